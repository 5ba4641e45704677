"""Any capture, within what its programs accept: hypothesis chooses lenses, pictures, readings, series, arrays, stages."""
import json

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

import fishremap_util as U
from conftest import driver, environment, one_line_error, run
from hdrgen_util import CAMERAS, expose, hdrgen, inverse, log2_errors, radiance, read_exr, scene, write_png, write_times
from process import execute
from stability.conftest import examples
from stability.test_any_field import log_uniform, seeds
from stage_util import session
from test_falloffcal import HALF
from test_fishremap_array import corner_text, photograph

FISH, HDR = "tools/fishremap/", "tools/hdrgen/"


# ---- lenses and the remap ----------------------------------------------------------------------------------------

@given(st.lists(st.tuples(log_uniform(1e-4, 1), log_uniform(1e-6, 1e6)), min_size=1, max_size=12), st.floats(.1, 1), st.floats(1, 180))
@pytest.mark.case("any lens table", FISH + "lens.c", "1..12 steps 1e-4 .. 1 wide, 1e-6 .. 1e6 high", "the inverse, to rounding, at 17 radii")
def test_any_lens_table(tmp_path, steps, share, last):
    """fuzz_lens holds what it is given against the lens's own curve (fuzz_lens.c)."""
    angle, r = np.cumsum([[0, 0], *steps], axis=0).T
    angle, r = angle / angle[-1] * last, r / r[-1]
    assume((np.diff(angle) > 1e-9).all() and (np.diff(r) > 0).all())
    path = tmp_path / "lens.txt"
    path.write_text("table\n" + "".join(f"{a!r} {b!r}\n" for a, b in zip(angle.tolist(), r.tolist())) + f"fov {2 * last * share!r}\n")
    p = execute([driver("fuzz_lens"), str(path)], capture_output=True, text=True, env=environment())
    assert p.returncode == 0, (path.read_text(), p.stderr)


LENSES = {"equidistant": 360, "equisolid": 360, "stereographic": 350, "orthographic": 180}


@given(seeds, st.sampled_from(sorted(LENSES)), st.floats(.05, 1), st.tuples(st.integers(1, 40), st.integers(1, 40)), st.tuples(st.integers(1, 48), st.integers(1, 24)),
       st.tuples(st.floats(-.5, 1.5), st.floats(-.5, 1.5)), log_uniform(.3, 60), st.tuples(st.floats(0, 180), st.floats(-360, 360)), st.floats(5, 180), st.floats(0, 12),
       st.one_of(st.just("area"), st.floats(.25, 3).map(lambda sd: f"gaussian:{sd!r}")))
@pytest.mark.case("any remap", FISH + "plan.c", "field 18 .. 360 degrees, circle anywhere, pictures 1 .. 40, tilted, to 12 decades", "constant stays constant, 0 <= rest <= twice the largest, or refused")
def test_any_remap(tmp_path, worst, seed, lens, share, size, out, centre, radius, lean, polar_max, decades, filter_):
    """A mean of planes in pixels that are nowhere below 0, and so nowhere above twice the pixel; what is not seen is black."""
    picture = 10 ** np.random.default_rng(seed).uniform(-decades / 2, decades / 2, (size[1], size[0], 3))
    picture[..., 2] = .25
    U.write_exr(tmp_path / "in.exr", picture)
    r = run("fishremap", "--lens", lens, "--fov", LENSES[lens] * share, "--centre", f"{centre[0] * size[0]!r},{centre[1] * size[1]!r}", "--radius", radius, "--tilt", lean[0],
            "--tilt-to", lean[1], "--polar-max", polar_max, "--filter", filter_, "--size", f"{out[0]}x{out[1]}", "-o", tmp_path / "out.exr", tmp_path / "in.exr", code=None)
    if r.code:
        one_line_error(r, "fishremap")
        assert not (tmp_path / "out.exr").exists()
        return
    got = U.read_exr(tmp_path / "out.exr")[0]
    (tmp_path / "out.exr").unlink()
    assert np.isfinite(got).all()
    alpha = got[..., 3] if got.shape[2] == 4 else np.ones(got.shape[:2])
    assert ((alpha >= 0) & (alpha <= 1)).all() and (got[alpha == 0] == 0).all()
    seen = got[alpha > 0][:, :3]          # the mean of what is seen; alpha says how much that is
    if seen.size:
        assert (seen >= 0).all() and (seen[:, :2] <= 2.0001 * picture[..., :2].max((0, 1))).all()
        worst(np.abs(seen[:, 2] / .25 - 1).max(), 1e-6, f"{lens}, {size} to {out}")


