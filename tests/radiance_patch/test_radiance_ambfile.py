"""Ambient files are bound to their light fields (ilf(7), AMBIENT FILES): to -di 0 or not, to the values, to the place.

What is refused leaves the file as it was; what is not gives the same value as before.
"""
import re
import subprocess

import numpy as np
import pytest

from conftest import command, environment, run, shared_case
from ilf_util import f32, random_ilf, write_ilf
from process import Process
from rad_util import Mesh, Sphere, material, numbers, oconv
from test_radiance_di import DARK, ROOM, WALLS

AMB = ["-ab", "1", "-aa", ".2", "-ad", "256", "-as", "0", "-lw", "1e-6"]
POINT = "0 0 .01 0 0 1\n"
DOME = Sphere((0, 0, 0.5), 3.5)


@pytest.fixture()
def room(tmp_path):
    write_ilf(tmp_path / "room.ilf.exr", ROOM)
    write_ilf(tmp_path / "dark.ilf.exr", DARK)
    return tmp_path


def scene(folder, name="s", depth=None, place=ROOM, file="room.ilf.exr", reals=9):
    return oconv(folder, material("env", file, place, reals, depth) + DOME.rad("env", "dome"), name)


def made(folder, octree, di=16, *options, file="a.amb", stdin=POINT):
    (folder / file).unlink(missing_ok=True)
    return used(folder, octree, di, *options, file=file, stdin=stdin)


def used(folder, octree, di=16, *options, file="a.amb", stdin=POINT):
    r = run("rtrace", "-h", "-w", "-I+", *AMB, "-di", di, *options, "-af", file, octree, cwd=folder, stdin=stdin)
    return np.array(r.text.split(), float)


def refused(folder, octree, di=16, *words, file="a.amb", program="rtrace"):
    before = (folder / file).read_bytes()
    view = ["-vf", "v.vf", "-x", "4", "-y", "4"]
    (folder / "v.vf").write_text("rvu -vtv -vp 0 0 .1 -vd 0 1 0 -vu 0 0 1\n")
    options = ["-h", "-w", "-I+"] if program == "rtrace" else ["-w", *view]
    r = run(program, *options, *AMB, "-di", di, "-af", file, octree, cwd=folder, stdin=POINT, code=1)
    lines = [x for x in r.err.splitlines() if " 0 rays" not in x]       # rpict's own report
    assert len(lines) == 1 and file in r.err and "remove it" in r.err, r
    for w in words:
        assert w in r.err, r
    assert (folder / file).read_bytes() == before
    return r.err


# ---- -di -------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("first", [0, 1, 16])
@pytest.mark.parametrize("then", [0, 1, 16])
def test_the_kind_of_di(room, first, then):
    octree = scene(room)
    made(room, octree, first)
    if bool(first) == bool(then):
        size = (room / "a.amb").stat().st_size
        assert used(room, octree, then).all()
        assert (room / "a.amb").stat().st_size == size, "the value in the file was not used"
    else:
        refused(room, octree, then, "room.ilf.exr", "-di 0" if then else "-di above 0")
        refused(room, octree, then, "room.ilf.exr", program="rpict")


def test_the_case_itself(tmp_path):
    """cases/ambfile_di: E is 3.954 3.958 3.959 either way, and neither file serves the other way."""
    case = shared_case("ambfile_di")
    for f in ("scene.rad", "room.ilf.exr"):
        (tmp_path / f).write_bytes((case / f).read_bytes())
    point = (case / "point.txt").read_text()
    octree = oconv(tmp_path, (tmp_path / "scene.rad").read_text(), "s")
    for first, then in ((0, 16), (16, 0)):
        got = made(tmp_path, octree, first, "-ad", "4096", stdin=point)
        assert np.allclose(got, (3.954, 3.958, 3.959), rtol=0.05)   # of 16 samples
        refused(tmp_path, octree, then)


# ---- what makes the same light field --------------------------------------------------------------------------------

STORAGE = {"half": (True, "none"), "half zip": (True, "zip"), "float": (False, "none"), "float zips": (False, "zips"),
           "half piz": (True, "piz"), "float rle": (False, "rle")}


