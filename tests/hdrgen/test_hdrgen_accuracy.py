"""How right hdrgen is, against synthetic series of known truth and against Debevec's own radiance map."""
import numpy as np
import pytest

from conftest import shared_data
from hdrgen_util import (CAMERAS, FULL, READ, bias_by_decade, f_bump, f_gamma, hdrgen, inverse, log2_errors, make_series, radiance,
                         read_exr, read_response, read_rgbe, scene, write_times)

TIMES16 = 2.0 ** np.arange(-14, 2)


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """16 exposures of six decades, as the peers were measured on (same equations, 1024x1024)."""
    folder = tmp_path_factory.mktemp("series16")
    truth = scene(1024, 1024)
    names = make_series(folder, truth, TIMES16, f_bump)
    hdrgen(folder, names, "--sigma", "--save-response", "response.txt", "--threads", "1")
    ch, _ = read_exr(folder / "out.exr")
    sigma = np.stack([ch["sigma." + c] for c in "RGB"], -1).astype(float)
    return folder, names, truth, radiance(folder / "out.exr"), sigma


def test_error_within_five_percent_of_the_photon_limit(reference):
    # the limit, 0.0079 / 0.094, is what the true response and true inverse variances reach
    _, _, truth, got, _ = reference
    d = np.abs(log2_errors(got, truth))
    assert np.median(d) <= 0.0083
    assert np.percentile(d, 99) <= 0.098


def test_no_bias_in_any_decade(reference):
    _, _, truth, got, _ = reference
    bias = bias_by_decade(log2_errors(got, truth), truth)
    assert len(bias) == 6
    assert max(map(abs, bias)) <= 0.003


def test_sigma_is_honest(reference):
    _, _, truth, got, sigma = reference
    scale = np.exp(np.median(np.log(got / truth)))
    within = np.abs(got / scale - truth) < sigma / scale
    assert 0.65 <= within.mean() <= 0.71
    for lo in 10.0 ** np.arange(-2, 3):   # and in every decade on its own, a little wider
        part = (truth >= lo) & (truth < 10 * lo)
        assert 0.64 <= within[part].mean() <= 0.72


def test_debevec_weights_are_worse_but_sane(reference):
    folder, names, truth, _, _ = reference
    hdrgen(folder, names, "--weight", "debevec", out="deb.exr")
    d = np.abs(log2_errors(radiance(folder / "deb.exr"), truth))
    assert np.median(d) < 0.034     # OpenCV 5's Debevec on this series


def test_given_noise_parameters_give_the_same_picture(reference):
    folder, names, truth, got, _ = reference
    hdrgen(folder, names, "--gain", str(20000 / 255), "--read-noise", "8", out="given.exr")
    d = np.log2(radiance(folder / "given.exr") / got)
    assert abs(np.median(d)) < 0.02     # the highest code's exposure is extrapolated: the scale is known so well
    assert np.median(np.abs(d - np.median(d))) < 0.001


@pytest.mark.parametrize("camera", ["linear", "gamma", "srgb", "film", "bump"])
def test_response_is_recovered(tmp_path, camera):
    f = CAMERAS[camera]
    truth = scene(384, 384, decades=5, lowest=-2, seed=5)
    names = make_series(tmp_path, truth, 2.0 ** np.arange(-11, 4), f)
    hdrgen(tmp_path, names, "--save-response", "r.txt")
    codes, curves = read_response(tmp_path / "r.txt")
    true = inverse(f, codes, 255)
    # RMS of the relative error where one sample is known to 10 %, and not at the clipped end; RMS of
    # the error in full-scale units over all codes
    sd = np.sqrt(true / FULL + (READ / FULL) ** 2 + np.gradient(true) ** 2 / 12)
    inside = (sd < 0.1 * true) & (codes <= 250)
    assert inside.sum() > 200
    for curve in curves:
        scale = np.exp(np.mean(np.log(curve[inside] / true[inside])))
        relative = curve[inside] / scale / true[inside] - 1
        assert np.sqrt(np.mean(relative ** 2)) < 0.005
        assert np.sqrt(np.mean((curve / scale - true) ** 2)) < 0.005
        assert np.all(np.diff(curve) > 0)


def test_channels_share_one_scale(reference):
    _, _, truth, got, _ = reference
    d = np.log2(got / truth)
    per_channel = np.median(d, axis=(0, 1))
    assert np.ptp(per_channel) < 0.003


@pytest.mark.parametrize("camera", ["gamma", "linear"])
def test_mitsunaga_nayar(tmp_path, camera):
    f = CAMERAS[camera]
    truth = scene(256, 256, decades=4, lowest=-1.5, seed=6)
    names = make_series(tmp_path, truth, 2.0 ** np.arange(-9, 3), f)
    hdrgen(tmp_path, names, "--response", "mitsunaga", "--save-response", "r.txt")
    codes, curves = read_response(tmp_path / "r.txt")
    true = inverse(f, codes, 255)
    inside = (codes >= 25) & (codes <= 250)   # a polynomial can't follow z^2.2 at its root
    for curve in curves:
        scale = np.exp(np.mean(np.log(curve[inside] / true[inside])))
        assert np.sqrt(np.mean((curve[inside] / scale / true[inside] - 1) ** 2)) < 0.03


