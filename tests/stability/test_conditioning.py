"""Condition numbers, measured: of the response's solve and of the falloff's fit, beside numpy's on a system built here."""
import re

import numpy as np
import pytest

import fishremap_util as U
from conftest import TOP, run
from hdrgen_util import expose, f_gamma, hdrgen, make_series, radiance, scene, write_png, write_times
from test_falloffcal import STRENGTH, paper_like, source_picture

SOLVE, FIT = "tools/hdrgen/debevec.c", "tools/fishremap/falloff_fit.c"
EPS = np.finfo(float).eps


def conditions(text, word):
    return [float(x) for x in re.findall(word + r".*?condition ([0-9.e+-]+)", text)]


@pytest.mark.parametrize("lam", ["1e-6", "1e-3", "1", "1e3", "1e6"])
@pytest.mark.case("condition of the response's solve", SOLVE, "lambda", "condition x eps < 1e-3, curve to 0.03 stops")
def test_condition_against_smoothness(tmp_path, lam, row):
    truth = scene(160, 160, decades=4, lowest=-2)
    names = make_series(tmp_path, truth, 2.0 ** np.arange(-6, 2), f_gamma)
    r = hdrgen(tmp_path, names, "--verbose", "--lambda", lam)
    first, refined = conditions(r.err, "first response"), conditions(r.err, "refined")
    assert len(first) == 3 and all(np.isfinite(first)) and all(np.isfinite(refined))
    worst = max(first + refined)
    row(condition=f"lambda {lam}: {max(first):.3g} (first), {max(refined or [0]):.3g} (refined)", error=f"condition x eps = {worst * EPS:.1e} < 1e-3",
        result="by QR: not squared")
    assert worst * EPS < 1e-3


@pytest.mark.case("smoothness acts", SOLVE, "lambda 1e-3 against 1e6", "condition at least 10 times higher")
def test_smoothness_acts(tmp_path, row):
    """The penalty's rows outweigh the data's by the square root of lambda: a solve whose condition does not rise has none."""
    names = make_series(tmp_path, scene(100, 100, decades=4, lowest=-2), 2.0 ** np.arange(-6, 2), f_gamma)
    soft, stiff = (max(conditions(hdrgen(tmp_path, names, "--verbose", "--lambda", lam).err, "first response")) for lam in ("1e-3", "1e6"))
    row(error=f"{soft:.3g} and {stiff:.3g}")
    assert stiff > 10 * soft


@pytest.mark.parametrize("what, times", [("2 exposures", [.25, 1]), ("16 exposures", 2.0 ** np.arange(-12, 4)), ("ratio 1e3", [1e-3, 1]), ("steps of 1/6 stop", 2.0 ** (np.arange(8) / 6 - 1))])
@pytest.mark.case("condition of the response's solve", SOLVE, "exposures", "condition x eps < 1e-3, or refused")
def test_condition_against_exposures(tmp_path, what, times, row):
    truth = scene(160, 160, decades=3 if len(times) > 2 else 1.6, lowest=-2)
    names = make_series(tmp_path, truth, list(times), f_gamma)
    r = hdrgen(tmp_path, names, "--verbose", code=None)
    if r.code:
        row(condition=what, result="refused: " + r.err.strip()[-60:])
        assert r.err.count("\n") == 1
        return
    worst = max(conditions(r.err, "first response") + conditions(r.err, "refined"))
    row(condition=f"{what}: {worst:.3g}", error=f"condition x eps = {worst * EPS:.1e} < 1e-3")
    assert worst * EPS < 1e-3


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.case("noise of one code in the response", SOLVE, "one code up or down at random", "curve moves by less than 0.05 stops")
def test_sensitivity_of_the_response(tmp_path, bits, row):
    """What conditioning is about: the same scene with other noise gives the same radiance."""
    truth = scene(120, 120, decades=3, lowest=-2)
    times = 2.0 ** np.arange(-5, 2)
    top = 2 ** bits - 1
    pictures = []
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        names = []
        for k, t in enumerate(times):
            names.append(f"{seed}_{k}.png")
            write_png(tmp_path / names[-1], expose(truth, t, f_gamma, max_code=top, rng=rng))
        write_times(tmp_path, names, times)
        hdrgen(tmp_path, names, out=f"{seed}.exr")
        pictures.append(radiance(tmp_path / f"{seed}.exr"))
    d = np.log2(pictures[0] / pictures[1])
    moved = abs(np.median(d - np.median(d)))
    spread = np.abs(np.percentile(d, [5, 95]) - np.median(d)).max()
    row(condition=f"{bits} bits", error=f"median {moved:.3f}, 90 % within {spread:.3f} stops (noise of single pixels included)")
    assert moved < 0.05 and spread < 0.3


