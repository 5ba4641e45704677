"""ilflamps on a single probe: lamps lie on the geometry that their directions meet, and give the light that their texels gave."""
import json

import ilf
import numpy as np
import pytest
from conftest import run
from ilf_util import directional_ilf, unit, write_ilf

ROOM = np.array([6, 5, 2.8])
AT = np.array([2.5, 3, 1.2])
PANEL = dict(c=np.array([4., 2.2, 2.8]), half=(.24, .12), rgb=np.array([90., 80, 60]))     # on the ceiling
DISC = dict(c=np.array([0, 1.5, 1.9]), r=.25, rgb=np.array([20., 40, 80]))               # on the wall x = 0


def hits(o, d):
    t = np.min(np.where(d > 0, (ROOM - o) / np.where(d == 0, 1e-9, d), -o / np.where(d == 0, 1e-9, d)), axis=-1)
    return o + t[..., None] * d


def light(x):
    """What shines at a point of the room's surfaces."""
    rgb = np.ones((*x.shape[:-1], 3)) * (.4 + .1 * np.sin(x[..., :1]))
    panel = (np.abs(x[..., 2] - 2.8) < 1e-6) & (np.abs(x[..., 0] - PANEL["c"][0]) < PANEL["half"][0]) & (np.abs(x[..., 1] - PANEL["c"][1]) < PANEL["half"][1])
    disc = (np.abs(x[..., 0]) < 1e-6) & (np.linalg.norm(x - DISC["c"], axis=-1) < DISC["r"])
    rgb[panel], rgb[disc] = PANEL["rgb"], DISC["rgb"]
    return rgb


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    here = tmp_path_factory.mktemp("one")
    S = 3                                                               # rays along a texel's sides

    def seen(d):
        return light(hits(AT, d))
    fine = directional_ilf(seen, 512 * S, 256 * S, polar_max=np.pi)
    f = directional_ilf(lambda d: d * 0 + 1, 512, 256, polar_max=np.pi, origin=AT - [3, 2.5, 0], U=(6, 0, 0), V=(0, 5, 0))
    f.probes = fine.probes.reshape(1, 1, 256, S, 512, S, 3).mean((3, 5))
    write_ilf(here / "a.ilf.exr", f)
    (here / "walls.rad").write_bytes(b"void plastic w 0 0 5 .5 .5 .5 0 0\n" + run("genbox", "w", "room", *ROOM).out)
    (here / "walls.oct").write_bytes(run("oconv", here / "walls.rad").out)
    r = run("ilflamps", "--geometry", here / "walls.oct", "--report", here / "r.json", "-t", "float", "-o", here / "b.ilf.exr", here / "a.ilf.exr")
    return here, json.loads((here / "r.json").read_text())["lamps"], r.err


def test_lamps_lie_where_their_directions_meet_the_room(room):
    _, lamps, err = room
    assert [l["fate"] for l in lamps] == ["taken out"] * 2 and "2 lie on the surroundings" in err
    panel, disc = sorted(lamps, key=lambda l: -l["position"][2])
    assert panel["shape"] == "rectangle" and disc["shape"] == "disc"
    assert np.allclose(panel["position"], PANEL["c"], atol=.02) and np.allclose(disc["position"], DISC["c"], atol=.02)
    sides = sorted((np.abs(panel["a"]), np.abs(panel["b"])), key=lambda v: -np.linalg.norm(v))
    assert np.allclose(sides, [[.24, 0, 0], [0, .12, 0]], atol=.015)
    assert np.linalg.norm(disc["a"]) == pytest.approx(.25, abs=.02) and np.linalg.norm(disc["b"]) == pytest.approx(.25, abs=.02)
    assert np.abs(disc["a"])[0] < .01 and np.abs(disc["b"])[0] < .01                        # on the wall
    assert np.allclose(panel["radiance"], PANEL["rgb"], rtol=.04) and np.allclose(disc["radiance"], DISC["rgb"], rtol=.06)


def test_light_falls_off_and_moves_as_in_the_room(room):
    """Irradiance anywhere in the room is that of the room itself, the lamps at their true places."""
    here = room[0]
    n = 500
    r, t = np.sqrt((np.arange(n) + .5) / n)[:, None], 2 * np.pi * (np.arange(n) + .5) / n
    d = np.stack([r * np.cos(t), r * np.sin(t), np.sqrt(1 - r**2) * np.ones(n)], -1).reshape(-1, 3)
    with ilf.open(here / "a.ilf.exr") as one, ilf.open(here / "b.ilf.exr") as two:
        for o in np.array([[2.5, 3, 1.2], [.8, 1.5, .1], [4, 2.2, .1], [4, 2.2, 2], [5.5, 4.5, .1]]):
            h = hits(o, d)
            true, old, new = light(h).mean(0), one.eval(o, d, h).mean(0), two.eval(o, d, h).mean(0)
            assert np.allclose(new, true, rtol=.03), o
            assert np.allclose(old, true, rtol=.06), o


def test_without_geometry_it_is_said(room, tmp_path):
    r = run("ilflamps", "-o", tmp_path / "b.ilf.exr", room[0] / "a.ilf.exr")
    assert "--geometry" in r.err and "version 1\n" in run("ilfinfo", "--header", tmp_path / "b.ilf.exr").text


def test_clipped_lamps_are_said(room, tmp_path):
    f = directional_ilf(lambda d: np.where(unit(d) @ unit(np.array([.3, .2, 1.]))[:, None] > .99, 50., .2) * np.ones(3), 256, 128, polar_max=np.pi,
                        origin=AT - [.5, .5, 0])
    r = run("ilflamps", "--geometry", room[0] / "walls.oct", "--report", tmp_path / "r.json", write_ilf(tmp_path / "c.ilf.exr", f))
    assert "share the largest value of red (50)" in r.err and "clipped" in r.err
