"""stagectl on the virtual stage: commands, sessions, targets, exposures, interrupts."""
import hashlib
import importlib.util
import re
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import TOP, environment, needed, run
from process import execute
from stage_util import PYTHON, SOON, Run, Stage, asking_camera, fake, pictures, script, session, shots      # noqa: F401  (fake is a fixture)


def one_line(result):
    lines = result.err.splitlines()
    assert len(lines) == 1 and lines[0].startswith("stagectl: "), result.err
    return lines[0]


# ---- what every command promises ----------------------------------------------------------------------------------

@pytest.mark.parametrize("program", ["stagectl", "virtualstage", "virtualcamera"])
def test_help_version_and_man_page_agree(program):
    text = run(program, "--help").text
    assert text.startswith(f"Usage: {program}") and run(program, "--version").text.startswith(program)
    page = (TOP / "man" / f"{program}.1").read_text().replace("\\-", "-")
    for name in re.findall(r"^ +(?:-\w, )?--([a-z-]+)", text, re.M):
        assert f"--{name}" in page, name


@pytest.mark.parametrize("args", [[], ["walk"], ["home", "now"], ["move", "1"], ["move", "one", "2"], ["capture"], ["home"],
                                  ["--driver", "marlin", "--port", "/dev/null", "home"], ["--speed", "3", "home"]])
def test_usage_errors(args):
    assert one_line(run("stagectl", *args, code=2))


def test_every_session_key_is_in_the_man_page():
    page = (TOP / "man" / "stagectl.1").read_text()
    keys = re.findall(r"^(\w+) = ", run("stagectl", "keys").text, re.M)
    assert len(keys) > 30
    for key in keys:
        assert re.search(rf"^\.BR? {key}\b", page, re.M), key


def test_keys_are_a_session_file(tmp_path):
    """What `keys` prints can be filled in and used."""
    text = run("stagectl", "keys").text.replace("nodes = \n", "nodes = 2x2\n").replace("plane = \n", "plane = 0 0 0 1 0 0 0 1 0\n")
    text = text.replace("command = \n", "command = cam {file}\n").replace("folder = \n", "folder = out\n")
    (tmp_path / "s.conf").write_text(text)
    plan = run("stagectl", "plan", tmp_path / "s.conf").text
    assert "exposures   64 (16 a place, 6.10352e-05 to 2 s)" in plan


# ---- sessions ------------------------------------------------------------------------------------------

@pytest.mark.parametrize("section, keys, words", [
    ("grid", {"nodes": "3"}, "nodes"), ("grid", {"nodes": "0x3"}, ""), ("grid", {"plane": "0 0 0 1 0 0 1 0 0"}, "right angles"),
    ("grid", {"plane": "0 0 0 1 0 0 0 0"}, ""), ("grid", {"plane": "0 0 0 0 0 0 0 1 0"}, "longer"), ("grid", {"order": "spiral"}, "serpentine"),
    ("stage", {"sped": 3}, "unknown key 'sped'"), ("stage", {"feed": -1}, "feed"), ("stage", {"feed": "nan"}, ""),
    ("stage", {"axes": "x x"}, "axes"), ("stage", {"driver": "marlin"}, "driver"), ("stage", {"travel": "0 -1 0 1"}, "travel"),
    ("camera", {"exposures": "1 0.5"}, "rise"), ("camera", {"exposures": ""}, "at least one"),
    ("camera", {"exposures": "from 1 to 1e30 step 0.1"}, "at most"), ("camera", {"command": "cam"}, "{file}"),
    ("camera", {"command": "cam {file} {f}"}, "{f}"), ("camera", {"command": "cam '{file}"}, "closing"), ("camera", {"retries": 1.5}, "whole"),
    ("camera", {"labels": "one"}, "expected 2, one for each"), ("camera", {"command": "cam {file} {label}"}, "labels"),
    ("output", {"file": "{i}/{k}.png"}, "{j}"), ("output", {"file": "{i}_{j}.png"}, "{k}"), ("output", {"file": "../{i}_{j}_{k}.png"}, "below"),
    ("output", {"file": "/tmp/{i}_{j}_{k}.png"}, "below"), ("output", {"file": "{i:3}_{j}_{k}.png"}, "{i:0N}"), ("output", {"folder": ""}, "folder"),
])
def test_bad_sessions_are_refused(tmp_path, section, keys, words):
    path = session(tmp_path, **{section: keys})
    line = one_line(run("stagectl", "plan", path, code=1))
    assert words in line and "session.conf" in line


