"""The lookup where numbers are hard: far away, tiny, huge, grazing; ten million rays; error growth measured against an
oracle in long double."""
import struct
import subprocess

import numpy as np
import pytest
from hypothesis import given, strategies as st

from conftest import BUILD, command, environment, one_line_error, run, run_measured
from ilf_util import ILF, assert_same, edited, f32, random_ilf, sparse_ilf, tile_offsets, unit, write_ilf
from process import execute, Process
from stability.conftest import WIDE
from test_ilf_eval import trace
from test_ilf_sampling import sample

STORM = str(BUILD / "test/ilfstorm")
EVAL, FRAME, PROBE = "ilfmat/lookup/ilf_eval.c", "ilfmat/lookup/ilf_frame.c", "ilfmat/file/ilf_probe.c"


# ---- an oracle in long double --------------------------------------------------------------------------

class Precise(ILF):
    """As ILF, positions in 80-bit numbers: origin, U, V, rays may need them far from the world's origin."""

    def eval(self, o, d, h=None, depth=True):
        L = np.longdouble
        u, v = (np.asarray(a, L) / np.sqrt((np.asarray(a, L) ** 2).sum()) for a in (self.U, self.V))
        F = np.stack([u, v, np.cross(u, v)])
        h, d = np.asarray(h, L), np.asarray(d, L)
        dl, rel = (d[:, None] * F).sum(2), h - np.asarray(self.origin, L)
        local = (rel[:, None] * F).sum(2)
        lu, lv = (np.sqrt((np.asarray(a, L) ** 2).sum()) for a in (self.U, self.V))
        # the rest is well conditioned: near the plane's own origin in plane coordinates
        near = ILF(self.probes, (0, 0, 0), (1, 0, 0), (0, 1, 0), self.polar_max, self.polar_valid)
        near.U, near.V = np.array([float(lu), 0, 0]), np.array([0, float(lv), 0])
        return near.eval(local.astype(float), dl.astype(float), local.astype(float), depth)


def field(rng, plane, **kw):
    """Polar angle and range moderate: an angle's error is then not multiplied by more than about 50 (texels a radian)."""
    g = random_ilf(rng, 5, 4, 24, 8, decades=0.6, plane=((0, 0, 0), (1, 0, 0), (0, 1, 0)), **kw)
    p = Precise(g.probes, polar_max=g.polar_max)
    p.origin, p.U, p.V = (np.asarray(a, float) for a in plane)
    return g, p


def plane_text(p):
    return " ".join(f"{x:.17g}" for x in [*p.origin, *p.U, *p.V])


def local_rays(rng, p, n):
    """Rays about the plane: hit points within a plane's size of it, made in long double, rounded to double once."""
    d = unit(np.stack([*rng.normal(size=(2, n)), rng.uniform(.3, 1.5, n)], -1)) @ p.frame()
    local = np.stack([rng.uniform(0, 1, n), rng.uniform(0, 1, n)], -1)
    size = np.linalg.norm(p.U)
    h = p.origin + local[:, :1] * p.U + local[:, 1:] * p.V + d * size * rng.uniform(.2, 1, (n, 1))
    return h - d * size * .1, d, h


def relative(found, expected):
    return np.abs(found / expected - 1).max()


@pytest.mark.parametrize("offset", [1.0, 1e2, 1e4, 1e6])
@pytest.mark.case("scene far from the world's origin", EVAL, "offset of the plane / its size", "error <= 64 eps offset x texels")
def test_error_growth_with_offset(tmp_path, offset, row):
    """All rounding that counts is of coordinates: eps x offset, times the lookup's slope (24/2pi texels a radian at less than
    0.6 decades = ratio 4 a texel, a probe each 1/4 of the plane)."""
    rng = np.random.default_rng(1)
    g, p = field(rng, ((offset, -offset, offset), (1, .2, .1), (-.2, 1, 0)))
    p.V = p.V - p.U * (p.U @ p.V) / (p.U @ p.U)
    path = write_ilf(tmp_path / "f.ilf.exr", g)
    o, d, h = local_rays(rng, p, 3000)
    got = trace(path, o, d, h, True, "--plane", plane_text(p))
    error = relative(got, p.eval(o, d, h))
    bound = 64 * np.finfo(float).eps * offset * 24 + 2e-7          # and the result's own float
    row(condition=f"offset {offset:g}", error=f"{error:.2e} <= {bound:.2e}", result="double suffices")
    assert error <= bound


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1.0, 1e3, 1e6])
@pytest.mark.case("scene scaled", EVAL, "scale of plane and rays", "the same radiance to 1e-4")
def test_error_growth_with_scale(tmp_path, scale, row):
    rng = np.random.default_rng(2)
    g, p = field(rng, (np.array([.3, -.2, .1]) * scale, np.array([0, 1., 1]) * scale, np.array([1., 0, 0]) * scale))
    path = write_ilf(tmp_path / "f.ilf.exr", g)
    o, d, h = local_rays(rng, p, 3000)
    error = relative(trace(path, o, d, h, True, "--plane", plane_text(p)), p.eval(o, d, h))
    row(condition=f"scale {scale:g}", error=f"{error:.2e} <= 1e-4", result="independent of the scale")
    assert error <= 1e-4


