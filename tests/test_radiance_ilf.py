"""The material ilf in Radiance (contract, section 3): every renderer and scene tool, against the numpy oracle."""
import re

import numpy as np
import pytest

from conftest import BUILD, environment, run, run_measured
from ilf_util import (ILF, MIRROR_ARRAY_VALID, PI, POLAR_MAX, assert_same, directional_ilf, edited, f32, random_directions,
                      random_ilf, sparse_ilf, unit, write_ilf)
from rad_util import (LITERAL, Cone, Mesh, Polygon, Ring, Source, Sphere, Surface, clear, material, matrix, numbers, oconv,
                      read_picture, rtrace, scene_value)

RENDERERS = ["rpict", "rtrace", "rcontrib"]


def file_and_ilf(folder, rng, grid=(4, 3), texels=(12, 8), kind="hemisphere", half=False, name="room", **more):
    f = random_ilf(rng, *grid, *texels, kind, half, **more)
    write_ilf(folder / f"{name}.ilf.exr", f, half)
    return f, f"{name}.ilf.exr"


def rays_about(rng, f, n, spread=0.5):
    """Float32 rays from about the plane, in all directions."""
    middle = f.origin + f.U / 2 + f.V / 2
    return f32(middle + rng.normal(size=(n, 3)) * spread), f32(random_directions(rng, n))


def compare(folder, octree, surfaces, o, d, rng, least=0.1, *options):
    """rtrace against the oracle, where no rounding decides what is hit."""
    expected = scene_value(surfaces, o, d)
    good = clear(surfaces, o, d, rng)
    assert good.mean() > 0.97
    assert (expected[good] > 0).all(1).mean() > least, "the rays miss what is tested"
    assert_same(rtrace(folder, octree, o, d, *options)[good], expected[good])


# ---- the surfaces of the scene -------------------------------------------------------------------------

GRIDS = {
    "1x1": ((1, 1), (16, 8), "hemisphere", False),
    "1x4": ((1, 4), (12, 7), "sphere", False),
    "3x1": ((3, 1), (9, 5), "185deg", False),
    "2x2": ((2, 2), (16, 16), "hemisphere", False),
    "5x7": ((5, 7), (10, 6), "sphere", False),
    "30x30": ((30, 30), (8, 4), "hemisphere", False),
    "half": ((4, 3), (20, 10), "185deg", True),
}


@pytest.mark.parametrize("depth", [None, True, False], ids=["default", "depth", "nodepth"])
@pytest.mark.parametrize("case", GRIDS)
def test_rtrace_agrees(tmp_path, case, depth):
    grid, texels, kind, half = GRIDS[case]
    rng = np.random.default_rng(sum(case.encode()))
    f, file = file_and_ilf(tmp_path, rng, grid, texels, kind, half)
    s = Surface(Sphere((0.5, 0.2, -0.1), 5), f, depth is not False)
    octree = oconv(tmp_path, material("room", file, depth=depth) + s.shape.rad("room", "dome"))
    compare(tmp_path, octree, [s], *rays_about(rng, f, 20000), rng, 0.4)


def test_rtrace_polar_valid(tmp_path):
    rng = np.random.default_rng(40)
    f, file = file_and_ilf(tmp_path, rng, polar_valid=MIRROR_ARRAY_VALID)
    s = Surface(Sphere((0, 0, 0), 4), f)
    compare(tmp_path, oconv(tmp_path, material("room", file) + s.shape.rad("room", "dome")), [s], *rays_about(rng, f, 5000), rng)


OCTAHEDRON = ([(6, 0, 0), (-6, 0, 0), (0, 6, 0), (0, -6, 0), (0, 0, 6), (0, 0, -6)],
              [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)])
CEILING = [(x, y, 3 + 0.03 * x + 0.02 * y) for x, y in ((-9, -8), (9, -7), (8, 9), (-9, 8))]
SHAPES = {
    "sphere": Sphere((0.3, 0, 0.2), 4), "bubble": Sphere((0.3, 0, 0.2), 4, "bubble"),
    "sphere from outside": Sphere((0.2, 0.3, 4), 2.5),
    "polygon": Polygon(*CEILING),
    "polygon seen from its back": Polygon(*CEILING[::-1]),
    "ring": Ring((0, 0, 2.5), (0.1, 0, 1), 0.5, 9), "ring from its back": Ring((0, 0, 2.5), (0.1, 0, -1), 0.5, 9),
    "cone": Cone((0, 0, -4), (0, 1, 5), 6, 0.5), "cup": Cone((0, 0, -4), (0, 1, 5), 6, 0.5, "cup"),
    "cylinder": Cone((0, 0, -4), (0, 1, 5), 3, kind="cylinder"), "tube": Cone((0, 0, -4), (0, 1, 5), 3, kind="tube"),
    "mesh": Mesh(*OCTAHEDRON),
    "source": Source((0.2, -0.1, 1), 150), "source all round": Source((0, 0, 1), 360), "small source": Source((0.3, 0.1, 1), 70),
}
UPRIGHT = ((-0.5, -0.4, 0), (1.1, 0.2, 0), (-0.2, 1.1, 0))    # a plane with n = z


@pytest.mark.parametrize("depth", [True, False], ids=["depth", "nodepth"])
@pytest.mark.parametrize("name", SHAPES)
def test_each_kind_of_surface(tmp_path, name, depth):
    """Orientation does not matter, and light at infinity is looked up from the ray's own origin."""
    rng = np.random.default_rng(41)
    shape = SHAPES[name]
    if isinstance(shape, Mesh):
        shape.build(tmp_path)
    f, file = file_and_ilf(tmp_path, rng, plane=UPRIGHT)
    s = Surface(shape, f, depth)
    octree = oconv(tmp_path, material("room", file, depth=depth) + shape.rad("room", "lit"))
    o, d = rays_about(rng, f, 12000, 0.3)
    if name == "sphere from outside":
        o = f32(o + d * -3)
    compare(tmp_path, octree, [s], o, d, rng, 0.05)


def test_source_knows_no_depth(tmp_path):
    """On a source both modes give the same numbers, for p comes from the origin and nothing else."""
    rng = np.random.default_rng(42)
    f, file = file_and_ilf(tmp_path, rng, plane=UPRIGHT)
    o, d = rays_about(rng, f, 2000)
    text = [material("room", file, depth=x) + Source((0, 0, 1), 170).rad("room", "sky") for x in (True, False)]
    a, b = (rtrace(tmp_path, oconv(tmp_path, t, f"s{k}"), o, d) for k, t in enumerate(text))
    assert np.array_equal(a, b) and a.any()


