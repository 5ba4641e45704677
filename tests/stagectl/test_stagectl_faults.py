"""stagectl when things go wrong: kill -9, faults of the line, the stage, the camera, the disk, the journal."""
import hashlib
import os
import random
import shutil
import signal
import time
from pathlib import Path

import pytest
from conftest import BUILD, command, environment, run
from process import execute
from stage_util import PYTHON, SOON, UNIQUE, Run, Stage, journal, pictures, script, session, shots


def capture(path, stage, *args, **kw):
    return run("stagectl", "--port", stage.port, *args, "capture", path, **kw)


def digests(folder):
    return {p: hashlib.sha256((Path(folder) / p).read_bytes()).hexdigest() for p in pictures(folder) if "/." not in p and p[0] != "."}


def check_whole(path, folder, n):
    """Every file exactly once under its name, as the journal has it, and nothing else."""
    recorded = {f"{i:03}_{j:03}/{k:02}.ppm": d for (i, j, k), d in shots(folder).items()}
    assert len(recorded) == n and digests(folder) == recorded
    assert not [p for p in Path(folder).iterdir() if p.name.startswith(".shot")]
    assert "0 missing or changed" in run("stagectl", "verify", path).text


# ---- kill -9 -----------------------------------------------------------------------------------------------

def records(journal):
    return journal.read_bytes().count(b"\n") if journal.is_file() else 0


def wait_for_records(r, journal, n):
    """Until the run has written so many, or has ended: however long that takes on a busy machine."""
    before = records(journal)
    while r.process.poll() is None and records(journal) < before + n:
        time.sleep(0.003)


def test_killed_at_fifty_random_instants(tmp_path):
    """Each picture is of its own (random bytes): one that was finished and taken again would show."""
    rng = random.Random(2003)
    folder = tmp_path / "out"
    slow = script(tmp_path, UNIQUE.replace("{ printf", "sleep 0.0$(($$ % 3))\n{ printf"))
    path = session(tmp_path, f"{slow} {{file}} {{i}},{{j}},{{k}}", grid={"nodes": "14x12"}, camera={"exposures": "1/8 1/4 1/2 1"})
    finished, where = {}, set()
    with Stage(tmp_path, factor=400) as stage:
        kills = 0
        while kills < 50:
            r = Run("--port", stage.port, "capture", path)
            if rng.random() < 0.8:      # else anywhere, while it starts
                wait_for_records(r, folder / "journal", rng.randint(1, 12))
            time.sleep(rng.uniform(0, 0.03))
            r.kill(signal.SIGKILL)
            code = r.end()[0]
            assert code in (-9, 0), code
            if code == 0:
                break
            kills += 1
            if not (folder / "journal").is_file():
                continue
            text = (folder / "journal").read_bytes()
            if not text.endswith(b"\n"):
                text = text[:text.rfind(b"\n") + 1]
            words = [line[9:].decode().split() for line in text.splitlines()]
            where.add(words[-1][0])
            now = {tuple(map(int, w[1:4])): w[6] for w in words if w[0] == "shot"}
            for key, digest in finished.items():
                assert now[key] == digest, f"{key} was finished and taken again"
            finished = now
        assert kills == 50, f"the session was over after {kills} kills"
        assert len(where & {"begin", "arrived", "shot", "run", "done"}) >= 3, where
        capture(path, stage)
    after = shots(folder)
    assert all(after[k] == v for k, v in finished.items())
    check_whole(path, folder, 672)
    records = [tuple(r[1:4]) for r in journal(folder) if r[0] == "shot"]
    assert len(records) == len(set(records)) == 672


def test_killed_between_journal_and_rename(tmp_path):
    """A recorded exposure whose rename never came is there, under its temporary name: it is not taken again."""
    folder, path = tmp_path / "out", session(tmp_path)
    with Stage(tmp_path) as stage:
        capture(path, stage)
        before = shots(folder)
        record = [r for r in journal(folder) if r[0] == "shot"][3]
        (folder / record[10]).rename(folder / record[9])
        (folder / ".shot-1-99.ppm").write_bytes(b"left over")
        capture(path, stage)
    assert shots(folder) == before
    check_whole(path, folder, 12)