@pytest.mark.parametrize("offset", [1e2, 1e4, 1e6])
@pytest.mark.case("scene far away, plane from the file's header (float)", FRAME, "offset / size", "2^-24 offset: ilfpack says so")
def test_float_header_far_away(tmp_path, offset, row):
    """The header's v3f is where float is not enough: what it rounds is said when it is packed."""
    import OpenEXR
    rng = np.random.default_rng(3)
    for k in range(4):
        OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": f32(rng.uniform(.5, 2, (4, 8, 3))).astype(np.float32)}).write(str(tmp_path / f"{k}.exr"))
    x = offset + 1 / 3
    r = run("ilfpack", "--grid", "2x2", "--plane", f"{x!r} 0 0 1 0 0 0 1 0", "--type", "float", "-o", "f.ilf.exr",
            "0.exr", "1.exr", "2.exr", "3.exr", cwd=tmp_path)
    shift = abs(float(np.float32(x)) - x)
    said = "rounds" in r.err
    row(condition=f"offset {offset:g}", error=f"origin {shift:.1e} of a pitch off", result="warned" if said else "no word needed")
    assert said == (shift > 1e-3)


@pytest.mark.case("U and V of very different length", FRAME, "|U|/|V| 1e6, 1e-6", "oracle to 1e-5")
def test_ratio_of_edges(tmp_path, row):
    worst = 0
    for k, (u, v) in enumerate([(1e3, 1e-3), (1e-3, 1e3)]):
        rng = np.random.default_rng(4 + k)
        g, p = field(rng, ((0, 0, 0), (u, 0, 0), (0, v, 0)))
        path = write_ilf(tmp_path / f"{k}.ilf.exr", g)
        d = unit(np.stack([rng.normal(size=2000), rng.normal(size=2000), rng.uniform(.3, 1, 2000)], -1))
        local = np.stack([rng.uniform(0, u, 2000), rng.uniform(0, v, 2000), np.zeros(2000)], -1)
        h = local + d * min(u, v) * .7
        worst = max(worst, relative(trace(path, h, d, h, True, "--plane", plane_text(p)), p.eval(h, d, h)))
    row(error=f"{worst:.2e} <= 1e-5")
    assert worst <= 1e-5


# ---- ten million rays --------------------------------------------------------------------------------------

FIELDS = {
    "185deg": dict(shape=(4, 3, 16, 8), kind="185deg", polar_valid=1.4), "sphere": dict(shape=(4, 3, 16, 8), kind="sphere", half=True),
    "1x1": dict(shape=(1, 1, 1, 1), kind="hemisphere"), "1xm": dict(shape=(1, 7, 5, 3), kind="hemisphere"),
    "12-decades": dict(shape=(3, 3, 12, 6), kind="hemisphere", decades=12), "lit-texel": None}


@pytest.fixture(scope="module")
def fields(tmp_path_factory):
    folder, paths = tmp_path_factory.mktemp("fields"), {}
    for k, (name, spec) in enumerate(FIELDS.items()):
        rng = np.random.default_rng(50 + k)
        if spec is None:
            f = ILF(np.zeros((3, 4, 8, 16, 3)), U=(1, 0, 0), V=(0, 1, 0))
            f.probes[1, 2, 3, 4], f.probes[0, 0, 0, 0] = 1e6, 1e-3
        else:
            spec = dict(spec)
            f = random_ilf(rng, *spec.pop("shape"), **spec)
        paths[name] = write_ilf(folder / f"{name}.ilf.exr", f, half=bool(spec and spec.get("half")))
    return paths