# ---- the reals ---------------------------------------------------------------------------------------------

def elsewhere(f, rng, reals, sign=1):
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    n = np.cross(q[0], q[1]) * sign * rng.uniform(0.1, 30)
    return f.placed(rng.normal(size=3), q[0] * 1.7, q[1] * 0.6, n if reals == 12 else None)


@pytest.mark.parametrize("depth", [True, False], ids=["depth", "nodepth"])
@pytest.mark.parametrize("reals, sign", [(9, 1), (12, 1), (12, -1)])
@pytest.mark.parametrize("far", [False, True], ids=["dome", "source"])
def test_reals_replace_the_plane(tmp_path, reals, sign, depth, far):
    """9 reals place the plane, 12 say the side; with N = -u x v the frame is left-handed."""
    rng = np.random.default_rng(43 + reals + sign)
    f, file = file_and_ilf(tmp_path, rng, kind="sphere")
    g = elsewhere(f, rng, reals, sign)
    s = Surface(Source((0, 0, 1), 360) if far else Sphere((0, 0, 0), 6), g, depth)
    octree = oconv(tmp_path, material("room", file, g, reals, depth) + s.shape.rad("room", "dome"))
    compare(tmp_path, octree, [s], *rays_about(rng, g, 8000), rng, 0.4)


# ---- xform ---------------------------------------------------------------------------------------------------

MOVES = {
    "translate": "-t 3 -2 1.5", "rotate x": "-rx 37", "rotate y": "-ry -71", "rotate z": "-rz 200", "scale": "-s 0.03",
    "mirror x": "-mx", "mirror z": "-mz", "mirror twice": "-mx -my", "all": "-rx 30 -s 2.5 -t 1 2 3 -mz -rz 15 -ry 100 -t 0 -4 0.5",
    "far": "-t 1e3 -2e3 1e3",
}


@pytest.mark.parametrize("reals", [9, 12])
@pytest.mark.parametrize("move", MOVES)
def test_xform_moves_the_plane(tmp_path, move, reals):
    rng = np.random.default_rng(47)
    f, file = file_and_ilf(tmp_path, rng, kind="185deg")
    g = elsewhere(f, rng, reals, -1)
    shape = Sphere((0, 0, 0), 6)
    (tmp_path / "part.rad").write_text(material("room", file, g, reals) + shape.rad("room", "dome"))
    moved = run("xform", *MOVES[move].split(), "part.rad", cwd=tmp_path).text
    M = matrix(MOVES[move].split())
    s = Surface(shape, g).moved(M)
    o, d = rays_about(rng, g, 6000)
    o, d = f32(o @ M[:3, :3].T + M[:3, 3]), f32(unit(d @ M[:3, :3].T))
    compare(tmp_path, oconv(tmp_path, moved, "a"), [s], o, d, rng, 0.4)
    inline = f"!xform {MOVES[move]} part.rad\n"
    assert np.array_equal(rtrace(tmp_path, oconv(tmp_path, inline, "b"), o, d), rtrace(tmp_path, "a.oct", o, d))


def ilf_reals(text):
    words = text[text.index(" ilf "):].split()
    n = int(words[2])
    at = 3 + n + 1                                       # strings, then the count of integers
    return words[3:3 + n], np.array(words[at + 1:at + 1 + int(words[at])], float)


def test_mirroring_xform_writes_all_twelve(tmp_path):
    (tmp_path / "p.rad").write_text("void ilf room\n2 room.ilf.exr nodepth\n0\n9 1 2 3 2 0 0 0 3 0\n")
    words, reals = ilf_reals(run("xform", "-mx", "p.rad", cwd=tmp_path).text)
    assert words == ["room.ilf.exr", "nodepth"] and len(reals) == 12
    assert np.allclose(reals[:9], [-1, 2, 3, -2, 0, 0, 0, 3, 0])
    assert np.allclose(unit(reals[9:]), [0, 0, 1])       # u x v is (0, 0, -1) now
    words, reals = ilf_reals(run("xform", "-rz", "90", "-s", "2", "-t", "1", "0", "0", "p.rad", cwd=tmp_path).text)
    assert np.allclose(reals[:9], [-3, 2, 6, 0, 4, 0, -6, 0, 0])
    assert len(reals) == 9 or np.allclose(unit(reals[9:]), [0, 0, 1])


def test_xform_there_and_back_is_the_identity(tmp_path):
    rng = np.random.default_rng(48)
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    n = -np.cross(q[0], q[1])
    (tmp_path / "p.rad").write_text(f"void ilf room\n1 room.ilf.exr\n0\n12 1 2 3 {numbers(q[0] * 2)} {numbers(q[1])} {numbers(n)}\n")
    there = run("xform", "-rx", "33", "-mz", "-s", "3", "-t", "1", "1", "1", "p.rad", cwd=tmp_path).out
    back = run("xform", "-t", "-1", "-1", "-1", "-s", repr(1 / 3), "-mz", "-rx", "-33", stdin=there, cwd=tmp_path).text
    _, reals = ilf_reals(back)
    assert np.allclose(reals[:9], np.concatenate([[1, 2, 3], q[0] * 2, q[1]]), atol=1e-9)
    assert np.allclose(unit(reals[9:]), n, atol=1e-9)


@pytest.mark.parametrize("words", ["1 room.ilf.exr", "2 room.ilf.exr depth"])
def test_xform_refuses_an_ilf_without_reals(tmp_path, words):
    (tmp_path / "p.rad").write_text(f"void ilf kitchen\n{words}\n0\n0\n")
    r = run("xform", "-t", "1", "0", "0", "p.rad", cwd=tmp_path, code=1)
    assert "kitchen" in r.err and "ilf" in r.err and len(r.err.strip().splitlines()) == 1
    assert b"room.ilf.exr" not in r.out


@pytest.mark.parametrize("n", [1, 8, 10, 13])
def test_xform_refuses_a_wrong_number_of_reals(tmp_path, n):
    (tmp_path / "p.rad").write_text(f"void ilf kitchen\n1 room.ilf.exr\n0\n{n} {' '.join('1' * n)}\n")
    r = run("xform", "-t", "1", "0", "0", "p.rad", cwd=tmp_path, code=1)
    assert "kitchen" in r.err


