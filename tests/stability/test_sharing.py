"""Two at a time, and nothing that a file says reaches a shell."""
import os
import re
import shutil
import subprocess
import threading

import numpy as np
import pytest

from conftest import TOP, command, environment, one_line_error, run
from ilf_util import ILF, random_ilf, rays_text, write_ilf
from process import execute, Process
from stability.conftest import WIDE
from stage_util import Stage, script, session
from test_ilf_eval import trace


def constant(value, compression="none", path=None):
    f = ILF(np.full((4, 4, 16, 32, 3), float(value)), U=(1, 0, 0), V=(0, 1, 0))
    return write_ilf(path, f, compression=compression)


@pytest.mark.parametrize("compression", ["none", "zip", "dwaa"])
@pytest.mark.case("light field replaced by rename while it is read", "ilfmat/file/ilf_dwa.c", "after the first of 16 probes", "the old one to the end, never mixed")
def test_replaced_while_read(tmp_path, compression):
    """ilftrace is fed one ray, the file is replaced, then the rays that need all other probes."""
    path = constant(2, compression, tmp_path / "f.ilf.exr")
    new = constant(4, compression, tmp_path / "new.exr")
    p = Process(["stdbuf", "-o0", *command("ilftrace", [path])], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                bufsize=0, env=environment(ASAN_OPTIONS="verify_asan_link_order=0"))
    p.stdin.write(b"0 0 1 0 0 1 0 0 1\n" * 400)     # beyond what stdin buffers: the answers have begun
    p.stdin.flush()
    first = p.stdout.readline()
    os.replace(new, path)
    grid = np.stack([*np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 1, 9)), np.zeros((9, 9))], -1).reshape(-1, 3)
    rest, err = p.communicate(rays_text(grid, np.broadcast_to([.1, .2, 1.], grid.shape), grid).encode())
    values = np.array((first + rest).split(), float)
    assert p.returncode == 0, err
    assert np.abs(values - 2).max() < .02, ("mixed", values.min(), values.max())     # DWA is lossy


@pytest.mark.parametrize("which", ["another probe", "the same probe"])
@pytest.mark.case("light field written over in place while it is read", "ilfmat/file/ilf_probe.c", "same size, other values", "refused, one line")
def test_overwritten_while_read(tmp_path, which):
    """A mapped file changes under its reader: no answer may be taken for the opened file's."""
    path, new = constant(2, path=tmp_path / "f.ilf.exr"), constant(4, path=tmp_path / "new.exr")
    p = Process(["stdbuf", "-o0", *command("ilftrace", [path])], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                bufsize=0, env=environment(ASAN_OPTIONS="verify_asan_link_order=0"))
    p.stdin.write(b"0 0 1 0 0 1 0 0 1\n" * 400)
    p.stdin.flush()
    p.stdout.readline()
    with open(path, "r+b") as f:
        f.write(new.read_bytes())
    there = "1 1" if which == "another probe" else "0 0"
    out, err = p.communicate(f"{there} 0 0 0 1 {there} 0\n".encode())
    assert p.returncode == 1 and err.count(b"\n") == 1 and b"changed" in err, (p.returncode, err)


@pytest.mark.case("light field written over in place during a rendering", "radiance_patch/m_ilf.c", "after its only probe was used", "exit 1, one line")
def test_overwritten_while_rendered(tmp_path):
    path, new = constant(2, path=tmp_path / "f.ilf.exr"), constant(4, path=tmp_path / "new.exr")
    (tmp_path / "s.rad").write_text("void ilf env\n1 f.ilf.exr\n0\n0\nenv bubble sky\n0\n0\n4 .5 .5 0 5\n")
    (tmp_path / "s.oct").write_bytes(run("oconv", "s.rad", cwd=tmp_path).out)
    p = Process(["stdbuf", "-o0", *command("rtrace", ["-h", "s.oct"])], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                bufsize=0, cwd=tmp_path, env=environment(ASAN_OPTIONS="verify_asan_link_order=0"))
    p.stdin.write(b"0 0 .1 0 0 1\n" * 2000)
    p.stdin.flush()
    p.stdout.readline()
    with open(path, "r+b") as f:
        f.write(new.read_bytes())
    _, err = p.communicate(b"0 0 .1 0 0 1\n")
    assert p.returncode == 1 and err.count(b"\n") == 1 and b"changed" in err, (p.returncode, err)


