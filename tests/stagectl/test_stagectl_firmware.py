"""stagectl against what real firmware does: alarms that throw resets away, answers lost and answers too many, states with
names, controllers that restarted, switches, lost steps, other lines.  The virtual stage plays them; nothing is taken on
its word: where it truly stands and whether it moves is asked of its own side."""
import os
import re
import signal
import socket
import subprocess
import threading
import time

import numpy as np
import pytest
from conftest import command, environment, run
from stage_util import SOON, Run, Stage, asking_camera, fake, journal, pictures, session, shots      # noqa: F401  (fake is a fixture)


def go(stage, *args, **kw):
    return run("stagectl", "--port", stage.port, *args, **kw)


def stands(stage, seconds=0.4):
    """It is told nothing more and does not move."""
    a = stage.truth()
    time.sleep(seconds)
    b = stage.truth()
    return a == b and b[2] == 0


# ---- every end stops the stage -----------------------------------------------------------------------------

def test_homing_that_takes_too_long_is_stopped(tmp_path):
    with Stage(tmp_path, "--start", "-700,-600", factor=2) as stage:
        r = go(stage, "--home-timeout", 1, "home", code=3)
        assert "not done after 1 s" in r.err and "may take" in r.err and stands(stage)
        x, y, _ = stage.truth()
        assert x < -100 and y < -100      # stopped on the way, not at its end


