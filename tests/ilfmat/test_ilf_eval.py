"""Evaluation of the light field (docs/FORMAT.md, section 2): the oracle against analytic answers, ilftrace against the oracle."""
import io

import numpy as np
import pytest

from conftest import driver, environment, run, sweep
from ilf_util import (ILF, Lamp, MIRROR_ARRAY_VALID, PI, POLAR_MAX, assert_same, directional_ilf, random_directions,
                      random_ilf, rays_text, read_mosaic, unit, unmosaic, write_ilf)
from process import execute

INF = np.inf


# ---- the oracle itself, against answers by hand ------------------------------------------------------

def grid_ilf(value, n_u, n_v, n_theta=8, n_phi=4, **more):
    """Probes that are constant over directions; value(i, j) -> 3 numbers."""
    probes = np.zeros((n_v, n_u, n_phi, n_theta, 3))
    for j in range(n_v):
        for i in range(n_u):
            probes[j, i] = value(i, j)
    return ILF(probes, **more)


@pytest.mark.parametrize("kind", POLAR_MAX)
@pytest.mark.parametrize("depth", [True, False])
def test_oracle_constant_field_is_constant_above_and_black_below(kind, depth):
    f = grid_ilf(lambda i, j: (1, 2, 3), 4, 3, polar_max=POLAR_MAX[kind], origin=(1, 2, 3), U=(0, 2, 0), V=(0, 0, 3))
    rng = np.random.default_rng(1)
    d = random_directions(rng, 500)
    got = f.eval(np.zeros((500, 3)), d, d * 3, depth)
    up = d[:, 0] > 0                                     # n = y x z = x
    assert np.allclose(got[up], [1, 2, 3], rtol=1e-13) and not got[~up].any()


def test_oracle_interpolates_position_linearly_and_holds_the_edge():
    f = grid_ilf(lambda i, j: (10 + 2 * i + 5 * j, i, j), 5, 4, origin=(1, 1, 0), U=(2, 0, 0), V=(0, 3, 0))
    d = unit([[0.3, -0.2, 1.0]])
    for x, y in [(1.3, 1.7), (2.99, 3.99), (-5, 2), (9, 9), (1, 1)]:
        p = np.array([[x, y, 0.0]])
        s, t = np.clip((x - 1) / 2 * 4, 0, 4), np.clip((y - 1) / 3 * 3, 0, 3)
        for back in (0.0, 2.0):                          # whatever h on the ray: p is the same
            got = f.eval(p, d, p + back * d, depth=False)
            assert np.allclose(got, [[10 + 2 * s + 5 * t, s, t]])
        assert np.allclose(f.eval(p + 7 * d, d, None), [[10 + 2 * s + 5 * t, s, t]])


def test_oracle_single_row_or_column_stands_in_the_middle():
    f = ILF(np.ones((1, 3, 2, 2, 3)), origin=(0, 0, 0), U=(2, 0, 0), V=(0, 4, 0))
    assert np.allclose(f.node(np.arange(3), np.zeros(3, int)), [[0, 2, 0], [1, 2, 0], [2, 2, 0]])
    f = ILF(np.ones((1, 1, 2, 2, 3)), U=(2, 0, 0), V=(0, 4, 0))
    assert np.allclose(f.node(np.zeros(1, int), np.zeros(1, int)), [[1, 2, 0]])


@pytest.mark.parametrize("kind", POLAR_MAX)
def test_oracle_reproduces_a_map_that_is_linear_in_the_polar_angle(kind):
    top = POLAR_MAX[kind]
    n_phi = 7
    rows = (np.arange(n_phi) + 0.5) * top / n_phi
    f = ILF(np.broadcast_to(rows[None, None, :, None, None], (1, 1, n_phi, 6, 3)), polar_max=top)
    phi = np.linspace(0, PI, 1001)
    d = np.stack([np.sin(phi), 0 * phi, np.cos(phi)], -1)
    got = f.lookup(np.zeros(1001, int), np.zeros(1001, int), d)[:, 0]
    expected = np.clip(phi, rows[0], rows[-1])           # the caps are flat: their row is constant
    assert np.allclose(got, expected, atol=1e-6)


