"""What all tests share: where things are, and how a program is run.

ILF_BUILD names the build folder, relative to the project's top (default: build), ILF_SHARED the
folder with the real photographs (default: ../shared).
"""
import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from process import execute

# The tests' own linear algebra is small, and its threads would wait for each other beside other workers; environment() takes this out again.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

TOP = Path(__file__).resolve().parent.parent
BUILD = (TOP / os.environ.get("ILF_BUILD", "build")).resolve()
BIN = BUILD / "bin"
SHARED = (TOP / os.environ.get("ILF_SHARED", "../shared")).resolve()
# what one room's tests offer others', whichever file is collected first
sys.path += [str(f) for f in sorted((TOP / "tests").iterdir()) if f.is_dir()]
FETCHED = TOP / "build" / "bin"     # programs that are fetched, not built, lie here for SAN=1 too

# Radiance seeds rough highlights with an address; where it is the same in each run (personality(2)), so are the pictures.
ADDR_NO_RANDOMIZE = 0x0040000
ctypes.CDLL(None).personality(ADDR_NO_RANDOMIZE)

# Radiance's own programs leave their memory to the system; a leak is an error in ours alone.
HOST = set("""rpict rtrace rcontrib lookamb oconv xform gendaylit pfilt pcomb pcompos pvalue getinfo vwrays rcalc cnt
    total""".split())


def pytest_configure(config):
    config.addinivalue_line("markers", "sweep: the same comparison on many more rays; set ILF_SWEEP=1 to run it")
    # A test finds our programs through environment() alone, in a shell that has them on its path (make env), too.
    words = os.environ.get("PATH", "").split(":")
    os.environ["PATH"] = ":".join(w for w in words if Path(w) not in (BIN, FETCHED))


# The dearest files, most seconds first: begun first, so that workers side by side end together.  stagectl's mostly wait.
DEAREST = """test_radiance_di test_ilfpack_positions test_fishremap_array test_stagectl_faults test_stagectl_firmware test_fishremap_circle_auto test_stagectl_camera
    test_fishremap_accuracy test_ilf_sampling test_hdrgen_accuracy test_hdrgen_align test_ilf_light test_hdrgen test_chain test_figures
    test_fishremap_charts test_hdrgen_flare test_examples test_fishremap_circle_looks test_radiance_surfaces test_capture_room""".split()


def pytest_collection_finish():
    """A library that was linked with -ffast-math takes subnormal numbers from all of its process, this one's tests too."""
    least = float("5e-324")
    if least * 1.0 == 0:
        raise pytest.UsageError("a module that tests import flushes subnormal numbers to 0 (-ffast-math, -Ofast)")


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: DEAREST.index(item.path.stem) if item.path.stem in DEAREST else len(DEAREST))
    if os.environ.get("ILF_SWEEP"):
        return
    skip = pytest.mark.skip(reason="a long sweep: set ILF_SWEEP=1 to run it")
    for item in items:
        if "sweep" in item.keywords:
            item.add_marker(skip)


def sweep(compare, inputs):
    """One comparison on many inputs, as one test: all are tried, and those that fail are named."""
    wrong = []
    for x in inputs:
        try:
            compare(*x)
        except (AssertionError, pytest.fail.Exception) as e:
            wrong.append(f"{', '.join(map(str, x))}: {' '.join(str(e).split())[:300]}")
    if wrong:
        pytest.fail(f"{len(wrong)} of {len(inputs)} inputs fail:\n" + "\n".join(wrong), pytrace=False)


def shared_data(name):
    """The folder of one real data set; the test is skipped where it is not there."""
    folder = SHARED / "data" / name
    if not folder.is_dir():
        pytest.skip(f"real photographs not found: {name} (set ILF_SHARED to the folder that holds data/{name})")
    return folder


def shared_case(name):
    """The folder of one input on which we were wrong, with its README; skipped where it is not there."""
    folder = SHARED / "cases" / name
    if not folder.is_dir():
        pytest.skip(f"input not found: cases/{name} (set ILF_SHARED to the folder that holds it)")
    return folder


def environment(**more):
    """The environment that `make env` prints."""
    env = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    env["PATH"] = ":".join(dict.fromkeys([str(BIN), str(FETCHED), env.get("PATH", "")]))
    lib = ":".join(dict.fromkeys([str(BUILD / "lib"), str(TOP / "build" / "lib")]))
    env["RAYPATH"] = f".:{lib}"
    env.setdefault("LC_ALL", "C")
    env.setdefault("LSAN_OPTIONS", f"suppressions={TOP / 'tests' / 'lsan.supp'}:print_suppressions=0")
    env.update(more)
    return env


