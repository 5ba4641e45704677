"""One chain from a session to its light field, for demo, figures and everybody: what a change makes anew, and what it does not."""
import os
import re
import shutil
import subprocess

import numpy as np
import pytest
from conftest import BUILD, TOP, environment
from ilf_util import read_mosaic
from process import execute

PROGRAMS = "stagectl virtualstage virtualcamera hdrgen fishremap ilfpack oconv rtrace".split()
STEPS = ("00.png", "fisheye.exr", "probe.exr", "room.ilf.exr")
# what another build of a program leaves as it is
KEPT = {"hdrgen": 1, "fishremap": 2, "ilfpack": 3, "virtualcamera": 0, "rtrace": 0}
ROOM = ("void light l\n0\n0\n3 300 200 100\nl sphere lamp\n0\n0\n4 .2 .1 1.5 .2\nvoid glow g\n0\n0\n4 .2 .2 .2 0\ng bubble far\n0\n0\n4 0 0 0 9\n")
SESSION = """# a remark
[grid]
nodes = 2x1
plane = -.15 -.1 0  .3 0 0  0 .2 0
[stage]
port = port
unit_mm = 1000
origin = -600 -500
feed = 6000
settle = 0.1
[camera]
exposures = 1/256 1/4
command = virtualcamera --quiet --octree room.oct --plane "{plane}" --at {x},{y} --seconds {seconds} --size 32 --response srgb
  --supersample 1 --refine 0 --no-noise --falloff falloff.txt --cache CACHE --render-options "-ab 0" -o {file}
depends = room.oct falloff.txt out/camera.programs
[output]
folder = out
[chain]
before = oconv -f room.rad > room.oct
beside = virtualstage --with-parent --time-factor 1000 --link port
hdrgen = --response srgb
fishremap = --size 32x8 --polar-max 90 --falloff falloff.txt
ilfpack = --type float
"""


def another_build(program):
    """The same program with other bytes: what stands behind its end is never read."""
    with open(program, "ab") as f:
        f.write(b"\0")


