"""hdrgen as its man page has it: options, times, inputs, outputs, what is in the header, and what is refused."""
import os
import re
import shutil
import struct
import subprocess

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from common_util import write_dng, write_tiff
from conftest import BIN, TOP, environment, one_line_error, run, run_measured, shared_data
from hdrgen_util import (expose, f_gamma, f_linear, f_srgb, hdrgen, log2_errors, make_series, radiance, read_exr,
                         read_response, read_rgbe, scene, write_pgm, write_png, write_times)
from process import execute
from svg_util import Plot

TIMES = 2.0 ** np.arange(-5, 2)


@pytest.fixture(scope="module")
def series(tmp_path_factory):
    """7 exposures of three decades, 96x128, gamma camera."""
    folder = tmp_path_factory.mktemp("series")
    truth = scene(96, 128, decades=3, lowest=-1.5)
    return folder, make_series(folder, truth, TIMES, f_gamma), truth


def fresh(series, tmp_path):
    folder, names, truth = series
    for n in (*names, "times.txt"):
        shutil.copy(folder / n, tmp_path / n)
    return names, truth


# ---- the command ---------------------------------------------------------------------------------------

def test_help_and_version():
    text = run("hdrgen", "--help").text
    for option in ("--response", "--save-response", "--weight", "--times", "--sigma", "--refine-times", "--deghost",
                   "--calibrate", "--bayer", "--dark", "--flat", "--half-size", "--plot", "--threads", "--quiet"):
        assert option in text
    assert run("hdrgen", "--version").text.startswith("hdrgen ")


@pytest.mark.parametrize("args, words", [
    ([], ["-o"]), (["-o", "x.exr"], ["image"]), (["a.png"], ["-o"]),
    (["--nonsense", "-o", "x.exr", "a.png"], ["nonsense"]),
    (["--response", "gamma:0", "-o", "x.exr", "a.png"], ["gamma"]),
    (["--response", "gamma:x", "-o", "x.exr", "a.png"], ["number"]),
    (["--weight", "best", "-o", "x.exr", "a.png"], ["noise or debevec", "best"]),
    (["--bayer", "RGBG", "-o", "x.exr", "a.png"], ["RGGB"]),
    (["--lambda", "-1", "-o", "x.exr", "a.png"], ["lambda"]),
    (["--gain", "0", "-o", "x.exr", "a.png"], ["gain"]),
    (["--read-noise", "3", "-o", "x.exr", "a.png"], ["--gain"]),
    (["--calibrate", "1,2,3=5", "-o", "x.exr", "a.png"], [("calibrate", "4")]),
    (["--calibrate", "1,2,3,0=5", "-o", "x.exr", "a.png"], ["W and H"]),
    (["--sigma", "-o", "x.hdr", "a.png"], [".exr"]),
])
def test_bad_usage(tmp_path, args, words):
    r = run("hdrgen", *args, cwd=tmp_path, code=2)
    line = one_line_error(r, "hdrgen")
    for w in words:
        assert any(x.lower() in line.lower() for x in (w if isinstance(w, tuple) else (w,))), line
    assert not list(tmp_path.iterdir())


def test_every_option_is_in_the_man_page():
    page = (TOP / "man" / "hdrgen.1").read_text().replace("\\-", "-")
    for option in re.findall(r"--[a-z][a-z-]+", run("hdrgen", "--help").text):
        assert option in page, option


def test_quiet_says_nothing(series):
    folder, names, _ = series
    r = hdrgen(folder, names, "--quiet", "--refine-times", out="quiet.exr")
    assert r.err == "" and r.out == b""


# ---- times -----------------------------------------------------------------------------------------------

def test_times_file_takes_fractions_comments_and_more_columns(series, tmp_path):
    names, _ = fresh(series, tmp_path)
    hdrgen(tmp_path, names, out="a.exr")
    (tmp_path / "other.txt").write_text("# image seconds f ISO\n\n" + "".join(
        f"  {n}\t1/{round(1 / t)} 8 100 # note\n" if t < 1 else f"some/where/{n} {t:g} 8\r\n" for n, t in zip(names, TIMES)) +
        "not_in_this_series.png 3\n")
    hdrgen(tmp_path, names, times="other.txt", out="b.exr")
    assert (radiance(tmp_path / "a.exr") == radiance(tmp_path / "b.exr")).all()


