"""Pixels that are not square: PIXASPECT in .hdr, pixelAspectRatio in OpenEXR; densities of coded pictures."""
import numpy as np
import pytest
from PIL import Image

from common_util import IMGTOOL, line_new, load, refused, rgbe_of, run, value_of, write_exr, write_hdr
from conftest import run as run_installed
from ilf_util import read_mosaic


def light(w, h):
    return np.random.default_rng(7).uniform(0.5, 2, (h, w, 3)).astype(np.float32)


def hdr(path, a, header, order="-Y +X"):
    c = rgbe_of(a)
    write_hdr(path, c, order, line_new, header=header)
    return value_of(c)


def rows(path, tmp_path, *how):
    p = run(IMGTOOL, "rows", *how, path, tmp_path / "x")
    assert p.returncode == 0, p.stderr
    w, h, c = np.fromfile(tmp_path / "x", np.int32, 3)
    return np.fromfile(tmp_path / "x", np.float32, offset=12).reshape(h, w, c), p.stderr.decode()


def stretched(a, n, axis):
    """Each of n output pixels along the axis is the mean of what it covers: by integrating and interpolating."""
    a = np.moveaxis(np.asarray(a, float), axis, 0)
    total = np.concatenate([np.zeros_like(a[:1]), np.cumsum(a, 0)])
    edge = np.arange(n + 1) * len(a) / n
    i = np.minimum(edge.astype(int), len(a) - 1)
    at = total[i] + (edge - i)[:, None, None] * a[i]
    return np.moveaxis(np.diff(at, axis=0) * n / len(a), 0, axis)


@pytest.mark.parametrize("aspect", [2, 1.5, 1.02, 7 / 3, 0.5, 0.4, 0.97, 15])
@pytest.mark.parametrize("order", ["-Y +X", "+X -Y", "+Y +X"])
def test_hdr(tmp_path, aspect, order):
    a = hdr(tmp_path / "a.hdr", light(13, 11), f"PIXASPECT={aspect:.9f}\n", order)
    got, said = rows(tmp_path / "a.hdr", tmp_path)
    want = stretched(a, int(11 * aspect + 0.5), 0) if aspect > 1 else stretched(a, int(13 / aspect + 0.5), 1)
    assert got.shape == want.shape and np.allclose(got, want, rtol=1e-5)
    assert "not square" in said if got.shape != a.shape else said == ""
    assert np.isclose(got.mean(), a.mean(), rtol=1e-5)
    kept, said = rows(tmp_path / "a.hdr", tmp_path, "--keep-aspect")
    assert np.allclose(kept, a, rtol=1e-6) and said == ""


def test_lines_multiply(tmp_path):
    a = hdr(tmp_path / "a.hdr", light(9, 4), "PIXASPECT=4\n\tPIXASPECT=9\nPIXASPECT=0.5\nPIXASPECT= 0.5\n")
    assert np.array_equal(load(tmp_path / "a.hdr", tmp_path), a.astype(np.float32))
    a = hdr(tmp_path / "b.hdr", light(9, 4), "PIXASPECT=3\nEXPOSURE=2\nPIXASPECT=0.6666667\n")
    assert np.allclose(rows(tmp_path / "b.hdr", tmp_path)[0], np.repeat(a, 2, 0) / 2)


@pytest.mark.parametrize("value", ["0", "-1", "x", "inf", "17", "0.01"])
def test_nonsense_is_refused(tmp_path, value):
    hdr(tmp_path / "a.hdr", light(9, 4), f"PIXASPECT={value}\n")
    refused(run(IMGTOOL, "probe", tmp_path / "a.hdr"))


@pytest.mark.parametrize("ratio", [2.0, 0.5, 1.4, 1.005])
def test_exr(tmp_path, ratio):
    """Width over height here."""
    a = light(9, 8)
    write_exr(tmp_path / "a.exr", {n: np.ascontiguousarray(a[..., i]) for i, n in enumerate("RGB")}, pixelAspectRatio=ratio)
    got, said = rows(tmp_path / "a.exr", tmp_path)
    if ratio == 1.005:
        assert np.array_equal(got, a) and said == ""
        return
    want = stretched(a, round(9 * ratio), 1) if ratio > 1 else stretched(a, round(8 / ratio), 0)
    assert np.allclose(got, want, rtol=1e-5) and "not square" in said


def test_alpha_weighs_colours(tmp_path):
    rgba = np.array([[[4, 4, 4, 1]], [[0, 0, 0, 0]], [[2, 2, 2, 0.5]]], np.float32)  # straight
    planes = {n: np.ascontiguousarray(rgba[..., i]) for i, n in enumerate("RGBA")}
    write_exr(tmp_path / "a.exr", planes, pixelAspectRatio=1 / 1.3334, **{"ilf:alpha": "unassociated"})
    got = rows(tmp_path / "a.exr", tmp_path)[0][:, 0]
    assert np.allclose(got[:, 3], [1, 1 / 3, 1 / 6, 0.5], atol=1e-3)  # 3 rows over 4
    assert np.allclose(got[:, 0], [4, 4, 2, 2], atol=1e-2)


def test_a_disc_of_oblong_pixels_is_the_same_disc(tmp_path):
    """A fisheye picture rendered with half the rows: no wall is lost (rpict -pa 0 -x 96 -y 48)."""
    y, x = np.mgrid[0:96, 0:96] - 47.5
    a = np.stack([1.5 + np.sin(x / 20), 1.5 + np.cos(y / 20), 1.5 + np.sin((x + y) / 30)], 2).astype(np.float32)
    hdr(tmp_path / "square.hdr", a, "")
    hdr(tmp_path / "flat.hdr", a.reshape(48, 2, 96, 3).mean(1), "PIXASPECT=2\n")
    hdr(tmp_path / "tall.hdr", a.reshape(96, 48, 2, 3).mean(2), "PIXASPECT=0.5\n")
    found = []
    for name in ("square", "flat", "tall"):
        run_installed("fishremap", "--lens", "equidistant", "--fov", "180", "--size", "24x12", "-o", tmp_path / f"{name}.exr", tmp_path / f"{name}.hdr")
        found.append(load(tmp_path / f"{name}.exr", tmp_path))
    for other in found[1:]:
        assert other.shape == found[0].shape and np.abs(other - found[0]).max() < 0.05


def test_a_probe_has_angles_for_rows_and_columns(tmp_path):
    a = hdr(tmp_path / "p.hdr", light(16, 16), "PIXASPECT=2\n")
    r = run_installed("ilfpack", "--grid", "1x1", "--plane", "0 0 0 1 0 0 0 1 0", "--type", "float", "-o", tmp_path / "o.ilf.exr", tmp_path / "p.hdr")
    assert r.err == "" and np.array_equal(read_mosaic(tmp_path / "o.ilf.exr")[1], a.astype(np.float32))


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif"])
def test_densities_are_remarked_on(tmp_path, suffix):
    for dpi in ((72, 72), (200, 100)):
        Image.new("RGB", (20, 10)).save(tmp_path / f"a{suffix}", dpi=dpi)
        p = run(IMGTOOL, "probe", tmp_path / f"a{suffix}")
        assert b"20x10" in p.stdout and (b"densities" in p.stderr) == (dpi[0] != dpi[1])
    assert run(IMGTOOL, "probe", "--quiet", tmp_path / f"a{suffix}").stderr == b""
