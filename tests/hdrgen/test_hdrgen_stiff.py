"""Stiff and extreme series: a right answer, or a refusal that says why; never NaN or inf."""
import numpy as np
import pytest
from PIL import Image

from conftest import one_line_error
from hdrgen_util import (expose, f_gamma, f_linear, f_srgb, hdrgen, log2_errors, make_series, radiance, read_exr, scene,
                         write_png, write_times)


def sane(folder, out="out.exr"):
    """The picture; finite and positive everywhere, its extra channels too."""
    ch, _ = read_exr(folder / out)
    for name, pix in ch.items():
        assert np.isfinite(pix).all(), name
    got = radiance(folder / out)
    assert (got > 0).all()
    return got


def test_two_exposures(tmp_path):
    truth = scene(160, 160, decades=1.6, lowest=-1.7)
    names = make_series(tmp_path, truth, [0.25, 1.0], f_gamma)
    hdrgen(tmp_path, names, "--sigma")
    d = log2_errors(sane(tmp_path), truth)
    assert np.median(np.abs(d)) < 0.05 and np.percentile(np.abs(d), 99) < 0.5


def test_two_exposures_known_response(tmp_path):
    truth = scene(160, 160, decades=2, lowest=-2)
    names = make_series(tmp_path, truth, [0.25, 1.0], f_srgb)
    hdrgen(tmp_path, names, "--response", "srgb")
    d = log2_errors(sane(tmp_path), truth)
    assert np.median(np.abs(d)) < 0.02


def test_one_image_needs_a_response(tmp_path):
    truth = scene(40, 40, decades=1, lowest=-1.1)
    names = make_series(tmp_path, truth, [1.0], f_srgb)
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", "two images", "--response")
    assert not (tmp_path / "out.exr").exists()
    hdrgen(tmp_path, names, "--response", "srgb")
    d = np.log2(sane(tmp_path) / truth)
    assert np.median(np.abs(d)) < 0.03 and abs(np.median(d)) < 0.005


def test_identical_exposures_cannot_tell_the_response(tmp_path):
    truth = scene(60, 60, decades=1.5, lowest=-1.6)
    names = make_series(tmp_path, truth, [0.5] * 4, f_gamma)
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", "different exposure", "--response")


def test_identical_exposures_average(tmp_path):
    truth = scene(100, 100, decades=1.5, lowest=-1.6)
    names = make_series(tmp_path, truth, [0.5] * 8, f_gamma)
    hdrgen(tmp_path, names, "--response", "gamma:2.2", out="all.exr")
    hdrgen(tmp_path, names[:1], "--response", "gamma:2.2", out="one.exr")
    errors = [np.std(np.log2(sane(tmp_path, o) / truth)) for o in ("all.exr", "one.exr")]
    assert errors[0] < errors[1] / 2      # sqrt(8) = 2.8, less what rounding shares


def test_times_a_million_apart(tmp_path):
    truth = scene(80, 80, decades=0.5, lowest=-0.6)
    names = make_series(tmp_path, truth, [1e-6, 1.0], f_gamma)
    # nothing is seen by both: no response can be had
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", "neither black nor clipped", "--response")
    assert not (tmp_path / "out.exr").exists()
    hdrgen(tmp_path, names, "--response", "gamma:2.2", "--flags")
    d = np.log2(sane(tmp_path) / truth)
    assert np.median(np.abs(d)) < 0.03


def test_gap_between_exposures_is_bounded_and_flagged(tmp_path):
    # radiance 10: clipped at 1 s, black at 1 us: between 1 and what code 1/2 means in 1 us
    truth = np.full((20, 20, 3), 10.0)
    names = make_series(tmp_path, truth, [1e-6, 1.0], f_linear)
    r = hdrgen(tmp_path, names, "--response", "linear", "--flags", "--sigma")
    ch, _ = read_exr(tmp_path / "out.exr")
    assert (ch["flags"] == 4).all()
    assert (ch["G"] > 0.99).all() and (ch["G"] < 0.01 / 1e-6).all() and (ch["sigma.G"] > 1).all()
    assert "between two bounds" in r.err


@pytest.mark.parametrize("lam", ["1e-6", "1e-3", "1", "1e3", "1e6"])
def test_smoothness_over_twelve_decades(tmp_path, lam):
    truth = scene(200, 200, decades=4, lowest=-2)
    names = make_series(tmp_path, truth, 2.0 ** np.arange(-6, 2), f_gamma)
    hdrgen(tmp_path, names, "--lambda", lam)
    d = np.abs(log2_errors(sane(tmp_path), truth))
    assert np.median(d) < 0.03            # a gamma curve is what infinite smoothness assumes


