"""What a light field shades is a light source whatever shows it: any surface, through aliases, mixtures and antimatter,
in instances, nested, turned and mirrored.  Irradiance against the oracle's integral, within 5 standard errors (see
test_radiance_di.py), with so few blind rays that the literal method would not come near.
"""
import gzip

import numpy as np
import pytest

from conftest import run, shared_case
from ilf_util import f32, random_directions, unit, write_ilf
from rad_util import Cone, Mesh, Moved, Polygon, Ring, Sphere, Surface, material, matrix, numbers, oconv, rtrace
from render_scene import LUMINANCE
from test_radiance_di import EXACT, ROOM, DARK, WALLS, check_irradiance, integral, points_and_normals

DI = ["-di", "16", "-ad", "256"]
PLACED = ROOM.placed(ROOM.origin, ROOM.U, ROOM.V)
DOME = Sphere((0, 0, 0.5), 3.5)
OCTAHEDRON = Mesh(5.5 * np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]) + (0, 0, 0.5),
                  [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)])


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    folder = tmp_path_factory.mktemp("surfaces")
    write_ilf(folder / "room.ilf.exr", ROOM)
    write_ilf(folder / "dark.ilf.exr", DARK)
    OCTAHEDRON.build(folder)
    return folder


def says_nothing(folder, octree):
    """No word about the literal method while the light field is met by rays of all kinds."""
    r = run("rtrace", "-h", "-I", "-ab", "1", "-aa", "0", "-ad", "64", "-di", "4", octree, cwd=folder, stdin="0 0 .1 0 0 1\n" * 4)
    assert r.err == ""
    return r


def check(folder, text, surfaces, name, seed=60, n=2, spread=(0.4, 0.4), height=(0.02, 0.3), copies=32):
    octree = oconv(folder, text, name)
    x, normals = points_and_normals(np.random.default_rng(seed), n, spread, height)
    says_nothing(folder, octree)
    check_irradiance(folder, octree, surfaces, x, normals, *DI, copies=copies)


ENV = material("env", "room.ilf.exr", PLACED, 9)
SHAPES = {
    "mesh": OCTAHEDRON, "cone": Cone((0, 0, -3), (0, 0, 4.5), 3.5, 1), "cup": Cone((0, 0, -3), (0, 0, 4.5), 3.5, 1, "cup"),
    "cylinder": Cone((0, 0, -3), (0, 0, 4.5), 3, kind="cylinder"), "tube": Cone((0, 0, -3), (0, 0, 4.5), 3, kind="tube"),
    "ring": Ring((0, 0, 2.9), (0, 0, 1), 0, 8), "bubble": Sphere((0, 0, 0.5), 3.5, "bubble"), "polygon": Polygon(*WALLS[0].p * (3, 3, 1)),
}


@pytest.mark.parametrize("name", SHAPES)
def test_any_surface_is_a_light_source(room, name):
    check(room, ENV + SHAPES[name].rad("env", "it"), [Surface(SHAPES[name], ROOM)], name)


CHAINS = {     # text between the material and the surface, and the surface's modifier
    "alias": ("void alias same env\n", "same"),
    "alias of an alias": ("void alias a env\nvoid alias b a\n", "b"),
    "alias with a pattern": ("void brightfunc one\n2 one half.cal\n0\n0\none alias same env\n", "same"),
    "alias with a pattern of an alias": ("void brightfunc one\n2 one half.cal\n0\n0\none alias a env\none alias b a\n", "b"),
    "mixture with itself": ("void mixfunc mix\n4 env env .3 half.cal\n0\n0\n", "mix"),
    "alias of a mixture": ("void mixfunc mix\n4 env env .3 half.cal\n0\n0\nvoid alias other mix\n", "other"),
    "mixture of aliases": ("void alias a env\nvoid alias b env\nvoid mixfunc mix\n4 a b c half.cal\n0\n0\n", "mix"),
}


