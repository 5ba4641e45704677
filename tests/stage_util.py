"""What the tests of stagectl share: a virtual stage to run, a GRBL of the tests' own, cameras, sessions, journals."""
import os
import pty
import re
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import tty
import zlib
from pathlib import Path

import pytest

from conftest import command, environment
from process import WALL, Process

# A camera that leaves a picture of its own each time: twelve random bytes as four pixels.
UNIQUE = """#!/bin/sh
{ printf 'P6\\n4 1\\n255\\n'; head -c 12 /dev/urandom; } > "$1"
echo "$2" >> "$(dirname "$0")/shots.log"
"""


# The interpreter itself, not a shim or a venv's start-up: cameras are started often.
PYTHON = f"{os.path.realpath(sys.executable)} -ISE"

# Writes a picture, asks the stage where it truly stands and notes it behind the words that it was given.
ASKING = """import socket, sys
with socket.socket(socket.AF_UNIX) as s:
    s.connect(sys.argv[1])
    truth = s.makefile().readline()
open(sys.argv[4], "wb").write(b"P6\\n1 1\\n255\\nabc")
with open(sys.argv[2], "a") as log:
    print(*sys.argv[3].split(","), truth, file=log, end="")
"""


def asking_camera(folder, stage, words):
    """Command of a camera that logs `words` and the stage's true x, y, speed to folder/where."""
    return f"{PYTHON} {script(folder, ASKING, 'asking.py')} {stage.truth_path} {folder}/where {words} {{file}}"


# Seconds within which a program reports what it need not wait for.  Unloaded it takes one or two; a busy machine may stretch that.
SOON = 60


class Stage:
    """virtualstage on a pty, ended with the block."""

    def __init__(self, folder, *args, factor=200):
        self.port, self.truth_path = Path(folder) / "port", Path(folder) / "truth"
        self.process = Process(
            command("virtualstage", ["--link", self.port, "--truth", self.truth_path, "--time-factor", factor, *args]),
            stdout=subprocess.PIPE, env=environment())
        self.process.stdout.readline()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGCONT)
        self.process.terminate()
        self.process.wait()
        self.process.stdout.close()

    def truth(self):
        """x, y (mm), speed (mm/s)"""
        with socket.socket(socket.AF_UNIX) as s:
            s.connect(str(self.truth_path))
            return tuple(map(float, s.makefile().readline().split()))

    def wait_moving(self):
        end = time.monotonic() + WALL
        while self.truth()[2] == 0:
            assert time.monotonic() < end, "the stage never moved"


class FakeGrbl(threading.Thread):
    """A controller written for the tests alone, from GRBL 1.1's published interface; moves at once.

    quirks: stuck=True never holds, banner=TEXT, answer=function(line) -> reply or None for the usual one, junk=bytes before each reply, settings=lines.
    """

    def __init__(self, banner="Grbl 1.1f ['$' for help]", answer=None, junk=b"", settings=None, after_banner="", stuck=False):
        super().__init__(daemon=True)
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        self.port = os.ttyname(self.slave)
        self.banner, self.answer, self.junk, self.after_banner, self.stuck = banner, answer, junk, after_banner, stuck
        self.settings = settings or ["$10=1", "$13=0", "$20=1", "$22=1", "$23=0", "$100=250.000", "$101=250.000", "$110=500.000",
                                     "$111=500.000", "$120=10.000", "$121=10.000", "$130=200.000", "$131=200.000"]
        self.lines, self.at, self.state, self.stopped, self.resets = [], [0.0, 0.0], "Idle", False, 0
        self.start()

    def close(self):
        self.stopped = True
        self.join(5)
        os.close(self.master)
        os.close(self.slave)

    def say(self, text):
        os.write(self.master, self.junk + text.encode())

    def run(self):
        text = b""
        while not self.stopped:
            if not select.select([self.master], [], [], 0.05)[0]:
                continue
            for byte in os.read(self.master, 256):
                if byte == 0x18:
                    text, self.state = b"", "Idle"
                    self.resets += 1
                    self.say(f"\r\n{self.banner}\r\n{self.after_banner}")
                elif byte == ord("?"):
                    self.say(f"<{self.state}|MPos:{self.at[0]:.3f},{self.at[1]:.3f},0.000|Bf:15,128|FS:0,0|Pn:X>\r\n")
                elif byte in b"!~":
                    self.state = "Run" if self.stuck else "Hold:0" if byte == ord("!") else "Idle"
                elif byte in b"\n":
                    self.line(text.decode())
                    text = b""
                elif byte < 0x80:
                    text += bytes([byte])

    def line(self, line):
        self.lines.append(line)
        reply = self.answer(line) if self.answer else None
        if reply is not None:
            self.say(reply)
            return
        move = re.search(r"G1X(-?[\d.]+)Y(-?[\d.]+)", line)
        if move:
            self.at = [round(float(v) * 250) / 250 for v in move.groups()]
        elif line == "$H":
            self.at = [-1.0, -1.0]
        elif line == "$$":
            self.say("".join(s + "\r\n" for s in self.settings))
        elif line == "$I":
            self.say("[VER:1.1f.20170801:]\r\n[OPT:V,15,128]\r\n")
        self.say("ok\r\n")

    def moves(self):
        return [tuple(map(float, m.groups())) for m in (re.search(r"G1X(-?[\d.]+)Y(-?[\d.]+)", s) for s in self.lines) if m]