def test_oracle_pole_is_the_mean_of_the_first_row_and_continuous():
    rng = np.random.default_rng(2)
    f = ILF(rng.uniform(size=(1, 1, 5, 9, 3)), polar_max=PI)
    z = np.zeros(1, int)
    assert np.allclose(f.lookup(z, z, np.array([[0, 0, 1.0]])), f.probes[0, 0, 0].mean(0))
    assert np.allclose(f.lookup(z, z, np.array([[0, 0, -1.0]])), f.probes[0, 0, -1].mean(0))
    half_way = PI / 5 / 4                                # half way between the pole and the first row's centre
    th = -PI + 2.5 * 2 * PI / 9                          # column 2
    d = np.array([[np.sin(half_way) * np.cos(th), np.sin(half_way) * np.sin(th), np.cos(half_way)]])
    assert np.allclose(f.lookup(z, z, d), (f.probes[0, 0, 0, 2] + f.probes[0, 0, 0].mean(0)) / 2)
    for pole in (1.0, -1.0):                             # all round the pole the values meet
        a = np.linspace(0, 2 * PI, 40)
        d = np.stack([1e-9 * np.cos(a), 1e-9 * np.sin(a), np.full(40, pole)], -1)
        got = f.lookup(np.zeros(40, int), np.zeros(40, int), d)
        assert np.ptp(got, axis=0).max() < 1e-6          # float32(pi) lies 8.7e-8 beyond the lower pole


def test_oracle_is_continuous_across_the_azimuth_seam_and_hits_texel_centres():
    rng = np.random.default_rng(3)
    f = ILF(rng.uniform(size=(1, 1, 4, 6, 3)))
    z = np.zeros(2, int)
    e = 1e-9
    got = f.lookup(z, z, np.array([[-1, e, 0.7], [-1, -e, 0.7]]))
    assert np.abs(got[0] - got[1]).max() < 1e-7
    d = f.texel_directions()                             # default frame: world = plane coordinates
    for y in range(4):
        for x in range(6):
            assert np.allclose(f.lookup(z[:1], z[:1], d[y, x][None]), f.probes[0, 0, y, x])


def test_oracle_polar_valid_holds_the_value_there():
    rng = np.random.default_rng(4)
    f = ILF(rng.uniform(size=(1, 1, 90, 8, 3)), polar_valid=MIRROR_ARRAY_VALID)
    z = np.zeros(3, int)
    a = np.array([MIRROR_ARRAY_VALID, 1.5, 3.0])
    got = f.lookup(z, z, np.stack([np.sin(a) * 0.6, np.sin(a) * 0.8, np.cos(a)], -1))
    assert np.allclose(got[1:], got[0], rtol=1e-6) and 79 < np.rad2deg(f.polar_valid) < 80
    g = ILF(f.probes, polar_valid=3.0)                   # beyond polarMax it changes nothing
    h = ILF(f.probes)
    assert np.array_equal(g.lookup(z, z, np.ones((3, 3))), h.lookup(z, z, np.ones((3, 3))))


def test_oracle_depth_correction_finds_the_point_that_was_hit():
    """A ceiling at height H that shines with E(x, y): corrected lookups give E(h), others are off by the parallax."""
    H = 1.0

    def shine(x, y):
        return np.stack([1 + 0.5 * np.sin(2 * x), 1 + 0.5 * np.cos(y), 1 + 0.3 * np.sin(x + y)], -1)

    f = ILF(np.zeros((3, 3, 120, 240, 3)), origin=(-1, -1, 0), U=(2, 0, 0), V=(0, 2, 0))
    d = f.texel_directions()
    for j in range(3):
        for i in range(3):
            q = f.node(np.array([i]), np.array([j]))[0]
            at = q + d * (H / d[..., 2])[..., None]
            f.probes[j, i] = shine(at[..., 0], at[..., 1])
    rng = np.random.default_rng(5)
    p = np.concatenate([rng.uniform(-1, 1, (400, 2)), np.zeros((400, 1))], 1)
    h = np.concatenate([rng.uniform(-1, 1, (400, 2)), np.full((400, 1), H)], 1)
    true = shine(h[:, 0], h[:, 1])
    with_depth = np.abs(f.eval(p, h - p, h, True) - true).max()
    without = np.abs(f.eval(p, h - p, h, False) - true).max()
    assert with_depth < 2e-3 and without > 0.05


