"""Hostile and broken input: one line, exit 1, no output; never a crash, a hang or a picture with NaN."""
import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from common_util import write_dng
from conftest import one_line_error, shared_data
from hdrgen_util import f_gamma, f_srgb, expose, hdrgen, make_series, read_exr, scene, write_png, write_times

TIMES = [0.125, 0.5, 2.0]


def refused_or_sane(folder, r, out="out.exr"):
    if r.code == 0:
        for name, pix in read_exr(folder / out)[0].items():
            assert np.isfinite(pix).all(), name
    else:
        assert r.code == 1
        one_line_error(r, "hdrgen")
        assert not (folder / out).exists()


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    """The same little series as PNG, JPEG, TIFF, PPM and raw: {suffix: [bytes, ...]}."""
    folder = tmp_path_factory.mktemp("originals")
    truth = scene(24, 32, decades=1.5, lowest=-1.5)
    rng = np.random.default_rng(1)
    files = {s: [] for s in (".png", ".jpg", ".tif", ".ppm", ".dng")}
    for t in TIMES:
        z = expose(truth, t, f_srgb, rng=rng)
        for s in files:
            p = folder / f"x{s}"
            if s == ".dng":
                write_dng(p, np.repeat(np.repeat(z[..., 1].astype(np.uint16) * 16, 2, 0), 2, 1), seconds=(int(t * 1000), 1000))
            else:
                Image.fromarray(z).save(p)
            files[s].append(p.read_bytes())
    return files


def run_on(folder, files, suffix, *args):
    names = []
    for k, data in enumerate(files):
        names.append(f"h{k}{suffix}")
        (folder / names[-1]).write_bytes(data)
    write_times(folder, names, TIMES)
    (folder / "out.exr").unlink(missing_ok=True)
    r = hdrgen(folder, names, "--response", "srgb", *args, code=None)
    refused_or_sane(folder, r)
    return r


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".ppm", ".dng"])
def test_truncated_files(tmp_path, originals, suffix):
    files = originals[suffix]
    assert run_on(tmp_path, files, suffix).code == 0
    size = len(files[1])
    for keep in {0, 1, 2, 7, 20, size // 4, size // 2, size - size // 8}:
        run_on(tmp_path, [files[0], files[1][:keep], files[2]], suffix)
    for keep in (0, 7, size // 4):
        assert run_on(tmp_path, [files[0], files[1][:keep], files[2]], suffix).code == 1


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".ppm", ".dng"])
def test_damaged_files(tmp_path, originals, suffix):
    files = originals[suffix]

    @settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=6), st.booleans())
    def damaged(changes, head):
        data = bytearray(files[1])
        for where, value in changes:
            data[int(where * (min(len(data), 200) if head else len(data)))] = value
        run_on(tmp_path, [files[0], bytes(data), files[2]], suffix)
    damaged()


def test_huge_dimensions_are_refused_before_memory_is_taken(tmp_path, originals):
    huge = 2_000_000_000
    ppm = b"P6\n%d %d\n255\n" % (huge, huge) + b"\0" * 100
    png = bytearray(originals[".png"][0])
    png[16:24] = struct.pack(">II", 0x7fffffff, 0x7fffffff)
    for suffix, data in ((".ppm", ppm), (".png", bytes(png))):
        assert run_on(tmp_path, [data] * 3, suffix).code == 1


def exif_block(entries, order="<", next_ifd=0, count=None):
    """An APP1 segment with these IFD0 -> EXIF entries: (tag, type, count, 4 value bytes)."""
    o = order
    start = b"Exif\0\0" + (b"II*\0" if o == "<" else b"MM\0*") + struct.pack(o + "I", 8)
    body = struct.pack(o + "H", 1) + struct.pack(o + "HHII", 0x8769, 4, 1, 26) + struct.pack(o + "I", next_ifd)
    body += struct.pack(o + "H", len(entries) if count is None else count)
    body += b"".join(struct.pack(o + "HHI", t, k, n) + v for t, k, n, v in entries) + struct.pack(o + "I", 0)
    data = start + body
    return b"\xff\xe1" + struct.pack(">H", len(data) + 2) + data