@pytest.mark.parametrize("edit, words", [
    (lambda t: t.replace("exp_03.png 0.25\n", ""), ["exp_03.png"]),
    (lambda t: t.replace("0.25", "a quarter"), ["line 4", "seconds"]),
    (lambda t: t.replace("0.25", "-1"), ["line 4", "seconds > 0"]),
    (lambda t: t.replace("0.25", "1/0"), ["line 4"]),
    (lambda t: t.replace("0.25", "nan"), ["line 4"]),
    (lambda t: t.replace("0.25", ""), ["line 4", "image seconds"]),
    (lambda t: t + "exp_03.png 0.5\n", ["exp_03.png", "second"]),
    (lambda t: t.replace("0.25", "1e-20"), ["exp_03.png", "1e-12"]),
])
def test_bad_times(series, tmp_path, edit, words):
    names, _ = fresh(series, tmp_path)
    (tmp_path / "times.txt").write_text(edit((tmp_path / "times.txt").read_text()))
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", *words)
    assert not (tmp_path / "out.exr").exists()


def test_no_times_at_all(series):
    folder, names, _ = series
    one_line_error(hdrgen(folder, names, times=None, code=1, out="no.exr"), "hdrgen", "EXIF", "--times")


def jpeg_with_exif(path, codes, seconds=None, f=None, iso=None):
    exif = Image.Exif()
    exif[0x8769] = {tag: value for tag, value in ((0x829A, seconds and IFDRational(round(seconds * 960), 960)),
                                                  (0x829D, f and IFDRational(round(f * 10), 10)), (0x8827, iso)) if value}
    Image.fromarray(codes).save(path, exif=exif, quality=98, subsampling=0)


def tiff_with_exif(path, codes, seconds):
    write_tiff(path, codes, more={34665: (4, [0])})
    end = path.stat().st_size
    write_tiff(path, codes, more={34665: (4, [end])})
    path.write_bytes(path.read_bytes() + struct.pack("<HHHIII", 1, 33434, 5, 1, end + 18, 0) +
                     struct.pack("<II", round(seconds * 960), 960))


@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
def test_times_from_exif(tmp_path, suffix):
    truth = scene(60, 60, decades=2, lowest=-1.5)
    rng = np.random.default_rng(1)
    names = []
    for k, t in enumerate(TIMES):
        names.append(f"e{k}{suffix}")
        write = jpeg_with_exif if suffix == ".jpg" else tiff_with_exif
        write(tmp_path / names[-1], expose(truth, t, f_srgb, rng=rng), seconds=float(t))
    hdrgen(tmp_path, names, "--response", "srgb", times=None)
    _, header = read_exr(tmp_path / "out.exr")
    assert np.allclose(np.array(header["hdrgen:times"], float), TIMES, rtol=1e-4)
    assert np.median(np.abs(np.log2(radiance(tmp_path / "out.exr") / truth))) < 0.03


def test_iso_and_f_number_count(tmp_path):
    truth = scene(60, 60, decades=1.5, lowest=-1.2)
    rng = np.random.default_rng(1)
    shots = [(0.25, 4.0, 100), (0.25, 2.0, 100), (0.25, 4.0, 200), (0.5, 4.0, 100)]
    names = []
    for k, (t, f, iso) in enumerate(shots):
        names.append(f"e{k}.jpg")
        jpeg_with_exif(tmp_path / names[-1], expose(truth, t * 16 / f ** 2 * iso / 100, f_srgb, rng=rng), t, f, iso)
    r = hdrgen(tmp_path, names, "--response", "srgb", times=None)
    assert "ISO" in r.err
    _, header = read_exr(tmp_path / "out.exr")
    assert np.allclose(np.array(header["hdrgen:times"], float), [0.25, 0.5, 0.5, 1.0], rtol=1e-3)
    assert abs(np.median(np.log2(radiance(tmp_path / "out.exr") / truth))) < 0.01


