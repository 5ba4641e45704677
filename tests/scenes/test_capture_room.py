"""A capture is of one room: what the camera sees, the chain's options and the camera's facts are checked before hours of capture."""
import os
import shutil
import subprocess

import numpy as np
import pytest
from conftest import BUILD, TOP, environment, needed, run, shared_case
from ilf_util import read_mosaic
from process import execute
from stage_util import journal

NEEDED = "stagectl virtualstage virtualcamera hdrgen fishremap ilfpack oconv rtrace".split()
PLANE = "-.15 -.1 0 .3 0 0 0 .2 0"


def lamp(level):
    return f"void light l\n0\n0\n3 {3 * level} {2 * level} {level}\nl sphere lamp\n0\n0\n4 .2 .1 1.5 .2\n"


SKY = "void brightdata glowing\n4 noop level.dat . (Dz+1)/2\n0\n0\nglowing glow sky\n0\n0\n4 .2 .2 .2 0\nsky bubble far\n0\n0\n4 0 0 0 9\n"
SESSION = f"""[grid]
nodes = 2x1
plane = {PLANE}
[stage]
port = port
unit_mm = 1000
origin = -600 -500
feed = 6000
settle = 0.1
[camera]
exposures = 1/256 1/4
command = virtualcamera --quiet --octree room.oct --plane "{{plane}}" --at {{x}},{{y}} --seconds {{seconds}} --size 64
  --response srgb --supersample 1 --refine 0 --no-noise --cache views RENDER -o {{file}}
[output]
folder = out
[chain]
before = OCONV > room.oct
beside = virtualstage --with-parent --time-factor 100 --link port
hdrgen = --response srgb
fishremap = --size 32x16 --polar-max 90
ilfpack = --type float
"""


@pytest.fixture
def room(tmp_path):
    needed(*NEEDED)
    (tmp_path / "lamp.rad").write_text(lamp(100))
    (tmp_path / "room.rad").write_text("!xform lamp.rad\n" + SKY)
    (tmp_path / "level.dat").write_text("1\n0 1 2\n1 1\n")
    write_session(tmp_path)
    return tmp_path


def write_session(room, oconv="oconv -f room.rad", render="", **replaced):
    text = SESSION.replace("OCONV", oconv).replace("RENDER", render)
    for old, new in replaced.items():
        line = next(x for x in text.splitlines() if x.startswith(old + " ="))
        text = text.replace(line, f"{old} = {new}")
    (room / "s.conf").write_text(text)