@pytest.mark.case("light field replaced while it is rendered", "ilfmat/file/ilf_probe.c", "40 replacements during rtrace", "each picture one or the other")
def test_replaced_while_rendered(tmp_path, row):
    sizes = [constant(v, "none", tmp_path / f"{v}.exr") for v in (2, 4)]
    path = tmp_path / "f.ilf.exr"
    shutil.copy(sizes[0], path)
    (tmp_path / "s.rad").write_text("void ilf env\n1 f.ilf.exr\n0\n0\nenv bubble sky\n0\n0\n4 .5 .5 0 5\n")
    octree = tmp_path / "s.oct"
    octree.write_bytes(run("oconv", "s.rad", cwd=tmp_path).out)
    rng = np.random.default_rng(1)
    n = 60000
    d = np.abs(rng.normal(size=(n, 3))) + [0, 0, .2]
    rays = "".join("%g %g 0.1 %g %g %g\n" % (*o, *x) for o, x in zip(rng.uniform(0, 1, (n, 2)), d)).encode()
    stop = threading.Event()

    def swap():
        k = 0
        while not stop.is_set():
            shutil.copy(sizes[k % 2], tmp_path / "next")
            os.replace(tmp_path / "next", path)
            k += 1
            stop.wait(.02)
    swapping = threading.Thread(target=swap)
    swapping.start()
    seen = []
    try:
        for _ in range(4):
            r = run("rtrace", "-h", "-w", "-ab", "0", "s.oct", stdin=rays, cwd=tmp_path)
            values = np.array(r.text.split(), float)
            assert len(values) == 3 * n
            seen.append(np.unique(values.round(3)))
            assert len(seen[-1]) == 1 and seen[-1][0] in (2, 4), "mixed"
    finally:
        stop.set()
        swapping.join()
    row(result=f"values {[float(s[0]) for s in seen]}")


