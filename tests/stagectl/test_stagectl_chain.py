"""scenes/capture.mk: from a session to its light field on the virtual stage, stopped and gone on with."""
import math
import os
import signal
import subprocess
import time

import numpy as np
import pytest
from conftest import BUILD, TOP, environment, needed
from ilf_util import read_mosaic, unmosaic
from process import execute, Process
from stage_util import journal

NEEDED = "stagectl virtualstage virtualcamera hdrgen fishremap ilfpack oconv rtrace".split()
PLANE = "-.15 -.1 0 .3 0 0 0 .2 0"


@pytest.fixture
def room(tmp_path):
    """A 2 x 2 session of the example's room at small sizes; the lamp's energy is known."""
    needed(*NEEDED)
    (tmp_path / "room.rad").write_text("""void light l
0
0
3 300 200 100
l sphere lamp
0
0
4 0.2 0.1 1.5 .08
void glow sky
0
0
4 .2 .2 .2 0
sky bubble far
0
0
4 0 0 0 9
""")
    (tmp_path / "s.conf").write_text(f"""[grid]
nodes = 2x2
plane = {PLANE}
[stage]
port = port
unit_mm = 1000
origin = -600 -500
feed = 6000
settle = 0.1
[camera]
exposures = 1/2048 1/64 1/2
command = virtualcamera --quiet --octree room.oct --plane "{PLANE}" --at {{x}},{{y}} --seconds {{seconds}} --size 192
  --response srgb --electrons 200000 --read-noise 3 --cache views -o {{file}}
[output]
folder = out
[chain]
before = oconv -f room.rad > room.oct
beside = virtualstage --with-parent --time-factor 100 --link port
hdrgen = --response srgb
fishremap = --lens equidistant --fov 185 --size 64x32 --polar-max 90
ilfpack = --type float
""")
    return tmp_path


def make(room, *args, **kw):
    return Process(["make", "-C", TOP / "scenes", f"CAPTURE={room}/s.conf", f"BUILD={BUILD}", "-j2", "QUIET=--quiet", *args],
                   env=environment(MAKEFLAGS="", MAKELEVEL=""), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                   start_new_session=True, **kw)


def made(room, *args):
    p = make(room, *args)
    text, _ = p.communicate()
    assert p.returncode == 0, text
    return text


def stamps(room):
    return {str(p): p.stat().st_mtime_ns for p in (room / "out").rglob("*.*") if p.suffix in (".exr", ".png")}


def test_session_to_light_field(room):
    made(room)
    light = room / "out/room.ilf.exr"
    # at each probe: radiance of the sky, and the lamp's radiance times solid angle, summed over the texels
    probes = unmosaic(read_mosaic(light)[1], 2, 2)
    phi = (np.arange(32) + 0.5) * math.pi / 2 / 32
    omega = (np.sin(phi) * 2 * math.sin(math.pi / 2 / 64))[:, None] * (2 * math.pi / 64)
    for i in range(2):
        for j in range(2):
            probe = np.asarray(probes[j][i], float)
            d = math.hypot(0.35 - 0.3 * i, 0.2 - 0.2 * j, 1.5)
            lamp = 2 * math.pi * (1 - math.sqrt(1 - (0.08 / d) ** 2))
            energy = ((probe - 0.2) * omega[..., None]).sum((0, 1))
            assert np.median(probe, (0, 1)) == pytest.approx([0.2] * 3, rel=0.01)
            assert energy == pytest.approx(lamp * (np.array([300, 200, 100]) - 0.2), rel=0.015)
    before = stamps(room)
    assert len(before) == 12 + 4 + 4 + 1
    assert "light field" not in made(room) and stamps(room) == before       # a second run does nothing
    (room / "out/001_000/probe.exr").unlink()
    made(room)
    after = stamps(room)
    assert {p for p in after if after[p] != before[p]} == {str(room / "out/001_000/probe.exr"), str(light)}
    text = (room / "s.conf").read_text()
    (room / "s.conf").write_text(text.replace("--size 64x32", "--size 32x16"))
    made(room)
    assert {p.split("/")[-1] for p, t in stamps(room).items() if t != after[p]} == {"probe.exr", "room.ilf.exr"}
    assert len([r for r in journal(room / "out") if r[0] == "shot"]) == 12      # nothing was taken again


def test_stopped_and_gone_on_with(room):
    for wait in (0.4, 1.0, 1.6):
        p = make(room)
        time.sleep(wait)
        os.killpg(p.pid, signal.SIGKILL)
        p.communicate()
    made(room)
    shots = [tuple(r[1:4]) for r in journal(room / "out") if r[0] == "shot"]
    assert len(shots) == len(set(shots)) == 12 and (room / "out/room.ilf.exr").exists()


def test_refusals(room):
    text = (room / "s.conf").read_text()
    for change, words in (("nodes = 2x2\n", "nodes = 2y2\n"), "expected WxH"), (("[output]\n", "[output]\ntimes = t{i}{j}.txt\n"), "times in the folder"):
        (room / "s.conf").write_text(text.replace(*change))
        p = make(room)
        out, _ = p.communicate()
        assert p.returncode != 0 and words in out
    p = execute(["make", "-C", TOP / "scenes", "CAPTURE=none.conf"], capture_output=True, text=True)
    assert p.returncode != 0 and "none.conf is not there" in p.stderr
