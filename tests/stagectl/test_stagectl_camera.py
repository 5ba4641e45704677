"""stagectl and real cameras: what a picture says of itself, raw beside JPEG, servers left behind, failures gone on from."""
import importlib.util
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational, ImageFileDirectory_v2

from common_util import write_dng
from conftest import environment, needed, run
from process import execute, Process
from stage_util import PYTHON, Run, Stage, asking_camera, journal, script, session, shots

ONE = {"nodes": "1x1"}


def photo(path, seconds=None, f_number=None, iso=None, seed=1):
    """A JPEG, PNG or TIFF that says so in EXIF, written by Pillow."""
    exif = Image.Exif()
    facts = exif.get_ifd(0x8769)
    if seconds:
        facts[0x829A] = IFDRational(*seconds) if isinstance(seconds, tuple) else IFDRational(round(seconds * 1e6), 10**6)
    if f_number:
        facts[0x829D] = IFDRational(round(f_number * 10), 10)
    if iso:
        facts[0x8827] = iso
    pixels = np.random.default_rng(seed).integers(0, 255, (24, 32, 3)).astype("u1")
    if Path(path).suffix == ".tif":     # Pillow wants them as tags of the picture's own directory
        tags = ImageFileDirectory_v2()
        tags[34665] = dict(facts)
        Image.fromarray(pixels).save(path, tiffinfo=tags)
        return path
    Image.fromarray(pixels).save(path, **({"exif": exif.tobytes()} if len(facts) else {}))
    return path


def copying(folder, *more):
    """A camera that hands out folder/roll/I,J,K.ENDING (or K.ENDING, or any.ENDING): all endings that are there."""
    return script(folder, f"""#!/bin/sh
stem=${{1%.*}}
for name in "$2" "${{2##*,}}" any; do
    for f in {folder}/roll/$name.*; do [ -e "$f" ] && {{ cp "$f" "$stem.${{f##*.}}"; found=1; }}; done
    [ -n "$found" ] && break
done
echo "$2 LC_ALL=$LC_ALL LANGUAGE=$LANGUAGE" >> {folder}/taken
{"; ".join(more)}
""")


def take(path, stage, code=0, more=(), env=None):
    return run("stagectl", "--port", stage.port, "capture", path, *more, code=code, env=env)


@pytest.fixture
def roll(tmp_path):
    (tmp_path / "roll").mkdir()
    return tmp_path / "roll"


def jpegs(tmp_path, body=(), **sections):
    sections.setdefault("grid", ONE)
    sections.setdefault("output", {"file": "{i}_{j}/{k}.jpg"})
    return session(tmp_path, f"{copying(tmp_path, *body)} {{file}} {{i}},{{j}},{{k}}", **sections)


# ---- what the picture says ------------------------------------------------------------------------------------------

@pytest.mark.parametrize("asked, says, good", [
    ("0.25", (1, 10), False), ("0.25", (1, 4), True), ("1/60", (1, 64), True), ("30", (32, 1), True), ("1/60", (1, 50), False),
    ("1/15", (1, 13), False), ("1/13", (1, 15), False), ("1/4000", (1, 4096), True), ("0.3", (1, 3), True), ("2", (1, 2), False)])
def test_the_time_in_the_picture_is_the_one_asked_for(tmp_path, roll, asked, says, good):
    photo(roll / "any.jpg", says)
    path = jpegs(tmp_path, camera={"exposures": asked})
    with Stage(tmp_path) as stage:
        r = take(path, stage, code=0 if good else 1)
    if good:
        assert not re.search("says", r.err)
        assert ["says", "0", "0", "0"] == [w[:4] for w in journal(tmp_path / "out") if w[0] == "says"][0]
    else:
        number = f"{says[0] / says[1]:.6g}"
        assert f"asked for {eval(asked):.6g} s, the picture says {number} s" in r.err
        assert not list((tmp_path / "out").rglob("*.jpg")) and not list((tmp_path / "out").glob(".shot-*"))


@pytest.mark.parametrize("ending", ["jpg", "tif", "png", "dng"])
def test_whatever_the_format(tmp_path, roll, ending):
    """JPEG, PNG and TIFF by Pillow; a raw file goes through LibRaw."""
    def put(seconds):
        if ending == "dng":
            write_dng(roll / "any.dng", np.full((64, 96), 900), seconds=seconds)
        else:
            photo(roll / f"any.{ending}", seconds)
    path = jpegs(tmp_path, camera={"exposures": "1/8"}, output={"file": "{i}_{j}/{k}." + ending})
    with Stage(tmp_path) as stage:
        put((1, 10))
        assert "the picture says 0.1 s" in take(path, stage, code=1).err
        put((1, 8))
        take(path, stage)
    assert "1 of 1 places finished" in run("stagectl", "verify", path).text


