"""The command line: one table drives parsing and --help; its words and looks are those of the toolchain's programs in C (common/base/cli.h)."""
import math
import textwrap
from dataclasses import dataclass, field

from . import PROGRAM
from .errors import Usage

WIDTH, TEXT_AT = 80, 28


def numbers(least, most=None):
    """A reader of some finite numbers in one word."""
    def read(text):
        try:
            values = [float(w) for w in text.split()]
        except ValueError:
            values = []
        if not least <= len(values) <= (most or least) or not all(map(math.isfinite, values)):
            raise ValueError(f"{least} numbers" if not most else f"{least} to {most} numbers")
        return values
    return read


def between(low, high, whole=False):
    """A reader of one number."""
    what = f"a {'whole ' if whole else ''}number from {low:g} to {high:g}"

    def read(text):
        try:
            value = int(text) if whole else float(text)
        except ValueError:
            raise ValueError("a whole number" if whole else what) from None
        if not low <= value <= high:
            raise ValueError(what)
        return value
    return read


def one_of(*words):
    def read(text):
        if text not in words:
            raise ValueError(" or ".join(words))
        return text
    return read


def auto_or(read):
    def read_word(text):
        return text if text == "auto" else read(text)
    return read_word


def volume(text):
    """"W D H NxMxK": edges of a box and points along them."""
    words = text.split()
    try:
        edges, counts = [float(w) for w in words[:3]], [int(w) for w in words[3].split("x")]
    except (ValueError, IndexError):
        edges, counts = [], []
    if len(words) != 4 or len(counts) != 3 or not all(map(math.isfinite, edges)) or min(edges) < 0 or min(counts) < 1 or math.prod(counts) > 1000:
        raise ValueError("\"W D H NxMxK\", at most 1000 points")
    return edges, counts


@dataclass(frozen=True)
class Option:
    name: str
    value: str          # what stands for its value in --help; "": a switch
    text: str
    read: object = str
    default: object = None
    letter: str = ""


TABLE = [
    Option("output", "DRIVE.csv", "write the drive values, a row a frame, a column for each channel", letter="o"),
    Option("dmx", "FILE", "write the frames as packets, ready to be sent"),
    Option("protocol", "artnet|sacn", "what the packets are (default: artnet)", one_of("artnet", "sacn"), "artnet"),
    Option("report", "FILE.json", "write errors, their bounds, and what can't be reached and why"),
    Option("errors", "FILE.csv", "write what was wanted and what is reached, for each frame, point and direction"),
    Option("picture", "FILE.png", "draw the wanted and the reproduced light on a ball, and on --mesh or --show, for some frames"),
    Option("at", "PLACE", 'where the subject stands in the field, "X Y Z [HEADING]" (default: the middle of its plane)', numbers(3, 4)),
    Option("path", "FILE", 'path of the subject: lines "seconds x y z [heading]"'),
    Option("fps", "N", "frames a second along the path (default: 25)", between(.01, 1000), 25.),
    Option("smooth", "SECONDS", "drive values follow the path as slowly as this (default 0: each frame by itself)", between(0, 1000), 0.),
    Option("normals", "N", "directions of the ball whose irradiance is matched (default: 162)", between(12, 5000, True), 162),
    Option("volume", "BOX", 'match at N x M x K points of a box about the subject, not at one: "W D H NxMxK"', volume),
    Option("mesh", "FILE.obj", "match what points of this mesh reflect, its own shadows on it", str),
    Option("reflectance", "RGB", 'of the mesh, "R G B" (default: .5 .5 .5)', numbers(3), [.5, .5, .5]),
    Option("samples", "N", "points of the mesh (default: 300)", between(10, 5000, True), 300),
    Option("camera", '"X Y Z"', "what faces away from this direction counts a tenth", numbers(3)),
    Option("geometry", "FILE.oct", "surroundings of the light field, for its depth correction (default: infinitely far away)"),
    Option("exposure", "auto|X", "factor from the field's light to the stage's; auto: what the lights can just do (default: 1)",
           auto_or(between(1e-12, 1e12)), 1.),
    Option("noise", "PERCENT", "how far the stage may be from what is computed of it (default: 2)", between(0, 50), 2.),
    Option("ridge", "auto|X", "regularisation, as a part of each channel's own effect (default: auto, the least that --noise asks for)",
           auto_or(between(1e-9, 1)), "auto"),
    Option("few", "N", "use N of the lights at most", between(1, 100000, True)),
    Option("bits", "N", "of a drive value, where the stage does not say (default: 16)", between(8, 16, True), 16),
    Option("matrix", "FILE.npz", "keep what is computed of the stage here, and take it from here as long as nothing has changed"),
    Option("show", "FILE.obj", "a mesh to draw, where none is matched"),
    Option("quiet", "", "no remarks", letter="q"),
    Option("threads", "N", "threads to use at most (default 0: one per core)", between(0, 1024, True), 0),
    Option("help", "", "print this text and exit"),
    Option("version", "", "print name and version and exit"),
]
SUMMARY = "Find drive values for the lights of a stage that light a subject as a captured light field would."
NOTES = "Lengths are in the stage's unit, which is the light field's, too. Text about the result goes to standard output."