@pytest.mark.parametrize("storage", STORAGE)
def test_storage_does_not_count(tmp_path, storage):
    f = random_ilf(np.random.default_rng(70), 3, 2, 16, 8, half=True, plane=((-.5, -.5, 0), (1, 0, 0), (0, 1, 0)))
    half, compression = STORAGE[storage]
    write_ilf(tmp_path / "room.ilf.exr", f, True)
    first = made(tmp_path, scene(tmp_path, place=f))
    write_ilf(tmp_path / "room.ilf.exr", f, half, compression)
    assert np.allclose(used(tmp_path, "s.oct"), first, rtol=0.1)
    write_ilf(tmp_path / "other name.ilf.exr".replace(" ", "_"), f, half, compression)
    assert np.allclose(used(tmp_path, scene(tmp_path, "t", place=f, file="other_name.ilf.exr")), first, rtol=0.1)


def test_interleaved_is_the_same(tmp_path):
    f = random_ilf(np.random.default_rng(71), 2, 2, 16, 8, plane=((-.5, -.5, 0), (1, 0, 0), (0, 1, 0)))
    import OpenEXR
    names = []
    for k, (j, i) in enumerate((j, i) for j in range(2) for i in range(2)):
        names.append(f"p{k}.exr")
        OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": f.probes[j, i].astype(np.float32)}).write(str(tmp_path / names[-1]))
    for k, more in enumerate(([], ["--interleave"])):
        run("ilfpack", "--grid", "2x2", "--plane", "-.5 -.5 0 1 0 0 0 1 0", "--type", "float", *more, "-o", "room.ilf.exr", *names, cwd=tmp_path)
        octree = scene(tmp_path, place=f)
        assert (used if k else made)(tmp_path, octree).all()


@pytest.mark.parametrize("where", [(0, 0, 0, 0, 0), (-1, -1, -1, -1, 2), (3, 4, 11, 20, 1)])
def test_one_texel_counts(room, where):
    made(room, scene(room))
    data = ROOM.probes.copy()
    data[where] = np.nextafter(np.float32(data[where]), np.float32(np.inf))
    g = random_ilf(np.random.default_rng(0), *ROOM.probes.shape[1::-1], *ROOM.probes.shape[3:1:-1], plane=(ROOM.origin, ROOM.U, ROOM.V))
    g.probes, g.polar_max = data, ROOM.polar_max
    write_ilf(room / "room.ilf.exr", g)
    refused(room, "s.oct", 16, "room.ilf.exr", "changed")


def test_probes_in_another_order_are_another_field(room):
    made(room, scene(room))
    g = ROOM.placed(ROOM.origin, ROOM.U, ROOM.V)
    g.probes = ROOM.probes[:, ::-1]
    write_ilf(room / "room.ilf.exr", g)
    refused(room, "s.oct", 16, "room.ilf.exr")


@pytest.mark.parametrize("what", ["origin", "scaled", "turned", "other side", "nodepth"])
def test_the_place_counts(room, what):
    made(room, scene(room))
    c, s = np.cos(.01), np.sin(.01)
    U, V, N = ROOM.U, ROOM.V, np.cross(ROOM.U, ROOM.V)
    g = {"origin": ROOM.placed(ROOM.origin + (.01, 0, 0), U, V), "scaled": ROOM.placed(ROOM.origin, U * 1.01, V * 1.01),
         "turned": ROOM.placed(ROOM.origin, U * c + V * s, V * c - U * s), "other side": ROOM.placed(ROOM.origin, U, V, -N),
         "nodepth": ROOM}[what]
    octree = scene(room, "t", depth=False if what == "nodepth" else None, place=g, reals=12 if what == "other side" else 9)
    refused(room, octree, 16, "room.ilf.exr", "depth" if what == "nodepth" else "place")


