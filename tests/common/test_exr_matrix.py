"""OpenEXR in, against the Python package OpenEXR as writer and as independent reader, over a matrix of files:
compressions x types x sizes x windows x parts x layers x tiles; through the row stream and, at its end, ilfpack.

What a file means (windows, alpha, layers) is written down here a second time, in numpy.
"""
import itertools
import struct

import numpy as np
import OpenEXR
import pytest

from common_util import IMGTOOL, load, probe, refused, run, write_exr
from conftest import run as run_installed
from process import execute
from conftest import shared_case

COMPRESSIONS = "NO RLE ZIPS ZIP PIZ PXR24 B44 B44A DWAA DWAB".split()
SIZES = [(1, 1), (3, 2), (33, 31), (32, 32), (7, 33), (64, 33), (17, 65), (5, 257)]  # w x h; chunks have 1, 16, 32, 256 lines
KINDS = [np.float16, np.float32, np.uint32]


def light(w, h, n=3, seed=1):
    """Smooth with noise, so that some chunks get smaller and some don't."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:h, 0:w]
    base = 40 + 20 * np.sin(x / 5) + 10 * np.cos(y / 7)
    return (base[..., None] * (1 + np.arange(n)) * rng.uniform(0.5, 1.5, (h, w, n)) ** 2).astype(np.float32)


def planes_of(a, names, kind):
    return {n: np.ascontiguousarray(a[..., i].astype(kind)) for i, n in enumerate(names)}


def box(x0, y0, w, h):
    return (np.array([x0, y0], np.int32), np.array([x0 + w - 1, y0 + h - 1], np.int32))


def tiles(w, h):
    t = OpenEXR.TileDescription()
    t.xSize, t.ySize = w, h
    return {"type": OpenEXR.tiledimage, "tiles": t}


def peer(path, names, part=0):
    with OpenEXR.File(str(path), separate_channels=True) as f:
        return np.stack([f.channels(part)[n].pixels.astype(np.float64) for n in names], 2)


def shown(data, display, a):
    """a at its place in the display window; an alpha channel of zeros where the data window does not reach."""
    (dx, dy), (x, y), (x1, y1) = data[0], display[0], display[1]
    h, w = a.shape[:2]
    want = np.zeros((y1 - y + 1, x1 - x + 1, a.shape[2] + 1))
    a = np.concatenate([a, np.ones((h, w, 1))], 2)
    for row in range(h):  # pixel by pixel: slow and plain
        for col in range(w):
            to_y, to_x = dy + row - y, dx + col - x
            if 0 <= to_y < want.shape[0] and 0 <= to_x < want.shape[1]:
                want[to_y, to_x] = a[row, col]
    return want if (want[..., -1] == 0).any() else want[..., :-1]


# ---- compressions, types, sizes --------------------------------------------------------------------------------

@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("kind", KINDS)
def test_sizes(tmp_path, compression, kind):
    path = tmp_path / "a.exr"
    for (w, h), tiled in itertools.product(SIZES, (None, (16, 7))):
        head = {"compression": getattr(OpenEXR, compression + "_COMPRESSION"), **(tiles(*tiled) if tiled else {})}
        write_exr(path, planes_of(light(w, h), "RGB", kind), **head)
        got, want = load(path, tmp_path, "rows"), peer(path, "RGB").astype(np.float32)
        assert np.array_equal(got, want), (w, h, tiled)


@pytest.mark.parametrize("height", [32, 33, 34, 64, 65, 66, 97])
@pytest.mark.parametrize("width", [31, 64])
@pytest.mark.parametrize("compression", ["B44", "B44A"])
def test_b44_whose_last_chunk_did_not_shrink(tmp_path, width, height, compression):
    write_exr(tmp_path / "a.exr", planes_of(light(width, height), "RGB", np.float16),
              compression=getattr(OpenEXR, compression + "_COMPRESSION"))
    assert np.array_equal(load(tmp_path / "a.exr", tmp_path), peer(tmp_path / "a.exr", "RGB").astype(np.float32))


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_rgb_beside_y(tmp_path, compression):
    a = light(40, 33, 5)
    write_exr(tmp_path / "a.exr", planes_of(a, ["R", "G", "B", "Y", "Z"], np.float16),
              compression=getattr(OpenEXR, compression + "_COMPRESSION"))
    got = load(tmp_path / "a.exr", tmp_path)
    assert np.array_equal(got, peer(tmp_path / "a.exr", "RGB").astype(np.float32))
    assert np.abs(got / a[..., :3] - 1).mean() < 0.03


# ---- windows -------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("compression", ["NO", "ZIP", "PIZ", "DWAB"])
@pytest.mark.parametrize("tiled", [False, True])
def test_windows(tmp_path, compression, tiled):
    """Cropped, overscan, shifted, one row or column in common."""
    a = light(20, 35)
    for display in ((0, 0, 20, 35), (-3, -5, 30, 60), (4, 4, 8, 8), (-10, 10, 20, 10), (19, 34, 9, 9), (0, 34, 40, 3)):
        data, window = box(0, 0, 20, 35), box(*display)
        for shift in (0, -1000, 70001):
            moved = [(lo + shift, hi + shift) for lo, hi in (data, window)]
            head = {"dataWindow": moved[0], "displayWindow": moved[1], **(tiles(16, 8) if tiled else {})}
            write_exr(tmp_path / "a.exr", planes_of(a, "RGB", np.float32), compression=getattr(OpenEXR, compression + "_COMPRESSION"), **head)
            want = shown(moved[0], moved[1], peer(tmp_path / "a.exr", "RGB")).astype(np.float32)
            assert np.array_equal(load(tmp_path / "a.exr", tmp_path, "rows"), want), (display, shift)


def test_windows_without_a_pixel_in_common(tmp_path):
    for display in ((20, 0, 9, 9), (-9, 0, 9, 9), (0, 35, 9, 9), (0, -9, 9, 9)):
        write_exr(tmp_path / "a.exr", planes_of(light(20, 35), "RGB", np.float16), dataWindow=box(0, 0, 20, 35), displayWindow=box(*display))
        assert "expected a data window inside the display window" in refused(run(IMGTOOL, "probe", tmp_path / "a.exr"))


def test_a_nearly_empty_window_costs_no_memory(tmp_path):
    write_exr(tmp_path / "a.exr", planes_of(light(4, 4), "RGB", np.float16), dataWindow=box(0, 0, 4, 4), displayWindow=box(0, 0, 40000, 40000))
    assert "expected a data window of at least" in refused(run(IMGTOOL, "dump", tmp_path / "a.exr", tmp_path / "b"))


def test_there_and_back_by_cropping(tmp_path):
    """A picture, and the same cut into the data window of what is not black, give one light field."""
    a = light(32, 16)
    a[:5] = a[11:] = 0
    a[:, :7] = 0
    write_exr(tmp_path / "whole.exr", planes_of(a, "RGB", np.float32))
    write_exr(tmp_path / "cut.exr", planes_of(a[5:11, 7:], "RGB", np.float32), dataWindow=box(7, 5, 25, 6), displayWindow=box(0, 0, 32, 16))
    for name in ("whole", "cut"):
        run_installed("ilfpack", "--grid", "1x1", "--plane", "0 0 0 1 0 0 0 1 0", "--type", "float", "--ignore-alpha", "-o",
                      tmp_path / f"{name}.ilf.exr", tmp_path / f"{name}.exr")
    assert np.array_equal(peer(tmp_path / "whole.ilf.exr", "RGB"), peer(tmp_path / "cut.ilf.exr", "RGB"))


# ---- alpha ---------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_multiplied_alpha_is_divided_out(tmp_path, kind):
    a = light(24, 20)
    alpha = np.random.default_rng(5).choice([0, 0.25, 0.5, 1, 1.5], (20, 24, 1))
    write_exr(tmp_path / "a.exr", planes_of(np.concatenate([a * np.minimum(alpha, 1), alpha], 2), "RGBA", kind))
    got, stored = load(tmp_path / "a.exr", tmp_path), peer(tmp_path / "a.exr", "RGBA")
    inside = (stored[..., 3:] > 0) & (stored[..., 3:] < 1)
    want = np.where(inside, stored[..., :3] / np.where(inside, stored[..., 3:], 1), stored[..., :3])
    assert np.array_equal(got[..., :3], want.astype(np.float32)) and np.array_equal(got[..., 3:], alpha.astype(np.float32))


@pytest.mark.parametrize("compression", ["zip", "dwaa"])
def test_our_own_alpha_comes_back(tmp_path, compression):
    a = light(24, 20)
    alpha = np.linspace(0, 1, 24 * 20).reshape(20, 24, 1)
    write_exr(tmp_path / "a.exr", planes_of(np.concatenate([a * alpha, alpha], 2), "RGBA", np.float32))
    first = load(tmp_path / "a.exr", tmp_path)
    assert run(IMGTOOL, "convert", "--type", "half", "--compression", compression, tmp_path / "a.exr", tmp_path / "b.exr").returncode == 0
    assert np.allclose(load(tmp_path / "b.exr", tmp_path)[:, 1:], first[:, 1:], rtol=1e-3 if compression == "zip" else 0.2, atol=1e-3)


# ---- parts, layers, views -------------------------------------------------------------------------------------------

def parts(path, *which, **head):
    window = {"dataWindow": box(0, 0, 9, 6), "displayWindow": box(0, 0, 9, 6)}
    OpenEXR.File([OpenEXR.Part({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, **window, **more}, planes, name)
                  for name, planes, more in which]).write(str(path))


A = light(9, 6)
DEPTH = {"Z": np.full((6, 9), 7, np.float32)}


def colour(names=("R", "G", "B"), scale=1):
    return planes_of(A * scale, names, np.float32)


def dump(path, tmp_path, *how):
    """Pixels, and what was said."""
    p = run(IMGTOOL, "rows", *how, path, tmp_path / "x")
    assert p.returncode == 0, p.stderr
    w, h, c = np.fromfile(tmp_path / "x", np.int32, 3)
    return np.fromfile(tmp_path / "x", np.float32, offset=12).reshape(h, w, c), p.stderr.decode()


@pytest.mark.parametrize("at", [0, 1, 2])
def test_depth_and_masks_are_no_light(tmp_path, at):
    others = [("depth", DEPTH, {}), ("mask", {"A": np.ones((6, 9), np.float16)}, {})]
    parts(tmp_path / "a.exr", *others[:at], ("light", colour(), {}), *others[at:])
    got, said = dump(tmp_path / "a.exr", tmp_path)
    assert np.array_equal(got, A) and said == ""
    parts(tmp_path / "b.exr", *others)
    assert "found Z, A" in refused(run(IMGTOOL, "probe", tmp_path / "b.exr"))


@pytest.mark.parametrize("name", ["Z", "A", "V", "depth.Z", "mask", "U"])
def test_a_single_channel_that_is_no_light(tmp_path, name):
    write_exr(tmp_path / "a.exr", {name: np.ones((6, 9), np.float32)})
    assert f"found {name}" in refused(run(IMGTOOL, "probe", tmp_path / "a.exr"))
    assert (dump(tmp_path / "a.exr", tmp_path, "--layer", name)[0] == 1).all()  # unless the user says so


@pytest.mark.parametrize("names", [["R", "G", "B"], ["r", "g", "b"], ["red", "green", "blue"]])
@pytest.mark.parametrize("layer", ["ViewLayer.Combined", "beauty", "x"])
def test_one_layer_is_taken_and_said(tmp_path, layer, names):
    write_exr(tmp_path / "a.exr", colour([f"{layer}.{n}" for n in names]) | {f"{layer}.Z": DEPTH["Z"]})
    got, said = dump(tmp_path / "a.exr", tmp_path)
    assert np.array_equal(got, A) and layer in said and said.count("\n") == 1
    got, said = dump(tmp_path / "a.exr", tmp_path, "--layer", layer)
    assert np.array_equal(got, A) and said == ""


def test_several_layers(tmp_path):
    passes = colour(["L.DiffCol.R", "L.DiffCol.G", "L.DiffCol.B"], 3) | colour(["L.Emit.R", "L.Emit.G", "L.Emit.B"], 4)
    write_exr(tmp_path / "a.exr", passes)
    line = refused(run(IMGTOOL, "probe", tmp_path / "a.exr"))
    assert "L.DiffCol" in line and "L.Emit" in line
    assert np.array_equal(dump(tmp_path / "a.exr", tmp_path, "--layer", "L.Emit")[0], A * 4)
    assert "'nothing'" in refused(run(IMGTOOL, "probe", "--layer", "nothing", tmp_path / "a.exr"))
    write_exr(tmp_path / "b.exr", passes | colour(["L.Combined.R", "L.Combined.G", "L.Combined.B"]))  # Blender's picture
    got, said = dump(tmp_path / "b.exr", tmp_path)
    assert np.array_equal(got, A) and "L.Combined" in said
    write_exr(tmp_path / "c.exr", passes | colour())  # what has no name comes before all that have
    got, said = dump(tmp_path / "c.exr", tmp_path)
    assert np.array_equal(got, A) and said == ""


def test_mattes_are_no_light(tmp_path):
    matte = colour([f"ViewLayer.CryptoObject00.{n}" for n in "rgb"], 5)
    write_exr(tmp_path / "a.exr", matte | colour(["ViewLayer.Image.R", "ViewLayer.Image.G", "ViewLayer.Image.B"]))
    assert np.array_equal(dump(tmp_path / "a.exr", tmp_path)[0], A)
    write_exr(tmp_path / "b.exr", matte)
    refused(run(IMGTOOL, "probe", tmp_path / "b.exr"))


def test_views(tmp_path):
    views = {"multiView": ["left", "right"]}
    write_exr(tmp_path / "a.exr", colour() | colour(["right.R", "right.G", "right.B"], 2), **views)
    got, said = dump(tmp_path / "a.exr", tmp_path)
    assert np.array_equal(got, A) and "view left" in said
    assert np.array_equal(dump(tmp_path / "a.exr", tmp_path, "--layer", "right")[0], A * 2)
    parts(tmp_path / "b.exr", ("depth.left", DEPTH, {"view": "left"}), ("l", colour(), {"view": "left"}), ("r", colour(scale=2), {"view": "right"}))
    got, said = dump(tmp_path / "b.exr", tmp_path)
    assert np.array_equal(got, A) and "view left" in said
    assert np.array_equal(dump(tmp_path / "b.exr", tmp_path, "--layer", "right")[0], A * 2)


def test_several_parts_are_asked_about_unless_one_is_the_picture(tmp_path):
    parts(tmp_path / "a.exr", ("diffuse", colour(scale=2), {}), ("glossy", colour(scale=3), {}))
    assert "diffuse, glossy" in refused(run(IMGTOOL, "probe", tmp_path / "a.exr"))
    parts(tmp_path / "b.exr", ("mask", colour(scale=2), {}), ("beauty", colour(), {}))
    got, said = dump(tmp_path / "b.exr", tmp_path)
    assert np.array_equal(got, A) and "beauty" in said


# ---- colours ---------------------------------------------------------------------------------------------------------

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)


def rgb_to_xyz(c):
    """By Lindbloom's recipe (brucelindbloom.com: RGB/XYZ matrices)."""
    xy = np.array(c).reshape(4, 2)
    xyz = np.stack([xy[:, 0], xy[:, 1], 1 - xy.sum(1)])
    return xyz[:, :3] * np.linalg.solve(xyz[:, :3], xyz[:, 3] / xyz[1, 3])


