"""common/image: every format read exactly, written and read back; the row stream equals the whole picture."""
import struct

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from common_util import (IMGTOOL, both, line_new, line_old, load, probe, refused, rgbe_of, run, value_of, write_dng,
                         write_hdr, write_pfm, write_png, write_pnm, write_tiff)

W, H = 37, 23  # odd, and no multiple of any tile, strip or chunk


def codes(samples, maximum, w=W, h=H, seed=1):
    rng = np.random.default_rng(seed)
    a = rng.integers(0, maximum, (h, w, samples), endpoint=True)
    a[0, 0], a[-1, -1] = 0, maximum
    return a


def radiance(w=W, h=H, channels=3, decades=12, seed=2):
    """Positive values over many decades with black and constant stretches."""
    rng = np.random.default_rng(seed)
    a = (10 ** rng.uniform(-decades / 2, decades / 2, (h, w, channels))).astype(np.float32)
    a[1] = 0
    a[2, w // 4:] = a[2, 0]
    return a


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
    assert np.allclose(to_xyz[1], [0.265, 0.670, 0.065], atol=5e-4)  # the contract's luminance weights
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

def write_exr(path, channels, **header):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File(header, channels).write(str(path))


def read_exr(path):
    with OpenEXR.File(str(path), separate_channels=True) as f:
        return {k: v.pixels.copy() for k, v in f.channels().items()}, dict(f.header())


COMPRESSIONS = "NO RLE ZIPS ZIP PIZ PXR24 B44 B44A".split()


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
    if compression.startswith("B44") and kind == np.float32:  # the C library reads other numbers than the C++ one
        assert "expected half channels" in refused(run(IMGTOOL, "dump", tmp_path / "a.exr", tmp_path / "b"))
        return
    peer, _ = read_exr(tmp_path / "a.exr")
    want = np.stack([peer[n] for n in "RGB"], axis=2).astype(np.float32)
    assert np.array_equal(both(tmp_path / "a.exr", tmp_path), want)


@pytest.mark.parametrize("names", ["RGBA", "RGB", "YA", "Y", "Z"])
def test_exr_channels_and_types(tmp_path, names):
    """Any order, further channels, mixed types, unsigned integers, NaN and infinity pass through."""
    rng = np.random.default_rng(4)
    kinds = [np.float16, np.float32, np.uint32, np.float16]
    planes = {n: rng.integers(0, 1000, (H, W)).astype(k) for n, k in zip(names, kinds)}
    planes[names[0]][3, 4:7] = [np.nan, np.inf, 6e-8]
    extra = {} if names == "Z" else {"depth.Z": rng.random((H, W)).astype(np.float32), "AA": np.ones((H, W), np.float16)}
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
    assert np.array_equal(both(tmp_path / "a.exr", tmp_path), a)


def test_exr_facts(tmp_path):
    write_exr(tmp_path / "a.exr", {"Y": np.ones((H, W), np.float32)}, expTime=0.125, aperture=2.8, isoSpeed=400.0)
    got = probe(tmp_path / "a.exr")
    assert got["size"] == (W, H) and got["channels"] == 1 and got["coded"] == 0
    assert np.allclose([got["exposure"], got["f"], got["iso"]], [0.125, 2.8, 400])


def test_exr_first_of_several_parts(tmp_path):
    a, b = radiance(decades=2), radiance(5, 5)
    window = (np.array([0, 0], np.int32), np.array([W - 1, H - 1], np.int32))
    parts = [OpenEXR.Part({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "displayWindow": window},
                          {n: np.ascontiguousarray(x[:, :, i]) for i, n in enumerate("RGB")}, name)
             for name, x in (("one", a), ("two", b))]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    assert np.array_equal(both(tmp_path / "a.exr", tmp_path), a)


def test_exr_refusals(tmp_path):
    y = np.ones((4, 4), np.float32)
    write_exr(tmp_path / "a.exr", {"R": y, "G": y, "up": y})
    assert "found G, R, up" in refused(run(IMGTOOL, "probe", tmp_path / "a.exr"))
    write_exr(tmp_path / "b.exr", {"Y": y, "RY": y, "BY": y})
    assert "expected channels R, G, B or Y" in refused(run(IMGTOOL, "probe", tmp_path / "b.exr"))
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


# ---- PNG -----------------------------------------------------------------------------------------------

@pytest.mark.parametrize("bits, colour, samples", [(1, 0, 1), (2, 0, 1), (4, 0, 1), (8, 0, 1), (16, 0, 1), (8, 2, 3),
                                                   (16, 2, 3), (8, 4, 2), (16, 4, 2), (8, 6, 4), (16, 6, 4)])
@pytest.mark.parametrize("interlace", [False, True])
def test_png(tmp_path, bits, colour, samples, interlace):
    """Codes as stored (a gamma chunk changes nothing); fewer bits are stretched to 0..255."""
    a = codes(samples, 2 ** bits - 1)
    write_png(tmp_path / "a.png", a, bits, colour, interlace, gamma=0.45)
    assert np.array_equal(both(tmp_path / "a.png", tmp_path), a if bits >= 8 else a * (255 // (2 ** bits - 1)))
    got = probe(tmp_path / "a.png")
    assert (got["format"], got["size"], got["channels"], got["coded"]) == ("png", (W, H), samples, 1)
    assert got["max"] == (65535 if bits == 16 else 255)


@pytest.mark.parametrize("bits", [1, 2, 4, 8])
def test_png_palette(tmp_path, bits):
    palette = codes(3, 255, 2 ** bits, 1)[0]
    a = codes(1, 2 ** bits - 1)
    write_png(tmp_path / "a.png", a, bits, 3, palette=palette)
    assert np.array_equal(both(tmp_path / "a.png", tmp_path), palette[a[:, :, 0]])


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_png_written_codes(tmp_path, channels):
    a = codes(channels, 255)
    write_png(tmp_path / "a.png", a, 8, {1: 0, 2: 4, 3: 2, 4: 6}[channels])
    assert run(IMGTOOL, "convert", tmp_path / "a.png", tmp_path / "b.png").returncode == 0
    with Image.open(tmp_path / "b.png") as im:
        assert np.array_equal(np.asarray(im).reshape(H, W, channels), a)


def test_png_written_light_is_srgb(tmp_path):
    a = np.linspace(-0.1, 1.1, 300, dtype=np.float32).reshape(1, 100, 3)
    write_pfm(tmp_path / "a.pfm", a)
    assert run(IMGTOOL, "convert", tmp_path / "a.pfm", tmp_path / "b.png").returncode == 0
    v = np.clip(a.astype(np.float64), 0, 1)
    want = np.floor(255 * np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055) + 0.5)
    assert np.array_equal(load(tmp_path / "b.png", tmp_path), want)
    back = load(tmp_path / "b.png", tmp_path, "linear")  # and the inverse curve is the inverse
    assert np.abs(back - v).max() < 0.5 / 255 * 2.3


@pytest.mark.parametrize("bits", [8, 16])
def test_linearise_leaves_alpha_linear(tmp_path, bits):
    a = codes(4, 2 ** bits - 1)
    write_png(tmp_path / "a.png", a, bits, 6)
    v = a / (2 ** bits - 1)
    want = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    want[:, :, 3] = v[:, :, 3]
    assert np.allclose(load(tmp_path / "a.png", tmp_path, "linear"), want, rtol=1e-6, atol=1e-9)


# ---- JPEG ----------------------------------------------------------------------------------------------

@pytest.mark.parametrize("mode", ["L", "RGB"])
@pytest.mark.parametrize("progressive", [False, True])
@pytest.mark.parametrize("subsampling", [0, 2])
def test_jpeg(tmp_path, mode, progressive, subsampling):
    y, x = np.mgrid[0:H, 0:W]
    a = np.stack([x * 6, y * 10, (x + y) * 4], axis=2).astype(np.uint8)
    im = Image.fromarray(a if mode == "RGB" else a[:, :, 0])
    im.save(tmp_path / "a.jpg", quality=90, progressive=progressive, subsampling=subsampling)
    with Image.open(tmp_path / "a.jpg") as back:
        want = np.asarray(back).reshape(H, W, -1).astype(int)
    got = both(tmp_path / "a.jpg", tmp_path)
    assert got.shape == want.shape and np.abs(got - want).max() <= 1  # two builds of the library


def test_jpeg_of_four_inks_is_refused(tmp_path):
    Image.new("CMYK", (8, 8)).save(tmp_path / "a.jpg")
    assert "expected a grey or RGB JPEG" in refused(run(IMGTOOL, "probe", tmp_path / "a.jpg"))


# ---- TIFF ----------------------------------------------------------------------------------------------

@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("samples", [1, 2, 3, 4, 5])
@pytest.mark.parametrize("layout", ["strips", "one strip", "tiles"])
@pytest.mark.parametrize("separate", [False, True])
def test_tiff(tmp_path, kind, samples, layout, separate):
    a = radiance(channels=samples) if kind == np.float32 else codes(samples, np.iinfo(kind).max).astype(kind)
    extra = {2: [2], 4: [1], 5: [0, 0]}.get(samples)
    order = "<" if layout == "strips" else ">"
    write_tiff(tmp_path / "a.tif", a, order, separate=separate, tile=(16, 16) if layout == "tiles" else None,
               rows=H if layout == "one strip" else 3, deflate=samples % 2 == 1, extra=extra)
    want = a[:, :, :3] if samples == 5 else a  # what isn't alpha is left out
    assert np.array_equal(both(tmp_path / "a.tif", tmp_path), want)
    got = probe(tmp_path / "a.tif")
    assert got["max"] == {np.uint8: 255, np.uint16: 65535, np.float32: 0}[kind] and got["coded"] == (kind != np.float32)


def shown(a, orientation):
    """TIFF 6.0, tag 274: where row 0 and column 0 of the file lie in the picture."""
    if orientation >= 5:
        a = a.transpose(1, 0, 2)
    if orientation in (2, 3, 6, 7):
        a = a[:, ::-1]
    if orientation in (3, 4, 7, 8):
        a = a[::-1]
    return a


@pytest.mark.parametrize("orientation", range(1, 9))
def test_tiff_orientation(tmp_path, orientation):
    a = codes(3, 255).astype(np.uint8)
    write_tiff(tmp_path / "a.tif", a, orientation=orientation)
    with Image.open(tmp_path / "a.tif") as im:
        from PIL import ImageOps
        assert np.array_equal(np.asarray(ImageOps.exif_transpose(im)), shown(a, orientation))
    assert np.array_equal(both(tmp_path / "a.tif", tmp_path), shown(a, orientation))


def test_tiff_palette_and_inverted_grey(tmp_path):
    a = codes(1, 255).astype(np.uint8)
    palette = codes(3, 65535, 256, 1)[0]
    write_tiff(tmp_path / "a.tif", a, photometric=3, palette=palette)
    assert np.array_equal(both(tmp_path / "a.tif", tmp_path), palette[a[:, :, 0]])
    write_tiff(tmp_path / "b.tif", a, photometric=0)
    assert np.array_equal(both(tmp_path / "b.tif", tmp_path), 255 - a)


@pytest.mark.parametrize("compression", ["tiff_lzw", "packbits", "jpeg", "tiff_adobe_deflate"])
def test_tiff_compressions(tmp_path, compression):
    y, x = np.mgrid[0:H, 0:W]
    a = np.stack([x * 6, y * 10, (x + y) * 4], axis=2).astype(np.uint8)
    Image.fromarray(a).save(tmp_path / "a.tif", compression=compression)
    with Image.open(tmp_path / "a.tif") as im:
        want = np.asarray(im).astype(int)
    assert np.abs(both(tmp_path / "a.tif", tmp_path) - want).max() <= (1 if compression == "jpeg" else 0)


def test_tiff_refusals(tmp_path):
    a = codes(1, 255).astype(np.uint8)
    write_tiff(tmp_path / "a.tif", a, photometric=9)
    assert "photometric" in refused(run(IMGTOOL, "probe", tmp_path / "a.tif"))
    write_tiff(tmp_path / "b.tif", a, more={258: (3, [12])}.items())
    assert "12 bit" in refused(run(IMGTOOL, "probe", tmp_path / "b.tif"))


# ---- PNM, PFM, raw, and what all have in common ----------------------------------------------------------

@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("maximum", [1, 200, 255, 256, 1023, 65535])
@pytest.mark.parametrize("text", [False, True])
def test_pnm(tmp_path, samples, maximum, text):
    a = codes(samples, maximum)
    write_pnm(tmp_path / "a.pnm", a, maximum, text)
    assert np.array_equal(both(tmp_path / "a.pnm", tmp_path), a)
    assert probe(tmp_path / "a.pnm")["max"] == maximum


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("scale", [1, 0.5])
def test_pfm(tmp_path, samples, order, scale):
    a = radiance(channels=samples)
    a[5, 5, 0] = np.nan
    write_pfm(tmp_path / "a.pfm", a, order, scale)
    assert np.array_equal(both(tmp_path / "a.pfm", tmp_path), a * np.float32(scale), equal_nan=True)


def test_raw_is_linear_and_states_its_facts(tmp_path):
    """Flat fields of grey: radiance in proportion to the code, white level -> 1, whatever the picture holds."""
    got = {}
    for code in (40, 400, 4000, 4095):
        write_dng(tmp_path / "a.dng", np.full((64, 96), code))
        info = probe(tmp_path / "a.dng")
        assert (info["format"], info["size"], info["coded"]) == ("raw", (96, 64), 0)
        assert np.allclose([info["exposure"], info["f"], info["iso"]], [0.125, 2.8, 200])
        a = both(tmp_path / "a.dng", tmp_path)
        assert np.ptp(a, axis=(0, 1)).max() <= 2 / 65535
        got[code] = a.mean(axis=(0, 1))
    for code, v in got.items():
        assert np.allclose(v, code / 4095, atol=2e-3 * code / 4095 + 1 / 65535), (code, v)


def test_raw_keeps_colours_apart(tmp_path):
    cfa = np.full((64, 96), 500)
    cfa[0::2, 0::2] = 2000  # the red pixels of RGGB
    write_dng(tmp_path / "a.dng", cfa)
    a = load(tmp_path / "a.dng", tmp_path)[8:-8, 8:-8].mean(axis=(0, 1))
    assert np.allclose(a, np.array([2000, 500, 500]) / 4095, rtol=0.01)


def test_content_decides_not_the_name(tmp_path):
    a = codes(3, 255)
    write_pnm(tmp_path / "a.png", a, 255)
    write_png(tmp_path / "a.hdr", a, 8, 2)
    assert probe(tmp_path / "a.png")["format"] == "pnm" and probe(tmp_path / "a.hdr")["format"] == "png"


@pytest.mark.parametrize("kind", ["pnm", "png", "tif", "exr", "hdr", "pfm", "jpg"])
def test_standard_input(tmp_path, kind):
    a = codes(3, 255).astype(np.uint8)
    path = tmp_path / f"a.{kind}"
    {"pnm": lambda: write_pnm(path, a, 255), "png": lambda: write_png(path, a, 8, 2), "tif": lambda: write_tiff(path, a),
     "exr": lambda: write_exr(path, {n: np.ascontiguousarray(a[:, :, i]).astype(np.float32) for i, n in enumerate("RGB")}),
     "hdr": lambda: write_hdr(path, rgbe_of(a.astype(np.float32))), "pfm": lambda: write_pfm(path, a.astype(np.float32)),
     "jpg": lambda: Image.fromarray(a).save(path)}[kind]()
    want = load(path, tmp_path)
    out = tmp_path / "out.f32"
    p = run(IMGTOOL, "dump", "-", out, input=path.read_bytes())
    assert p.returncode == 0, p.stderr
    assert np.array_equal(np.fromfile(out, np.float32, offset=12).reshape(want.shape), want)


def test_hdr_to_standard_output(tmp_path):
    write_hdr(tmp_path / "a.hdr", rgbe_of(radiance()))
    p = run(IMGTOOL, "convert", tmp_path / "a.hdr", "-")
    (tmp_path / "b.hdr").write_bytes(p.stdout)
    assert p.returncode == 0 and np.array_equal(load(tmp_path / "b.hdr", tmp_path), load(tmp_path / "a.hdr", tmp_path))


def test_unknown_ending(tmp_path):
    write_pfm(tmp_path / "a.pfm", radiance())
    for name in ("b.jpg", "b", ".exr/b", "exr"):
        assert "ends in .exr, .hdr or .png" in refused(run(IMGTOOL, "convert", tmp_path / "a.pfm", tmp_path / name))
    assert run(IMGTOOL, "convert", tmp_path / "a.pfm", tmp_path / "B.EXR").returncode == 0


def test_rows_stream_in_little_memory(tmp_path):
    """A reader of rows stays small where the picture is large: 6000 x 4000 RGB are 288 MB as float."""
    a = np.zeros((4000, 6000, 3), np.uint8)
    write_pnm(tmp_path / "a.ppm", a, 255)
    write_png(tmp_path / "a.png", a, 8, 2)
    write_tiff(tmp_path / "a.tif", a, rows=4000)
    write_hdr(tmp_path / "a.hdr", np.zeros((4000, 6000, 4), np.uint8))
    f = np.zeros((4000, 6000), np.float16)
    write_exr(tmp_path / "a.exr", {"R": f, "G": f, "B": f})
    Image.fromarray(a).save(tmp_path / "a.jpg")
    for name in ("a.ppm", "a.png", "a.tif", "a.hdr", "a.exr", "a.jpg"):
        p = run(IMGTOOL, "stream", tmp_path / name)
        assert p.returncode == 0, p.stderr
        kib = int(p.stdout)
        assert kib < (300000 if "san" in IMGTOOL.parts else 40000), (name, kib)