def test_times_as_the_pictures_say(tmp_path, roll):
    photo(roll / "0.jpg", (1, 10))
    photo(roll / "1.jpg", (1, 1), seed=2)
    path = jpegs(tmp_path, camera={"times": "exif"}, grid={"nodes": "2x1"})
    with Stage(tmp_path) as stage:
        r = take(path, stage)
    assert r.err.count("asked for 0.25 s, the picture says 0.1 s") == 1 and "exposure 1" not in r.err
    for i in range(2):
        listed = (tmp_path / f"out/00{i}_000/times.txt").read_text().splitlines()[1:]
        assert listed == ["0.jpg 0.1", "1.jpg 1"]
    assert "plan has changed: camera.times" in take(jpegs(tmp_path, grid={"nodes": "2x1"}), stage, code=1).err


def test_times_in_the_other_section(tmp_path):
    path = session(tmp_path, "cam {file}", grid=ONE, output={"times": "exif"})
    assert "'exif', which belongs in [camera]" in run("stagectl", "plan", path, code=1).err


def test_times_as_the_pictures_say_survive_a_kill(tmp_path, roll):
    """The list is written by the run after the one that took the picture."""
    photo(roll / "0.jpg", (1, 10))
    photo(roll / "1.jpg", (1, 1))
    wait = 'case "$2" in *,1) until [ -e %s/go ]; do touch %s/asked; sleep 0.05; done;; esac' % (tmp_path, tmp_path)
    path = jpegs(tmp_path, [wait], camera={"times": "exif", "timeout": 600})
    with Stage(tmp_path) as stage:
        r = Run("--port", stage.port, "capture", path)
        while not (tmp_path / "asked").exists():
            time.sleep(0.01)
        r.kill(signal.SIGKILL)
        r.end()
        (tmp_path / "go").touch()
        take(path, stage)
    assert (tmp_path / "out/000_000/times.txt").read_text().splitlines()[1:] == ["0.jpg 0.1", "1.jpg 1"]


def test_pictures_that_say_nothing(tmp_path, roll):
    photo(roll / "any.jpg")
    path = jpegs(tmp_path, grid={"nodes": "2x1"})
    with Stage(tmp_path) as stage:
        assert take(path, stage).err.count("doesn't say its exposure time") == 1
        path = jpegs(tmp_path, camera={"times": "exif"}, output={"folder": "o2", "file": "{k}_{i}.jpg"})
        assert "times = exif, but the picture doesn't say" in take(path, stage, code=1).err


@pytest.mark.parametrize("keys, facts, words", [
    ({}, [(8, 100), (8, 200)], "expected ISO 100 as in the session's first picture, this one says 200"),
    ({}, [(8, 100), (5.6, 100)], "expected f-number 8 as in the session's first picture, this one says 5.6"),
    ({"iso": 200}, [(8, 100), (8, 200)], "expected ISO 200 as asked, the picture says 100"),
    ({"f_number": 5.6}, [(8, 100), (8, 100)], "expected f-number 5.6 as asked, the picture says 8"),
    ({"iso": 100}, [(8, None), (8, 100)], "expected ISO 100 as asked, the picture doesn't say it"),
    ({"iso": -1}, [(8, 100), (8, 200)], None), ({"f_number": -1}, [(8, 100), (4, 100)], None),
    ({"f_number": 8, "iso": 100}, [(8.1, 100), (8, 100)], None), ({}, [(None, None), (8, 100)], None)])
def test_f_number_and_iso(tmp_path, roll, keys, facts, words):
    for k, (f, iso) in enumerate(facts):
        photo(roll / f"{k}.jpg", (0.25, 1)[k], f, iso)
    path = jpegs(tmp_path, camera=keys)
    with Stage(tmp_path) as stage:
        r = take(path, stage, code=1 if words else 0)
    assert not words or words in r.err


def test_the_first_picture_counts_after_a_resume_too(tmp_path, roll):
    photo(roll / "0.jpg", 0.25, 8, 100)
    path = jpegs(tmp_path)
    with Stage(tmp_path) as stage:
        assert "wrote no file" in take(path, stage, code=1).err          # exposure 1 is not there
        photo(roll / "1.jpg", 1, 8, 400)
        assert "expected ISO 100" in take(path, stage, code=1).err
        photo(roll / "1.jpg", 1, 8, 100)
        take(path, stage)


def test_the_ending_and_the_content(tmp_path, roll):
    photo(roll / "any.png", (1, 4))
    os.rename(roll / "any.png", roll / "any.jpg")
    path = jpegs(tmp_path, camera={"time_tolerance": 100})
    with Stage(tmp_path) as stage:
        assert take(path, stage).err.count("0_0/0.jpg: its name says jpeg, it holds png") == 1


