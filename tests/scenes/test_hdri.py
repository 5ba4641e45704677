"""scenes/hdri.mk: one panorama and a room's size become a room whose light is the panorama's, seen from where it was taken, and moves elsewhere."""
import re

import numpy as np
import pytest

import fishremap_util as U
from conftest import BUILD, TOP, environment, run
from ilf_util import random_directions
from process import execute
from test_fishremap_panorama import panorama, pose

SCENE = U.lobes(count=8, sharpest=1.2)
ROOM, AT, HEADING = np.array([6, 5, 2.8]), np.array([2.5, 3, 1.2]), -30


def made(folder, *words, code=0):
    p = execute(["make", "-C", TOP / "scenes", f"BUILD={BUILD}", "QUIET=--quiet", f"HDRI={folder}/a.exr", *words], env=environment(MAKEFLAGS="", MAKELEVEL=""),
                capture_output=True, text=True)
    assert (p.returncode != 0) == (code != 0), p.stdout + p.stderr
    return p


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    here = tmp_path_factory.mktemp("hdri")
    U.write_exr(here / "a.exr", SCENE(panorama(256, 128, pose(HEADING))))
    made(here, "ROOM=6 5 2.8", "AT=2.5 3 1.2", f"HEADING={HEADING}", "SIZE=256x128")
    return here


def walls(o, d):
    t = np.min(np.where(d > 0, (ROOM - o) / d, -o / d), axis=-1)
    return o + t[:, None] * d


def test_rays_up_and_down_see_what_the_panorama_saw_of_their_walls(room):
    (room / "o.oct").write_bytes(run("oconv", room / "a.field" / "room.rad").out)
    rng = np.random.default_rng(3)
    d = random_directions(rng, 400)
    for o in (AT, [4, 1, .3], [1, 4, 2.5]):
        rays = np.concatenate([np.tile(o, (400, 1)), d], 1)
        found = np.frombuffer(run("rtrace", "-h", "-ffd", "-ab", "0", "-di", "0", room / "o.oct", stdin=rays.astype("<f4").tobytes()).out, "<f8").reshape(-1, 3)
        e = walls(np.array(o), d) - AT
        expected = SCENE(e / np.linalg.norm(e, axis=1)[:, None])
        assert np.quantile(np.abs(found / expected - 1), .98) < .03


def test_a_second_make_does_nothing_and_another_place_makes_it_anew(room):
    light = room / "a.field" / "up.ilf.exr"
    before = light.stat().st_mtime_ns
    made(room, "ROOM=6 5 2.8", "AT=2.5 3 1.2", f"HEADING={HEADING}", "SIZE=256x128")
    assert light.stat().st_mtime_ns == before
    made(room, "ROOM=6 5 2.8", "AT=2.5 2 1.2", f"HEADING={HEADING}", "SIZE=256x128", f"FIELD={room}/other")
    origin = re.search(r"origin +(\S+) (\S+) (\S+)", run("ilfinfo", "--header", room / "other" / "up.ilf.exr").text)
    assert np.allclose(np.array(origin.groups(), float), [-.5, -1, 1.2], atol=1e-3)          # of a square of 6


@pytest.mark.parametrize("words, told", [
    (("AT=1 1 1",), "expected ROOM="), (("ROOM=6 5 2.8",), "expected AT="), (("ROOM=6 5 2.8", "AT=1 1 3"), "expected AT within the room"),
    (("ROOM=6 5 high", "AT=1 1 1"), "expected numbers"), (("GEOMETRY=none.rad", "AT=1 1 1"), "is not there")])
def test_refusals(room, words, told):
    p = made(room, *words, f"FIELD={room}/never", code=2)
    assert told in p.stderr and not (room / "never").exists()