def facts(text):
    words = text.split()
    return {k: float(v) for k, v in zip(words[::2], words[1::2])}


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.case("random and adversarial rays through libilf", EVAL, "1.7e6 rays, scales 1e-6..1e6",
                  "finite, >= 0, continuous, equal at all scales")
def test_rays_by_the_million(fields, name, row):
    """Six fields make 1e7; grazing, poles, seam, nodes, at probes, horizon, far and below (see ilfstorm.c)."""
    n = 1_700_000
    p = execute([STORM, "lib", str(fields[name]), "7", str(n)], capture_output=True, text=True)
    got = facts(p.stdout)
    assert got["rays"] == n and got["pairs"] > n / 8 and got["scaled"] > n / 8
    row(condition=f"{name}, {n:.2g} rays, scales 1e-6..1e6", result=f"{got['jumps']:.0f} jumps, {got['nonfinite']:.0f} NaN, {got['negative']:.0f} < 0",
        error=f"largest step {got['worst_jump']:.2f} of the slope's; scales {got['worst_scale']:.1e} <= 1e-4")
    assert p.returncode == 0, (p.stdout, p.stderr)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("name, depth", [("185deg", True), ("sphere", False), ("lit-texel", True)])
@pytest.mark.case("random and adversarial rays through ilftrace", "ilfmat/programs/ilftrace.c", "rays", "finite, >= 0, continuous")
def test_rays_through_ilftrace(fields, name, depth, scale, row):
    """1e5 each in the suite, 1.2e6 (1e7 in all) in make stability."""
    n = (1_200_000 if WIDE else 60_000)
    path, env = str(fields[name]), environment()
    plane = execute([STORM, "plane", path, repr(scale)], capture_output=True, text=True, check=True).stdout.strip()
    give = Process([STORM, "rays", path, "8", str(n), repr(scale)], stdout=subprocess.PIPE)
    middle = Process(command("ilftrace", [*([] if depth else ["--nodepth"]), "--plane", plane, path]), stdin=give.stdout,
                     stdout=subprocess.PIPE, env=env)
    give.stdout.close()
    p = execute([STORM, "check", path, "8", str(n), "depth" if depth else "nodepth"], stdin=middle.stdout, capture_output=True,
                text=True)
    middle.stdout.close()
    assert give.wait() == 0 and middle.wait() == 0
    got = facts(p.stdout)
    row(condition=f"{name}, {n:.2g} rays at scale {scale:g}", result=f"{got['jumps']:.0f} jumps, {got['nonfinite']:.0f} NaN, {got['negative']:.0f} < 0",
        error=f"largest step {got['worst_jump']:.2f} of the slope's")
    assert p.returncode == 0, (p.stdout, p.stderr)


# ---- single extremes, with hypothesis about them ---------------------------------------------------------------

finite = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(st.tuples(*[finite] * 9), min_size=1, max_size=8), st.booleans())
@pytest.mark.case("any nine finite numbers as a ray", EVAL, "denormals to 1.8e308", "finite, >= 0, or refused")
def test_any_ray(tmp_path_factory, numbers, depth):
    path = tmp_path_factory.getbasetemp() / "any.ilf.exr"
    if not path.exists():
        write_ilf(path, random_ilf(np.random.default_rng(9), 3, 3, 7, 5))
    for ray in numbers:
        r = run("ilftrace", *([] if depth else ["--nodepth"]), path, stdin=" ".join(repr(x) for x in ray) + "\n", code=None)
        if r.code:
            assert not any(ray[3:6]), ray
            one_line_error(r, "ilftrace", "direction")
        else:
            rgb = np.array(r.text.split(), float)
            assert np.isfinite(rgb).all() and (rgb >= 0).all()


@given(st.floats(1e-300, 1e-3), st.floats(-np.pi, np.pi))
@pytest.mark.case("grazing rays, any steepness", EVAL, "d.n from 1e-300 to 1e-3", "edge held: the limit's value")
def test_grazing(tmp_path_factory, up, azimuth):
    """Far above a small plane a grazing ray comes from beyond its edge: any smaller angle gives the same radiance."""
    path = tmp_path_factory.getbasetemp() / "graze.ilf.exr"
    f = ILF(np.random.default_rng(10).uniform(.5, 2, (4, 5, 6, 8, 3)).astype(np.float32), origin=(-1, -1, 0), U=(2, 0, 0), V=(0, 2, 0))
    if not path.exists():
        write_ilf(path, f)
    a = np.array([[np.cos(azimuth), np.sin(azimuth), min(up, 1e-3)], [np.cos(azimuth), np.sin(azimuth), 1e-300]])
    h = np.array([[0, 0, 3000.0], [0, 0, 3000.0]])
    got = trace(path, h, a, h, False)
    # no farther in direction than the last row's centre, beyond which it is held
    if up < np.pi / 2 / 12:
        sides = np.abs([np.cos(azimuth), np.sin(azimuth)]) * 3000 / up
        if sides.min() > 2:
            assert_same(got[:1], got[1:], rel=1e-6)