def test_the_default_name_and_a_camera_of_jpegs(tmp_path, roll):
    """The default is .png; gphoto2 writes what the camera has."""
    photo(tmp_path / "x.jpg", (1, 4))
    shutil.copy(tmp_path / "x.jpg", roll / "any.png")
    path = jpegs(tmp_path, grid=ONE, camera={"exposures": "0.25"}, output={"file": None})
    path.write_text(path.read_text())
    with Stage(tmp_path) as stage:
        assert "000_000/00.png: its name says png, it holds jpeg ([output] file)" in take(path, stage).err


# ---- what the command says -----------------------------------------------------------------------------------------

def test_messages_in_the_c_locale(tmp_path, roll):
    photo(roll / "any.jpg", (1, 4))
    path = jpegs(tmp_path, camera={"exposures": "0.25"})
    with Stage(tmp_path) as stage:
        take(path, stage, env=environment(LC_ALL="fr_FR.UTF-8", LANG="fr_FR.UTF-8", LANGUAGE="fr:de"))
    assert (tmp_path / "taken").read_text() == "0,0,0 LC_ALL=C LANGUAGE=\n"


@pytest.mark.parametrize("keys, body, words", [
    ({"error_text": "broken | *** Error"}, "echo '*** Error ***'", "it said '*** Error'"),
    ({"error_text": "broken | *** Error"}, "echo lens broken", "it said 'broken'"), ({"error_text": "broken|"}, "echo fine", None),
    ({"error_text": ""}, "echo '*** Error ***'", None), ({}, "echo '*** Error ***'", None),
    ({"expect_text": "Current: {label}", "labels": "0.25s"}, "echo Current: 0.1000s", "expected it to say 'Current: 0.25s'"),
    ({"expect_text": "Current: {label}", "labels": "0.25s"}, "echo Current: 0.25s", None)])
def test_words_that_count(tmp_path, roll, keys, body, words):
    photo(roll / "any.jpg", (1, 4))
    path = jpegs(tmp_path, [body], camera={"exposures": "0.25", **keys})
    with Stage(tmp_path) as stage:
        r = take(path, stage, code=1 if words else 0)
    assert not words or words in r.err


@pytest.mark.parametrize("labels, words", [
    ("1/4 1/2", "expected a word for 1 s, found '1/2'"), ("0.1000s 1s", "expected a word for 0.25 s"), ("1/4 1s", None), ("3 4", None),
    ("bulb B", None), ("0.25s 1/1", None), ("'1/4 s' '1 s'", None), ("1s 0.25s", "expected a word for 0.25 s, found '1s'")])
def test_labels_that_read_as_times(tmp_path, labels, words):
    path = session(tmp_path, "cam {file} {label}", camera={"labels": labels})
    r = run("stagectl", "capture", "--dry-run", path, code=1 if words else 0)
    assert not words or words in r.err


def test_the_man_pages_example(tmp_path):
    """gphoto2's lines as the man page has them are a session."""
    page = (Path(__file__).parents[2] / "man/stagectl.1").read_text().replace("\\-", "-")
    example = re.search(r"\.nf\n((?: .*gphoto2.*\n)(?: .*\n)*)", page).group(1)
    lines = [s[4:] for s in example.splitlines()]
    path = tmp_path / "s.conf"
    path.write_text("[grid]\nnodes = 2x2\nplane = 0 0 0 1 0 0 0 1 0\n[camera]\n" + "\n".join(lines) + "\nfolder = out\n")
    assert run("stagectl", "get", path, "camera.error_text").text == "*** Error\n"
    words = run("stagectl", "capture", "--dry-run", path).text
    assert "--set-config shutterspeed=1/1000 --capture-image-and-download --force-overwrite --filename 000_000/00.%C" in words


# ---- raw beside JPEG --------------------------------------------------------------------------------------------------

def pairs(tmp_path, body=(), **sections):
    sections.setdefault("grid", {"nodes": "2x1"})
    roll = tmp_path / "roll"
    for k, t in enumerate([(1, 4), (1, 1)]):
        photo(roll / f"{k}.jpg", t)
        write_dng(roll / f"{k}.DNG", np.full((64, 96), 900 + k), seconds=t)
    return jpegs(tmp_path, body, **sections)


def files(folder):
    return sorted(str(p.relative_to(folder)) for p in Path(folder).rglob("*") if p.is_file() and not p.name.startswith(".")
                  and p.name not in ("journal", "camera.log", "times.txt"))


BOTH = [f"{i}_0/{k}.{e}" for i in range(2) for k in range(2) for e in ("DNG", "jpg")]