def test_nothing_moves_while_an_orphaned_camera_exposes(tmp_path):
    """stagectl is killed; what its camera started lives on.  The next run waits for it."""
    camera = script(tmp_path, f"""#!/bin/sh
if [ ! -e {tmp_path}/once ]; then touch {tmp_path}/once; setsid sh -c 'sleep 1.5; touch {tmp_path}/over' & sleep 5; fi
printf 'P6\\n1 1\\n255\\nabc' > "$1"
""")
    path = session(tmp_path, f"{camera} {{file}}", grid={"nodes": "2x1"})
    with Stage(tmp_path) as stage:
        r = Run("--port", stage.port, "capture", path)
        while not (tmp_path / "once").exists():
            time.sleep(0.01)
        time.sleep(0.05)
        r.kill(signal.SIGKILL)
        r.end()
        at = stage.truth()
        r = Run("--port", stage.port, "capture", path)
        while r.process.poll() is None and not (tmp_path / "over").exists():
            assert stage.truth() == at
            time.sleep(0.02)
        code, _, err = r.end()
        assert code == 0 and "waiting for it" in err and (tmp_path / "over").exists()


# ---- line and stage --------------------------------------------------------------------------------------------

def test_unplugged_in_a_move_is_reported_soon(tmp_path):
    with Stage(tmp_path, factor=5) as stage:
        r = Run("--port", stage.port, "capture", session(tmp_path))
        stage.wait_moving()
        while stage.truth()[0] > -100:      # past homing, on the way to the first node
            time.sleep(0.02)
        stage.process.kill()
        start = time.monotonic()
        code, _, err = r.end()
        assert code == 3 and "disconnected" in err and time.monotonic() - start < SOON


@pytest.mark.parametrize("fault, code, words", [
    ("alarm1@3", 4, "ALARM:1 (hard limit"), ("alarm3@3", 4, "ALARM:3 (reset while in motion"), ("error9@3", 4, "error:9 (locked"),
    ("reboot@3", 4, "the controller restarted while moving"), ("unplug@3", 3, "disconnected while moving"),
    ("silence@3", 3, "no answer while moving")])
def test_faults_in_a_move_then_resume(tmp_path, fault, code, words):
    """In words, with their code; and the next run homes, goes on and finishes."""
    path, folder = session(tmp_path), tmp_path / "out"
    with Stage(tmp_path, "--fault", fault, factor=100) as stage:
        r = capture(path, stage, code=code)
        assert words in r.err, r.err
        before = shots(folder)
        if fault.split("@")[0] in ("alarm1", "alarm3", "error9", "reboot"):
            capture(path, stage)        # the same controller goes on
    if not (folder / "002_001/01.ppm").exists():
        with Stage(tmp_path) as stage:
            capture(path, stage)
    assert all(shots(folder)[k] == v for k, v in before.items())
    check_whole(path, folder, 12)


def test_a_rebooted_controller_while_exposing_spoils_the_exposure(tmp_path):
    """Power fails under the camera: the picture is not kept."""
    from stage_util import FakeGrbl
    g = FakeGrbl()
    os.mkfifo(tmp_path / "go")
    camera = script(tmp_path, f"#!/bin/sh\n[ \"$2\" = 1,0,0 ] && {{ : > {tmp_path}/asked; read x < {tmp_path}/go; }}\n" + UNIQUE.split("\n", 1)[1])
    path = session(tmp_path, f"{camera} {{file}} {{i}},{{j}},{{k}}", stage={"origin": "-150 -150", "unit_mm": 100})
    try:
        r = Run("--port", g.port, "capture", path)
        while not (tmp_path / "asked").exists():
            time.sleep(0.01)
        g.say("\r\nGrbl 1.1f ['$' for help]\r\n")
        (tmp_path / "go").write_text("x\n")
        code, _, err = r.end()
    finally:
        g.close()
    assert code == 4 and "restarted while exposing" in err and (1, 0, 0) not in shots(tmp_path / "out")