def test_oracle_left_handed_frame_is_the_mirror_image():
    rng = np.random.default_rng(6)
    f = random_ilf(rng, 3, 2, 8, 6)
    mirror = np.diag([-1.0, 1, 1, 1])
    g = f.moved(mirror)
    assert np.linalg.det(g.frame()) < 0 < np.linalg.det(f.frame())
    o, d = rng.normal(size=(300, 3)), random_directions(rng, 300)
    h = o + 2 * d
    m = np.array([-1.0, 1, 1])
    for depth in (True, False):
        assert np.allclose(f.eval(o, d, h, depth), g.eval(o * m, d * m, h * m, depth), rtol=1e-9)


def test_oracle_two_halves_meet_at_the_right_azimuth():
    """theta = 0 is +u, theta = pi/2 is +v."""
    f = directional_ilf(lambda d: np.stack([d[..., 0] > 0, d[..., 1] > 0, d[..., 2] > 0.5], -1), 64, 32)
    got = f.eval(np.zeros((4, 3)), [[1, 1, 0.2], [-1, 1, 0.2], [-1, -1, 0.2], [1, -1, 3]], None)
    assert np.allclose(got, [[1, 1, 0], [0, 1, 0], [0, 0, 0], [1, 0, 1]])


# ---- ilftrace against the oracle ---------------------------------------------------------------------

def trace(path, o, d, h, depth=True, *options):
    out = run("ilftrace", *options, *([] if depth else ["--nodepth"]), path, stdin=rays_text(o, d, h)).out
    return np.loadtxt(io.BytesIO(out), ndmin=2)


def rays(rng, f, n, far=0.1):
    """Rays from about the plane in all directions that meet geometry a few plane sizes away, some at infinity."""
    size = np.linalg.norm(f.U) + np.linalg.norm(f.V)
    middle = f.origin + f.U / 2 + f.V / 2
    o = middle + rng.normal(size=(n, 3)) * size * 0.4
    d = random_directions(rng, n)
    h = o + d * size * 10 ** rng.uniform(-1, 1, (n, 1))
    h[rng.uniform(size=n) < far] = INF
    return o, d, h


CASES = {   # grid u x v, probe theta x phi, kind, half
    "1x1": ((1, 1), (16, 8), "hemisphere", False),
    "1x4": ((1, 4), (12, 7), "sphere", False),
    "3x1": ((3, 1), (9, 5), "185deg", False),
    "2x2": ((2, 2), (32, 16), "hemisphere", False),
    "5x7": ((5, 7), (10, 6), "sphere", False),
    "5x7-185": ((5, 7), (11, 13), "185deg", False),
    "30x30": ((30, 30), (16, 8), "hemisphere", False),
    "30x30-sphere": ((30, 30), (8, 8), "sphere", False),
    "half": ((4, 3), (20, 10), "185deg", True),
    "one-pixel": ((2, 3), (1, 1), "hemisphere", False),
    "one-pixel-sphere": ((1, 1), (1, 1), "sphere", False),
    "one-row": ((2, 2), (7, 1), "sphere", False),
    "one-column": ((2, 2), (1, 9), "185deg", False),
}


@pytest.mark.parametrize("depth", [True, False], ids=["depth", "nodepth"])
@pytest.mark.parametrize("case", CASES)
def test_ilftrace_agrees(tmp_path, case, depth):
    (n_u, n_v), (n_theta, n_phi), kind, half = CASES[case]
    rng = np.random.default_rng(sum(case.encode()))
    f = random_ilf(rng, n_u, n_v, n_theta, n_phi, kind, half)
    path = write_ilf(tmp_path / "f.ilf.exr", f, half)
    o, d, h = rays(rng, f, 8000)
    expected = f.eval(o, d, h, depth)
    assert 0.4 < (expected > 0).all(1).mean() < 0.6       # half of the rays come from below
    assert_same(trace(path, o, d, h, depth), expected)