@pytest.mark.parametrize("text, words", [("[grid\n", "[section]"), ("nodes\n", "key = value"), ("[places]\nn = 1\n", "[places]"),
                                         ("[grid]\nnodes = 1x1\nnodes = 2x2\n", "given before, in line 2"), ("", "expected 'nodes'")])
def test_broken_files_name_the_line(tmp_path, text, words):
    (tmp_path / "s.conf").write_text(text)
    assert words in one_line(run("stagectl", "plan", tmp_path / "s.conf", code=1))
    one_line(run("stagectl", "plan", tmp_path / "none.conf", code=1))


def test_plan_times_by_hand(tmp_path):
    """3 x 1 nodes 100 mm apart, no backlash: two moves of d/v + v/a, settles and exposures."""
    path = session(tmp_path, grid={"nodes": "3x1"}, stage={"backlash": "0 0", "feed": 3000, "acceleration": 100, "settle": 0.5})
    out = run("stagectl", "plan", path).text
    moving = 2 * (100 / 50 + 50 / 100)
    assert f"moving      0 h 00 min {moving:04.1f} s" in out and "settling    0 h 00 min 01.5 s" in out
    assert "exposing    0 h 00 min 03.8 s" in out and "x -500 to -300, y -350 to -350" in out


def test_plan_refuses_what_leaves_the_travel(tmp_path):
    inside = session(tmp_path, stage={"travel": "-501 0 -401 0"})
    assert "all points inside" in run("stagectl", "plan", inside).text
    # the nodes are inside, the approach against backlash is not
    outside = session(tmp_path, stage={"travel": "-500 0 -400 0", "backlash": "0.5 0"})
    r = run("stagectl", "plan", outside, code=1)
    assert "node 0,0: expected x from -500 to 0 mm, found -500.5 (on the approach" in r.err


# ---- what the controller is told (a GRBL of our own) -----------------------------------------------------

@pytest.mark.parametrize("order", ["serpentine", "raster"])
@pytest.mark.parametrize("backlash", ["0.5 -0.25", "0 0"])
def test_targets_and_side_of_approach(tmp_path, fake, order, backlash):
    g = fake()
    path = session(tmp_path, grid={"order": order}, stage={"origin": "-150 -120", "unit_mm": 100, "backlash": backlash, "axes": "-y x"},
                   camera={"exposures": "0.1"})
    run("stagectl", "--port", g.port, "capture", path)
    rows = [(j, range(3) if j == 0 or order == "raster" else range(2, -1, -1)) for j in range(2)]
    # U (20 mm) runs along -y, V (10 mm) along x
    want = [(-150 + 10.0 * j, -120 - 10.0 * i) for j, r in rows for i in r]
    moves, at = g.moves(), [None, None]
    b = list(map(float, backlash.split()))
    reached = []
    for k, m in enumerate(moves):
        final = len(reached) < len(want) and np.allclose(m, want[len(reached)])
        for a in range(2):
            if final and b[a] and (at[a] is None or m[a] != at[a][0]):
                assert at[a] is not None and (m[a] - at[a][0]) * b[a] > 0, f"move {k} comes from the wrong side"
            if at[a] is None or m[a] != at[a][0]:
                at[a] = (m[a],)
        if final:
            reached.append(m)
    assert np.allclose(reached, want)
    assert all(len(s) <= 79 for s in g.lines) and not any(re.match(r"\$\d+=", s) or s == "$X" for s in g.lines)
    assert all(s.startswith("G21G90G94G53G1") for s in g.lines if "X" in s)


def test_nothing_moves_before_homing_and_all_points_are_checked_first(tmp_path, fake):
    g = fake()
    far = session(tmp_path, stage={"origin": "-150 -150", "unit_mm": 1000})
    r = run("stagectl", "--port", g.port, "capture", far, code=1)
    assert "expected x from -200 to 0 mm" in r.err and not g.moves() and "$H" not in g.lines