def test_the_same_place_in_other_words(room):
    """Header's plane, 9 reals, 12 reals, frozen, through xform there and back."""
    first = made(room, scene(room))
    g = ROOM.placed(ROOM.origin, ROOM.U, ROOM.V, np.cross(ROOM.U, ROOM.V) * 7)
    assert np.allclose(used(room, scene(room, "t", place=g, reals=12)), first, rtol=0.1)
    assert np.allclose(used(room, scene(room, "t", reals=0)), first, rtol=0.1)
    text = material("env", "room.ilf.exr", ROOM, 9) + DOME.rad("env", "dome")
    assert np.allclose(used(room, oconv(room, text, "t", "-f")), first, rtol=0.1)
    there = run("xform", "-rx", "33", "-t", "1", "2", "3", stdin=text.encode(), cwd=room).out
    back = run("xform", "-t", "-1", "-2", "-3", "-rx", "-33", stdin=there, cwd=room).text
    assert np.allclose(used(room, oconv(room, back, "t")), first, rtol=0.1)


def test_two_light_fields(room):
    env, dim = material("env", "room.ilf.exr", ROOM, 9), material("dim", "dark.ilf.exr", DARK, 9)
    walls = [w.rad("env" if k % 2 else "dim", f"w{k}") for k, w in enumerate(WALLS)]
    a, b = oconv(room, env + dim + "".join(walls), "a"), oconv(room, dim + env + "".join(walls[::-1]), "b")
    only = oconv(room, env + DOME.rad("env", "dome"), "only")
    first = made(room, a)
    assert np.allclose(used(room, b), first, rtol=0.1)
    assert "dark.ilf.exr" in refused(room, only, 16)
    made(room, only)
    assert "dark.ilf.exr" in refused(room, a, 16)
    idle = oconv(room, env + dim + DOME.rad("env", "dome"), "idle")    # defined, on no surface
    assert used(room, idle).all()
    write_ilf(room / "dark.ilf.exr", ROOM)          # only one of them changed
    made(room, a, 16, file="b.amb")
    write_ilf(room / "dark.ilf.exr", DARK)
    assert "dark.ilf.exr" in refused(room, a, 16, file="b.amb")


def test_in_instances_and_on_meshes(room):
    text = material("env", "room.ilf.exr", ROOM, 9)
    oconv(room, text + DOME.rad("env", "dome"), "inner")
    outer = [oconv(room, f"void instance i\n4 inner.oct -t {t} 0\n0\n0\n".replace("4 inner.oct -t", "5 inner.oct -t"), f"o{k}")
             for k, t in enumerate(("0 0", "0.1 0"))]
    for di in (0, 16):
        made(room, outer[0], di)
        assert used(room, outer[0], di).all()
        refused(room, outer[1], di, "place")
        refused(room, outer[0], 16 - di, "-di")
    mesh = Mesh(9 * np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]),
                [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]).build(room)
    octree = oconv(room, text + mesh.rad("env", "it"), "mesh")
    made(room, octree, 0)
    refused(room, octree, 16, "-di")


# ---- files of others ------------------------------------------------------------------------------------------------

PLAIN = "void glow bright\n0\n0\n4 1 2 3 0\n" + Sphere((0, 0, 0.5), 3.5, "bubble").rad("bright", "dome")


def test_scenes_without_light_fields(room):
    plain = oconv(room, PLAIN, "plain")
    assert np.allclose(made(room, plain), np.pi * np.array([1, 2, 3]), rtol=0.1)
    assert b"LIGHTFIELD" not in (room / "a.amb").read_bytes()
    assert used(room, plain, 0).all() and used(room, plain, 16).all()
    refused(room, scene(room), 16, "without light fields")
    refused(room, scene(room), 0, "without light fields", program="rpict")
    made(room, "s.oct")
    refused(room, plain, 16, "room.ilf.exr")


@pytest.mark.parametrize("line", ["", "LIGHTFIELD= sampled depth\n", "LIGHTFIELD= perhaps depth 0 0 0 0 0 0 0 0 0 0 + x\n", "LIGHTFIELD=\n"])
def test_lines_that_we_do_not_understand(room, line):
    octree = scene(room)
    made(room, octree)
    data = (room / "a.amb").read_bytes()
    (room / "a.amb").write_bytes(re.sub(rb"LIGHTFIELD=[^\n]*\n", line.encode(), data))
    refused(room, octree, 16)
    refused(room, octree, 0)