# ---- falloff -----------------------------------------------------------------------------------------------------

def disc_seen(deg, side, curve, noise, rng, level=5., patch=12.):
    """A constant disc at a field angle (to the right), through the falloff curve(theta)."""
    y, x = np.mgrid[0:side, 0:side]
    px, py = (x + .5) / side * 2 - 1, 1 - (y + .5) / side * 2
    t, psi = np.hypot(px, py) * HALF, np.arctan2(py, px)
    d = np.stack([np.sin(t) * np.cos(psi), np.sin(t) * np.sin(psi), np.cos(t)], -1)
    lit = (d @ [np.sin(np.radians(deg)), 0, np.cos(np.radians(deg))] > np.cos(np.radians(patch / 2))) & (t <= HALF)
    return (curve(t) * np.where(lit, level, .02))[..., None] * (1 + noise * rng.normal(size=(side, side, 3)))


@examples(10, 300)
@given(seeds, st.lists(st.integers(0, 88), min_size=2, max_size=14, unique=True), st.floats(0, 3), st.sampled_from([2, 4]), st.floats(0, .05), st.floats(0, .2))
@pytest.mark.case("any falloff from any angles", FISH + "falloff_fit.c", "2..14 angles, to a fourth at 90 degrees, noise to 5 %, a fifth wild", "positive; right between readings near each other; or refused")
def test_any_falloff(tmp_path, worst, seed, angles, strength, power, noise, wild):
    rng = np.random.default_rng(seed)

    def curve(t):
        return 1 / (1 + strength * (t / (np.pi / 2)) ** power)
    angles = np.sort(angles)
    # not the last: what lies beyond all others, nobody can tell from a lens that falls steeply
    false = 1 + rng.permutation(len(angles) - 2)[:int(wild * len(angles))] if len(angles) >= 10 else []
    names = []
    for k, deg in enumerate(angles):
        image = disc_seen(deg, 160, curve, noise, rng) * (rng.choice([.1, .5, 2, 10]) if k in false else 1)
        names.append(f"{U.write_exr(tmp_path / f's{k}.exr', image)}@{deg}")
    r = run("falloffcal", "--lens", "equidistant", "--fov", 185, "-o", tmp_path / "falloff.txt", *names, code=None)
    if r.code:
        one_line_error(r, "falloffcal")
        assert not (tmp_path / "falloff.txt").exists()
        return
    table = np.loadtxt(tmp_path / "falloff.txt")
    (tmp_path / "falloff.txt").unlink()
    assert np.isfinite(table).all() and (table[:, 1:4] > 0).all()
    # eight good readings less than 20 degrees apart: the curve is known between them, up to one factor; each has some 100 pixels
    good = np.array([a for k, a in enumerate(angles) if k not in false])
    inside = table[(table[:, 0] >= good[0]) & (table[:, 0] <= good[-1])]
    if len(good) < 8 or np.diff(good).max() > 20:
        return
    ratio = inside[:, 1:4] / curve(np.radians(inside[:, 0]))[:, None]
    worst(np.abs(ratio / np.median(ratio, 0) - 1).max(), .01 + noise, f"{len(angles)} angles, noise {noise:.3f}, {len(false)} wild")


# ---- exposure series -----------------------------------------------------------------------------------------------