def test_refined_times_find_a_slow_shutter(tmp_path):
    truth = scene(256, 256, decades=4, lowest=-1.5, seed=7)
    true = 2.0 ** np.arange(-9, 3)
    true[3] *= 1.12
    true[8] *= 0.93
    names = make_series(tmp_path, truth, true, f_bump)
    write_times(tmp_path, names, 2.0 ** np.arange(-9, 3))
    hdrgen(tmp_path, names, "--refine-times")
    _, header = read_exr(tmp_path / "out.exr")
    found = np.array(header["hdrgen:times"], float)
    # times and curve share an exponent that only the stated times fix: compare the deviations
    deviation = np.log(found / true)
    trend = np.polyval(np.polyfit(np.arange(12), deviation, 1), np.arange(12))
    assert np.abs(deviation - trend).max() < 0.01
    assert abs(trend[-1] - trend[0]) < 0.15


def test_linear_camera_with_given_response_finds_absolute_times(tmp_path):
    truth = scene(200, 200, decades=3, lowest=-1.2, seed=8)
    true = 2.0 ** np.arange(-6, 2)
    true[5] *= 1.3
    names = make_series(tmp_path, truth, true, f_gamma)
    write_times(tmp_path, names, 2.0 ** np.arange(-6, 2))
    hdrgen(tmp_path, names, "--refine-times", "--response", "gamma:2.2")
    _, header = read_exr(tmp_path / "out.exr")
    found = np.array(header["hdrgen:times"], float)
    assert np.abs(np.log(found / true)).max() < 0.02


# ---- real photographs ----------------------------------------------------------------------------------

def test_memorial_church_against_its_authors_own_map(tmp_path):
    data = shared_data("bracket_memorial_church")
    names = sorted(data.glob("memorial00*.png"))
    hdrgen(tmp_path, names, "--fill", "0,0,255", times=data / "exposures.txt")
    ref, _ = read_rgbe(data / "memorial.hdr")
    got = radiance(tmp_path / "out.exr")
    assert got.shape == ref.shape
    inner = np.zeros(ref.shape[:2], bool)
    inner[40:-40, 40:-40] = True
    use = inner[..., None] & (ref > 0)
    errors = []
    for c in range(3):
        d = np.log2(got[..., c][use[..., c]] / ref[..., c][use[..., c]])
        errors.append(np.abs(d - np.median(d)))
    assert np.median(np.concatenate(errors)) <= 0.05


def test_office_series_true_steps(tmp_path):
    data = shared_data("fisheye_bracket_office_canon5d2_8mm")
    names = sorted(data.glob("IMG_*.jpg"))
    hdrgen(tmp_path, names, "--refine-times", times=None)
    _, header = read_exr(tmp_path / "out.exr")
    t = np.array(header["hdrgen:times"], float)
    steps = np.diff(np.log2(t))[-3:]      # labels 1.6, 3.2, 6, 13 s; truly 1.6, 3.2, 6.4, 12.8
    assert np.abs(steps - 1).max() < 0.05


def leave_one_out(tmp_path, names, times, k):
    """Median |log2| between exposure k and what the others say it should be."""
    from PIL import Image
    rest = [n for i, n in enumerate(names) if i != k]
    (tmp_path / "t.txt").write_text("".join(f'"{n}" {t}\n' for n, t in zip(names, times)))
    hdrgen(tmp_path, rest, "--save-response", "r.txt", times="t.txt")
    got = radiance(tmp_path / "out.exr") * times[k]
    _, curves = read_response(tmp_path / "r.txt")
    z = np.array(Image.open(names[k]))
    seen = np.zeros(z.shape, bool)
    for n in rest:
        o = np.array(Image.open(n))
        seen |= (o >= 5) & (o <= 250)
    errors = [np.abs(np.log2(got[..., c][m] / curves[c][z[..., c][m]]))
              for c in range(3) for m in [seen[..., c] & (z[..., c] >= 10) & (z[..., c] <= 245)]]
    return float(np.median(np.concatenate(errors)))


def test_leave_one_out_window(tmp_path):
    data = shared_data("bracket_window_nikon_e995")
    names = sorted(data.glob("*.jpg"))
    times = [float(line.split()[1]) for line in (data / "exposures.txt").read_text().splitlines() if line[:1] == "H"]
    # OpenCV 5's Debevec, the same way: 0.062 (exposure 7 of 12, 1/15 s)
    assert leave_one_out(tmp_path, names, times, 6) < 0.062