@pytest.mark.parametrize("half", [False, True], ids=["float", "half"])
@pytest.mark.parametrize("compression", ["none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab"])
def test_ilftrace_reads_each_compression(tmp_path, compression, half):
    rng = np.random.default_rng(7)
    f = random_ilf(rng, 3, 2, 37, 21, half=half)
    path = write_ilf(tmp_path / "f.ilf.exr", f, half, compression)
    # lossy ones: what counts is what OpenEXR itself reads back
    f.probes = unmosaic(read_mosaic(path)[1], 3, 2)
    o, d, h = rays(rng, f, 3000)
    assert_same(trace(path, o, d, h), f.eval(o, d, h), rel=2e-3 if compression.startswith("dwa") else 1e-5)


@pytest.mark.parametrize("order", ["INCREASING_Y", "DECREASING_Y", "RANDOM_Y"])
def test_ilftrace_reads_each_order_of_tiles(tmp_path, order):
    import OpenEXR
    rng = np.random.default_rng(8)
    f = random_ilf(rng, 4, 3, 8, 5)
    path = write_ilf(tmp_path / "f.ilf.exr", f, line_order=getattr(OpenEXR, order))
    o, d, h = rays(rng, f, 2000)
    assert_same(trace(path, o, d, h), f.eval(o, d, h))


def test_ilftrace_ignores_further_parts(tmp_path):
    import OpenEXR
    rng = np.random.default_rng(9)
    f = random_ilf(rng, 3, 3, 8, 5)
    window = np.zeros(2, np.int32), np.array([23, 14], np.int32)      # shared by all parts of a file
    part = OpenEXR.Part({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "displayWindow": window},
                        {"Y": rng.uniform(size=(6, 9)).astype(np.float32)}, "derived")
    path = write_ilf(tmp_path / "f.ilf.exr", f, compression="zip", parts=[part])
    o, d, h = rays(rng, f, 2000)
    assert_same(trace(path, o, d, h), f.eval(o, d, h))


def test_ilftrace_needs_no_display_window_and_keeps_other_attributes(tmp_path):
    rng = np.random.default_rng(10)
    f = random_ilf(rng, 2, 2, 8, 5)
    path = write_ilf(tmp_path / "f.ilf.exr", f, extra={
        "displayWindow": (np.array([5, 5], np.int32), np.array([99, 70], np.int32)),
        "comments": "a comment", "owner": "nobody", "whiteLuminance": 179.0, "ilf:later": 3.0})
    o, d, h = rays(rng, f, 1000)
    assert_same(trace(path, o, d, h), f.eval(o, d, h))


@pytest.mark.parametrize("kind", POLAR_MAX)
@pytest.mark.parametrize("valid", [MIRROR_ARRAY_VALID, 0.2, 1.6, 3.1])
def test_ilftrace_polar_valid(tmp_path, kind, valid):
    rng = np.random.default_rng(11)
    f = random_ilf(rng, 3, 3, 12, 18, kind, polar_valid=valid)
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    o, d, h = rays(rng, f, 4000)
    assert_same(trace(path, o, d, h), f.eval(o, d, h))


@pytest.mark.parametrize("depth", [True, False], ids=["depth", "nodepth"])
def test_ilftrace_at_poles_seams_nodes_and_edges(tmp_path, depth):
    """Exactly representable special places on an axis-parallel plane."""
    rng = np.random.default_rng(12)
    probes = rng.uniform(0.5, 2, (3, 5, 6, 8, 3)).astype(np.float32)
    f = ILF(probes, origin=(0, 0, 0), U=(4, 0, 0), V=(0, 2, 0), polar_max=PI)
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    d = np.array([[0, 0, 1], [-1, 0, 1], [1, 0, 1], [0, 1, 1], [0, -1, 1], [-1, 1e-12, 1], [-1, -1e-12, 1], [-1, -0.0, 1],
                  [1e-9, 0, 1], [0, -1e-9, 1], [1, 0, 1e-3], [1, 1, 1e-6], [0, 0, -1], [1, 0, 0], [0, 1, 0],
                  [1, 0, -1e-12]], float)
    h = np.array([[0, 0, 0], [1, 1, 0], [4, 2, 0], [2.5, 1, 0], [-3, 7, 0], [1, 1, 1], [2, 1, 1e-3], [1, 1, -1],
                  [4, 0, -1e-3], [9, 9, 9], [3, 2, 1e-9], [INF, INF, INF]], float)
    D, H = (a.reshape(-1, 3) for a in np.broadcast_arrays(d[:, None], h[None]))
    O = np.where(np.isfinite(H), H - 0.25 * D, [1.5, 0.5, 0.25])
    got = trace(path, O, D, H, depth)
    assert_same(got, f.eval(O, D, H, depth))