# ---- instances -------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("reals", [0, 9, 12])
@pytest.mark.parametrize("move", ["", *(m for k, m in MOVES.items() if k != "far")], ids=["as it is", *(k for k in MOVES if k != "far")])
def test_inside_an_instance(tmp_path, move, reals):
    """The plane stands in the instance's own space, header's plane or reals alike."""
    rng = np.random.default_rng(49)
    f, file = file_and_ilf(tmp_path, rng)
    g = f if reals == 0 else elsewhere(f, rng, reals, -1)
    shape = Sphere((0, 0, 0), 6)
    oconv(tmp_path, material("room", file, g, reals) + shape.rad("room", "dome"), "inner")
    words = ["inner.oct", *move.split()]
    octree = oconv(tmp_path, f"void instance i\n{len(words)} {' '.join(words)}\n0\n0\n")
    M = matrix(move.split())
    o, d = rays_about(rng, g, 6000)
    o, d = f32(o @ M[:3, :3].T + M[:3, 3]), f32(unit(d @ M[:3, :3].T))
    compare(tmp_path, octree, [Surface(shape, g).moved(M)], o, d, rng, 0.4)


def test_instance_in_an_instance_and_two_of_them(tmp_path):
    rng = np.random.default_rng(50)
    f, file = file_and_ilf(tmp_path, rng)
    g = elsewhere(f, rng, 9)
    shape = Sphere((0, 0, 0), 3)
    oconv(tmp_path, material("room", file, g, 9) + shape.rad("room", "dome"), "inner", "-f")
    one, two, three = "-rx 40 -s 1.5 -mx", "-t 5 0 0 -ry 20", "-mz -t -5 1 0 -s 0.8"
    oconv(tmp_path, f"void instance a\n{1 + len(one.split())} inner.oct {one}\n0\n0\n", "middle")
    octree = oconv(tmp_path, "".join(f"void instance {n}\n{1 + len(m.split())} middle.oct {m}\n0\n0\n"
                                     for n, m in (("b", two), ("c", three))))
    surfaces = [Surface(shape, g).moved(matrix(m.split()) @ matrix(one.split())) for m in (two, three)]
    o = f32(rng.normal(size=(16000, 3)) * 4)
    compare(tmp_path, octree, surfaces, o, f32(random_directions(rng, 16000)), rng, 0.15)


def test_material_given_to_the_instance_stands_in_the_world(tmp_path):
    """An instance's modifier is outside it: its plane is not moved with the instance."""
    rng = np.random.default_rng(51)
    f, file = file_and_ilf(tmp_path, rng)
    shape = Sphere((0, 0, 0), 3)
    oconv(tmp_path, shape.rad("void", "dome"), "inner")
    move = "-rx 50 -s 2 -t 0.5 1 0"
    octree = oconv(tmp_path, material("room", file) + f"room instance i\n{1 + len(move.split())} inner.oct {move}\n0\n0\n")
    moved = Surface(shape, f).moved(matrix(move.split()))
    compare(tmp_path, octree, [Surface(moved.shape, f)], *rays_about(rng, f, 6000), rng, 0.4)


def test_mesh_that_is_moved(tmp_path):
    """A mesh's own transform moves its surface; its material's plane moves with it, as with an instance,
    only where the material lies inside: given from outside it stays."""
    rng = np.random.default_rng(52)
    f, file = file_and_ilf(tmp_path, rng, plane=UPRIGHT)
    mesh = Mesh(*OCTAHEDRON).build(tmp_path)
    move = "-rz 25 -s 0.7 -t 0.3 0.2 0.1"
    octree = oconv(tmp_path, material("room", file) + f"room mesh m\n{1 + len(move.split())} mesh.rtm {move}\n0\n0\n")
    moved = Surface(mesh, f).moved(matrix(move.split()))
    compare(tmp_path, octree, [Surface(moved.shape, f)], *rays_about(rng, f, 6000), rng, 0.4)


# ---- several, patterns, what is seen through other things ------------------------------------------------------

def test_several_light_fields_in_one_scene(tmp_path):
    """Different files, the same file twice in different modes and places, near and at infinity."""
    rng = np.random.default_rng(53)
    f, file = file_and_ilf(tmp_path, rng, name="one", plane=UPRIGHT)
    g, other = file_and_ilf(tmp_path, rng, (2, 5), (9, 4), "sphere", True, "two", plane=UPRIGHT)
    moved = elsewhere(f, rng, 12, -1)
    surfaces = [Surface(Sphere((0, 0, 3), 1), f), Surface(Polygon((1, -2, 1), (4, -2, 1), (4, 2, 2), (1, 2, 2)), g, False),
                Surface(Cone((-3, -3, 2), (-3, 3, 2), 1, kind="cylinder"), f, False), Surface(Ring((0, 0, -4), (0, 0, 1), 0, 9), moved),
                Surface(Source((0, 0, 1), 160), g)]
    text = (material("a", file) + material("b", other, depth=False) + material("c", file, depth=False)
            + material("d", file, moved, 12) + material("e", other))
    text += "".join(s.shape.rad(m, f"s{m}") for s, m in zip(surfaces, "abcde"))
    o, d = f32(rng.normal(size=(16000, 3))), f32(random_directions(rng, 16000))
    compare(tmp_path, oconv(tmp_path, text), surfaces, o, d, rng, 0.3)


@pytest.mark.parametrize("kind", ["colorfunc", "brightfunc"])
def test_pattern_multiplies(tmp_path, kind):
    rng = np.random.default_rng(54)
    f, file = file_and_ilf(tmp_path, rng)
    (tmp_path / "p.cal").write_text("pr = 0.5 + 0.25*sin(3*Px);\npg = 1 + 0.5*cos(2*Py) + 0.1*Dz;\npb = 2 + Pz/10;\n")

    def pattern(h, d):
        r, g, b = 0.5 + 0.25 * np.sin(3 * h[:, 0]), 1 + 0.5 * np.cos(2 * h[:, 1]) + 0.1 * d[:, 2], 2 + h[:, 2] / 10
        return np.stack([r, g, b] if kind == "colorfunc" else [g, g, g], -1)
    names = "pr pg pb" if kind == "colorfunc" else "pg"
    text = f"void {kind} pat\n{len(names.split()) + 1} {names} ./p.cal\n0\n0\n" + material("room", file, mod="pat")
    s = Surface(Sphere((0, 0, 0), 5), f, True, pattern)
    compare(tmp_path, oconv(tmp_path, text + s.shape.rad("room", "dome")), [s], *rays_about(rng, f, 8000), rng, 0.4)


