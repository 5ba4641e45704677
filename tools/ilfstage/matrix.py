"""The matrix from a stage's channels to what shall match, by Radiance, once per stage.

    C[s, c, l]   irradiance (R, G, B) at sensor s of lamp l with 1 W/sr: rcontrib, a shadow ray to each lamp (and light reflected by `scene`)
    A[s, c, k]   the same of channel k at full drive: C times its R, G, B, or the irradiance in the light field that was measured of it
    seen[s, b]   whether sensor s of a mesh sees its surroundings in direction bin b, past the mesh itself

It is kept in a file with a digest of all that it came from.
"""
import hashlib
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import lamps, radiance
from .errors import Bad
from .match import even

RULES = 1       # a number that changes with what is computed, so that kept matrices are computed again
BINS = 4096
OPTIONS = "-I -V+ -di 0 -dt 0 -dc 1 -dj 0 -ds .1 -st 0 -lr 0 -lw 1e-9 -u-".split()


@dataclass(eq=False)
class Matrix:
    """A: (s, 3, k) W/m2, or W/(sr m2) of a mesh, at full drive; seen: (s, BINS) bool or None; fresh: whether it was computed now."""
    A: np.ndarray
    seen: np.ndarray | None
    fresh: bool


def bins():
    """Directions of a mesh's map of what it sees, (BINS, 3)."""
    return even(BINS)


def write_subject(folder, match):
    if match.mesh is None:
        return []
    radiance.write_mesh(folder / "subject.obj", *match.mesh)
    radiance.run("obj2mesh", "subject.obj", "subject.rtm", cwd=folder)
    (folder / "subject.rad").write_text(f"void plastic subject 0 0 5 {radiance.row(match.factor * np.pi)} 0 0\nsubject mesh body 1 subject.rtm 0 0\n")
    return ["subject.rad"]


def lend(folder, source):
    """What stands beside a scene, its meshes and function files, under the same names in `folder`, where none stands yet."""
    for path in source.iterdir():
        if not (folder / path.name).exists():
            (folder / path.name).symlink_to(path)


def contributions(folder, stage, lights, match, subject):
    """C, (s, 3, lamps)."""
    lamps.write(folder, lights)
    names = "".join(f"L{k}\n" for k in range(len(lights)))
    (folder / "names").write_text(names)
    others = []
    if stage.scene:
        moved = ["-s", f"{stage.unit:.9g}"] if stage.unit != 1 else []
        (folder / "scene.rad").write_bytes(radiance.run("xform", "-e", *moved, stage.scene.resolve(), cwd=stage.scene.parent))
        others = ["scene.rad"]
        lend(folder, stage.scene.resolve().parent)
    octree = radiance.oconv(folder, "stage.oct", "lights.rad", *others, *subject)
    bounced = ["-ab", stage.bounces, "-ad", 1024] if stage.bounces else ["-ab", 0]
    out = radiance.run("rcontrib", "-h", "-us", 1, "-fdf", *OPTIONS, *bounced, "-M", "names", octree, cwd=folder,
                       data=radiance.rays(match.points, match.normals))
    return np.frombuffer(out, np.float32).reshape(len(match.points), len(lights), 3).astype(float).transpose(0, 2, 1)


def sight(folder, match, subject):
    """seen, (s, BINS)."""
    octree = radiance.oconv(folder, "subject.oct", *subject)
    d, seen = bins(), []
    for part in np.array_split(np.arange(len(match.points)), max(1, len(match.points) // 64)):
        data = radiance.rays(match.points[part, None], d[None])
        far = np.frombuffer(radiance.run("rtrace", "-h", "-w", "-fdf", "-oL", "-ab", 0, "-di", 0, octree, cwd=folder, data=data), np.float32)
        seen.append(far.reshape(len(part), BINS) > 1e9)
    return np.concatenate(seen)


def digest(stage, match):
    """Of everything that the matrix comes from, Radiance's own programs among it."""
    h = hashlib.sha256(f"{RULES} {OPTIONS} {stage.unit} {stage.bounces}".encode())
    for program in ("rcontrib", "rtrace"):
        h.update(hashlib.sha256(radiance.found(program).read_bytes()).digest())
    for path in (stage.path, *stage.reads):
        h.update(hashlib.sha256(Path(path).read_bytes()).digest())
    if stage.scene:     # what it reads in its turn
        h.update(radiance.run("xform", "-e", stage.scene.resolve(), cwd=stage.scene.parent))
    for a in (match.points, match.normals, match.factor, *(match.mesh or ())):
        h.update(np.ascontiguousarray(a).tobytes())
    return h.hexdigest()


def computed(stage, match, measured):
    """A Matrix.  measured(channel): irradiance (s, 3) of a measured channel."""
    with tempfile.TemporaryDirectory(prefix="ilfstage") as name:
        folder = Path(name)
        subject = write_subject(folder, match)
        lights = [light for light in stage.lights if light.fixture is not None]
        C = contributions(folder, stage, lights, match, subject) if lights else None
        seen = sight(folder, match, subject) if subject else None
    columns, number = [], {id(light): k for k, light in enumerate(lights)}
    for light in stage.lights:
        for c in light.channels:
            E = C[:, :, number[id(light)]] * c.rgb if light.fixture is not None else measured(c, seen)
            columns.append(E * match.factor)
    return Matrix(np.stack(columns, -1), seen, True)


def kept(path, key):
    """The Matrix in a file, None if it came from something else or there is none."""
    try:
        with np.load(path, allow_pickle=False) as f:
            return Matrix(f["A"], f["seen"] if "seen" in f else None, False) if str(f["digest"]) == key else None
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as e:
        raise Bad(f"{path}: expected a matrix that ilfstage wrote, found another file ({type(e).__name__})") from None


def of(stage, match, measured, path=None):
    """The matrix of a stage: from `path` if it holds it, else computed, and kept there.  Raises Bad."""
    key = digest(stage, match)
    found = kept(path, key) if path else None
    if found is None:
        found = computed(stage, match, measured)
        if path:
            from .outputs import whole
            with whole(path, "wb") as f:
                np.savez(f, A=found.A, digest=np.array(key), **({} if found.seen is None else {"seen": found.seen}))
    return found
