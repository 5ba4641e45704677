"""common/image: Radiance pictures and OpenEXR read exactly, written and read back."""
import struct

import numpy as np
import OpenEXR
import pytest

from common_util import (IMGTOOL, both, codes, H, line_new, line_old, load, probe, radiance, refused, rgbe_of, run, value_of,
                         W, write_exr, write_hdr, write_pfm, write_png)

# ---- Radiance ------------------------------------------------------------------------------------------

ORDERS = ["-Y +X", "-Y -X", "+Y +X", "+Y -X", "+X -Y", "+X +Y", "-X -Y", "-X +Y"]


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("line", [line_new, line_old, np.ndarray.tobytes], ids=["new", "old", "flat"])
def test_hdr_orders_and_run_lengths(tmp_path, order, line):
    c = rgbe_of(radiance())
    write_hdr(tmp_path / "a.hdr", c, order, line)
    got = both(tmp_path / "a.hdr", tmp_path)
    assert np.array_equal(got, value_of(c).astype(np.float32))


def test_hdr_old_run_of_several_counts(tmp_path):
    c = rgbe_of(np.ones((2, 70000, 3), np.float32))
    write_hdr(tmp_path / "a.hdr", c, line=line_old)
    assert np.array_equal(load(tmp_path / "a.hdr", tmp_path), value_of(c).astype(np.float32))


@pytest.mark.parametrize("width", [1, 7, 8, 127, 128, 129, 32767, 32768])
def test_hdr_widths(tmp_path, width):
    """Below 8 and above 32767 pixels there are no new run lengths."""
    a = radiance(width, 3)
    c = rgbe_of(a)
    write_hdr(tmp_path / "a.hdr", c, line=line_new if 8 <= width <= 32767 else np.ndarray.tobytes)
    got = load(tmp_path / "a.hdr", tmp_path)
    assert np.array_equal(got, value_of(c).astype(np.float32))
    assert run(IMGTOOL, "convert", tmp_path / "a.hdr", tmp_path / "b.hdr").returncode == 0
    assert np.array_equal(load(tmp_path / "b.hdr", tmp_path), got)


def test_hdr_exposure_and_colour_correction_divide(tmp_path):
    c = rgbe_of(radiance())
    head = "EXPOSURE=2\n\tEXPOSURE=100\nVIEW= -vtv\nEXPOSURE= 0.25 \nCOLORCORR= 1 2 4\nnonsense\nCOLORCORR=2 1 1\nPIXASPECT=1\n"
    write_hdr(tmp_path / "a.hdr", c, header=head)
    want = value_of(c) / 0.5 / np.array([2, 2, 4])
    assert np.allclose(load(tmp_path / "a.hdr", tmp_path), want, rtol=1e-7, atol=0)


def test_hdr_starts(tmp_path):
    c = rgbe_of(radiance())
    for start in ("#?RADIANCE\n", "#?RGBE\n", "VIEW= -vtv\n#?RADIANCE\n", "#?AUTOPANO\n", "made by hand\n"):
        write_hdr(tmp_path / "a.hdr", c, start=start)
        assert probe(tmp_path / "a.hdr")["format"] == "hdr"
        assert np.array_equal(load(tmp_path / "a.hdr", tmp_path), value_of(c).astype(np.float32))


def test_hdr_xyze(tmp_path):
    """White stays white and Y = 179·luminance, for the primaries in Radiance's color.h."""
    xy = np.array([[0.640, 0.330], [0.290, 0.600], [0.150, 0.060]])
    p = np.stack([xy[:, 0] / xy[:, 1], np.ones(3), (1 - xy.sum(1)) / xy[:, 1]])
    to_xyz = p * np.linalg.solve(p, np.ones(3))
    assert np.allclose(to_xyz[1], [0.265, 0.670, 0.065], atol=5e-4)  # docs/FORMAT.md's luminance weights
    c = rgbe_of(radiance(decades=4))
    write_hdr(tmp_path / "a.hdr", c, fmt="xyze")
    want = np.einsum("ij,yxj->yxi", np.linalg.inv(to_xyz * 179), value_of(c))
    assert np.allclose(load(tmp_path / "a.hdr", tmp_path), want, rtol=1e-5, atol=1e-7 * want.max())


