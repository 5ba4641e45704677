"""falloffcal: known falloff curves recovered from synthetic pictures, outliers, few angles, a real flat field."""
import numpy as np
import pytest
from PIL import Image

import fishremap_util as U
from conftest import one_line_error, run, shared_data
from svg_util import Plot

HALF = np.radians(92.5)


def paper_like(theta, strength):
    """About a factor of 1.95 at 90 degrees, flat on the axis, as in the paper's figure 6."""
    return 1 / (1 + strength * (np.asarray(theta) / (np.pi / 2)) ** 2 * (0.7 + 0.3 * (np.asarray(theta) / (np.pi / 2)) ** 2))


STRENGTH = (0.95, 0.85, 1.05)


def source_picture(deg, azimuth, rng, noise=0.02, size=400, level=5., patch=7.):
    """A disc of constant radiance at field angle deg, seen through the falloff; noise per pixel."""
    a = U.direction(azimuth, deg)
    y, x = np.mgrid[0:size, 0:size]
    px, py = (x + .5) / size * 2 - 1, 1 - (y + .5) / size * 2
    t, psi = np.hypot(px, py) * HALF, np.arctan2(py, px)
    d = np.stack([-np.sin(t) * np.cos(psi), np.sin(t) * np.sin(psi), np.cos(t)], -1)
    lit = (d @ a > np.cos(np.radians(patch / 2))) & (t <= HALF)
    image = np.stack([paper_like(t, s) for s in STRENGTH], -1) * np.where(lit, level, 0.02)[..., None]
    return image * (1 + noise * rng.normal(size=image.shape))


def calibrate(tmp_path, shots, *args, code=0):
    names = []
    for k, (deg, image) in enumerate(shots):
        names.append(f"{U.write_exr(tmp_path / f's{k:02d}.exr', image)}@{deg}")
    r = run("falloffcal", "--lens", "equidistant", "--fov", 185, *args, "-o", tmp_path / "falloff.txt", *names, code=code)
    return r if code else np.loadtxt(tmp_path / "falloff.txt")


def check(table, tolerance, up_to=92.5):
    rows = table[table[:, 0] <= up_to]
    for c in range(3):
        truth = paper_like(np.radians(rows[:, 0]), STRENGTH[c])
        assert np.abs(rows[:, 1 + c] / truth - 1).max() < tolerance
    assert (table[:, 1:4] > 0).all()
    assert (np.diff(table[:, 1:4], axis=0) <= 1e-6).all()   # the printed digits end there


TWENTY = np.linspace(0, 89, 20)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_twenty_angles_to_half_a_percent(tmp_path, seed):
    rng = np.random.default_rng(seed)
    check(calibrate(tmp_path, [(d, source_picture(d, rng.uniform(0, 360), rng)) for d in TWENTY]), 0.005)


def test_noise_per_reading_stays_within_its_stated_deviation(tmp_path):
    """A source that flickers by 2 %: no fit can undo that, but it knows how wrong it is."""
    rng = np.random.default_rng(4)
    inside = []
    for trial in range(4):
        table = calibrate(tmp_path, [(d, source_picture(d, 0, rng) * (1 + .02 * rng.normal())) for d in TWENTY])
        for c in range(3):
            error = np.abs(table[:, 1 + c] - paper_like(np.radians(table[:, 0]), STRENGTH[c]))
            inside.append((error < 3 * table[:, 4 + c] + 1e-4).mean())
            assert error.max() < 0.04
    assert np.mean(inside) > 0.9


def test_wild_outliers_survive(tmp_path):
    rng = np.random.default_rng(5)
    shots = [(d, source_picture(d, 10 * d, rng)) for d in TWENTY]
    for k, factor in ((3, 10), (9, .05), (16, 1.6)):
        shots[k] = (shots[k][0], shots[k][1] * factor)
    check(calibrate(tmp_path, shots), 0.005)


def test_three_angles(tmp_path):
    rng = np.random.default_rng(6)
    table = calibrate(tmp_path, [(d, source_picture(d, 45, rng)) for d in (0, 45, 88)])
    check(table, 0.03)
    assert (table[table[:, 0] > 90][:, 4:] > table[table[:, 0] == 45][:, 4:] * .99).all()


def test_extrapolation_says_how_unsure_it_is(tmp_path):
    rng = np.random.default_rng(7)
    table = calibrate(tmp_path, [(d, source_picture(d, 80, rng)) for d in np.linspace(0, 65, 12)])
    check(table, 0.006, up_to=65)
    check(table, 0.05)
    assert (table[-1, 4:] > 3 * table[60, 4:]).all()


def test_hot_pixels_are_no_source(tmp_path):
    rng = np.random.default_rng(8)
    shots = []
    for d in TWENTY:
        image = source_picture(d, 200, rng)
        image[rng.integers(0, 400, 5), rng.integers(0, 400, 5)] = 1000
        shots.append((d, image))
    check(calibrate(tmp_path, shots), 0.006)


