"""Lamps' light, white below the highest code, missing pixels: what counts is energy, not the median pixel."""
import numpy as np
import pytest
from PIL import Image

from conftest import one_line_error, shared_case
from hdrgen_util import (f_film, f_gamma, f_linear, f_srgb, hdrgen, log2_errors, make_series, radiance, read_exr, scene, write_png,
                         write_times)

FULL, READ = 20000.0, 8.0


def lamp_series(folder, f, white, stops, step, max_code=255, seed=1, quality=None):
    """A scene of three decades with lamps that read 70 to 98 % in the shortest exposure and clip in all others.
    Returns names, truth, mask of the lamps."""
    rng = np.random.default_rng(seed)
    h, w = 120, 160
    times = 2.0 ** np.arange(-stops, 1e-9, step)
    truth = scene(h, w, decades=3, lowest=-3, seed=seed)
    truth *= 0.9 / truth.max()
    yy, xx = np.mgrid[:h, :w]
    lamps = np.zeros((h, w), bool)
    for _ in range(12):
        m = (yy - rng.uniform(8, h - 8)) ** 2 + (xx - rng.uniform(8, w - 8)) ** 2 < rng.uniform(2, 5) ** 2
        truth[m] = rng.uniform(.88, .98) * rng.uniform(.8, 1, 3) / times[0]
        lamps |= m
    white, names = np.broadcast_to(white, 3), []
    for k, t in enumerate(times):
        e = truth * t * FULL
        n = e + rng.normal(size=e.shape) * np.sqrt(np.clip(e, 0, FULL) + READ ** 2)
        z = np.round(f(n / FULL) * white).clip(0, white).astype(np.uint8 if max_code < 256 else np.uint16)
        names.append(f"e{k:02d}.{'jpg' if quality else 'png'}")
        if quality:
            Image.fromarray(z).save(folder / names[-1], quality=quality, subsampling=0)
        else:
            write_png(folder / names[-1], z)
    write_times(folder, names, times)
    return names, truth, lamps


def lamp_light(got, truth, lamps):
    """Light of the lamps over what it is, in the scale of what the rest of the picture shows best (its bright part)."""
    bright = ~lamps & (truth.min(axis=-1) > .05)
    scale = np.exp(np.median(np.log(got[bright] / truth[bright])))
    return got[lamps].sum() / truth[lamps].sum() / scale


@pytest.mark.parametrize("stops, step", [(6, 1), (6, 3), (12, 4), (16, 2)])
@pytest.mark.parametrize("white, max_code", [(255, 255), (254, 255), (250, 255), (65534, 65535), ((65535, 65534, 65535), 65535), (60000, 65535)])
def test_lamps_that_only_the_shortest_exposure_resolves(tmp_path, white, max_code, stops, step):
    names, truth, lamps = lamp_series(tmp_path, f_linear, white, stops, step, max_code)
    hdrgen(tmp_path, names, "--response", "linear")
    assert abs(lamp_light(radiance(tmp_path / "out.exr"), truth, lamps) - 1) < 0.02


@pytest.mark.parametrize("f", [f_srgb, f_film])
@pytest.mark.parametrize("white", [254, 250, 235])
def test_lamps_and_response_with_white_below_the_top(tmp_path, f, white):
    names, truth, lamps = lamp_series(tmp_path, f, white, 8, 2)
    r = hdrgen(tmp_path, names)
    assert (f"white lies at code {white}" in r.err) == (white < 254)
    got = radiance(tmp_path / "out.exr")
    assert abs(lamp_light(got, truth, lamps) - 1) < 0.03
    inside = ~lamps & (truth.min(axis=-1) > .01)
    d = np.log2(got[inside] / truth[inside])
    assert np.sqrt(np.mean((d - np.median(d)) ** 2)) < 0.1
    hdrgen(tmp_path, names, "--white", white, out="said.exr")          # said and found are the same
    assert (radiance(tmp_path / "said.exr") == got).all() or white == 254


def test_white_differs_by_channel(tmp_path):
    names, truth, lamps = lamp_series(tmp_path, f_linear, (255, 250, 240), 8, 2)
    r = hdrgen(tmp_path, names, "--response", "linear")
    assert "255, 250, 240" in r.err
    got = radiance(tmp_path / "out.exr") / (np.array([255, 250, 240]) / 255)
    assert abs(lamp_light(got, truth, lamps) - 1) < 0.02


def test_debevec_weights_keep_the_lamps(tmp_path):
    names, truth, lamps = lamp_series(tmp_path, f_linear, 254, 10, 2)
    hdrgen(tmp_path, names, "--response", "linear", "--weight", "debevec", "--white", 255)
    assert abs(lamp_light(radiance(tmp_path / "out.exr"), truth, lamps) - 1) < 0.03


def test_a_bright_wall_is_not_white(tmp_path):
    """Many pixels of one code in one exposure: light, as the other exposures show."""
    truth = np.full((60, 80, 3), .02)
    truth[:30] = .8
    truth[:, :40] *= np.linspace(.2, 1, 40)[None, :, None]
    names = make_series(tmp_path, truth, [.25, .5, 1], f_gamma)
    r = hdrgen(tmp_path, names, "--response", "gamma:2.2")
    assert "white" not in r.err
    assert np.median(np.abs(np.log2(radiance(tmp_path / "out.exr") / truth))) < .03


def test_white_is_within_the_codes(tmp_path):
    names = make_series(tmp_path, scene(40, 40, decades=2, lowest=-2), [.5, 1, 2], f_gamma)
    one_line_error(hdrgen(tmp_path, names, "--white", 300, code=1), "hdrgen", "--white", "255", "300")
    one_line_error(hdrgen(tmp_path, names, "--white", 2, code=2), "hdrgen", "--white")