def test_banner_of_0_9_is_refused(fake):
    g = fake(banner="Grbl 0.9j ['$' for help]")
    r = run("stagectl", "--port", g.port, "home", code=4)
    assert "expected GRBL 1.1 or later" in r.err


@pytest.mark.parametrize("number, words", [(2, "soft limit"), (1, "hard limit"), (3, "reset while in motion"), (8, "homing failed")])
def test_alarms_in_words(fake, number, words):
    g = fake(answer=lambda s: f"ALARM:{number}\r\n" if s.startswith("G21G90G94G53") or (number == 8 and s == "$H") else None)
    r = run("stagectl", "--port", g.port, *(["home"] if number == 8 else ["move", "-10", "-10"]), code=4)
    assert f"ALARM:{number} ({words}" in r.err and ("$H" if number == 8 else "X-10.0000Y-10.0000") in r.err


def test_errors_in_words(fake):
    g = fake(answer=lambda s: "error:22\r\n" if s.startswith("G21G90G94G53") else None)
    r = run("stagectl", "--port", g.port, "move", "-10", "-10", code=4)
    assert "error:22 (no feed rate is set) to 'G21G90G94G53G1X-10.0000Y-10.0000F1500.0'" in r.err


def test_messages_at_any_time_answer_nothing(fake):
    junk = b"[MSG:Caution: Unlocked]\r\n>G54:ok\r\n$5=1\r\n<Idle|WPos:1.000,2.000,3.000>\r\n\x00\xff\x91\r\n"
    g = fake(junk=junk)
    assert run("stagectl", "--port", g.port, "move", "-10", "-20").text == "-10.000 -20.000\n"


def test_a_position_that_is_not_the_target_is_not_believed(fake):
    g = fake(answer=lambda s: "ok\r\n" if s.startswith("G21G90G94G53") else None)   # says ok and stays
    r = run("stagectl", "--port", g.port, "move", "-10", "-10", code=4)
    assert "expected it to stand at -10.000 -10.000 mm, found it Idle at 0.000 0.000" in r.err


# ---- dialects and habits of controllers: a capture must come out the same ---------------------------------

@pytest.mark.parametrize("habit", [
    [], ["--dialect", "grblhal"], ["--inches"], ["--startup", "G20"], ["--work-positions", "--work-offset", "7,-3"], ["--skip-status", "2"],
    ["--late-ok", "0.15"], ["--reset-ok"], ["--boot", "0.7"], ["--noise"], ["--split"], ["--home-direction", "3"],
    ["--inches", "--startup", "G91G20", "--noise", "--split", "--work-positions"]], ids=lambda h: " ".join(h).replace("--", "") or "plain")
def test_habits(tmp_path, habit):
    with Stage(tmp_path, *habit) as stage:
        path = session(tmp_path, asking_camera(tmp_path, stage, "{i},{j}"), grid={"nodes": "2x2"}, camera={"exposures": 1})
        run("stagectl", "--port", stage.port, "capture", path)
    lines = np.loadtxt(tmp_path / "where")
    assert len(lines) == 4
    for i, j, x, y, speed in lines:
        assert speed == 0 and abs(x - (-500 + 200 * i)) <= 0.5 / 80 + 1e-9 and abs(y - (-400 + 100 * j)) <= 0.5 / 80 + 1e-9