@pytest.mark.parametrize("name, xy", [("XYZ", (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)),
                                      ("Rec. 2020", (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)),
                                      ("ACES AP0", (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)),
                                      ("P3-D65", (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290))])
def test_primaries_do_not_change_the_light(tmp_path, name, xy):
    m = np.linalg.solve(rgb_to_xyz(xy), rgb_to_xyz(REC709))  # Rec. 709 -> its own
    write_exr(tmp_path / "a.exr", planes_of(A @ m.T, "RGB", np.float32), chromaticities=xy)
    got, said = dump(tmp_path / "a.exr", tmp_path)
    assert np.allclose(got, A, rtol=2e-5) and "primaries" in said
    alpha = np.full((6, 9, 1), 0.5)
    write_exr(tmp_path / "b.exr", planes_of(np.concatenate([0.5 * A @ m.T, alpha], 2), "RGBA", np.float32), chromaticities=xy)
    assert np.allclose(dump(tmp_path / "b.exr", tmp_path)[0], np.concatenate([A, alpha], 2), rtol=2e-5)


def test_primaries_that_need_no_conversion(tmp_path):
    for xy in (REC709, (0.64, 0.33, 0.29, 0.60, 0.15, 0.06, 1 / 3, 1 / 3)):  # Radiance's own
        write_exr(tmp_path / "a.exr", colour(), chromaticities=xy)
        got, said = dump(tmp_path / "a.exr", tmp_path)
        assert np.array_equal(got, A) and said == ""
    write_exr(tmp_path / "b.exr", colour(), chromaticities=(0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3))
    assert "chromaticities" in refused(run(IMGTOOL, "probe", tmp_path / "b.exr"))


