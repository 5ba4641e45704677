"""The file format (docs/FORMAT.md, sections 1 and 4): each rule broken one at a time, and hostile bytes."""
import os
import re
import struct
import subprocess

import numpy as np
import pytest

from conftest import BIN, environment, needed, one_line_error, run, run_measured
from ilf_util import (ILF, PI, edited, header_attributes, random_ilf, rebuilt, tile_offsets, write_ilf)
from process import execute, Process

RAY = "0.3 0.3 0 0.1 0.2 1 0.5 0.7 2\n"


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A sound file, 3 x 2 probes of 8 x 4 texels, and its bytes."""
    f = random_ilf(np.random.default_rng(20), 3, 2, 8, 4, plane=((0, 0, 0), (1, 0, 0), (0, 1, 0)), polar_valid=1.5)
    path = write_ilf(tmp_path_factory.mktemp("good") / "good.ilf.exr", f)
    return f, path.read_bytes()


def refused(tmp_path, data, *words, name="bad.ilf.exr"):
    """Both readers refuse the file in one line that names it and the words, and print nothing."""
    path = tmp_path / name
    if data is not None:
        path.write_bytes(data)
    for program in ("ilfinfo", "ilftrace"):
        r = run(program, path, stdin=RAY, code=1)
        one_line_error(r, program, name, *words)
        assert r.out == b"", r


# ---- every rule of the header broken, one at a time --------------------------------------------------

def v3(*x):
    return struct.pack("<3f", *x)


def flt(x):
    return struct.pack("<f", x)


NAN, INF = float("nan"), float("inf")
REQUIRED = ["ilf:version", "ilf:origin", "ilf:U", "ilf:V", "ilf:polarMax"]
WRONG_TYPE = {
    "ilf:version": ("float", flt(1)), "ilf:origin": ("v3d", struct.pack("<3d", 0, 0, 0)), "ilf:U": ("v3i", struct.pack("<3i", 1, 0, 0)),
    "ilf:V": ("v2f", struct.pack("<2f", 0, 1)), "ilf:polarMax": ("double", struct.pack("<d", 1.5)),
    "ilf:polarValid": ("int", struct.pack("<i", 1)),
}
WRONG_VALUE = {
    "version 0": ("ilf:version", struct.pack("<i", 0)),
    "version 3": ("ilf:version", struct.pack("<i", 3)),
    "origin NaN": ("ilf:origin", v3(0, NAN, 0)),
    "origin inf": ("ilf:origin", v3(0, 0, INF)),
    "U NaN": ("ilf:U", v3(NAN, 0, 0)),
    "V inf": ("ilf:V", v3(0, INF, 0)),
    "U zero": ("ilf:U", v3(0, 0, 0)),
    "V zero": ("ilf:V", v3(0, 0, 0)),
    "polarMax 0": ("ilf:polarMax", flt(0)),
    "polarMax negative": ("ilf:polarMax", flt(-1)),
    "polarMax NaN": ("ilf:polarMax", flt(NAN)),
    "polarMax inf": ("ilf:polarMax", flt(INF)),
    "polarMax over pi": ("ilf:polarMax", flt(3.1417)),
    "polarMax in degrees": ("ilf:polarMax", flt(90)),
    "polarValid 0": ("ilf:polarValid", flt(0)),
    "polarValid negative": ("ilf:polarValid", flt(-0.1)),
    "polarValid NaN": ("ilf:polarValid", flt(NAN)),
}


@pytest.mark.parametrize("name", REQUIRED)
def test_missing_attribute(tmp_path, good, name):
    refused(tmp_path, edited(good[1], name, remove=True), name)


@pytest.mark.parametrize("name", WRONG_TYPE)
def test_attribute_of_the_wrong_type(tmp_path, good, name):
    kind, value = WRONG_TYPE[name]
    refused(tmp_path, edited(good[1], name, kind, value), name)


@pytest.mark.parametrize("what", WRONG_VALUE)
def test_attribute_of_the_wrong_value(tmp_path, good, what):
    name, value = WRONG_VALUE[what]
    refused(tmp_path, edited(good[1], name, value=value), name)


@pytest.mark.parametrize("u, v, ok", [
    ((1, 0, 0), (2e-4, 1, 0), False), ((1, 0, 0), (0.5e-4, 1, 0), True), ((1, 0, 0), (-2e-4, 1, 0), False),
    ((1e6, 0, 0), (2e-10, 1e-6, 0), False), ((1e6, 0, 0), (0.5e-10, 1e-6, 0), True),
    ((1, 0, 0), (1, 0, 0), False), ((1e-18, 0, 0), (0, 1e-18, 0), True), ((1e18, 0, 0), (0, 1e18, 0), True)])
def test_edges_are_perpendicular(tmp_path, good, u, v, ok):
    data = edited(edited(good[1], "ilf:U", value=v3(*u)), "ilf:V", value=v3(*v))
    if not ok:
        refused(tmp_path, data, ("ilf:U", "ilf:V"), "perpendicular")
    else:
        (tmp_path / "ok.ilf.exr").write_bytes(data)
        run("ilfinfo", tmp_path / "ok.ilf.exr")


def test_polar_max_of_float_pi_is_the_full_sphere(tmp_path, good):
    (tmp_path / "ok.ilf.exr").write_bytes(edited(good[1], "ilf:polarMax", value=flt(PI)))
    run("ilfinfo", tmp_path / "ok.ilf.exr")


def test_polar_valid_beyond_polar_max_is_harmless(tmp_path, good):
    """docs/FORMAT.md, section 1.3: it means polarMax."""
    (tmp_path / "ok.ilf.exr").write_bytes(edited(good[1], "ilf:polarValid", value=flt(3)))
    run("ilfinfo", tmp_path / "ok.ilf.exr")


@pytest.mark.parametrize("tile", [(7, 4), (8, 3), (5, 4), (24, 3), (16, 4)], ids=str)
def test_tile_does_not_divide_the_window(tmp_path, good, tile):
    f, _ = good
    refused(tmp_path, write_ilf(tmp_path / "t.exr", f, tile=tile).read_bytes(), "tile")


def test_mipmap(tmp_path, good):
    # level mode 1: the same tiles, but the offset table of a real mipmap is longer
    data = edited(good[1], "tiles", value=struct.pack("<IIB", 8, 4, 1))
    refused(tmp_path, data, ("tile", "level"))


def test_real_mipmap(tmp_path, good):
    needed("exrmaketiled")
    (tmp_path / "a.exr").write_bytes(good[1])
    execute(["exrmaketiled", "-m", "-t", "8", "4", str(tmp_path / "a.exr"), str(tmp_path / "bad.ilf.exr")], check=True)
    refused(tmp_path, None, ("tile", "level"))


def test_scan_lines(tmp_path, good):
    import OpenEXR
    f, _ = good
    image = f.mosaic().astype(np.float32)
    header = {"type": OpenEXR.scanlineimage, "ilf:version": 1, "ilf:polarMax": 1.5, "ilf:origin": (0.0, 0.0, 0.0),
              "ilf:U": (1.0, 0.0, 0.0), "ilf:V": (0.0, 1.0, 0.0)}
    OpenEXR.File(header, {c: np.ascontiguousarray(image[..., k]) for k, c in enumerate("RGB")}).write(str(tmp_path / "bad.ilf.exr"))
    refused(tmp_path, None, "tile")


def chlist(*channels):
    return b"".join(n.encode() + b"\0" + struct.pack("<iB3xii", t, 0, s, s) for n, t, s in channels) + b"\0"


@pytest.mark.parametrize("channels", [
    [("B", 2, 1), ("G", 2, 1), ("Z", 2, 1)], [("B", 0, 1), ("G", 0, 1), ("R", 0, 1)], [("Y", 2, 1), ("RY", 2, 1), ("BY", 2, 1)],
    [("left.B", 2, 1), ("left.G", 2, 1), ("left.R", 2, 1)]], ids=["Z", "UINT", "YC", "layer"])
def test_wrong_channels(tmp_path, good, channels):
    refused(tmp_path, edited(good[1], "channels", value=chlist(*channels)), "channel")


@pytest.mark.parametrize("keep", ["R", "RG", "GB", "Y"])
def test_too_few_channels(tmp_path, good, keep):
    import OpenEXR
    f, _ = good
    tiles = OpenEXR.TileDescription()
    tiles.xSize, tiles.ySize = 8, 4
    header = {"type": OpenEXR.tiledimage, "tiles": tiles, "ilf:version": 1, "ilf:polarMax": 1.5,
              "ilf:origin": (0.0, 0.0, 0.0), "ilf:U": (1.0, 0.0, 0.0), "ilf:V": (0.0, 1.0, 0.0)}
    image = f.mosaic().astype(np.float32)[..., 0].copy()
    OpenEXR.File(header, {c: image for c in keep}).write(str(tmp_path / "bad.ilf.exr"))
    refused(tmp_path, None, "channel")


@pytest.mark.parametrize("window", [(1, 0, 24, 7), (0, 2, 23, 9), (-8, -4, 15, 3)], ids=str)
def test_data_window_not_at_the_origin(tmp_path, good, window):
    refused(tmp_path, edited(good[1], "dataWindow", value=struct.pack("<4i", *window)), ("data window", "dataWindow"))


@pytest.mark.parametrize("window, tile", [
    ((0, 0, 2**31 - 2, 2**31 - 2), (2**31 - 1, 2**31 - 1)), ((0, 0, 2**31 - 1, 3), (8, 4)), ((0, 0, 2**31 - 9, 3), (8, 4)),
    ((0, 0, 2**30 - 1, 2**30 - 1), (1, 1)), ((0, 0, 2**30 - 1, 2**20 - 1), (2**30, 2**20)), ((0, 0, 23, 7), (2**31, 4)),
    ((0, 0, 23, 7), (0, 0)), ((0, 0, 23, 7), (8, 2**32 - 4)), ((0, 0, -1, -1), (8, 4)), ((0, 0, 65535, 65535), (65536, 65536))], ids=str)
def test_sizes_that_cannot_be(tmp_path, good, window, tile):
    """2^31 and the like: refused before any memory is taken."""
    data = edited(good[1], "dataWindow", value=struct.pack("<4i", *window))
    data = edited(data, "tiles", value=struct.pack("<IIB", *tile, 0))
    (tmp_path / "bad.ilf.exr").write_bytes(data)
    for program in ("ilfinfo", "ilftrace"):
        r, peak = run_measured(program, tmp_path / "bad.ilf.exr", stdin=RAY, code=1)
        one_line_error(r, program, "bad.ilf.exr")
        assert peak < 200e6, f"{program} took {peak / 1e6:.0f} MB"


# ---- hostile bytes -----------------------------------------------------------------------------------

def test_not_an_image_at_all(tmp_path, good):
    for data in (b"", b"\0" * 1000, b"v/1\x01", b"v/1\x01\x02\x02\0\0", b"hello, world\n" * 99, b"#?RADIANCE\n\n-Y 1 +X 1\n"):
        refused(tmp_path, data)


def test_missing_file_and_folder(tmp_path):
    refused(tmp_path, None, "no such file")
    (tmp_path / "folder.ilf.exr").mkdir()
    refused(tmp_path, None, name="folder.ilf.exr")


@pytest.mark.parametrize("compression", ["none", "zip", "piz"])
def test_truncated_anywhere(tmp_path, good, compression):
    """Cut anywhere in the header or the tile table: refused by all; cut in the data: by whoever reads that probe."""
    f, _ = good
    data = write_ilf(tmp_path / "whole.exr", f, compression=compression).read_bytes()
    table, offsets = tile_offsets(data)
    rng = np.random.default_rng(21)
    head = sorted({int(n) for n in rng.integers(0, min(offsets), 25)} | {7, 8, 9, table - 1, table, table + 7, min(offsets) - 1})
    for n in head:
        refused(tmp_path, data[:n])
    body = sorted({int(n) for n in rng.integers(min(offsets), len(data), 12)} | {min(offsets), len(data) - 1})
    every_probe = "".join(f"{x} {y} 0 0.1 0.2 1 {x} {y} 0\n" for x in (0.1, 0.9) for y in (0.1, 0.9))
    for n in body:
        path = tmp_path / "cut.ilf.exr"
        path.write_bytes(data[:n])
        r = run("ilftrace", path, stdin=every_probe, code=1)
        one_line_error(r, "ilftrace", "cut.ilf.exr")
        r = run("ilfinfo", path, code=1)
        one_line_error(r, "ilfinfo", "cut.ilf.exr")


@pytest.mark.parametrize("compression", ["none", "zip", "piz", "pxr24", "rle", "b44", "dwaa"])
def test_flipped_bytes_never_crash(tmp_path, good, compression):
    """Random damage: a refusal in one line or numbers, never a signal, a hang or NaN."""
    f, _ = good
    data = write_ilf(tmp_path / "whole.exr", f, half=True, compression=compression).read_bytes()
    rng = np.random.default_rng(sum(compression.encode()))
    path = tmp_path / "bad.ilf.exr"
    for _ in range(60):
        b = bytearray(data)
        for at in rng.integers(0, len(b), rng.integers(1, 4)):
            b[at] = rng.integers(256)
        path.write_bytes(b)
        r = run("ilftrace", path, stdin=RAY, code=None)
        assert r.code in (0, 1), r
        assert "nan" not in r.text.lower() and "inf" not in r.text.lower(), r
        if r.code:
            one_line_error(r, "ilftrace", "bad.ilf.exr")


@pytest.mark.parametrize("offset", [0, 1, 2**63, 2**64 - 1, 10**9])
def test_tile_table_that_points_nowhere(tmp_path, good, offset):
    _, data = good
    table, offsets = tile_offsets(data)
    b = bytearray(data)
    struct.pack_into(f"<{len(offsets)}Q", b, table, *[offset] * len(offsets))
    path = tmp_path / "bad.ilf.exr"
    path.write_bytes(b)
    # a reader may rebuild a table of zeros from the tiles; if it does, the numbers must be right
    r = run("ilftrace", path, stdin=RAY, code=None)
    if r.code == 0:
        (tmp_path / "good.ilf.exr").write_bytes(data)
        assert r.out == run("ilftrace", tmp_path / "good.ilf.exr", stdin=RAY).out
    else:
        assert r.code == 1
        one_line_error(r, "ilftrace", "bad.ilf.exr")

def right_or_refused(tmp_path, data, damaged):
    """Damage in one tile's bookkeeping: the numbers of the sound file, or one line and exit 1."""
    good_path, path = tmp_path / "good.ilf.exr", tmp_path / "bad.ilf.exr"
    good_path.write_bytes(data)
    path.write_bytes(damaged)
    r = run("ilftrace", path, stdin=RAY, code=None)
    if r.code == 0:
        assert r.out == run("ilftrace", good_path, stdin=RAY).out, "quietly wrong"
    else:
        assert r.code == 1
        one_line_error(r, "ilftrace", "bad.ilf.exr")