@pytest.mark.parametrize("sig, code", [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interrupted_homing_is_stopped(tmp_path, sig, code):
    with Stage(tmp_path, "--start", "-700,-600", factor=2) as stage:
        r = Run("--port", stage.port, "home")
        stage.wait_moving()
        r.kill(sig)
        assert r.end()[0] == code and stands(stage)


def test_homing_has_the_time_that_the_settings_need(tmp_path, fake):
    """A slow stage: 200 mm at $25=100 mm/min take 3 minutes for the search alone, and the words say so."""
    slow = ["$10=1", "$22=1", "$24=50", "$25=100", "$26=250", "$27=1", "$100=80", "$101=80", "$110=500", "$111=500", "$120=10", "$121=10",
            "$130=200", "$131=200"]
    g = fake(settings=slow, answer=lambda s: "" if s == "$H" else None)
    g.state = "Home"
    r = Run("--port", g.port, "--home-timeout", 1, "home")

    def homes():
        while not g.stopped:
            if "$H" in g.lines:
                g.state = "Home"
            time.sleep(0.01)
    g.state = "Idle"
    threading.Thread(target=homes, daemon=True).start()
    code, _, err = r.end()
    needs = float(re.search(r"may take (\d+) s", err).group(1))
    assert code == 3 and needs > 2 * 1.5 * 200 / (100 / 60), err


def test_an_ok_too_many_does_not_end_homing(fake):
    """The firmware says Home for a second after a stray ok."""
    g = fake()
    began = []

    def answer(line):
        if line == "$H":
            began.append(time.monotonic())
            g.state = "Home"

            def end():
                time.sleep(1)
                g.at, g.state = [-1.0, -1.0], "Idle"
                g.say("ok\r\n")
            threading.Thread(target=end, daemon=True).start()
            return "ok\r\n"
        return None
    g.answer = answer
    assert run("stagectl", "--port", g.port, "home").text == "-1.000 -1.000\n"
    assert time.monotonic() - began[0] >= 1


@pytest.mark.parametrize("what", ["answer", "command"])
def test_a_lost_answer_to_homing_is_not_taken_for_homing(fake, what):
    """Idle without an ok: the answer was lost, or the command.  It is done again; what the stage did not do is not said."""
    g = fake()
    g.at = [-77.0, -66.0]
    seen = []

    def answer(line):
        if line != "$H":
            return None
        seen.append(line)
        if len(seen) == 1:
            if what == "answer":
                g.at = [-1.0, -1.0]
            return "o~\r\n"
        return None
    g.answer = answer
    r = run("stagectl", "--port", g.port, "home")
    assert r.text == "-1.000 -1.000\n" and len(seen) == 2 and "homing again" in r.err
    g.answer = lambda line: "o~\r\n" if line == "$H" else None
    assert "twice" in run("stagectl", "--port", g.port, "home", code=4).err


@pytest.mark.parametrize("fault", ["stray@1", "garble@1"])
def test_answers_lost_and_answers_too_many(tmp_path, fault):
    with Stage(tmp_path, "--fault", fault, factor=20) as stage:
        go(stage, "home")
        r = go(stage, "move", "-300", "-200")
        assert r.text == "-300.000 -200.000\n" and stage.truth() == (-300, -200, 0)
        assert ("an answer was lost" in r.err) == fault.startswith("garble")


@pytest.mark.parametrize("fault", ["stray@2", "stray@4", "garble@3", "garble@6"])
def test_a_session_survives_them(tmp_path, fault):
    with Stage(tmp_path, "--fault", fault, factor=50) as stage:
        path = session(tmp_path, asking_camera(tmp_path, stage, "{i},{j}"), camera={"exposures": 1})
        go(stage, "capture", path)
    lines = np.loadtxt(tmp_path / "where")
    assert len(lines) == 6 and not lines[:, 4].any()
    assert np.abs(lines[:, 2] - (-500 + 100 * lines[:, 0])).max() < 0.01 and np.abs(lines[:, 3] - (-400 + 100 * lines[:, 1])).max() < 0.01


# ---- states ------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("fault, name, kept", [("hold@1", "Hold", True), ("door@1", "Door", True), ("sleep@1", "Sleep", False), ("check@1", "Check", True)])
def test_states_are_named(tmp_path, fault, name, kept):
    with Stage(tmp_path, "--fault", fault, factor=20) as stage:
        go(stage, "home")
        r = go(stage, "move", "-300", "-200", code=4)
        assert f"state {name}" in r.err and "no answer" not in r.err and "lost" not in r.err and stands(stage)
        status = go(stage, "status").text
        assert ("not to be trusted" not in status) == kept
        if kept:
            assert go(stage, "move", "-300", "-200").text == "-300.000 -200.000\n"


@pytest.mark.parametrize("fault", ["hold@3", "check@3"])
def test_a_session_goes_on_after_a_hold(tmp_path, fault):
    with Stage(tmp_path, "--fault", fault, factor=50) as stage:
        path = session(tmp_path)
        r = go(stage, "capture", path, code=4)
        assert "state" in r.err and "its position is lost" not in r.err
        go(stage, "capture", path)
    assert len(shots(tmp_path / "out")) == 12


def test_nothing_is_called_lost_that_was_never_known(tmp_path):
    with Stage(tmp_path) as stage:
        r = go(stage, "capture", session(tmp_path, stage={"origin": "500 0"}), code=1)
        assert "expected x from" in r.err and "lost" not in r.err


def test_the_reset_after_an_alarm_is_not_thrown_away(tmp_path):
    """Resets within half a second of a critical alarm are; at one simulated second in one of ours."""
    with Stage(tmp_path, "--fault", "alarm1@1", "--no-homing", "--start", "-20,-20", factor=1) as stage:
        r = go(stage, "move", "-5", "-5", code=4)
        assert "ALARM:1" in r.err and "no answer" not in r.err
        start = time.monotonic()
        status = go(stage, "status").text          # at once: it was reset
        assert "state       Alarm" in status and time.monotonic() - start < SOON


def test_a_dead_controller_is_noticed_in_a_long_move(tmp_path):
    with Stage(tmp_path, "--no-homing", "--fault", "silence@1", "--start", "-700,-700", factor=1) as stage:
        start = time.monotonic()
        r = go(stage, "--feed", 600, "move", "60", "0", code=3)      # 6 s; dead after 3
        assert "no answer while moving" in r.err and time.monotonic() - start < SOON


# ---- alarms and positions --------------------------------------------------------------------------------------

def test_unlock(tmp_path):
    with Stage(tmp_path, "--no-homing", "--fault", "alarm3@1", factor=20) as stage:
        go(stage, "move", "-300", "-200", code=4)
        for words in (["move", "-1", "-1"], ["home"], ["capture", session(tmp_path, stage={"home": "no", "origin": "0 0"})]):
            r = go(stage, *words, code=4)
            assert "stagectl unlock" in r.err, r.err
        assert not pictures(tmp_path / "out")
        r = go(stage, "unlock")
        assert "on your word" in r.err and re.fullmatch(r"\S+ \S+\n", r.text)
        assert "Idle" in go(stage, "status").text
        assert go(stage, "move", "-1", "-1").text == "-1.000 -1.000\n"
    assert "would unlock" in run("stagectl", "--dry-run", "unlock").text


def test_assumed_position_is_compared(tmp_path):
    """Interrupted: where it stands is on record.  Killed: it stands on its way.  Restarted: refused, again and again."""
    path = session(tmp_path, stage={"home": "no", "origin": "20 20"}, camera={"exposures": "0.25"})
    with Stage(tmp_path, "--no-homing", factor=10) as stage:
        r = Run("--port", stage.port, "capture", path)
        while not pictures(tmp_path / "out"):
            time.sleep(0.01)
        stage.wait_moving()
        r.kill(signal.SIGINT)
        assert r.end()[0] == 130 and [x for x in journal(tmp_path / "out") if x[0] == "stopped"]
        r = Run("--port", stage.port, "--assume-position", "capture", path)
        while len(pictures(tmp_path / "out")) < 3:
            assert r.process.poll() is None, r.end()
            time.sleep(0.01)
        stage.wait_moving()
        r.kill(signal.SIGKILL)
        r.end()
    with Stage(tmp_path, "--no-homing") as stage:      # another start: it counts from 0 where it stands
        for _ in range(2):
            r = go(stage, "--assume-position", "capture", path, code=4)
            assert "counts from another zero" in r.err and "stagectl move" in r.err
        last = [x for x in journal(tmp_path / "out") if x[0] in ("arrived", "stopped")][-1][-2:]
        go(stage, "move", *last)                    # its zero is right again, says the user
        go(stage, "--assume-position", "capture", path)
    assert len(shots(tmp_path / "out")) == 6


def test_a_killed_run_may_be_assumed_on_its_way(tmp_path):
    path = session(tmp_path, stage={"home": "no", "origin": "20 20"}, camera={"exposures": "0.25"})
    with Stage(tmp_path, "--no-homing", factor=5) as stage:
        for n in (1, 3):
            r = Run("--port", stage.port, *(["--assume-position"] if n > 1 else []), "capture", path)
            while len(pictures(tmp_path / "out")) < n:
                assert r.process.poll() is None, r.end()
                time.sleep(0.01)
            stage.wait_moving()
            r.kill(signal.SIGKILL)
            r.end()
        go(stage, "--assume-position", "capture", path)
    assert len(shots(tmp_path / "out")) == 6


# ---- settings ------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("ms, warns", [(25, True), (0, True), (254, True), (255, False)])
def test_motors_without_current(tmp_path, ms, warns):
    with Stage(tmp_path, "--idle-delay", ms) as stage:
        r = go(stage, "status")
        assert ("$1=255" in r.err) == warns and ("stay on" in r.text) != warns
        r = go(stage, "capture", session(tmp_path, grid={"nodes": "1x1"}))
        assert r.err.count(f"$1={ms}:") == warns


@pytest.mark.parametrize("direction", [0, 1, 2, 3])
@pytest.mark.parametrize("hard", [False, True])
def test_travel_keeps_off_the_switch(tmp_path, direction, hard):
    """Every corner of what is called travel can be gone to; with $21=1 none of them is an alarm."""
    with Stage(tmp_path, "--home-direction", direction, *(["--hard-limits"] if hard else []), factor=1000) as stage:
        text = go(stage, "status").text
        x0, x1, y0, y1 = map(float, re.search(r"travel +x (\S+) to (\S+), y (\S+) to (\S+) mm", text).groups())
        low = [direction & 1, direction >> 1 & 1]
        for (a, b), at_low in zip(((x0, x1), (y0, y1)), low):
            assert (a, b) == ((-800 + hard, 0) if at_low else (-800, -hard if hard else 0))
        go(stage, "home")
        for corner in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)):
            go(stage, "--feed", 6000, "--settle", 0, "move", *corner)
        if hard:
            outside = x0 - 0.5 if low[0] else x1 + 0.5
            assert "$21" in go(stage, "move", outside, y0, code=1).err
            path = session(tmp_path, stage={"origin": f"{outside - 0.1} -300", "unit_mm": 1})
            assert "$21=1" in go(stage, "capture", path, code=1).err
            assert "$21=1" in go(stage, "plan", path, code=1).err