def test_real_exif(tmp_path):
    data = shared_data("mirrorball_bracket_desk_sony")
    hdrgen(tmp_path, sorted(data.glob("desk_[123].JPG")), times=None, out="desk.exr")
    _, header = read_exr(tmp_path / "desk.exr")
    assert np.allclose(np.array(header["hdrgen:times"], float), [1 / 160, 1 / 40, 1 / 10])


def test_hand_held_series_of_mixed_sizes_is_refused():
    data = shared_data("mirrorball_bracket_kitchen_iphone7_messy")
    r = run("hdrgen", "-o", "/nonexistent/x.exr", *sorted(data.glob("*.JPG")), code=1)
    one_line_error(r, "hdrgen", "pixels as in")


# ---- inputs ----------------------------------------------------------------------------------------------

def test_mixed_series_are_refused(series, tmp_path):
    names, _ = fresh(series, tmp_path)
    for codes, words in ((np.zeros((96, 100, 3), np.uint8), ("96",)), (np.zeros((96, 128), np.uint8), ("grey", "colour")),
                         (np.zeros((96, 128, 3), np.uint16), ("65535",))):
        write_png(tmp_path / names[2], codes)
        one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", names[2], *words)
    assert not (tmp_path / "out.exr").exists()


def test_radiance_as_input_is_refused(series, tmp_path):
    names, _ = fresh(series, tmp_path)
    hdrgen(tmp_path, names, out="a.hdr")
    one_line_error(hdrgen(tmp_path, ["a.hdr"], times=None, code=1), "hdrgen", "a.hdr", "radiance")


def test_grey_series(tmp_path):
    truth = scene(80, 90, decades=3, lowest=-1.5, colour=False)
    names = make_series(tmp_path, truth, TIMES, f_gamma)
    hdrgen(tmp_path, names, "--sigma", "--save-response", "r.txt")
    ch, _ = read_exr(tmp_path / "out.exr")
    assert set(ch) == {"Y", "sigma.Y"}
    assert np.median(np.abs(log2_errors(radiance(tmp_path / "out.exr"), truth))) < 0.015
    assert read_response(tmp_path / "r.txt")[1].shape[0] == 1


def test_the_same_picture_from_every_lossless_format(series, tmp_path):
    names, _ = fresh(series, tmp_path)
    hdrgen(tmp_path, names, out="png.exr")
    for suffix in (".ppm", ".tif"):
        other = []
        for n in names:
            Image.open(tmp_path / n).save((tmp_path / n).with_suffix(suffix))
            other.append(n.replace(".png", suffix))
        write_times(tmp_path, other, TIMES, "t.txt")
        hdrgen(tmp_path, other, times="t.txt", out="other.exr")
        assert (radiance(tmp_path / "other.exr") == radiance(tmp_path / "png.exr")).all(), suffix


@pytest.mark.parametrize("order", ["RGGB", "GBRG"])
def test_bayer_mosaic(tmp_path, order):
    # a scene whose colour is constant: then interpolation has an exact answer, brightness edges apart
    grey = scene(120, 100, decades=2.5, lowest=-1.5, colour=False)[..., 0]
    yy, xx = np.mgrid[0:120, 0:100] / 120
    grey = 10 ** (-1.3 + 2.0 * (0.5 + 0.25 * np.sin(5 * xx) + 0.25 * np.cos(4 * yy)))
    tint = np.array([0.6, 1.0, 0.4])
    site = np.array(["RGB".index(c) for c in order]).reshape(2, 2)
    mosaic = grey * tint[np.tile(site, (60, 50))]
    names, rng = [], np.random.default_rng(3)
    for k, t in enumerate(TIMES):
        names.append(f"b{k}.pgm")
        write_pgm(tmp_path / names[-1], expose(mosaic, t, f_linear, max_code=4095 * 16, rng=rng))
    write_times(tmp_path, names, TIMES)
    hdrgen(tmp_path, names, "--bayer", order, "--response", "linear", "--sigma")
    got, ch = radiance(tmp_path / "out.exr"), read_exr(tmp_path / "out.exr")[0]
    assert got.shape == (120, 100, 3) and set(ch) == {"R", "G", "B", "sigma.R", "sigma.G", "sigma.B"}
    d = np.log2(got / (grey[..., None] * tint) / (4095 * 16 / 65535))[2:-2, 2:-2]
    assert np.median(np.abs(d)) < 0.02 and np.percentile(np.abs(d), 99) < 0.15
    assert np.abs(np.median(d, axis=(0, 1))).max() < 0.005
    one_line_error(hdrgen(tmp_path, names, "--bayer", order, "--half-size", code=1), "hdrgen", "camera raw")