def test_pairs_are_kept_and_verified(tmp_path, roll):
    path, out = pairs(tmp_path), tmp_path / "out"
    with Stage(tmp_path) as stage:
        take(path, stage)
        assert files(out) == BOTH and not list(out.glob(".shot*"))
        assert (out / "0_0/1.DNG").read_bytes() == (roll / "1.DNG").read_bytes()
        assert len([r for r in journal(out) if r[0] == "beside"]) == 4
        assert (out / "000_000/times.txt").read_text().count("jpg") == 2 and "DNG" not in (out / "000_000/times.txt").read_text()
        assert "0 taken now" in take(path, stage).err and files(out) == BOTH
        before = shots(out)
        (out / "1_0/0.DNG").unlink()
        assert "1_0/0.DNG: missing" in run("stagectl", "verify", path, code=1).err
        r = take(path, stage)
        assert "1_0/0.DNG: missing" in r.err and "(1 taken now)" in r.err and files(out) == BOTH
        assert set(before) == set(shots(out))
        with open(out / "0_0/1.DNG", "r+b") as f:
            f.seek(5000)
            f.write(b"x")
        assert "0_0/1.DNG: not as it was taken" in run("stagectl", "verify", path, code=1).err
        assert "(1 taken now)" in take(path, stage).err
    assert "0 missing or changed" in run("stagectl", "verify", path).text


@pytest.mark.parametrize("what", ["empty", "truncated", "foreign", "odd"])
def test_a_pair_with_a_bad_half_is_refused(tmp_path, roll, what):
    body = {"empty": ': > "$stem.DNG"', "truncated": 'head -c 3000 %s/0.DNG > "$stem.DNG"' % roll, "foreign": ":",
            "odd": 'echo x > "${stem}x.jpg"'}[what]
    path = pairs(tmp_path, [body], grid=ONE, camera={"retries": 1, "retry_wait": 0})
    if what == "foreign":
        (tmp_path / "out/0_0").mkdir(parents=True)
        (tmp_path / "out/0_0/0.DNG").write_text("mine")
    with Stage(tmp_path) as stage:
        r = take(path, stage, code=1)
    assert {"empty": "{stem}.DNG is empty", "truncated": "DNG", "foreign": "0_0/0.DNG: is there already and not from this session",
            "odd": "expected files beside {file} named {stem}.ENDING"}[what] in r.err
    assert not list((tmp_path / "out").rglob("*.jpg")) and not list((tmp_path / "out").glob(".shot*"))
    assert what != "foreign" or (tmp_path / "out/0_0/0.DNG").read_text() == "mine"


def test_stem_in_the_command_and_capital_endings(tmp_path, roll):
    """As gphoto2's %C: {file} is never named, and the card's endings are capitals."""
    pairs(tmp_path)
    for k in range(2):
        os.rename(roll / f"{k}.jpg", roll / f"{k}.JPG")
    path = session(tmp_path, f"{copying(tmp_path)} {{stem}}.any {{i}},{{j}},{{k}}", grid={"nodes": "2x1"}, output={"file": "{i}_{j}/{k}.jpg"})
    with Stage(tmp_path) as stage:
        take(path, stage)
        assert files(tmp_path / "out") == BOTH
        path = session(tmp_path, f"{copying(tmp_path)} {{stem}}.any {{i}},{{j}},{{k}}", output={"folder": "o2", "file": "{i}_{j}_{k}.png"})
        assert "expected a file that ends in .png as [output] file does, found .DNG .JPG" in take(path, stage, code=1).err.replace(".JPG .DNG", ".DNG .JPG")
    shell = session(tmp_path, "cp " + str(roll / "0.JPG") + " {stem}.JPG", grid=ONE, camera={"shell": "yes", "exposures": "0.25"},
                    output={"folder": "it's; o3", "file": "{i}_{j}/{k}.jpg"})
    with Stage(tmp_path) as stage:
        take(shell, stage)
    assert files(tmp_path / "it's; o3") == ["0_0/0.jpg"]


def test_the_raw_file_can_be_the_picture(tmp_path, roll):
    path = pairs(tmp_path, output={"file": "{i}_{j}/{k}.dng"})
    with Stage(tmp_path) as stage:
        take(path, stage)
    assert files(tmp_path / "out") == [f"{i}_0/{k}.{e}" for i in range(2) for k in range(2) for e in ("dng", "jpg")]


def test_pairs_after_kills_at_any_time(tmp_path, roll):
    """Thirty runs killed where chance has it: never half a pair, never a file too many."""
    path, out = pairs(tmp_path, grid={"nodes": "3x2"}), tmp_path / "out"
    rng = np.random.default_rng(5)
    with Stage(tmp_path, factor=1000) as stage:
        for _ in range(30):
            r = Run("--port", stage.port, "capture", path)
            time.sleep(0.02 + 0.5 * rng.random() ** 2)
            r.kill(signal.SIGKILL)
            r.end()
        assert not re.search("missing|not as|came with", take(path, stage).err)
    assert files(out) == [f"{i}_{j}/{k}.{e}" for i in range(3) for j in range(2) for k in range(2) for e in ("DNG", "jpg")]
    assert not list(out.glob(".shot*")) and "6 of 6 places finished, 12 exposures on record, 0 missing" in run("stagectl", "verify", path).text


