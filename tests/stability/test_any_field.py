"""Any light field, within the format's limits: hypothesis chooses plane, grid, probes, range and rays about the hard places."""
import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

import fishremap_util as U
from conftest import one_line_error, run
from ilf_util import ILF, PI, assert_same, f32, random_ilf, read_mosaic, unit, unmosaic, write_ilf
from stability.conftest import examples
from stability.test_lookup import Precise, field, plane_text, relative
from test_ilf_eval import rays, trace
from test_ilf_sampling import UNIFORM, density, info, sample

EPS = np.finfo(float).eps
seeds = st.integers(0, 2 ** 32 - 1)


def log_uniform(low, high):
    return st.floats(np.log10(low), np.log10(high)).map(lambda x: 10 ** x)


@given(seeds, log_uniform(1e-6, 1e6), log_uniform(1e-6, 1e6), log_uniform(1e-3, 1e6), st.booleans())
@pytest.mark.case("any plane", "ilfmat/lookup/ilf_frame.c", "edges 1e-6 .. 1e6, ratio to 1e6, up to 1e6 edges away, any turn", "oracle in long double")
def test_any_plane(tmp_path, worst, seed, across, along, away, depth):
    """Coordinates round to eps x distance; against the shorter edge that is the error in probes' pitches (test_lookup.py)."""
    assume(1e-6 <= across / along <= 1e6)
    rng = np.random.default_rng(seed)
    F = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    short = min(across, along)
    origin = unit(rng.normal(size=3)) * away * short
    g, p = field(rng, (origin, F[0] * across, F[1] * along))
    path = write_ilf(tmp_path / "f.ilf.exr", g)
    n = 300
    d = unit(np.stack([*rng.normal(size=(2, n)), rng.uniform(.3, 1.5, n)], -1)) @ p.frame()
    # edges as rounded are perpendicular to eps only: hits at random places on the rectangle, then up along the ray
    h = p.origin + rng.uniform(size=(n, 1)) * p.U + rng.uniform(size=(n, 1)) * p.V + d * short * rng.uniform(.2, 1, (n, 1))
    got = trace(path, h - d * short * .1, d, h, depth, "--plane", plane_text(p))
    reach = np.abs(p.origin).max() + across + along
    worst(relative(got, p.eval(h - d * short * .1, d, h, depth)), 1e-6 + 64 * EPS * 24 * reach / short, f"edges {across:.2g}, {along:.2g}, {away:.2g} edges away")


@given(seeds, st.tuples(st.integers(1, 7), st.integers(1, 7)), st.tuples(st.integers(1, 33), st.integers(1, 17)),
       st.one_of(st.sampled_from(["hemisphere", "185deg", "sphere"]), st.floats(.02, PI)), st.one_of(st.none(), st.floats(.1, 1)),
       st.floats(0, 12), st.sampled_from(["none", "zip", "zips", "rle", "piz"]), st.booleans(), st.booleans())
@pytest.mark.case("any grid, probes and range", "ilfmat/lookup/ilf_eval_avx2.c", "1..7 x 1..7 probes of 1..33 x 1..17, polarMax .02 .. pi, to 12 decades", "oracle to 1e-5")
def test_any_shape(tmp_path, seed, grid, size, kind, valid, decades, compression, half, depth):
    rng = np.random.default_rng(seed)
    f = random_ilf(rng, *grid, *size, kind, half, decades=min(decades, 8) if half else decades)
    f.polar_valid = None if valid is None else float(f32(valid * f.polar_max))
    path = write_ilf(tmp_path / "f.ilf.exr", f, half=half, compression=compression)
    o, d, h = rays(rng, f, 300)
    assert_same(trace(path, o, d, h, depth), f.eval(o, d, h, depth))


@given(seeds, st.tuples(st.integers(1, 3), st.integers(1, 3)), st.tuples(st.integers(1, 40), st.integers(1, 20)), st.sampled_from(["half", "float"]),
       st.sampled_from(["none", "rle", "zip", "zips", "piz"]), st.floats(-9, 3), st.floats(0, 8), st.one_of(st.none(), st.sampled_from([np.nan, np.inf, -np.inf])), st.booleans())
