"""Orientation tags: one rule for JPEG, TIFF, PNG and raw.  Pillow's exif_transpose() is the peer."""
import numpy as np
import pytest
from PIL import Image, ImageOps

from common_util import IMGTOOL, both, H, load, probe, run, W, write_dng
from conftest import shared_case
from conftest import run as run_installed


def write(path, orientation, a, order="II"):
    exif = Image.Exif()
    exif.endian = "<" if order == "II" else ">"
    exif[0x0112] = orientation
    how = {"exif": exif.tobytes()}
    if path.suffix == ".jpg":
        how |= {"quality": 98, "subsampling": 0}
    if path.suffix == ".tif":
        how = {"tiffinfo": {274: orientation}}
    Image.fromarray(a).save(path, **how)


def picture():
    y, x = np.mgrid[0:H, 0:W]
    return np.stack([x * 6, y * 10, (x + y) * 4], axis=2).astype(np.uint8)


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_turned_as_it_is_looked_at(tmp_path, suffix, orientation):
    path = tmp_path / f"a{suffix}"
    write(path, orientation, picture(), "II" if orientation % 2 else "MM")
    with Image.open(path) as im:
        stored = np.asarray(im).astype(int) if suffix == ".jpg" else picture().astype(int)  # Pillow turns TIFFs itself
        want = np.asarray(ImageOps.exif_transpose(im)).astype(int)
    got = both(path, tmp_path)
    assert got.shape == want.shape and np.abs(got - want).max() <= 1  # two builds of the JPEG library
    info = probe(path)
    assert info["orientation"] == orientation and info["size"] == (want.shape[1], want.shape[0])
    p = run(IMGTOOL, "rows", path, tmp_path / "k", "--keep-orientation")
    assert p.returncode == 0, p.stderr
    w, h, c = np.fromfile(tmp_path / "k", np.int32, 3)
    kept = np.fromfile(tmp_path / "k", np.float32, offset=12).reshape(h, w, c)
    assert kept.shape == stored.shape and np.abs(kept - stored).max() <= 1


@pytest.mark.parametrize("value", [0, 9, 65535])
def test_a_tag_beyond_its_range_says_nothing(tmp_path, value):
    write(tmp_path / "a.jpg", value, picture())
    assert probe(tmp_path / "a.jpg")["orientation"] == 1 and probe(tmp_path / "a.jpg")["size"] == (W, H)


def test_png_says_it_after_its_pixels(tmp_path):
    """eXIf may follow the pixels (PNG specification, third edition, 11.3.4.5)."""
    write(tmp_path / "a.png", 6, picture())
    data = (tmp_path / "a.png").read_bytes()
    at = data.index(b"eXIf") - 4
    size = 12 + int.from_bytes(data[at:at + 4], "big")
    block, rest = data[at:at + size], data[:at] + data[at + size:]
    (tmp_path / "b.png").write_bytes(rest[:-12] + block + rest[-12:])
    assert probe(tmp_path / "b.png")["orientation"] == 6
    assert np.array_equal(load(tmp_path / "b.png", tmp_path), load(tmp_path / "a.png", tmp_path))


def test_any_cut_of_the_exif_block(tmp_path):
    """A broken block says nothing, and nothing falls over it."""
    write(tmp_path / "a.png", 6, picture())
    data = (tmp_path / "a.png").read_bytes()
    at = data.index(b"eXIf") - 4
    size = int.from_bytes(data[at:at + 4], "big")
    block = data[at + 8:at + 8 + size]
    import zlib
    for n in range(size):
        body = b"eXIf" + block[:n]
        chunk = n.to_bytes(4, "big") + body + zlib.crc32(body).to_bytes(4, "big")
        (tmp_path / "b.png").write_bytes(data[:at] + chunk + data[at + 12 + size:])
        p = run(IMGTOOL, "probe", tmp_path / "b.png")
        assert p.returncode in (0, 1)
        if p.returncode == 0:
            assert b"orientation=1" in p.stdout or n >= 22  # the entry is whole


def test_the_rows_of_an_upright_jpeg_stream(tmp_path):
    tall = np.zeros((20000, 500, 3), np.uint8)
    Image.fromarray(tall).save(tmp_path / "a.jpg")
    write(tmp_path / "b.jpg", 3, tall)
    if "san" in IMGTOOL.parts:
        pytest.skip("the sanitizer's own memory would be measured")
    peak = [int(run(IMGTOOL, "stream", tmp_path / f"{k}.jpg").stdout) for k in "ab"]
    assert peak[0] + 20000 < peak[1] < peak[0] + 50000  # KiB; the whole picture is 29 MB as bytes, 120 as floats


def test_portrait_photographs_alike(tmp_path):
    """fishremap gives the same light whichever format the picture is stored in."""
    folder = shared_case("jpeg_exif_orientation")
    probes = []
    for name in ("o6.jpg", "o6.tif"):
        run_installed("fishremap", "--lens", "equisolid", "--fov", "180", "--size", "32x16", "-o", tmp_path / "p.exr", folder / name)
        probes.append(load(tmp_path / "p.exr", tmp_path))
    d = np.abs(probes[0] - probes[1])  # the JPEG's colours are blurred
    assert d.max() < 0.06 * probes[1].max() and d.mean() < 0.01 * probes[1].mean()


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_camera_raw(tmp_path, orientation):
    """LibRaw turns by quarters; the pixels as they lie on the sensor are the same whatever the tag says."""
    rng = np.random.default_rng(2)
    cfa = rng.integers(500, 3500, (32, 48))
    write_dng(tmp_path / "1.dng", cfa)
    write_dng(tmp_path / "o.dng", cfa, orientation=orientation)
    flat, turned = load(tmp_path / "1.dng", tmp_path), both(tmp_path / "o.dng", tmp_path)
    want = {1: flat, 3: flat[::-1, ::-1], 6: np.rot90(flat, -1), 8: np.rot90(flat)}[orientation]
    assert np.array_equal(turned, want)
    info = probe(tmp_path / "o.dng")
    assert info["orientation"] == orientation and info["size"] == (want.shape[1], want.shape[0])
    p = run(IMGTOOL, "dump", "--keep-orientation", tmp_path / "o.dng", tmp_path / "k")
    assert p.returncode == 0 and np.array_equal(np.fromfile(tmp_path / "k", np.float32, offset=12).reshape(flat.shape), flat)