def dng_series(folder, half=False):
    """A colour-filter picture whose 2x2 blocks are constant, 12 bit, 4 exposures."""
    truth = scene(48, 64, decades=1.5, lowest=-1.4)
    rng = np.random.default_rng(5)
    names = []
    for k, t in enumerate([0.125, 0.25, 0.5, 1.0]):
        z = expose(truth, t, f_linear, max_code=4095, rng=rng)
        cfa = np.zeros((96, 128), np.uint16)
        for y, x, c in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
            cfa[y::2, x::2] = z[..., c]
        names.append(f"r{k}.dng")
        write_dng(folder / names[-1], cfa, seconds=(int(t * 1000), 1000))
    return names, truth


def test_camera_raw_half_size(tmp_path):
    names, truth = dng_series(tmp_path)
    hdrgen(tmp_path, names, "--half-size", times=None)
    got = radiance(tmp_path / "out.exr")
    _, header = read_exr(tmp_path / "out.exr")
    assert got.shape == truth.shape and header["hdrgen:response"] == "linear"
    assert np.allclose(np.array(header["hdrgen:times"], float), [0.125, 0.25, 0.5, 1.0])
    d = log2_errors(got, truth)
    assert np.median(np.abs(d)) < 0.02
    assert np.ptp(np.median(d, axis=(0, 1))) < 0.02        # neutral white balance, sRGB primaries


def test_camera_raw_full_size(tmp_path):
    names, truth = dng_series(tmp_path)
    hdrgen(tmp_path, names, times=None)
    got = radiance(tmp_path / "out.exr")
    assert got.shape == (96, 128, 3)
    blocks = got.reshape(48, 2, 64, 2, 3).mean(axis=(1, 3))
    assert np.median(np.abs(log2_errors(blocks, truth))) < 0.15    # the scene has edges at every block


def test_dark_frame(tmp_path):
    truth = scene(80, 80, decades=2, lowest=-1.5)
    rng = np.random.default_rng(4)
    pedestal = rng.integers(60, 70, (80, 80, 3))
    names = []
    for k, t in enumerate(TIMES):
        e = truth * t * 20000
        n = e + rng.normal(size=e.shape) * np.sqrt(e + 64)
        z = np.clip(np.round(n / 20000 * 3000 + pedestal), 0, 4095).astype(np.uint16) * 16
        names.append(f"d{k}.png")
        write_png(tmp_path / names[-1], z)
    write_times(tmp_path, names, TIMES)
    write_png(tmp_path / "dark.png", (pedestal * 16).astype(np.uint16))
    hdrgen(tmp_path, names, "--response", "linear", out="with.exr", *["--dark", "dark.png"])
    hdrgen(tmp_path, names, "--response", "linear", out="without.exr")
    d, bad = (log2_errors(radiance(tmp_path / f), truth) for f in ("with.exr", "without.exr"))
    dark = truth < 0.1
    assert abs(np.median(d[dark])) < 0.01 and np.median(np.abs(d)) < 0.02
    assert np.median(bad[dark]) > 0.05
    write_png(tmp_path / "dark.png", np.zeros((8, 8, 3), np.uint16))
    one_line_error(hdrgen(tmp_path, names, "--dark", "dark.png", code=1), "hdrgen", "dark.png", "80x80")


