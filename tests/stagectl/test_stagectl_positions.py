"""[grid] positions: some nodes of the grid, by a list or chosen between rounds (scenes/adaptive.py)."""
import json
import os
import signal
import subprocess
import sys
import time

import pytest
from conftest import BUILD, TOP, environment, needed, run
from process import Process, execute
from stage_util import Run, Stage, journal, session, shots

ADAPTIVE = TOP / "scenes/adaptive.py"
COARSE = [(i, j) for j in (0, 2, 5, 7) for i in (0, 2, 5, 7)]


@pytest.fixture
def stage(tmp_path):
    with Stage(tmp_path, factor=1000) as s:
        yield s


def listed(path):
    return [tuple(map(int, line.split())) for line in path.read_text().splitlines() if not line.startswith("#")]


def visited(folder):
    return [tuple(map(int, r[1:3])) for r in journal(folder) if r[0] == "begin"]


def capture(stage, path):
    return run("stagectl", "--port", stage.port, "capture", path)


# ---- a list -------------------------------------------------------------------------------------------------

def test_a_list_is_visited_in_its_order(tmp_path, stage):
    (tmp_path / "mine.txt").write_text("# mine\n2 1\n0 0\n\n1 1\n")
    path = session(tmp_path, grid={"positions": "mine.txt"})
    capture(stage, path)
    assert visited(tmp_path / "out") == [(2, 1), (0, 0), (1, 1)] and len(shots(tmp_path / "out")) == 6
    assert run("stagectl", "verify", path).text.startswith("3 of 3 places finished, 6 exposures on record, 0 missing")
    assert [line.split("/")[-2] for line in run("stagectl", "list", path).text.split()] == ["002_001", "000_000", "001_001"]
    # the same folder goes on as a whole grid: three places are new
    capture(stage, session(tmp_path))
    assert len(shots(tmp_path / "out")) == 12 and len(visited(tmp_path / "out")) == 6


@pytest.mark.parametrize("text, words", [
    ("0 0\n3 0\n", "mine.txt: line 2: expected a node of 3x2, found 3 0"), ("0\n", "mine.txt: line 1: expected"), ("0 0 0\n", "line 1: expected"),
    ("0 0\n1 1\n0 0\n", "line 3: expected each node once, found 0 0 again"), ("# none\n", "found none"), (None, "mine.txt: No such file")])
def test_lists_that_are_none(tmp_path, text, words):
    if text is not None:
        (tmp_path / "mine.txt").write_text(text)
    r = run("stagectl", "plan", session(tmp_path, grid={"positions": "mine.txt"}), code=1)
    assert words in r.err and r.err.count("\n") == 1


# ---- rounds -------------------------------------------------------------------------------------------------

# two more nodes after each round, up to twenty
NEXT = "n=$(grep -vc '#' out/positions.txt); echo next >> rounds.log; {pause} " \
       "[ $n -ge 20 ] || {{ {{ cat out/positions.txt; echo $((n - 16)) 3; echo $((n - 16 + 1)) 3; }} > t; mv t out/positions.txt; }}; echo \"$n places\""


def adaptive(folder, pause=""):
    path = session(folder, grid={"nodes": "8x8", "positions": "adaptive"}, camera={"exposures": "0.25"})
    path.write_text(path.read_text() + "[chain]\nnext = " + NEXT.format(pause=pause) + "\n")
    return path


def test_rounds(tmp_path, stage):
    path = adaptive(tmp_path)
    plan = run("stagectl", "plan", path).text
    assert "places      16 (of 8 x 8)" in plan and "or there are 40" in plan and "at most" in plan and "next        n=$(grep" in plan
    assert not (tmp_path / "out").exists()
    r = capture(stage, path)
    wanted = [*COARSE, (0, 3), (1, 3), (2, 3), (3, 3)]
    assert sorted(visited(tmp_path / "out")) == sorted(wanted) and visited(tmp_path / "out")[16:] == wanted[16:]
    assert listed(tmp_path / "out/positions.txt") == visited(tmp_path / "out")
    assert "20 places" in r.err and (tmp_path / "rounds.log").read_text() == "next\n" * 3
    capture(stage, path)                                     # asks once more, and captures nothing
    assert len(shots(tmp_path / "out")) == len(journal_shots(tmp_path)) == 20
    assert run("stagectl", "verify", path).text.startswith("20 of 20 places")
    run("stagectl", "--port", stage.port, "--anew", "capture", path)                # another room: the list begins anew, too
    assert len(journal_shots(tmp_path)) == 40 and listed(tmp_path / "out/positions.txt")[16:] == wanted[16:]


