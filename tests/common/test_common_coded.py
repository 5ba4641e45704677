"""common/image: coded formats and raw read exactly; and what all formats have in common."""
import numpy as np
import pytest
from PIL import Image, ImageOps

from common_util import (IMGTOOL, both, codes, H, load, probe, radiance, refused, rgbe_of, run, W, write_dng, write_exr,
                         write_hdr, write_pfm, write_png, write_pnm, write_tiff)


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
    if samples == 4:  # associated: colours were multiplied by alpha
        top = 1 if kind == np.float32 else float(np.iinfo(kind).max)
        share = a[:, :, 3:].astype(float) / top
        inside = (share > 0) & (share < 1)
        rgb = np.where(inside, a[:, :, :3] / np.where(inside, share, 1), a[:, :, :3])
        want = np.concatenate([rgb if kind == np.float32 else np.minimum(rgb, top), a[:, :, 3:]], 2).astype(np.float32)
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
    """A reader of rows stays small where the picture is large: 3000 x 2000 RGB are 72 MB as float."""
    a = np.zeros((2000, 3000, 3), np.uint8)
    write_pnm(tmp_path / "a.ppm", a, 255)
    write_png(tmp_path / "a.png", a, 8, 2)
    write_tiff(tmp_path / "a.tif", a, rows=2000)
    write_hdr(tmp_path / "a.hdr", np.zeros((2000, 3000, 4), np.uint8), line=np.ndarray.tobytes)
    f = np.zeros((2000, 3000), np.float16)
    write_exr(tmp_path / "a.exr", {"R": f, "G": f, "B": f})
    Image.fromarray(a).save(tmp_path / "a.jpg")
    for name in ("a.ppm", "a.png", "a.tif", "a.hdr", "a.exr", "a.jpg"):
        p = run(IMGTOOL, "stream", tmp_path / name)
        assert p.returncode == 0, p.stderr
        kib = int(p.stdout)
        assert kib < (300000 if "san" in IMGTOOL.parts else 40000), (name, kib)
