"""The scene that the sweeps share: the demo's studio with its two spotlights, small, without the mirror ball.

The mirror ball is left out because Radiance does not follow a lamp's light over a mirror to a matt surface in the reference, and
because the few pixels in which it shows a lamp would outweigh all others.  All files lie under build/report/scene and
name each other by paths from the project's top, so that every command works there.

    photo      the room with its lamps and the objects: what is true
    stage      the room without the objects: what a camera on the plane sees
    mask       red = table, green = objects
    lit(...)   the objects in a light field, on auxiliary geometry of one's choice
"""
import os
from pathlib import Path

from . import run
from .run import OUT, PYTHON, TOP

SCENES = "scenes/demo"
HERE = f"{OUT}/scene"
PLANE = "-.381 -.381 0  .762 0 0  0 .762 0"
SIZE = tuple(int(x) for x in os.environ.get("REPORT_SIZE", "64x48").split("x"))
VIEW = f"-vf {SCENES}/view.vf -x {SIZE[0]} -y {SIZE[1]} -ps 1 -pj 0 -w"
EXACT = "-as 0 -lw 1e-9 -ab 1 -aa 0"
# what the camera sees of the room: lamps as sources, one bounce and a half cached
ROOM_LIGHT = "-ab 2 -aa .15 -ad 1024 -as 256 -ar 32 -ds .1 -dj .6 -dt 0 -dc 1"
PHOTO_LIGHT = "-ab 2 -aa .12 -ad 1024 -as 256 -ar 64 -ds .03 -dj .8 -dt 0 -dc 1 -u+"
MASK, PHOTO, PROBES = f"{HERE}/mask.hdr", f"{HERE}/photo.hdr", f"{OUT}/fields"


def written(path, text):
    """A generated file, touched only when its text changes."""
    file = TOP / path
    file.parent.mkdir(parents=True, exist_ok=True)
    if not file.is_file() or file.read_text() != text:
        file.write_text(text)
    return path


def own(name, replace=(), without=()):
    """A copy of one of the demo's scene files that names further files by their paths from the top."""
    lines = [x for x in (TOP / SCENES / name).read_text().splitlines() if not any(w in x for w in without)]
    text = "\n".join(lines) + "\n"
    for a, b in replace:
        text = text.replace(a, b)
    return written(f"{HERE}/{name}", text)


def parts():
    lamp = [("spot.cal", f"{SCENES}/spot.cal")]
    lamps = [own("lamp_yellow.rad", lamp), own("lamp_blue.rad", lamp)]
    lights = own("lamps.rad", [(Path(p).name, p) for p in lamps])
    objects = own("objects.rad", [("statue.rtm", f"{HERE}/statue.rtm")], ["mirror_ball", "chrome"])
    return {"materials": f"{SCENES}/room_materials.rad", "room": f"{SCENES}/room.rad", "lamps": lights,
            "table": f"{SCENES}/table.rad", "objects": objects, "mask": f"{SCENES}/mask_materials.rad"}


def measured(image, reference, mask=MASK):
    """The words that end a row's command: the picture on standard input against the reference."""
    return f"{image} | {PYTHON} -m report measure --reference {reference} --mask {mask} -"


def both(name, command):
    """Two independent pictures by one command (with -u+, seeded by the second of the clock) and their mean as NAME.hdr."""
    names = [f"{HERE}/{name}_{k}.hdr" if "/" not in name else f"{name}_{k}.hdr" for k in "ab"]
    mean = f"{HERE}/{name}.hdr" if "/" not in name else f"{name}.hdr"
    run.several([lambda n=n, k=k: run.run(command if k == 0 else f"sleep 1.5; {command}", n, f"reference {n}") for k, n in enumerate(names)])
    run.run(f"pcomb -s .5 {names[0]} -s .5 {names[1]}", mean)
    return mean, names


def prepare():
    """Makes everything that the sections share; returns the parts of the scene."""
    p = parts()
    run.run(f"{PYTHON} scenes/models/statue.py --height .30 --cells 70 -o {HERE}/statue.obj", f"{HERE}/statue.log", "the statue's mesh")
    run.run(f"obj2mesh {HERE}/statue.obj", f"{HERE}/statue.rtm")
    room = f"{p['materials']} {p['room']} {p['lamps']}"
    run.run(f"oconv -f {room} {p['table']}", f"{HERE}/stage.oct")
    run.run(f"oconv -f {room} {p['table']} {p['objects']}", f"{HERE}/photo.oct")
    run.run(f"{{ cat {p['mask']}; xform -m mask_table {p['table']}; xform -m mask_objects {p['objects']}; }} | oconv -f -", f"{HERE}/mask.oct")
    run.run(f"rpict {VIEW} -ab 0 {HERE}/mask.oct", MASK)
    both("photo", f"rpict {VIEW} {PHOTO_LIGHT} {HERE}/photo.oct")
    return p


def surfaces(p):
    """Auxiliary geometry that is the room itself."""
    return f"xform -m light {p['room']} {p['lamps']}"


def lit(p, name, field, geometry=None, depth=True):
    """An octree of table and objects in the light field `field`; geometry: shell text that writes surfaces of modifier `light`."""
    head = written(f"{name}.rad", f"void ilf light\n{1 if depth else 2} {field}{'' if depth else ' nodepth'}\n0\n0\n")
    text = f"{{ cat {p['materials']} {head}; {geometry or surfaces(p)}; cat {p['table']} {p['objects']}; }} | oconv -f -"
    run.run(text, f"{name}.oct")
    return f"{name}.oct"


def grid(n, size, options="", name=None):
    """Shell text that makes a light field of n x n ideal probes, and the file's name."""
    name = name or f"{PROBES}/n{n}_{size[0]}x{size[1]}"
    text = (f"{PYTHON} -m report probes --octree {HERE}/stage.oct --plane '{PLANE}' --grid {n}x{n} --size {size[0]}x{size[1]} {options} "
            f"--render-options '{ROOM_LIGHT} -af {HERE}/stage.amb' -o {name} && {packed(name, n, f'{name}.ilf.exr')}")
    return text, f"{name}.ilf.exr"


def packed(folder, n, out, more="--type float"):
    return f"ilfpack --quiet --grid {n}x{n} --plane '{PLANE}' {more} -o {out} {folder}/p_*.exr"


def field(n, size, options="", name=None):
    """Makes that light field (its capture's cost beside it)."""
    text, out = grid(n, size, options, name)
    cost = run.run(text, f"{out.removesuffix('.ilf.exr')}.log", f"light field {n}x{n} of {size[0]}x{size[1]}, by rays")
    return out, text, cost
