"""The description of a stage: a TOML file (man/ilfstage.1, THE STAGE FILE), read and checked.

What comes out is in metres and W/sr, whatever the file's unit is.  Names and keys that are not known are refused, never passed over.
"""
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import ies, spectrum
from .errors import Bad

UNITS = {"m": 1., "cm": .01, "mm": .001, "in": .0254, "ft": .3048}
SLOTS = 512


@dataclass(eq=False)
class Channel:
    """One drive value: what it may be, how it is coded, and what it sends.

    rgb : (3,) W/sr in the beam's brightest direction at full drive (None of a measured one)
    low, high : range of the light's own output, as a part of full drive
    gamma : output = drive value ** gamma
    slot : (universe, first address), counted from 1
    """
    light: str
    name: str
    rgb: np.ndarray | None
    low: float
    high: float
    gamma: float
    bits: int
    slot: tuple = (1, 1)
    place: np.ndarray | None = None
    source: Path | None = None

    @property
    def slots(self):
        """Bytes on the wire: coarse, and fine above 8 bits."""
        return 1 if self.bits <= 8 else 2

    @property
    def title(self):
        return f"{self.light}.{self.name}"


@dataclass(frozen=True, eq=False)
class Fixture:
    """A kind of lamp.  size: (diameter,) of a round face or (width, height), metres; power: of its cosine, or beam: an ies.Beam."""
    size: tuple
    power: float
    beam: ies.Beam | None
    channels: tuple

    @property
    def area(self):
        return np.pi / 4 * self.size[0] ** 2 if len(self.size) == 1 else self.size[0] * self.size[1]


@dataclass(eq=False)
class Light:
    """A lamp at its place; a measured one has channels alone.  position: metres; axis, up: unit vectors at right angles."""
    name: str
    channels: list
    fixture: Fixture | None = None
    position: np.ndarray | None = None
    axis: np.ndarray | None = None
    up: np.ndarray | None = None


@dataclass(eq=False)
class Stage:
    path: Path
    unit: float
    lights: list
    scene: Path | None = None
    bounces: int = 0
    reads: list = field(default_factory=list)   # further files that it names

    @property
    def channels(self):
        return [c for light in self.lights for c in light.channels]


class Table:
    """A table of the file: keys are taken one by one, and what is left over in the end is refused."""

    def __init__(self, path, title, values):
        if not isinstance(values, dict):
            raise Bad(f"{path}: {title}: expected a table, found {values!r:.40}")
        self.path, self.title, self.values = path, title, dict(values)

    def bad(self, words):
        return Bad(f"{self.path}: {self.title + ': ' if self.title else ''}{words}")

    def take(self, key, kind, what, default=None, needed=False):
        if key not in self.values:
            if needed:
                raise self.bad(f"expected {key} ({what}), found none")
            return default
        value = self.values.pop(key)
        if isinstance(value, bool) or not isinstance(value, kind):
            raise self.bad(f"{key}: expected {what}, found {value!r:.60}")
        return value

    def number(self, key, low, high, default=None, needed=False, whole=False):
        what = f"a {'whole ' if whole else ''}number from {low:g} to {high:g}"
        value = self.take(key, int if whole else (int, float), what, default, needed)
        if value is not None and not low <= value <= high:
            raise self.bad(f"{key}: expected {what}, found {value:g}")
        return value

    def vector(self, key, counts, default=None, needed=False):
        what = " or ".join(str(n) for n in counts) + " finite numbers in brackets"
        value = self.take(key, list, what, None, needed)
        if value is None:
            return default
        if len(value) not in counts or not all(isinstance(x, (int, float)) and not isinstance(x, bool) and np.isfinite(x) for x in value):
            raise self.bad(f"{key}: expected {what}, found {value!r:.60}")
        return np.array(value, float)

    def tables(self, key):
        return self.take(key, list, f"tables [[{key}]]", [])

    def end(self):
        if self.values:
            raise self.bad(f"expected no key '{next(iter(self.values))}', found one")