def png(pixels):
    """Bytes of an 8-bit PNG of a (h, w, 3) array."""
    import struct
    h, w, _ = pixels.shape
    raw = b"".join(b"\0" + row.tobytes() for row in pixels)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", w, h, 8, 2, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))


def script(folder, text, name="camera.sh"):
    path = Path(folder) / name
    path.write_text(text)
    path.chmod(0o755)
    return path


DEFAULTS = {
    "grid": {"nodes": "3x2", "plane": "0 0 0  0.2 0 0  0 0.1 0"},
    "stage": {"unit_mm": 1000, "origin": "-500 -400", "feed": 6000, "settle": 0.05},
    "camera": {"exposures": "0.25 1", "timeout": 600, "kill_after": 0.3, "retries": 0},
    "output": {"folder": "out", "file": "{i:03}_{j:03}/{k:02}.ppm"},
}


def session(folder, program=None, name="session.conf", **sections):
    """Write a session file; sections override DEFAULTS key by key.  Gives its path."""
    folder = Path(folder)
    if program is None:
        program = f"{script(folder, UNIQUE)} {{file}} {{i}},{{j}},{{k}}"
    parts = {s: {**DEFAULTS[s], **{k: v for k, v in sections.get(s, {}).items()}} for s in DEFAULTS}
    parts["camera"].setdefault("command", program)
    path = folder / name
    path.write_text("".join(f"[{s}]\n" + "".join(f"{k} = {v}\n" for k, v in keys.items() if v is not None) for s, keys in parts.items()))
    return path


class Run:
    """stagectl in the background."""

    def __init__(self, *args, cwd=None):
        self.process = Process(command("stagectl", args), stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=cwd,
                               env=environment())

    def kill(self, sig):
        self.process.send_signal(sig)

    def end(self):
        out, err = self.process.communicate()
        assert b"Sanitizer" not in err and b"runtime error" not in err, err
        return self.process.returncode, out.decode(), err.decode()


def journal(folder):
    """Records as lists of words; checks each line's checksum by Python's own CRC-32."""
    records = []
    for line in (Path(folder) / "journal").read_bytes().splitlines():
        crc, words = line[:8], line[9:]
        assert int(crc, 16) == zlib.crc32(words), line
        records.append(words.decode().split(" "))
    return records


def shots(folder):
    """(i, j, k) -> digest of the last record"""
    return {tuple(map(int, r[1:4])): r[6] for r in journal(folder) if r[0] == "shot"}


def pictures(folder):
    return sorted(str(p.relative_to(folder)) for p in Path(folder).rglob("*.p[pn][mg]"))


@pytest.fixture
def fake():
    made = []

    def make(**quirks):
        made.append(FakeGrbl(**quirks))
        return made[-1]
    yield make
    for g in made:
        g.close()