def test_all_clipped(tmp_path):
    truth = np.full((32, 40, 3), 50.0)
    names = make_series(tmp_path, truth, [0.5, 1.0, 2.0], f_gamma)
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", "neither black nor clipped", "found 0")
    r = hdrgen(tmp_path, names, "--response", "linear", "--flags")
    ch, _ = read_exr(tmp_path / "out.exr")
    assert (ch["flags"] == 1).all()
    assert np.allclose(ch["R"], 2 * 254.5 / 255, rtol=1e-3)   # the shortest exposure's lower bound
    assert "clipped in every exposure" in r.err and "1280 pixels" in r.err


def test_all_black(tmp_path):
    truth = np.full((32, 40, 3), 1e-9)
    names = make_series(tmp_path, truth, [0.5, 1.0, 2.0], f_linear, noise=False)
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", "neither black nor clipped", "found 0")
    r = hdrgen(tmp_path, names, "--response", "linear", "--flags", "--sigma")
    ch, _ = read_exr(tmp_path / "out.exr")
    assert (ch["flags"] == 2).all()
    assert np.allclose(ch["B"], 0.5 / 255 / 2, rtol=0.01)     # the longest exposure's upper bound
    assert "black in every exposure" in r.err


def test_sixteen_bit(tmp_path):
    truth = scene(256, 256, decades=3.5, lowest=-2)
    names = make_series(tmp_path, truth, 2.0 ** np.arange(-6, 2), f_gamma, max_code=65535)
    hdrgen(tmp_path, names, "--response", "gamma:2.2", out="true.exr")
    hdrgen(tmp_path, names, "--sigma")
    got = sane(tmp_path)
    d, best = (np.median(np.abs(log2_errors(x, truth))) for x in (got, sane(tmp_path, "true.exr")))
    assert best < 0.009 and d < 1.05 * best         # as good as with the true response
    ch, _ = read_exr(tmp_path / "out.exr")
    scale = np.exp(np.median(np.log(got / truth)))
    sigma = np.stack([ch["sigma." + c] for c in "RGB"], -1)
    assert 0.64 < (np.abs(got - truth * scale) < sigma).mean() < 0.72


def test_one_channel_dead(tmp_path):
    truth = scene(120, 120, decades=3, lowest=-1.5)
    times = 2.0 ** np.arange(-5, 2)
    rng = np.random.default_rng(2)
    names = []
    for k, t in enumerate(times):
        z = expose(truth, t, f_gamma, rng=rng)
        z[..., 2] = 0
        names.append(f"exp_{k}.png")
        write_png(tmp_path / names[-1], z)
    write_times(tmp_path, names, times)
    # its response can't be recovered: named; with a given one the others come out right and it is a bound
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", "channel 2", "--response")
    hdrgen(tmp_path, names, "--response", "gamma:2.2", "--flags")
    got = sane(tmp_path)
    assert np.median(np.abs(log2_errors(got[..., :2], truth[..., :2]))) < 0.02
    assert got[..., 2].max() < 1e-3
    ch, _ = read_exr(tmp_path / "out.exr")
    assert (ch["flags"].astype(int) & 2 == 2).all()


def test_dead_channel_clipped(tmp_path):
    truth = scene(60, 60, decades=2, lowest=-1.5)
    times = [0.25, 0.5, 1]
    names = []
    for k, t in enumerate(times):
        z = expose(truth, t, f_gamma, rng=np.random.default_rng(k))
        z[..., 0] = 255
        names.append(f"exp_{k}.png")
        write_png(tmp_path / names[-1], z)
    write_times(tmp_path, names, times)
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", "channel 0")


def test_one_time_wrong_by_two(tmp_path):
    truth = scene(200, 200, decades=4, lowest=-2)
    true = 2.0 ** np.arange(-7, 2)
    names = make_series(tmp_path, truth, true, f_gamma)
    said = true.copy()
    said[4] *= 2
    write_times(tmp_path, names, said)
    hdrgen(tmp_path, names, out="blind.exr")
    sane(tmp_path, "blind.exr")
    hdrgen(tmp_path, names, "--refine-times")
    got = sane(tmp_path)
    _, header = read_exr(tmp_path / "out.exr")
    found = np.log2(np.array(header["hdrgen:times"], float) / true)
    assert np.abs(found[4] - 0.5 * (found[3] + found[5])) < 0.1     # the odd one is back in line
    blind = np.abs(log2_errors(radiance(tmp_path / "blind.exr"), truth))
    fine = log2_errors(got, truth)
    slope = np.polyfit(np.log2(truth).ravel(), fine.ravel(), 1)     # the exponent times can't fix
    left = np.abs(fine - np.polyval(slope, np.log2(truth)))
    assert np.median(left) < 0.5 * np.median(blind) and np.median(left) < 0.05


