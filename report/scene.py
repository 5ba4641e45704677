"""The three small scenes that the sweeps use, and what can be made of them.

studio: the demo's room with its two spotlights, table and objects.  The mirror ball is left out because Radiance does not follow a
lamp's light over a mirror to a matt surface in the reference, and because the few pixels in which it shows a lamp would outweigh
all others.  dapples: figure 12's lamp behind a branch.  lamps: the studio with small bare lamps.  Meshes have flat facets: where interpolated normals lean far from their
facets, blind rays and lamps do not agree in Radiance, with no light field at all.

All files lie under build/report and name each other by paths from the project's top, so that every command works there.

    photo      the room with its lamps and the objects: what is true
    stage      the room without the objects: what a camera on the plane sees
    mask       red = table, green = objects
    lit(...)   the objects in a light field, on auxiliary geometry of one's choice
"""
import os
import subprocess
from pathlib import Path

from . import run
from .run import OUT, PYTHON, TOP

PLANE = "-.381 -.381 0  .762 0 0  0 .762 0"
SIZE = tuple(int(x) for x in os.environ.get("REPORT_SIZE", "64x48").split("x"))
EXACT = "-as 0 -lw 1e-9 -ab 1 -aa 0"
# a light field's picture with little noise, for sweeps of everything but the renderer
FINE = "-ab 2 -aa .2 -as 64 -ar 32 -di 128 -ad 512"
# what the camera sees of the room: lamps as sources, indirect light cached
ROOM_LIGHT = "-ab 2 -aa .15 -ad 1024 -as 256 -ar 32 -ds .1 -dj .6 -dt 0 -dc 1"
# a lamp in the middles of its parts: Radiance divides a lamp into 64 at most, too few for jitter
PHOTO_LIGHT = "-ab 2 -aa .2 -ad 512 -as 64 -ar 32 -ds .03 -dj 0 -dt 0 -dc 1 -u+"
MODELS = f"{OUT}/models"
STATUE = (f"{PYTHON} scenes/models/statue.py --height .30 --cells 70 -o {MODELS}/statue.obj", "statue")
BRANCH = (f"{PYTHON} scenes/models/branch.py --length .6 --leaf .08 --seed 1 -o {MODELS}/branch.obj", "branch")


def written(path, text):
    """A generated file, touched only when its text changes."""
    file = TOP / path
    file.parent.mkdir(parents=True, exist_ok=True)
    if not file.is_file() or file.read_text() != text:
        file.write_text(text)
    return path


def both(name, command, label):
    """Two independent pictures by one command (with -u+, seeded by the second of the clock) and their mean as NAME.hdr."""
    names = [f"{name}_{k}.hdr" for k in "ab"]
    run.several([lambda n=n, k=k: run.run(command if k == 0 else f"sleep 1.5; {command}", n, f"{label}, half {k + 1}") for k, n in enumerate(names)])
    run.run(f"pcomb -s .5 {names[0]} -s .5 {names[1]}", f"{name}.hdr")
    return f"{name}.hdr", names