def test_the_curve_undoes_the_falloff(tmp_path):
    """End to end: fishremap with falloffcal's file makes a constant scene constant again."""
    rng = np.random.default_rng(9)
    calibrate(tmp_path, [(d, source_picture(d, 33, rng)) for d in TWENTY], "--plot", tmp_path / "plot.svg")
    plot, table = Plot(tmp_path / "plot.svg"), np.loadtxt(tmp_path / "falloff.txt")
    assert len(plot.lines()) == len(plot.bands()) == 3 and len(plot.xticks) == 10 and "degrees" in plot.xlabel
    assert len(plot.dots()) + len(plot.dots(full=False)) == 3 * len(TWENTY)
    for c, (line, (low, high)) in enumerate(zip(plot.lines(), plot.bands())):
        v, sd = (np.interp(line[:, 0], table[:, 0], table[:, k]) for k in (1 + c, 4 + c))
        assert np.abs(line[:, 1] - v).max() < 2e-3
        assert np.abs(high[:, 1] - low[:, 1] - 4 * sd).max() < 2e-3 and (low[:, 1] <= line[:, 1] + 1e-4).all()
    y, x = np.mgrid[0:256, 0:256]
    t = np.hypot((x + .5) / 128 - 1, (y + .5) / 128 - 1) * HALF
    U.write_exr(tmp_path / "flat.exr", np.stack([paper_like(t, s) for s in STRENGTH], -1))
    run("fishremap", "--lens", "equidistant", "--fov", 185, "--size", "40x40", "--falloff", tmp_path / "falloff.txt",
        "-o", tmp_path / "o.exr", tmp_path / "flat.exr")
    assert np.abs(U.read_exr(tmp_path / "o.exr")[0] - 1).max() < 0.006


def test_a_proven_rise_is_kept(tmp_path):
    """The office lens: V(rn) = 1 + 0.1755 rn^2 - 0.5286 rn^4 rises by 1.4 % before it falls."""
    rng = np.random.default_rng(10)
    y, x = np.mgrid[0:400, 0:400]
    r = np.hypot((x + .5) / 200 - 1, (y + .5) / 200 - 1)
    v = np.where(r < 1, 1 + .1755 * r ** 2 - .5286 * r ** 4, 0)
    U.write_exr(tmp_path / "flat.exr", np.repeat(v[..., None], 3, -1) * (1 + .02 * rng.normal(size=(400, 400, 3))))
    run("falloffcal", "--lens", "equidistant", "--fov", 186, "--flat", tmp_path / "flat.exr", "-o", tmp_path / "f.txt")
    table = np.loadtxt(tmp_path / "f.txt")
    table = table[table[:, 0] <= 92]   # the rings' readings end there
    rn = table[:, 0] / 93
    assert np.abs(table[:, 2] / (1 + .1755 * rn ** 2 - .5286 * rn ** 4) - 1).max() < 0.005


def test_real_flat_field(tmp_path):
    """The measured Coolpix flat field (four raw bands): the curve runs through the medians of its rings."""
    picture = shared_data("fisheye_falloff_and_projection_calibration") / "flat_field_image.tif"
    (tmp_path / "lens.txt").write_text("polynomial 0.6380 0.0307 -0.0200\n")
    run("falloffcal", "--lens", tmp_path / "lens.txt", "--fov", 180, "--linear", "--flat", picture, "-o", tmp_path / "f.txt")
    table = np.loadtxt(tmp_path / "f.txt")
    bands = np.asarray(Image.open(picture))
    y, x = np.mgrid[0:756, 0:756]
    t = np.linspace(0, np.pi / 2, 9001)
    p = .6380 * t + .0307 * t ** 2 - .02 * t ** 3
    angle = np.degrees(np.interp(np.hypot(x + .5 - 378, y + .5 - 378) / 378, p / p[-1], t))
    axis = bands[angle < 8].mean(0)
    for deg in (20, 30, 50, 70, 80, 88):
        ring = bands[np.abs(angle - deg) < .5].mean(0)
        for c in range(3):
            assert np.interp(deg, table[:, 0], table[:, 1 + c]) == pytest.approx(ring[c] / axis[c], abs=0.01)


def test_refusals(tmp_path):
    assert "--flat" in run("falloffcal", "--help").text
    one_line_error(run("falloffcal", "-o", "x", "a@3", code=2), "falloffcal", "--lens")
    one_line_error(run("falloffcal", "--lens", "equidistant", "--fov", 185, "-o", tmp_path / "x", "a.exr", code=2), "falloffcal", "IMAGE@DEG")
    one_line_error(run("falloffcal", "--lens", "equidistant", "--fov", 185, "-o", tmp_path / "x", "none.exr@10", code=1), "falloffcal", "none.exr")
    rng = np.random.default_rng(11)
    one = [(10, source_picture(10, 0, rng))]
    one_line_error(calibrate(tmp_path, one, code=1), "falloffcal", "at least 2")
    one_line_error(calibrate(tmp_path, [(120, one[0][1])] * 2, code=1), "falloffcal", "120")
    one_line_error(calibrate(tmp_path, [(10, np.zeros((64, 64, 3)))] * 2, code=1), "falloffcal", "black")
    assert not (tmp_path / "falloff.txt").exists()