def test_homing_of_single_axes(tmp_path):
    with Stage(tmp_path, "--z-first", "--single-axis") as stage:
        r = go(stage, "home", code=4)
        assert "ALARM:9" in r.err and "$HX $HY" in r.err
        assert go(stage, "--homing", "$HX $HY", "home").text == "-1.000 -1.000\n" and stage.truth() == (-1, -1, 0)
        go(stage, "capture", session(tmp_path, stage={"homing": "$HX $HY"}))
    with Stage(tmp_path, "--z-first") as stage:
        assert "no single axes" in go(stage, "--homing", "$HX $HY", "home", code=4).err
    assert len(shots(tmp_path / "out")) == 12
    for bad in ("G28", "$X", "$HXY", ""):
        assert "homing" in run("stagectl", "plan", session(tmp_path, stage={"homing": bad}), code=1).err


# ---- lost steps --------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("args", [[], ["--no-soft-limits"], ["--no-soft-limits", "--hard-limits"], ["--home-direction", "1"]])
def test_lost_steps_are_found(tmp_path, args):
    """2 mm lost in x at a known move: said once, with the places since the last look; what follows is right again."""
    with Stage(tmp_path, *args, factor=2000) as stage:
        path = session(tmp_path, asking_camera(tmp_path, stage, "{i},{j}"), grid={"nodes": "4x1", "plane": "0 0 0  0.3 0 0  0 0.1 0"},
                       camera={"exposures": 1}, stage={"check_home": 2, "settle": 0, "origin": "-500 -400"})
        assert "drifted" not in go(stage, "capture", path).err
    lines = np.loadtxt(tmp_path / "where")
    assert len(lines) == 4 and np.abs(lines[:, 2] - (-500 + 100 * lines[:, 0])).max() < 0.01
    # slips come with the N-th move; it is found whichever it is
    for n in (120, 150):
        folder = tmp_path / str(n)
        folder.mkdir()
        with Stage(folder, "--fault", f"slip@{n}", *args, factor=2000) as stage:
            path = session(folder, asking_camera(folder, stage, "{i},{j}"), grid={"nodes": "40x1", "plane": "0 0 0  0.3 0 0  0 0.1 0"},
                           camera={"exposures": 1}, stage={"check_home": 20, "settle": 0, "origin": "-500 -400"})
            r = go(stage, "capture", path)
        lines = np.loadtxt(folder / "where")
        off = {int(i) for i, j, x, *_ in lines if abs(x - (-500 + 300 / 39 * i)) > 0.01}
        told = re.search(r"x has drifted .*: the 20 places from (\d+),0 to (\d+),0", r.err)
        if off:
            assert told, (n, off, r.err)
            assert off <= set(range(int(told[1]), int(told[2]) + 1))
        if told and "has drifted by" in r.err:
            assert "by 2.0" in r.err or "by 1.9" in r.err, r.err


