"""scenes/panoramas.mk: from exposures of places to their panoramas and the call of ilfpack, stopped and gone on with.

ilfpack is another's: here a program of its name that writes down what it was asked (its own tests are elsewhere).
"""
import shutil

import numpy as np
import pytest
from PIL import Image

import exif_util
import fishremap_util as U
from conftest import BUILD, TOP, environment
from process import execute
from test_fishremap_dual import lit
from test_fishremap_panorama import panorama, pose

TIMES = (1 / 125, 1 / 30, 1 / 8, 1 / 2, 2)
SCENE = U.lobes(count=8, sharpest=1.5)
LIST = """# a room
#: fishremap --size 128x64
#: ilfpack --grid 2x2   --plane "0 0 0  1 0 0  0 1 0"

a/ 0 0 0 0
  P02_*.jpg 1 0 .5 40 1 2   # by the door
deep/c.exr, 0 1 0 80
#: hdrgen --weight debevec
"""


def codes(light, t, seed):
    e = np.clip(light * t + np.random.default_rng(seed).normal(0, 5e-4, light.shape), 0, 1)
    return np.round(255 * np.where(e <= .0031308, 12.92 * e, 1.055 * e ** (1 / 2.4) - .055)).astype(np.uint8)


def exposures(folder, light, stem="x", exif=False):
    """Files of one place; times in a list beside them, or in their EXIF."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = []
    for k, t in enumerate(TIMES):
        name = f"{stem}{k}.{'jpg' if exif else 'png'}"
        if exif:
            exif_util.save(folder / name, codes(light, t, k), {33434: (5, [exif_util.rational(t)]), 34855: (3, [100])})
        else:
            Image.fromarray(codes(light, t, k)).save(folder / name)
        lines.append(f"{name} {t:.6g}\n")
    if not exif:
        (folder / "times.txt").write_text("# seconds\n" + "".join(lines))


@pytest.fixture
def room(tmp_path):
    folder = tmp_path / "room"
    exposures(folder / "a", SCENE(panorama(192, 96, pose(0))))
    exposures(folder, SCENE(panorama(192, 96, pose(40))), "P02_", exif=True)
    (folder / "deep").mkdir()
    U.write_exr(folder / "deep" / "c.exr", SCENE(panorama(192, 96, pose(80))))
    (folder / "positions.txt").write_text(LIST)
    bin_folder = tmp_path / "build" / "bin"
    bin_folder.mkdir(parents=True)
    for name in ("hdrgen", "fishremap"):
        shutil.copy(BUILD / "bin" / name, bin_folder / name)
    (bin_folder / "ilfpack").write_text('#!/bin/sh\nfor a in "$@"; do echo "$a"; done > asked\nwhile [ "$1" != -o ]; do shift; done\ncp asked "$2"\n')
    (bin_folder / "ilfpack").chmod(0o755)
    return folder


def made(room, *goals, code=0, after=""):
    p = execute(["make", "-C", TOP / "scenes", f"PANORAMAS={room}/positions.txt", f"BUILD={room.parent}/build", "QUIET=--quiet", "-j2", *goals],
                env=environment(MAKEFLAGS="", MAKELEVEL=""), capture_output=True, text=True)
    assert p.returncode == code, p.stdout + p.stderr
    return p


def stamps(room):
    return {p.name: p.stat().st_mtime_ns for p in (room / "field").glob("*.*") if p.name[0] != "."}


def others(before, after):
    return {name for name in after if after[name] != before.get(name)}


def test_places_become_panoramas_on_one_scale(room):
    p = made(room)
    assert "light field" in p.stdout
    field = room / "field"
    for name, heading in (("a", 0), ("P02", 40), ("c", 80)):
        got = U.read_exr(field / (f"deep_{name}.exr" if name == "c" else f"{name}.exr"))[0]
        want = SCENE(panorama(128, 64, pose(heading)))
        ratio = got[..., :3].sum() / want.sum()
        # of an exposure its highest code in a second is 1, as is the scene's here
        assert ratio == pytest.approx(1, rel=.04) and np.abs(got / ratio / want - 1).mean() < .03
    asked = (field / "room.ilf.exr").read_text().splitlines()
    assert asked == ["--quiet", "--grid", "2x2", "--plane", "0 0 0 1 0 0 0 1 0", "--positions", f"{field}/positions.txt", "-o", f"{field}/room.ilf.exr",
                     *(f"{field}/{n}.exr" for n in ("a", "P02", "deep_c"))]
    # line by line as it was
    lines, ours = LIST.splitlines(), (field / "positions.txt").read_text().splitlines()
    assert ours == [line.replace("a/ ", "a.exr ").replace("  P02_*.jpg", "P02.exr").replace("deep/c.exr,", "deep_c.exr,") for line in lines]


def test_only_what_has_changed_is_made_again(room):
    made(room)
    before = stamps(room)
    assert made(room).stdout.count("light field") == 0 and stamps(room) == before
    # an exposure: its place and the field; the response is not its own
    Image.open(room / "P02_4.jpg").save(room / "P02_4.jpg", exif=Image.open(room / "P02_4.jpg").getexif().tobytes())
    made(room)
    after = stamps(room)
    assert others(before, after) == {"P02.merged.exr", "P02.exr", "room.ilf.exr", "room.ilf.programs"}
    # a lost panorama
    (room / "field/a.exr").unlink()
    made(room)
    assert others(after, stamps(room)) == {"a.exr", "room.ilf.exr", "room.ilf.programs"}
    after = stamps(room)
    # a place's position: the field alone
    (room / "positions.txt").write_text(LIST.replace("1 0 .5 40", "1 0 .6 40"))
    made(room)
    assert others(after, stamps(room)) == {"positions.txt", "room.ilf.exr", "room.ilf.programs"}
    after = stamps(room)
    # an option of fishremap: all panoramas, no merge
    (room / "positions.txt").write_text(LIST.replace("128x64", "96x48"))
    made(room)
    changed = others(after, stamps(room))
    assert {"a.exr", "P02.exr", "deep_c.exr"} <= changed and not any("merged" in n or "response" in n for n in changed)
    # a place less
    (room / "positions.txt").write_text("\n".join(line for line in LIST.replace("128x64", "96x48").splitlines() if "P02" not in line))
    made(room)
    assert "P02" not in (room / "field/room.ilf.exr").read_text()


def test_masks_and_the_goal_before_the_field(room):
    """One for all, and one of a place's own; what they hide is alpha."""
    mask = np.full((96, 192), 255, np.uint8)
    mask[80:] = 0
    Image.fromarray(mask).save(room / "mask.png")
    mask[:40] = 0
    Image.fromarray(mask).save(room / "a" / "mask.png")
    made(room, "panoramas")
    assert not (room / "field/room.ilf.exr").exists()
    a, c = (U.read_exr(room / f"field/{n}.exr")[0] for n in ("a", "deep_c"))
    for image, top in ((a, True), (c, False)):
        alpha = image[..., 3]
        assert (alpha[54:] == 0).all() and (alpha[30:52] == 1).all() and ((alpha[:25] == 0).all() if top else (alpha[:25] == 1).all())