# ---- what is refused ----------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("name", ["HTJ2K256", "HTJ2K32", "ZSTD", "LJ2K"])
def test_newer_compressions_are_named(tmp_path, name):
    code = getattr(OpenEXR, name + "_COMPRESSION")
    write_exr(tmp_path / "a.exr", colour())
    data = (tmp_path / "a.exr").read_bytes()
    key = b"compression\0compression\0\1\0\0\0"
    at = data.index(key) + len(key)
    (tmp_path / "a.exr").write_bytes(data[:at] + bytes([int(code.value)]) + data[at + 1:])
    p = run(IMGTOOL, "dump", tmp_path / "a.exr", tmp_path / "b")
    if p.returncode != 0:  # a library that is new enough has its own words
        line = refused(p)
        assert name.lower() in line and "OpenEXR 3." in line or "broken" in line


@pytest.mark.parametrize("tiled", [False, True])
def test_incomplete_files(tmp_path, tiled):
    """Cut at any place, or never finished: refused, however far the pixels go."""
    a = light(40, 70)
    write_exr(tmp_path / "a.exr", planes_of(a, "RGB", np.float16), **(tiles(16, 16) if tiled else {}))
    data = (tmp_path / "a.exr").read_bytes()
    for keep in (20, 200, len(data) // 3, len(data) // 2, len(data) - 100, len(data) - 1):
        (tmp_path / "b.exr").write_bytes(data[:keep])
        refused(run(IMGTOOL, "dump", tmp_path / "b.exr", tmp_path / "c"))
    chunks = 5 * 3 if tiled else 5
    first = min(i for i in range(len(data) - 8) if int.from_bytes(data[i:i + 8], "little") == i + 8 * chunks)
    for k in (0, chunks - 1):  # a chunk that was never written has offset 0
        at = first + 8 * k
        (tmp_path / "b.exr").write_bytes(data[:at] + bytes(8) + data[at + 8:])
        assert "incomplete" in refused(run(IMGTOOL, "probe", tmp_path / "b.exr"))


def test_memory_is_not_taken_from_a_header_that_lies(tmp_path):
    write_exr(tmp_path / "a.exr", colour())
    data = (tmp_path / "a.exr").read_bytes()
    window = b"box2i\0\x10\0\0\0" + np.array([0, 0, 8, 5], "<i4").tobytes()
    assert data.count(window) == 2
    for w, h in ((100000, 100000), (131071, 16000), (2 ** 30, 2 ** 30)):
        (tmp_path / "b.exr").write_bytes(data.replace(window, window[:10] + np.array([0, 0, w - 1, h - 1], "<i4").tobytes()))
        limit = "" if "san" in IMGTOOL.parts else "ulimit -v 2000000;"  # a sanitizer takes address space of its own
        refused(execute(["bash", "-c", f"{limit} '{IMGTOOL}' dump '{tmp_path}/b.exr' '{tmp_path}/c'"], capture_output=True))


# ---- inputs that once went wrong ---------------------------------------------------------------------------------------

@pytest.mark.parametrize("case, wrong, right, loss", [
    ("exr_b44_33_rows", "b44", "same_zip", 0.02), ("exr_chromaticities", "xyz", "rec709", 2e-3), ("exr_dwaa_rgb_and_y", "rgby_dwaa", "same_zip", 0.05),
    ("exr_multipart_depth_first", "depth_first", "beauty", 0), ("exr_data_window", "autocrop", "whole", None)])
def test_cases(tmp_path, case, wrong, right, loss):
    folder = shared_case(case)
    found = []
    for name in (wrong, right):
        run_installed("ilfpack", "--grid", "1x1", "--polar-max", "180", "--plane", "0 0 0 1 0 0 0 1 0", "--type", "float", "-o",
                      tmp_path / "x.ilf.exr", folder / f"{name}.exr")
        found.append(peer(tmp_path / "x.ilf.exr", "RGB"))
    a, b = found
    assert a.shape == b.shape
    if loss is None:  # cropped: what is there lies at its place
        with OpenEXR.File(str(folder / f"{wrong}.exr")) as f:
            (x0, y0), (x1, y1) = f.header()["dataWindow"]
        assert np.array_equal(a[y0:y1 + 1, x0:x1 + 1], b[y0:y1 + 1, x0:x1 + 1]) and (x1 - x0, y1 - y0) == (84, 34)
    else:
        assert np.abs(a - b).max() <= loss * b.max()


def test_case_of_a_named_layer(tmp_path):
    path = shared_case("exr_layer_names") / "blender_multilayer.exr"
    assert "ViewLayer.Combined" in run(IMGTOOL, "probe", path).stderr.decode()
    assert probe(path)["size"] == (128, 64)


def test_deep_data_is_refused(tmp_path):
    samples = np.empty((6, 9), dtype=object)
    for i in np.ndindex(6, 9):
        samples[i] = np.ones(1 + i[1] % 3, np.float32)
    head = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.deepscanline}
    OpenEXR.File(head, {n: samples for n in "RGBZ"}).write(str(tmp_path / "a.exr"))
    assert "deep data" in refused(run(IMGTOOL, "probe", tmp_path / "a.exr"))