@examples(10, 300)
@given(seeds, st.integers(2, 10), log_uniform(1.3, 16), st.sampled_from(sorted(CAMERAS)), st.sampled_from([255, 65535]), log_uniform(1e-6, 1e6))
@pytest.mark.case("response of any camera from any series", HDR + "debevec.c", "2..10 exposures 1.3 .. 16 apart, 8 and 16 bits, lambda 1e-6 .. 1e6", "finite; 3 or more, to 4 apart, lambda .1 .. 1e3: median error < .1 stops; or refused")
def test_any_series(tmp_path, worst, seed, count, ratio, camera, top, smooth):
    """Beyond 4 the curve between two exposures is the smoothness's guess: no data tells it.  Nor does any below lambda .1
    (steps of 3.65, 8 bits: .013 stops at .3 and above, .03 at .1, .13 at .01)."""
    span = np.log10(ratio) * (count - 1)
    assume(span < 7)
    truth = scene(100, 100, decades=span + 1, lowest=-span - 1.1, seed=seed)
    rng = np.random.default_rng(seed)
    names = [f"{k}.png" for k in range(count)]
    times = ratio ** np.arange(count)
    for name, t in zip(names, times):
        write_png(tmp_path / name, expose(truth, t, CAMERAS[camera], max_code=top, rng=rng))
    write_times(tmp_path, names, times)
    r = hdrgen(tmp_path, names, "--lambda", repr(smooth), "--flags", code=None)
    if r.code:
        one_line_error(r, "hdrgen")
        assert not (tmp_path / "out.exr").exists()
        return
    ch, _ = read_exr(tmp_path / "out.exr")
    got = radiance(tmp_path / "out.exr")
    (tmp_path / "out.exr").unlink()
    assert all(np.isfinite(c).all() for c in ch.values()) and (got > 0).all()
    seen = ch["flags"] == 0
    if ratio <= 4 and count > 2 and .1 <= smooth <= 1e3 and seen.mean() > .3:
        worst(np.median(np.abs(log2_errors(got, truth)[seen])), .1, f"{camera}, {count} exposures {ratio:.3g} apart, {top}, lambda {smooth:.2g}")


@given(seeds, st.integers(1, 8), log_uniform(1.05, 1e3), st.sampled_from(["noise", "debevec"]), st.sampled_from(["linear", "gamma:2.2"]))
@pytest.mark.case("any codes merged", HDR + "merge.c", "codes at random, contradictory, 1..8 exposures 1.05 .. 1e3 apart", "positive; debevec: between what its exposures say, or flagged")
def test_any_codes(tmp_path, seed, count, ratio, weight, response):
    """A mean lies between the least and the largest; a code stands for half a code to either side of it.  Weights by noise
    correct for what black and white cut off, so that there contradictory codes need not stay between."""
    rng = np.random.default_rng(seed)
    codes = rng.integers(0, 256, (count, 12, 12, 3), dtype=np.uint8)
    times = np.minimum(ratio ** np.arange(count), 1e9)
    names = [f"{k}.png" for k in range(count)]
    for name, c in zip(names, codes):
        write_png(tmp_path / name, c)
    write_times(tmp_path, names, times)
    hdrgen(tmp_path, names, "--response", response, "--weight", weight, "--flags", "--sigma")
    ch, _ = read_exr(tmp_path / "out.exr")
    got, flags = radiance(tmp_path / "out.exr"), ch["flags"]
    assert all(np.isfinite(c).all() for c in ch.values()) and (got > 0).all()
    if weight == "noise":
        return
    f = CAMERAS["linear" if response == "linear" else "gamma"]
    valid = (codes > 0) & (codes < 255)
    t = times[:, None, None, None]
    low = np.where(valid, inverse(f, np.clip(codes - .5, 0, 255), 255) / t, np.inf).min(0)
    high = np.where(valid, inverse(f, np.clip(codes + .5, 0, 255), 255) / t, 0).max(0)
    sure = (flags == 0) & valid.any(0).all(-1)
    assert sure.any()
    assert (got >= low * (1 - 1e-5))[sure].all() and (got <= high * (1 + 1e-5))[sure].all()


# ---- sphere arrays -------------------------------------------------------------------------------------------------

