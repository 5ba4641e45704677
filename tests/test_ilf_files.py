"""The file contract (section 1) and the commands ilfpack, ilfinfo, ilftrace (section 4)."""
import os
import re
import struct
import subprocess

import numpy as np
import pytest

from conftest import BIN, environment, one_line_error, run, run_measured
from ilf_util import (ILF, PI, POLAR_MAX, assert_same, directional_ilf, edited, header_attributes, pixel_type, random_ilf,
                      rays_text, read_mosaic, rebuilt, sparse_ilf, tile_offsets, unmosaic, write_ilf)

PROGRAMS = ["ilfpack", "ilfinfo", "ilftrace"]
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
    "version 2": ("ilf:version", struct.pack("<i", 2)),
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
    """Section 2: min(polarValid, polarMax)."""
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
    maker = next((p for d in os.environ["PATH"].split(":") if os.access(p := os.path.join(d, "exrmaketiled"), os.X_OK)), None)
    if maker is None:
        pytest.skip("exrmaketiled is not installed")
    (tmp_path / "a.exr").write_bytes(good[1])
    subprocess.run([maker, "-m", "-t", "8", "4", str(tmp_path / "a.exr"), str(tmp_path / "bad.ilf.exr")], check=True)
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
        r = run("ilftrace", path, stdin=RAY, code=None, timeout=20)
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
    p = subprocess.Popen([str(BIN / "ilftrace"), str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                         env=environment())
    feed(p, first)
    if how == "renamed over":
        (tmp_path / "new").write_bytes(b"something else")
        (tmp_path / "new").rename(path)
    elif how == "removed":
        path.unlink()
    else:
        os.truncate(path, 5000)
    out, err = p.communicate(second.encode(), timeout=20)
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


# ---- what is touched is what is read -------------------------------------------------------------------

@pytest.fixture(scope="module")
def big(tmp_path_factory):
    """The paper's full size as half floats: 30 x 30 probes of 400 x 400, 864 MB, all holes but one probe."""
    probe = np.full((400, 400, 3), 2.0)
    probe[..., 1] = 0.5
    return sparse_ilf(tmp_path_factory.mktemp("big") / "big.ilf.exr", 30, 30, 400, 400, {(7, 11): probe})


def test_big_file_is_sound_and_right(big):
    assert os.path.getsize(big) > 860e6
    out = run("ilftrace", big, stdin=f"{7 / 29} {11 / 29} 0 0.1 0.2 1 {7 / 29} {11 / 29} 0\n0 0 0 0 0 1 0 0 0\n").out
    rows = np.array([x.split() for x in out.splitlines()], float)
    assert np.allclose(rows, [[2, 0.5, 2], [0, 0, 0]], rtol=1e-5, atol=1e-5)


def test_memory_grows_with_the_probes_that_are_touched(big):
    def rays_on(n):
        k = np.arange(n)
        x, y = (k % 29 + 0.5) / 29, (k // 29 + 0.5) / 29
        a = np.linspace(0, 6, 25)[:, None]
        rows = [f"{p} {q} 0 {np.cos(t)} {np.sin(t)} {c} {p} {q} 0\n" for p, q in zip(x, y) for t in a[:, 0] for c in (0.1, 1)]
        return "".join(rows)

    _, least = run_measured("ilftrace", big, stdin="")
    _, few = run_measured("ilftrace", big, stdin=rays_on(2))          # 2 cells, 6 probes of 0.96 MB
    _, many = run_measured("ilftrace", big, stdin=rays_on(100))
    assert least < 60e6
    assert few < least + 30e6
    assert many < least + 330e6                                          # 100 cells touch about 145 probes


def test_opening_reads_header_and_table_only(big):
    """Bytes that passed through read() in the child, as the kernel counts them."""
    try:
        def count():
            return int(re.search(r"rchar: (\d+)", open("/proc/self/io").read())[1])
        before = count()
    except OSError:
        pytest.skip("/proc/self/io is not there")
    _, peak = run_measured("ilftrace", big, stdin="0 0 0 0 0 1 0 0 0\n")
    assert count() - before < 12e6
    assert peak < 60e6


# ---- ilfinfo -------------------------------------------------------------------------------------------

def test_ilfinfo_tells_header_plane_and_range(tmp_path):
    f = ILF(np.full((2, 3, 4, 8, 3), 0.25), origin=(0.5, 1.5, -2.5), U=(3, 0, 0), V=(0, 1.25, 0), polar_max=POLAR_MAX["185deg"])
    f.probes[1, 2, 3, 7] = (96, 4, 0.125)
    path = write_ilf(tmp_path / "room.ilf.exr", f, compression="zip")
    text = run("ilfinfo", path).text
    for word in ("0.5 1.5 -2.5", "3 0 0", "0 1.25 0", "92.5", "96", "0.125"):
        assert word in text, f"{word} is not in\n{text}"
    assert re.search(r"3 ?[x×] ?2", text) and re.search(r"8 ?[x×] ?4", text) and "zip" in text.lower() and "float" in text.lower()


@pytest.mark.parametrize("half", [False, True])
def test_ilfinfo_montage_is_the_mosaic(tmp_path, half):
    from PIL import Image
    f = ILF(np.zeros((2, 3, 4, 8, 3)))
    f.probes[..., :] = 0.01
    f.probes[1, 2] = 1.0                                 # the brightest probe
    f.probes[0, 1, :, :, 0] = 1.0                        # a red one
    path = write_ilf(tmp_path / "f.ilf.exr", f, half)
    out = tmp_path / "m.png"
    run("ilfinfo", path, "--montage", out)
    a = np.asarray(Image.open(out).convert("RGB"), float)
    assert a.shape[0] % 2 == 0 and a.shape[1] % 3 == 0
    ph, pw = a.shape[0] // 2, a.shape[1] // 3

    def mean(i, j):
        return a[j * ph + ph // 4:(j + 1) * ph - ph // 4, i * pw + pw // 4:(i + 1) * pw - pw // 4].mean((0, 1))
    assert mean(2, 1).min() > mean(0, 0).max() + 50
    assert mean(1, 0)[0] > mean(1, 0)[1] + 50 and abs(mean(1, 0)[1] - mean(0, 0)[1]) < 20


def test_ilfinfo_leaves_no_half_a_montage(tmp_path, good):
    f = ILF(good[0].probes.copy())
    f.probes[0, 0, 0, 0, 0] = NAN
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    run("ilfinfo", path, "--montage", tmp_path / "m.png", code=1)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["f.ilf.exr"]
    run("ilfinfo", path, "--montage", tmp_path / "no" / "folder.png", code=1)


# ---- ilfpack ---------------------------------------------------------------------------------------------

PLANE = "0.5 -1 2 3 0 0 0 0 1.5"


def write_probe(path, image, half=False, attributes=None):
    import OpenEXR
    image = np.asarray(image, np.float16 if half else np.float32)
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, **(attributes or {})}
    OpenEXR.File(header, {c: np.ascontiguousarray(image[..., k]) for k, c in enumerate("RGB")}).write(str(path))
    return path


def six_probes(folder, rng, **more):
    probes = (10 ** rng.uniform(-2, 2, (2, 3, 6, 10, 3))).astype(np.float32)
    return probes, [write_probe(folder / f"p{i}{j}.exr", probes[j, i], **more) for j in range(2) for i in range(3)]


@pytest.mark.parametrize("kind", ["float", "half"])
@pytest.mark.parametrize("compression", ["none", "rle", "zips", "zip", "piz"])
def test_ilfpack_round_trip(tmp_path, kind, compression):
    """Probes in i-fastest order; what OpenEXR's own reader finds is what went in."""
    probes, files = six_probes(tmp_path, np.random.default_rng(22))
    out = tmp_path / "out.ilf.exr"
    run("ilfpack", "--grid", "3x2", "--plane", PLANE, "--type", kind, "--compression", compression, "-o", out, *files)
    header, mosaic = read_mosaic(out)
    if kind == "half":
        probes = probes.astype(np.float16)
    assert np.array_equal(unmosaic(mosaic, 3, 2), probes.astype(float))
    assert pixel_type(out) == (np.float16 if kind == "half" else np.float32)
    assert (header["tiles"].xSize, header["tiles"].ySize) == (10, 6) and "ONE_LEVEL" in str(header["tiles"])
    assert np.array_equal(header["ilf:origin"], np.float32([0.5, -1, 2]))
    assert np.array_equal(header["ilf:U"], [3, 0, 0]) and np.array_equal(header["ilf:V"], [0, 0, 1.5])
    assert header["ilf:version"] == 1 and np.isclose(header["ilf:polarMax"], PI / 2, rtol=1e-7)
    assert header["compression"].name.lower().startswith(compression) or compression == "none"
    assert [list(w) for w in header["dataWindow"]] == [[0, 0], [29, 11]]
    kinds = {n: k for n, k, _ in header_attributes(out.read_bytes())[0]}
    assert [kinds[n] for n in REQUIRED] == ["int", "v3f", "v3f", "v3f", "float"]
    # and the light field evaluates as the oracle says
    f = ILF(probes, (0.5, -1, 2), (3, 0, 0), (0, 0, 1.5))
    rng = np.random.default_rng(23)
    o, d = rng.normal(size=(500, 3)), rng.normal(size=(500, 3))
    got = run("ilftrace", out, stdin=rays_text(o, d, o + d)).out
    assert_same(np.array([x.split() for x in got.splitlines()], float), f.eval(o, d, o + d))


def test_ilfpack_keeps_the_polar_angle_of_its_probes(tmp_path):
    """Probes that say how far they reach (as fishremap writes them) make a file that says so."""
    about = {"ilf:polarMax": float(np.float32(POLAR_MAX["185deg"]))}
    _, files = six_probes(tmp_path, np.random.default_rng(24), attributes=about)
    out = tmp_path / "out.ilf.exr"
    run("ilfpack", "--grid", "3x2", "--plane", PLANE, "-o", out, *files)
    assert np.isclose(read_mosaic(out)[0]["ilf:polarMax"], POLAR_MAX["185deg"], rtol=1e-6)


def test_ilfpack_takes_radiance_pictures(tmp_path):
    rng = np.random.default_rng(25)
    e = 128 + 3
    pixels = rng.integers(128, 256, (4, 8, 3)).astype(np.uint8)
    flat = np.concatenate([pixels, np.full((4, 8, 1), e, np.uint8)], -1)
    data = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n"
    for row in flat:                                     # new run-length format, literal runs
        data += bytes([2, 2, 0, 8]) + b"".join(bytes([8]) + row[:, k].tobytes() for k in range(4))
    (tmp_path / "p.hdr").write_bytes(data)
    out = tmp_path / "out.ilf.exr"
    run("ilfpack", "--grid", "1x1", "--plane", PLANE, "--type", "float", "-o", out, tmp_path / "p.hdr")
    expected = (pixels + 0.5) / 256 * 2.0 ** 3           # Radiance's colr_color
    got = read_mosaic(out)[1]
    assert np.allclose(got, expected, rtol=1e-5) or np.allclose(got, pixels / 256 * 8.0, rtol=1e-5)


def refuses_to_pack(tmp_path, words, *args, code=1):
    before = sorted(p.name for p in tmp_path.iterdir())
    r = run("ilfpack", *args, code=code)
    one_line_error(r, "ilfpack", *words)
    assert sorted(p.name for p in tmp_path.iterdir()) == before, "something was left behind"


def test_ilfpack_refuses(tmp_path):
    _, files = six_probes(tmp_path, np.random.default_rng(26))
    other = write_probe(tmp_path / "small.exr", np.ones((5, 10, 3)))
    bad = np.ones((6, 10, 3))
    bad[4, 7, 2] = NAN
    nan = write_probe(tmp_path / "nan.exr", bad)
    big = write_probe(tmp_path / "big.exr", np.full((6, 10, 3), 1e5))
    (tmp_path / "text.exr").write_text("no picture")
    out = tmp_path / "out.ilf.exr"
    base = ["--grid", "3x2", "--plane", PLANE, "-o", out]
    refuses_to_pack(tmp_path, ["small.exr", "10x6", "10x5"], *base, *files[:5], other)
    refuses_to_pack(tmp_path, ["nan.exr", "7", "4"], *base, *files[:3], nan, *files[4:])
    refuses_to_pack(tmp_path, ["text.exr"], *base, *files[:5], tmp_path / "text.exr")
    refuses_to_pack(tmp_path, ["gone.exr", "no such file"], *base, *files[:5], tmp_path / "gone.exr")
    refuses_to_pack(tmp_path, ["big.exr", ("65504", "half")], "--type", "half", *base, *files[:5], big)
    refuses_to_pack(tmp_path, ["6"], *base, *files[:5], code=2)
    refuses_to_pack(tmp_path, ["6"], *base, *files, files[0], code=2)


@pytest.mark.parametrize("option, value", [
    ("--grid", "0x2"), ("--grid", "3"), ("--grid", "-3x2"), ("--grid", "3x2x1"), ("--grid", "99999999999x2"), ("--grid", "axb"),
    ("--plane", "0 0 0 1 0 0 0 1"), ("--plane", "0 0 0 1 0 0 0 1 0 0"), ("--plane", "0 0 0 0 0 0 0 1 0"), ("--plane", "0 0 0 1 0 0 1 1 0"),
    ("--plane", "nan 0 0 1 0 0 0 1 0"), ("--plane", "0 0 0 1e300 0 0 0 1 0"), ("--type", "double"), ("--compression", "best")])
def test_ilfpack_refuses_options(tmp_path, option, value):
    _, files = six_probes(tmp_path, np.random.default_rng(27))
    options = {"--grid": "3x2", "--plane": PLANE, "-o": tmp_path / "out.ilf.exr", option: value}
    before = sorted(p.name for p in tmp_path.iterdir())
    r = run("ilfpack", *(x for pair in options.items() for x in pair), *files, code=None)
    assert r.code in (1, 2)
    one_line_error(r, "ilfpack", (option.strip("-"), value))
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_ilfpack_failure_keeps_the_old_file(tmp_path):
    _, files = six_probes(tmp_path, np.random.default_rng(28))
    out = tmp_path / "out.ilf.exr"
    out.write_bytes(b"old")
    run("ilfpack", "--grid", "3x2", "--plane", PLANE, "-o", out, *files[:5], tmp_path / "gone.exr", code=1)
    assert out.read_bytes() == b"old"


# ---- the command contract --------------------------------------------------------------------------------

@pytest.mark.parametrize("program", PROGRAMS)
def test_command_contract(tmp_path, program):
    r = run(program, "--help")
    assert program in r.text and "--quiet" in r.text and "--threads" in r.text and not r.err
    r = run(program, "--version")
    assert re.match(rf"{program}\b.*\d+\.\d+", r.text) and r.text.count("\n") == 1 and not r.err
    r = run(program, code=2)
    assert r.err.startswith(f"{program}: ") and not r.out
    r = run(program, "--no-such-option", code=2)
    one_line_error(r, program, "--no-such-option")
    assert not r.out


def test_full_output_is_noticed(good, tmp_path):
    """The last act of a program is to check that its output was taken."""
    if not os.path.exists("/dev/full"):
        pytest.skip("/dev/full is not there")
    path = tmp_path / "f.ilf.exr"
    path.write_bytes(good[1])
    for program in ("ilfinfo", "ilftrace"):
        with open("/dev/full", "w") as full:
            p = subprocess.run([str(BIN / program), str(path)], input=RAY.encode(), stdout=full, stderr=subprocess.PIPE,
                               env=environment())
        assert p.returncode == 1 and p.stderr.decode().startswith(f"{program}: ")


def test_rebuilt_header_is_the_same_file(good):
    """The tool that breaks files breaks nothing by itself."""
    assert rebuilt(good[1], header_attributes(good[1])[0]) == good[1]


def test_single_probe_file_with_the_default_plane(tmp_path):
    f = directional_ilf(lambda d: np.stack([d[..., 2]] * 3, -1), 16, 64)
    path = write_ilf(tmp_path / "one.ilf.exr", f)
    out = run("ilftrace", path, stdin="0 0 0 0 0.6 0.8 inf inf inf\n").out
    assert np.allclose(np.array(out.split(), float), 0.8, atol=1e-3)
