"""The order of texels in memory changes nothing but time: interleaved parts and decoded tiles against the planar file."""
import os
import re
import struct
import subprocess
import time

import numpy as np
import pytest

from conftest import BUILD, command, driver, environment, one_line_error, run, run_measured
from ilf_util import ILF, POLAR_MAX, assert_same, random_ilf, rays_text, read_mosaic, unmosaic, write_ilf
from process import execute, Process
from test_ilf_eval import CASES, rays, trace
from test_ilf_sampling import sample

EPS = 2.0 ** -24
NAN = float("nan")


def driven(name, *args, code=0):
    p = execute([driver(name), *args], stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment())
    assert p.returncode == code, p.stderr.decode()
    return p.stdout.decode()


def copied(path, name, *options):
    """The same light field written by libilf's own writer."""
    out = path.parent / name
    driven("ilfcopy", path, out, *options)
    return out


def differences(a, b, n=20000):
    """Values of lookups in a and b that differ in any bit; those of the fast lookup from plain C's, relative."""
    text = driven("ilfboth", a, b, "-n", n)
    return int(re.search(r"differ (\d+)", text)[1]), float(re.search(r"worst (\S+)", text)[1])


def make(folder, case="half", seed=1):
    """The same light field planar and with its interleaved part."""
    (n_u, n_v), (n_theta, n_phi), kind, half = CASES[case]
    f = random_ilf(np.random.default_rng(seed), n_u, n_v, n_theta, n_phi, kind, half, decades=3)
    planar = write_ilf(folder / "planar.ilf.exr", f, half)
    return f, planar, copied(planar, "both.ilf.exr", "--interleave")


def decoded_mb(path, o, d, h):
    return float(re.search(r"([\d.]+) MB decoded", run("ilftrace", "--report", path, stdin=rays_text(o, d, h)).err)[1])


# ---- the same light ------------------------------------------------------------------------------------

@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("order", ["second part", "zip"])
def test_same_to_the_bit(tmp_path, case, order):
    f, planar, both = make(tmp_path, case)
    other = both if order == "second part" else copied(planar, "zip.ilf.exr", "-c", "zip")
    differ, worst = differences(planar, other)
    assert differ == 0
    # halves: weight, up to 4 partial sums, sum of two columns, result: each rounded by 2^-24; floats in double: the result
    assert worst <= (7 if CASES[case][3] else 2) * EPS
    o, d, h = rays(np.random.default_rng(2), f, 3000)
    for depth in (True, False):
        assert_same(trace(other, o, d, h, depth), f.eval(o, d, h, depth))
    # and what is read from it: written out again it is the same file
    assert copied(planar, "a.exr").read_bytes() == copied(other, "b.exr").read_bytes()


@pytest.mark.parametrize("kind", POLAR_MAX)
@pytest.mark.parametrize("half", [True, False], ids=["half", "float"])
def test_any_ray_and_usual_rays(tmp_path, kind, half):
    """The lookup of any ray in plain C, with which no processor's extensions are needed, against the one that is used here."""
    f = random_ilf(np.random.default_rng(3), 5, 4, 37, 21, kind, half, decades=3)
    path = write_ilf(tmp_path / "f.ilf.exr", f, half)
    text = driven("ilfboth", path)
    fast, n = map(int, re.search(r"fast (\d+) of (\d+)", text).groups())
    assert fast in (0, n) or 0.9 * n < fast < n          # 0: a processor without AVX2
    assert float(re.search(r"worst (\S+)", text)[1]) <= (7 if half else 2) * EPS