@examples(3, 100)
@given(seeds, st.integers(3, 5), st.integers(2, 4), st.integers(16, 45), st.floats(1, 1.3), st.floats(-5, 5))
@pytest.mark.case("any sphere array, corners by hand", FISH + "spherefind.c", "3..5 x 2..4 spheres of 16..45 pixels, turned to 5 degrees, 3 pixels off", "centres to a pixel or 4 % of the radius, or it says whose rims it did not find")
def test_any_array(tmp_path, worst, seed, n, m, radius, gap, turn):
    image, centres = photograph(U.lobes(10, seed % 1000, 1.5), n, m, radius=radius, pitch=2 * radius * gap, turn=turn, seed=seed)
    U.write_exr(tmp_path / "array.exr", image)
    text = corner_text(centres, n, m, radius, np.random.default_rng(seed), min(3, radius / 8))
    r = run("fishremap", "--array", f"{n}x{m}", "--size", "8x6", "--report", tmp_path / "r.json", "--corners", text, "-o", tmp_path / "out.ilf.exr", tmp_path / "array.exr", code=None)
    if r.code:
        one_line_error(r, "fishremap")
        return
    found = json.loads((tmp_path / "r.json").read_text())
    off = np.abs(np.array(found["spheres"])[:, :2] - centres).max()
    if found["spheres_from"] == "corners":        # as good as those, and it says so
        assert "corners" in r.err and off < 3 * 2 ** .5
        return
    assert 2 * found["rims_seen"] > n * m
    if found["rims_seen"] < n * m:
        assert f"rims of {found['rims_seen']} of {n * m} spheres" in r.err
        return
    worst(off, max(.04 * radius, 1), f"{n} x {m} of {radius} pixels, gap {gap:.2f}, turned {turn:.1f}")


# ---- the stage -----------------------------------------------------------------------------------------------------

@given(st.tuples(st.integers(1, 12), st.integers(1, 12)), st.tuples(st.floats(.01, 1), st.floats(.01, 1)), st.tuples(st.floats(-600, 200), st.floats(-600, 200)),
       st.sampled_from([("x", "y"), ("y", "x"), ("-x", "y"), ("x", "-y"), ("-y", "-x")]), st.tuples(st.floats(-3, 3), st.floats(-3, 3)), st.sampled_from(["serpentine", "raster"]))
@pytest.mark.case("any grid on any stage", "tools/stagectl/plan.c", "1..12 x 1..12 nodes, origin, axes, backlash", "refused exactly when a point or its approach leaves the travel")
def test_any_stage(tmp_path, nodes, edges, origin, axes, backlash, order):
    """The approach here from its description: beyond the target, against the side of approach, where an axis comes from the wrong side."""
    low, high = np.array([-500, -450.]), np.array([50, 100.])
    path = session(tmp_path, grid={"nodes": f"{nodes[0]}x{nodes[1]}", "plane": f"0 0 0 {edges[0]!r} 0 0 0 {edges[1]!r} 0", "order": order},
                   stage={"origin": f"{origin[0]!r} {origin[1]!r}", "axes": " ".join(axes), "backlash": f"{backlash[0]!r} {backlash[1]!r}", "travel": "-500 50 -450 100"})
    at, points = None, []
    for j in range(nodes[1]):
        row_ = range(nodes[0])
        for i in reversed(row_) if order == "serpentine" and j % 2 else row_:
            target = np.array(origin, float)
            for edge, axis, k, n in zip(edges, axes, (i, j), nodes):
                target["xy".index(axis[-1])] += (-1 if axis[0] == "-" else 1) * 1000 * (edge * k / (n - 1) if n > 1 else edge / 2)
            wrong = [b != 0 and (at is None or (t - a) * b < 0) for t, a, b in zip(target, target if at is None else at, backlash)]
            points += [target - np.array(backlash) * wrong, target]
            at = target
    out = max((low - points).max(), (points - high).max())
    assume(abs(out) > 1e-4)
    r = run("stagectl", "plan", path, code=None)
    if out > 0:
        one_line_error(r, "stagectl", "expected")
        assert r.code == 1
    else:
        assert r.code == 0 and "all points inside" in r.text