def make(room, *args, code=0):
    p = execute(["make", "-C", TOP / "scenes", f"CAPTURE={room}/s.conf", f"BUILD={BUILD}", "QUIET=--quiet", *args],
                env=environment(MAKEFLAGS="", MAKELEVEL=""), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert (p.returncode == 0) == (code == 0), p.stdout
    return p.stdout


def light(room):
    return np.asarray(read_mosaic(room / "out/room.ilf.exr")[1], float)[..., :3]


def edit_lamp(room):
    (room / "lamp.rad").write_text(lamp(50))


def edit_data(room):
    (room / "level.dat").write_text("1\n0 1 2\n3 3\n")


# a frozen octree, one that names its scene files, one behind an instance; edits of a file in a file, and of a data file
@pytest.mark.parametrize("oconv, edit", [("oconv -f room.rad", edit_lamp), ("oconv room.rad", edit_lamp), ("oconv -f room.rad", edit_data),
                                         ("oconv -f room.rad > inner.oct; echo void instance all 1 inner.oct 0 0 | oconv -", edit_lamp)])
def test_a_changed_room_is_refused_and_taken_anew_on_request(room, oconv, edit):
    write_session(room, oconv)
    make(room)
    before, shots = light(room), [r for r in journal(room / "out") if r[0] == "shot"]
    assert "light field" not in make(room)                              # built again, the same: nothing to do
    assert np.array_equal(light(room), before) and len(shots) == 4
    edit(room)
    for _ in range(2):                                                  # and it stays refused
        said = make(room, code=2)
        assert "room.oct has changed since the capture began" in said and "4 exposures" in said and "--anew" in said, said
    assert np.array_equal(light(room), before)
    said = make(room, "ANEW=1")
    changed = light(room)
    assert "light field" in said and not np.allclose(changed, before, rtol=.1)
    assert len([r for r in journal(room / "out") if r[0] == "shot"]) == 8
    assert "light field" not in make(room) and np.array_equal(light(room), changed)
    # the same as one captured afresh
    shutil.rmtree(room / "out")
    shutil.rmtree(room / "views")
    make(room)
    assert np.array_equal(light(room), changed)


def test_the_same_room_built_again_goes_on(room):
    make(room)
    before = light(room)
    os.utime(room / "lamp.rad")
    (room / "s.conf").write_text((room / "s.conf").read_text() + "# a remark\n")
    make(room)
    assert np.array_equal(light(room), before) and len([r for r in journal(room / "out") if r[0] == "shot"]) == 4


def test_a_room_changed_back_goes_on(room):
    make(room)
    edit_lamp(room)
    make(room, code=2)
    (room / "lamp.rad").write_text(lamp(100))
    make(room)
    assert len([r for r in journal(room / "out") if r[0] == "shot"]) == 4


def test_anew_that_was_stopped_leaves_no_old_place_behind(room):
    """--anew takes the lists of times away at once: make can't take old pictures for done."""
    make(room)
    edit_lamp(room)
    make(room, code=2)
    (room / "s.conf").write_text((room / "s.conf").read_text().replace("port = port", "port = nowhere"))
    p = execute([BUILD / "bin/stagectl", "--anew", "capture", "s.conf"], cwd=room, env=environment(), capture_output=True, text=True)
    assert p.returncode != 0 and not list((room / "out").rglob("times.txt"))
    write_session(room)
    make(room)
    assert len([r for r in journal(room / "out") if r[0] == "shot"]) == 8


def test_the_old_rooms_indirect_light_is_not_taken_along(room):
    """-af: an ambient file of another scene is set aside."""
    (room / "room.rad").write_text("void plastic grey\n0\n0\n5 .6 .6 .6 0 0\ngrey bubble wall\n0\n0\n4 0 0 .5 3\n!xform lamp.rad\n")
    render = '--render-options "-ab 2 -ad 64 -as 0 -aa .3 -ar 16 -af out.amb"'
    write_session(room, render=render)
    make(room)
    edit_lamp(room)
    make(room, code=2)
    said = make(room, "ANEW=1")
    log = (room / "out/camera.log").read_text()
    assert "out.amb: holds another scene's indirect light" in log and (room / "out.amb.old").exists(), said
    anew = light(room)
    for f in ("out.amb", "out.amb.old", "out.amb.scene"):
        (room / f).unlink()
    shutil.rmtree(room / "out")
    shutil.rmtree(room / "views")
    make(room)
    fresh = light(room)
    assert fresh.mean() == pytest.approx(anew.mean(), rel=.02) and np.allclose(fresh, anew, rtol=.1)   # with the old room's: half as bright again


def test_files_that_a_real_camera_depends_on(tmp_path):
    """depends names any files; what stands in the journal of an older version is taken as it is, and that is said."""
    (tmp_path / "cam.sh").write_text("#!/bin/sh\nprintf 'P6\\n1 1\\n255\\nabc' > $1\n")
    (tmp_path / "light plan.txt").write_text("lamp 1 at half\n")
    text = SESSION.split("[camera]")[0] + "[camera]\nexposures = 1\ncommand = sh cam.sh {file}\n[output]\nfolder = out\nfile = {i}_{j}_{k}.ppm\ntimes =\n"
    from stage_util import Stage
    with Stage(tmp_path):
        def capture(more="", *args, code=0):
            (tmp_path / "s.conf").write_text(text.replace("[output]", more + "[output]"))
            return run("stagectl", *args, "capture", "s.conf", cwd=tmp_path, code=code)
        capture()
        r = capture("depends = 'light plan.txt'\n")
        assert "not on record" in r.err
        assert "not on record" not in capture("depends = 'light plan.txt'\n").err
        (tmp_path / "light plan.txt").write_text("lamp 1 at full\n")
        r = capture("depends = 'light plan.txt'\n", code=1)
        assert "light plan.txt has changed" in r.err and len(r.err.splitlines()) == 1
        assert "light plan.txt has changed" in run("stagectl", "verify", "s.conf", cwd=tmp_path, code=1).err
        capture("depends = none\n")
        assert "No such file" in capture("depends = missing.txt\n", code=1).err


# ---- one source for each fact --------------------------------------------------------------------------

@pytest.mark.parametrize("change, words", [
    ({"plane": "-.15 -.1 0 .3 0 0 0 .2 0"}, None),
    ({"camera": '--plane "-.15 -.1 0 .3 0 0 0 .25 0"'}, "expected --plane"), ({"camera": '--plane="-.15 -.1 .1 .3 0 0 0 .2 0"'}, "expected --plane"),
    ({"camera": f'--plane "{PLANE}"'}, None), ({"camera": "--fov 180"}, None), ({"camera": "--fov 180", "remap": "--fov 185"}, "180 degrees as the camera's"),
    ({"camera": "--fov 180", "remap": "--fov 180"}, None), ({"camera": "--lens equisolid", "remap": "--lens equidistant"}, "lens equisolid"),
    ({"camera": "--lens=equisolid", "remap": "-l equisolid"}, None), ({"keys": "fov = 200\n"}, "200 degrees"),
    ({"keys": "fov = 200\nlens = stereographic\n", "camera": "--lens {lens} --fov {fov}"}, None),
    ({"keys": "fov = 200\n", "camera": "--fov {fov}", "remap": "--fov 185"}, "200 degrees"),
    ({"keys": "fov = 200\n", "camera": "--fov {fov}", "remap": "--fov {fov}"}, None),
])
def test_what_stands_twice_agrees(tmp_path, change, words):
    text = SESSION.replace("OCONV", "true").replace("RENDER", change.get("camera", "")).replace("[camera]\n", "[camera]\n" + change.get("keys", ""))
    (tmp_path / "s.conf").write_text(text.replace("fishremap = ", f"fishremap = {change.get('remap', '')} "))
    if words:
        for command in ("plan", "capture"):
            line = run("stagectl", command, tmp_path / "s.conf", code=1).err
            assert words in line and len(line.splitlines()) == 1, line
        return
    run("stagectl", "plan", tmp_path / "s.conf")
    got = run("stagectl", "get", tmp_path / "s.conf", "chain.fishremap").text
    camera, keys = change.get("camera", ""), change.get("keys", "")
    fov = "200" if "200" in keys else "180" if "180" in camera else "185"
    lens = "stereographic" if keys else "equisolid" if "equisolid" in camera else "equidistant"
    if "lens" not in keys and keys:
        lens = "equidistant"
    assert got.count("fov") == 1 and f"--fov {fov}" in got and lens in got, got


# ---- [chain] is checked before the capture -------------------------------------------------------------

@pytest.mark.parametrize("key, options, words", [
    ("fishremap", "--size 32x16 --polar-maxx 90", "polar-maxx"), ("fishremap", "--size 32", "WxH"), ("fishremap", "--size 32x16 --lens none.lens", "none.lens"),
    ("fishremap", "--size 32x16 --falloff none.txt", "none.txt"), ("fishremap", "--size 32x16 --polar-max 190", "190"), ("fishremap", "'--size", "chain"),
    ("hdrgen", "--response gama:2", "gama"), ("hdrgen", "--lambda 0", "lambda"), ("hdrgen", "--dark none.png", "none.png"), ("hdrgen", "--circle -1", "circle"),
    ("ilfpack", "--type quarter", "quarter"), ("ilfpack", "--compression lzw", "lzw"), ("ilfpack", "--interleave --compression zip", "zip"),
    ("ilfpack", "--polar-max 200", "polar")])
def test_wrong_options_of_the_chain_are_found_by_plan(room, key, options, words):
    write_session(room, **{key: options})
    line = run("stagectl", "plan", room / "s.conf", code=1).err
    assert len(line.splitlines()) == 1 and f"[chain] {key}: " in line and words in line, line
    said = make(room, code=2)
    assert words in said and not list((room / "out").rglob("*.png")), said


def test_right_options_of_the_chain_pass(room):
    (room / "fall off.txt").write_text("0 1 1 1\n100 .5 .5 .5\n")
    write_session(room, fishremap="--size 32x16 --polar-max 90 --falloff 'fall off.txt' --centre 900,700 --radius 650", hdrgen="--response srgb --sigma --circle 900,700,650",
                  ilfpack="--type float --compression zip --polar-valid 80")
    before = sorted(p.name for p in room.iterdir())
    assert "chain       options of hdrgen, fishremap and ilfpack are right" in run("stagectl", "plan", room / "s.conf", cwd=TOP).text
    assert sorted(p.name for p in room.iterdir()) == before             # nothing was written


def test_the_virtual_cameras_timeout_is_a_rendering_ones(room):
    """A camera that takes longer than a real one may: 30 s are not to be waited for, so the plan's own words are looked at."""
    def timeout(text):
        (room / "t.conf").write_text(text)
        return run("stagectl", "get", room / "t.conf", "camera.timeout").text.strip()
    text = (room / "s.conf").read_text()
    assert timeout(text) == "3600" and timeout(text.replace("[output]", "timeout = 7\n[output]")) == "7"
    assert timeout(text.replace("virtualcamera --quiet", "/opt/x/bin/ilf-virtualcamera")) == "3600"
    assert timeout(text.replace("virtualcamera --quiet", "gphoto2")) == "30"
    assert timeout(text.replace("command = virtualcamera", "shell = yes\ncommand = nice virtualcamera")) == "3600"


# ---- messages ------------------------------------------------------------------------------------------

def test_corners_outside_the_circle_are_not_counted(room, tmp_path):
    """hdrgen --circle: shares are of the circle; the picture is the same."""
    from PIL import Image
    y, x = np.mgrid[:100, :160] + .5
    inside = np.hypot(x - 80, y - 50) < 50
    dark = np.hypot(x - 60, y - 50) < 10
    for k, code in enumerate((90, 180)):
        Image.fromarray(np.where(inside & ~dark, code, 0).astype(np.uint8)).save(tmp_path / f"{k}.png")
    (tmp_path / "times").write_text("0.png 1\n1.png 4\n")
    outs = []
    for name, args in (("all", ()), ("r", ("--circle", "1")), ("xyr", ("--circle", "80,50,50")), ("less", ("--circle", "40,50,30"))):
        r = run("hdrgen", "--response", "srgb", "--times", "times", *args, "-o", f"{name}.exr", "0.png", "1.png", cwd=tmp_path)
        n = {"all": dark | ~inside, "less": (dark | ~inside) & (np.hypot(x - 40, y - 50) < 30)}.get(name, dark).sum()
        of = {"all": 16000, "less": (np.hypot(x - 40, y - 50) < 30).sum()}.get(name, inside.sum())
        assert f"{n} pixels ({100 * n / of:.3g} %" in r.err, r.err
        outs.append((tmp_path / f"{name}.exr").stat().st_size)
    assert max(outs) - min(outs) < 40                                   # the command line in the header
    room_said = make(room, "QUIET=")
    assert "black in every exposure" not in room_said, room_said


@pytest.mark.parametrize("value", [65504, 65505, 1e6])
def test_a_half_that_is_too_small_names_the_type_that_holds_it(tmp_path, value):
    pix = np.full((8, 16, 3), .5, np.float32)
    pix[2, 3] = value
    h, w = pix.shape[:2]
    (tmp_path / "p.pfm").write_bytes(f"PF\n{w} {h}\n-1\n".encode() + pix[::-1].tobytes())
    args = ["--grid", "1x1", "--plane", "0 0 0 1 0 0 0 1 0", "-o", tmp_path / "o.ilf.exr", tmp_path / "p.pfm"]
    r = run("ilfpack", *args, code=None)
    assert (r.code == 0) == (value <= 65504)
    if r.code:
        assert "--type float" in r.err and len(r.err.splitlines()) == 1 and not (tmp_path / "o.ilf.exr").exists()
    run("ilfpack", "--type", "float", *args)
    r = run("fishremap", "--from", "latlong", "--to", "latlong", "--size", "16x8", "--type", "half", "-o", tmp_path / "o.exr", tmp_path / "p.pfm", code=None)
    assert r.code == 0 or "--type float" in r.err


def test_the_sun(tmp_path):
    sun = shared_case("sun_half") / "sun.exr"
    r = run("ilfpack", "--grid", "1x1", "--plane", "-.5 -.5 0 1 0 0 0 1 0", "-o", tmp_path / "o.ilf.exr", sun, code=1)
    assert "--type float" in r.err and len(r.err.splitlines()) == 1


def test_too_many_images_are_refused_at_once(tmp_path):
    """The limit is of the series, not found after its calibration: no image is even read."""
    r = run("hdrgen", "-o", tmp_path / "o.exr", *[f"none{k}.png" for k in range(1025)], code=2)
    assert "at most 1024 images, found 1025" in r.err and len(r.err.splitlines()) == 1