# ---- falloff ---------------------------------------------------------------------------------------------------------

def nodes():
    return int(re.search(r"FIT_NODES (\d+)", (TOP / "tools/fishremap/falloff_fit.h").read_text()).group(1))


def normal_matrix(t, lam):
    """The fit's matrix from its description: cubic rows at the readings, third differences, even about the axis."""
    n = nodes()
    A = np.zeros((n, n))
    for x in t * (n - 1):
        k = int(min(max(np.floor(x), 0), n - 2))
        k0 = min(k - 1, n - 4)
        s = x - k0
        c = [-(s - 1) * (s - 2) * (s - 3) / 6, s * (s - 2) * (s - 3) / 2, -s * (s - 1) * (s - 3) / 2, s * (s - 1) * (s - 2) / 6]
        row_ = np.zeros(n)
        for i in range(4):
            row_[abs(k0 + i)] += c[i]
        A += np.outer(row_, row_)
    for k in range(n - 2):
        row_ = np.zeros(n)
        for i, c in enumerate((-1, 3, -3, 1)):
            row_[abs(k - 1 + i)] += c
        A += lam * np.outer(row_, row_)
    return A + 1e-12 * np.eye(n)


@pytest.mark.parametrize("what, angles", [("3 angles", [0, 40, 85]), ("20 angles", np.linspace(0, 89, 20)), ("20 angles within 10 degrees", np.linspace(0, 10, 20)),
                                          ("twice the same angle", [0, 30, 30, 60, 85])])
@pytest.mark.case("condition of the falloff's fit", FIT, "readings x stiffness 1e-4 .. 1e10", "Cholesky's error cond x eps < 1e-2")
def test_condition_of_the_falloff_fit(what, angles, row):
    """The normal equations are solved (N is small): that squares the condition, and the stiffest fits come near to
    what double can bear.  Stiff fits are polynomials of few parameters, whose own error is measured below."""
    t = np.asarray(angles) / 92.5
    worst, soft = (np.linalg.cond(normal_matrix(t, lam)) for lam in (1e10, 1e-2))
    row(condition=f"{what}: {soft:.2g} at stiffness 1e-2, {worst:.2g} at 1e10", error=f"cond x eps {soft * EPS:.1e} .. {worst * EPS:.1e}")
    assert soft * EPS < 1e-2


@pytest.mark.parametrize("what, angles, tolerance", [("3 angles", [0, 40, 85], .03), ("2 angles", [0, 60], None), ("20 angles", np.linspace(0, 89, 20), .005),
                                                     ("20 within 10 degrees", np.linspace(0, 10, 20), None), ("the same angle 3 times", [50, 50, 50], None)])