def test_hdr_written_is_within_one_code_and_stable(tmp_path):
    a = radiance()
    write_pfm(tmp_path / "a.pfm", a)
    assert run(IMGTOOL, "convert", "--comment", "made\nby test", "--extra", tmp_path / "a.pfm", tmp_path / "b.hdr").returncode == 0
    got = load(tmp_path / "b.hdr", tmp_path)
    step = a.max(axis=2, keepdims=True) / 128  # a code is 1/256 to 1/128 of the largest channel
    assert (np.abs(got - a) <= step / 2 * 1.00001)[a.max(axis=2) > 0].all() and (got[1] == 0).all()
    assert np.array_equal(got, value_of(rgbe_of(a)).astype(np.float32))
    assert run(IMGTOOL, "convert", tmp_path / "b.hdr", tmp_path / "c.hdr").returncode == 0
    assert np.array_equal(load(tmp_path / "c.hdr", tmp_path), got)
    head = (tmp_path / "b.hdr").read_bytes().split(b"\n\n")[0].decode().splitlines()
    assert head == ["#?RADIANCE", "made by test", "owner=nobody", "expTime=0.25", "ilf:origin=1 2 3", "ilf:version=1",
                    "curve=1.5 2.5 -3.5", "FORMAT=32-bit_rle_rgbe"]


def test_hdr_extremes(tmp_path):
    a = np.array([[[1e38, 0, -5], [2e-33, 0, 0], [1e-30, 1, 1], [-1, -2, -3]]], np.float32)
    write_pfm(tmp_path / "a.pfm", a)
    assert run(IMGTOOL, "convert", tmp_path / "a.pfm", tmp_path / "b.hdr").returncode == 0
    got = load(tmp_path / "b.hdr", tmp_path)
    assert np.isfinite(got).all() and abs(got[0, 0, 0] / 1e38 - 1) < 1 / 256 and (got[0, 3] == 0).all()
    a[0, 0, 0] = 2e38
    write_pfm(tmp_path / "a.pfm", a)
    assert "(0, 0)" in refused(run(IMGTOOL, "convert", tmp_path / "a.pfm", tmp_path / "c.hdr"))
    assert not (tmp_path / "c.hdr").exists()


# ---- OpenEXR -------------------------------------------------------------------------------------------

def read_exr(path):
    with OpenEXR.File(str(path), separate_channels=True) as f:
        return {k: v.pixels.copy() for k, v in f.channels().items()}, dict(f.header())