def test_not_an_ambient_file(room):
    octree = scene(room)
    (room / "a.amb").write_bytes(b"nothing of the kind\n")
    r = run("rtrace", "-h", "-w", "-I+", *AMB, "-af", "a.amb", octree, cwd=room, stdin=POINT, code=1)
    assert "bad ambient file" in r.err or "bad/incompatible ambient file" in r.err


def test_through_lookamb_and_back(room):
    octree = scene(room)
    made(room, octree)
    text = run("lookamb", "a.amb", cwd=room).out
    assert b"LIGHTFIELD= sampled" in text
    plain = run("lookamb", "-d", "a.amb", cwd=room).out
    (room / "b.amb").write_bytes(run("lookamb", "-d", "-r", cwd=room, stdin=plain).out)
    assert used(room, octree, file="b.amb").all()
    refused(room, octree, 0, file="b.amb")


# ---- programs and processes -------------------------------------------------------------------------------------------

FLOOR = "void plastic grey\n0\n0\n5 .5 .5 .5 0 0\ngrey polygon floor\n0\n0\n12 -2 -2 0 2 -2 0 2 2 0 -2 2 0\n"


def test_programs_share_a_file(room):
    octree = oconv(room, FLOOR + material("env", "room.ilf.exr", ROOM, 9) + DOME.rad("env", "dome"), "s")
    view = ["-vtl", "-vp", "0", "0", "1", "-vd", "0", "0", "-1", "-vu", "0", "1", "0", "-vh", "3", "-vv", "3", "-x", "8", "-y", "8"]
    run("rpict", "-w", *view, *AMB, "-af", "a.amb", octree, cwd=room)
    size = (room / "a.amb").stat().st_size
    grid = "".join(f"{x} {y} .5 0 0 -1\n" for x in (-1, 0, 1) for y in (-1, 0, 1))
    one = run("rtrace", "-h", "-w", *AMB, "-af", "a.amb", octree, cwd=room, stdin=grid).text
    two = run("rtrace", "-h", "-w", "-n", "2", *AMB, "-af", "a.amb", octree, cwd=room, stdin=grid).text
    assert len(one.splitlines()) == len(two.splitlines()) == 9
    assert (room / "a.amb").stat().st_size >= size
    for v in "-V+", "-V-":      # rcontrib keeps no ambient values
        assert "not opened" in run("rcontrib", "-h-", v, "-m", "env", *AMB, "-af", "a.amb", octree, cwd=room, stdin=grid).err
    refused(room, octree, 0)


def test_processes_at_the_same_time(room):
    """Four add to one file; it stays whole and all of one kind."""
    octree = oconv(room, FLOOR + material("env", "room.ilf.exr", ROOM, 9) + DOME.rad("env", "dome"), "s")
    used(room, octree)
    args = command("rtrace", ["-h", "-w", "-n", "2", *AMB, "-aa", ".1", "-af", "a.amb", octree])
    ps = [Process(args, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=room, env=environment())
          for _ in range(4)]
    for k, p in enumerate(ps):
        rays = "".join(f"{x:.3f} {y:.3f} .5 0 0 -1\n" for x, y in np.random.default_rng(k).uniform(-1.5, 1.5, (60, 2)))
        out, err = p.communicate(rays.encode())
        assert p.returncode == 0 and len(out.splitlines()) == 60 and not err, err
    text = run("lookamb", "a.amb", cwd=room).text
    assert text.count("LIGHTFIELD=") == 1 and text.count("Position:") > 4
    refused(room, octree, 0)


def test_without_an_ambient_file_nothing_is_asked(room):
    octree = scene(room)
    values = [np.array(run("rtrace", "-h", "-w", "-I+", *AMB, "-di", d, octree, cwd=room, stdin=POINT).text.split(), float) for d in (0, 16)]
    assert np.allclose(*values, rtol=0.3)