@pytest.mark.parametrize("half", [True, False], ids=["half", "float"])
def test_same_samples(tmp_path, half):
    f = random_ilf(np.random.default_rng(4), 4, 3, 32, 16, half=half, plane=((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    f.probes *= 0.01
    f.probes[:, :, 4:6, 8:10] = 100
    planar = write_ilf(tmp_path / "planar.ilf.exr", f, half)
    rng = np.random.default_rng(5)
    points, u = rng.uniform(0, 1, (500, 3)), rng.uniform(size=(500, 3))
    first = sample(planar, points, u)
    assert (first[:, 3] > 0).any()
    for other in (copied(planar, "both.ilf.exr", "--interleave"), copied(planar, "zip.ilf.exr", "-c", "zip")):
        assert np.array_equal(first, sample(other, points, u))


@pytest.mark.parametrize("kind", ["half", "float"])
def test_ilfpack_interleaves(tmp_path, kind):
    """What OpenEXR's own reader finds: the first part as without, the second as described; ilfinfo says that it is there."""
    import OpenEXR
    rng = np.random.default_rng(6)
    probes = (10 ** rng.uniform(-2, 2, (2, 3, 6, 10, 3))).astype(np.float32)
    files = []
    for k in range(6):
        files.append(tmp_path / f"{k}.exr")
        OpenEXR.File({"type": OpenEXR.scanlineimage}, {c: np.ascontiguousarray(probes[k // 3, k % 3, ..., i])
                                                       for i, c in enumerate("RGB")}).write(str(files[-1]))
    base = ["--grid", "3x2", "--plane", "0 0 0 1 0 0 0 1 0", "--type", kind]
    run("ilfpack", *base, "-o", tmp_path / "planar.ilf.exr", *files)
    run("ilfpack", *base, "--interleave", "-o", tmp_path / "both.ilf.exr", *files)
    a, b = (OpenEXR.File(str(tmp_path / n), separate_channels=True) for n in ("planar.ilf.exr", "both.ilf.exr"))
    assert len(a.parts) == 1 and len(b.parts) == 2
    for c in "RGB":
        assert np.array_equal(a.channels()[c].pixels, b.channels()[c].pixels)
    for name, value in a.header().items():
        if name.startswith("ilf:"):
            assert np.array_equal(value, b.header()[name])
    head, second = b.parts[1].header, b.parts[1].channels["RGB"].pixels
    assert head["name"] == "interleaved" and head["ilf:interleaved"] == 1
    assert (head["tiles"].xSize, head["tiles"].ySize) == (30, 6) and head["compression"] == OpenEXR.NO_COMPRESSION
    wanted = unmosaic(read_mosaic(tmp_path / "planar.ilf.exr")[1], 3, 2)
    got = np.asarray(second, float).reshape(2, 6, 3, 10, 3).transpose(0, 2, 1, 3, 4)
    assert np.array_equal(got, wanted)
    texts = [re.sub(r"(file|interleaved|read) .*|\d+ bytes|file size.*", "", run("ilfinfo", tmp_path / n).text)
             for n in ("planar.ilf.exr", "both.ilf.exr")]
    assert texts[0] == texts[1]
    assert re.search(r"interleaved +yes", run("ilfinfo", "--header", tmp_path / "both.ilf.exr").text)
    assert re.search(r"interleaved +no", run("ilfinfo", "--header", tmp_path / "planar.ilf.exr").text)
    one_line_error(run("ilfpack", *base, "--interleave", "-c", "zip", "-o", tmp_path / "no.ilf.exr", *files, code=2), "ilfpack", "none", "zip")
    assert not (tmp_path / "no.ilf.exr").exists()


# ---- a second part that is not what the first says -------------------------------------------------------

def chunks(data, bytes_each):
    """Offsets of the tiles' data by (part, i, j): found by their heads, which nothing else in these files resembles."""
    found = {}
    for m in re.finditer(re.escape(struct.pack("<iii", 0, 0, bytes_each)), data):
        part, i, j = struct.unpack_from("<3i", data, m.start() - 12)
        found[part, i, j] = m.end()
    return found


@pytest.fixture
def pair(tmp_path):
    f = random_ilf(np.random.default_rng(7), 3, 2, 8, 5, half=True, plane=((0, 0, 0), (2, 0, 0), (0, 1, 0)))
    planar = write_ilf(tmp_path / "planar.ilf.exr", f, True)
    both = copied(planar, "both.ilf.exr", "--interleave")
    data = both.read_bytes()
    at = chunks(data, 8 * 5 * 6)
    assert len(at) == 12
    return f, planar, both, data, at


def all_probes(f):
    q = f.node(*np.meshgrid(np.arange(f.n_u), np.arange(f.n_v))).reshape(-1, 3)
    d = np.broadcast_to([0.3, 0.2, 1.0], q.shape)
    return q, d, q + 0.5 * d


def test_edited_first_part_counts(pair, tmp_path):
    """Another tool changed a texel of the first part and kept the second: the first part's light, for that probe decoded."""
    f, planar, both, data, at = pair
    changed = bytearray(data)
    offset = at[0, 1, 1] + 2 * 8 * 3 * 2 + 8 * 2 + 3 * 2      # row 2, green, column 3
    struct.pack_into("<e", changed, offset, 77.0)
    both.write_bytes(changed)
    f.probes[1, 1, 2, 3, 1] = 77.0
    write_ilf(planar, f, True)
    assert differences(planar, both)[0] == 0
    assert copied(planar, "a.exr").read_bytes() == copied(both, "b.exr").read_bytes()
    rest = all_probes(f)
    assert decoded_mb(both, *rest) == pytest.approx(8 * 5 * 6 / 1e6, abs=0.05)
    usage = run("ilfinfo", both).text
    assert re.search(r"read +6 of 6 probes", usage)


@pytest.mark.parametrize("damage", ["texel", "NaN", "size", "place", "cut", "attribute", "channel", "table"])
def test_damaged_second_part_is_passed_over(pair, damage):
    """The light stays that of the first part, whatever stands in the second."""
    f, planar, both, data, at = pair
    b = bytearray(data)
    where = at[1, 2, 0]
    if damage == "texel":
        b[where + 17] ^= 0x10
    elif damage == "NaN":
        struct.pack_into("<H", b, where + 40, 0x7e00)
    elif damage == "size":
        struct.pack_into("<i", b, where - 4, 3)
    elif damage == "place":
        struct.pack_into("<i", b, where - 20, 0)
    elif damage == "cut":
        b = b[:where + 30]
    elif damage == "attribute":
        k = b.index(b"ilf:interleaved\0int\0")
        struct.pack_into("<i", b, k + 24, 2)
    elif damage == "channel":
        k = b.index(b"RGB\0")
        b[k:k + 3] = b"XYZ"
    else:
        struct.pack_into("<Q", b, data.index(struct.pack("<Q", where - 24)), 10 ** 12)
    both.write_bytes(b)
    assert differences(planar, both)[0] == 0


def test_texel_that_is_no_number_in_both_parts_is_named(pair):
    f, planar, both, data, at = pair
    b = bytearray(data)
    struct.pack_into("<H", b, at[0, 2, 1] + 3 * 48 + 16 + 5 * 2, 0x7e00)         # row 3, green, column 5
    struct.pack_into("<H", b, at[1, 2, 1] + 3 * 48 + 5 * 6 + 2, 0x7e00)
    both.write_bytes(b)
    for program, more in (("ilfinfo", {}), ("ilftrace", dict(stdin="2 1 0 0.1 0.2 1 2 1 0\n"))):
        line = one_line_error(run(program, both, code=1, **more), program, "both.ilf.exr")
        assert re.search(r"probe \(2,1\), pixel \(5,3\)", line or run(program, both, code=1, **more).err)


def test_damage_anywhere_never_crashes(pair, tmp_path):
    f, planar, both, data, at = pair
    rng = np.random.default_rng(8)
    text = rays_text(*all_probes(f))
    path = tmp_path / "bad.ilf.exr"
    for _ in range(80):
        b = bytearray(data)
        for k in rng.integers(0, len(b), rng.integers(1, 4)):
            b[k] = rng.integers(256)
        path.write_bytes(b if rng.uniform() < 0.7 else b[:rng.integers(len(b))])
        r = run("ilftrace", path, stdin=text, code=None)
        assert r.code in (0, 1) and "nan" not in r.text.lower(), r
        if r.code:
            one_line_error(r, "ilftrace", "bad.ilf.exr")


# ---- memory ------------------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def large(tmp_path_factory):
    """16 x 16 probes of 200 x 200 halves: 61 MB, and as much again interleaved."""
    folder = tmp_path_factory.mktemp("large")
    rng = np.random.default_rng(9)
    one = rng.uniform(0.5, 2, (200, 200, 3))
    f = ILF(np.broadcast_to(one, (16, 16, 200, 200, 3)))
    planar = write_ilf(folder / "planar.ilf.exr", f, True)
    return f, planar, copied(planar, "both.ilf.exr", "--interleave")


def everywhere(f, probes):
    """Rays that need all rows of the first probes."""
    k = np.arange(probes)
    q = f.node(k % f.n_u, k // f.n_u)
    phi, th = np.meshgrid(np.linspace(0.01, 1.56, 60), np.linspace(-3, 3, 8))
    d = np.stack([np.sin(phi) * np.cos(th), np.sin(phi) * np.sin(th), np.cos(phi)], -1).reshape(-1, 3)
    o = np.repeat(q, len(d), 0)
    return rays_text(o, np.tile(d, (probes, 1)), o)


@pytest.mark.parametrize("probes", [40, 256])
def test_memory_is_what_is_touched(large, probes):
    """The first part is compared, not kept: peak memory grows by the touched halves x 1.25 at most."""
    f, planar, both = large
    if "san" in BUILD.parts:
        pytest.skip("the sanitizer's own memory comes on top")
    text = everywhere(f, probes)
    _, least = run_measured("ilftrace", both, stdin="")
    _, peak = run_measured("ilftrace", both, stdin=text)
    touched = probes * 200 * 200 * 6
    assert peak - least < 1.25 * touched + 3e6               # 3 MB: buffers, tables, the library's own
    assert decoded_mb(both, *map(np.atleast_2d, ([0, 0, 0], [0, 0, 1.], [0, 0, 0]))) == 0


def test_two_processes_share_the_second_part(large):
    """Of the file's pages that both have touched, the kernel counts half for each; nothing is a process's own."""
    f, _, both = large
    text = everywhere(f, 256).encode()
    many = [Process(command("ilftrace", [both]), stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment()) for _ in range(2)]
    try:
        for p in many:
            os.set_blocking(p.stdout.fileno(), False)
        sizes = []
        for p in many:                                       # stdout is drained as the rays go in
            for k in range(0, len(text), 1 << 14):
                p.stdin.write(text[k:k + (1 << 14)])
                p.stdin.flush()
                p.stdout.read()
        for _ in range(600):
            sizes = [mapping(p.pid, both.name) for p in many]
            if min(s["Rss"] for s in sizes) > 0.9 * 256 * 240000:
                break
            for p in many:
                p.stdout.read()
            time.sleep(0.05)
        for s in sizes:
            assert 0.9 * 256 * 240000 < s["Rss"] < 1.1 * 256 * 240000, s
            assert s["Pss"] < 0.55 * s["Rss"], s
            assert s["Anonymous"] == 0, s
    finally:
        for p in many:
            p.stdin.close()
            os.set_blocking(p.stdout.fileno(), True)
            p.stdout.read()
            p.wait()


def mapping(pid, name):
    """Bytes of a process's mapping of a file, as the kernel counts them."""
    total, inside = {"Rss": 0, "Pss": 0, "Anonymous": 0}, False
    for line in open(f"/proc/{pid}/smaps"):
        if re.match(r"[0-9a-f]+-[0-9a-f]+ ", line):
            inside = line.rstrip().endswith(name)
        elif inside and (key := line.split(":")[0]) in total:
            total[key] += int(line.split()[1]) * 1024
    return total
