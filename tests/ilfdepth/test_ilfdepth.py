"""ilfdepth in rooms whose distances are known (bench/lamps/rooms.py): maps, meshes, and what must not matter (turns, mirrors, copies, threads)."""
import json
import sys
from collections import Counter

import numpy as np
import pytest
from conftest import TOP, run
from ilf_util import ILF, Lamp, write_ilf

sys.path.insert(0, str(TOP / "bench" / "lamps"))
import rooms                                                           # noqa: E402

NT, NP, N = 96, 48, 4
LO, HI = (-2.1, -2.6, -.001), (2.4, 1.9, 2.3)
COARSE = ("--width", 48)                                              # where what is compared needs no more
UNIT = dict(lo=LO, hi=HI)
CARD = rooms.tilted((0, 0, 3), (.1, -.1), 1.1, .33, .3, 0, 0, 20, (.15, .2, .3))
PLAIN, CARDED = rooms.Room([], **UNIT), rooms.Room([CARD], **UNIT)


def directions(nt, np_, polar_max):
    t, p = np.meshgrid(-np.pi + (np.arange(nt) + .5) * 2 * np.pi / nt, (np.arange(np_) + .5) * polar_max / np_)
    return np.stack([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)], -1).reshape(-1, 3)


def channels(path):
    import OpenEXR
    with OpenEXR.File(str(path)) as f:
        return {k: np.array(c.pixels, float) for k, c in f.parts[0].channels.items()}


def distances(room, o, d):
    """Along rays; the card stands before the walls, which are all that room.rays tells of."""
    far = np.linalg.norm(room.rays(o, d)[1] - o, axis=1)
    for b in room.bodies:
        n = np.cross(b["u"], b["v"])
        t = (b["c"] - o) @ n / (d @ n)
        x = o + t[:, None] * d - b["c"]
        on = (abs(x @ b["u"]) <= b["u"] @ b["u"]) & (abs(x @ b["v"]) <= b["v"] @ b["v"]) & (t > 0)
        far = np.where(on, np.minimum(far, t), far)
    return far