def test_no_controller_there(tmp_path):
    with Stage(tmp_path, "--deaf") as stage:
        start = time.monotonic()
        r = run("stagectl", "--port", stage.port, "home", code=3)
        assert "no answer" in r.err and time.monotonic() - start < SOON
    assert "expected a serial port" in run("stagectl", "--port", "/dev/null", "home", code=1).err
    assert "No such file" in run("stagectl", "--port", tmp_path / "none", "home", code=1).err


def test_slipped_steps_are_noticed_where_they_can_be(tmp_path):
    """Lost steps are invisible to the controller: the next run homes and stands right again."""
    path = session(tmp_path, grid={"nodes": "2x1"})
    with Stage(tmp_path, "--fault", "slip@1") as stage:
        capture(path, stage)
        assert abs(stage.truth()[0] - -300) > 1
        run("stagectl", "--port", stage.port, "home")
        assert stage.truth()[:2] == (-1, -1)


def test_one_at_a_time(tmp_path):
    with Stage(tmp_path, factor=5) as stage:
        path = session(tmp_path)
        r = Run("--port", stage.port, "capture", path)
        stage.wait_moving()
        other = run("stagectl", "--port", stage.port, "where", code=1)
        assert "in use by another program" in other.err
        again = run("stagectl", "--port", stage.port, "capture", path, code=1)
        assert "in use by another stagectl" in again.err
        r.kill(signal.SIGKILL)      # liveness is a lock: nothing is left to clean up
        r.end()
        run("stagectl", "--port", stage.port, "where")


def test_the_line_gets_its_settings_back(tmp_path):
    import termios
    with Stage(tmp_path) as stage:
        fd = os.open(stage.port, os.O_RDWR | os.O_NOCTTY)
        before = termios.tcgetattr(fd)
        before[3] |= termios.ECHOE
        termios.tcsetattr(fd, termios.TCSANOW, before)
        before = termios.tcgetattr(fd)
        run("stagectl", "--port", stage.port, "home")
        assert termios.tcgetattr(fd) == before
        os.close(fd)


# ---- camera ------------------------------------------------------------------------------------------------------

GOOD = "printf 'P6\\n1 1\\n255\\nabc' > \"$1\"\n"


@pytest.mark.parametrize("body, words", [
    ("exit 0", "wrote no file"), (": > \"$1\"", "its file is empty"), ("printf 'P6\\n9 9\\n255\\nabc' > \"$1\"", "expected 254 bytes"),
    ("mkdir \"$1\"", "wrote no file"), ("ln -s /etc/passwd \"$1\"", "wrote no file"),
    ("echo lens stuck >&2; exit 7", "exit code 7: lens stuck"), ("kill -SEGV $$", "ended by signal 11"),
    ("head -c 40 \"$0.png\" > \"$1\"", "truncated PNG"), ("printf nonsense > \"$1\"", "")])
def test_a_failed_camera_stops_the_session(tmp_path, body, words):
    from stage_util import png
    import numpy as np
    camera = script(tmp_path, f"#!/bin/sh\n{body}\n")
    Path(f"{camera}.png").write_bytes(png(np.zeros((4, 4, 3), np.uint8)))
    path = session(tmp_path, f"{camera} {{file}}")
    with Stage(tmp_path) as stage:
        r = capture(path, stage, code=1)
    assert "node 0,0 exposure 0" in r.err and words in r.err
    assert not pictures(tmp_path / "out") and not shots(tmp_path / "out")


def test_a_camera_that_is_not_there(tmp_path):
    path = session(tmp_path, "no-such-camera-program {file}")
    with Stage(tmp_path) as stage:
        assert "no-such-camera-program: No such file" in capture(path, stage, code=1).err


@pytest.mark.parametrize("body", ["sleep 600", "trap '' TERM; sleep 600 & wait; sleep 600", "(trap '' TERM; sleep 601) & sleep 600"])
def test_a_camera_that_hangs_is_ended_with_all_its_children(tmp_path, body):
    camera = script(tmp_path, f"#!/bin/sh\necho $$ >> {tmp_path}/pids\n{body}\n")
    path = session(tmp_path, f"{camera} {{file}}", camera={"exposures": "0.1", "timeout": 0.3, "kill_after": 0.2})
    with Stage(tmp_path) as stage:
        start = time.monotonic()
        r = capture(path, stage, code=1)
        assert "not done after 0.4 s" in r.err and time.monotonic() - start < SOON
    group = (tmp_path / "pids").read_text().split()[0]
    left = execute(["ps", "-o", "pid=,stat=", "-g", group], capture_output=True, text=True).stdout.split("\n")
    assert not [s for s in left if s and "Z" not in s]