def journal_shots(folder):
    return [tuple(r[1:4]) for r in journal(folder / "out") if r[0] == "shot"]


def test_killed_at_any_time(tmp_path, stage):
    """What was captured is not captured again, whether the end came in a round or between two."""
    path = adaptive(tmp_path, pause="sleep .2;")
    for k in range(40):
        r = Run("--port", stage.port, "capture", path)
        time.sleep(.3 + .13 * k)
        r.kill(signal.SIGKILL)
        r.end()
        if (tmp_path / "rounds.log").exists() and k > 3:
            break
    capture(stage, path)
    assert len(journal_shots(tmp_path)) == len(set(journal_shots(tmp_path))) == 20
    assert run("stagectl", "verify", path).text.startswith("20 of 20 places finished, 20 exposures on record, 0 missing")


@pytest.mark.parametrize("command, words", [
    ("echo what is wrong >&2; exit 3", "[chain] next: exit code 3: what is wrong"), ("sed -i '$d' out/positions.txt", "expected the 16 nodes that were there first"),
    ("echo 9 9 >> out/positions.txt", "expected a node of 8x8, found 9 9")])
def test_rounds_that_fail(tmp_path, stage, command, words):
    path = session(tmp_path, grid={"nodes": "8x8", "positions": "adaptive"}, camera={"exposures": "0.25"})
    path.write_text(path.read_text() + f"[chain]\nnext = {command}\n")
    r = run("stagectl", "--quiet", "--port", stage.port, "capture", path, code=1)
    assert words in r.err and r.err.count("\n") == 1 and len(journal_shots(tmp_path)) == 16


# ---- the choice ---------------------------------------------------------------------------------------------