def test_what_came_too_late_is_not_thrown_away(tmp_path, roll):
    """A file of a recorded exposure under its temporary name: as an older version left them."""
    path, out = jpegs(tmp_path, camera={"exposures": "0.25"}), tmp_path / "out"
    photo(roll / "any.jpg", (1, 4))
    with Stage(tmp_path) as stage:
        take(path, stage)
        temp = [r for r in journal(out) if r[0] == "shot"][0][9]
        (out / temp.replace(".jpg", ".nef")).write_text("late")
        (out / ".shot-0123456789abcdef.nef").write_text("of nobody")
        assert "0_0/0.nef: came with 0_0/0.jpg and is not on record" in take(path, stage).err
    assert (out / "0_0/0.nef").read_text() == "late" and not list(out.glob(".shot*"))


def test_taken_anew_without_the_raw_half(tmp_path, roll):
    path, out = pairs(tmp_path, grid=ONE), tmp_path / "out"
    with Stage(tmp_path) as stage:
        take(path, stage)
        for f in roll.glob("*.DNG"):
            f.unlink()
        r = take(path, stage, more=["--anew"])
    assert r.err.count("removed, it came with the exposure that was taken anew") == 2 and files(out) == ["0_0/0.jpg", "0_0/1.jpg"]


# ---- what a command leaves behind ---------------------------------------------------------------------------------------

SERVER = "import os, sys, time\nif os.fork() == 0:\n    os.setsid()\n    open(sys.argv[1], 'w').write(str(os.getpid()))\n    time.sleep(30)\nwhile not os.path.exists(sys.argv[1]):\n    time.sleep(.01)\n"