def test_an_interrupt_ends_the_camera_too(tmp_path):
    camera = script(tmp_path, f"#!/bin/sh\necho $$ >> {tmp_path}/pids\nsleep 60\n")
    path = session(tmp_path, f"{camera} {{file}}")
    with Stage(tmp_path) as stage:
        r = Run("--port", stage.port, "capture", path)
        while not (tmp_path / "pids").exists():
            time.sleep(0.01)
        r.kill(signal.SIGINT)
        assert r.end()[0] == 130
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pids").read_text()), 0)


def test_retries(tmp_path):
    camera = script(tmp_path, f"#!/bin/sh\nif [ ! -e {tmp_path}/tried ]; then touch {tmp_path}/tried; exit 3; fi\n{GOOD}")
    path = session(tmp_path, f"{camera} {{file}}", camera={"retries": 1})
    with Stage(tmp_path) as stage:
        r = capture(path, stage)
    assert "exit code 3; trying again" in r.err and len(pictures(tmp_path / "out")) == 12


def test_names_with_blanks_and_quotes_are_safe_in_a_shell(tmp_path):
    folder = tmp_path / "it's a; folder"
    folder.mkdir()
    path = session(folder, "printf 'P6\\n1 1\\n255\\n%.3s' abc > {file}", camera={"shell": "yes"}, grid={"nodes": "1x1"})
    with Stage(tmp_path) as stage:
        capture(path, stage)
    assert len(pictures(folder / "out")) == 2


# ---- files and journal -----------------------------------------------------------------------------------------------

def test_journal_torn_anywhere_in_its_last_record(tmp_path):
    folder, path = tmp_path / "out", session(tmp_path, grid={"nodes": "1x1"}, camera={"exposures": 1})
    with Stage(tmp_path, factor=1000) as stage:
        capture(path, stage)
        whole = (folder / "journal").read_bytes()
        lines = whole.splitlines(keepends=True)
        first = next(n for n, s in enumerate(lines) if s[9:].startswith(b"run"))
        rng = random.Random(6)
        for n in range(first, len(lines)):
            cut = rng.randrange(1, len(lines[n]))
            (folder / "journal").write_bytes(b"".join(lines[:n]) + lines[n][:cut])
            if n <= next(k for k, s in enumerate(lines) if s[9:].startswith(b"shot")):
                shutil.rmtree(folder / "000_000", ignore_errors=True)   # what isn't on record wasn't finished
            assert "torn" in capture(path, stage).err
            check_whole(path, folder, 1)


def test_damage_in_the_middle_is_refused(tmp_path):
    folder, path = tmp_path / "out", session(tmp_path, grid={"nodes": "1x1"})
    with Stage(tmp_path) as stage:
        capture(path, stage)
        text = (folder / "journal").read_bytes()
        at = text.index(b"begin")
        (folder / "journal").write_bytes(text[:at] + b"B" + text[at + 1:])
        r = capture(path, stage, code=1)
        assert "is damaged" in r.err and "line " in r.err
        (folder / "journal").write_bytes(b"something else\nmore\n")
        assert "expected 'stagectl-journal 1'" in capture(path, stage, code=1).err
        (folder / "journal").write_bytes(b"")
        assert "found an empty file" in capture(path, stage, code=1).err


@pytest.mark.parametrize("section, key, value", [("grid", "nodes", "3x3"), ("grid", "plane", "0 0 0 0.3 0 0 0 0.1 0"), ("grid", "order", "raster"),
                                                 ("camera", "exposures", "0.25 2"), ("camera", "command", "other {file}"),
                                                 ("stage", "origin", "-500 -401"), ("stage", "backlash", "0 0")])