def report(nodes, sees, errors=.01):
    """ilfpack's, for one lamp above the middle of a unit square: sees(x, y) of it."""
    places = [(i / 7, j / 7) for i, j in nodes]
    return {"plane": [0, 0, 0, 1, 0, 0, 0, 1, 0], "grid": [8, 8],
            "pictures": [{"line": k + 1, "position": [*p, 0]} for k, p in enumerate(places)],
            "nodes": [{"node": [k % 8, k // 8], "error": errors} for k in range(64)],
            "lamps": [{"fate": "taken out", "position": [.5, .5, 2], "candela": 100, "error": .05, "seen": [sees(*p) for p in places]}]}


def choice(folder, sees, most=24, error=.001, step=8, nodes=COARSE, errors=.01):
    (folder / "list.txt").write_text("".join(f"{i} {j}\n" for i, j in nodes))
    (folder / "report.json").write_text(json.dumps(report(nodes, sees, errors)))
    p = execute([sys.executable, ADAPTIVE, "--nodes", "8x8", "--most", str(most), "--error", str(error), "--step", str(step), folder / "report.json",
                 folder / "list.txt"], capture_output=True, text=True)
    assert p.returncode == 0, p.stderr
    return set(listed(folder / "list.txt")) - set(nodes), p.stdout


def test_it_goes_where_places_disagree(tmp_path):
    """A shadow's edge between columns 2 and 5: nodes in between, and its mirror image gives theirs."""
    left, _ = choice(tmp_path, lambda x, y: float(x < .5))
    assert len(left) == 8 and sum(i in (3, 4) for i, _ in left) >= 6
    turned, _ = choice(tmp_path, lambda x, y: float(y < .5))
    assert len(turned) == 8 and sum(j in (3, 4) for _, j in turned) >= 6
    brighter, _ = choice(tmp_path, lambda x, y: float(x > .5))
    assert brighter == left                                   # what is hidden and what is not are alike


def test_without_shadows_it_fills_gaps(tmp_path):
    chosen, words = choice(tmp_path, lambda x, y: 1.)
    assert all(min(abs(i - a) + abs(j - b) for a, b in COARSE) > 1 for i, j in chosen)
    assert words.startswith("16 places: light from above is uncertain by 1 %; 8 more: ")
    assert choice(tmp_path, lambda x, y: 1.)[0] == chosen


def test_when_it_ends(tmp_path):
    assert choice(tmp_path, lambda x, y: 1., errors=.004, error=.005) == (set(), "16 places: light from above is uncertain by 0.4 %: done (at most 0.5 % were asked for)\n")
    assert len(choice(tmp_path, lambda x, y: 1., most=19)[0]) == 3
    chosen, words = choice(tmp_path, lambda x, y: 1., most=16)
    assert not chosen and "done (16 places at most)" in words


def test_the_table_for_ilfpack(tmp_path):
    (tmp_path / "list.txt").write_text("0 0\n7 0\n7 7\n")

    def table(plane, probes=3):
        return execute([sys.executable, ADAPTIVE, "--table", "--plane", plane, "--nodes", "8x8", tmp_path / "list.txt", *"abcd"[:probes]],
                       capture_output=True, text=True)
    assert table("1 2 .5 0 .7 0 -.7 0 0").stdout == "a 1 2 0.5 90\nb 1 2.7 0.5 90\nc 0.3 2.7 0.5 90\n"
    assert "expected a level plane" in table("0 0 0 1 0 .1 0 1 0").stderr and "expected a level plane" in table("0 0 0 0 1 0 1 0 0").stderr
    assert "expected 4 nodes" in table("0 0 0 1 0 0 0 1 0", probes=4).stderr


# ---- the whole chain ----------------------------------------------------------------------------------------

ROOM = """void light l
0
0
3 300 200 100
l sphere lamp
0
0
4 .2 .1 1.5 .08
void plastic grey
0
0
5 .5 .5 .5 0 0
grey polygon card
0
0
12 .15 -.5 .7 .8 -.5 .7 .8 .8 .7 .15 .8 .7
!genbox grey walls 4 4 3 -i | xform -t -2 -2 -.5
"""
SESSION = """[grid]
nodes = 6x6
plane = -.25 -.25 0 .5 0 0 0 .5 0
positions = adaptive
positions_most = {most}
positions_error = 0
[stage]
port = port
unit_mm = 1000
origin = -780 -780
feed = 6000
settle = 0.1
[camera]
exposures = 1/2048 1/64 1/2
command = virtualcamera --quiet --octree room.oct --plane "{{plane}}" --at {{x}},{{y}} --seconds {{seconds}} --size 128
  --response srgb --render-options "-ab 0 -av .1 .1 .1" --cache views -o {{file}}
[output]
folder = out
[chain]
before = oconv -f room.rad > room.oct
beside = virtualstage --with-parent --time-factor 1000 --link port
hdrgen = --response srgb
fishremap = --lens equidistant --fov 185 --size 64x32 --polar-max 90
ilfpack = --type float
ilflamps = --geometry room.oct
"""


def chain(folder):
    return Process(["make", "-C", TOP / "scenes", f"CAPTURE={folder}/s.conf", f"BUILD={BUILD}", "QUIET=--quiet"],
                   env=environment(MAKEFLAGS="", MAKELEVEL=""), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True)


@pytest.mark.sweep
def test_from_a_coarse_grid_to_a_regular_field(tmp_path):
    """Run in one go, and ended by kill -9 again and again: the same places, the same field, nothing captured twice."""
    needed(*"stagectl virtualstage virtualcamera hdrgen fishremap ilfpack oconv rtrace genbox xform".split())
    for name in ("whole", "killed"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "room.rad").write_text(ROOM)
        (tmp_path / name / "s.conf").write_text(SESSION.format(most=19))
    for wait in (4, 9, 9, 9, 9):
        p = chain(tmp_path / "killed")
        try:
            p.wait(wait)
        except subprocess.TimeoutExpired:
            os.killpg(p.pid, signal.SIGKILL)
        p.communicate()
    for name in ("whole", "killed"):
        p = chain(tmp_path / name)
        words, _ = p.communicate()
        assert p.returncode == 0, words
    whole, killed = tmp_path / "whole/out", tmp_path / "killed/out"
    assert listed(whole / "positions.txt") == listed(killed / "positions.txt") and len(visited(whole)) == 19
    taken = [tuple(r[1:4]) for r in journal(killed) if r[0] == "shot"]
    assert len(taken) == len(set(taken)) == 3 * 19
    assert "version 2" in run("ilfinfo", whole / "room.lamps.ilf.exr").text
    for f in ("room.ilf.exr", "room.lamps.ilf.exr"):
        assert run("ilfinfo", whole / f).text.replace("whole", "killed") == run("ilfinfo", killed / f).text