@pytest.mark.case("two renders share one light field", "ilfmat/file/ilf_probe.c", "4 processes at once", "the same answers")
def test_shared(tmp_path):
    f = random_ilf(np.random.default_rng(2), 6, 6, 16, 8)
    path = write_ilf(tmp_path / "f.ilf.exr", f, compression="zip")
    rng = np.random.default_rng(3)
    o = rng.uniform(0, 1, (5000, 3))
    text = rays_text(o, rng.normal(size=(5000, 3)), o).encode()
    many = [Process(command("ilftrace", [path]), stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment()) for _ in range(4)]
    out = [None] * 4

    def feed(k):
        out[k] = many[k].communicate(text)[0]
    threads = [threading.Thread(target=feed, args=(k,)) for k in range(4)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert all(p.returncode == 0 for p in many) and out.count(out[0]) == 4


@pytest.mark.case("two programs write one output", "common/base/outfile.c", "8 ilfpack at once", "one of them whole, nothing else")
def test_same_output(tmp_path):
    import OpenEXR
    for k in range(4):
        OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": np.full((32, 64, 3), k + 1, np.float32)}).write(str(tmp_path / f"{k}.exr"))
    before = {p.name for p in tmp_path.iterdir()}
    many = [Process(command("ilfpack", ["-q", "--grid", "2x2", "--plane", "0 0 0 1 0 0 0 1 0", "-o", "out.ilf.exr", *[f"{k % 4}.exr"] * 4]),
                    cwd=tmp_path, env=environment()) for k in range(8)]
    assert [p.wait() for p in many] == [0] * 8
    assert {p.name for p in tmp_path.iterdir()} == before | {"out.ilf.exr"}
    got = trace(tmp_path / "out.ilf.exr", np.array([[.2, .3, 0], [.9, .9, 0]]), np.array([[0, 0, 1.], [.3, .2, 1]]), np.array([[.2, .3, 0], [.9, .9, 0]]))
    assert got.min() == got.max() and got.max() in (1, 2, 3, 4)


@pytest.mark.skipif(not WIDE, reason="builds the library twice: in make stability")
@pytest.mark.case("two makes in one tree", "Makefile", "2 at once, from nothing", "both end, the library is whole")
def test_two_makes(tmp_path):
    """Both build libilf in a copy: objects and archives of one must not break the other's."""
    tree = tmp_path / "tree"
    tree.mkdir()
    for name in execute(["git", "ls-files"], cwd=TOP, capture_output=True, text=True).stdout.split("\n") or []:
        if name.split("/")[0] in ("common", "ilfmat", "Makefile", "setup", "radiance_patch", "man") or name.endswith(".mk"):
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(TOP / name, tree / name)
    if not (tree / "Makefile").exists():
        pytest.skip("the tree is no git checkout")
    (tree / "build").mkdir()
    for stamp in (".debs-radiance", ".debs-tools", ".debs-test"):
        (tree / "build" / stamp).touch()
    env = {k: v for k, v in environment().items() if not k.startswith("MAKE")}
    many = [Process(["make", "OPT=-O0", "build/bin/ilfinfo"], cwd=tree, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=env) for _ in range(2)]
    said = [p.communicate()[0] for p in many]
    last = execute(["make", "OPT=-O0", "build/bin/ilfinfo"], cwd=tree, capture_output=True, env=env)
    assert last.returncode == 0, last.stderr
    assert [p.returncode for p in many] == [0, 0], said
    assert execute([tree / "build/bin/ilfinfo", "--version"], capture_output=True).returncode == 0


# ---- nothing reaches a shell ------------------------------------------------------------------------------------------------

def sources():
    return [p for folder in ("common", "ilfmat", "tools", "radiance_patch") for p in sorted((TOP / folder).rglob("*.c"))]


@pytest.mark.case("calls of a shell in the sources", "tools/stagectl/names.c", "system, popen, wordexp, sh -c", "none but the camera's, when asked for, and the session's own line for what follows a round")
def test_no_shell_in_the_sources(row):
    found = []
    for p in sources():
        text = re.sub(r"/\*.*?\*/", "", p.read_text(), flags=re.S)
        for m in re.finditer(r'\b(system|popen|wordexp|execlp?)\s*\(|"(?:/bin/)?sh"', text):
            found.append((p.relative_to(TOP).as_posix(), m.group()))
    row(result=f"{found}")
    assert found == [("tools/stagectl/names.c", '"sh"')] + [("tools/stagectl/rounds.c", '"sh"')] * 2        # sh -c, and its own name


@pytest.mark.case("predictable temporary names in the sources", "tools/stagectl/shot.c", "mktemp, tmpnam, getpid in a name", "none")
def test_no_predictable_names_in_the_sources():
    for p in sources():
        text = re.sub(r"/\*.*?\*/", "", p.read_text(), flags=re.S)
        assert not re.search(r"\b(mktemp|tmpnam|tempnam)\s*\(", text), p
        for line in text.splitlines():
            assert not ("getpid()" in line and "printf" in line), (p, line)


@pytest.mark.case("temporary names differ from run to run", "common/base/outfile.c", "getrandom, O_EXCL", "a planted link is not followed")
def test_temp_names(tmp_path):
    """Names seen while two runs of the same work: 6 letters of 62."""
    seen = set()
    for _ in range(2):
        path = session(tmp_path, f"{script(tmp_path, SEE)} {{file}}", stage={"settle": 0.01})
        with Stage(tmp_path, factor=1000) as stage:
            run("stagectl", "-q", "--port", stage.port, "capture", path)
        names = (tmp_path / "seen").read_text().split()
        (tmp_path / "seen").unlink()
        shutil.rmtree(tmp_path / "out")
        assert len(set(names)) == len(names) == 12
        assert not seen & set(names)
        seen |= set(names)
    random = [re.search(r"\.shot-([0-9a-f]{16})\.ppm$", n).group(1) for n in seen]
    assert len({r[:6] for r in random}) == len(random)


SEE = """#!/bin/sh
{ printf 'P6\\n4 1\\n255\\n'; head -c 12 /dev/urandom; } > "$1"
echo "$1" >> "$(dirname "$0")/seen"
"""


@pytest.mark.parametrize("key, value", [("labels", "'$(touch owned)' '`touch owned`'"), ("labels", "';touch owned;' '|touch owned'"),
                                        ("labels", "'a b' \"c'd\"")])
@pytest.mark.case("commands in a session's words", "tools/stagectl/argwords.c", "$(), ``, ;, | without shell = yes", "arguments, never run")
def test_session_words_are_arguments(tmp_path, key, value):
    path = session(tmp_path, f"{script(tmp_path, SEE)} {{file}} {{label}}", stage={"settle": 0.01}, camera={key: value})
    with Stage(tmp_path, factor=1000) as stage:
        run("stagectl", "-q", "--port", stage.port, "capture", path, cwd=tmp_path)
    assert not list(tmp_path.rglob("owned"))


@pytest.mark.case("names that leave the session's folder", "tools/stagectl/names.c", "../, /, folder/../..", "refused, one line")
@pytest.mark.parametrize("name", ["../{i}_{j}_{k}.ppm", "/tmp/{i}_{j}_{k}.ppm", "a/../../{i}_{j}_{k}.ppm", "{i}_{j}_{k}/../../x{i}{j}{k}.ppm"])
def test_names_stay_in_the_folder(tmp_path, name):
    path = session(tmp_path, output={"file": name})
    one_line_error(run("stagectl", "plan", path, code=None), "stagectl", "expected a name below the folder")


@pytest.mark.case("sizes are checked before they are multiplied", "common/image/image.c", "a product over 2^63 in each size field", "refused, no crash, little memory")
@pytest.mark.parametrize("head", [b"P6\n3037000500 3037000500\n255\n", b"P5\n65536 65537\n65535\n", b"PF\n131073 1\n-1\n", b"Pf\n1 99999999999999999999\n-1\n",
                                  b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 131072 +X 131073\n", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4294967297 +X 1\n"])
def test_products_of_sizes(tmp_path, head):
    from conftest import run_measured
    (tmp_path / "a.img").write_bytes(head + b"\0" * 64)
    r, peak = run_measured("fishremap", "--lens", "equidistant", "--fov", "180", "--size", "8x4", "-o", "o.exr", "a.img", cwd=tmp_path, code=1)
    one_line_error(r, "fishremap", "a.img")
    assert peak < 1e9