@pytest.mark.parametrize("mode", ["MIPMAP_LEVELS", "RIPMAP_LEVELS"])
def test_the_first_of_several_levels(tmp_path, mode):
    """Level 0 is the picture; a file written here by hand, uncompressed, with its smaller levels all of 99."""
    w, h, t = 20, 12, 8
    a = light(w, h).astype("<f4")

    def attr(name, kind, value):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
    chlist = b"".join(n.encode() + b"\0" + struct.pack("<iIii", 2, 0, 1, 1) for n in "BGR") + b"\0"
    window = struct.pack("<4i", 0, 0, w - 1, h - 1)
    code = {"MIPMAP_LEVELS": 1, "RIPMAP_LEVELS": 2}[mode]
    head = struct.pack("<II", 20000630, 2 | 0x200) + attr("channels", "chlist", chlist) + attr("compression", "compression", b"\0") \
        + attr("dataWindow", "box2i", window) + attr("displayWindow", "box2i", window) + attr("lineOrder", "lineOrder", b"\0") \
        + attr("pixelAspectRatio", "float", struct.pack("<f", 1)) + attr("screenWindowCenter", "v2f", bytes(8)) \
        + attr("screenWindowWidth", "float", struct.pack("<f", 1)) + attr("tiles", "tiledesc", struct.pack("<IIB", t, t, code)) + b"\0"
    levels = [(k, k) for k in range(5)] if code == 1 else [(x, y) for y in range(4) for x in range(5)]
    chunks = []
    for lx, ly in levels:
        lw, lh = max(1, w >> lx), max(1, h >> ly)
        image = a if lx == ly == 0 else np.full((lh, lw, 3), 99, "<f4")
        for ty, tx in itertools.product(range(-(-lh // t)), range(-(-lw // t))):
            part = image[ty * t:(ty + 1) * t, tx * t:(tx + 1) * t]
            pixels = part[:, :, ::-1].transpose(0, 2, 1).tobytes()  # line by line, channels B, G, R
            chunks.append(struct.pack("<iiiii", tx, ty, lx, ly, len(pixels)) + pixels)
    at, table = len(head) + 8 * len(chunks), b""
    for c in chunks:
        table += struct.pack("<Q", at)
        at += len(c)
    (tmp_path / "a.exr").write_bytes(head + table + b"".join(chunks))
    assert np.array_equal(load(tmp_path / "a.exr", tmp_path, "rows"), a)
