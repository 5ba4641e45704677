"""A light field's file that is changed in place while programs use it: one line and exit status 1, never a signal, never other light.

The two ways in which it is noticed are tried apart: the look at the file's length and date before texels are used, and the
system's signal where the mapped file has ended (with a library preloaded in which the file's length and date stay as they were).
"""
import os
import subprocess

import numpy as np
import pytest

from conftest import BUILD, command, environment, one_line_error, run
from ilf_util import random_ilf, write_ilf
from process import execute, Process
from test_ilf_files import feed

SCENE = """void ilf room
1 f.ilf.exr
0
0

room bubble b
0
0
4 0 0 0 8

void plastic w
0
0
5 .6 .5 .4 0 0

w polygon floor
0
0
12 -3 -3 0 3 -3 0 3 3 0 -3 3 0
"""
PROGRAMS = {"rtrace -di 0": ["rtrace", "-h", "-di", "0", "s.oct"], "rtrace -di 16": ["rtrace", "-h", "-ab", "1", "-ad", "16", "s.oct"],
            "rcontrib": ["rcontrib", "-h", "-m", "room", "s.oct"], "ilftrace": ["ilftrace", "f.ilf.exr"]}
WORDS = ("f.ilf.exr", "as it was opened", "found it changed", "renaming")


@pytest.fixture
def folder(tmp_path):
    f = random_ilf(np.random.default_rng(61), 8, 8, 64, 64, decades=1, plane=((-1, -1, 0), (2, 0, 0), (0, 2, 0)))
    write_ilf(tmp_path / "plain", f)
    write_ilf(tmp_path / "zip", f, compression="zip")
    (tmp_path / "s.rad").write_text(SCENE)
    os.link(tmp_path / "plain", tmp_path / "f.ilf.exr")
    (tmp_path / "s.oct").write_bytes(run("oconv", "s.rad", cwd=tmp_path).out)
    return tmp_path


def provide(folder, kind):
    (folder / "new").write_bytes((folder / kind).read_bytes())
    (folder / "new").rename(folder / "f.ilf.exr")


def cut_in_the_last_page(path):
    os.truncate(path, path.stat().st_size - 100)