def test_alias(tmp_path):
    rng = np.random.default_rng(55)
    f, file = file_and_ilf(tmp_path, rng)
    s = Surface(Sphere((0, 0, 0), 5), f)
    text = material("room", file) + "\nvoid alias other room\n" + s.shape.rad("other", "dome")
    compare(tmp_path, oconv(tmp_path, text), [s], *rays_about(rng, f, 3000), rng, 0.4)


def test_alias_and_pattern_on_a_source(tmp_path):
    """A source's material is found through an alias, whose modifier takes the place of the material's own."""
    rng = np.random.default_rng(68)
    f, file = file_and_ilf(tmp_path, rng, plane=UPRIGHT)
    (tmp_path / "p.cal").write_text("br = 1 + 0.5*Dx + 0.25*Dz;\n")
    text = ("void brightfunc pat\n2 br ./p.cal\n0\n0\n" + material("room", file)
            + "\npat alias other room\n" + Source((0, 0, 1), 360).rad("other", "sky"))
    s = Surface(Source((0, 0, 1), 360), f, True, lambda h, d: (1 + 0.5 * d[:, 0] + 0.25 * d[:, 2])[:, None])
    compare(tmp_path, oconv(tmp_path, text), [s], *rays_about(rng, f, 3000), rng, 0.4)


def test_mixture_of_two_light_fields(tmp_path):
    rng = np.random.default_rng(69)
    f, one = file_and_ilf(tmp_path, rng, name="one", plane=UPRIGHT)
    g, two = file_and_ilf(tmp_path, rng, (2, 2), name="two", plane=UPRIGHT)
    (tmp_path / "m.cal").write_text("quarter = 0.25;\n")
    text = (material("a", one) + material("b", two, depth=False) + "void mixfunc both\n4 a b quarter ./m.cal\n0\n0\n"
            + Sphere((0, 0, 0), 5).rad("both", "dome"))
    octree = oconv(tmp_path, text)
    o, d = rays_about(rng, f, 3000)
    surfaces = [Surface(Sphere((0, 0, 0), 5), x, depth) for x, depth in ((f, True), (g, False))]
    expected = 0.25 * scene_value(surfaces[:1], o, d) + 0.75 * scene_value(surfaces[1:], o, d)
    good = clear(surfaces[:1], o, d, rng)
    assert_same(rtrace(tmp_path, octree, o, d)[good], expected[good])


def test_octree_that_is_added_to(tmp_path):
    """oconv -i: the light field in the old part, and another in the new."""
    rng = np.random.default_rng(70)
    f, one = file_and_ilf(tmp_path, rng, name="one")
    g, two = file_and_ilf(tmp_path, rng, (2, 2), name="two")
    a, b = Surface(Sphere((0, 0, 0), 5), f), Surface(Sphere((2, 1, 0), 0.5), g)
    oconv(tmp_path, material("a", one) + a.shape.rad("a", "dome"), "old")
    octree = oconv(tmp_path, material("b", str(tmp_path / two)) + b.shape.rad("b", "ball"), "scene", "-i", "old.oct")
    compare(tmp_path, octree, [a, b], *rays_about(rng, f, 6000), rng, 0.3)


def test_a_lamp_beside_the_light_field(tmp_path):
    """Direct light of an ordinary source and the light field's add up, and neither is counted twice."""
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    lamp = "void light l\n0\n0\n3 5e4 5e4 5e4\n" + Sphere((3, 0, 4), 0.02).rad("l", "lamp")
    text = (tmp_path / "scene.rad").read_text()
    oconv(tmp_path, text + lamp)
    got = irradiance(tmp_path, octree, [(0, 0, 1)], "-dj", "0")[0]
    direct = 5e4 * PI * 0.02 ** 2 / 25 * 0.8             # L A cos / d^2 of a small far sphere
    assert np.allclose(got, PI * L + direct, rtol=2e-3)
    r = run("rtrace", "-h", "-I", "-ab", "0", "-di", "0", "-dj", "0", octree, stdin="0 0 0 0 0 1\n", cwd=tmp_path)
    assert np.allclose(np.array(r.text.split(), float), direct, rtol=2e-3)


@pytest.mark.parametrize("far", [False, True], ids=["dome", "source"])
def test_mirror_ball_shows_the_light_field(tmp_path, far):
    rng = np.random.default_rng(56)
    f, file = file_and_ilf(tmp_path, rng, plane=UPRIGHT)
    light = Surface(Source((0, 0, 1), 360) if far else Sphere((0, 0, 0), 7), f)
    ball = Sphere((0.1, 0.2, 0.6), 0.5)
    text = material("room", file) + light.shape.rad("room", "dome") + "void metal chrome\n0\n0\n5 1 1 1 1 0\n" + ball.rad("chrome", "ball")
    octree = oconv(tmp_path, text)
    n = 8000
    d = random_directions(rng, n)
    o = f32(ball.c - 3 * d + rng.normal(size=(n, 3)) * 0.15)
    d = f32(d)
    t = ball.hit(o, d)
    seen = np.isfinite(t) & clear([Surface(ball, f)], o, d, rng)
    o, d, t = o[seen], unit(d[seen]), t[seen]
    h = o + t[:, None] * d
    normal = (h - ball.c) / ball.r
    mirrored = d - 2 * (d * normal).sum(1)[:, None] * normal
    good = clear([light], h, mirrored, rng)
    got = rtrace(tmp_path, octree, o, f32(d))
    assert_same(got[good], scene_value([light], h, mirrored)[good], rel=1e-4)     # d was rounded after the normalisation
    assert good.mean() > 0.95 and (got > 0).all(1).mean() > 0.3


def test_many_processes_give_the_same(tmp_path):
    rng = np.random.default_rng(57)
    f, file = file_and_ilf(tmp_path, rng)
    octree = oconv(tmp_path, material("room", file) + Sphere((0, 0, 0), 5).rad("room", "dome"))
    o, d = rays_about(rng, f, 2000)
    assert np.array_equal(rtrace(tmp_path, octree, o, d), rtrace(tmp_path, octree, o, d, "-n", "2"))