def test_flat_field_and_hot_pixels(tmp_path):
    truth = np.full((60, 70, 3), 0.3)
    yy, xx = np.mgrid[0:60, 0:70]
    shade = (1 - 0.4 * ((xx - 35) ** 2 + (yy - 30) ** 2) / 2100)[..., None]
    rng = np.random.default_rng(4)
    names = []
    for k, t in enumerate(TIMES):
        z = expose(truth * shade, t, f_gamma, rng=rng)
        z[10, 20] = z[59, 0] = 255
        names.append(f"f{k}.png")
        write_png(tmp_path / names[-1], z)
    write_times(tmp_path, names, TIMES)
    write_png(tmp_path / "flat.png", np.round(255 * f_gamma(0.8 * np.repeat(shade, 3, 2))).astype(np.uint8))
    hot = np.zeros((60, 70), np.uint8)
    hot[10, 20] = hot[59, 0] = 1
    write_png(tmp_path / "hot.png", hot)
    hdrgen(tmp_path, names, "--response", "gamma:2.2", "--flat", "flat.png", "--hot", "hot.png")
    got = radiance(tmp_path / "out.exr")
    assert np.abs(got / np.median(got) - 1).max() < 0.06
    one_line_error(hdrgen(tmp_path, names, "--response", "gamma:2.2", "--flat", "hot.png", code=1), "hdrgen", "hot.png")


# ---- outputs ---------------------------------------------------------------------------------------------

def test_header_says_how_it_was_made(series, tmp_path):
    names, _ = fresh(series, tmp_path)
    hdrgen(tmp_path, names, "--weight", "noise", "--sigma", "--count", "--flags")
    ch, header = read_exr(tmp_path / "out.exr")
    assert set(ch) == {"R", "G", "B", "sigma.R", "sigma.G", "sigma.B", "exposures", "flags"}
    assert np.allclose(np.array(header["hdrgen:times"], float), TIMES)
    assert header["hdrgen:images"].split() == names
    assert header["hdrgen:response"] == "debevec" and header["hdrgen:weight"] == "noise"
    assert "--sigma" in header["comments"] and names[0] in header["comments"]
    inside = (ch["flags"] == 0)
    assert inside.mean() > 0.9 and ch["exposures"][inside].min() >= 1 and ch["exposures"].max() <= len(names)
    assert (ch["exposures"][~inside] == 0).all()


def test_radiance_output(series, tmp_path):
    names, _ = fresh(series, tmp_path)
    hdrgen(tmp_path, names, out="a.exr")
    hdrgen(tmp_path, names, out="a.hdr")
    exr = radiance(tmp_path / "a.exr")
    hdr, header = read_rgbe(tmp_path / "a.hdr")
    assert "--times" in header
    assert np.abs(hdr / exr - 1).max(axis=-1).mean() < 0.03 and np.median(np.abs(hdr[..., 1] / exr[..., 1] - 1)) < 0.005
    out = hdrgen(tmp_path, names, out="-").out
    assert (read_rgbe(out)[0] == hdr).all()


def test_half_where_it_fits_and_float_where_it_does_not(tmp_path):
    truth = scene(40, 40, decades=2, lowest=-1.5)
    names = make_series(tmp_path, truth, TIMES, f_gamma)
    r = hdrgen(tmp_path, names, "--type", "half", "--response", "gamma:2.2")
    assert "float" not in r.err
    ch, _ = read_exr(tmp_path / "out.exr")
    write_times(tmp_path, names, TIMES * 1e-6)
    r = hdrgen(tmp_path, names, "--type", "half", "--response", "gamma:2.2", out="big.exr")
    assert "float written" in r.err
    big = radiance(tmp_path / "big.exr")
    assert big.max() > 65504 and np.isfinite(big).all()
    ratio = big / (1e6 * radiance(tmp_path / "out.exr"))    # other grid cells, where a sample is nearly clipped
    assert np.median(np.abs(ratio - 1)) < 5e-4 and np.abs(ratio - 1).max() < 0.03