@dataclass
class Given:
    """What the command line says: values by option name, and the two files."""
    values: dict = field(default_factory=dict)
    files: list = field(default_factory=list)

    def __getattr__(self, name):
        return self.values[name]


def help_text():
    lines = [f"Usage: {PROGRAM} [OPTION]... STAGE.toml FIELD.ilf.exr", *textwrap.wrap(SUMMARY, WIDTH), "", "Options:"]
    for o in TABLE:
        head = ("  -" + o.letter + ", " if o.letter else "      ") + "--" + o.name + (" " + o.value if o.value else "")
        text = textwrap.wrap(o.text, WIDTH - TEXT_AT, break_on_hyphens=False)
        if len(head) < TEXT_AT - 1:
            head = head.ljust(TEXT_AT) + text.pop(0)
        lines += [head, *(" " * TEXT_AT + t for t in text)]
    return "\n".join([*lines, "", *textwrap.wrap(NOTES, WIDTH)]) + "\n"


def value_of(option, text):
    try:
        return option.read(text)
    except ValueError as e:
        raise Usage(f"option --{option.name}: expected {e}, found '{text}'") from None


def parse(words):
    """Given, from the words of a command line; raises Usage."""
    by_name, given = {o.name: o for o in TABLE}, Given({o.name: o.default if o.value else False for o in TABLE})
    words = list(words)
    while words:
        word = words.pop(0)
        if word == "--":
            given.files += words
            break
        if not word.startswith("-") or word == "-":
            given.files.append(word)
            continue
        short = next((o.name for o in TABLE if o.letter == word[1:2]), "")
        name, equals, text = word[2:].partition("=") if word.startswith("--") else (short, "", "")
        o = by_name.get(name)
        if o is None:
            raise Usage(f"unknown option {word.partition('=')[0]}")
        attached = "" if word.startswith("--") else word[2:]
        if not o.value:
            if equals or attached:
                raise Usage(f"option --{name}: expected no value, found '{text or attached}'")
            given.values[name] = True
            continue
        if not equals and not attached:
            if not words:
                raise Usage(f"option --{name}: expected a value ({o.value}), found none")
            text = words.pop(0)
        given.values[name] = value_of(o, text or attached)
    return given


def check(given):
    """What can't go together; raises Usage."""
    if len(given.files) != 2:
        raise Usage(f"expected a stage and a light field, found {len(given.files)} files")
    for a, b in (("at", "path"), ("mesh", "volume"), ("mesh", "show")):
        if given.values[a] is not None and given.values[b] is not None:
            raise Usage(f"expected --{a} or --{b}, found both")
    if given.camera is not None and not any(given.camera):
        raise Usage("option --camera: expected a direction, found 0 0 0")
    if min(given.reflectance) < 0 or max(given.reflectance) > 1 or not any(given.reflectance):
        raise Usage("option --reflectance: expected numbers from 0 to 1, not all 0, found " + " ".join(f"{x:g}" for x in given.reflectance))