def test_a_changed_plan_is_refused(tmp_path, section, key, value):
    path = session(tmp_path)
    with Stage(tmp_path) as stage:
        capture(path, stage)
        session(tmp_path, **{section: {key: value}})
        r = capture(path, stage, code=1)
        assert f"the plan has changed: {section}.{key} was" in r.err
        session(tmp_path, stage={"feed": 3000, "settle": 0})       # no matter
        capture(path, stage)


def test_another_stage_is_refused(tmp_path):
    path = session(tmp_path)
    with Stage(tmp_path) as stage:
        capture(path, stage)
    (tmp_path / "out/000_000/00.ppm").unlink()
    with Stage(tmp_path, "--steps", "100,100") as stage:
        assert "expected 80 x 80 steps/mm" in capture(path, stage, code=1).err


def test_missing_and_changed_files_are_taken_again_foreign_ones_kept(tmp_path):
    folder, path = tmp_path / "out", session(tmp_path)
    with Stage(tmp_path) as stage:
        capture(path, stage)
        before = shots(folder)
        (folder / "001_000/01.ppm").unlink()
        changed = folder / "002_001/00.ppm"
        changed.write_bytes(changed.read_bytes()[:-1] + b"?")
        r = run("stagectl", "verify", path, code=1)
        assert "2 missing or changed" in r.text and "001_000/01.ppm: missing" in r.err and "not as it was taken" in r.err
        r = capture(path, stage)
        assert "2 taken now" in r.err
        after = shots(folder)
        assert {k for k in after if after[k] != before[k]} == {(1, 0, 1), (2, 1, 0)}
        check_whole(path, folder, 12)
    other = session(tmp_path, name="other.conf", output={"folder": "out2"})
    (tmp_path / "out2/000_000").mkdir(parents=True)
    (tmp_path / "out2/000_000/00.ppm").write_bytes(b"dear to someone")
    with Stage(tmp_path) as stage:
        assert "is there already and not from this session" in capture(other, stage, code=1).err
    assert (tmp_path / "out2/000_000/00.ppm").read_bytes() == b"dear to someone"


def test_lost_times_file_is_written_again(tmp_path):
    path = session(tmp_path, grid={"nodes": "1x1"})
    with Stage(tmp_path) as stage:
        capture(path, stage)
        times = tmp_path / "out/000_000/times.txt"
        text = times.read_text()
        times.unlink()
        capture(path, stage)
        assert times.read_text() == text


def test_without_homing_a_resume_needs_a_word(tmp_path):
    path = session(tmp_path, stage={"home": "no", "origin": "20 20"})
    with Stage(tmp_path, "--no-homing", factor=20) as stage:
        r = Run("--port", stage.port, "capture", path)
        while not pictures(tmp_path / "out"):
            time.sleep(0.01)
        r.kill(signal.SIGINT)
        assert r.end()[0] == 130
        assert "--assume-position" in capture(path, stage, code=1).err
        capture(path, stage, "--assume-position")
    check_whole(path, tmp_path / "out", 12)


def test_folder_that_can_not_be_written(tmp_path):
    where = "/proc/stagectl-out" if os.geteuid() == 0 else str(tmp_path / "locked" / "out")
    (tmp_path / "locked").mkdir()
    (tmp_path / "locked").chmod(0o555)
    path = session(tmp_path, output={"folder": where})
    with Stage(tmp_path) as stage:
        at = stage.truth()
        r = capture(path, stage, code=1)
        assert where in r.err and stage.truth() == at      # nothing moved for nothing