def test_two_circles(room):
    exposures(room / "a", lit(SCENE, fov=200, n=96))
    (room / "positions.txt").write_text("#: fishremap --dual --lens equidistant --fov 200 --size 128x64\n#: hdrgen --response srgb\na 0 0 0\n")
    made(room)
    got, want = U.read_exr(room / "field/a.exr")[0], SCENE(panorama(128, 64))
    assert np.abs(got[..., :3] / want - 1).mean() < .05
    assert not (room / "field/response.txt").exists()


def test_single_exposures_count_as_srgb(room):
    (room / "positions.txt").write_text("#: fishremap --size 96x48\na/x1.png 0 0 0\nP02_2.jpg 1 0 0\n")
    made(room, "panoramas")
    for name, heading, t in (("a_x1", 0, 1), ("P02_2", 40, TIMES[2])):      # the JPEG states its time, the PNG counts as of a second
        got = U.read_exr(room / f"field/{name}.exr")[0][..., :3]
        want = SCENE(panorama(96, 48, pose(heading))) * (TIMES[1] if t == 1 else 1)
        sure = want.max(-1) * (1 if t == 1 else t) < .9
        assert sure.mean() > .3 and np.abs(got / want - 1)[sure].mean() < .1


@pytest.mark.parametrize("text, words", [
    ("", ("expected lines",)), ("# nothing\n", ("expected lines",)), ("b 0 0 0\n", ("nothing for b",)), ("a 0 0 0\nq*.jpg 0 0 0\n", ("nothing for q*.jpg",)),
    ("a 0 0 0\na/ 1 0 0\n", ("each place once", "a")), ('"a b" 0 0 0\n', ("blanks",)), ("#: hdrcreate -x\na 0 0 0\n", ("hdrcreate",)),
    ("#: fishremap --sizes 3\na 0 0 0\n", ("--sizes",)), ("#: hdrgen --response nothing.txt\na 0 0 0\n", ("nothing.txt",))])
def test_lists_that_cannot_be_meant(room, text, words):
    (room / "positions.txt").write_text(text)
    p = made(room, code=2)
    for w in words:
        assert w in p.stderr
    assert not (room / "field/a.exr").exists() and not (room / "field/a.merged.exr").exists()


def test_a_list_that_is_not_there():
    p = execute(["make", "-C", TOP / "scenes", "PANORAMAS=none/positions.txt"], capture_output=True, text=True)
    assert p.returncode == 2 and "none/positions.txt is not there" in p.stderr