def test_five_by_four_by_four_stands_still_on_target(tmp_path):
    """Positions that are no whole steps; truth from the stage's own side, asked for while the camera runs."""
    with Stage(tmp_path) as stage:
        path = session(tmp_path, asking_camera(tmp_path, stage, "{mx},{my},{x},{y}"), grid={"nodes": "5x4"},
                       stage={"origin": "-412.3456 -333.3333", "unit_mm": 777.7}, camera={"exposures": "1/8 1/4 1/2 1"})
        run("stagectl", "--port", stage.port, "capture", path)
    lines = np.loadtxt(tmp_path / "where")
    assert len(lines) == 80
    mx, my, px, py, x, y, speed = lines.T
    assert not speed.any()
    assert np.abs(x - (-412.3456 + 777.7 * px)).max() <= 0.5 / 80 + 1e-6 and np.abs(y - (-333.3333 + 777.7 * py)).max() <= 0.5 / 80 + 1e-6
    assert np.abs(mx - x).max() <= 0.0006 and np.abs(my - y).max() <= 0.0006       # as reported, 3 decimals
    assert np.allclose(sorted(set(px)), np.linspace(0, 0.2, 5)) and np.allclose(sorted(set(py)), np.linspace(0, 0.1, 4))
    assert run("stagectl", "verify", path).text.startswith("20 of 20 places finished, 80 exposures on record, 0 missing")
    times = (tmp_path / "out/004_003/times.txt").read_text().splitlines()
    assert times[1:] == ["00.ppm 0.125", "01.ppm 0.25", "02.ppm 0.5", "03.ppm 1"]
    for (i, j, k), digest in shots(tmp_path / "out").items():
        assert hashlib.sha256((tmp_path / f"out/{i:03}_{j:03}/{k:02}.ppm").read_bytes()).hexdigest() == digest


def test_single_row_stands_in_the_middle(tmp_path):
    with Stage(tmp_path) as stage:
        path = session(tmp_path, grid={"nodes": "1x1"})
        run("stagectl", "--port", stage.port, "capture", path)
        assert stage.truth() == (-400, -350, 0)


def test_c4_stage(tmp_path):
    """Arrick's controller: relative half steps, no read-back; the host's count and the truth agree at the end."""
    with Stage(tmp_path, "--dialect", "c4", "--steps", "7.874016,7.874016", "--start", "12,34") as stage:
        path = session(tmp_path, stage={"driver": "c4", "origin": "10 10", "steps_per_mm": "7.874016 7.874016"})
        assert "expected c4 as in" in run("stagectl", "--driver", "grbl", "--port", stage.port, "capture", path, code=2).err
        run("stagectl", "--port", stage.port, "capture", path)
        x, y, moving = stage.truth()
        assert not moving and abs(x - 10) <= 0.5 / 7.874 and abs(y - 110) <= 0.5 / 7.874
        r = run("stagectl", "--driver", "c4", "--port", stage.port, "--steps-per-mm", "7.874016,7.874016", "move", "5", "5", code=4)
        assert "home it first" in r.err
        back = ["--driver", "c4", "--port", stage.port, "--steps-per-mm", "7.874016,7.874016", "--from", f"{x},{y}", "move", "5", "5"]
        run("stagectl", *back)
        assert np.allclose(stage.truth()[:2], (5, 5), atol=0.5 / 7.874)
    assert len(pictures(tmp_path / "out")) == 12


# ---- single commands -------------------------------------------------------------------------------------

def test_home_move_where_status(tmp_path):
    with Stage(tmp_path) as stage:
        go = lambda *a, **k: run("stagectl", "--port", stage.port, *a, **k)
        assert "not to be trusted" in go("status").text
        assert "home it first" in one_line(go("move", "-5", "-5", code=4))
        assert go("home").text == "-1.000 -1.000\n"
        assert go("move", "-12.34567", "-50").text == "-12.350 -50.000\n"    # 80 steps/mm
        assert stage.truth()[:2] == (-12.35, -50)
        assert go("where").text == "-12.350 -50.000\n"
        assert "expected x from -800 to 0 mm, found 3" in one_line(go("move", "3", "0", code=1))
        assert "would move" in run("stagectl", "--dry-run", "move", "1", "2").text


def test_dry_run_touches_nothing(tmp_path):
    path = session(tmp_path)
    out = run("stagectl", "--dry-run", "--port", "/dev/nothing", "capture", path).text
    assert "node 2,1 at -300.000 -300.000 mm: 002_001/00.ppm 002_001/01.ppm" in out and not (tmp_path / "out").exists()


# ---- ends before the end -----------------------------------------------------------------------------------