def test_looking_for_lost_steps_needs_homing(tmp_path):
    assert "home = yes" in run("stagectl", "plan", session(tmp_path, stage={"check_home": 2, "home": "no"}), code=1).err
    with Stage(tmp_path, factor=2000) as stage:       # without homing at the start it has nothing to compare with but homing itself
        go(stage, "home")
        r = go(stage, "--assume-position", "capture", session(tmp_path, stage={"check_home": 4, "settle": 0}))
        assert "doubt" not in r.err and len(shots(tmp_path / "out")) == 12


# ---- other lines ---------------------------------------------------------------------------------------------------

class Bridge(threading.Thread):
    """A terminal server: a TCP port in front of a stage's terminal."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.server = socket.create_server(("127.0.0.1", 0))
        self.number, self.tty, self.stopped, self.cut = self.server.getsockname()[1], os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK), False, False
        self.start()

    def run(self):
        self.server.settimeout(0.05)
        while not self.stopped:
            try:
                client, _ = self.server.accept()
            except TimeoutError:
                continue
            client.settimeout(0.002)
            while not self.stopped and not self.cut:
                try:
                    data = client.recv(256)
                    if not data:
                        break
                    os.write(self.tty, data)
                except TimeoutError:
                    pass
                try:
                    client.sendall(os.read(self.tty, 4096))
                except BlockingIOError:
                    pass
                except OSError:
                    break
            client.close()

    def close(self):
        self.stopped = True
        self.join(5)
        os.close(self.tty)
        self.server.close()


def test_a_controller_on_the_network(tmp_path):
    with Stage(tmp_path) as stage:
        b = Bridge(stage.port)
        try:
            path = session(tmp_path, stage={"port": f"tcp:127.0.0.1:{b.number}"})
            run("stagectl", "capture", path)
            assert len(shots(tmp_path / "out")) == 12
            assert run("stagectl", "--port", f"tcp:localhost:{b.number}", "move", "-10", "-20").text == "-10.000 -20.000\n"
        finally:
            b.close()


def test_a_network_that_breaks_is_an_unplugged_cable(tmp_path):
    with Stage(tmp_path, factor=5) as stage:
        b = Bridge(stage.port)
        try:
            r = Run("--port", f"tcp:127.0.0.1:{b.number}", "home")
            stage.wait_moving()
            b.cut = True
            code, _, err = r.end()
            assert code == 3 and "disconnected" in err
        finally:
            b.close()


@pytest.mark.parametrize("name, words", [("tcp:127.0.0.1", "tcp:HOST:PORT"), ("tcp::23", "tcp:HOST:PORT"), ("tcp:127.0.0.1:x", "tcp:HOST:PORT"),
                                         ("tcp:127.0.0.1:1", "refused")])
def test_addresses_that_lead_nowhere(name, words):
    assert words in run("stagectl", "--port", name, "status", code=1).err


def test_who_holds_the_port(tmp_path):
    with Stage(tmp_path, factor=1) as stage:
        r = Run("--port", stage.port, "home")
        stage.wait_moving()
        err = go(stage, "status", code=1).err
        assert f"stagectl (pid {r.process.pid})" in err
        r.kill(signal.SIGINT)
        r.end()


def test_baud_and_dtr(tmp_path):
    with Stage(tmp_path) as stage:
        assert go(stage, "--baud", 57600, "where").text
        assert "usual baud rate" in go(stage, "--baud", 12345, "where", code=1).err
        r = go(stage, "--dtr", "off", "where")          # a pty has none: said, and gone on
        assert "no DTR" in r.err
        assert "--dtr" in go(stage, "--dtr", "maybe", "where", code=2).err
        go(stage, "capture", session(tmp_path, stage={"baud": 230400, "dtr": "off"}, grid={"nodes": "1x1"}))


def test_plan_asks_the_controller_that_is_there(tmp_path):
    """3 x 1 nodes 100 mm apart along x and y at once: $110 and $120 of the slower axis decide.  Nothing is reset."""
    path = session(tmp_path, grid={"nodes": "3x1"}, stage={"backlash": "0 0", "feed": 6000})
    assert "not asked" in run("stagectl", "plan", path).text
    with Stage(tmp_path, "--max-rate", 3000, "--acceleration", 100) as stage:
        go(stage, "home")
        out = go(stage, "plan", path).text
        assert f"moving      0 h 00 min {2 * (100 / 50 + 50 / 100):04.1f} s" in out and "all points inside" in out
        assert "at most 3000 and 3000 mm/min, 100 and 100 mm/s2" in out
        assert "expected x from -800 to 0" in go(stage, "plan", session(tmp_path, stage={"origin": "-100 0"}), code=1).err
    with Stage(tmp_path, "--start", "-700,-700", "--no-homing", factor=1) as stage:
        r = Run("--port", stage.port, "--feed", 600, "move", "30", "0")
        stage.wait_moving()
        r.kill(signal.SIGKILL)
        r.end()
        out = go(stage, "plan", session(tmp_path, grid={"nodes": "3x1"})).text
        assert "not disturbed" in out and stage.truth()[2] > 0      # it goes on moving