def test_absolute_scale(series, tmp_path):
    names, _ = fresh(series, tmp_path)
    hdrgen(tmp_path, names, "--calibrate", "10,20,8,6=1200", "--sigma")
    got = radiance(tmp_path / "out.exr")
    luminance = 179 * (got @ [0.265, 0.670, 0.065])
    assert abs(luminance[20:26, 10:18].mean() / 1200 - 1) < 1e-5
    _, header = read_exr(tmp_path / "out.exr")
    assert abs(header["whiteLuminance"] - 179) < 1e-3 and header["hdrgen:scale"] > 0
    one_line_error(hdrgen(tmp_path, names, "--calibrate", "120,20,9,6=1200", out="x.exr", code=1), "hdrgen", "128x96")
    assert not (tmp_path / "x.exr").exists()


def test_response_saved_and_used_again(series, tmp_path):
    names, _ = fresh(series, tmp_path)
    hdrgen(tmp_path, names, "--save-response", "r.txt", out="a.exr")
    hdrgen(tmp_path, names, "--response", "r.txt", out="b.exr")
    a, b = radiance(tmp_path / "a.exr"), radiance(tmp_path / "b.exr")
    assert np.abs(np.log2(a / b)).max() < 0.05 and np.median(np.abs(np.log2(a / b))) < 1e-3
    hdrgen(tmp_path, names, "--response", "r.txt", "--save-response", "again.txt", out="b.exr")
    assert np.allclose(read_response(tmp_path / "r.txt")[1], read_response(tmp_path / "again.txt")[1], rtol=1e-9)


def test_polynomial_response_file(series, tmp_path):
    names, _ = fresh(series, tmp_path)
    (tmp_path / "p.rsp").write_text("2 0.7 0.3 0\n2 0.7 0.3 0\n3 0.1 0.5 0.4 0\n")
    hdrgen(tmp_path, names, "--response", "p.rsp", "--save-response", "r.txt")
    codes, curves = read_response(tmp_path / "r.txt")
    x = codes / 255
    assert np.allclose(curves[0], 0.7 * x ** 2 + 0.3 * x) and np.allclose(curves[2], 0.1 * x ** 3 + 0.5 * x ** 2 + 0.4 * x)


@pytest.mark.parametrize("text, words", [
    ("", ["polynomials"]), ("hello\n", ["polynomials"]), ("2 1 1\n", ["coefficients"]), ("99 1\n", ["order"]),
    ("2 -1 0 0\n2 -1 0 0\n2 -1 0 0\n", ["positive"]),
    ("hdrgen-response 1\nchannels 3\nmax_code 255\n", ["two codes"]),
    ("hdrgen-response 1\nchannels 3\nmax_code 255\n1 1 1 1\n2 1 2 2\n", ["rising", "line 5"]),
    ("hdrgen-response 1\nchannels 3\nmax_code 255\n1 1 1\n", ["3 exposures"]),
    ("hdrgen-response 1\nchannels 7\nmax_code 255\n1 1 1\n", ["channels"]),
    ("hdrgen-response 1\nchannels 1\nmax_code 10\n1 1\n20 2\n", ["max_code"]),
    ("hdrgen-response 1\nchannels 1\nmax_code 255\n1 nan\n20 2\n", ["line 4"]),
])
def test_bad_response_files(series, tmp_path, text, words):
    names, _ = fresh(series, tmp_path)
    (tmp_path / "bad.txt").write_text(text)
    one_line_error(hdrgen(tmp_path, names, "--response", "bad.txt", code=1), "hdrgen", "bad.txt", *words)
    one_line_error(hdrgen(tmp_path, names, "--response", "none.txt", code=1), "hdrgen", "none.txt")