@pytest.mark.parametrize("shape, name", [*(("sphere", n) for n in CHAINS), ("mesh", "alias with a pattern"), ("mesh", "mixture of aliases")])
def test_through_other_modifiers(room, name, shape):
    (room / "half.cal").write_text("c = if(sin(40*Px), .9, .1);\none = 1;\n")
    text, modifier = CHAINS[name]
    s = DOME if shape == "sphere" else OCTAHEDRON
    check(room, ENV + text + s.rad(modifier, "it"), [Surface(s, ROOM)], f"chain_{shape}_{name.replace(' ', '_')}")


def test_mixture_of_two_light_fields(room):
    """Each by its share; and with void, behind which is the other one."""
    (room / "share.cal").write_text("share = .3;\n")
    both = ENV + material("dim", "dark.ilf.exr", DARK.placed(DARK.origin, DARK.U, DARK.V), 9)
    x, normals = points_and_normals(np.random.default_rng(61), 3, (0.4, 0.4), (0.02, 0.3))
    for name, text in {
        "two": both + "void mixfunc mix\n4 env dim share share.cal\n0\n0\n" + DOME.rad("mix", "it"),
        "behind": both + "void mixfunc mix\n4 env void share share.cal\n0\n0\n" + DOME.rad("mix", "it") + Sphere((0, 0, 0.5), 5).rad("dim", "far"),
    }.items():
        octree = oconv(room, text, "mix_" + name)
        says_nothing(room, octree)
        got = rtrace(room, octree, np.repeat(x, 48, 0), np.repeat(normals, 48, 0), "-I", *EXACT, *DI, literal=False).reshape(3, 48, 3)
        for k in range(3):
            bright = integral([Surface(DOME, ROOM)], x[k], unit(normals[k]))
            dim = integral([Surface(DOME if name == "two" else Sphere((0, 0, 0.5), 5), DARK)], x[k], unit(normals[k]))
            truth = .3 * bright + .7 * dim
            error = got[k].std(0, ddof=1) / np.sqrt(48)
            assert (np.abs(got[k].mean(0) - truth) < 5 * error + 3e-3 * truth).all(), (name, k, got[k].mean(0), truth, error)
            assert (error < 0.02 * truth).all()


MOVES = {"as it is": "", "turned": "-rx 20 -t .1 .2 -.1", "mirrored": "-mx -rz 40", "scaled": "-s 1.5 -mz -ry 10"}


@pytest.mark.parametrize("move, reals", [("as it is", 0), ("mirrored", 0), ("turned", 9), ("scaled", 9), ("mirrored", 12)])
def test_inside_an_instance(room, move, reals):
    M = matrix(MOVES[move].split())
    name = f"{move.replace(' ', '_')}{reals}"
    g = PLACED if reals == 9 else ROOM if reals == 0 else ROOM.placed(ROOM.origin, ROOM.U, ROOM.V, np.cross(ROOM.U, ROOM.V))
    oconv(room, material("env", "room.ilf.exr", g, reals) + DOME.rad("env", "dome"), "inner_" + name)
    n = 1 + len(MOVES[move].split())
    octree = oconv(room, f"void instance it\n{n} inner_{name}.oct {MOVES[move]}\n0\n0\n", "inst_" + name)
    says_nothing(room, octree)
    x, normals = points_and_normals(np.random.default_rng(63), 2, (0.4, 0.4), (0.02, 0.3))
    x, normals = f32(x @ M[:3, :3].T + M[:3, 3]), f32(unit(normals @ M[:3, :3].T))
    check_irradiance(room, octree, [Surface(DOME, ROOM).moved(M)], x, normals, *DI, copies=32)


@pytest.mark.parametrize("frozen", [False, True], ids=["files", "frozen"])
def test_instance_in_an_instance_and_a_mesh_in_it(room, frozen):
    one, two = "-rx 15 -s 1.2 -mx", "-rz 30 -t .1 0 .1"
    f = ["-f"] if frozen else []
    oconv(room, ENV + OCTAHEDRON.rad("env", "it"), "deep", *f)
    oconv(room, f"void instance a\n{1 + len(one.split())} deep.oct {one}\n0\n0\n", "middle", *f)
    text = f"void instance b\n{1 + len(two.split())} middle.oct {two}\n0\n0\n"
    M = matrix(two.split()) @ matrix(one.split())
    check(room, text, [Surface(OCTAHEDRON, ROOM).moved(M)], "nested", n=2)


