"""Our C lies as .clang-format has it, clang takes it without a warning, and rooms include each other downwards only."""
import re
import shutil
import sys
from pathlib import Path

import pytest
from conftest import BUILD, TOP
from process import execute

# Radiance code keeps Radiance's dress
ROOMS = "common ilfmat tools tests".split()


def sources(*endings):
    files = [f for room in ROOMS for f in sorted((TOP / room).rglob("*")) if f.suffix in endings and "corpus" not in f.parts]
    assert len(files) > 100
    return files


def test_c_is_formatted():
    program = Path(sys.executable).with_name("clang-format")
    assert program.is_file(), "clang-format is not in the tests' virtual environment (setup/requirements.txt)"
    p = execute([program, "--dry-run", "--Werror", *sources(".c", ".h", ".cpp", ".hpp")], cwd=TOP,
                capture_output=True, text=True)
    said = re.findall(r"^(\S+?):(\d+):\d+: error", p.stderr, re.M)
    assert p.returncode == 0, "not as .clang-format has it (build/venv/bin/clang-format -i FILE): " + ", ".join(
        f"{f}:{n}" for f, n in said[:10])


CLANGS = [c for n in range(14, 23) if (c := shutil.which(f"clang-{n}"))] or [c for c in [shutil.which("clang")] if c]


@pytest.mark.skipif(not CLANGS, reason="no clang on this machine (gcc is the one that builds)")
@pytest.mark.parametrize("compiler", dict.fromkeys([*CLANGS[:1], *CLANGS[-1:]]))     # the oldest and the newest
def test_clang_takes_it_without_a_warning(compiler):
    ours = [f for f in sources(".c") if f.relative_to(TOP).parts[0] in ("common", "ilfmat", "tools")]
    p = execute([compiler, "-fsyntax-only", "-std=c11", "-D_GNU_SOURCE", '-DILF_VERSION="0"', "-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Werror",
                 "-Wno-enum-float-conversion", "-Wno-unknown-pragmas", "-Icommon", "-Iilfmat", "-Itools", "-isystem", "/usr/include/OpenEXR",
                 "-isystem", "/usr/include/Imath", f"-I{BUILD}/gen", *ours], cwd=TOP, capture_output=True, text=True)
    assert p.returncode == 0, p.stderr[-3000:]


# A room may include what stands in the rooms named here, and itself; the first part of a path is the room.
BELOW = {
    "common/base": [],
    "common/exr": ["common/base"],
    "common/image": ["common/exr", "common/base"],
    "common/vision": ["common/base"],
    "ilfmat/file": ["ilfmat", "common/exr"],
    "ilfmat/lookup": ["ilfmat"],
    "ilfmat/sampling": ["ilfmat"],
    "ilfmat/lamps": ["ilfmat"],
    "ilfmat": ["common/exr"],
    "ilfmat/programs": ["ilfmat", "common/image", "common/base"],
    "ilfmat/examples": ["ilfmat"],
    "tools/hdrgen": ["common/vision", "common/image", "common/exr", "common/base"],
    "tools/fishremap": ["common/vision", "common/image", "common/exr", "common/base", "ilfmat"],
    "tools/ilflamps": ["common/image", "common/base", "ilfmat", "ilfmat/lamps", "ilfmat/programs"],
    "tools/ilfpack": ["tools/ilflamps", "common/image", "common/base", "ilfmat", "ilfmat/lamps", "ilfmat/programs"],
    "tools/ilfdepth": ["common/image", "common/base", "ilfmat", "ilfmat/programs"],
    "tools/ilfview": ["tools/ilflamps", "common/exr", "common/base", "ilfmat", "ilfmat/programs"],
    "tools/stagectl": ["common/image", "common/base"],
    "tools/twin": ["tools/stagectl", "common/image", "common/base"],
}


def room_of(path):
    return str(path.relative_to(TOP).parent)


def included():
    """(file, room, included file, its room) for each include of ours."""
    for f in sources(".c", ".h", ".cpp", ".hpp"):
        if f.relative_to(TOP).parts[0] == "tests":
            continue
        for name in re.findall(r'^\s*#\s*include "([^"]+)"', f.read_text(), re.M):
            places = [p for p in (f.parent / name, TOP / "common" / name, TOP / "ilfmat" / name, TOP / "tools" / name) if p.is_file()]
            assert places, f"{f.relative_to(TOP)} includes {name}, which is nowhere"
            yield f, room_of(f), places[0].resolve(), room_of(places[0].resolve())


def test_rooms_include_downwards():
    wrong = [f"{f.relative_to(TOP)}: {to.relative_to(TOP)}" for f, room, to, there in included()
             if there != room and there not in BELOW[room]]
    assert not wrong


def test_the_order_of_rooms_has_no_circle():
    seen = set()

    def walk(room, above):
        assert room not in above, " -> ".join([*above, room])
        if room not in seen:
            for below in BELOW[room]:
                walk(below, [*above, room])
            seen.add(room)
    for room in BELOW:
        walk(room, [])


def test_headers_do_not_include_each_other_in_a_circle():
    arrows = {}
    for f, _, to, _ in included():
        if f.suffix in (".h", ".hpp"):
            arrows.setdefault(f.resolve(), set()).add(to)
    done = set()

    def walk(f, above):
        assert f not in above, " -> ".join(x.name for x in [*above, f])
        if f not in done:
            for to in arrows.get(f, ()):
                walk(to, [*above, f])
            done.add(f)
    for f in list(arrows):
        walk(f, [])


def test_programs_are_started_with_a_limit_that_a_busy_machine_does_not_break():
    """tests/process.py limits processor time; a limit by the clock of one's own is a matter of what else the machine does."""
    own = re.compile(r"subprocess\.(run|Popen|call|check_\w+)\(|os\.(system|popen)\(|\b(communicate|wait|end)\(\s*(timeout=)?[1-9]\d*\s*[,)]|(?<!_)timeout=\d")
    for path in sorted((TOP / "tests").rglob("*.py")):
        if path.name not in ("process.py", "mutate.py", "elsewhere.py", "test_form.py"):
            found = [line.strip() for line in path.read_text().splitlines() if own.search(line)]
            assert not found, (path, found)