@pytest.mark.parametrize("sig, code", [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interrupt_in_a_move_keeps_the_position(tmp_path, sig, code):
    with Stage(tmp_path, factor=20) as stage:
        run("stagectl", "--port", stage.port, "home")
        r = Run("--port", stage.port, "move", "-700", "-600")
        stage.wait_moving()
        time.sleep(0.05)
        r.kill(sig)
        ended, out, err = r.end()
        assert ended == code and "interrupted" in err and not out
        x, y, speed = stage.truth()
        assert speed == 0 and -699 < x < -1.5
        status = run("stagectl", "--port", stage.port, "status").text
        assert "state       Idle" in status and "trusted" not in status
        sx, sy = map(float, re.search(r"position +(\S+) (\S+) mm", status).groups())
        assert abs(sx - x) <= 0.5 / 80 + 0.001 and abs(sy - y) <= 0.5 / 80 + 0.001


def test_a_second_interrupt_resets_at_once(fake):
    """A stage that goes on running after a hold: the first SIGINT waits for it, the second does not."""
    g = fake(stuck=True, answer=lambda s: "" if s.startswith("G4") else None)
    r = Run("--port", g.port, "move", "-10", "-10")
    while not any(s.startswith("G4") for s in g.lines):
        time.sleep(0.01)
    resets = g.resets
    r.kill(signal.SIGINT)
    time.sleep(0.5)
    assert r.process.poll() is None and g.resets == resets
    r.kill(signal.SIGINT)
    start = time.monotonic()
    assert r.end()[0] == 130 and g.resets == resets + 1 and time.monotonic() - start < SOON


def test_interrupt_in_a_session_and_resume(tmp_path):
    with Stage(tmp_path, factor=20) as stage:
        path = session(tmp_path)
        r = Run("--port", stage.port, "capture", path)
        while not list((tmp_path / "out").rglob("*.ppm")):
            time.sleep(0.02)
        stage.wait_moving()
        r.kill(signal.SIGINT)
        assert r.end()[0] == 130
        before = shots(tmp_path / "out")
        assert 0 < len(before) < 12
        run("stagectl", "--port", stage.port, "resume", path)
        after = shots(tmp_path / "out")
        assert len(after) == 12 and all(after[k] == v for k, v in before.items())


def test_sigcont_prints_one_line(tmp_path):
    with Stage(tmp_path, factor=5) as stage:
        r = Run("--port", stage.port, "capture", session(tmp_path))
        stage.wait_moving()
        r.kill(signal.SIGCONT)
        time.sleep(0.1)
        r.kill(signal.SIGINT)
        code, _, err = r.end()
        assert code == 130 and len(re.findall(r"^stagectl: place \d+/6 \(\d,\d\) \w+, \d+/12 exposures.*$", err, re.M)) == 1, err


# ---- adaptive exposures --------------------------------------------------------------------------------------

AUTO = """import sys
# pixel = radiance * seconds, clipped; two pixels: a lamp and a wall, of such radiances
out, seconds, lamp, wall = sys.argv[1], *map(float, sys.argv[2:])
code = bytes(min(255, round(255 * v * seconds)) for v in (lamp, wall))
open(out, "wb").write(b"P5\\n2 1\\n255\\n" + code)
"""


@pytest.mark.parametrize("lamp, wall", [(100, 0.1), (0.4, 0.3), (3000, 0.02), (1e-6, 1e-6), (1e6, 1e5)])
def test_auto_takes_what_the_scene_needs(tmp_path, lamp, wall):
    """Of the paper's 16 exposures: from the longest that clips nothing to the shortest that leaves nothing black."""
    camera = script(tmp_path, AUTO, "camera.py")
    path = session(tmp_path, program=f"{PYTHON} {camera} {{file}} {{seconds}} {lamp} {wall}", grid={"nodes": "3x1"})
    text = path.read_text().replace("exposures = 0.25 1", "auto = yes\ncircle = 0").replace(".ppm", ".pgm")
    path.write_text(text)
    with Stage(tmp_path) as stage:
        r = run("stagectl", "--port", stage.port, "capture", path)
    series = 2.0 ** np.arange(-14, 2)
    assert f"{48 - len(shots(tmp_path / 'out'))} left out as not needed" in r.err
    clips, black = np.round(255 * np.minimum(1, lamp * series)) >= 0.99 * 255, np.round(255 * np.minimum(1, wall * series)) <= 0.02 * 255
    first = max([k for k in range(16) if not clips[k]], default=0)
    last = min([k for k in range(16) if not black[k]], default=15)
    needed = set(range(min(first, last), max(first, last) + 1)) if last >= first else {last, first}
    for i in range(3):
        taken = {k for (a, _, k) in shots(tmp_path / "out") if a == i}
        if last >= first:
            assert needed <= taken, (needed, taken)
        assert not clips[min(taken)] or min(taken) == 0          # nothing stays clipped that need not
        assert not black[max(taken)] or max(taken) == 15         # nothing stays black that need not
        if i > 0 and last >= first:                              # from the second place on no more than one to spare
            assert len(taken) <= len(needed) + 1, (needed, taken)
        listed = (tmp_path / f"out/{i:03}_000/times.txt").read_text().splitlines()[1:]
        assert [float(s.split()[1]) for s in listed] == pytest.approx(sorted(series[k] for k in taken))


# ---- a real camera command ---------------------------------------------------------------------------------------

def test_gphoto2_and_its_virtual_nikon(tmp_path):
    """Debian's gphoto2 on the Nikon D750 that the PyPI package's vusb library plays: 3 x 3 places, 2 exposures."""
    spec = importlib.util.find_spec("gphoto2")
    vusb = Path(spec.origin).parent / "libgphoto2" / "vusb" if spec else None
    needed("gphoto2")
    assert vusb and vusb.is_dir(), "the Python package gphoto2 has no virtual camera (setup/requirements.txt)"
    roll = tmp_path / "card/DCIM/100NIKON"
    roll.mkdir(parents=True)
    from PIL import Image
    Image.fromarray(np.random.default_rng(1).integers(0, 255, (60, 80, 3)).astype("u1")).save(roll / "DSC_0001.JPG")
    env = environment(IOLIBS=str(vusb), VCAMERADIR=str(tmp_path / "card"))
    found = execute(["gphoto2", "--auto-detect"], env=env, capture_output=True, text=True)
    assert "D750" in found.stdout, "the virtual Nikon does not show up"
    # in one call the two options take 3.4 s on this camera, in two 0.6 s
    path = session(tmp_path, "gphoto2 --set-config shutterspeed={label} && "
                   "gphoto2 --capture-image-and-download --force-overwrite --filename {file}",
                   grid={"nodes": "3x3"}, camera={"shell": "yes", "exposures": "0.1 1", "labels": "0.1000s 1.0000s", "timeout": 600, "retries": 1,
                                                  "error_text": "*** Error"}, output={"file": "{i}_{j}/{k}.jpg"})
    with Stage(tmp_path) as stage:
        run("stagectl", "--port", stage.port, "capture", path, env=env)
    files = sorted((tmp_path / "out").rglob("*.jpg"))
    assert len(files) == 18 and all(Image.open(f).size == (80, 60) for f in files)
    assert "9 of 9 places finished, 18 exposures" in run("stagectl", "verify", path).text
    assert (tmp_path / "out/camera.log").read_text().count("Saving file as") == 18


def test_labels_and_error_text(tmp_path):
    camera = script(tmp_path, "#!/bin/sh\nprintf 'P6\\n1 1\\n255\\nabc' > $1; echo \"$2\" >> $0.log; [ \"$2\" != B ] || echo '*** Error ***'\n")
    path = session(tmp_path, f"{camera} {{file}} {{label}}", camera={"labels": "'1/4 s' A", "error_text": "*** Error"}, grid={"nodes": "1x1"})
    with Stage(tmp_path) as stage:
        run("stagectl", "--port", stage.port, "capture", path)
        assert (tmp_path / "camera.sh.log").read_text() == "1/4 s\nA\n"
        path = session(tmp_path, f"{camera} {{file}} {{label}}", camera={"labels": "A B", "error_text": "*** Error"}, output={"folder": "o2"})
        assert "exposure 1: camera: it said '*** Error'" in run("stagectl", "--port", stage.port, "capture", path, code=1).err