def test_all_times_scaled(tmp_path):
    truth = scene(150, 150, decades=3, lowest=-1.5)
    times = 2.0 ** np.arange(-5, 2)
    names = make_series(tmp_path, truth, times, f_gamma)
    hdrgen(tmp_path, names, out="a.exr")
    write_times(tmp_path, names, times * 2)
    hdrgen(tmp_path, names, out="b.exr")
    assert np.allclose(sane(tmp_path, "a.exr"), 2 * sane(tmp_path, "b.exr"), rtol=1e-3)


def test_wrong_order_of_times_is_refused(tmp_path):
    truth = scene(100, 100, decades=3, lowest=-1.5)
    times = 2.0 ** np.arange(-5, 2)
    names = make_series(tmp_path, truth, times, f_gamma)
    write_times(tmp_path, names, times[::-1])
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", "order of the images")
    rng = np.random.default_rng(3)
    for _ in range(4):                  # any order: refused, or at least finite
        write_times(tmp_path, names, rng.permutation(times))
        (tmp_path / "out.exr").unlink(missing_ok=True)
        r = hdrgen(tmp_path, names, "--sigma", code=None)
        if r.code == 0:
            sane(tmp_path)
        else:
            one_line_error(r, "hdrgen")


def test_seventeen_decades(tmp_path):
    times = 4.0 ** np.arange(-24, 5)          # 3.6e-15 would be below what a time may be: from 1e-12
    times = times[times >= 1e-12]
    truth = scene(128, 128, decades=12, lowest=-2.3)
    names = make_series(tmp_path, truth, times, f_gamma)
    hdrgen(tmp_path, names, "--sigma", "--flags")
    d = log2_errors(sane(tmp_path), truth)
    assert np.median(np.abs(d)) < 0.02
    # five decades more, beyond what any exposure reaches on either side: bounds, flagged
    wide = scene(128, 128, decades=17, lowest=-5.0)
    for k, t in enumerate(times):
        write_png(tmp_path / names[k], expose(wide, t, f_gamma, rng=np.random.default_rng(k)))
    hdrgen(tmp_path, names, "--sigma", "--flags", "--response", "gamma:2.2", out="wide.exr")
    got = sane(tmp_path, "wide.exr")
    ch, _ = read_exr(tmp_path / "wide.exr")
    inside = (wide * times[-1] > 0.01) & (wide * times[0] < 0.9)
    assert np.median(np.abs(log2_errors(got[inside], wide[inside]))) < 0.02
    over = wide[..., 1] * times[0] > 1.5
    assert over.any() and (ch["flags"][over] == 1).all()
    assert (ch["G"][over] <= wide[..., 1][over] * 1.01).all()


def test_tiny_pictures(tmp_path):
    for shape in ((1, 1, 3), (1, 7, 3), (5, 1, 3), (2, 2, 3)):
        truth = np.full(shape, 0.3)
        names = make_series(tmp_path, truth, [0.5, 1.0, 2.0], f_gamma)
        hdrgen(tmp_path, names, "--response", "gamma:2.2")
        assert np.allclose(sane(tmp_path), truth, rtol=0.05)
        one_line_error(hdrgen(tmp_path, names, code=1, out="no.exr"), "hdrgen", "--response")


def test_constant_picture_does_not_make_a_response(tmp_path):
    names = make_series(tmp_path, np.full((50, 50, 3), 0.2), [0.5, 1.0, 2.0], f_gamma)
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", "--response")


def test_order_of_the_images_does_not_matter(tmp_path):
    truth = scene(128, 128, decades=3, lowest=-1.5)
    names = make_series(tmp_path, truth, 2.0 ** np.arange(-5, 2), f_gamma)
    hdrgen(tmp_path, names, out="up.exr")
    hdrgen(tmp_path, names[::-1], out="down.exr")
    assert (sane(tmp_path, "up.exr") == sane(tmp_path, "down.exr")).all()