COMPRESSIONS = "NO RLE ZIPS ZIP PIZ PXR24 B44 B44A DWAA DWAB".split()


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("kind", [np.float16, np.float32])
@pytest.mark.parametrize("tiled", [False, True])
def test_exr_compressions(tmp_path, compression, kind, tiled):
    """As the OpenEXR library itself reads the file (PXR24 and B44 lose bits when written)."""
    a = radiance(decades=6).astype(kind)
    head = {"compression": getattr(OpenEXR, compression + "_COMPRESSION")}
    if tiled:
        head |= {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
        head["tiles"].xSize, head["tiles"].ySize = 16, 8
    write_exr(tmp_path / "a.exr", {n: np.ascontiguousarray(a[:, :, i]) for i, n in enumerate("RGB")}, **head)
    peer, _ = read_exr(tmp_path / "a.exr")
    want = np.stack([peer[n] for n in "RGB"], axis=2).astype(np.float32)
    assert np.array_equal(both(tmp_path / "a.exr", tmp_path), want)


@pytest.mark.parametrize("names", ["RGBA", "RGB", "YA", "Y"])
def test_exr_channels_and_types(tmp_path, names):
    """Any order, further channels, mixed types, unsigned integers, NaN and infinity pass through."""
    rng = np.random.default_rng(4)
    kinds = [np.float16, np.float32, np.uint32, np.float16]
    planes = {n: rng.integers(1, 1000, (H, W)).astype(k) for n, k in zip(names, kinds)}
    planes[names[0]][3, 4:7] = [np.nan, np.inf, 6e-8]
    extra = {"depth.Z": rng.random((H, W)).astype(np.float32), "AA": np.ones((H, W), np.float16)}
    write_exr(tmp_path / "a.exr", planes | extra)
    want = np.stack([planes[n] for n in names], axis=2).astype(np.float32)
    assert np.array_equal(both(tmp_path / "a.exr", tmp_path), want, equal_nan=True)


@pytest.mark.parametrize("tiled", [False, True])
@pytest.mark.parametrize("line_order", ["INCREASING_Y", "DECREASING_Y"])
def test_exr_data_window(tmp_path, tiled, line_order):
    a = radiance(decades=2)
    head = {"dataWindow": (np.array([-7, 100], np.int32), np.array([-7 + W - 1, 100 + H - 1], np.int32)),
            "displayWindow": (np.array([0, 0], np.int32), np.array([199, 199], np.int32)),
            "lineOrder": getattr(OpenEXR, line_order)}
    if tiled:
        head |= {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
        head["tiles"].xSize, head["tiles"].ySize = 16, 16
    write_exr(tmp_path / "a.exr", {n: np.ascontiguousarray(a[:, :, i]) for i, n in enumerate("RGB")}, **head)
    want = np.zeros((200, 200, 4), np.float32)  # at its place in the display window; beyond it nothing is known
    want[100:100 + H, :W - 7] = np.concatenate([a, np.ones((H, W, 1), np.float32)], 2)[:, 7:]
    assert np.array_equal(both(tmp_path / "a.exr", tmp_path), want)


def test_exr_facts(tmp_path):
    write_exr(tmp_path / "a.exr", {"Y": np.ones((H, W), np.float32)}, expTime=0.125, aperture=2.8, isoSpeed=400.0)
    got = probe(tmp_path / "a.exr")
    assert got["size"] == (W, H) and got["channels"] == 1 and got["coded"] == 0
    assert np.allclose([got["exposure"], got["f"], got["iso"]], [0.125, 2.8, 400])


def test_exr_of_several_pictures_is_asked_about(tmp_path):
    a, b = radiance(decades=2), radiance(5, 5)
    window = (np.array([0, 0], np.int32), np.array([W - 1, H - 1], np.int32))
    parts = [OpenEXR.Part({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "displayWindow": window},
                          {n: np.ascontiguousarray(x[:, :, i]) for i, n in enumerate("RGB")}, name)
             for name, x in (("one", a), ("two", b))]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    assert "found 2: one, two" in refused(run(IMGTOOL, "dump", tmp_path / "a.exr", tmp_path / "b"))
    p = run(IMGTOOL, "dump", "--layer", "one", tmp_path / "a.exr", tmp_path / "b")
    assert p.returncode == 0 and p.stderr == b""
    assert np.array_equal(np.fromfile(tmp_path / "b", np.float32, offset=12).reshape(H, W, 3), a)


def test_exr_refusals(tmp_path):
    y = np.ones((4, 4), np.float32)
    write_exr(tmp_path / "a.exr", {"R": y, "G": y, "up": y})
    assert "found G, R, up" in refused(run(IMGTOOL, "probe", tmp_path / "a.exr"))
    write_exr(tmp_path / "b.exr", {"Y": y, "RY": y, "BY": y})
    assert "expected channel BY at every second pixel" in refused(run(IMGTOOL, "probe", tmp_path / "b.exr"))
    write_exr(tmp_path / "z.exr", {"Z": y})  # depth is no light
    assert "found Z" in refused(run(IMGTOOL, "probe", tmp_path / "z.exr"))
    write_exr(tmp_path / "c.exr", {"Y": y})
    data = (tmp_path / "c.exr").read_bytes()
    entry = b"Y\0" + struct.pack("<iIii", 2, 0, 1, 1)
    assert data.count(entry) == 1
    (tmp_path / "c.exr").write_bytes(data.replace(entry, b"Y\0" + struct.pack("<iIii", 2, 0, 2, 2)))
    assert "subsampled 2x2" in refused(run(IMGTOOL, "probe", tmp_path / "c.exr"))


@pytest.mark.parametrize("compression", ["none", "rle", "zips", "zip", "piz"])
@pytest.mark.parametrize("kind", ["half", "float"])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_exr_written(tmp_path, compression, kind, channels):
    a = codes(channels, 65535) if channels in (2, 4) else radiance(channels=channels, decades=8)
    if channels in (2, 4):
        write_png(tmp_path / "a.png", a, 16, {2: 4, 4: 6}[channels])
        a = a.astype(np.float32)
        source = "a.png"
    else:
        write_pfm(tmp_path / "a.pfm", a)
        source = "a.pfm"
    scale = 0.5 if channels in (2, 4) else 1
    p = run(IMGTOOL, "convert", "--type", kind, "--compression", compression, "--comment", "why", "--extra", "--scale",
            scale, tmp_path / source, tmp_path / "b.exr")
    assert p.returncode == 0, p.stderr
    got, head = read_exr(tmp_path / "b.exr")
    t = np.float16 if kind == "half" else np.float32
    names = {1: "Y", 2: "YA", 3: "RGB", 4: "RGBA"}[channels]
    assert set(got) == set(names) | {"sigma.R", "count"}
    for i, n in enumerate(names):
        assert got[n].dtype == t and np.array_equal(got[n], (a[:, :, i] * np.float32(scale)).astype(t))
    i = np.arange(W * H).reshape(H, W)
    assert np.array_equal(got["sigma.R"], (i % 2048).astype(np.float16))
    assert np.array_equal(got["count"], i.astype(np.float32) + np.float32(0.1))
    assert head["comments"] == "why" and head["owner"] == "nobody" and head["expTime"] == 0.25
    assert head["ilf:version"] == 1 and list(head["ilf:origin"]) == [1, 2, 3] and list(head["curve"]) == [1.5, 2.5, -3.5]
    assert np.array_equal(load(tmp_path / "b.exr", tmp_path), np.stack([got[n] for n in names], 2).astype(np.float32))


@pytest.mark.parametrize("channels", [3, 4])
def test_exr_written_dwaa(tmp_path, channels):
    """Lossy: smooth values come back within a few per cent, alpha exactly."""
    y, x = np.mgrid[0:H, 0:W]
    a = np.stack([(1 + x) * 500, (1 + y) * 900, (1 + x + y) * 700, x * 1700], axis=2)[:, :, :channels]
    write_png(tmp_path / "a.png", a, 16, {3: 2, 4: 6}[channels])
    args = [IMGTOOL, "convert", "--compression", "dwaa", "--comment", "why", tmp_path / "a.png", tmp_path / "b.exr"]
    assert "half" in refused(run(*args, "--type", "float"))
    assert run(*args, "--type", "half").returncode == 0
    got, head = read_exr(tmp_path / "b.exr")
    assert head["compression"] == OpenEXR.DWAA_COMPRESSION and head["comments"] == "why"
    both_ways = both(tmp_path / "b.exr", tmp_path)
    for i, n in enumerate("RGBA"[:channels]):
        assert np.array_equal(both_ways[:, :, i], got[n].astype(np.float32))
        assert np.allclose(got[n], a[:, :, i], rtol=0.05 if n != "A" else 2 ** -11, atol=0)


@pytest.mark.parametrize("names", ["RGBA", "Y"])
def test_exr_dwa_window_and_channels(tmp_path, names):
    y, x = np.mgrid[0:H, 0:W]
    planes = {n: (1 + x + 2 * y + i).astype(np.float16) for i, n in enumerate(names)}
    window = (np.array([-7, 100], np.int32), np.array([-7 + W - 1, 100 + H - 1], np.int32))
    write_exr(tmp_path / "a.exr", planes, compression=OpenEXR.DWAB_COMPRESSION, dataWindow=window, displayWindow=window)
    peer, _ = read_exr(tmp_path / "a.exr")
    want = np.stack([peer[n] for n in names], axis=2).astype(np.float32)
    assert np.array_equal(both(tmp_path / "a.exr", tmp_path), want)


def test_exr_dwa_beyond_half(tmp_path):
    """Chunks that DWA can't make smaller are stored as they are, floats included."""
    a = radiance(5, 3, decades=6)
    a[2, 4] = 1e6
    write_exr(tmp_path / "a.exr", {n: np.ascontiguousarray(a[:, :, i]) for i, n in enumerate("RGB")},
              compression=OpenEXR.DWAB_COMPRESSION)
    assert np.array_equal(both(tmp_path / "a.exr", tmp_path), a)


def test_exr_default_type_holds_all_values(tmp_path):
    for top, kind in ((65504, np.float16), (65505, np.float32)):
        write_pfm(tmp_path / "a.pfm", np.full((2, 2, 3), top, np.float32))
        assert run(IMGTOOL, "convert", tmp_path / "a.pfm", tmp_path / "b.exr").returncode == 0
        assert read_exr(tmp_path / "b.exr")[0]["R"].dtype == kind


@pytest.mark.parametrize("value, args, words", [
    (70000, ["--type", "half"], "65504"), (-70000, ["--type", "half"], "65504"), (np.nan, [], "nan"),
    (np.inf, [], "inf"), (1, ["--compression", "lzw"], "found 'lzw'")])
def test_values_that_are_not_written(tmp_path, value, args, words):
    a = np.ones((4, 5, 3), np.float32)
    a[2, 3, 1] = value
    write_pfm(tmp_path / "a.pfm", a)
    for name in ("b.exr", "b.hdr", "b.png") if not args else ("b.exr",):
        (tmp_path / name).write_bytes(b"old")
        line = refused(run(IMGTOOL, "convert", *args, tmp_path / "a.pfm", tmp_path / name))
        assert words in line and (value == 1 or "pixel (3, 2)" in line)
        assert (tmp_path / name).read_bytes() == b"old"
    assert {p.name for p in tmp_path.iterdir()} <= {"a.pfm", "b.exr", "b.hdr", "b.png"}