class Scene:
    """folder of its files; room and lamps: the auxiliary geometry; hidden: what the camera sees but the rendering knows nothing of."""

    def __init__(self, folder, view, room, lamps, objects, models, hidden=(), copies=(), without=(), edits=()):
        self.here, self.models, self.without, self.edits = f"{OUT}/{folder}", models, list(without), list(edits)
        self.view = f"-vf {view} -x {SIZE[0]} -y {SIZE[1]} -ps 1 -pj 0 -w"
        self.materials, self.table, self.masks = "scenes/demo/room_materials.rad", "scenes/demo/table.rad", "scenes/demo/mask_materials.rad"
        self.room, self.hidden = room, list(hidden)
        self.own_files = {}
        for path in copies:         # first those that others name
            self.own(path)
        self.lamps, self.objects = self.own(lamps), self.own(objects)
        self.hidden = [self.own(h) for h in hidden]
        self.mask, self.photo = f"{self.here}/mask.hdr", f"{self.here}/photo.hdr"

    def own(self, path):
        """A copy of a scene file in which further files have their paths from the top, and commands are carried out: xform, given
        a file with commands, looks for their files elsewhere."""
        text = "\n".join(x for x in (TOP / path).read_text().splitlines() if not any(w in x for w in self.without)) + "\n"
        for old, new in self.edits:
            text = text.replace(old, new)
        for name, whole in self.own_files.items():
            text = text.replace(f" {name}", f" {whole}")
        for _, name in self.models:
            text = text.replace(f" {name}.rtm", f" {MODELS}/{name}.rtm")
        for path_of in ("scenes/demo/spot.cal", "scenes/studio/profile.cal"):
            text = text.replace(f" {Path(path_of).name}", f" {path_of}").replace(f"\n{Path(path_of).name}", f"\n{path_of}")
        text = "".join(self.output(x[1:]) if x.startswith("!") else x + "\n" for x in text.splitlines())
        self.own_files[Path(path).name] = written(f"{self.here}/{Path(path).name}", text)
        return self.own_files[Path(path).name]

    @staticmethod
    def output(command):
        p = subprocess.run(["bash", "-euo", "pipefail", "-c", command], cwd=TOP, env=run.environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        if p.returncode or "cannot find" in p.stderr:
            raise run.ReportError(f"expected a scene from {command}, found: {p.stderr.strip()}")
        return p.stdout

    def prepare(self):
        """Makes what all sweeps of this scene share; returns the error of the photograph itself."""
        for text, name in self.models:
            run.run(text, f"{MODELS}/{name}.log", f"the mesh of the {name}")
            run.run(f"sed '/^vn/d; s,//[0-9]*,,g' {MODELS}/{name}.obj > {MODELS}/{name}_flat.obj && obj2mesh {MODELS}/{name}_flat.obj {MODELS}/{name}.rtm",
                    f"{MODELS}/{name}_mesh.log")
        room = " ".join([self.materials, self.room, self.lamps, *self.hidden])
        run.run(f"oconv -f {room} {self.table}", f"{self.here}/stage.oct")
        run.run(f"oconv -f {room} {self.table} {self.objects}", f"{self.here}/photo.oct")
        run.run(f"{{ cat {self.masks}; xform -m mask_table {self.table}; xform -m mask_objects {self.objects}; }} | oconv -f -", f"{self.here}/mask.oct")
        run.run(f"rpict {self.view} -ab 0 {self.here}/mask.oct", self.mask)
        # the room's indirect light as seen from the middle of the plane: every capture starts from a copy of it
        amb = f"{self.here}/stage.amb"
        run.run(f"rm -f {amb}; {PYTHON} -m report probes --octree {self.here}/stage.oct --plane '{PLANE}' --grid 1x1 --size 96x48 --refine 1 "
                f"--render-options '{ROOM_LIGHT} -af {amb}' -o {self.here}/overture", f"{self.here}/overture.log", "indirect light of the room")
        _, halves = both(f"{self.here}/photo", f"rpict {self.view} {PHOTO_LIGHT} {self.here}/photo.oct", "photograph")
        return self.split(halves)

    def split(self, halves):
        from . import measures
        a, b, mask = (measures.compare.read_finite(TOP / f) for f in (*halves, self.mask))
        return measures.split_error((a, b), mask)

    def measured(self, image, reference):
        """A row's command: the picture, and its error against the reference."""
        return f"{image} | {PYTHON} -m report measure --reference {reference} --mask {self.mask} -"

    def surfaces(self):
        """Auxiliary geometry that is the room itself."""
        return f"xform -m light {self.room} {self.lamps}"

    def lit(self, name, field, geometry=None, depth=True):
        """Octree NAME.oct of table and objects in the light field; geometry: shell text that writes surfaces of modifier `light`."""
        head = written(f"{name}.rad", f"void ilf light\n{1 if depth else 2} {field}{'' if depth else ' nodepth'}\n0\n0\n")
        run.run(f"{{ cat {self.materials} {head}; {geometry or self.surfaces()}; cat {self.table} {self.objects}; }} | oconv -f -", f"{name}.oct", reads=(field,))
        return f"{name}.oct"

    def field_text(self, n, size, name, options=""):
        """Shell text that makes NAME.ilf.exr, n x n probes by rays, float."""
        return (f"mkdir -p {name} && cp {self.here}/stage.amb {name}/room.amb && {PYTHON} -m report probes --octree {self.here}/stage.oct --plane '{PLANE}' "
                f"--grid {n}x{n} --size {size[0]}x{size[1]} {options} --render-options '{ROOM_LIGHT} -af {name}/room.amb' -o {name} && "
                f"{packed(name, n, f'{name}.ilf.exr')}")

    def field(self, n, size, options="", name=None):
        name = name or f"{self.here}/n{n}_{size[0]}x{size[1]}"
        run.run(self.field_text(n, size, name, options), f"{name}.log", f"light field {n}x{n} of {size[0]}x{size[1]}, by rays")
        return f"{name}.ilf.exr"

    def row(self, name, octree, options, against, own, label=None, before="", **more):
        """Renders NAME.hdr, measures it; the row of it.  before: shell text that makes the light field, for the row's command."""
        from . import measures
        command = f"rpict {self.view} {options} {octree}"
        cost = run.run(command, f"{name}.hdr", label)
        e = measures.of_files(TOP / f"{name}.hdr", TOP / against, TOP / self.mask)
        again = self.measured(command, against)
        return {"error": e["rmse"], "y": e["rmse"], "ssim": e["ssim"], "measure": measures.RMSE, "reference_error": own, "cpu_s": cost["cpu_s"],
                "peak_mb": cost["peak_mb"], "command": f"{before} && {again}" if before else again, **more}


def packed(folder, n, out, more="--type float"):
    return f"ilfpack --quiet --grid {n}x{n} --plane '{PLANE}' {more} -o {out} {folder}/p_*.exr"


def studio():
    d = "scenes/demo"
    return Scene("studio", f"{d}/view.vf", f"{d}/room.rad", f"{d}/lamps.rad", f"{d}/objects.rad", [STATUE],
                 copies=[f"{d}/lamp_yellow.rad", f"{d}/lamp_blue.rad"], without=["mirror_ball", "chrome"])


def lamps():
    """The studio with small lamps that shine alike in all directions: light that varies little over the plane, but comes from near."""
    d = "scenes/demo"
    return Scene("lamps", f"{d}/view.vf", f"{d}/room.rad", f"{d}/lamps.rad", f"{d}/objects.rad", [STATUE],
                 copies=[f"{d}/lamp_yellow.rad", f"{d}/lamp_blue.rad"], without=["mirror_ball", "chrome"],
                 edits=[("yellow_beam light", "void light"), ("blue_beam light", "void light"), ("!xform -ry", "!xform -s .4 -ry"),
                        ("620 400 130", "3900 2500 810"), ("150 270 560", "940 1700 3500")])


def dapples():
    d = "scenes/figure12"
    return Scene("dapples", f"{d}/view.vf", "scenes/demo/room.rad", f"{d}/lamps.rad", f"{d}/objects.rad", [STATUE, BRANCH],
                 hidden=[f"{d}/branch.rad"], copies=[f"{d}/lamp.rad", f"{d}/branch_up.rad"])