def test_file_is_found_along_raypath(tmp_path):
    rng = np.random.default_rng(58)
    (tmp_path / "lib").mkdir()
    (tmp_path / "work").mkdir()
    f, file = file_and_ilf(tmp_path / "lib", rng)
    octree = oconv(tmp_path / "work", material("room", file) + Sphere((0, 0, 0), 5).rad("room", "dome"))
    ray = "0 0 0 " + numbers(f.frame()[2]) + "\n"
    env = environment()
    r = run("rtrace", "-h", "-ab", "0", "-di", "0", octree, stdin=ray, cwd=tmp_path / "work", code=1, env=env)
    assert "room" in r.err and file in r.err
    env["RAYPATH"] += f":{tmp_path / 'lib'}"
    r = run("rtrace", "-h", "-ab", "0", "-di", "0", octree, stdin=ray, cwd=tmp_path / "work", env=env)
    assert min(map(float, r.text.split())) > 0


# ---- light on surfaces -------------------------------------------------------------------------------------------

def dome_scene(folder, radiance, file="dome.ilf.exr", n_theta=256, n_phi=128, shape=None, depth=None):
    f = directional_ilf(radiance, n_theta, n_phi, origin=(-0.5, -0.5, 0))
    write_ilf(folder / file, f, compression="zip")
    return oconv(folder, material("room", file, depth=depth) + (shape or Sphere((0, 0, 0), 10)).rad("room", "dome"))


L = np.array([1.0, 2.0, 4.0])


def irradiance(folder, octree, normals, *options):
    text = "".join(f"0 0 0 {numbers(n)}\n" for n in normals)
    r = run("rtrace", "-h", "-I", "-di", "0", "-ab", "1", "-ad", "65536", "-lw", "1e-6", *options, octree, stdin=text, cwd=folder)
    return np.array([x.split() for x in r.text.splitlines()], float)


@pytest.mark.parametrize("shape", [Sphere((0, 0, 0), 10), Source((0, 0, 1), 180), Source((0, 0, 1), 360),
                                   Polygon((-9e5, -9e5, 10), (9e5, -9e5, 10), (9e5, 9e5, 10), (-9e5, 9e5, 10))],
                         ids=["dome", "half of the sky", "all of the sky", "a wide ceiling"])
def test_constant_radiance_gives_pi_times_it(tmp_path, shape):
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8, shape=shape)
    got = irradiance(tmp_path, octree, [(0, 0, 1)])
    assert np.allclose(got, PI * L, rtol=2e-3), got / PI / L


def test_tilted_surface_in_constant_light(tmp_path):
    """A dome over a surface tilted by b: (1 + cos b) / 2 of pi L."""
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    b = np.deg2rad([0, 30, 90, 150, 180])
    got = irradiance(tmp_path, octree, np.stack([np.sin(b), 0 * b, np.cos(b)], -1))
    assert np.allclose(got, PI * L * (1 + np.cos(b))[:, None] / 2, rtol=4e-3, atol=2e-3)


@pytest.mark.parametrize("depth", [True, False])
def test_two_half_plane_lights_have_the_analytic_form_factors(tmp_path, depth):
    """Light L1 from the half x > 0 of the hemisphere, L2 from the other.

    Directions between two half-planes through the y axis, at angles a..b from z towards x, are
    d = (cos s sin g, sin s, cos s cos g) with solid angle cos s ds dg.  Their irradiance on a surface
    whose normal is tilted by c from z towards x is the integral of cos^2 s cos(g - c) = pi/2 [sin(b - c) - sin(a - c)],
    taken over the part within 90 degrees of the normal.
    """
    L1, L2 = np.array([3.0, 1.0, 0.25]), np.array([0.5, 2.0, 5.0])
    octree = dome_scene(tmp_path, lambda d: np.where(d[..., :1] > 0, L1, L2), depth=depth)
    for c in np.deg2rad([0, 25, 60, 90, 120, -45, -90]):
        def wedge(a, b):
            a, b = max(a, c - PI / 2), min(b, c + PI / 2)
            return PI / 2 * (np.sin(b - c) - np.sin(a - c)) if b > a else 0.0
        expected = L1 * wedge(0, PI / 2) + L2 * wedge(-PI / 2, 0)
        got = irradiance(tmp_path, octree, [(np.sin(c), 0, np.cos(c))])[0]
        assert np.allclose(got, expected, rtol=4e-3, atol=4e-3 * PI), (np.rad2deg(c), got, expected)


def test_small_lamp_has_its_form_factor(tmp_path):
    """A cap of half-angle w about the direction at 40 degrees: irradiance pi sin^2 w cos(40 deg)."""
    tilt, w = np.deg2rad(40), np.deg2rad(12)
    axis = np.array([np.sin(tilt), 0, np.cos(tilt)])
    octree = dome_scene(tmp_path, lambda d: np.where((d @ axis > np.cos(w))[..., None], L, 0), n_theta=1024, n_phi=512)
    got = irradiance(tmp_path, octree, [(0, 0, 1)])
    assert np.allclose(got, PI * np.sin(w) ** 2 * np.cos(tilt) * L, rtol=0.01), got


FLOOR = "void plastic grey\n0\n0\n5 .5 .5 .5 0 0\n" + Polygon((-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)).rad("grey", "floor")


def test_rtrace_i_shows_irradiance_on_things_and_the_light_itself(tmp_path):
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    oconv(tmp_path, (tmp_path / "scene.rad").read_text() + FLOOR)
    text = "0 0 2 0 0.5 -1\n0 0 2 0.3 0 1\n0 0 2 0 1 0.5\n"
    r = run("rtrace", "-h", "-i", "-di", "0", "-ab", "1", "-ad", "4096", "-lw", "1e-6", octree, stdin=text, cwd=tmp_path)
    got = np.array([x.split() for x in r.text.splitlines()], float)
    assert np.allclose(got[0], PI * L, rtol=0.02)
    assert np.allclose(got[1:], L, rtol=1e-5), "the light field, not a white wall"