def alive(pid):
    return execute(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout.strip()[:1] not in ("", "Z")


def test_a_server_left_behind_holds_nothing_up(tmp_path, roll):
    """As adb does: its first call starts a server in a session of its own that inherits what there is."""
    photo(roll / "any.jpg", (1, 4))
    server = script(tmp_path, SERVER, "server.py")
    body = f'[ -e {tmp_path}/pid ] || {PYTHON} {server} {tmp_path}/pid'
    path = jpegs(tmp_path, [body, f'[ -e {tmp_path}/go ] || exit 9'], camera={"exposures": "0.25", "timeout": 600})
    with Stage(tmp_path) as stage:
        take(path, stage, code=1)
        while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text():
            time.sleep(0.01)
        pid = int((tmp_path / "pid").read_text())
        try:
            assert alive(pid)
            ours = [os.readlink(f) for f in Path(f"/proc/{pid}/fd").iterdir()]
            assert not [f for f in ours if f.endswith(("/.camera", "/.lock", "/journal")) or "pts" in f], ours
            (tmp_path / "go").touch()
            r = take(path, stage)
            assert "at work" not in r.err and alive(pid)
        finally:
            os.kill(pid, signal.SIGKILL)


def test_a_camera_left_behind_is_waited_for_and_named(tmp_path, roll):
    """A killed run's command is killed with it, but not what the command had started."""
    photo(roll / "any.jpg", (1, 4))
    body = f'if [ ! -e {tmp_path}/go ]; then sleep 47 & echo $! > {tmp_path}/pid; wait; fi'
    path = jpegs(tmp_path, [body], camera={"exposures": "0.25", "timeout": 600})
    with Stage(tmp_path) as stage:
        r = Run("--port", stage.port, "capture", path)
        while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text().strip():
            time.sleep(0.01)
        r.kill(signal.SIGKILL)
        r.end()
        pid = int((tmp_path / "pid").read_text())
        (tmp_path / "go").touch()
        short = jpegs(tmp_path, [body], camera={"exposures": "0.25", "timeout": 0.5})
        words = take(short, stage, code=1).err
        assert f"still at work (process {pid}, sleep)" in words and f"does not end: process {pid}, sleep; end it (kill {pid})" in words
        waiting = Run("--port", stage.port, "capture", path)
        time.sleep(0.5)
        assert waiting.process.poll() is None
        os.kill(pid, signal.SIGTERM)
        assert waiting.end()[0] == 0


def test_who_has_the_session(tmp_path, roll):
    photo(roll / "any.jpg", (1, 4))
    path = jpegs(tmp_path, [f"touch {tmp_path}/asked; [ -e {tmp_path}/go ] || sleep 600"], camera={"exposures": "0.25", "timeout": 600})
    with Stage(tmp_path) as stage:
        r = Run("--port", stage.port, "capture", path)
        while not (tmp_path / "asked").exists():
            time.sleep(0.01)
        assert f"in use by another stagectl, process {r.process.pid}:" in take(path, stage, code=1).err
        r.kill(signal.SIGINT)
        assert r.end()[0] == 130


# ---- failures gone on from ------------------------------------------------------------------------------------------

def test_retries_wait(tmp_path, roll):
    photo(roll / "any.jpg", (1, 4))
    body = f"date +%s.%N >> {tmp_path}/times; [ $(wc -l < {tmp_path}/times) -ge 3 ] || exit 3"
    path = jpegs(tmp_path, [body], camera={"exposures": "0.25", "retries": 2, "retry_wait": 0.7})
    with Stage(tmp_path) as stage:
        assert take(path, stage).err.count("trying again") == 2
        at = [float(s) for s in (tmp_path / "times").read_text().split()]
        assert min(b - a for a, b in zip(at, at[1:])) >= 0.7
    assert "retry_wait = 1\n" in run("stagectl", "keys").text


def test_an_interrupt_while_a_retry_waits(tmp_path):
    path = jpegs(tmp_path, [f"touch {tmp_path}/asked"], camera={"retries": 5, "retry_wait": 600})
    with Stage(tmp_path) as stage:
        r = Run("--port", stage.port, "capture", path)
        while not (tmp_path / "asked").exists():
            time.sleep(0.01)
        time.sleep(0.2)
        r.kill(signal.SIGTERM)
        assert r.end()[0] == 143


def test_skip_goes_on_and_comes_back(tmp_path, roll):
    """At two places the camera fails at first: they come last, the others in their order."""
    photo(roll / "0.jpg", (1, 4))
    photo(roll / "1.jpg", (1, 1))
    body = f'case "$2" in 0,0,1|1,1,0) if [ ! -e {tmp_path}/"$2" ]; then touch {tmp_path}/"$2"; exit 5; fi;; esac'
    path = jpegs(tmp_path, [body], grid={"nodes": "3x2"}, camera={"on_fail": "skip"})
    with Stage(tmp_path) as stage:
        r = take(path, stage)
    assert r.err.count("left for the end") == 2 and "6 places, 12 exposures on disk (12 taken now)" in r.err
    order = [w[1] + w[2] for w in journal(tmp_path / "out") if w[0] == "done"]
    assert order == ["10", "20", "21", "01", "00", "11"]
    assert "6 of 6 places finished" in run("stagectl", "verify", path).text
    first = [w[1:4] for w in journal(tmp_path / "out") if w[0] == "shot"]
    assert first[0] == ["0", "0", "0"] and first.count(["0", "0", "0"]) == 1    # what it had there is not taken again


def test_skip_with_a_place_that_never_works(tmp_path, roll):
    photo(roll / "0.jpg", (1, 4))
    photo(roll / "1.jpg", (1, 1))
    path = jpegs(tmp_path, ['case "$2" in 1,0,*) exit 5;; esac'], grid={"nodes": "3x1"}, camera={"on_fail": "skip"})
    with Stage(tmp_path) as stage:
        r = take(path, stage, code=1)
        assert "1 place is still without all exposures; the last: node 1,0 exposure 0: camera: exit code 5" in r.err
        assert len([w for w in journal(tmp_path / "out") if w[0] == "done"]) == 2
        assert "4 exposures on record" in run("stagectl", "verify", path, code=1).text
        jpegs(tmp_path, grid={"nodes": "3x1"}, camera={"on_fail": "skip"})         # the camera is mended
        assert "6 exposures on disk (2 taken now)" in take(path, stage).err


def test_keep_trying_over_a_camera_that_comes_back(tmp_path, roll):
    photo(roll / "any.jpg", (1, 4))
    body = f"echo x >> {tmp_path}/calls; [ $(wc -l < {tmp_path}/calls) -ge 3 ] || exit 3"
    path = jpegs(tmp_path, [body], grid={"nodes": "2x1"}, camera={"exposures": "0.25"})
    with Stage(tmp_path) as stage:
        r = take(path, stage, more=["--keep-trying"])
    assert r.err.count("exit code 3; keeps trying") == 1 and "2 exposures on disk (2 taken now)" in r.err


@pytest.mark.parametrize("fault", ["reboot@4", "alarm1@4", "error9@4"])
def test_keep_trying_over_what_the_stage_does(tmp_path, fault):
    """Homed anew, it goes on where it was: every picture is taken at its place, each once."""
    with Stage(tmp_path, "--fault", fault) as stage:
        path = session(tmp_path, asking_camera(tmp_path, stage, "{i},{j},{k},{mx},{my}"))
        r = take(path, stage, more=["--keep-trying"])
    assert r.err.count("keeps trying") == 1 and "12 exposures on disk (12 taken now)" in r.err
    rows = [s.split() for s in (tmp_path / "where").read_text().splitlines()]
    assert len({tuple(s[:3]) for s in rows}) == len(rows) == 12
    for i, j, _, mx, my, x, y, speed in rows:
        assert abs(float(x) - (-500 + 100 * int(i))) < 0.01 and abs(float(y) - (-400 + 100 * int(j))) < 0.01 and float(speed) == 0


def test_keep_trying_survives_another_name_of_the_port(tmp_path, roll):
    """The stage is unplugged in a move and comes back as another device: the name in by-id leads to it."""
    photo(roll / "any.jpg", (1, 4))
    ids, path = tmp_path / "by-id", jpegs(tmp_path, grid={"nodes": "3x1"}, camera={"exposures": "0.25"})
    ids.mkdir()
    other = tmp_path / "second"
    other.mkdir()
    with Stage(tmp_path, "--fault", "unplug@2") as first:
        device = os.path.realpath(first.port)
        (ids / "usb-1a86_stage-if00-port0").symlink_to(device)
        process = Process([str(run.__globals__["BIN"] / "stagectl"), "--keep-trying", "--port", device, "capture", str(path)],
                          stderr=subprocess.PIPE, env=environment(STAGECTL_BY_ID=str(ids)), text=True)
        line = ""
        while "keeps trying" not in line:
            line = process.stderr.readline()
            assert line
        assert "disconnected" in line
        (ids / "usb-1a86_stage-if00-port0").unlink()
        held = [os.openpty() for _ in range(3)]         # or the kernel gives it the same number
        with Stage(other) as second:
            assert os.path.realpath(second.port) != device
            (ids / "usb-1a86_stage-if00-port0").symlink_to(os.path.realpath(second.port))
            err = process.communicate()[1]
        for fd in sum(held, ()):
            os.close(fd)
    assert process.returncode == 0 and "3 exposures on disk (3 taken now)" in err


def test_keep_trying_knows_what_is_not_worth_it(tmp_path, roll):
    photo(roll / "any.jpg", (1, 4))
    path = jpegs(tmp_path, camera={"exposures": "0.25"})
    assert "No such file" in run("stagectl", "--keep-trying", "--port", tmp_path / "none", "capture", path, code=1).err
    far = jpegs(tmp_path, stage={"origin": "-5000 0"}, output={"folder": "o2"})
    with Stage(tmp_path) as stage:
        assert "expected x from" in run("stagectl", "--keep-trying", "--port", stage.port, "capture", far, code=1).err


# ---- gphoto2 itself ---------------------------------------------------------------------------------------------------

@pytest.fixture
def nikon(tmp_path):
    """Environment in which Debian's gphoto2 has the Nikon D750 of the Python package's vusb library."""
    spec = importlib.util.find_spec("gphoto2")
    vusb = Path(spec.origin).parent / "libgphoto2" / "vusb" if spec else None
    needed("gphoto2")
    assert vusb and vusb.is_dir(), "the Python package gphoto2 has no virtual camera (setup/requirements.txt)"
    card = tmp_path / "card/DCIM/100NIKON"
    card.mkdir(parents=True)
    photo(card / "DSC_0001.JPG", (1, 10), 5.6, 100)
    env = environment(IOLIBS=str(vusb), VCAMERADIR=str(tmp_path / "card"), LC_ALL="C.UTF-8", LANGUAGE="fr")
    assert "D750" in execute(["gphoto2", "--auto-detect"], env=env, capture_output=True, text=True).stdout, "the virtual Nikon does not show up"
    return env


def test_gphoto2s_roundings_and_refusals(tmp_path, nikon):
    """Exit code 0 three times, measured: an unknown word, a speed that is rounded (0.25 s is taken at 0.1 s), one that fits."""
    line = "gphoto2 --set-config shutterspeed={label} --get-config shutterspeed --capture-image-and-download --force-overwrite --filename {stem}.%C"
    with Stage(tmp_path) as stage:
        def go(folder, exposures, labels, code, **camera):
            path = session(tmp_path, line, grid=ONE, camera={"exposures": exposures, "labels": labels, "timeout": 600, **camera},
                           output={"folder": folder, "file": "{i}_{j}/{k}.jpg"})
            return run("stagectl", "--port", stage.port, "capture", path, env=nikon, code=code).err
        assert "asked for 0.25 s, the picture says 0.1 s (a factor 0.4" in go("o1", "0.25", "0.25s", 1)
        assert "expected it to say 'Current: 0.25s'" in go("o2", "0.25", "0.25s", 1, expect_text="Current: {label}")
        assert re.search(r"it said '\*\*\* Error': .*Failed to set new configuration value fast", go("o3", "0.1", "fast", 1))
        assert "asked for 0.25 s, the picture says 0.1 s: so it stands in the list" in go("o4", "0.25", "0.25s", 0, times="exif")
        assert (tmp_path / "o4/000_000/times.txt").read_text().endswith("0.jpg 0.1\n")
        assert "says" not in go("o5", "0.1", "0.1000s", 0)
    assert files(tmp_path / "o5") == ["0_0/0.jpg"]


def test_gphoto2_saving_two_files_under_one_name(tmp_path):
    """A body set to raw + JPEG: gphoto2 says so of each file, and --filename {file} would leave one of them."""
    photo(tmp_path / "x.jpg", (1, 4))
    two = f"cp {tmp_path}/x.jpg \"$1\"; echo 'Saving file as 1'; echo 'Saving file as 1'"
    fake = script(tmp_path, f"#!/bin/sh\n{two}\n", "gphoto2")
    path = session(tmp_path, f"{fake} {{file}}", grid=ONE, camera={"exposures": "0.25"}, output={"file": "{i}_{j}/{k}.jpg"})
    with Stage(tmp_path) as stage:
        assert "it saved 2 files under one name" in take(path, stage, code=1).err


# ---- the same picture at the same place -------------------------------------------------------------------------------

# What a camera sees that stands where the stage truly is: waves, 10 pixels a mm; its noise, and a lamp of any strength.
LOOKING = """import math, os, random, socket, sys
truth, mx, my, out = sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), sys.argv[4]
with socket.socket(socket.AF_UNIX) as s:
    s.connect(truth)
    x, y = map(float, s.makefile().readline().split()[:2])
lamp = float(open(sys.argv[5]).read()) if os.path.exists(sys.argv[5]) else 1
dx, dy, n = 10 * (x - mx), 10 * (y - my), 96
noise = random.Random()
def value(i, j):
    u, v = i - dx, j - dy
    w = 3 + math.sin(u / 7) + math.cos(v / 5 + 1) + math.sin((u + v) / 11)
    return min(255, max(0, round(lamp * 35 * w + noise.gauss(0, 1))))
open(out, "wb").write(b"P5\\n96 96\\n255\\n" + bytes(value(i, j) for j in range(n) for i in range(n)))
"""


def looking(tmp_path, stage, **sections):
    command = f"{PYTHON} {script(tmp_path, LOOKING, 'looking.py')} {stage.truth_path} {{mx}} {{my}} {{file}} {tmp_path}/lamp"
    sections.setdefault("grid", {"nodes": "6x1"})
    return session(tmp_path, command, camera={"exposures": "0.25", "check_picture": 2, **sections.pop("camera", {})},
                   output={"file": "{i}_{j}/{k}.pgm"}, **sections)


def checks(folder):
    return [list(map(float, r[1:])) for r in journal(folder) if r[0] == "check"]


def test_the_same_picture_at_the_same_place(tmp_path):
    with Stage(tmp_path) as stage:
        r = take(looking(tmp_path, stage), stage)
        assert "differs" not in r.err and "6 exposures on disk (6 taken now)" in r.err
        found = checks(tmp_path / "out")
        assert len(found) == 3 and all(c[:3] == [0, 0, 0] and c[3] < 2 * c[4] and abs(c[5]) < 0.3 and abs(c[6]) < 0.3 for c in found)
    assert not list((tmp_path / "out").glob(".shot*")) and "0 missing" in run("stagectl", "verify", tmp_path / "session.conf").text


def test_lost_steps_show_in_the_picture(tmp_path):
    """Two mm are lost in the seventh move: the next check says so, and which places are in doubt."""
    with Stage(tmp_path, "--fault", "slip@7") as stage:
        r = take(looking(tmp_path, stage), stage)
        where = [c for c in checks(tmp_path / "out") if c[3] > 0.3]
        said = re.findall(r"node 0,0 differs .* displaced by ([-\d.]+),([-\d.]+) pixels: .* in doubt: the (\d) places? from node (\d),0 on", r.err)
        assert said and len(said) == len(where)
    assert [s[2:] for s in said] == [("2", "2"), ("4", "2")]       # until a check agrees they grow in number


def test_another_lamp_is_no_other_place(tmp_path):
    with Stage(tmp_path) as stage:
        path = looking(tmp_path, stage, grid={"nodes": "2x1"})
        take(path, stage)
        (tmp_path / "lamp").write_text("0.8")
        shutil.rmtree(tmp_path / "out/1_0")
        assert "differs" not in take(path, stage).err      # a session gone on with is checked before its first place
        assert len(checks(tmp_path / "out")) == 3


def test_a_camera_that_was_pushed_overnight(tmp_path):
    """0.1 mm is a pixel here: found to a tenth, with its sign, before the first place of the second day."""
    with Stage(tmp_path) as stage:
        path = looking(tmp_path, stage, grid={"nodes": "2x1"})
        take(path, stage)
        shutil.rmtree(tmp_path / "out/1_0")
        text = (tmp_path / "looking.py").read_text()
        script(tmp_path, text.replace("10 * (x - mx), 10 * (y - my)", "0.8, -0.5"), "looking.py")
        err = take(path, stage).err
    dx, dy = map(float, re.search(r"displaced by ([-\d.]+),([-\d.]+) pixels: camera, stage or light has changed; in doubt: what is", err).groups())
    assert dx == pytest.approx(0.8, abs=0.1) and dy == pytest.approx(-0.5, abs=0.1)