def test_a_thing_that_moves(tmp_path):
    truth = scene(160, 160, decades=1.5, lowest=-1.5, seed=9)
    times = 2.0 ** np.arange(-5, 3)
    rng = np.random.default_rng(4)
    names = []
    for k, t in enumerate(times):
        now = truth.copy()
        now[40:80, 20 * k:20 * k + 18] *= 12         # a bright thing that is elsewhere each time
        names.append(f"exp_{k}.png")
        write_png(tmp_path / names[-1], expose(now, t, f_gamma, rng=rng))
    write_times(tmp_path, names, times)
    hdrgen(tmp_path, names, "--response", "gamma:2.2", out="plain.exr")
    r = hdrgen(tmp_path, names, "--response", "gamma:2.2", "--deghost", "--flags", out="clean.exr")
    hit = np.s_[40:80, 0:100]
    plain, clean = (np.abs(np.log2(sane(tmp_path, o)[hit] / truth[hit])) for o in ("plain.exr", "clean.exr"))
    assert np.percentile(plain, 90) > 0.5
    assert np.percentile(clean, 90) < 0.15 and np.median(clean) < 0.03
    rest = np.s_[90:, :]
    still = np.abs(np.log2(sane(tmp_path, "clean.exr")[rest] / truth[rest]))
    assert np.median(still) < 0.015
    ch, _ = read_exr(tmp_path / "clean.exr")
    assert ((ch["flags"].astype(int) & 8) > 0)[hit].mean() > 3 * ((ch["flags"].astype(int) & 8) > 0)[rest].mean()
    assert "--deghost" in r.err


def test_clipped_pixels_that_are_not_quite_white(tmp_path):
    # as in JPEG files: what was clipped comes out anywhere from 250 to 255, by much more than the model's noise
    truth = scene(160, 160, decades=3, lowest=-1.5)
    rng = np.random.default_rng(6)
    names, times = [], 2.0 ** np.arange(-6, 2)
    for k, t in enumerate(times):
        z = expose(truth, t, f_gamma, rng=rng)
        z[z == 255] = rng.integers(250, 256, (z == 255).sum())
        names.append(f"exp_{k}.png")
        write_png(tmp_path / names[-1], z)
    write_times(tmp_path, names, times)
    hdrgen(tmp_path, names, "--response", "gamma:2.2")
    inside = truth * times[0] < 0.5
    d = np.abs(np.log2(sane(tmp_path)[inside] / truth[inside]))
    assert np.median(d) < 0.015 and np.percentile(d, 99) < 0.1


def test_twelve_bits_in_files_of_sixteen(tmp_path):
    """A camera's codes, from the lowest bit: where they clip is found; --bits knows."""
    truth = scene(120, 120, decades=3, lowest=-2.5)
    times = 2.0 ** np.arange(-4, 3)
    names = make_series(tmp_path, truth, times, f_gamma, max_code=4095)
    r = hdrgen(tmp_path, names, "--bits", 12, "--flags")
    assert "--bits" not in r.err
    d = log2_errors(sane(tmp_path), truth)
    assert np.median(np.abs(d)) < 0.02
    r = hdrgen(tmp_path, names, out="found.exr")     # the pile of codes says where it clips, and that is said
    assert "white lies at code 4095" in r.err and "--bits" not in r.err
    d = log2_errors(sane(tmp_path, "found.exr"), truth)
    assert np.median(np.abs(d)) < 0.02
    # a series that clips nowhere ends where it ends
    assert "--bits" not in hdrgen(tmp_path, make_series(tmp_path, truth * .05, times[:4], f_gamma, max_code=65535)).err
    one_line_error(hdrgen(tmp_path, names, "--bits", 17, code=2), "hdrgen", "--bits")


@pytest.mark.parametrize("level", [0, .2, 3])
def test_noise_of_the_short_exposures_does_not_light_the_dark(tmp_path, level):
    """In the shortest exposures noise makes a code of nothing here and there; the longest, black at `level` codes or not,
    know better by their thousandfold time."""
    times = 4.0 ** np.arange(-5, 1)
    truth = np.full((200, 200, 3), level / 255)
    names = make_series(tmp_path, truth, times, f_linear, read=24, seed=5)
    lit = sum((np.asarray(Image.open(tmp_path / n)) > 0).mean() for n in names[:3])
    assert lit > .03, "not much of a test"
    hdrgen(tmp_path, names, "--response", "linear", "--flags")
    got = sane(tmp_path) * 255
    # a code and five deviations of the longest exposure (24 of 20000 electrons: .31 codes, and rounding)
    assert got.max() < level + .5 + 5 * np.hypot(.31, .29)
    if level == 3:
        assert abs(got.mean() / level - 1) < .02


def test_a_long_exposure_that_is_black_by_mistake_is_not_believed(tmp_path):
    """The border of a registered image, say, where --fill was not given."""
    times = 4.0 ** np.arange(-2, 1)
    names = make_series(tmp_path, np.full((80, 80, 3), .2), times, f_linear)
    codes = np.asarray(Image.open(tmp_path / names[-1])).copy()
    codes[:6] = 0
    write_png(tmp_path / names[-1], codes)
    hdrgen(tmp_path, names, "--response", "linear")
    assert np.abs(sane(tmp_path).mean((1, 2)) / .2 - 1).max() < .02