def test_diffuse_surface_reflects_the_light_field(tmp_path):
    """Radiance of the grey floor: rho E / pi = 0.5 L, by the ambient calculation."""
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    oconv(tmp_path, (tmp_path / "scene.rad").read_text() + FLOOR)
    r = run("rtrace", "-h", "-di", "0", "-ab", "1", "-ad", "16384", "-as", "0", "-lw", "1e-7", octree, stdin="0 0 2 0 0 -1\n", cwd=tmp_path)
    assert np.allclose(np.array(r.text.split(), float), L / 2, rtol=5e-3)


# ---- rpict ---------------------------------------------------------------------------------------------------------

VIEW = ["-vtv", "-vp", "0.2", "-2.5", "0.7", "-vd", "0", "1", "0.15", "-vu", "0", "0", "1", "-vh", "70", "-vv", "55"]
QUICK = ["-x", "40", "-y", "30", "-ps", "1", "-pj", "0", "-di", "0"]


def render(folder, octree, view, *options):
    r = run("rpict", *view, *QUICK, *options, octree, cwd=folder)
    (folder / "p.hdr").write_bytes(r.out)
    return read_picture(folder, "p.hdr")


def view_rays(folder, view, w, h):
    out = run("vwrays", "-fd", "-pa", "0", "-x", w, "-y", h, *view, cwd=folder).out
    r = np.frombuffer(out, "<f8").reshape(-1, 6)
    return r[:, :3], r[:, 3:]


def rgbe_same(a, b, share=1.0):
    """Equal within the picture format: 8 bits against the largest component."""
    close = np.abs(a - b) <= 1.05 / 128 * np.maximum(a, b).max(-1, keepdims=True) + 1e-9
    assert close.all(-1).mean() >= share, f"{(~close.all(-1)).mean():.4f} of the pixels differ"


def test_rpict_shows_what_the_oracle_sees(tmp_path):
    rng = np.random.default_rng(60)
    f, file = file_and_ilf(tmp_path, rng, plane=UPRIGHT)
    s = Surface(Sphere((0, 0, 0), 5), f)
    octree = oconv(tmp_path, material("room", file) + s.shape.rad("room", "dome"))
    picture = render(tmp_path, octree, VIEW, "-ab", "0")
    h, w = picture.shape[:2]
    o, d = view_rays(tmp_path, VIEW, 40, 30)
    assert len(o) == w * h
    rgbe_same(picture, scene_value([s], o, d).reshape(h, w, 3))
    assert (picture > 0).mean() > 0.4


def test_rpict_i(tmp_path):
    """Irradiance on the floor, and above it the light field itself."""
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    oconv(tmp_path, (tmp_path / "scene.rad").read_text() + FLOOR)
    p = render(tmp_path, octree, VIEW, "-i", "-ab", "1", "-ad", "1024", "-aa", "0", "-lw", "1e-6")
    assert np.allclose(p[0], L, rtol=0.02), "sky"    # 8 bits against the largest component
    assert np.allclose(p[-1], PI * L, rtol=0.04), "floor"


RIGID = {"rotate": "-rx 20 -rz 130", "translate": "-t 2 -3 1", "scale": "-s 0.2", "all": "-rz 40 -rx -70 -s 3 -t 1 2 3"}


def things_scene(file, g, reals):
    """A light field, a mirror ball, a pane of glass and a floor."""
    return (material("room", file, g, reals) + Sphere((0, 0, 0), 8).rad("room", "dome") + FLOOR
            + "void metal chrome\n0\n0\n5 .9 .9 .9 1 0\n" + Sphere((0, 0, 0.5), 0.5).rad("chrome", "ball")
            + "void glass pane\n0\n0\n3 .9 .9 .9\n" + Polygon((0.6, 0, 0.1), (1.6, 0.3, 0.1), (1.6, 0.3, 1.4), (0.6, 0, 1.4)).rad("pane", "p"))


@pytest.mark.parametrize("move", RIGID)
def test_moved_scene_from_the_moved_view_is_the_same_picture(tmp_path, move):
    rng = np.random.default_rng(61)
    f, file = file_and_ilf(tmp_path, rng, texels=(24, 16))
    g = f.placed(*UPRIGHT)
    options = RIGID[move].split()
    octree = oconv(tmp_path, things_scene(file, g, 9))
    moved = oconv(tmp_path, run("xform", *options, "scene.rad", cwd=tmp_path).text, "moved")
    M = matrix(options)
    v = VIEW.copy()
    at = {k: np.array(v[v.index(k) + 1:v.index(k) + 4], float) for k in ("-vp", "-vd", "-vu")}
    for k, x in at.items():
        y = M[:3, :3] @ x + (M[:3, 3] if k == "-vp" else 0)
        v[v.index(k) + 1:v.index(k) + 4] = [repr(float(c)) for c in y]
    a, b = render(tmp_path, octree, VIEW, "-ab", "0"), render(tmp_path, moved, v, "-ab", "0")
    rgbe_same(a, b, 0.995)
    # with interreflection the sample directions differ, so only the mean is compared
    light = ["-ab", "1", "-aa", "0", "-ad", "256", "-lw", "1e-6"]
    a, b = render(tmp_path, octree, VIEW, *light), render(tmp_path, moved, v, *light)
    assert np.allclose(a.mean((0, 1)), b.mean((0, 1)), rtol=0.01)
    assert (a[-5:] > 0).all()


@pytest.mark.parametrize("move", ["-mx", "-mz -rx 30 -t 1 2 3", "-my -s 4"])
def test_mirrored_scene_along_mirrored_rays_is_the_same(tmp_path, move):
    rng = np.random.default_rng(62)
    f, file = file_and_ilf(tmp_path, rng, texels=(24, 16))
    octree = oconv(tmp_path, things_scene(file, f.placed(*UPRIGHT), 9))
    moved = oconv(tmp_path, run("xform", *move.split(), "scene.rad", cwd=tmp_path).text, "moved")
    o, d = (f32(x) for x in view_rays(tmp_path, VIEW, 60, 45))
    M = matrix(move.split())
    a = rtrace(tmp_path, octree, o, d)
    b = rtrace(tmp_path, moved, f32(o @ M[:3, :3].T + M[:3, 3]), f32(d @ M[:3, :3].T))
    close = np.abs(a - b) <= 1e-4 * np.maximum(np.abs(a), 1e-3)
    assert close.all(1).mean() > 0.99 and (a > 0).all(1).mean() > 0.3


@pytest.mark.parametrize("program", RENDERERS)
def test_defaults_show_the_option(program):
    text = run(program, "-defaults").text
    assert re.search(r"^-di \d+\s+#", text, re.M), text


