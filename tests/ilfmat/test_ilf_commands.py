"""The commands ilfpack, ilfinfo and ilftrace, and what they read and keep in memory."""
import os
import re
import subprocess

import numpy as np
import pytest

from conftest import BIN, environment, one_line_error, run, run_measured
from ilf_util import (ILF, PI, POLAR_MAX, assert_same, directional_ilf, header_attributes, pixel_type, random_ilf, rays_text,
                      read_mosaic, sparse_ilf, unmosaic, write_ilf)
from process import execute

PROGRAMS = ["ilfpack", "ilfinfo", "ilftrace"]
REQUIRED = ["ilf:version", "ilf:origin", "ilf:U", "ilf:V", "ilf:polarMax"]
RAY = "0.3 0.3 0 0.1 0.2 1 0.5 0.7 2\n"
NAN = float("nan")


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
    def count():
        return int(re.search(r"rchar: (\d+)", open("/proc/self/io").read())[1])
    before = count()
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


def test_ilfinfo_leaves_no_half_a_montage(tmp_path):
    f = ILF(np.ones((2, 3, 4, 8, 3)))
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


# ---- what every command promises --------------------------------------------------------------------------------

@pytest.mark.parametrize("program", PROGRAMS)
def test_what_every_command_promises(tmp_path, program):
    r = run(program, "--help")
    assert program in r.text and "--quiet" in r.text and "--threads" in r.text and not r.err
    r = run(program, "--version")
    assert re.match(rf"{program}\b.*\d+\.\d+", r.text) and r.text.count("\n") == 1 and not r.err
    r = run(program, code=2)
    assert r.err.startswith(f"{program}: ") and not r.out
    r = run(program, "--no-such-option", code=2)
    one_line_error(r, program, "--no-such-option")
    assert not r.out


def test_full_output_is_noticed(tmp_path):
    """The last act of a program is to check that its output was taken."""
    path = write_ilf(tmp_path / "f.ilf.exr", random_ilf(np.random.default_rng(20), 3, 2, 8, 4))
    for program in ("ilfinfo", "ilftrace"):
        with open("/dev/full", "w") as full:
            p = execute([str(BIN / program), str(path)], input=RAY.encode(), stdout=full, stderr=subprocess.PIPE,
                        env=environment())
        assert p.returncode == 1 and p.stderr.decode().startswith(f"{program}: ")


def test_single_probe_file_with_the_default_plane(tmp_path):
    f = directional_ilf(lambda d: np.stack([d[..., 2]] * 3, -1), 16, 64)
    path = write_ilf(tmp_path / "one.ilf.exr", f)
    out = run("ilftrace", path, stdin="0 0 0 0 0.6 0.8 inf inf inf\n").out
    assert np.allclose(np.array(out.split(), float), 0.8, atol=1e-3)