@pytest.fixture
def capture(tmp_path):
    """A session with programs of its own, and what makes it: capture(...) is the steps whose files are others than before."""
    (tmp_path / "build/bin").mkdir(parents=True)
    for p in PROGRAMS:
        shutil.copy2(shutil.which(p, path=environment()["PATH"]), tmp_path / "build/bin" / p)
    (tmp_path / "room.rad").write_text(ROOM)
    (tmp_path / "falloff.txt").write_text("0 1 1 1\n100 .9 .9 .9\n")
    (tmp_path / "s.conf").write_text(SESSION.replace("CACHE", "views/{i}_{j}"))

    def stamps():
        return {f: f.stat().st_mtime_ns for f in (tmp_path / "out").rglob("*") if f.name in STEPS}

    def make(*args, code=0, whole=True):
        before = stamps()
        p = execute(["make", "-C", TOP / "scenes", f"CAPTURE={tmp_path}/s.conf", f"BUILD={tmp_path}/build", "QUIET=--quiet", *args],
                    env=environment(MAKEFLAGS="", MAKELEVEL=""), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert (p.returncode == 0) == (code == 0), p.stdout
        make.said = p.stdout
        after = stamps()
        changed = {f.name for f in after if before.get(f) != after[f]}
        # a step is made for all places or for none
        assert not whole or all((before.get(f) != after[f]) == (f.name in changed) for f in after), (before, after)
        return [s for s in STEPS if s in changed]
    make.folder = tmp_path
    return make


def field(path):
    return np.asarray(read_mosaic(path)[1])


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


# ---- programs ----------------------------------------------------------------------------------------------

def test_another_build_makes_anew_what_it_makes_and_nothing_else(capture):
    bin_, out = capture.folder / "build/bin", capture.folder / "out"
    assert capture() == list(STEPS) and capture() == []
    for p in PROGRAMS:                                     # linked again, the same bytes; and copied over
        os.utime(bin_ / p)
    assert capture() == []
    for p in PROGRAMS:
        shutil.copy(shutil.which(p, path=environment()["PATH"]), bin_ / p)
    assert capture() == [] and capture() == []
    light = field(out / "room.ilf.exr")
    for p in ("hdrgen", "fishremap", "ilfpack"):
        named = dict(line.split() for line in (out / "room.ilf.programs").read_text().splitlines())
        another_build(bin_ / p)
        assert capture() == list(STEPS[KEPT[p]:]), p
        assert capture() == []
        now = dict(line.split() for line in (out / "room.ilf.programs").read_text().splitlines())
        assert {q for q in now if now[q] != named[q]} == {p} and set(now) == {"virtualcamera", "rtrace", "hdrgen", "fishremap", "ilfpack"}
    another_build(bin_ / "stagectl")                       # it takes the pictures, it doesn't make them
    assert capture() == []
    # what the camera sees through another program is another room: refused as one, taken anew where that is allowed
    for p in ("virtualcamera", "rtrace"):
        another_build(bin_ / p)
        for _ in range(2):
            assert capture(code=2) == [] and "camera.programs has changed since the capture began" in capture.said
        assert capture("ANEW=changed") == list(STEPS) and capture("ANEW=changed") == [] and capture() == []
    assert np.array_equal(field(out / "room.ilf.exr"), light)


def test_lamps_are_taken_out_where_the_session_asks_for_it(capture):
    out, session = capture.folder / "out", capture.folder / "s.conf"
    assert capture() == list(STEPS) and not list(out.glob("room.lamps*"))
    shutil.copy2(shutil.which("ilflamps", path=environment()["PATH"]), capture.folder / "build/bin")
    session.write_text(session.read_text() + "ilflamps = --lamps kept\n")
    assert capture(code=2) == [] and "[chain] ilflamps" in capture.said and "--lamps: expected keep, auto or a number" in capture.said
    edit(session, "--lamps kept", "--lamps keep --type float")
    lit = out / "room.lamps.ilf.exr"
    assert capture() == [] and np.array_equal(field(lit), field(out / "room.ilf.exr"))
    assert (out / "room.lamps.ilf.programs").read_text().startswith("ilflamps ")
    stamp = lit.stat().st_mtime_ns
    assert capture() == [] and lit.stat().st_mtime_ns == stamp
    edit(session, "keep --type float", "keep --type half")
    assert capture() == [] and lit.stat().st_mtime_ns != stamp
    stamp = lit.stat().st_mtime_ns
    another_build(capture.folder / "build/bin/ilflamps")
    assert capture() == [] and lit.stat().st_mtime_ns != stamp


def test_a_real_cameras_pictures_outlive_their_programs(capture):
    """Nothing can take them again: another build merges and remaps what is there."""
    (capture.folder / "cam.sh").write_text("printf 'P6\\n8 8\\n255\\n' > $1\nhead -c 192 /dev/zero | tr '\\0' $2 >> $1\n")
    text = re.sub(r"command = .*?depends", "command = sh cam.sh {file} {k}\ndepends", SESSION, flags=re.S)
    text = re.sub(r"depends = .*", "depends = none", text).replace("folder = out", "folder = out\nfile = {i}_{j}/0{k}.ppm\ntimes = {i}_{j}/times.txt")
    (capture.folder / "s.conf").write_text(text.replace("before = oconv -f room.rad > room.oct\n", ""))
    assert capture() == list(STEPS[1:])
    assert not (capture.folder / "out/camera.programs").exists()
    pictures = {p: p.stat().st_mtime_ns for p in (capture.folder / "out").rglob("*.ppm")}
    for p in ("stagectl", "virtualcamera", "rtrace"):
        another_build(capture.folder / "build/bin" / p)
    assert capture() == [] and capture("ANEW=changed") == []
    another_build(capture.folder / "build/bin/hdrgen")
    assert capture() == list(STEPS[1:])
    assert len(pictures) == 4 and pictures == {p: p.stat().st_mtime_ns for p in (capture.folder / "out").rglob("*.ppm")}


# ---- the session and its files -------------------------------------------------------------------------------

def test_a_changed_session_makes_anew_what_it_says_otherwise(capture):
    s, out = capture.folder / "s.conf", capture.folder / "out"
    assert capture() == list(STEPS)
    edit(s, "# a remark", "# another remark")
    assert capture("ANEW=changed") == []
    edit(s, "feed = 6000", "feed = 5000")                  # how, not what
    assert capture("ANEW=changed") == []
    edit(s, "--size 32x8", "--size 48x12")
    assert capture("ANEW=changed") == list(STEPS[2:])
    edit(s, "--type float", "--type half")
    assert capture("ANEW=changed") == list(STEPS[3:])
    # another plan: refused as it stands, taken anew on request; then as one that is made afresh
    edit(s, "exposures = 1/256 1/4", "exposures = 1/128 1/2")
    assert capture(code=2) == [] and "plan has changed" in capture.said
    assert capture("ANEW=changed") == list(STEPS) and capture("ANEW=changed") == []
    light = field(out / "room.ilf.exr")
    shutil.rmtree(out)
    assert capture() == list(STEPS) and np.array_equal(field(out / "room.ilf.exr"), light)


def test_a_file_that_an_option_names_counts(capture):
    edit(capture.folder / "s.conf", "--polar-max 90 --falloff falloff.txt", "--polar-max 90 --falloff=measured.txt")
    measured = capture.folder / "measured.txt"
    measured.write_text("0 1 1 1\n100 .9 .9 .9\n")
    assert capture() == list(STEPS)
    before = field(capture.folder / "out/room.ilf.exr")
    measured.write_text("0 1 1 1\n100 .4 .4 .4\n")
    assert capture() == list(STEPS[2:])
    # at 84 degrees the curve that it is divided by fell from .92 to .49
    assert (field(capture.folder / "out/room.ilf.exr")[-1] / before[-1]).mean() == pytest.approx(1.85, rel=.1)
    edit(capture.folder / "falloff.txt", ".9 .9 .9", ".8 .8 .8")          # the lens's own: the camera sees otherwise
    assert capture(code=2) == [] and "falloff.txt has changed" in capture.said
    assert capture("ANEW=changed") == list(STEPS)


def test_a_capture_that_was_stopped_goes_on_after_anew(capture):
    """ANEW=changed strikes off what is of another room once, not at each go."""
    folder = capture.folder
    edit(folder / "s.conf", "views/{i}_{j}", "seen")
    edit(folder / "s.conf", "command = virtualcamera", "retries = 0\nshell = yes\ncommand = test ! -e stop{i} && virtualcamera")
    assert capture() == list(STEPS)
    edit(folder / "room.rad", "300 200 100", "30 20 10")
    (folder / "stop1").touch()
    capture("ANEW=changed", code=2, whole=False)
    first = {p: p.stat().st_mtime_ns for p in (folder / "out/000_000").glob("*.png")}
    (folder / "stop1").unlink()
    capture("ANEW=changed", whole=False)
    assert (folder / "out/journal").read_text().count(" anew\n") == 1
    assert len(first) == 2 and first == {p: p.stat().st_mtime_ns for p in first}
    assert capture() == []


# ---- a virtual camera's views -----------------------------------------------------------------------------------

@pytest.mark.parametrize("render", ['"-ab 0"', '"-ab 1 -ad 32 -as 0 -aa .3 -ar 8 -af views/{i}_{j}/room.amb"'])
def test_views_rendered_beforehand_are_those_that_the_capture_wants(capture, render):
    """One view a place, with its indirect light from a copy of the room's: none is rendered a second time, for its place has the same digits."""
    folder = capture.folder
    edit(folder / "s.conf", '"-ab 0"', render)
    edit(folder / "s.conf", "nodes = 2x1", "nodes = 4x1")                  # thirds of a length have no end
    capture("-j2")
    views = sorted((folder / "views").rglob("*.pfm"))
    assert [v.parent.name for v in views] == [f"{i}_0" for i in range(4)]
    assert len([p for p in (folder / "out").rglob("0*.png")]) == 8
    # thrown away, they are rendered again only for a capture that wants them
    shutil.move(folder / "views", folder / "away")
    another_build(folder / "build/bin/hdrgen")
    assert capture() == list(STEPS[1:]) and not (folder / "views").exists()
    shutil.move(folder / "away", folder / "views")
    assert (folder / "views/room.amb").exists() == ("-af" in render) and not list((folder / "views").glob("*_*/room.amb*"))
    if "-af" in render:
        return
    before = field(folder / "out/room.ilf.exr")
    shutil.rmtree(folder / "out")
    edit(folder / "s.conf", "views/{i}_{j}", "seen")                       # one cache: rendered at each place's first exposure
    capture()
    assert np.array_equal(field(folder / "out/room.ilf.exr"), before) and len(list((folder / "seen").glob("*.pfm"))) == 4


# ---- the demo and the figures ---------------------------------------------------------------------------------------

SAN = ["SAN=1"] if BUILD.name == "san" else []


def top(*args):
    env = environment(MAKEFLAGS="", MAKELEVEL="", RAYPATH=f"{TOP}/scenes/demo")      # the demo's function files: its session stands elsewhere here
    p = execute(["make", "--no-print-directory", *args], cwd=TOP, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert p.returncode == 0, p.stdout
    return p.stdout


def demo_session(path, out):
    """The demo's session with fewer places, a smaller camera and no indirect light, into another folder."""
    text = (TOP / "scenes/demo/session.conf").read_text()
    here = os.path.relpath(TOP / "scenes/demo", path.parent)
    for old, new in ((r"nodes = 6x6", "nodes = 3x2"), (r"--size 256 --supersample 2 --refine 8", "--size 64 --supersample 1 --refine 0"),
                     (r'--render-options ".*"', '--render-options "-ab 0 -av .05 .05 .05 -ds .3"'), (r"lens_falloff.txt", f"{here}/lens_falloff.txt"),
                     (r"(make -s -C) \.\./\.\. build/demo", rf"\1 {TOP} DEMO={out} {out}"), (r"\.\./\.\./build/demo", str(out))):
        text, n = re.subn(old, new, text)
        assert n
    path.write_text(text)
    return path


def test_the_demos_light_field_is_its_sessions(tmp_path):
    demo, alone = tmp_path / "demo", tmp_path / "alone"
    goals = [f"DEMO={demo}", f"DEMO_SESSION={demo_session(tmp_path / 'a.conf', demo)}", f"{demo}/room.ilf.exr", f"{demo}/single.ilf.exr", "demo_SINGLE=1_1"] + SAN
    made = top("-j2", *goals)
    assert "light field" in made
    stamps = {p: p.stat().st_mtime_ns for p in demo.rglob("*")}
    again = top(*goals)
    assert "light field" not in again and stamps == {p: p.stat().st_mtime_ns for p in demo.rglob("*")}
    assert not {"CAPTURE", "virtualcamera", "oconv"} & set(re.findall(r"[A-Za-z]+", top("-n", *goals)))     # nothing is left to do
    top("-C", "scenes", f"CAPTURE={demo_session(tmp_path / 'b.conf', alone)}", f"BUILD={BUILD}", "QUIET=--quiet")
    assert np.array_equal(field(demo / "room.ilf.exr"), field(alone / "room.ilf.exr"))
    assert field(demo / "room.ilf.exr").max() > 1
    # another session is another light field
    edit(tmp_path / "a.conf", "--size 192x96", "--size 96x48")
    assert "light field" in top(*goals)
    assert field(demo / "room.ilf.exr").shape[0] * 2 == field(alone / "room.ilf.exr").shape[0] and "light field" not in top(*goals)


@pytest.mark.parametrize("size", ["small", "paper"])
def test_make_n_shows_the_figures_and_writes_nothing(tmp_path, size):
    """The sessions' rules are begun with the files that they read; nothing is made by looking."""
    said = top("-n", f"FIG={tmp_path}/fig", f"SIZE={size}", "figures-run")
    for name in ("figure11", "figure12", "exposures"):
        assert re.search(rf"make .*-C scenes CAPTURE={tmp_path}/fig/{name}/session.conf .*ANEW=changed", said), name
    assert not (tmp_path / "fig").exists()


def test_the_figures_sessions_are_sessions(tmp_path):
    """As written for both sizes: stagectl reads them, and their options are the chain's."""
    for size, nodes in (("small", "12x12"), ("paper", "30x30")):
        fig = tmp_path / size
        top(f"FIG={fig}", f"SIZE={size}", *(f"{fig}/{name}/session.conf" for name in ("figure11", "figure12", "exposures")))

        def get(name, key):
            return execute(["stagectl", "get", fig / name / "session.conf", key], env=environment(), stdout=subprocess.PIPE, text=True, check=True).stdout.strip()
        assert get("figure12", "grid.nodes") == nodes and get("exposures", "grid.nodes") == "1x1"
        assert len(get("exposures", "camera.exposures").split()) == 16 and get("figure12", "camera.lens") == "equidistant"
        assert f"{fig}/falloff/measured.txt" in get("figure11", "chain.fishremap") and "views/{i}_{j}/room.amb" in get("figure11", "camera.command")