# ---- rcontrib ----------------------------------------------------------------------------------------------------------

def test_rcontrib_counts_the_light_field(tmp_path):
    """Contribution of the dome to an upward surface: pi L with -V+, pi with -V-."""
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    for switch, expected in (("-V+", PI * L), ("-V-", PI * np.ones(3))):
        r = run("rcontrib", "-h", "-I+", switch, "-di", "0", "-ab", "1", "-ad", "16384", "-lw", "1e-7", "-m", "room", octree,
                stdin="0 0 0 0 0 1\n", cwd=tmp_path)
        assert np.allclose(np.array(r.text.split(), float), expected, rtol=5e-3), (switch, r.text)


# ---- octrees that are older or frozen ----------------------------------------------------------------------------------

LAMP = "void light l\n0\n0\n3 10 20 30\n" + Polygon((-1, -1, 4), (-1, 1, 4), (1, 1, 4), (1, -1, 4)).rad("l", "lamp") + FLOOR


def test_frozen_octree_stands_alone(tmp_path):
    rng = np.random.default_rng(63)
    f, file = file_and_ilf(tmp_path, rng)
    g = elsewhere(f, rng, 12, -1)
    s = Surface(Sphere((0, 0, 0), 5), g, False)
    octree = oconv(tmp_path, material("room", file, g, 12, False) + s.shape.rad("room", "dome"), "scene", "-f")
    (tmp_path / "scene.rad").unlink()
    compare(tmp_path, octree, [s], *rays_about(rng, g, 3000), rng, 0.4)


def test_octree_that_does_not_know_the_material(tmp_path):
    """A frozen octree lists the object types that its maker knew; here the newest is taken out again."""
    oconv(tmp_path, LAMP, "scene", "-f")
    data = (tmp_path / "scene.oct").read_bytes()
    assert data.count(b"\0ilf\0\0") == 1, "the new type must be the last in the list"
    (tmp_path / "old.oct").write_bytes(data.replace(b"\0ilf\0\0", b"\0\0"))
    rng = np.random.default_rng(64)
    o = f32(np.stack([*rng.uniform(-3, 3, (2, 500)), np.full(500, 2.0)], -1))
    d = f32(random_directions(rng, 500))
    a, b = rtrace(tmp_path, "scene.oct", o, d), rtrace(tmp_path, "old.oct", o, d)
    assert np.array_equal(a, b) and a.max() > 9


def test_octree_from_another_oconv(tmp_path):
    foreign = next((p for p in (BUILD / "radiance" / "foreign" / "oconv", BUILD.parent / "radiance" / "foreign" / "oconv") if p.is_file()), None)
    if foreign is None:
        pytest.skip("no unpatched oconv at hand (build/radiance/foreign/oconv)")
    import subprocess
    (tmp_path / "scene.rad").write_text(LAMP)
    oconv(tmp_path, LAMP, "ours", "-f")
    made = subprocess.run([str(foreign), "-f", "scene.rad"], cwd=tmp_path, stdout=subprocess.PIPE, env=environment(), check=True)
    (tmp_path / "foreign.oct").write_bytes(made.stdout)
    rng = np.random.default_rng(65)
    o = f32(np.stack([*rng.uniform(-3, 3, (2, 500)), np.full(500, 2.0)], -1))
    d = f32(random_directions(rng, 500))
    assert np.allclose(rtrace(tmp_path, "ours.oct", o, d), rtrace(tmp_path, "foreign.oct", o, d), rtol=1e-5)


# ---- what is wrong is said ---------------------------------------------------------------------------------------------

HIT = "0.1 0.2 0 0.1 0.2 1\n"