def test_disk_full_then_resume(tmp_path):
    """On a file system of 64 kB, mounted in a name space of its own; then it grows."""
    if execute(["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/mnt"], capture_output=True).returncode != 0:
        pytest.skip("a small file system can't be mounted here (unshare -rm)")
    small = tmp_path / "small"
    small.mkdir()
    camera = script(tmp_path, "#!/bin/sh\n{ printf 'P6\\n50 40\\n255\\n'; head -c 6000 /dev/urandom; } > \"$1\"\n")
    path = session(tmp_path, f"{camera} {{file}}", output={"folder": small / "out"}, camera={"file_mb": 0.006})
    with Stage(tmp_path) as stage:
        go = " ".join(command("stagectl", ["--port", stage.port, "capture", path]))
        r = execute(["unshare", "-rm", "bash", "-c", f"""
            mount -t tmpfs -o size=64k none {small}; {go}; echo first $?; cp -a {small}/out {tmp_path}/before
            mount -o remount,size=1m {small}; {go}; echo second $?; {command('stagectl', [])[0]} verify {path}
            cp -a {small}/out {tmp_path}/after"""], capture_output=True, text=True, env=environment())
    assert "first 1\n" in r.stdout and "second 0\n" in r.stdout and "12 exposures on record, 0 missing" in r.stdout, r
    assert "0.1 MB free, the rest may need 0.1 MB" in r.stderr and "camera: exit code 1" in r.stderr
    before, after = shots(tmp_path / "before"), shots(tmp_path / "after")
    assert 0 < len(before) < 12 and all(after[k] == v for k, v in before.items())


def test_disk_full_in_the_journal(tmp_path):
    """A limit on file size stands in for a full disk at the journal itself: no half record stays behind."""
    path, folder = session(tmp_path), tmp_path / "out"
    with Stage(tmp_path) as stage:
        shell = "ulimit -f 3; trap '' XFSZ; exec \"$@\""      # 512-byte blocks or 1 kB: the journal needs more
        r = execute(["bash", "-c", shell, "-", *command("stagectl", ["--port", stage.port, "capture", path])],
                    capture_output=True, text=True, env=environment())
        assert r.returncode == 1 and "journal" in r.stderr and "File too large" in r.stderr
        assert (folder / "journal").read_bytes().endswith(b"\n") and journal(folder)
        capture(path, stage)
    check_whole(path, folder, 12)


# ---- a day in fast time ------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("nodes", ["6x5", pytest.param("30x30", marks=pytest.mark.sweep)])
def test_a_day_long_session(tmp_path, nodes):
    """The paper's 16 exposures at each node with a camera that copies a file.  ILF_SWEEP=1 runs all 14,400.  Prints what
    an exposure costs; the journal's size and the memory are checked."""
    import numpy as np
    from stage_util import png
    n, m = map(int, nodes.split("x"))
    source = tmp_path / "source.png"
    source.write_bytes(png(np.random.default_rng(1).integers(0, 256, (64, 64, 3), np.uint8)))
    path = session(tmp_path, f"cp {source} {{file}}", grid={"nodes": nodes}, stage={"settle": 0.1},
                   camera={"exposures": "from 1/16384 to 2 step 1"}, output={"file": "{i:03}_{j:03}/{k:02}.png"})
    folder = tmp_path / "out"
    total = n * m * 16
    start = time.monotonic()
    for _ in range(20):
        execute(["cp", source, tmp_path / "copy.png"], check=True)
    one_copy = (time.monotonic() - start) / 20
    with Stage(tmp_path, factor=5000) as stage:
        r = Run("--port", stage.port, "capture", path)
        memory = []
        start = time.monotonic()
        while r.process.poll() is None:
            status = Path(f"/proc/{r.process.pid}/status").read_text()
            memory += [int(s.split()[1]) for s in status.splitlines() if s.startswith("VmRSS")]
            time.sleep(0.05)
        took = time.monotonic() - start
        assert r.end()[0] == 0
        start = time.monotonic()
        capture(path, stage)
        resume = time.monotonic() - start
    size = (folder / "journal").stat().st_size
    print(f"\n{total} exposures in {took:.1f} s: {took / total * 1000:.2f} ms each, of which a cp {one_copy * 1000:.2f} ms; "
          f"resume {resume:.2f} s; journal {size / 1e6:.2f} MB; memory {memory[len(memory) // 4]} to {max(memory)} kB")
    assert size <= 5e6 * total / 14400 + 4000
    assert max(memory) < (30000 if "san" not in BUILD.parts else 300000)      # freed memory is kept for a while by ASan
    assert len(list(folder.rglob("*.png"))) == total
    assert "0 missing or changed" in run("stagectl", "verify", path).text