@pytest.mark.case("error of the falloff's fit", FIT, "readings", "right inside the readings, positive beyond, or refused")
def test_falloff_readings(tmp_path, what, angles, tolerance, row):
    rng = np.random.default_rng(5)
    names = [f"{U.write_exr(tmp_path / f's{k}.exr', source_picture(d, 40, rng, noise=.005))}@{d}" for k, d in enumerate(angles)]
    r = run("falloffcal", "--lens", "equidistant", "--fov", 185, "-o", tmp_path / "falloff.txt", *names, code=None)
    if r.code:
        row(condition=what, result="refused: " + r.err.strip()[-60:])
        assert tolerance is None and r.err.count("\n") == 1 and not (tmp_path / "falloff.txt").exists()
        return
    table = np.loadtxt(tmp_path / "falloff.txt")
    assert np.isfinite(table).all() and (table[:, 1:4] > 0).all()
    inside = table[(table[:, 0] <= max(angles)) & (table[:, 0] >= min(angles))]
    if not len(inside):
        inside = table[:1]
    # relative to the first angle read: nothing is known of the axis without a reading there
    error = max(np.abs(inside[:, 1 + c] / inside[0, 1 + c] / (paper_like(np.radians(inside[:, 0]), STRENGTH[c]) / paper_like(np.radians(inside[0, 0]), STRENGTH[c])) - 1).max()
                for c in range(3))
    beyond = table[-1, 1:4].min()
    row(condition=what, error=f"{error:.4f} inside" + (f" <= {tolerance}" if tolerance else ""), result=f"{beyond:.3f} at the rim")
    assert error <= (tolerance or .06) and (table[:, 1:4] < 1.5).all()


@pytest.mark.parametrize("seed", [1, 4, 7])
@pytest.mark.case("falloff of a flat lens from noisy readings", FIT, "9 readings, 2 % each", "never rises by chance, within 6 % (3 sigma)")
def test_flat_and_noisy(tmp_path, seed, row):
    rng = np.random.default_rng(seed)
    names = []
    for k, d in enumerate(np.linspace(0, 88, 9)):
        im = source_picture(d, 90 * k, rng, noise=.005, size=200)
        y, x = np.mgrid[0:200, 0:200]
        t = np.hypot((x + .5) / 100 - 1, (y + .5) / 100 - 1) * np.radians(92.5)
        flat = np.stack([im[..., c] / paper_like(t, STRENGTH[c]) for c in range(3)], -1) * (1 + .02 * rng.normal())
        names.append(f"{U.write_exr(tmp_path / f's{k}.exr', flat)}@{d}")
    run("falloffcal", "--lens", "equidistant", "--fov", 185, "-o", tmp_path / "falloff.txt", *names)
    table = np.loadtxt(tmp_path / "falloff.txt")
    rise, off = np.diff(table[:, 1:4], axis=0).max(), np.abs(table[table[:, 0] <= 88, 1:4] - 1).max()
    row(condition=f"seed {seed}", error=f"largest rise {rise:.1e} <= 1e-6, off by {off:.3f}")
    assert rise <= 1e-6 and off < .06


@pytest.mark.case("falloff that is zero at the edge", FIT, "vignette to 1e-4 at 80 degrees", "refused, or positive and falling")
def test_falloff_zero_at_the_edge(tmp_path, row):
    """A lens hood: nothing comes beyond 80 degrees."""
    rng = np.random.default_rng(6)
    shots = []
    for d in [0, 15, 30, 45, 60, 75, 88]:
        im = source_picture(d, 0, rng, noise=.002)
        y, x = np.mgrid[0:400, 0:400]
        t = np.degrees(np.hypot((x + .5) / 200 - 1, (y + .5) / 200 - 1) * np.radians(92.5))
        shots.append((d, im * np.clip((84 - t) / 10, 0, 1)[..., None]))
    names = [f"{U.write_exr(tmp_path / f's{k}.exr', image)}@{deg}" for k, (deg, image) in enumerate(shots)]
    r = run("falloffcal", "--lens", "equidistant", "--fov", 185, "-o", tmp_path / "falloff.txt", *names, code=None)
    if r.code:
        row(result="refused: " + r.err.strip()[-70:])
        assert r.err.count("\n") == 1 and not (tmp_path / "falloff.txt").exists()
    else:
        table = np.loadtxt(tmp_path / "falloff.txt")
        row(result=f"{table[-1, 1]:.3g} at the rim: {r.err.strip()[:60]}")
        assert (table[:, 1:4] > 0).all() and np.isfinite(table).all()
        # no logarithm takes a zero: the reading is left out, which has to be said
        assert table[-1, 1] < .05 or "left out" in r.err, r.err