@pytest.mark.parametrize("entry, count", [
    ((0x829A, 5, 1, struct.pack("<I", 0xfffffff0)), None),        # rational beyond the file
    ((0x829A, 5, 0xffffffff, struct.pack("<I", 8)), None),        # four thousand million of them
    ((0x829A, 5, 1, struct.pack("<I", 6)), None),                 # the header read as a fraction
    ((0x829A, 3, 1, struct.pack("<HH", 0, 0)), None),             # a short 0
    ((0x829A, 99, 1, b"\xff" * 4), None),                         # no such type
    ((0x9201, 10, 1, struct.pack("<I", 26)), 65535),              # more entries than there are
])
def test_wrong_exif(tmp_path, originals, entry, count):
    files = [b"\xff\xd8" + exif_block([entry], count=count) + data[2:] for data in originals[".jpg"]]
    names = []
    for k, data in enumerate(files):
        names.append(f"w{k}.jpg")
        (tmp_path / names[-1]).write_bytes(data)
    r = hdrgen(tmp_path, names, "--response", "srgb", times=None, code=None)
    refused_or_sane(tmp_path, r)
    write_times(tmp_path, names, TIMES)                            # and with times from elsewhere it is no matter
    hdrgen(tmp_path, names, "--response", "srgb")


def test_exif_times_beyond_belief(tmp_path, originals):
    for num, den in ((0xffffffff, 1), (1, 0), (0, 1), (0, 0)):
        names = []
        for k, data in enumerate(originals[".jpg"]):
            value = struct.pack("<II", num, den)
            block = exif_block([(0x829A, 5, 1, struct.pack("<I", 44))])
            block = b"\xff\xe1" + struct.pack(">H", len(block) - 2 + 8) + block[4:] + value
            names.append(f"v{k}.jpg")
            (tmp_path / names[-1]).write_bytes(b"\xff\xd8" + block + data[2:])
        r = hdrgen(tmp_path, names, "--response", "srgb", times=None, code=1)
        one_line_error(r, "hdrgen", "exposure time")


def test_a_folder_an_empty_file_and_nothing(tmp_path):
    truth = scene(20, 20, decades=1, lowest=-1)
    names = make_series(tmp_path, truth, TIMES, f_gamma)
    (tmp_path / "empty.png").write_bytes(b"")
    (tmp_path / "folder.png").mkdir()
    for odd in ("empty.png", "folder.png", "nothing.png"):
        one_line_error(hdrgen(tmp_path, [*names, odd], code=1), "hdrgen", odd)
    one_line_error(hdrgen(tmp_path, names, times="folder.png", code=1), "hdrgen", "folder.png")
    assert not (tmp_path / "out.exr").exists()


@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(st.binary(max_size=400) | st.text("0123456789 .-e\n#channelsmax_code", max_size=300).map(str.encode))
def test_any_bytes_as_times_or_response(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("f")
    names = make_series(folder, np.full((4, 4, 3), 0.2), TIMES, f_gamma)
    (folder / "odd.txt").write_bytes(data)
    refused_or_sane(folder, hdrgen(folder, names, "--response", "srgb", times="odd.txt", code=None))
    (folder / "out.exr").unlink(missing_ok=True)
    for prefix in (b"", b"hdrgen-response 1\nchannels 3\nmax_code 255\n"):
        (folder / "odd.txt").write_bytes(prefix + data)
        refused_or_sane(folder, hdrgen(folder, names, "--response", "odd.txt", code=None))
        (folder / "out.exr").unlink(missing_ok=True)


def test_newline_in_a_name_stays_one_line(tmp_path):
    one_line_error(hdrgen(tmp_path, ["a\nb.png"], times=None, code=1), "hdrgen")


def test_messy_phone_series_refused_with_the_reason():
    data = shared_data("mirrorball_bracket_kitchen_iphone7_messy")
    r = hdrgen(data, ["10.JPG", "40.JPG", "160.JPG"], times=None, out="/nonexistent/x.exr", code=1)
    one_line_error(r, "hdrgen", "480x472", "pixels")


def test_noise_only_series(tmp_path):
    rng = np.random.default_rng(8)
    names = []
    for k in range(4):
        names.append(f"n{k}.png")
        write_png(tmp_path / names[-1], rng.integers(0, 256, (60, 60, 3), dtype=np.uint8))
    write_times(tmp_path, names, [0.1, 0.2, 0.4, 0.8])
    one_line_error(hdrgen(tmp_path, names, code=1), "hdrgen", "--response")
    hdrgen(tmp_path, names, "--response", "srgb", "--sigma", "--deghost", "--refine-times")
    for name, pix in read_exr(tmp_path / "out.exr")[0].items():
        assert np.isfinite(pix).all() and (pix >= 0).all(), name