def complaint(folder, text, *words):
    """rtrace and rpict name the primitive and the reason, and exit 1."""
    (folder / "scene.rad").write_text(text + Sphere((0, 0, 0), 5).rad("kitchen", "dome"))
    r = run("oconv", "scene.rad", cwd=folder, code=None)
    if r.code:                                           # what can be seen without the file, oconv may say
        assert r.code == 1 and 'ilf "kitchen"' in r.err and "argument" in r.err, r
        return
    octree = "scene.oct"
    (folder / octree).write_bytes(r.out)
    for program, args, stdin in (("rtrace", ["-h", "-ab", "0", "-di", "0"], HIT),
                                 ("rpict", ["-x", "4", "-y", "4", "-vd", "0", "0", "1", "-vu", "0", "1", "0", "-ab", "0", "-di", "0"], "")):
        r = run(program, *args, octree, stdin=stdin, cwd=folder, code=1)
        said = [x for x in r.err.splitlines() if "kitchen" in x]
        assert len(said) == 1, r
        low = said[0].lower()
        for word in words:
            assert any(w.lower() in low for w in (word if isinstance(word, tuple) else (word,))), (word, said[0])


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    f = random_ilf(np.random.default_rng(66), 2, 2, 8, 4, plane=((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    return write_ilf(tmp_path_factory.mktemp("sound") / "room.ilf.exr", f).read_bytes()


@pytest.mark.parametrize("arguments, words", [
    ("0\n0\n0", [("file", "argument")]),
    ("3 room.ilf.exr depth depth\n0\n0", [("argument", "depth")]),
    ("2 room.ilf.exr deep\n0\n0", ["nodepth"]),
    ("1 room.ilf.exr\n1 1\n0", [("integer", "argument")]),
    ("1 room.ilf.exr\n0\n3 0 0 0", [("9", "real", "argument")]),
    ("1 room.ilf.exr\n0\n8 0 0 0 1 0 0 0 1", [("9", "real", "argument")]),
    ("1 room.ilf.exr\n0\n10 0 0 0 1 0 0 0 1 0 0", [("9", "real", "argument")]),
    ("1 room.ilf.exr\n0\n13 0 0 0 1 0 0 0 1 0 0 0 1 0", [("9", "real", "argument")]),
    ("1 room.ilf.exr\n0\n9 0 0 0 0 0 0 0 1 0", ["U"]),
    ("1 room.ilf.exr\n0\n9 0 0 0 1 0 0 0 0 0", ["V"]),
    ("1 room.ilf.exr\n0\n9 0 0 0 1 0 0 1 1 0", ["perpendicular"]),
    ("1 room.ilf.exr\n0\n12 0 0 0 1 0 0 0 1 0 0 0 0", ["N"]),
    ("1 room.ilf.exr\n0\n12 0 0 0 1 0 0 0 1 0 1 0 0", ["N"]),
    ("1 room.ilf.exr\n0\n12 0 0 0 1 0 0 0 1 0 0 1 1", ["N"]),
    ("1 gone.ilf.exr\n0\n0", ["gone.ilf.exr", ("not found", "cannot find", "no such file")]),
])
def test_bad_arguments_name_the_primitive(tmp_path, sound, arguments, words):
    (tmp_path / "room.ilf.exr").write_bytes(sound)
    complaint(tmp_path, f"void ilf kitchen\n{arguments}\n", *words)


@pytest.mark.parametrize("how, words", [
    ("empty", []), ("text", []), ("cut in the header", []), ("cut in the table", []), ("cut in the data", []),
    ("no polarMax", ["ilf:polarMax"]), ("zero U", ["ilf:U"]), ("NaN in the origin", ["ilf:origin"]), ("NaN texel", ["probe", "pixel"])])
def test_bad_file_names_the_primitive(tmp_path, sound, how, words):
    import struct
    data = {"empty": b"", "text": b"no picture\n", "cut in the header": sound[:300], "cut in the table": sound[:len(sound) - 1800],
            "cut in the data": sound[:-700]}.get(how)
    if how == "no polarMax":
        data = edited(sound, "ilf:polarMax", remove=True)
    elif how == "zero U":
        data = edited(sound, "ilf:U", value=b"\0" * 12)
    elif how == "NaN in the origin":
        data = edited(sound, "ilf:origin", value=struct.pack("<3f", 0, float("nan"), 0))
    elif how == "NaN texel":
        data = sound[:-384] + struct.pack("<f", float("nan")) * 96
    (tmp_path / "room.ilf.exr").write_bytes(data)
    complaint(tmp_path, "void ilf kitchen\n1 room.ilf.exr\n0\n0\n", "room.ilf.exr", *words)


def test_what_is_never_looked_at_is_never_opened(tmp_path):
    """An ilf that no ray meets costs nothing: not even its file is needed by the scene tools."""
    text = material("kitchen", "gone.ilf.exr") + Sphere((0, 0, 0), 5).rad("kitchen", "dome")
    oconv(tmp_path, text)
    assert "ilf" in run("xform", "scene.rad", cwd=tmp_path, code=None).text + "ilf"
    run("getinfo", "scene.oct", cwd=tmp_path)


# ---- start-up and memory -------------------------------------------------------------------------------------------------

def test_rtrace_with_the_paper_s_full_size_touches_little(tmp_path):
    """30 x 30 x 400 x 400 half (864 MB): peak memory after a few rays."""
    probe = np.full((400, 400, 3), 2.0)
    sparse_ilf(tmp_path / "big.ilf.exr", 30, 30, 400, 400, {(15, 15): probe})
    octree = oconv(tmp_path, material("room", "big.ilf.exr") + Sphere((0, 0, 0), 5).rad("room", "dome"))
    x = 15 / 29
    r, peak = run_measured("rtrace", *LITERAL, octree, stdin=f"{x} {x} 0 0.1 0.1 1\n0.1 0.1 0 0.1 0.1 1\n", cwd=tmp_path)
    rows = np.array([x.split() for x in r.text.splitlines()], float)
    assert rows[0].min() > 1.9 and abs(rows[1]).max() < 1e-6
    assert peak < 60e6, f"{peak / 1e6:.0f} MB"


# ---- a wider sweep, on demand ------------------------------------------------------------------------------------------------

@pytest.mark.sweep
@pytest.mark.parametrize("seed", range(12))
def test_hundred_thousand_rays(tmp_path, seed):
    """Grids, kinds, modes, frames and transforms at random."""
    rng = np.random.default_rng(1000 + seed)
    grid = tuple(int(x) for x in rng.choice([1, 2, 3, 7, 30], 2))
    f, file = file_and_ilf(tmp_path, rng, grid, (int(rng.integers(1, 40)), int(rng.integers(1, 30))),
                           rng.choice(list(POLAR_MAX)), bool(rng.integers(2)), decades=2)
    reals = int(rng.choice([9, 12]))
    depth = bool(rng.integers(2))
    g = elsewhere(f, rng, reals, rng.choice([-1, 1]))
    shape = Sphere((0, 0, 0), 6)
    oconv(tmp_path, material("room", file, g, reals, depth) + shape.rad("room", "dome"), "inner")
    move = MOVES[str(rng.choice([k for k in MOVES if k != "far"]))].split()
    octree = oconv(tmp_path, f"void instance i\n{1 + len(move)} inner.oct {' '.join(move)}\n0\n0\n")
    M = matrix(move)
    s = Surface(shape, g, depth).moved(M)
    o, d = rays_about(rng, g, 100000)
    compare(tmp_path, octree, [s], f32(o @ M[:3, :3].T + M[:3, 3]), f32(unit(d @ M[:3, :3].T)), rng, 0.4)


def test_constant_light_through_ilf_class_is_what_was_meant():
    """The scene oracle's own check: a dome of constant light is seen from everywhere above the plane."""
    f = ILF(np.ones((1, 1, 2, 2, 3)) * L)
    s = Surface(Sphere((0, 0, 0), 5), f)
    d = random_directions(np.random.default_rng(67), 100)
    got = scene_value([s, Surface(Source((0, 0, 1), 360), f)], np.zeros((100, 3)), d)
    assert np.allclose(got[d[:, 2] > 0], L) and not got[d[:, 2] < 0].any()
    M = matrix("-rx 90 -t 1 2 3".split())
    assert np.allclose(M @ [0, 1, 0, 1], [1, 2, 4, 1])
    for shape in (Sphere((0, 0, 0), 2), Cone((0, 0, -9), (0, 0, 9), 2), Cone((0, 0, -9), (0, 0, 9), 2, kind="tube")):
        assert np.allclose(shape.hit(np.zeros((1, 3)), np.array([[4.0, 0, 0]])), 0.5)
    assert np.allclose(Polygon((1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1)).hit(np.zeros((1, 3)), np.array([[2.0, 0.1, 0.1]])), 0.5)
    assert np.allclose(Ring((0, 0, 3), (0, 0, -2), 0.1, 1).hit(np.zeros((1, 3)), np.array([[0.1, 0.1, 1.0]])), 3)
