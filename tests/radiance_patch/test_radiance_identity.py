"""Without a light field in the scene the patched programs do what Radiance's own do, bit for bit.

build/test/stock holds the unpatched programs (stock.mk): what the patches touch is compiled without them, all else is one and
the same object.  Radiance seeds rough highlights and BSDFs with the address of a material, which is another in each program; with
uncorrelated sampling (-u+) all random numbers come from one generator, seeded by the clock: ours by -us, theirs by a clock that stands.
"""
import re
import subprocess

import numpy as np
import pytest

from conftest import BUILD, TOP, environment, run
from ilf_util import f32, random_directions
from process import execute
from rad_util import Cone, Polygon, Ring, Source, Sphere, oconv, rtrace
from test_radiance_di import GROUND, THINGS, VIEW, bsdf_file, things

STOCK = BUILD / "test" / "stock"
SEED = "7"
ALONE = {"ot/obj2mesh", "ot/init2otypes"}       # parts of programs that have no unpatched twin
CLOCK = {"LD_PRELOAD": str(STOCK / "clock.so"), "CLOCK": SEED}
LAMPS = ("\nvoid light bulb 0 0 3 30 20 10\n" + Sphere((0.5, -0.5, 1.5), 0.1).rad("bulb", "lamp")
         + "\nvoid spotlight beam 0 0 7 200 200 300 40 -.3 .2 -1\n" + Ring((0.9, -0.4, 1.4), (-0.3, 0.2, -1), 0, 0.05).rad("beam", "torch")
         + "\nvoid glow dusk 0 0 4 .1 .2 .4 0\n" + Source((0, 0, 1), 180).rad("dusk", "sky"))
SMOOTH = THINGS + "void plastic stone 0 0 5 .6 .5 .4 0 0\n"

# what a scene is of: its objects, whether a rough highlight or a BSDF is among them, options beside -ab 2
SCENES = {
    "smooth": (lambda folder: SMOOTH + GROUND + "".join(Sphere((0.35 * k - 0.7, 0, 0.15), 0.15).rad(m, m[0] + "_ball") for k, m in enumerate(
        ("stone", "chrome", "crystal", "glazed", "velvet"))), False, []),
    "mirrors": (lambda folder: SMOOTH + GROUND + Polygon((-0.6, 0.6, 0), (0.7, 0.5, 0), (0.7, 0.5, 0.7), (-0.6, 0.6, 0.7)).rad("looking", "back")
                + Polygon((-0.8, -0.5, 0), (-0.8, 0.5, 0), (-0.7, 0.5, 0.8), (-0.7, -0.5, 0.8)).rad("looking", "side")
                + Polygon((-0.2, -0.1, 0), (0.3, 0, 0), (0.3, 0, 0.4), (-0.2, -0.1, 0.4)).rad("pane", "window"), False, ["-dr", "2"]),
    "mist": (lambda folder: SMOOTH + GROUND + Sphere((0, 0, 0.15), 0.15).rad("stone", "ball")
             + "\nvoid mist fog 1 torch 0 7 .3 .3 .3 .8 .8 .7 .4\n" + Sphere((0.3, -0.1, 0.5), 0.9).rad("fog", "cloud"), False, ["-ms", ".2"]),
    "mesh and instance": (lambda folder: with_instances(folder, things(folder).rsplit("\n", 2)[-2]), False, []),
    "patterns": (lambda folder: "\nvoid brightfunc waves 2 1+.3*sin(20*Px) . 0 0\nwaves plastic wavy 0 0 5 .5 .5 .5 0 0\n"
                 "\nvoid texfunc bumps 4 .1*sin(30*Py) .1*cos(30*Px) 0 . 0 0\nbumps plastic bumpy 0 0 5 .5 .3 .3 .03 0\n" + SMOOTH
                 + GROUND.replace("grey", "wavy") + Sphere((0, 0, 0.2), 0.2).rad("bumpy", "ball")
                 + Cone((-0.5, 0, 0), (-0.5, 0, 0.5), 0.2, 0.05).rad("velvet", "cone"), False, []),
    "all materials": (things, True, ["-ss", "4"]),
    "BSDF": (lambda folder: bsdf_file(folder / "sheet.xml") or SMOOTH + GROUND
             + "\nvoid BSDF klems 6 0 sheet.xml 0 0 1 . 0 9 .1 .1 .2 .1 .1 .1 0 0 0\n" + Ring((0, 0, 0.3), (0.3, -0.5, 0.8), 0, 0.4).rad("klems", "disc"), True, []),
}


def with_instances(folder, mesh):
    """A mesh in the scene, and twice an octree with another in it."""
    (folder / "part.rad").write_text(SMOOTH + mesh + "\n" + Sphere((0.5, 0, 0.1), 0.1).rad("glazed", "bead"))
    (folder / "part.oct").write_bytes(run("oconv", "-f", "part.rad", cwd=folder).out)
    return (SMOOTH + GROUND + mesh + "\nvoid instance one 9 part.oct -rz 30 -s .8 -t -.5 0 0 0 0\nstone instance two 5 part.oct -t -.4 .4 .1 0 0\n")


@pytest.fixture(scope="module", params=SCENES)
def scene(request, tmp_path_factory):
    """The folder, and the options of the picture."""
    folder = tmp_path_factory.mktemp("identity")
    build, rough, options = SCENES[request.param]
    oconv(folder, build(folder) + LAMPS)
    return folder, rough, options