def true_distances(room):
    "of all texels of a field of the room, laid out as the file is"
    d = directions(NT, NP, np.pi / 2)
    out = np.zeros((N * NP, N * NT))
    for k in range(N * N):
        o = np.array([-.5 + k % N / (N - 1), -.5 + k // N / (N - 1), 0])
        far = distances(room, np.broadcast_to(o, d.shape), d)
        out[k // N * NP:][:NP, k % N * NT:][:, :NT] = far.reshape(NP, NT)
    return out


def mesh_of(path):
    lines = path.read_text().splitlines()
    v = np.array([l.split()[1:] for l in lines if l.startswith("v ")], float)
    vt = np.array([l.split()[1:] for l in lines if l.startswith("vt ")], float)
    t = np.array([[int(w.split("/")[0]) - 1 for w in l.split()[1:]] for l in lines if l.startswith("f ")])
    return v, vt, t


def extent(v):
    return np.concatenate([v.min(0), v.max(0)])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    d = tmp_path_factory.mktemp("depth")
    rooms.make(PLAIN, N, N, NT, NP, str(d / "plain.ilf.exr"))
    rooms.make(CARDED, N, N, NT, NP, str(d / "card.ilf.exr"))
    run("ilfdepth", "--threads", 1, *COARSE, "--depth", d / "plain.exr", "-o", d / "plain.obj", "--rad", d / "plain.rad",
        "--report", d / "plain.json", "--picture", d / "plain.png", d / "plain.ilf.exr")
    run("ilfdepth", "--things", "--depth", d / "card.exr", "--report", d / "card.json", "--rad", d / "card.rad",
        "-o", d / "card.obj", d / "card.ilf.exr")
    return d


@pytest.mark.parametrize("name, room", [("plain", PLAIN), ("card", CARDED)])
def test_distances_are_those_of_the_room(folder, name, room):
    found, true = channels(folder / f"{name}.exr"), true_distances(room)
    wrong = abs(found["Y"] / true - 1)
    assert np.median(wrong) < .01 and (wrong < .1).mean() > (.95 if name == "plain" else .9)
    assert (wrong < .1)[found["confidence"] > .8].mean() > .97
    if name == "card":
        here = true < .95 * true_distances(PLAIN)
        assert .02 < here.mean() < .2 and np.median(wrong[here]) < .08
        assert found["confidence"][wrong > .1].mean() < found["confidence"][wrong < .1].mean() - .2


def test_a_box_is_found_as_one(folder):
    r = json.loads((folder / "plain.json").read_text())
    assert r["surface"] == "box" and r["judged_by_rays"] > 0 and r["held_out_error"]["far"] > 3 * r["held_out_error"]["box"]
    sides = {s["side"]: s for s in r["box"]["sides"]}
    for side, true in zip(("-x", "+x", "-y", "+y", "+z"), (2.1, 2.4, 2.6, 1.9, 2.3)):
        assert sides[side]["seen"] and sides[side]["distance"] == pytest.approx(true, rel=.01) and 0 < sides[side]["error"] < .05
    assert not sides["-z"]["seen"] and sides["-z"]["error"] is None
    assert r["mesh"]["measured"] > .97 and len(r["pictures"]) == 16 and len(r["regions"]) == 36
    assert sum(p["judges"] for p in r["pictures"]) >= 2


@pytest.mark.parametrize("name", ["plain", "card"])
def test_meshes_are_closed(folder, name):
    v, vt, t = mesh_of(folder / f"{name}.obj")
    edges = Counter((a, b) for f in t for a, b in zip(f, np.roll(f, -1)))
    assert set(edges.values()) == {1} and all((b, a) in edges for a, b in edges)
    inside = np.einsum("ij,ij->i", np.cross(v[t[:, 1]] - v[t[:, 0]], v[t[:, 2]] - v[t[:, 0]]), v[t[:, 0]] - [0, 0, .1])
    assert (inside < 0).mean() > .99                                    # counter-clockwise as seen from within
    assert len(vt) == len(v) and set(vt[:, 1]) == {0, 1} and vt[:, 0].min() > 0 and vt[:, 0].max() <= 1
    assert (vt[v[:, 2] < -.1, 1] == 1).all()                            # below the plane nothing was measured
    run("obj2mesh", folder / f"{name}.obj", folder / f"{name}.rtm")


def test_the_scene_is_met_where_the_room_is(folder):
    rng = np.random.default_rng(2)
    d = rng.normal(size=(2000, 3))
    d[:, 2] = abs(d[:, 2]) + .01
    d /= np.linalg.norm(d, axis=1)[:, None]
    o = np.c_[rng.uniform(-.4, .4, (2000, 2)), rng.uniform(0, .2, 2000)]
    for name, room, least in (("plain", PLAIN, .995), ("card", CARDED, .85)):
        (folder / f"{name}.oct").write_bytes(run("oconv", f"{name}.rad", cwd=folder).out)
        far = np.array(run("rtrace", "-h", "-oL", "-ab", "0", f"{name}.oct", cwd=folder,
                           stdin="\n".join(" ".join(map(repr, map(float, r))) for r in np.c_[o, d])).text.split(), float)
        true = distances(room, o, d)
        assert (abs(far / true - 1) < .02).mean() > least, name


def test_left_out_pictures_choose_the_surface(folder):
    r = json.loads((folder / "card.json").read_text())
    assert r["surface"] == "mixed" and r["held_out_error"]["mixed"] < .8 * r["held_out_error"]["box"]
    assert .01 < r["box"]["things_before_it"] < .2 and r["box"]["nearest_thing"] == pytest.approx(1.1, abs=.15)
    said = run("ilfdepth", "--report", folder / "b.json", "-o", folder / "b.obj", "--probes", "9", folder / "card.ilf.exr").err
    r = json.loads((folder / "b.json").read_text())
    assert r["surface"] == "box" and len(r["pictures"]) == 9 and "stands before the box" in said
    v, vt, _ = mesh_of(folder / "b.obj")
    assert np.allclose(extent(v)[[0, 1, 3, 4, 5]], [*LO[:2], *HI], atol=.04)


def test_a_cupboard_is_part_of_the_surroundings(tmp_path):
    """From floor to ceiling, at a wall: a box is not enough, and it is no thing that hangs in the room."""
    faces = [((1.5, .2, 1.15), (0, 1, 0), (0, 0, 1.15)), ((1.95, 1.2, 1.15), (.45, 0, 0), (0, 0, 1.15)), ((1.95, -.8, 1.15), (.45, 0, 0), (0, 0, 1.15))]
    room = rooms.Room([rooms.card(*f, (.8, .6, .4), amp=.3, cell=.25) for f in faces], **UNIT)
    rooms.make(room, N, N, NT, NP, str(tmp_path / "c.ilf.exr"))
    run("ilfdepth", "--depth", tmp_path / "c.exr", "--report", tmp_path / "c.json", tmp_path / "c.ilf.exr")
    r, true = json.loads((tmp_path / "c.json").read_text()), true_distances(room)
    wrong, here = abs(channels(tmp_path / "c.exr")["Y"] / true - 1), true < .95 * true_distances(PLAIN)
    assert r["surface"] in ("mixed", "free") and r["held_out_error"]["mixed"] < .97 * r["held_out_error"]["box"]
    assert np.median(wrong[here]) < .03 and (wrong[here] < .1).mean() > .9


def test_threads_do_not_matter(folder, tmp_path):
    run("ilfdepth", "--threads", 2, *COARSE, "--depth", tmp_path / "a.exr", "-o", tmp_path / "a.obj", folder / "plain.ilf.exr")
    a, b = channels(tmp_path / "a.exr"), channels(folder / "plain.exr")
    assert all(np.array_equal(a[k], b[k]) for k in a)
    assert all(np.array_equal(x, y) for x, y in zip(mesh_of(tmp_path / "a.obj"), mesh_of(folder / "plain.obj")))


def probes_of(path):
    return channels_rgb(path).reshape(N, NP, N, NT, 3).transpose(0, 2, 1, 3, 4)


def channels_rgb(path):
    import OpenEXR
    with OpenEXR.File(str(path)) as f:
        return np.array(f.parts[0].channels["RGB"].pixels, float)


def test_a_scene_that_is_turned_and_moved(folder, tmp_path):
    """The same probes in another place, twice as large: the mesh goes with them."""
    q = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    q *= np.sign(np.linalg.det(q))
    at = np.array([5, -3, 1.5])
    write_ilf(tmp_path / "t.ilf.exr", ILF(probes_of(folder / "plain.ilf.exr"), at, 2 * q[0], 2 * q[1]))
    run("ilfdepth", *COARSE, "-o", tmp_path / "t.obj", tmp_path / "t.ilf.exr")
    v, w = mesh_of(folder / "plain.obj")[0], mesh_of(tmp_path / "t.obj")[0]
    assert v.shape == w.shape and np.allclose(2 * (v + [.5, .5, 0]) @ q + at, w, atol=.02)


def test_a_room_in_a_mirror(folder, tmp_path):
    """Columns backwards and rows of probes in the other order: y is -y."""
    mirrored = probes_of(folder / "plain.ilf.exr")[::-1, :, :, ::-1]
    write_ilf(tmp_path / "m.ilf.exr", ILF(mirrored, np.array([-.5, -.5, 0]), np.array([1., 0, 0]), np.array([0, 1., 0])))
    run("ilfdepth", *COARSE, "-o", tmp_path / "m.obj", tmp_path / "m.ilf.exr")
    v, w = mesh_of(folder / "plain.obj")[0], mesh_of(tmp_path / "m.obj")[0] * [1, -1, 1]
    assert np.allclose(extent(v)[[0, 1, 3, 4, 5]], extent(w)[[0, 1, 3, 4, 5]], rtol=.01)


def test_lamps_that_were_taken_out_stand_where_the_file_says(folder, tmp_path):
    """Version 2: what is left in the probes is swept, and nothing of the lamp stands in the mesh."""
    f = ILF(probes_of(folder / "plain.ilf.exr"), np.array([-.5, -.5, 0]), np.array([1., 0, 0]), np.array([0, 1., 0]))
    f.lamps = [Lamp("sphere", (.9, .3, 1.6), (90, 80, 60), radius=.2, errors=(.1, .2, .01, .01))]
    write_ilf(tmp_path / "two.ilf.exr", f)
    run("ilfdepth", *COARSE, "--depth", tmp_path / "two.exr", "-o", tmp_path / "two.obj", tmp_path / "two.ilf.exr")
    far, plain = channels(tmp_path / "two.exr"), channels(folder / "plain.exr")
    d, o = directions(NT, NP, np.pi / 2), np.array([0, 0, 0])
    m = d @ (np.array([.9, .3, 1.6]) - o)
    hit = m * m - 1.6 ** 2 - .9 ** 2 - .3 ** 2 + .2 ** 2
    true = np.where((hit > 0) & (m > 0), m - np.sqrt(np.maximum(hit, 0)), 0).reshape(NP, NT)
    first, before = far["Y"][:NP, :NT], plain["Y"][:NP, :NT]
    assert (true > 0).sum() > 20 and np.allclose(first[true > 0], true[true > 0], rtol=1e-4)
    assert np.allclose(first[true == 0], before[true == 0]) and (far["confidence"][:NP, :NT][true > 0] == 1).all()
    assert np.array_equal(mesh_of(tmp_path / "two.obj")[0], mesh_of(folder / "plain.obj")[0])


# ---- panoramas ---------------------------------------------------------------------------------------------------------

def axes(heading, pitch, roll):
    "forward, left, up of a camera, by turning a camera that looks along +x: roll, then pitch, then heading"
    h, p, r = np.radians([heading, pitch, roll])
    z = np.array([[np.cos(h), -np.sin(h), 0], [np.sin(h), np.cos(h), 0], [0, 0, 1]])
    y = np.array([[np.cos(p), 0, -np.sin(p)], [0, 1, 0], [np.sin(p), 0, np.cos(p)]])
    x = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    return (z @ y @ x).T


def panorama(room, at, turn, height):
    t, p = np.meshgrid(np.pi - (np.arange(2 * height) + .5) * np.pi / height, (np.arange(height) + .5) * np.pi / height)
    look, step = np.zeros((height, 2 * height, 3)), .25 * np.pi / height
    for a, b in ((-1, -1), (-1, 1), (1, -1), (1, 1), (0, 0)):         # means of four, the distance of the middle
        u, v = t + a * step, p + b * step
        d = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1).reshape(-1, 3) @ axes(*turn)
        o = np.broadcast_to(np.array(at, float), d.shape)
        L, hit = room.rays(o, d)
        look += (a != 0) * .25 * L.reshape(look.shape)
    return look, np.linalg.norm(hit - o, axis=1).reshape(height, 2 * height)


WHOLE = rooms.Room([], lo=(-2.1, -2.6, -1.2), hi=(2.4, 1.9, 1.3), amp=.2, cell=.3)
PLACES = [(.1, .2, .05), (-.3, .25, -.04), (.35, -.2, 0), (-.2, -.35, .1), (.05, -.05, -.1)]
TURNS = [(0, 0, 0), (77, 0, 0), (200, 12, 0), (-40, -8, 15), (130, 4, -20)]


def write_list(folder, name, turns, order=range(5), height=64):
    import OpenEXR
    lines, far = ["# place by place"], []
    for k in order:
        picture, true = panorama(WHOLE, PLACES[k], turns[k], height)
        OpenEXR.File({}, {"RGB": picture.astype(np.float32)}).write(str(folder / f"{name}{k}.exr"))
        lines.append(f"{name}{k}.exr " + " ".join(map(str, PLACES[k] + turns[k])))
        far.append(true)
    (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")
    return np.concatenate(far)


def test_panoramas_at_free_places(tmp_path):
    true = write_list(tmp_path, "a", TURNS)
    run("ilfdepth", "--positions", tmp_path / "a.txt", "--depth", tmp_path / "a.exr", "-o", tmp_path / "a.obj", "--report", tmp_path / "a.json")
    wrong = abs(channels(tmp_path / "a.exr")["Y"] / true - 1)
    assert np.median(wrong) < .02 and (wrong < .1).mean() > .9
    box = [-2.1, -2.6, -1.2, 2.4, 1.9, 1.3]
    assert np.allclose(extent(mesh_of(tmp_path / "a.obj")[0]), box, atol=.08)
    # cameras all turned alike, in another order, one picture twice
    write_list(tmp_path, "b", [(0, 0, 0)] * 5, order=[3, 1, 4, 0, 2, 3])
    r = run("ilfdepth", *COARSE, "--positions", tmp_path / "b.txt", "-o", tmp_path / "b.obj", "--surface", "box")
    assert np.allclose(extent(mesh_of(tmp_path / "b.obj")[0]), box, atol=.08)
    assert "not judged" in r.err
    assert run("ilfdepth", "-q", "--width", "32", "--near", ".3", "--positions", tmp_path / "b.txt", "-o", tmp_path / "c.obj").err == ""


def test_two_panoramas(tmp_path):
    true = write_list(tmp_path, "a", TURNS, order=[0, 1], height=64)
    run("ilfdepth", "--positions", tmp_path / "a.txt", "--depth", tmp_path / "a.exr")
    wrong = abs(channels(tmp_path / "a.exr")["Y"] / true - 1)
    assert np.median(wrong) < .03 and (wrong < .1).mean() > .8


# ---- what is refused ---------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("args, code, words", [
    ((), 2, "one light field"), (("plain.ilf.exr",), 2, "nothing to write"), (("-o", "x.obj", "plain.ilf.exr", "card.ilf.exr"), 2, "found 2"),
    (("-o", "x.obj", "--surface", "cube", "plain.ilf.exr"), 2, "found \"cube\""), (("-o", "x.obj", "--width", "5", "plain.ilf.exr"), 2, "32 to 1024"),
    (("-o", "x.obj", "--probes", "9,9", "plain.ilf.exr"), 1, "grid of 4 x 4"), (("-o", "x.obj", "--probes", "1,1", "plain.ilf.exr"), 1, "two probes"),
    (("-o", "x.obj", "nowhere.ilf.exr"), 1, "nowhere.ilf.exr"), (("-o", "x.obj", "--positions", "bad.txt"), 1, "bad.txt:2"),
    (("-o", "x.obj", "--positions", "one.txt"), 1, "two pictures"), (("--rad", "x.rad", "--positions", "one.txt"), 2, "--field"),
    (("-o", "x.obj", "--positions", "same.txt"), 1, "different places")])
def test_refusals_are_one_line_and_leave_nothing(folder, args, code, words):
    import OpenEXR
    if not (folder / "bad.txt").exists():
        OpenEXR.File({}, {"RGB": np.ones((8, 16, 3), np.float32)}).write(str(folder / "p.exr"))
        (folder / "bad.txt").write_text("p.exr 0 0 0 0\np.exr 0 0 x 0\n")
        (folder / "one.txt").write_text("p.exr 0 0 0 0\n")
        (folder / "same.txt").write_text("p.exr 0 0 0 0\np.exr 0 0 0 90\n")
    r = run("ilfdepth", *args, cwd=folder, code=code)
    assert len(r.err.splitlines()) == 1 and words in r.err, r
    assert not (folder / "x.obj").exists() and not (folder / "x.rad").exists()
