"""common/image against broken files: every cut and every damage ends in one line and exit 1 (or a whole picture),
never in a crash, a hang or half an output."""
import random
import struct

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from common_util import (BUILD, IMGTOOL, line_old, load, refused, rgbe_of, run, write_dng, write_hdr, write_pfm, write_png,
                         write_pnm, write_tiff)

SANITIZED = "san" in BUILD.parts
W, H = 19, 11


def write_exr(path, a, kind, tile=None, **head):
    head = {"compression": getattr(OpenEXR, kind), "type": OpenEXR.scanlineimage, **head}
    if tile:
        head |= {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()}
        head["tiles"].xSize = head["tiles"].ySize = tile
    OpenEXR.File(head, {n: np.ascontiguousarray(a[:, :, i]) for i, n in enumerate("RGB")}).write(str(path))


def samples(folder):
    """One small file of every kind: name -> (path, does every cut have to be noticed?)."""
    rng = np.random.default_rng(7)
    a8, a16 = rng.integers(0, 256, (H, W, 3)).astype(np.uint8), rng.integers(0, 65536, (H, W, 3)).astype(np.uint16)
    f = rng.random((H, W, 3)).astype(np.float32)
    p = lambda name: folder / name
    write_exr(p("zip.exr"), f, "ZIP_COMPRESSION")
    write_exr(p("piz.exr"), f.astype(np.float16), "PIZ_COMPRESSION")
    write_exr(p("none.exr"), f, "NO_COMPRESSION")
    write_exr(p("tiled.exr"), f, "RLE_COMPRESSION", tile=8)
    write_exr(p("pxr.exr"), f, "PXR24_COMPRESSION")
    write_exr(p("b44.exr"), f.astype(np.float16), "B44_COMPRESSION", tile=8)
    write_exr(p("dwa.exr"), f.astype(np.float16), "DWAA_COMPRESSION")
    write_hdr(p("new.hdr"), rgbe_of(f))
    write_hdr(p("old.hdr"), rgbe_of(np.repeat(f, 3, axis=1)), "+X -Y", line_old)
    write_hdr(p("flat.hdr"), rgbe_of(f), line=np.ndarray.tobytes)
    write_png(p("rgb.png"), a8, 8, 2)
    write_png(p("adam7.png"), a16, 16, 2, interlace=True)
    write_png(p("palette.png"), a8[:, :, :1] % 16, 4, 3, palette=a8[:4, :4].reshape(16, 3))
    Image.fromarray(a8).save(p("base.jpg"), quality=80)
    Image.fromarray(a8).save(p("prog.jpg"), quality=80, progressive=True)
    write_tiff(p("strips.tif"), a8, rows=2)
    write_tiff(p("tiles.tif"), f, ">", tile=(16, 16), deflate=True, separate=True)
    write_tiff(p("turned.tif"), a16, orientation=6, deflate=True)
    Image.fromarray(a8).save(p("lzw.tif"), compression="tiff_lzw")
    Image.fromarray(a8).save(p("jpeg.tif"), compression="jpeg")
    write_pnm(p("text.ppm"), a16, 65535, text=True)
    write_pnm(p("bin.ppm"), a16, 65535)
    write_pfm(p("float.pfm"), f)
    write_dng(p("raw.dng"), rng.integers(0, 4096, (32, 48)))
    return sorted(x.name for x in folder.iterdir())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    d = tmp_path_factory.mktemp("samples")
    names = samples(d)
    return d, names


NAMES = ("zip.exr piz.exr none.exr tiled.exr pxr.exr b44.exr dwa.exr new.hdr old.hdr flat.hdr rgb.png adam7.png palette.png "
         "base.jpg prog.jpg strips.tif tiles.tif turned.tif lzw.tif jpeg.tif text.ppm bin.ppm float.pfm raw.dng").split()


def test_the_list_is_complete(folder):
    assert folder[1] == sorted(NAMES)


# a program between costs less than Python's own code between fork and exec, for which all of pytest is copied
LIMITED = ["prlimit", "--core=0", *([] if SANITIZED else [f"--as={1 << 31}"])]


def read(path, how="dump"):
    """Exit 0 and an output, or one line, exit 1 and none."""
    out = path.parent / "out.f32"
    out.unlink(missing_ok=True)
    p = run(*LIMITED, IMGTOOL, "--quiet", how, path, out)
    if p.returncode == 0:
        assert p.stderr == b"" and out.stat().st_size >= 16
    else:
        line = refused(p)
        assert str(path) in line and not out.exists()
    return p.returncode


@pytest.mark.parametrize("name", NAMES)
def test_whole_files_are_read(folder, tmp_path, name):
    load(folder[0] / name, tmp_path)