@pytest.mark.case("float denormals and the largest float", "ilfmat/lookup/ilf_eval_avx2.c", "1.4e-45 .. 3.4e38", "exact")
def test_ends_of_float(tmp_path):
    v = np.array([1.4e-45, 1e-40, 1.1754944e-38, 3.4028235e38], np.float32)
    f = ILF(np.broadcast_to(v[None, :, None, None, None], (1, 4, 3, 5, 3)).astype(float), U=(3, 0, 0), V=(0, 1, 0))
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    o = np.stack([np.arange(4), np.full(4, .5), np.zeros(4)], -1).astype(float)
    got = trace(path, o, np.broadcast_to([0.1, .2, 1.], (4, 3)), o)
    assert (np.abs(got / v[:, None].astype(float) - 1)[1:] < 1e-5).all() and got[0, 0] > 0


@pytest.mark.case("sampling light near the largest float", "ilfmat/sampling/ilf_slice.c", "radiance 1e36 .. 3e38", "densities finite, integral 1")
@pytest.mark.parametrize("level", [1e-38, 1e-3, 1e36])
def test_sampler_at_any_level(tmp_path, level, row):
    """Found by fuzzing: sums of weights left a float's range.  The draws depend on the light's shape alone."""
    rng = np.random.default_rng(11)
    f = random_ilf(rng, 3, 3, 16, 8, plane=((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    f.probes[:, :, 2, 3] *= 60
    u = rng.uniform(size=(2000, 3))
    draws = []
    for x in (1.0, level):
        path = write_ilf(tmp_path / f"{x:g}.ilf.exr", ILF(f32(f.probes * x), U=(1, 0, 0), V=(0, 1, 0)))
        draws.append(sample(path, np.array([.4, .6, .2]), u)[:, :4])
    a, b = draws
    assert (a[:, 3] > 0).all() and np.isfinite(b).all()
    error = np.abs(a - b).max() / np.abs(a).max()
    row(condition=f"radiance x {level:g}", error=f"draws differ by {error:.1e} <= 1e-3", result="same draws")
    assert error < 1e-3


@pytest.mark.case("light field of enormous grid", "ilfmat/file/ilf_file.c", "46340 x 46340 probes, 1 texel", "refused or opened in little memory")
def test_enormous_grid(tmp_path, row):
    """A table of 2^31 tiles in a file of 1 kB: refused by the file's length, before the table is asked for."""
    path = sparse_ilf(tmp_path / "f.ilf.exr", 2, 2, 1, 1)
    big = edited(path.read_bytes(), "dataWindow", value=struct.pack("<4i", 0, 0, 46339, 46339))
    path.write_bytes(edited(big, "displayWindow", value=struct.pack("<4i", 0, 0, 46339, 46339)))
    result, peak = run_measured("ilfinfo", path, code=1)
    one_line_error(result, "ilfinfo", "table of")
    row(result=f"refused at {peak / 1e6:.0f} MB")
    assert peak < 100e6


@pytest.mark.parametrize("compression", ["none", "zip"])
@pytest.mark.case("truncated light field, opened only", "ilfmat/file/ilf_file.c", "1 byte to a probe short", "refused at once, not in the middle of a picture")
def test_truncation_is_seen_at_once(tmp_path, compression):
    path = write_ilf(tmp_path / "f.ilf.exr", random_ilf(np.random.default_rng(12), 3, 2, 8, 4), compression=compression)
    data = path.read_bytes()
    run("ilftrace", path)
    for less in (1, 2, 20, 100):
        path.write_bytes(data[:-less])
        one_line_error(run("ilftrace", path, code=1), "ilftrace", "truncated")
    for where in (0, 8, len(data), 2 ** 63):
        table, offsets = tile_offsets(data)
        b = bytearray(data)
        struct.pack_into("<Q", b, table + 8 * (len(offsets) - 1), where)
        path.write_bytes(b)
        one_line_error(run("ilftrace", path, code=1), "ilftrace", "probe (2,1)")