def test_the_dark_is_not_lit_by_a_noisy_short_exposure_near_white(tmp_path):
    """The long exposure reads near the top, the short one by noise a few times too much: the long one is right."""
    truth = np.full((60, 60, 3), .85)
    names = make_series(tmp_path, truth, [1 / 512, 1.0], f_linear, read=60)
    hdrgen(tmp_path, names, "--response", "linear", "--gain", 20000 / 255, "--read-noise", 60)
    assert np.quantile(np.abs(radiance(tmp_path / "out.exr") / truth - 1), .999) < .05


# ---- missing pixels ----------------------------------------------------------------------------------------

def with_alpha(path, alpha, mode=None):
    z = np.array(Image.open(path))
    z[alpha == 0] = 0
    Image.fromarray(np.dstack([z, alpha])).save(path)


def test_alpha_is_missing(tmp_path):
    truth = scene(100, 120, decades=3, lowest=-2)
    times = 4.0 ** np.arange(-3, 2)
    names = make_series(tmp_path, truth, times, f_srgb)
    hdrgen(tmp_path, names, out="whole.exr")
    for k, n in enumerate(names):
        alpha = np.full((100, 120), 255, np.uint8)
        if k != 2:
            alpha[:, :5 * k + 4] = 0
            alpha[95:] = 0
        alpha[:3, :3] = 0                                     # nobody sees the corner
        with_alpha(tmp_path / n, alpha)
    r = hdrgen(tmp_path, names, "--flags")
    ch, _ = read_exr(tmp_path / "out.exr")
    assert "9 pixels" in r.err and "missing" in r.err
    corner = np.zeros((100, 120), bool)
    corner[:3, :3] = True
    assert ((ch["A"] == 0) == corner).all() and ((ch["flags"].astype(int) & 16 > 0) == corner).all()
    assert (ch["G"][corner] == 0).all()
    got = radiance(tmp_path / "out.exr")
    codes = np.asarray(Image.open(tmp_path / names[2]))[..., :3]
    seen = ~corner[..., None] & (codes > 20) & (codes < 250)
    border = np.zeros((100, 120, 1), bool)
    border[95:] = border[:, :5] = True
    d = np.log2(np.where(seen, got, 1) / np.where(seen, truth, 1))
    off = np.median(d[seen & ~border])
    assert np.sqrt(np.mean((d[seen & border] - off) ** 2)) < .08


def test_alpha_in_grey_and_in_sixteen_bits(tmp_path):
    truth = scene(60, 70, decades=2, lowest=-2, colour=False)
    names = make_series(tmp_path, truth, [.25, 1, 4], f_linear)
    z = np.array(Image.open(tmp_path / names[2]))
    z[:, :20] = 0
    alpha = np.full(z.shape, 255, np.uint8)
    alpha[:, :20] = 0
    Image.merge("LA", [Image.fromarray(z), Image.fromarray(alpha)]).save(tmp_path / names[2])
    hdrgen(tmp_path, names, "--response", "linear")
    d = np.log2(radiance(tmp_path / "out.exr") / truth)[:, :20]
    assert abs(np.median(d)) < .05 and np.sqrt(np.mean(d ** 2)) < .6


def test_an_image_without_a_pixel_is_refused(tmp_path):
    names = make_series(tmp_path, scene(30, 30, decades=2, lowest=-2), [.5, 1, 2], f_gamma)
    with_alpha(tmp_path / names[1], np.zeros((30, 30), np.uint8))
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", names[1], "alpha")
    assert not (tmp_path / "out.exr").exists()


# ---- the inputs on which we were wrong --------------------------------------------------------------------

def test_case_clipped_code_below_top(tmp_path):
    case = shared_case("clipped_code_below_top")
    hdrgen(tmp_path, sorted(case.glob("e*.png")), "-r", "linear", times=case / "times.txt")
    assert np.abs(radiance(tmp_path / "out.exr")[:, 24:] / 851 - 1).max() < .01


def test_case_white_at_250(tmp_path):
    case = shared_case("white_at_250")
    r = hdrgen(tmp_path, sorted(case.glob("w*.png")), times=case / "times.txt")
    assert "white lies at code 250 of 255" in r.err and "disagree" not in r.err
    hdrgen(tmp_path, sorted(case.glob("w*.png")), "--white", 250, times=case / "times.txt", out="said.exr")
    assert (radiance(tmp_path / "said.exr") == radiance(tmp_path / "out.exr")).all()


def test_case_alpha(tmp_path):
    case = shared_case("alpha_is_missing_pixels")
    names = sorted(case.glob("a*.png"))
    hdrgen(tmp_path, names, "--save-response", "r.txt", times=case / "times.txt")
    got = radiance(tmp_path / "out.exr")
    z = np.asarray(Image.open(case / "a2.png"))[..., :3]
    curve = np.array([[float(v) for v in x.split()[1:]] for x in (tmp_path / "r.txt").read_text().splitlines() if x[:1].isdigit()])
    t = [float(x.split()[1]) for x in (case / "times.txt").read_text().splitlines() if x.startswith("a2")][0]
    border = np.zeros(z.shape, bool)
    border[:, :26] = border[-25:] = True
    use = border & (z > 20) & (z < 240)
    alone = np.take_along_axis(curve, z.reshape(-1, 3), axis=0).reshape(z.shape) / t
    d = np.log2(got[use] / alone[use])
    assert np.sqrt(np.mean(d ** 2)) < .15