@pytest.mark.parametrize("compression", ["none", "zip"])
def test_tiles_that_are_not_what_the_table_says(tmp_path, good, compression):
    """Entries exchanged, coordinates or level changed, sizes that lie: a tile is checked against its own header."""
    f, _ = good
    data = write_ilf(tmp_path / "whole.exr", f, compression=compression).read_bytes()
    table, offsets = tile_offsets(data)
    for a, b in ((0, 1), (0, 5), (1, 4)):
        order = offsets.copy()
        order[a], order[b] = order[b], order[a]
        damaged = bytearray(data)
        struct.pack_into(f"<{len(order)}Q", damaged, table, *order)
        right_or_refused(tmp_path, data, bytes(damaged))
    for field in range(4):                               # x, y, level x, level y
        for value in (-1, 1, 2, 7, 2**31 - 1):
            damaged = bytearray(data)
            struct.pack_into("<i", damaged, offsets[0] + 4 * field, value)
            right_or_refused(tmp_path, data, bytes(damaged))
    size, = struct.unpack_from("<i", data, offsets[0] + 16)
    for value in (0, 1, size // 2, size - 1, size + 1, 2 * size, 2**31 - 1, -1):
        damaged = bytearray(data)
        struct.pack_into("<i", damaged, offsets[0] + 16, value)
        right_or_refused(tmp_path, data, bytes(damaged))


def test_light_field_in_the_second_part_is_not_found(tmp_path, good):
    """The first part is the light field."""
    import OpenEXR
    f, data = good
    window = np.zeros(2, np.int32), np.array([23, 7], np.int32)
    first = OpenEXR.Part({"type": OpenEXR.scanlineimage, "displayWindow": window}, {"Y": np.ones((8, 24), np.float32)}, "first")
    tiles = OpenEXR.TileDescription()
    tiles.xSize, tiles.ySize = 8, 4
    image = f.mosaic().astype(np.float32)
    header = {"type": OpenEXR.tiledimage, "tiles": tiles, "ilf:version": 1, "ilf:polarMax": 1.5, "ilf:origin": (0.0, 0.0, 0.0),
              "ilf:U": (1.0, 0.0, 0.0), "ilf:V": (0.0, 1.0, 0.0)}
    second = OpenEXR.Part(header, {c: np.ascontiguousarray(image[..., k]) for k, c in enumerate("RGB")}, "second")
    OpenEXR.File([first, second]).write(str(tmp_path / "bad.ilf.exr"))
    refused(tmp_path, None, "tile")


def feed(process, text):
    """Write to the process's standard input and wait until it has been read."""
    import fcntl
    import termios
    import time
    process.stdin.write(text.encode())
    process.stdin.flush()
    for _ in range(1000):
        waiting = struct.unpack("i", fcntl.ioctl(process.stdin.fileno(), termios.FIONREAD, b"\0" * 4))[0]
        if not waiting:
            break
        time.sleep(0.01)
    time.sleep(0.1)                                      # for what is done with it


@pytest.mark.parametrize("how", ["renamed over", "removed", "truncated in place"])
def test_file_that_changes_while_it_is_used(tmp_path, how):
    """Replaced or removed: the open file goes on to be read.  Cut short in place: a refusal, not a signal."""
    f = random_ilf(np.random.default_rng(29), 30, 2, 32, 32, plane=((0, 0, 0), (29, 0, 0), (0, 1, 0)))
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    first, second = "0 0 0 0.1 0.2 1 0 0 0\n", "29 1 0 0.1 0.2 1 29 1 0\n"
    expected = run("ilftrace", path, stdin=first + second).out
    p = Process([str(BIN / "ilftrace"), str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                env=environment())
    feed(p, first)
    if how == "renamed over":
        (tmp_path / "new").write_bytes(b"something else")
        (tmp_path / "new").rename(path)
    elif how == "removed":
        path.unlink()
    else:
        os.truncate(path, 5000)
    out, err = p.communicate(second.encode())
    if how == "truncated in place":
        assert p.returncode == 1 and err.decode().startswith("ilftrace: ") and err.count(b"\n") == 1, (p.returncode, err)
    else:
        assert p.returncode == 0 and out == expected


@pytest.mark.parametrize("value", [NAN, INF, -INF], ids=str)
@pytest.mark.parametrize("half, compression", [(False, "none"), (True, "none"), (True, "zip"), (False, "piz")])
def test_texel_that_is_no_number_is_named(tmp_path, good, half, compression, value):
    """Probe (2, 1), pixel (5, 3): named by all who touch the probe, unnoticed by those who don't."""
    g, _ = good
    f = ILF(g.probes.copy(), g.origin, g.U, g.V)
    f.probes[1, 2, 3, 5, 1] = value
    path = write_ilf(tmp_path / "bad.ilf.exr", f, half, compression)
    r = run("ilftrace", path, stdin="1 1 0 0.1 0.2 1 1 1 0\n", code=1)
    line = one_line_error(r, "ilftrace", "bad.ilf.exr", "probe", "pixel")
    assert re.search(r"probe \(?2, ?1\)?.*pixel \(?5, ?3\)?", line), line
    assert r.out == b""
    one_line_error(run("ilfinfo", path, code=1), "ilfinfo", "bad.ilf.exr", "probe", "pixel")
    assert run("ilftrace", path, stdin="0 0 0 0.1 0.2 1 0 0 0\n").out.split()


def test_rebuilt_header_is_the_same_file(good):
    """The tool that breaks files breaks nothing by itself."""
    assert rebuilt(good[1], header_attributes(good[1])[0]) == good[1]