def test_plot(series, tmp_path):
    """The curve, read back by the ticks' numbers, is the response that was asked for; points lie about it."""
    names, _ = fresh(series, tmp_path)
    hdrgen(tmp_path, names, "--plot", "curve.svg", "--response", "gamma:2.2")
    plot = Plot(tmp_path / "curve.svg")
    assert plot.xlabel == "code number" and "exposure" in plot.ylabel and len(plot.xticks) >= 5 and len(plot.yticks) >= 5
    lines, points = plot.lines(), plot.small_dots()
    assert len(lines) == len(points) == 3
    for line, dots in zip(lines, points):
        x, y = line.T
        assert x[-1] == pytest.approx(255, abs=0.1) and x[0] < 3
        assert np.abs(y - 2.2 * np.log2(x / 255))[x > 2].max() < 0.05
        assert len(dots) > 1000 and np.median(np.abs(dots[:, 1] - 2.2 * np.log2(np.maximum(dots[:, 0], 1) / 255))) < 0.1
    one_line_error(hdrgen(tmp_path, names, "--plot", "curve.png", "--response", "gamma:2.2", code=1), "hdrgen", "curve.png", ".svg")
    assert not (tmp_path / "curve.png").exists()


# ---- the machine -----------------------------------------------------------------------------------------

def test_threads_do_not_change_a_bit(series, tmp_path):
    names, _ = fresh(series, tmp_path)
    for n in (1, 2, 5):
        hdrgen(tmp_path, names, "--threads", n, "--sigma", "--deghost", "--refine-times", out=f"t{n}.exr")
    first = read_exr(tmp_path / "t1.exr")[0]
    for n in (2, 5):
        other = read_exr(tmp_path / f"t{n}.exr")[0]
        assert all((first[c] == other[c]).all() for c in first)


def test_memory_does_not_grow_with_the_number_of_exposures(tmp_path):
    """24 megapixels RGB: the output (288 MB as floats) and strips, however many exposures (288 MB of codes are too many to
    be kept from the first pass to the second); 16 must stay under 1 GB."""
    row = np.geomspace(1e-3, 30, 6000)[None, :, None] * np.ones((1, 1, 3))
    peaks = {}
    z = expose(row, 1.0, f_gamma, rng=np.random.default_rng(1))
    (tmp_path / "w.ppm").write_bytes(b"P6\n6000 4000\n255\n" + z.tobytes() * 4000)
    names = [f"v{k}.ppm" for k in range(6)]
    for name in names:
        os.link(tmp_path / "w.ppm", tmp_path / name)
    write_times(tmp_path, names, [1.0] * 6)
    for n in (4, 6):
        _, peaks[n] = run_measured("hdrgen", "-q", "-t", "times.txt", "-r", "gamma:2.2", "--gain", "80", "--read-noise", "8", "-o",
                                   "big.exr", "--type", "half", "--compression", "none", *names[:n], cwd=tmp_path)
    per_exposure = (peaks[6] - peaks[4]) / 2
    assert peaks[6] + 10 * max(per_exposure, 0) < 1 << 30
    assert per_exposure < 20e6          # one exposure is 72 MB


def test_a_full_disk_leaves_nothing(series, tmp_path):
    names, _ = fresh(series, tmp_path)
    (tmp_path / "out.exr").write_bytes(b"old")

    def small_files():
        import resource
        resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))
    p = execute([BIN / "hdrgen", "-q", "-t", "times.txt", "-o", "out.exr", *names], cwd=tmp_path, stderr=subprocess.PIPE,
                env=environment(), preexec_fn=small_files, restore_signals=False)
    assert p.returncode == 1, p.stderr
    assert p.stderr.count(b"\n") == 1 and b"out.exr" in p.stderr
    assert (tmp_path / "out.exr").read_bytes() == b"old"
    assert sorted(x.name for x in tmp_path.iterdir()) == sorted([*names, "times.txt", "out.exr"])


def test_output_into_nowhere(series):
    folder, names, _ = series
    one_line_error(hdrgen(folder, names, out="/nonexistent/out.exr", code=1), "hdrgen", "/nonexistent/out.exr")
    one_line_error(hdrgen(folder, names, out="out.xyz", code=2), "hdrgen", "out.xyz")