def half_of_another(path):
    """As cp over it, stopped half way."""
    data = path.read_bytes()
    with path.open("wb") as f:
        f.write(data[::-1][:len(data) // 2])


def rewritten(path):
    """Other light, of the same length."""
    data = bytearray(path.read_bytes())
    data[-200:] = bytes(200)
    with path.open("r+b") as f:
        f.write(data)


HOW = {"cut": lambda p: os.truncate(p, 5000), "emptied": lambda p: os.truncate(p, 0), "cut in the last page": cut_in_the_last_page,
       "grown": lambda p: p.open("ab").write(b"more"), "half of another": half_of_another, "rewritten": rewritten}


def rays(program, numbers):
    return "".join(" ".join(map(str, r)) + (" 0 0 2\n" if program == "ilftrace" else "\n") for r in numbers)


FIRST = [(0.1, 0.1, 1, 0.1, 0.2, 1)]
MORE = [(x, y, 0.5, 0.3 * x, -0.2 * y, 1) for x in (-0.9, 0.9) for y in (-0.9, 0.9)] + [(0.5, 0.5, 1, 0, 0.1, -1)]


def started(folder, program, env=None):
    return Process(command(program[0], program[1:]), cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                   env=env or environment())


@pytest.mark.parametrize("kind, program", [("plain", p) for p in PROGRAMS] + [("zip", "rtrace -di 16"), ("zip", "ilftrace")])
def test_changed_in_place(folder, kind, program):
    for how, change in HOW.items():
        provide(folder, kind)
        p = started(folder, PROGRAMS[program])
        feed(p, rays(program, FIRST))
        change(folder / "f.ilf.exr")
        out, err = p.communicate(rays(program, MORE).encode())
        lines = err.decode().splitlines()
        assert p.returncode == 1 and len(lines) == 1, (how, p.returncode, err)
        assert all(w in lines[0] for w in WORDS), (how, lines)
        assert len(out.splitlines()) <= 1, (how, out)    # nothing of what was asked after the change


@pytest.mark.parametrize("program", ["rtrace -di 16", "ilftrace"])
def test_replaced_by_rename_or_removed(folder, program):
    provide(folder, "plain")
    expected = run(PROGRAMS[program][0], *PROGRAMS[program][1:], stdin=rays(program, FIRST + MORE), cwd=folder).out
    for how in ("renamed", "removed"):
        provide(folder, "plain")
        p = started(folder, PROGRAMS[program])
        feed(p, rays(program, FIRST))
        (folder / "f.ilf.exr").unlink() if how == "removed" else provide(folder, "zip")
        out, err = p.communicate(rays(program, MORE).encode())
        assert (p.returncode, err) == (0, b"")
        if program == "ilftrace":
            assert out == expected
        assert len(out.splitlines()) == len(expected.splitlines())


def test_children(folder):
    """rtrace's child processes: each may speak, and the status is 1."""
    provide(folder, "plain")
    p = started(folder, ["rtrace", "-h", "-n", "2", "-di", "0", "s.oct"])
    feed(p, rays("rtrace", FIRST))
    os.truncate(folder / "f.ilf.exr", 5000)
    out, err = p.communicate(rays("rtrace", MORE).encode())
    assert p.returncode == 1 and b"found it changed" in err, (p.returncode, err)


# ---- where no look at the file tells ---------------------------------------------------------------------

@pytest.fixture(scope="module")
def blind(tmp_path_factory):
    """Environment in which a file's length and date stay what they were when first asked for: what is left is the signal."""
    if "san" in BUILD.parts:
        pytest.skip("a preloaded library and the sanitizers don't go together")
    folder = tmp_path_factory.mktemp("preload")
    (folder / "blind.c").write_text("""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <sys/stat.h>
int fstat(int fd, struct stat *to)
{
    static int (*real)(int, struct stat *);
    static struct stat kept[256];
    static char have[256];
    if (!real) *(void **)&real = dlsym(RTLD_NEXT, "fstat");
    const int r = real(fd, to);
    if (r || fd < 0 || fd > 255 || !S_ISREG(to->st_mode)) return r;
    if (!have[fd] || kept[fd].st_ino != to->st_ino) kept[fd] = *to, have[fd] = 1;
    *to = kept[fd];
    return 0;
}
""")
    execute(["cc", "-shared", "-fPIC", "-O1", "-o", str(folder / "blind.so"), str(folder / "blind.c"), "-ldl"], check=True)
    return environment(LD_PRELOAD=str(folder / "blind.so"))


@pytest.mark.parametrize("program", PROGRAMS)
def test_end_of_the_mapped_file(folder, blind, program):
    provide(folder, "plain")
    p = started(folder, PROGRAMS[program], blind)
    feed(p, rays(program, FIRST))
    os.truncate(folder / "f.ilf.exr", 5000)
    out, err = p.communicate(rays(program, FIRST + MORE).encode())      # probes that are in use already
    lines = err.decode().splitlines()
    assert p.returncode == 1 and len(lines) == 1, (p.returncode, err)
    assert all(w in lines[0] for w in WORDS), lines


def test_end_of_the_mapped_file_for_a_picture_and_for_programs_that_read_all(folder, blind):
    """Cut as soon as it is mapped, in the middle of the last probe, which they can't see here."""
    for args in (["rpict", "-x", "8", "-y", "8", "-vp", "0", "-2", "2", "-vd", "0", ".7", "-.7", "-vh", "4", "-vv", "4", "s.oct"], ["ilfinfo", "f.ilf.exr"],
                 ["ilflamps", "-o", "out", "f.ilf.exr"], ["ilfview", "-o", "out", "f.ilf.exr"], ["ilfdepth", "-o", "out", "f.ilf.exr"]):
        provide(folder, "plain")
        script = folder / "late.c"
        script.write_text("""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <sys/mman.h>
#include <unistd.h>
void *mmap(void *at, size_t n, int prot, int flags, int fd, off_t from)
{
    static void *(*real)(void *, size_t, int, int, int, off_t);
    if (!real) *(void **)&real = dlsym(RTLD_NEXT, "mmap");
    void *m = real(at, n, prot, flags, fd, from);
    if (fd >= 0 && (flags & MAP_SHARED)) (void)!truncate("f.ilf.exr", (off_t)n - 24000);
    return m;
}
void *mmap64(void *at, size_t n, int prot, int flags, int fd, off_t from) { return mmap(at, n, prot, flags, fd, from); }
""")
        execute(["cc", "-shared", "-fPIC", "-O1", "-o", str(folder / "late.so"), str(script), "-ldl"], check=True)
        env = dict(blind)
        env["LD_PRELOAD"] = f"{blind['LD_PRELOAD']}:{folder / 'late.so'}"
        r = run(args[0], *args[1:], cwd=folder, env=env, code=1)
        lines = [x for x in r.err.splitlines() if "light fields:" not in x and "probes used" not in x and "rays," not in x]
        assert len(lines) == 1 and all(w in lines[0] for w in WORDS), r
        assert not (folder / "out").exists()


def test_without_tricks_a_cut_file_is_one_line(folder):
    """ilfinfo reads a file that is cut already."""
    provide(folder, "plain")
    os.truncate(folder / "f.ilf.exr", 60000)
    one_line_error(run("ilfinfo", folder / "f.ilf.exr", code=1), "ilfinfo", "f.ilf.exr")