def test_one_octree_in_two_places(room):
    """Two light sources with one file: halves of a room, each the other's mirror image."""
    half = Polygon((0.0, -9, -9), (0, 9, -9), (0, 9, 9), (0, -9, 9))
    left, right = "-t -2.5 0 0", "-mx -t 2.5 0 0"
    oconv(room, ENV + half.rad("env", "wall"), "wall")
    text = "".join(f"void instance {n}\n{1 + len(m.split())} wall.oct {m}\n0\n0\n" for n, m in (("l", left), ("r", right)))
    check(room, text, [Surface(half, ROOM).moved(matrix(m.split())) for m in (left, right)], "two_places")


def test_material_given_to_an_instance_is_a_light_source(room):
    oconv(room, DOME.rad("void", "dome"), "bare")
    move = "-rx 50 -t 0.2 0 0"
    moved = Moved(DOME, matrix(move.split()))
    check(room, ENV + f"env instance it\n{1 + len(move.split())} bare.oct {move}\n0\n0\n", [Surface(moved, ROOM)], "given")


def test_antimatter_cuts_a_light_field(room):
    """A hole in the dome, with dim light behind it: both methods agree."""
    dim = material("dim", "dark.ilf.exr", DARK.placed(DARK.origin, DARK.U, DARK.V), 9)
    text = (ENV + dim + "void antimatter hole\n2 void env\n0\n0\n" + DOME.rad("env", "dome")
            + Sphere((0, 0, 4), 2.5).rad("hole", "cut") + Sphere((0, 0, 0), 9).rad("dim", "far"))
    octree = oconv(room, text, "anti")
    o, n = f32(np.tile((0, 0, 0.1), (64, 1))), f32(np.tile((0, 0, 1), (64, 1)))
    both = [rtrace(room, octree, o, n, "-I", *EXACT, "-di", d, "-ad", a, literal=False) for d, a in ((0, 16384), (16, 256))]
    error = np.hypot(*(b.std(0, ddof=1) / 8 for b in both))
    assert (both[0].mean(0) > 0).all()
    assert (np.abs(both[0].mean(0) - both[1].mean(0)) < 5 * error).all(), [b.mean(0) for b in both]


@pytest.mark.parametrize("substitute", ["illum", "mirror"])
def test_substitutes_are_no_sources(room, substitute):
    """An illum or a mirror decides which rays may see its substitute: -di changes nothing about it."""
    reals = "3 1 1 1" if substitute == "illum" else "3 .5 .5 .5"
    window = Polygon((-1, -1, 2), (-1, 1, 2), (1, 1, 2), (1, -1, 2))
    sky = Sphere((0, 0, 0.5), 6)
    for extra in ("", sky.rad("env", "sky")):           # alone, and with a surface that is a light source
        text = ENV + f"void {substitute} s\n1 env\n0\n{reals}\n" + window.rad("s", "window") + extra
        octree = oconv(room, text, f"sub_{substitute}{len(extra)}")
        o, n = f32(np.tile((0, 0, 0.1), (64, 1))), f32(np.tile((0, 0, 1), (64, 1)))
        both = [rtrace(room, octree, o, n, "-I", *EXACT, "-di", d, "-ad", a, literal=False) for d, a in ((0, 16384), (16, 256))]
        error = np.hypot(*(b.std(0, ddof=1) / 8 for b in both))
        assert (np.abs(both[0].mean(0) - both[1].mean(0)) < 5 * error + 1e-6).all(), [b.mean(0) for b in both]
        seen = [rtrace(room, octree, o[:1], n[:1], "-ab", "0", "-di", d, literal=False) for d in (0, 16)]
        assert (seen[0] == seen[1]).all() and seen[0].any()


