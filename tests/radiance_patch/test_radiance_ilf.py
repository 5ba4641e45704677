"""The material ilf on surfaces (docs/FORMAT.md, section 3): rtrace against the numpy oracle, through xform and instances."""
import numpy as np
import pytest

from conftest import run, sweep
from ilf_util import ILF, MIRROR_ARRAY_VALID, POLAR_MAX, f32, random_directions, unit
from rad_util import (L, MOVES, UPRIGHT, Cone, Mesh, Polygon, Ring, Source, Sphere, Surface, compare, elsewhere,
                      file_and_ilf, material, matrix, numbers, oconv, rays_about, rtrace, scene_value)


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


# ---- the reals -----------------------------------------------------------------------------------------

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


# ---- xform ---------------------------------------------------------------------------------------------

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


# ---- instances -----------------------------------------------------------------------------------------

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


# ---- a wider sweep, on demand --------------------------------------------------------------------------

@pytest.mark.sweep
def test_hundred_thousand_rays(tmp_path):
    """Grids, kinds, modes, frames and transforms at random."""
    def compare_rays(seed):
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
    sweep(compare_rays, [(seed,) for seed in range(12)])


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