@pytest.mark.parametrize("name", NAMES)
def test_cut_files(folder, tmp_path, name):
    """Cut anywhere before the last pixel's bytes a file is refused."""
    data = (folder[0] / name).read_bytes()
    rng = random.Random(1)
    cuts = {0, 1, 2, 3, 4, 7, 8, 11, 12, 15, 16, 31, 100, len(data) // 2, len(data) - 200} | {rng.randrange(len(data)) for _ in range(12)}
    # what comes after the last pixel: end marks and checksums of PNG and JPEG, a TIFF's tags are at the end
    spare = {"png": 24, "jpg": 12}.get(name.split(".")[1], 0)
    path = tmp_path / name
    for n in sorted(c for c in cuts if 0 <= c < len(data)):
        path.write_bytes(data[:n])
        code = read(path)
        assert code == 1 or n > len(data) - spare, (name, n, len(data))
    for n in range(1, 5):
        path.write_bytes(data[:-n])
        read(path)


@pytest.mark.parametrize("name", NAMES)
def test_damaged_files(folder, tmp_path, name):
    """Bytes overwritten at random, half of them in the header."""
    data = (folder[0] / name).read_bytes()
    rng = random.Random(name)
    path = tmp_path / name
    for i in range(30):
        b = bytearray(data)
        for _ in range(rng.choice([1, 1, 2, 8])):
            at = rng.randrange(min(len(b), 400)) if rng.random() < 0.5 else rng.randrange(len(b))
            b[at] = rng.choice([0, 1, 255, 127, 128, rng.randrange(256)])
        path.write_bytes(b)
        read(path, "dump" if i % 2 else "rows")


def exr_window(data, w, h):
    """The data window and display window of an EXR header set to w x h."""
    for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        at = data.index(name) + len(name) + 4
        data = data[:at] + struct.pack("<iiii", 0, 0, w - 1, h - 1) + data[at + 16:]
    return data


HUGE = {
    "p6": lambda d: b"P6\n100000 100000\n255\n" + b"x" * 100,
    "p3": lambda d: b"P3\n9999999999 1\n255\n" + b"1 " * 100,
    "pfm": lambda d: b"PF\n131072 131072\n-1.0\n" + b"x" * 100,
    "pfm within": lambda d: b"PF\n65536 32768\n-1.0\n" + b"x" * 100,
    "hdr": lambda d: b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 999999999999 +X 3\n" + b"x" * 100,
    "hdr within": lambda d: b"#?RADIANCE\n\n-Y 65536 +X 32767\n" + b"\x02\x02\x7f\xff" + b"x" * 100,
    "hdr within, turned": lambda d: b"#?RADIANCE\n\n+Y 65536 +X 32767\n" + b"\x02\x02\x7f\xff" + b"x" * 100,
    "exr": lambda d: exr_window((d / "zip.exr").read_bytes(), 1 << 30, 1 << 30),
    "exr within": lambda d: exr_window((d / "zip.exr").read_bytes(), 1 << 16, 1 << 15),
    "exr tiles within": lambda d: exr_window((d / "tiled.exr").read_bytes(), 1 << 16, 1 << 15),
    "exr negative": lambda d: exr_window((d / "zip.exr").read_bytes(), -5, 10),
    "png": lambda d: png_size((d / "rgb.png").read_bytes(), 0x7fffffff, 0x7fffffff),
    "png within": lambda d: png_size((d / "rgb.png").read_bytes(), 65536, 32768),
    "png adam7 within": lambda d: png_size((d / "adam7.png").read_bytes(), 65536, 32768),
    "jpg within": lambda d: jpg_size((d / "base.jpg").read_bytes(), b"\xff\xc0", 32768, 32768),
    "jpg progressive within": lambda d: jpg_size((d / "prog.jpg").read_bytes(), b"\xff\xc2", 65000, 32768),
}


def png_size(data, w, h):
    import zlib
    head = data[12:16] + struct.pack(">II", w, h) + data[24:29]
    return data[:12] + head + struct.pack(">I", zlib.crc32(head)) + data[33:]


def jpg_size(data, marker, w, h):
    at = data.index(marker) + 5
    return data[:at] + struct.pack(">HH", h, w) + data[at + 4:]


@pytest.mark.parametrize("name", sorted(HUGE))
@pytest.mark.parametrize("how", ["dump", "rows"])
def test_headers_that_promise_too_much(folder, tmp_path, name, how):
    """Refused without the memory: within 2 GiB of address space, where the promise is up to 24 GB and more."""
    path = tmp_path / "a"
    path.write_bytes(HUGE[name](folder[0]))
    assert read(path, how) == 1


@pytest.mark.parametrize("tags", [{256: (4, [100000]), 257: (4, [100000])}, {256: (4, [0])}, {277: (3, [60000])},
                                  {278: (4, [0])}, {278: (4, [0xffffffff])}, {258: (3, [8])}, {284: (3, [7])},
                                  {339: (3, [3, 3, 3])}, {259: (3, [34712])}, {262: (3, [3])}, {262: (3, [6])}],
                         ids=str)
def test_tiff_tags_that_contradict_each_other(tmp_path, tags):
    a = np.zeros((H, W, 3), np.uint8)
    write_tiff(tmp_path / "a.tif", a, more=tags.items())
    read(tmp_path / "a.tif")


@pytest.mark.parametrize("tile", [(16, 16), (4096, 16), (1 << 20, 1 << 20)])
def test_tiff_tiles_larger_than_the_file(tmp_path, tile):
    a = np.zeros((20, 20, 3), np.uint8)
    write_tiff(tmp_path / "a.tif", a, tile=(16, 16), more={322: (4, [tile[0]]), 323: (4, [tile[1]])}.items())
    assert read(tmp_path / "a.tif") == (tile != (16, 16))


@pytest.mark.parametrize("text", [
    b"#?RADIANCE\nEXPOSURE=0\n\n-Y 1 +X 1\n\1\1\1\1", b"#?RADIANCE\nEXPOSURE=-1\n\n-Y 1 +X 1\n\1\1\1\1",
    b"#?RADIANCE\nEXPOSURE=nan\n\n-Y 1 +X 1\n\1\1\1\1", b"#?RADIANCE\nCOLORCORR=1 2\n\n-Y 1 +X 1\n\1\1\1\1",
    b"#?RADIANCE\n" + b"EXPOSURE=1e300\n" * 3 + b"\n-Y 1 +X 1\n\1\1\1\1", b"#?RADIANCE\nFORMAT=ascii\n\n-Y 1 +X 1\n\1\1\1\1",
    b"#?RADIANCE\n\n-Y 1 +Y 1\n\1\1\1\1", b"#?RADIANCE\n\n-Y 1\n\1\1\1\1", b"#?RADIANCE\n\n-Y 0 +X 1\n\1\1\1\1",
    b"#?RADIANCE\n\n-Y 1 +X 1 1\n\1\1\1\1", b"#?RADIANCE\n\n", b"#?RADIANCE\n" + b"x" * 3000000,
    b"#?RADIANCE\n\n-Y 1 +X 1\n\1\1\1\5", b"#?RADIANCE\n\n-Y 1 +X 4\n\2\1\1\1\1\1\1\377",
    b"#?RADIANCE\n\n-Y 1 +X 8\n\2\2\0\7" + b"\x87\1" * 4, b"#?RADIANCE\n\n-Y 1 +X 8\n\2\2\0\x08" + b"\x89\1" * 4,
    b"#?RADIANCE\n\n-Y 1 +X 8\n\2\2\0\x08" + b"\0" * 40,
    b"P5\n1 1\n0\nx", b"P5\n1 1\n65536\nxx", b"P5\n-1 1\n255\nx", b"P5\n1 1\n255", b"P5\n1 1\n100\nx", b"P2\n1 1\n9\n10\n",
    b"P2\n2 1\n9\n1 -1\n", b"P2\n2 1\n9\n1\n", b"Pf\n1 1\n0\nxxxx", b"Pf\n1 1\nnan\nxxxx", b"PF\n1 1\n-1.0\nxxxx",
    b"P4\n8 1\nx", b"BM" + b"\0" * 100, b"GIF89a" + b"\0" * 100, b"\0", b"hello\n", b"\x76\x2f\x31\x01", b"II*\0",
    b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"IIRO" + b"\0" * 500, b"FUJIFILM" + b"\xff" * 500, b"II*\0\x08\0\0\0" + b"\xff" * 200],
    ids=lambda t: repr(t[:40]))
def test_small_nonsense(tmp_path, text):
    (tmp_path / "a").write_bytes(text)
    assert read(tmp_path / "a") == 1


def test_folders_and_missing_files(tmp_path):
    for name in (tmp_path, tmp_path / "none", ""):
        refused(run(IMGTOOL, "probe", name))


def test_shrinking_promises_of_exr_tiles(tmp_path):
    """A tile of 2^31 and more bytes is refused by its size, not by running out of memory."""
    f = np.zeros((16, 16, 3), np.float32)
    write_exr(tmp_path / "a.exr", f, "NO_COMPRESSION", tile=16)
    data = (tmp_path / "a.exr").read_bytes()
    at = data.index(b"tiles\0tiledesc\0") + len(b"tiles\0tiledesc\0") + 4
    (tmp_path / "a.exr").write_bytes(exr_window(data[:at] + struct.pack("<II", 65536, 32768) + data[at + 8:], 65536, 32768))
    assert read(tmp_path / "a.exr") == 1