class Result:
    """What a program left behind: code, out (bytes), err (text)."""

    def __init__(self, args, code, out, err):
        self.args, self.code, self.out, self.err = args, code, out, err

    @property
    def text(self):
        return self.out.decode("utf-8", "replace")

    def __repr__(self):
        return f"<{' '.join(self.args)}: exit {self.code}; {self.err[-2000:]!r}>"


def command(program, args):
    """The program's path and arguments, where it was built; the test fails if it was not."""
    path = BIN / program
    if not path.is_file() and not (FETCHED / program).is_file():
        pytest.fail(f"{program} is not built: run make first")
    return [str(path if path.is_file() else FETCHED / program), *seeded(program, args)]


def driver(name):
    """A program or library that `make test` builds for the tests; it is a failure if it is not there."""
    path = BUILD / "test" / name
    if not path.is_file():
        pytest.fail(f"the test driver {name} is not built: run make test")
    return path


def needed(*programs):
    """The test fails unless these are found as a user's shell would find them."""
    missing = [p for p in programs if not shutil.which(p, path=environment()["PATH"])]
    if missing:
        pytest.fail(f"not found: {' '.join(missing)} (make builds it, or make deps-test installs it)")


def seeded(program, args):
    """As words; rtrace and rcontrib, which would take their random numbers from the clock, get a seed unless -u... names another."""
    words = [str(a) for a in args]
    return ["-us", "1", *words] if program in ("rtrace", "rcontrib") and not any(w.startswith("-u") for w in words) else words


def run(program, *args, stdin=b"", cwd=None, code=0, env=None):
    """Run one of our programs; fail unless it ends with `code` (None: any code but a signal)."""
    if isinstance(stdin, str):
        stdin = stdin.encode()
    env = dict(env or environment())
    if program in HOST:
        env.setdefault("ASAN_OPTIONS", "detect_leaks=0")
    p = execute(command(program, args), input=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=cwd,
                env=env)
    result = Result([program, *map(str, args)], p.returncode, p.stdout, p.stderr.decode("utf-8", "replace"))
    if p.returncode < 0:
        pytest.fail(f"killed by signal {-p.returncode}: {result!r}")
    for sign in ("AddressSanitizer", "runtime error:", "LeakSanitizer"):
        if sign in result.err:
            pytest.fail(f"sanitizer report: {result!r}")
    if code is not None and p.returncode != code:
        pytest.fail(f"expected exit {code}: {result!r}")
    return result


MEASURE = """
import os, sys
_, status, usage = os.wait4(os.posix_spawn(sys.argv[2], sys.argv[2:], os.environ), 0)
with open(sys.argv[1], "w") as f:
    print(usage.ru_maxrss * 1024, os.waitstatus_to_exitcode(status), file=f)
"""


def run_measured(program, *args, stdin=b"", cwd=None, code=0):
    """As run(), and the process's peak resident memory in bytes.

    A child inherits its parent's peak across fork, so a small interpreter stands between.
    """
    with tempfile.NamedTemporaryFile("r") as note:
        p = execute([sys.executable, "-ISc", MEASURE, note.name, *command(program, args)], cwd=cwd,
                    input=stdin.encode() if isinstance(stdin, str) else stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                    env=environment())
        peak, ended = map(int, note.read().split())
    result = Result([program, *map(str, args)], ended, p.stdout, p.stderr.decode("utf-8", "replace"))
    if ended != code:
        pytest.fail(f"expected exit {code}: {result!r}")
    return result, peak


def one_line_error(result, program, *words):
    """One line on stderr, with the program's name before it and each of the words in it.

    A word may be a tuple: any one of its members will do.  Case does not matter.
    """
    lines = [x for x in result.err.splitlines() if x.strip()]
    assert len(lines) == 1, f"one line expected: {result!r}"
    assert lines[0].startswith(f"{program}: "), result
    low = lines[0].lower()
    for word in words:
        any_of = word if isinstance(word, tuple) else (word,)
        assert any(w.lower() in low for w in any_of), f"{any_of} not named: {lines[0]}"
    return lines[0]
