"""Faults of the system: a program ends with its whole output, or with exit 1, one line, and what was there before."""
import os
import resource
import shutil
import signal
import subprocess

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from conftest import BUILD, command, environment, one_line_error, run, run_measured
from ilf_util import ILF, random_ilf, rays_text, write_ilf
from process import execute, Process
from stage_util import Stage, session
from stability.conftest import WIDE

SHIM = BUILD / "test/faultshim.so"


def exr(path, rgb):
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": np.ascontiguousarray(rgb, np.float32)}).write(str(path))


class Job:
    """A program's small job: words, names of its outputs ('-': standard output), its input on stdin."""

    def __init__(self, program, words, outputs, stdin=b""):
        self.program, self.words, self.outputs, self.stdin = program, words, outputs, stdin


def disc(size, lit):
    y, x = np.mgrid[0:size, 0:size]
    inside = (x - size / 2 + .5) ** 2 + (y - size / 2 + .5) ** 2 < (size / 2) ** 2
    return np.repeat((np.where((x - lit) ** 2 + (y - size / 2) ** 2 < (size / 12) ** 2, 5.0, .02) * inside)[..., None], 3, -1)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A folder with all inputs, and the jobs on them."""
    d = tmp_path_factory.mktemp("inputs")
    rng = np.random.default_rng(1)
    light = 10 ** rng.uniform(-2, 0, (24, 32, 3))
    for k, t in enumerate([.25, 1, 4]):
        Image.fromarray((255 * np.clip(light * t, 0, 1) ** (1 / 2.2) + .5).astype(np.uint8)).save(d / f"e{k}.png")
    (d / "times").write_text("e0.png 0.25\ne1.png 1\ne2.png 4\n")
    exr(d / "fish.exr", rng.uniform(0, 2, (64, 64, 3)))
    for k, deg in enumerate([0, 30, 60]):
        exr(d / f"s{deg}.exr", disc(120, 60 - deg / 92.5 * 60))
    for k in range(4):
        exr(d / f"p{k}.exr", rng.uniform(0, 2, (6, 8, 3)))
    f = random_ilf(rng, 3, 3, 8, 6, half=True)
    write_ilf(d / "zip.ilf.exr", f, half=True, compression="zip")
    o = rng.normal(size=(300, 3))
    (d / "room.rad").write_text("void glow g\n0\n0\n4 1 1 1 0\ng bubble sky\n0\n0\n4 0 0 0 9\n")
    (d / "room.oct").write_bytes(run("oconv", "-f", d / "room.rad").out)
    jobs = {
        "hdrgen": Job("hdrgen", "-q -t times --response gamma:2.2 --save-response r.txt -o out.exr e0.png e1.png e2.png", ["out.exr", "r.txt"]),
        "hdrgen-hdr": Job("hdrgen", "-q -t times --response gamma:2.2 -o out.hdr e0.png e1.png e2.png", ["out.hdr"]),
        "fishremap": Job("fishremap", "-q --lens equidistant --fov 180 --size 32x16 -o out.exr fish.exr", ["out.exr"]),
        "falloffcal": Job("falloffcal", "-q --lens equidistant --fov 185 -o out.txt s0.exr@0 s30.exr@30 s60.exr@60", ["out.txt"]),
        "ilfpack": Job("ilfpack", ["-q", "--grid", "2x2", "--plane", "0 0 0 1 0 0 0 1 0", "-o", "out.ilf.exr", *(f"p{k}.exr" for k in range(4))],
                       ["out.ilf.exr"]),
        "ilfpack-zip": Job("ilfpack", ["-q", "--grid", "2x2", "--plane", "0 0 0 1 0 0 0 1 0", "--compression", "zip", "-o", "out.ilf.exr",
                                       *(f"p{k}.exr" for k in range(4))], ["out.ilf.exr"]),
        "ilfinfo": Job("ilfinfo", "-q --montage out.png zip.ilf.exr", ["out.png"]),
        "ilftrace": Job("ilftrace", "zip.ilf.exr", ["-"], rays_text(o, rng.normal(size=(300, 3)), o).encode()),
        "virtualcamera": Job("virtualcamera", ["-q", "--octree", "room.oct", "--plane", "0 0 0 1 0 0 0 1 0", "--at", "0,0", "--seconds", "1",
                                               "--size", "16", "-o", "out.ppm"], ["out.ppm"]),
    }
    for j in jobs.values():
        if isinstance(j.words, str):
            j.words = j.words.split()
    return d, jobs


PROGRAMS = ["hdrgen", "hdrgen-hdr", "fishremap", "falloffcal", "ilfpack", "ilfpack-zip", "ilfinfo", "ilftrace", "virtualcamera"]
GUARDS = {"ilfpack": "ilfmat/file/ilf_write.c", "ilfpack-zip": "ilfmat/file/ilf_write.c", "ilftrace": "ilfmat/programs/ilftrace.c",
          "virtualcamera": "tools/twin/picture_out.c", "ilfinfo": "common/image/image_write.c"}


def place(inputs, job, tmp_path, old=b"the old one"):
    folder = tmp_path / "job"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(inputs, folder)
    for name in job.outputs:
        if name != "-":
            (folder / name).write_bytes(old)
    return folder, sorted(p.name for p in folder.iterdir())


def attempt(job, folder, fault=None, limit=None):
    env = environment(ASAN_OPTIONS="verify_asan_link_order=0:detect_leaks=0")
    argv = command(job.program, job.words)
    if fault:
        env.update(FAULT=fault, LD_PRELOAD=str(SHIM))

    def small():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    return execute(argv, cwd=folder, input=job.stdin, capture_output=True, env=env, preexec_fn=None if limit is None else small,
                   restore_signals=False)


def result_of(job, folder, p):
    return {name: p.stdout if name == "-" else (folder / name).read_bytes() for name in job.outputs}


def all_or_nothing(job, folder, before, p, good, what):
    """True if the job was done; else it was refused cleanly."""
    assert b"Sanitizer" not in p.stderr and b"runtime error" not in p.stderr, (what, p.stderr)
    assert sorted(x.name for x in folder.iterdir()) == before, (what, "something was left or taken away", p.stderr)
    assert p.returncode in (0, 1), (what, p.returncode, p.stderr)
    now = result_of(job, folder, p)
    if p.returncode == 0:
        assert now == good, (what, "said to be done, but is not")
        return True
    lines = [x for x in p.stderr.decode().splitlines() if x.strip()]
    assert len(lines) == 1 and lines[0].startswith(job.program + ": "), (what, p.stderr)
    for name, data in now.items():
        if name != "-":     # of two outputs the first may be done already
            assert data in (b"the old one", good[name]), (what, name, "half a file")
    assert len(job.outputs) > 1 or "-" in now or now != good, what
    return False


def reference(inputs, job, tmp_path):
    folder, before = place(inputs, job, tmp_path)
    p = attempt(job, folder)
    assert p.returncode == 0, p.stderr
    assert sorted(x.name for x in folder.iterdir()) == before
    return result_of(job, folder, p)


def rows(title, condition, expected):
    return [pytest.param(n, marks=pytest.mark.case(f"{title}: {n}", GUARDS.get(n, "common/base/outfile.c"), condition, expected)) for n in PROGRAMS]


COUNTS = (1, 2, 3, 5, 9, 17, 40) if WIDE else (1, 3)


@pytest.mark.parametrize("name", rows("write errors", "n-th write, fsync, rename, open: ENOSPC, EIO, EDQUOT", "exit 1, one line, old file"))
def test_errors_at_the_nth_call(inputs, tmp_path, name, row):
    folder0, jobs = inputs
    job = jobs[name]
    good = reference(folder0, job, tmp_path)
    done = refused = 0
    for call, how in [("write", "ENOSPC"), ("write", "EIO"), ("fwrite", "ENOSPC"), ("fflush", "EIO"), ("fsync", "EIO"), ("rename", "EDQUOT"), ("open", "EIO")]:
        target = job.outputs[0]
        if target == "-":
            target = "pipe"
        for n in COUNTS:
            folder, before = place(folder0, job, tmp_path)
            p = attempt(job, folder, f"{call}:{how}:{n}:{target}")
            ok = all_or_nothing(job, folder, before, p, good, f"{call} {how} {n}")
            done, refused = done + ok, refused + (not ok)
            if ok:
                break       # it makes no more such calls
    row(result=f"{refused} refused, {done} not reached, none half")
    assert refused >= 1


@pytest.mark.parametrize("name", rows("read errors", "n-th read of any input: EIO", "exit 1, one line, old file"))
def test_read_errors(inputs, tmp_path, name, row):
    folder0, jobs = inputs
    job = jobs[name]
    good = reference(folder0, job, tmp_path)
    refused = 0
    names = [w.split("@")[0] for w in job.words if (folder0 / w.split("@")[0]).is_file()]
    for call in ("read", "fread", "open"):
        for target in names[:2]:
            folder, before = place(folder0, job, tmp_path)
            refused += not all_or_nothing(job, folder, before, attempt(job, folder, f"{call}:EIO:1:{target}"), good, f"{call} {target}")
    row(result=f"{refused} refused, none half")
    assert refused >= 1


@pytest.mark.parametrize("name", rows("interrupted and short calls", "EINTR once; every read and write half or one byte", "goes on: the same output"))
def test_interrupted_and_short_calls(inputs, tmp_path, name, row):
    folder0, jobs = inputs
    job = jobs[name]
    good = reference(folder0, job, tmp_path)
    for fault in ["read:EINTR:1", "read:EINTR:3", "write:EINTR:1", "write:EINTR:2", "fsync:EINTR:1", "read:SHORT:1+", "write:SHORT:1+", "write:ONE:1+"]:
        call, how, n = fault.split(":")
        for target in [job.outputs[0] if call != "read" else "exr" if "exr" in " ".join(job.words) else ".oct"]:
            folder, before = place(folder0, job, tmp_path)
            p = attempt(job, folder, f"{fault}:{target if target != '-' else 'pipe'}")
            assert all_or_nothing(job, folder, before, p, good, fault), (fault, p.stderr)


@pytest.mark.parametrize("name", rows("disk full at any byte", "file size limit 0 .. all but one byte", "exit 1, one line, old file"))
def test_disk_full_at_any_byte(inputs, tmp_path, name, row):
    """A limit on file size stops all writes, those inside the C library's streams too."""
    folder0, jobs = inputs
    job = jobs[name]
    if "-" in job.outputs:
        row(result="no file: /dev/full instead")
        folder, before = place(folder0, job, tmp_path)
        with open("/dev/full", "wb") as full:
            p = execute(command(job.program, job.words), cwd=folder, input=job.stdin, stdout=full, stderr=subprocess.PIPE, env=environment())
        assert p.returncode == 1 and p.stderr.count(b"\n") == 1
        return
    good = reference(folder0, job, tmp_path)
    whole = len(good[job.outputs[0]])
    limits = sorted({0, 1, whole // 3, whole // 2, whole - 1})
    for limit in limits:
        folder, before = place(folder0, job, tmp_path)
        assert not all_or_nothing(job, folder, before, attempt(job, folder, limit=limit), good, f"limit {limit} of {whole}")
    row(condition=f"{len(limits)} limits up to {whole - 1} bytes")


@pytest.mark.parametrize("name", rows("kill -9 while writing", "before the n-th open, write, fsync, rename", "old or new file, whole"))
def test_killed_at_the_nth_call(inputs, tmp_path, name, row):
    folder0, jobs = inputs
    job = jobs[name]
    good = reference(folder0, job, tmp_path)
    killed = 0
    for call in ("open", "write", "fwrite", "fflush", "fsync", "rename"):
        for n in COUNTS:
            folder, _ = place(folder0, job, tmp_path)
            p = attempt(job, folder, f"{call}:KILL:{n}:{job.outputs[0] if job.outputs != ['-'] else 'pipe'}")
            if p.returncode == 0:
                break
            assert p.returncode == -signal.SIGKILL, p.stderr
            killed += 1
            for name_, data in result_of(job, folder, p).items():
                if name_ != "-":
                    assert data in (b"the old one", good[name_]), (call, n, "half a file")
            p = attempt(job, folder)          # and what it left does not stand in the way
            assert p.returncode == 0 and result_of(job, folder, p) == good
    row(result=f"{killed} kills, none left half a file")
    assert killed >= 1


@pytest.mark.parametrize("name", rows("hostile names and places", "0 bytes, link loop, folder, newline, dash, blanks", "refused in one line, or done"))
def test_names_and_places(inputs, tmp_path, name, row):
    folder0, jobs = inputs
    job = jobs[name]
    good = reference(folder0, job, tmp_path)
    source = next(w for w in job.words if (folder0 / w.split("@")[0]).is_file())
    file, at, angle = source.partition("@")

    def again(new_word, words, code, stdin=job.stdin):
        words = [new_word if w == source else w for w in words]
        return run(job.program, *words, cwd=folder, code=code, stdin=stdin)
    folder, before = place(folder0, job, tmp_path)
    (folder / "empty").write_bytes(b"")
    (folder / "loop").symlink_to("loop")
    (folder / "folder").mkdir()
    for bad in ("empty", "loop", "folder", "missing", "folder/", "empty/x"):
        r = again(bad + at + angle, job.words, None)
        assert r.code in (1, 2), (bad, r)
        one_line_error(r, job.program)
    assert all((folder / n).read_bytes() == b"the old one" for n in job.outputs if n != "-")
    # a name is a name
    for odd in ("a b", "new\nline", "qu'o\"te$(touch owned)`touch owned`;x", "\x1b[31m", "ü", "-dash", "%s%n"):
        odd += os.path.splitext(file)[1]
        if file == "times" and odd.startswith("-"):
            continue
        shutil.copy(folder / file, folder / odd)
        word = f"./{odd}" if odd.startswith("-") else odd
        if name.startswith("hdrgen") and file != "times":
            continue                    # the times file names the images
        r = again(word + at + angle, job.words, 0)
        assert not (folder / "owned").exists()
        for n in job.outputs:
            if n != "-":
                assert (folder / n).stat().st_size > 0.9 * len(good[n])
    for n in job.outputs:
        if n == "-":
            continue
        # outputs into what can't be written
        words = [("folder" if w == n else w) for w in job.words]
        one_line_error(run(job.program, *words, cwd=folder, code=None), job.program)
        words = [("missing/" + n if w == n else w) for w in job.words]
        r = run(job.program, *words, cwd=folder, code=1)
        one_line_error(r, job.program, "missing")


@pytest.mark.case("reader of standard output that goes away", "ilfmat/programs/ilftrace.c", "closed after the first line", "exit 1, no endless loop")
def test_closed_standard_output(inputs, tmp_path):
    folder, jobs = inputs
    rays = jobs["ilftrace"].stdin * 300
    give = Process(command("ilftrace", ["zip.ilf.exr"]), cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                   env=environment())
    head = Process(["head", "-1"], stdin=give.stdout, stdout=subprocess.DEVNULL)
    give.stdout.close()
    try:
        give.stdin.write(rays)
        give.stdin.close()
    except BrokenPipeError:
        pass
    head.wait()
    assert give.wait() in (1, -signal.SIGPIPE)
    assert give.stderr.read().count(b"\n") <= 1
    give.stderr.close()


@pytest.mark.parametrize("words", [["fishremap", "--lens", "equidistant", "--fov", "180", "--size", "131072x131072", "-o", "o.exr", "fish.exr"],
                                   ["fishremap", "--lens", "equidistant", "--fov", "180", "--size", "99999999999x3", "-o", "o.exr", "fish.exr"],
                                   ["ilfpack", "--grid", "2147483647x2147483647", "--plane", "0 0 0 1 0 0 0 1 0", "-o", "o.exr", "p0.exr"],
                                   ["virtualcamera", "--octree", "room.oct", "--plane", "0 0 0 1 0 0 0 1 0", "--at", "0,0", "--seconds", "1", "--size",
                                    "2000000", "-o", "o.ppm"]], ids=["remap", "remap-overflow", "grid", "camera"])
@pytest.mark.case("absurd sizes asked for", "common/image/image.c", "2^17 .. 2^62 pixels or probes", "refused before memory is taken")
def test_absurd_sizes(inputs, words, row):
    folder, _ = inputs
    r = run(words[0], *words[1:], cwd=folder, code=None)
    assert r.code in (1, 2)
    one_line_error(r, words[0])
    result, peak = run_measured(words[0], *words[1:], cwd=folder, code=r.code)
    row(result=f"refused at {peak / 1e6:.0f} MB")
    assert peak < (1e9 if "san" in str(BUILD) else 200e6)
    assert not list(folder.glob("o.*"))


# ---- the capture session ---------------------------------------------------------------------------------------------

def capture(path, stage, fault=None, code=(0,), env_more=None):
    argv = command("stagectl", ["-q", "--port", stage.port, "capture", path])
    if fault:
        argv = ["env", f"FAULT={fault}", f"LD_PRELOAD={SHIM}", *argv]
    p = execute(argv, capture_output=True, env=environment(ASAN_OPTIONS="verify_asan_link_order=0:detect_leaks=0"))
    assert p.returncode in code, (fault, p.returncode, p.stderr)
    assert b"Sanitizer" not in p.stderr and b"runtime error" not in p.stderr
    return p


@pytest.mark.parametrize("fault, code", [("write:ENOSPC:2:journal", (1,)), ("write:EIO:7:journal", (1,)), ("fdatasync:EIO:2:journal", (1,)), ("syncfs:EIO:2", (1,)),
                                         ("rename:EIO:3:.ppm", (1,)), ("write:EINTR:2:journal", (0,)), ("write:ONE:1+:journal", (0,)),
                                         ("read:SHORT:1+:journal", (0,)), ("write:KILL:9:journal", (-9,)), ("fdatasync:KILL:4:journal", (-9,)), ("rename:KILL:4:.ppm", (-9,))],
                         ids=lambda v: v if isinstance(v, str) else "")
@pytest.mark.case("fault in a capture session, then resumed", "tools/stagectl/journal.c", "fault", "every exposure once, digests right")
def test_session_faults(tmp_path, fault, code):
    from stage_util import journal, pictures, shots
    path, folder = session(tmp_path, stage={"settle": 0.01}), tmp_path / "out"
    with Stage(tmp_path, factor=1000) as stage:
        p = capture(path, stage, fault, code)
        if code == (1,):
            # one line says what failed; another may say what became of the stage
            lines = [x for x in p.stderr.splitlines() if x != b"stagectl: stage: its position is lost"]
            assert len(lines) == 1 and lines[0].startswith(b"stagectl: "), p.stderr
        if (folder / "journal").exists():
            text = (folder / "journal").read_bytes()
            whole = text[:text.rfind(b"\n") + 1]
            assert whole == text or code == (-9,), "half a record stays"
        capture(path, stage)
    assert len(shots(folder)) == 12 and len(pictures(folder)) == 12 and journal(folder)
    run("stagectl", "verify", path)
    taken = (tmp_path / "shots.log").read_text().split()
    # of an exposure that a fault hit after the camera fired, one more at most
    assert len(taken) - len(set(taken)) <= (0 if code == (0,) else 1)


# ---- what must be durable before what ----------------------------------------------------------------------------------

def logged(tmp_path, argv, cwd=None):
    log = tmp_path / "calls"
    p = execute(["env", f"FAULT_LOG={log}", f"LD_PRELOAD={SHIM}", *argv], cwd=cwd, capture_output=True,
                env=environment(ASAN_OPTIONS="verify_asan_link_order=0:detect_leaks=0"))
    assert p.returncode == 0, p.stderr
    return [line.split(" ", 1) for line in log.read_text().splitlines()]


@pytest.mark.case("order: record, files, journal, rename", "tools/stagectl/shot.c", "each of 12 exposures", "synced record before its rename")
def test_order_of_the_journal(tmp_path, row):
    """A power cut keeps what was synced, in any order: a picture under its name must have its record on disk, and the record
    its file (journal.h)."""
    path = session(tmp_path, stage={"settle": 0.01})
    with Stage(tmp_path, factor=1000) as stage:
        calls = logged(tmp_path, command("stagectl", ["-q", "--port", stage.port, "capture", path]))
    renames = [k for k, (call, name) in enumerate(calls) if call == "rename" and name.endswith(".ppm")]
    assert len(renames) == 12
    for k in renames:
        before = [call for call, name in calls[:k] if call == "syncfs" or name.endswith("/journal")]
        # since the last record: the files' sync, then the journal's
        last = len(before) - 1 - before[::-1].index("write")
        assert before[last + 1:][:2] == ["syncfs", "fdatasync"], (k, before[-6:])
    row(result=f"{len(calls)} calls in order")


@pytest.mark.parametrize("name", [n for n in PROGRAMS if n != "ilftrace"])
@pytest.mark.case("order: contents, fsync, rename, folder", "common/base/outfile.c", "each output", "fsync between the last write and the rename")
def test_order_of_an_output(inputs, tmp_path, name):
    folder0, jobs = inputs
    job = jobs[name]
    folder, _ = place(folder0, job, tmp_path)
    calls = logged(tmp_path, command(job.program, job.words), cwd=folder)
    for out in job.outputs:
        at = [k for k, (call, path) in enumerate(calls) if call == "rename" and path.rsplit("/", 1)[-1] == out]
        assert len(at) == 1
        mine = [(call, k) for k, (call, path) in enumerate(calls) if f".{out}." in path]
        assert [c for c, k in mine if k < at[0]][-1] == "fsync", mine
        assert not [c for c, k in mine if k > at[0] and c != "fsync"]
        assert ("fsync", str(folder)) in [tuple(c) for c in calls[at[0] + 1:]]