class Reader:
    """A stage file on its way in."""

    def __init__(self, path, bits):
        self.path, self.bits, self.reads = path, bits, []
        try:
            self.top = Table(path, "", tomllib.loads(path.read_text()))
        except OSError as e:
            raise Bad(f"{path}: can't be opened: {e.strerror}") from None
        except UnicodeDecodeError:
            raise Bad(f"{path}: expected a text, found other bytes") from None
        except tomllib.TOMLDecodeError as e:
            raise Bad(f"{path}: expected TOML (numbers begin with a digit: 0.1), found: {' '.join(str(e).split())}") from None
        unit = self.top.take("unit", str, "a unit of length", "m")
        if unit not in UNITS:
            raise self.top.bad(f"unit: expected {', '.join(UNITS)}, found '{unit}'")
        self.unit = UNITS[unit]

    def file(self, name):
        path = Path(name)
        path = path if path.is_absolute() else self.path.parent / path
        if not path.is_file():
            raise Bad(f"{self.path}: expected the file {path}, found none")
        self.reads.append(path)
        return path

    def stage(self):
        fixtures = {name: self.fixture(Table(self.path, f"fixture {name}", v))
                    for name, v in self.top.take("fixture", dict, "tables [fixture.NAME]", {}).items()}
        lights = [self.light(k, v, fixtures) for k, v in enumerate(self.top.tables("light"), 1)]
        lights += [self.measured(k, v) for k, v in enumerate(self.top.tables("measured"), 1)]
        scene = self.top.take("scene", str, "a scene file")
        stage = Stage(self.path, self.unit, lights, scene and self.file(scene), self.top.number("bounces", 0, 8, 0, whole=True), self.reads)
        self.top.end()
        if not stage.channels:
            raise Bad(f"{self.path}: expected lights, found an empty stage")
        seen = set()
        for light in lights:
            if light.name in seen:
                raise Bad(f"{self.path}: expected one light of each name, found two '{light.name}'")
            seen.add(light.name)
        return stage

    # ---- lamps ----

    def fixture(self, t):
        size = t.vector("size", (1, 2)) if isinstance(t.values.get("size"), list) else t.number("size", 1e-6, 1e6, needed=True)
        size = tuple(np.atleast_1d(size).astype(float) * self.unit)
        if min(size) <= 0:
            raise t.bad(f"size: expected lengths above 0, found {min(size) / self.unit:g}")
        power, beam = self.beam(t, t.take("beam", str, '"cosine POWER" or "ies FILE"', "cosine 1"))
        channels = tuple(self.channel(Table(self.path, f"{t.title}, channel {name}", v), name, beam)
                         for name, v in t.take("channel", dict, "tables [fixture.NAME.channel.NAME]", {}).items())
        t.end()
        if not channels:
            raise t.bad("expected a channel or more, found none")
        return Fixture(size, power, beam, channels)

    def beam(self, t, text):
        kind, _, what = text.partition(" ")
        if kind == "ies" and what:
            return 1., ies.read(self.file(what.strip()))
        try:
            power = float(what) if kind == "cosine" else -1
        except ValueError:
            power = -1
        if not 0 <= power <= 1e4:
            raise t.bad(f"beam: expected \"cosine POWER\" (0 to 10000) or \"ies FILE\", found '{text[:40]}'")
        return power, None

    def channel(self, t, name, beam):
        given = [k for k in ("rgb", "spectrum") if k in t.values]
        if len(given) != 1:
            raise t.bad(f"expected rgb or spectrum, found {' and '.join(given) or 'neither'}")
        if t.values.get("rgb") == "ies":
            if beam is None:
                raise t.bad('rgb: expected three numbers where the beam is no IES file, found "ies"')
            t.values["rgb"] = [beam.greatest / spectrum.WHITE_EFFICACY] * 3
        rgb = t.vector("rgb", (3,)) if given == ["rgb"] else spectrum.read(self.file(t.take("spectrum", str, "a file")))
        if given == ["rgb"] and (rgb.min() < 0 or rgb.max() == 0):
            raise t.bad("rgb: expected three numbers of 0 or more, not all 0, found " + " ".join(f"{x:g}" for x in rgb))
        return self.coded(t, "", name, rgb)

    def coded(self, t, light, name, rgb):
        """The keys of all channels: range, gamma, bits."""
        low, high = t.vector("range", (2,), np.array([0., 1.]))
        if not 0 <= low < high <= 1:
            raise t.bad(f"range: expected two numbers that rise, from 0 to 1, found {low:g} {high:g}")
        gamma, bits = t.number("gamma", .2, 5, 1.), t.number("bits", 8, 16, self.bits, whole=True)
        t.end()
        return Channel(light, name, rgb, float(low), float(high), float(gamma), bits)

    # ---- where they are ----

    def named(self, t, what, k):
        name = t.take("name", str, "a word", needed=True)
        if not name or any(c.isspace() or c in ",\"" for c in name):
            raise t.bad(f"name: expected a word without blanks, commas and quotes, found '{name}'")
        t.title = f"{what} {name}"
        return name

    def light(self, k, values, fixtures):
        t = Table(self.path, f"light number {k}", values)
        name, kind = self.named(t, "light", k), t.take("fixture", str, "a fixture's name", needed=True)
        if kind not in fixtures:
            raise t.bad(f"fixture: expected one of {', '.join(fixtures) or 'none'}, found '{kind}'")
        position = t.vector("position", (3,), needed=True)
        if ("aim" in t.values) == ("direction" in t.values):
            raise t.bad(f"expected aim or direction, found {'both' if 'aim' in t.values else 'neither'}")
        axis = t.vector("aim", (3,)) - position if "aim" in t.values else t.vector("direction", (3,))
        axis, up = self.axes(t, axis, t.vector("up", (3,)))
        channels = self.addressed(t, [Channel(name, c.name, c.rgb, c.low, c.high, c.gamma, c.bits) for c in fixtures[kind].channels])
        t.end()
        return Light(name, channels, fixtures[kind], position * self.unit, axis, up)

    def axes(self, t, axis, up):
        length = np.linalg.norm(axis)
        if not length:
            raise t.bad("expected a direction, found 0 0 0")
        axis = axis / length
        if up is None:
            up = np.array([0, 0, 1.]) if abs(axis[2]) < .999 else np.array([0, 1., 0])
        across = np.cross(axis, up)
        if np.linalg.norm(across) < 1e-6 * max(np.linalg.norm(up), 1e-300):
            raise t.bad("up: expected another direction than the light's own, found the same")
        up = np.cross(across, axis)
        return axis, up / np.linalg.norm(up)

    def measured(self, k, values):
        t = Table(self.path, f"measured number {k}", values)
        name = self.named(t, "measured", k)
        source, place = self.file(t.take("field", str, "a light field or a probe", needed=True)), t.vector("place", (3,))
        slot = t.values.pop("dmx", None)
        c = self.coded(t, name, "level", None)
        c.source, c.place = source, None if place is None else place
        t.values = {} if slot is None else {"dmx": slot}
        return Light(name, self.addressed(t, [c]))

    def addressed(self, t, channels):
        """Channels with slots beginning where dmx says ("UNIVERSE.ADDRESS"); (0, 0) where it does not."""
        text = t.take("dmx", str, '"UNIVERSE.ADDRESS"')
        at = (0, 0)
        if text is not None:
            words = text.split(".")
            at = tuple(int(w) for w in words) if len(words) == 2 and all(w.isdigit() for w in words) else (0, 0)
            if not (1 <= at[0] <= 32768 and 1 <= at[1] and at[1] + sum(c.slots for c in channels) - 1 <= SLOTS):
                raise t.bad(f"dmx: expected \"UNIVERSE.ADDRESS\" with room for {sum(c.slots for c in channels)} slots up to {SLOTS}, found '{text}'")
        for c in channels:
            c.slot = at
            at = (at[0], at[1] + c.slots) if at != (0, 0) else at
        return channels


def give_addresses(stage):
    """Slots for lights that have none: behind all others, a light never in two universes.  Raises Bad where two overlap."""
    universe = max([c.slot[0] for c in stage.channels] + [0]) + 1
    address = 1
    for light in stage.lights:
        if light.channels[0].slot != (0, 0):
            continue
        n = sum(c.slots for c in light.channels)
        if n > SLOTS:
            raise Bad(f"{stage.path}: light {light.name}: expected channels that fit a universe of {SLOTS} slots, found {n}")
        if address + n - 1 > SLOTS:
            universe, address = universe + 1, 1
        for c in light.channels:
            c.slot = (universe, address)
            address += c.slots
    taken = {}
    for c in stage.channels:
        for k in range(c.slots):
            at = (c.slot[0], c.slot[1] + k)
            if at in taken:
                raise Bad(f"{stage.path}: expected one channel at DMX slot {at[0]}.{at[1]}, found {taken[at]} and {c.title}")
            taken[at] = c.title
    return stage


def read(path, bits=16):
    """A Stage; raises Bad.  bits: of a drive value where the file does not say."""
    return give_addresses(Reader(Path(path), bits).stage())