def both(folder, program, *args, stdin=b"", uncorrelated=False):
    """What ours and theirs put out, headers apart; theirs must not know our options, so that the one is not the other."""
    args = [*args, "scene.oct"]
    ours = run(program, *(["-us", SEED] if uncorrelated else ["-u-"]), *args, stdin=stdin, cwd=folder).out
    env = environment(**CLOCK)
    theirs = execute([str(STOCK / "bin" / program), "-u+" if uncorrelated else "-u-", *args], input=stdin, cwd=folder, env=env,
                     stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert theirs.returncode == 0, theirs.stderr
    return ours.split(b"\n\n", 1)[-1], theirs.stdout.split(b"\n\n", 1)[-1]


def view_rays(folder, w, h):
    return run("vwrays", "-ff", "-pa", "0", "-x", w, "-y", h, *VIEW, cwd=folder).out


def modes(rough):
    return (True,) if rough else (False, True)


def test_rpict(scene):
    folder, rough, options = scene
    for uncorrelated in modes(rough):
        for more in (["-ab", "2", "-ad", "32", "-as", "8"], ["-ab", "1", "-aa", "0", "-ad", "16", "-dj", "0.5"]):
            ours, theirs = both(folder, "rpict", *VIEW, "-x", "40", "-y", "30", *more, *options, uncorrelated=uncorrelated)
            assert len(ours) > 1000 and ours == theirs, (uncorrelated, more)


def test_rtrace(scene):
    """All that a ray can say of itself, as text; and irradiance."""
    folder, rough, options = scene
    text = "\n".join(" ".join(f"{x:.6g}" for x in r) for r in np.frombuffer(view_rays(folder, 12, 9), "<f4").reshape(-1, 6)) + "\n"
    for uncorrelated in modes(rough):
        for more in (["-oodvVlLpnNsmMwWcr", "-ab", "2", "-ad", "32", "-as", "8"], ["-I", "-ab", "2", "-ad", "64", "-aa", "0"]):
            ours, theirs = both(folder, "rtrace", "-h", *more, *options, stdin=text.encode(), uncorrelated=uncorrelated)
            assert ours.count(b"\n") >= 108 and ours == theirs, (uncorrelated, more)


def test_rcontrib(scene):
    folder, rough, options = scene
    for uncorrelated in modes(rough):
        for more in ([], ["-V+"]):
            ours, theirs = both(folder, "rcontrib", "-h", "-ff", "-ab", "2", "-ad", "64", "-lw", "1e-3", *more, *options, "-m", "bulb", "-m", "dusk",
                                stdin=view_rays(folder, 8, 6), uncorrelated=uncorrelated)
            assert np.frombuffer(ours, "<f4").any() and ours == theirs, (uncorrelated, more)


def test_octrees_are_those_of_the_other_oconv(scene):
    """Each reads the other's octree; frozen ones carry a list of all types, which is longer in ours."""
    folder, _, _ = scene
    env = environment()
    for frozen in ([], ["-f"]):
        ours = run("oconv", *frozen, "scene.rad", cwd=folder).out
        theirs = execute([str(STOCK / "bin" / "oconv"), *frozen, "scene.rad"], cwd=folder, stdout=subprocess.PIPE, env=env, check=True).stdout
        assert ours.split(b"\n\n", 1)[1].replace(b"\0ilf\0\0", b"\0\0") == theirs.split(b"\n\n", 1)[1]
    (folder / "theirs.oct").write_bytes(theirs)
    (folder / "ours.oct").write_bytes(ours)
    rng = np.random.default_rng(65)
    o, d = f32(rng.uniform((-1, -1, 0.1), (1, 1, 1), (300, 3))), f32(random_directions(rng, 300))
    a = rtrace(folder, "theirs.oct", o, d, "-us", SEED)
    assert np.array_equal(a, rtrace(folder, "ours.oct", o, d, "-us", SEED)) and a.max() > 0
    p = execute([str(STOCK / "bin" / "rtrace"), "-h", "-ab", "0", "-ff", "-u+", "ours.oct"], input=np.concatenate([o, d], 1).astype("<f4").tobytes(),
                cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment(**CLOCK))
    assert p.returncode == 0 and p.stdout == a.astype("<f4").tobytes(), p.stderr


def test_shared_objects_know_nothing_of_the_patches():
    """What is compiled once for both must not depend on what the patches put into headers."""
    version = "6.1" if "6.1" in (STOCK / "src" / "rt" / "VERSION").read_text() else "5.4a"
    folder = TOP / "radiance_patch" / version
    patches = [(folder / p).read_text() for p in (folder / "series").read_text().split()]
    added = []
    for header in re.findall(r"^\+\+\+ b/\S+\.h\n((?:[-+@ ].*\n)*)", "".join(patches), re.M):
        added += [a or b for a, b in re.findall(r"^[-+](?:#define\s+(\w+)|extern\s+\w+\s+(\w+))", header, re.M)]
    assert {"NUMOTYPE", "SILF", "dirparts", "rand_seed"} <= set(added)
    objects = {p.relative_to(STOCK / "obj").with_suffix("") for p in (STOCK / "obj").rglob("*.o")}
    assert len(objects) > 15
    words = re.compile(rb"\b(" + "|".join(sorted(set(added))).encode() + rb")\b")
    for folder in ("common", "rt", "ot"):
        for path in (STOCK / "src" / folder).glob("*.c"):
            name = path.relative_to(STOCK / "src").with_suffix("")
            if (BUILD / "radiance" / "obj" / name).with_suffix(".o").is_file() and name not in objects and str(name) not in ALONE:
                assert not words.search(path.read_bytes()), name