def test_ilftrace_takes_directions_of_any_length(tmp_path):
    rng = np.random.default_rng(13)
    f = random_ilf(rng, 4, 4, 8, 5)
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    o, d, h = rays(rng, f, 2000)
    length = 10 ** rng.uniform(-6, 6, (2000, 1))
    assert_same(trace(path, o, d * length, h), f.eval(o, d, h))


@pytest.mark.parametrize("depth", [True, False], ids=["depth", "nodepth"])
def test_ilftrace_near_parallel_rays(tmp_path, depth):
    """Down to 1e-12 of parallel to the plane: p is far away, the edge is held, nothing is NaN."""
    rng = np.random.default_rng(14)
    f = ILF(rng.uniform(0.5, 2, (4, 5, 6, 8, 3)).astype(np.float32), origin=(-1, -1, 0), U=(2, 0, 0), V=(0, 2, 0))
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    n = 4000
    a = rng.uniform(0, 2 * PI, n)
    d = np.stack([np.cos(a), np.sin(a), 10 ** rng.uniform(-300, -3, n)], -1)
    d[: n // 2, 2] = 10 ** rng.uniform(-14, -3, n // 2)
    o = rng.uniform(-1, 1, (n, 3))
    h = o + d * rng.uniform(0.5, 3, (n, 1))
    # where |p| is huge, only the side of the plane on which it leaves matters; the rest is exact
    assert_same(trace(path, o, d, h, depth), f.eval(o, d, h, depth))


PLANES = {   # origin, U, V: exactly as far as float32 goes
    "far-away": ((1e6, -1e6, 1e6), (1, 0, 0), (0, 1, 0)),
    "tiny": ((1e-6, 2e-6, 0), (1e-6, 0, 0), (0, 0, 1e-6)),
    "huge": ((-5e5, 1e5, 0), (1e6, 0, 0), (0, 0, 1e6)),
    "ratio-1e6": ((0, 0, 0), (1e3, 0, 0), (0, 1e-3, 0)),
    "not-quite-square": ((0, 0, 0), (1, 0, 0), (0.9e-4, 1, 0)),
}


@pytest.mark.parametrize("depth", [True, False], ids=["depth", "nodepth"])
@pytest.mark.parametrize("plane", PLANES)
def test_ilftrace_extreme_planes(tmp_path, plane, depth):
    rng = np.random.default_rng(15)
    f = random_ilf(rng, 4, 3, 8, 6, plane=PLANES[plane])
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    o, d, h = rays(rng, f, 4000)
    assert_same(trace(path, o, d, h, depth), f.eval(o, d, h, depth))


@pytest.mark.parametrize("half, low, high", [(False, -38, 38), (False, -6, 6), (True, -7, 4.8)],
                         ids=["float-range", "12-decades", "half-range"])
def test_ilftrace_keeps_the_whole_range_of_values(tmp_path, half, low, high):
    """Denormals and values above half's 65504 included; each ray looks into a single constant probe."""
    n = 40
    values = 10 ** np.linspace(low, high, n)
    values = values.astype(np.float16 if half else np.float32).astype(float)
    probes = np.broadcast_to(values[None, :, None, None, None], (1, n, 2, 4, 3))
    f = ILF(probes, U=(n - 1, 0, 0))
    path = write_ilf(tmp_path / "f.ilf.exr", f, half)
    o = np.stack([np.arange(n), np.full(n, 0.5), np.zeros(n)], -1).astype(float)
    d = np.broadcast_to(unit([0.1, 0.2, 1]), (n, 3))
    got = trace(path, o, d, o + 0 * d)
    assert np.allclose(got, values[:, None].repeat(3, 1), rtol=1e-5, atol=1e-44)


def test_ilftrace_one_lit_texel(tmp_path):
    f = ILF(np.zeros((2, 2, 16, 32, 3)))
    f.probes[1, 0, 5, 9] = (4, 5, 6)
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    d = f.texel_directions().reshape(-1, 3)
    o = np.zeros_like(d) + [0, 1, 0]                     # on probe (0, 1)
    got = trace(path, o, d, o).reshape(16, 32, 3)
    assert np.allclose(got[5, 9], (4, 5, 6), rtol=1e-5)
    got[5, 9] = 0
    assert np.abs(got).max() < 1e-5


def test_ilftrace_is_continuous(tmp_path):
    """Along paths through the pole, the seam, the plane's edge and the last row, steps of 1e-7 change little."""
    rng = np.random.default_rng(16)
    f = ILF(rng.uniform(0.5, 2, (3, 3, 6, 8, 3)).astype(np.float32), U=(2, 0, 0), V=(0, 2, 0), polar_max=np.deg2rad(92.5))
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    centres = np.array([[0, 0, 1], [-1, 0, 0.5], [0.3, 0.1, 1], [1, 0.2, np.tan(np.deg2rad(5))]])
    hits = np.array([[0.5, 0.5, 1], [2, 1, 0.3], [0, 0, 0.2], [1, 1, 0.4]])
    for c in centres:
        for p in hits:
            step = rng.normal(size=(21, 3)) * 1e-7
            H = p + np.concatenate([step, np.zeros((21, 3))])
            D = c + np.concatenate([np.zeros((21, 3)), step])
            got = trace(path, H, D, H)
            assert np.ptp(got, axis=0).max() < 1e-4


@pytest.mark.parametrize("reals, sign", [(9, 1), (12, 1), (12, -1)])
def test_ilftrace_on_another_plane(tmp_path, reals, sign):
    """--plane: the material's reals."""
    rng = np.random.default_rng(19)
    f = random_ilf(rng, 3, 4, 8, 5, "sphere")
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    g = f.placed([1, 2, 3], q[0] * 2, q[1] * 0.7, np.cross(q[0], q[1]) * sign * 5 if reals == 12 else None)
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    numbers = [g.origin, g.U, g.V] + ([g.N] if reals == 12 else [])
    o, d, h = rays(rng, g, 3000)
    assert_same(trace(path, o, d, h, True, "--plane", " ".join(f"{x:.17g}" for x in np.ravel(numbers))), g.eval(o, d, h))


def test_ilftrace_reports_the_probes_that_it_used(tmp_path):
    rng = np.random.default_rng(20)
    f = random_ilf(rng, 30, 30, 4, 4, plane=((0, 0, 0), (29, 0, 0), (0, 29, 0)))
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    for ray, n in (("3.5 4.5 0 0 0 1 3.5 4.5 0\n", 4), ("3 4 0 0 0 1 3 4 0\n", 1), ("3.5 4 0 0 0 1 3.5 4 0\n", 2),
                   ("0 0 0 0 0 -1 1 1 1\n", 0)):
        assert f"{n} of 900 probes" in run("ilftrace", "--report", path, stdin=ray).err


def test_ilftrace_does_not_depend_on_threads(tmp_path):
    rng = np.random.default_rng(17)
    f = random_ilf(rng, 4, 4, 8, 5)
    path = write_ilf(tmp_path / "f.ilf.exr", f, compression="zip")
    text = rays_text(*rays(rng, f, 5000))
    one = run("ilftrace", "--threads", 1, path, stdin=text).out
    assert one == run("ilftrace", "--threads", 2, path, stdin=text).out
    assert one == run("ilftrace", path, stdin=text).out


@pytest.mark.parametrize("lit", [False, True])
def test_many_rays_at_once_are_as_one_by_one(tmp_path, lit):
    """ilf_eval_many against ilf_eval, bit by bit, for several numbers of threads (tests/c/ilfmany.c)."""
    f = random_ilf(np.random.default_rng(31), 4, 3, 16, 8, half=not lit)
    if lit:
        f.lamps = [Lamp("sphere", (.5, .5, 1.5), (9, 8, 7), radius=.5), Lamp("rectangle", (-1, .3, 2), (1, 2, 30), a=(.7, 0, 0), b=(0, .6, .1))]
    p = execute([driver("ilfmany"), write_ilf(tmp_path / "f.ilf.exr", f, half=not lit), 20001], env=environment(), capture_output=True, text=True)
    assert p.returncode == 0 and p.stderr == "" and len(p.stdout.splitlines()) == 2, p.stderr


@pytest.mark.parametrize("squeeze", ["zip", "dwaa"])
def test_many_rays_of_a_compressed_file(tmp_path, squeeze):
    """Decoded by several threads at once, and with memory for few of its probes."""
    f = random_ilf(np.random.default_rng(33), 6, 5, 16, 8, half=True)
    path = write_ilf(tmp_path / "f.ilf.exr", f, half=True, compression=squeeze)
    p = execute([driver("ilfmany"), path, 2000 if squeeze == "zip" else 400], env=environment(), capture_output=True, text=True)
    assert p.returncode == 0 and p.stderr == "", p.stderr
    rng = np.random.default_rng(34)
    text = rays_text(f.origin + rng.uniform(size=(200, 1)) * f.U + rng.uniform(size=(200, 1)) * f.V, rng.normal(size=(200, 3)), np.full((200, 3), np.inf))
    few = run("ilftrace", "--memory", ".001", "--report", path, stdin=text)
    assert few.out == run("ilftrace", path, stdin=text).out and "0.0 MB decoded" in few.err


def test_ilftrace_nothing_in_nothing_out(tmp_path):
    path = write_ilf(tmp_path / "f.ilf.exr", directional_ilf(lambda d: d * 0 + 1, 4, 4))
    assert run("ilftrace", path).out == b""


@pytest.mark.parametrize("bad", [
    "1 2 3\n", "0 0 0 0 0 1 0 0\n", "0 0 0 0 0 one 0 0 1\n", "0 0 0 nan 0 1 0 0 1\n", "0 0 0 0 0 1 0 nan 1\n",
    "0 0 0 inf 0 1 0 0 1\n", "nan 0 0 0 0 1 inf inf inf\n"])
def test_ilftrace_refuses_what_is_no_ray(tmp_path, bad):
    path = write_ilf(tmp_path / "f.ilf.exr", directional_ilf(lambda d: d * 0 + 1, 4, 4))
    r = run("ilftrace", path, stdin="0 0 0 0 0 1 0 0 1\n" + bad, code=1)
    assert "2" in r.err, "the line's number"
    assert r.err.count("\n") == 1 and r.err.startswith("ilftrace: ")
    assert "nan" not in r.text.lower()


def test_ilftrace_a_direction_of_length_zero_is_no_nan(tmp_path):
    path = write_ilf(tmp_path / "f.ilf.exr", directional_ilf(lambda d: d * 0 + 1, 4, 4))
    r = run("ilftrace", path, stdin="0 0 0 0 0 0 0 0 1\n", code=None)
    assert r.code in (0, 1) and "nan" not in r.text.lower()


@pytest.mark.sweep
def test_ilftrace_agrees_on_many_rays(tmp_path):
    def compare(grid, kind, mode):
        rng = np.random.default_rng(18)
        f = random_ilf(rng, *grid, 64, 32, kind, decades=3)
        path = write_ilf(tmp_path / "f.ilf.exr", f)
        for _ in range(2):
            o, d, h = rays(rng, f, 100000)
            assert_same(trace(path, o, d, h, mode == "depth"), f.eval(o, d, h, mode == "depth"))
    sweep(compare, [(grid, kind, mode) for grid in ((1, 1), (2, 2), (30, 30)) for kind in POLAR_MAX for mode in ("depth", "nodepth")])