def test_octree_that_does_not_tell_is_rendered_literally_with_a_word(room):
    """One that an older oconv wrote: right in the mean, and said once."""
    oconv(room, ENV + DOME.rad("env", "dome"), "told")
    data = (room / "told.oct").read_bytes()
    assert data.count(b"ILF= in scene\n") == 1
    (room / "untold.oct").write_bytes(data.replace(b"ILF= in scene\n", b""))
    octree = oconv(room, "void instance it\n1 untold.oct\n0\n0\n", "outer")
    stdin = "0 0 .1 0 0 1\n" * 3
    r = run("rtrace", "-h", "-I", "-ab", "1", "-ad", "4096", "-as", "0", "-aa", "0", "-lw", "1e-7", octree, cwd=room, stdin=stdin)
    words = [x for x in r.err.splitlines() if "no light sources found" not in x]
    assert len(words) == 1 and "literal method" in words[0] and '"env"' in words[0] and "octree" in words[0], r
    assert "literal" not in run("rtrace", "-h", "-I", "-ab", "1", "-di", "0", octree, cwd=room, stdin=stdin).err
    x, normals = points_and_normals(np.random.default_rng(62), 2, (0.4, 0.4), (0.02, 0.3))
    check_irradiance(room, octree, [Surface(DOME, ROOM)], x, normals, "-ad", "4096", aimed=False, copies=32)


def test_more_places_than_we_sample_are_said(room):
    chip = Polygon((0, 0, 0), (0.1, 0, 0), (0.1, 0.1, 0), (0, 0.1, 0))
    oconv(room, ENV + chip.rad("env", "chip"), "chip")
    octree = oconv(room, "".join(f"void instance i{k}\n5 chip.oct -t {k % 9} {k // 9} 2\n0\n0\n" for k in range(80)), "many")
    r = run("rtrace", "-h", "-I", "-ab", "1", "-ad", "1024", octree, cwd=room, stdin="0 0 .1 0 0 1\n")
    assert r.err.count("literal method") == 1 and len(r.err.splitlines()) == 1


def test_octrees_without_light_fields_are_as_ever(room):
    (room / "plain.rad").write_text("void plastic grey\n0\n0\n5 .5 .5 .5 0 0\n" + Sphere((0, 0, 0), 1).rad("grey", "ball"))
    data = run("oconv", "plain.rad", cwd=room).out
    assert data.split(b"\n")[2:4] == [b"FORMAT=Radiance_octree", b""]


def test_same_picture_on_a_mesh_as_on_its_triangles(tmp_path):
    """cases/mesh_literal: closed surface, lamp shadows.  Errors are those of the luminance, by which directions are drawn."""
    case = shared_case("mesh_literal")
    for f in ("ilf.rad", "mesh.rad", "objects.rad", "room.ilf.exr", "sph.rtm", "dummy.rad"):
        (tmp_path / f).write_bytes((case / f).read_bytes())
    (tmp_path / "triangles.rad").write_bytes(gzip.decompress((case / "triangles.rad.gz").read_bytes()))
    o, n = np.tile(f32((0, 0, .01)), (64, 1)), np.tile(f32((0, 0, 1)), (64, 1))
    got = {}
    for name, parts in (("triangles", ["triangles.rad"]), ("mesh", ["mesh.rad"]), ("dummy", ["mesh.rad", "dummy.rad"])):
        (tmp_path / f"{name}.oct").write_bytes(run("oconv", "ilf.rad", *parts, "objects.rad", cwd=tmp_path).out)
        got[name] = rtrace(tmp_path, f"{name}.oct", o, n, "-I", *EXACT, *DI, literal=False)
    blind = rtrace(tmp_path, "mesh.oct", o, n, "-I", *EXACT, "-di", "0", "-ad", "256", literal=False)
    for name in ("mesh", "dummy"):
        error = np.hypot(*(got[k].std(0, ddof=1) / 8 for k in ("triangles", name)))
        assert (np.abs(got[name].mean(0) - got["triangles"].mean(0)) < 5 * error).all(), name
        assert (got[name] @ LUMINANCE).std(ddof=1) < (blind @ LUMINANCE).std(ddof=1) / 2, f"{name} not sampled"