@pytest.mark.case("any probes packed", "ilfmat/file/ilf_write.c", "1..3 x 1..3 probes of 1..40 x 1..20, 1e-9 .. 1e11, NaN, inf", "the same numbers, rounded to the type; or refused, the old file whole")
def test_any_probes(tmp_path, seed, grid, size, kind, compression, low, decades, spoilt, interleaved):
    rng = np.random.default_rng(seed)
    probes = (10 ** rng.uniform(low, low + decades, (grid[1], grid[0], size[1], size[0], 3))).astype(np.float32)
    probes[rng.uniform(size=probes.shape) < .1] = 0
    if spoilt is not None:
        probes[tuple(rng.integers(0, n) for n in probes.shape)] = spoilt
    names = []
    for k, p in enumerate(probes.reshape(-1, *probes.shape[2:])):
        names.append(f"{k}.exr")
        U.write_exr(tmp_path / names[-1], p)
    (tmp_path / "f.ilf.exr").write_bytes(b"old")
    r = run("ilfpack", "--grid", f"{grid[0]}x{grid[1]}", "--plane", "0 0 0 1 0 0 0 2 0", "--type", kind, "--compression", compression,
            *(["--interleave"] if interleaved and compression == "none" else []), "-o", "f.ilf.exr", *names, cwd=tmp_path, code=None)
    fits = np.isfinite(probes).all() and (kind == "float" or probes.max() <= 65504)
    if r.code:
        assert not fits
        one_line_error(r, "ilfpack", ".exr")
        assert (tmp_path / "f.ilf.exr").read_bytes() == b"old"
    else:
        assert fits
        _, mosaic = read_mosaic(tmp_path / "f.ilf.exr")
        assert (unmosaic(mosaic, *grid) == probes.astype(np.float16 if kind == "half" else np.float32)).all()
    assert sorted(x.name for x in tmp_path.iterdir()) == sorted(["f.ilf.exr", *names])
    for name in names:
        (tmp_path / name).unlink()


@examples(12)
@given(seeds, st.tuples(st.integers(1, 5), st.integers(1, 5)), st.tuples(st.integers(1, 32), st.integers(1, 12)), st.sampled_from(["hemisphere", "185deg", "sphere"]),
       st.integers(0, 6), log_uniform(1e-3, 1e9), log_uniform(1e-3, 1e3), st.booleans())
@pytest.mark.case("sampling any field from anywhere", "ilfmat/sampling/ilf_draw.c", "0..6 lamps, 1e-3 .. 1e9 of the rest, points 1e-3 .. 1e3 planes away", "densities finite, positive, the same drawn and asked")
def test_any_lamps(tmp_path, worst, seed, grid, size, kind, lamps, bright, away, near):
    rng = np.random.default_rng(seed)
    f = random_ilf(rng, *grid, *size, kind, decades=1, plane=((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    for _ in range(lamps):
        f.probes[tuple(rng.integers(0, n) for n in f.probes.shape[:4])] *= bright
    path = write_ilf(tmp_path / "f.ilf.exr", ILF(f32(f.probes), U=(1, 0, 0), V=(0, 1, 0), polar_max=f.polar_max))
    points = np.array([.5, .5, 0]) + unit(rng.normal(size=(40, 3))) * away
    options = ["--sphere", f"0.5,0.5,0,{2 * away + 2}"] if near else ["--nodepth"]
    drawn = sample(path, points, rng.uniform(size=(40, 3)), *options)
    none = drawn[:, 3] == -1                   # nothing bright is seen from there: nothing to draw, and it says so
    assert none.all() or info(path, *options)[1] > 0
    assert (drawn[none][:, [0, 1, 2, 4, 5]] == 0).all()
    if none.all():
        return
    drawn, points = drawn[~none], points[~none]
    d, p = drawn[:, :3], drawn[:, 3]
    # [4]: how far off the light is, or inf
    assert np.isfinite(drawn[:, [0, 1, 2, 3, 5]]).all() and (drawn[:, 4] > 0).all() and (p > 0).all()
    worst(np.abs(np.linalg.norm(d, axis=1) - 1).max(), 1e-6, "length of directions")
    assert (d[:, 2] > -1e-6).all() and (p >= UNIFORM * (1 - 1e-5)).all()
    # asked for the direction as drawn: the same cell, but where it lies on an edge, and no more than rounding apart
    again = density(path, points, d, *options)
    same = np.abs(again / p - 1) < 1e-4
    assert same.mean() > .9, (again / p)[~same]
