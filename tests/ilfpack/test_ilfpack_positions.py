"""ilfpack --positions: panoramas taken anywhere, of rooms whose light is known everywhere (bench/lamps/rooms.py)."""
import json
import sys

import numpy as np
import pytest
from conftest import TOP, run
from ilf_util import read_mosaic, unmosaic

sys.path.insert(0, str(TOP / "bench" / "lamps"))
import rooms                                                           # noqa: E402

ROWS, N = 200, 14
YELLOW, BLUE = ((1.3, .7, 2.4), .07, (9000, 8000, 6000)), ((-1.1, -1.6, 2.3), .08, (5000, 6000, 9000))
CARDED = rooms.Room([rooms.lamp(*YELLOW), rooms.lamp(*BLUE), rooms.tilted(YELLOW[0], (.1, -.1), 1.2, .15, .12, 0, 0, 20, (.3, .3, .3))])


def write_picture(path, rgb):
    import OpenEXR
    with OpenEXR.File({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION},
                      {"RGBA" if rgb.shape[-1] == 4 else "RGB": np.ascontiguousarray(rgb, np.float32)}) as f:
        f.write(str(path))


def write_table(path, poses, names=None):
    names = names or [f"shot_{k:02}.exr" for k in range(len(poses))]
    path.write_text("# picture x y z heading pitch roll\n" + "".join(f"{n} " + " ".join(f"{x:.9g}" for x in p) + "\n" for n, p in zip(names, poses)))


class Shoot:
    """Pictures of a room from places by chance, some centimetres off the plane, held not quite upright; gain: how bright each was taken."""

    def __init__(self, folder, room, n=N, rows=ROWS, seed=5, gain=0.):
        rng = np.random.default_rng(seed)
        self.folder, self.room, self.n = folder, room, n
        self.poses = np.c_[rng.uniform(-.5, .5, (n, 2)), rng.uniform(0, .04, n), rng.uniform(-180, 180, n), rng.normal(0, 2, (n, 2))]
        self.gain, self.rng = 1 + gain * rng.normal(size=n), rng
        for k, p in enumerate(self.poses):
            write_picture(folder / f"shot_{k:02}.exr", self.gain[k] * room.panorama(p[:3], rows, *p[3:]))
        write_table(folder / "poses.txt", self.poses)
        (folder / "walls.rad").write_text(rooms.walls(room))
        (folder / "walls.oct").write_bytes(run("oconv", folder / "walls.rad").out)

    def wrong(self, place=.005, angle=.5):
        return self.poses + np.c_[self.rng.normal(0, place, (self.n, 3)), self.rng.normal(0, angle, (self.n, 3))]

    def pack(self, table, *options, name="out", code=0):
        r = run("ilfpack", "--positions", self.folder / table, "--report", self.folder / f"{name}.json", "-o", self.folder / f"{name}.ilf.exr",
                *options, code=code)
        return r, json.loads((self.folder / f"{name}.json").read_text()) if code == 0 else None


@pytest.fixture(scope="session")
def shoot(tmp_path_factory):
    return Shoot(tmp_path_factory.mktemp("shoot"), CARDED, gain=.02)


@pytest.fixture(scope="session")
def exact(shoot):
    return shoot.pack("poses.txt", "--geometry", shoot.folder / "walls.oct", "--refine", "always", name="exact")


def irradiance(score, field):
    """Relative errors of the light from above at score's points, by ilftrace."""
    text = "\n".join(" ".join(f"{x:.9g}" for x in r) for r in score.rays())
    rgb = np.array(run("ilftrace", field, stdin=text.encode()).text.split(), float).reshape(-1, 3)
    return {z: v["up"] for z, v in score.of(rgb).items()}


def left(shoot, report):
    """Distances (scene's unit) and angles (degrees) by which a report's poses are off."""
    off, turn = [], []
    for p in report["pictures"]:
        true = shoot.poses[int(p["picture"][-6:-4])]
        d = rooms.turned_camera(*p["angles"]) @ rooms.turned_camera(*true[3:]).T
        off.append(np.subtract(p["position"], true[:3]))
        turn.append(np.degrees([d[2, 1] - d[1, 2], d[0, 2] - d[2, 0], d[1, 0] - d[0, 1]]) / 2)
    return np.array(off), np.array(turn)


# ---- directions and places ------------------------------------------------------------------------------

def sky(d):
    "radiance without any symmetry, smooth"
    d = np.asarray(d)
    return np.stack([2 + d[..., 0] + .5 * d[..., 1], 2 + d[..., 1] * d[..., 2], 1.5 + .7 * d[..., 2] - .4 * d[..., 0]], -1)


def panorama_of(light, rows, heading, pitch, roll):
    y, x = np.mgrid[0:rows, 0:2 * rows] + .5
    lon, lat = np.pi - x / rows * np.pi, np.pi / 2 - y / rows * np.pi      # lon: to the left of forward
    own = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], -1)
    return light(own @ rooms.turned_camera(heading, pitch, roll).T)


def probe_directions(n_theta, n_phi):
    t, p = np.meshgrid(-np.pi + (np.arange(n_theta) + .5) * 2 * np.pi / n_theta, (np.arange(n_phi) + .5) * np.pi / 2 / n_phi)
    return np.stack([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)], -1)


@pytest.mark.parametrize("angles", [(0, 0, 0), (35, 0, 0), (-120, 12, 0), (10, 0, -25), (77, -8, 15)], ids=str)
def test_angles_are_what_the_page_says(tmp_path, angles):
    """One picture: its light is the probe's, in the plane's directions."""
    write_picture(tmp_path / "a.exr", panorama_of(sky, 96, *angles))
    (tmp_path / "p.txt").write_text(f"a.exr .5 .5 0 {angles[0]} {angles[1]} {angles[2]}\n")
    run("ilfpack", "--positions", tmp_path / "p.txt", "--plane", "0 0 0 1 0 0 0 1 0", "--grid", "1x1", "--type", "float", "-o", tmp_path / "o.ilf.exr")
    got = unmosaic(read_mosaic(tmp_path / "o.ilf.exr")[1], 1, 1)[0, 0]
    want = sky(probe_directions(got.shape[1], got.shape[0]))
    assert np.abs(got - want)[:-1].max() < .01 and np.abs(got - want).max() < .04


def test_pitch_lifts_the_nose_and_roll_sinks_the_right(tmp_path):
    """Words, not matrices: what lies straight ahead and to the right of a camera in the scene."""
    forward, leftward, up = rooms.turned_camera(90, 10, 0).T
    assert forward == pytest.approx((0, np.cos(np.radians(10)), np.sin(np.radians(10)))) and leftward == pytest.approx((-1, 0, 0))
    assert rooms.turned_camera(0, 0, 10)[:, 1] == pytest.approx((0, np.cos(np.radians(10)), np.sin(np.radians(10))))


def test_a_plane_that_is_turned(tmp_path):
    """The same pictures on a plane with u along -y: the probe's azimuth is counted from there."""
    write_picture(tmp_path / "a.exr", panorama_of(sky, 64, 20, 0, 0))
    (tmp_path / "p.txt").write_text("a.exr .5 -.5 0 20\n")
    run("ilfpack", "--positions", tmp_path / "p.txt", "--plane", "0 0 0 0 -1 0 1 0 0", "--grid", "1x1", "--type", "float", "-o", tmp_path / "o.ilf.exr")
    got = unmosaic(read_mosaic(tmp_path / "o.ilf.exr")[1], 1, 1)[0, 0]
    d = probe_directions(got.shape[1], got.shape[0])
    want = sky(np.stack([d[..., 1], -d[..., 0], d[..., 2]], -1))
    assert np.abs(got - want)[:-1].max() < .015


# ---- a room ---------------------------------------------------------------------------------------------

def test_lamps_and_light_between(shoot, exact):
    r, report = exact
    for centre, radius, _ in (YELLOW, BLUE):
        lamp = min(report["lamps"], key=lambda l: np.linalg.norm(np.subtract(l["position"], centre)))
        assert lamp["fate"] == "taken out" and lamp["shape"] == "sphere" and lamp["radius"] == pytest.approx(radius, rel=.01)
        assert np.linalg.norm(np.subtract(lamp["position"], centre)) < .01
    error = irradiance(rooms.Score(CARDED, patches=3, heights=(.02, .3), most=2500, rest=1500), shoot.folder / "exact.ilf.exr")
    assert max(error.values()) < 2.5, error       # gains of 2 % leave half a per cent of the whole
    assert "is of version 2" in r.err and "version 2" in run("ilfinfo", shoot.folder / "exact.ilf.exr").text


def test_poses_are_found(shoot, exact):
    """From 5 mm and half a degree to a millimetre and a fiftieth of a degree beside each other; all together as well as creases of such
    coarse pictures say (a sixteenth of a texel, .9 degrees wide); gains to a thousandth of each other."""
    write_table(shoot.folder / "wrong.txt", shoot.wrong())
    r, report = shoot.pack("wrong.txt", "--geometry", shoot.folder / "walls.oct", name="refined")
    assert report["refined"] and "poses were refined" in r.err
    off, turn = left(shoot, report)
    beside = np.linalg.norm(off - off.mean(0), axis=1), np.linalg.norm(turn - turn.mean(0), axis=1)
    assert beside[0].max() < .001 and beside[1].max() < .02, (off, turn)
    assert np.linalg.norm(off, axis=1).max() < .006 and np.linalg.norm(turn, axis=1).max() < .06, (off, turn)
    gain = np.array([p["gain"] / shoot.gain[int(p["picture"][-6:-4])] for p in report["pictures"]])
    assert (gain / gain.mean()).std() < 1e-3
    assert all(p["moved_error"][0] < .002 for p in report["pictures"])


def test_poses_that_are_right_stay(shoot, tmp_path):
    still = Shoot(tmp_path, CARDED, n=6, rows=96, seed=8)
    r, report = still.pack("poses.txt", "--geometry", still.folder / "walls.oct")
    assert not report["refined"] and "poses are as given" in r.err
    assert [p["position"] for p in sorted(report["pictures"], key=lambda p: p["line"])] == [pytest.approx(p[:3]) for p in still.poses]


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    return Shoot(tmp_path_factory.mktemp("small"), rooms.Room([], amp=.2, cell=.7), n=9, rows=96, seed=3)


@pytest.mark.parametrize("kind", ["swapped", "x", *(pytest.param(k, marks=pytest.mark.sweep) for k in ("sign", "heading"))])
def test_a_wrong_line_is_named(small, kind):
    poses, names = small.poses.copy(), [f"shot_{k:02}.exr" for k in range(9)]
    if kind == "swapped":
        names[2], names[6] = names[6], names[2]
    poses[4] *= {"sign": (1, 1, 1, -1, 1, 1), "x": (-1, 1, 1, 1, 1, 1)}.get(kind, 1)
    poses[4, 3] += 50 if kind == "heading" else 0
    write_table(small.folder / f"{kind}.txt", poses, names)
    r, report = small.pack(f"{kind}.txt", name=kind)
    said = [line for line in r.err.splitlines() if "taken so" in line]
    assert len(said) == 1 and {"swapped": "lines 4 (shot_06.exr) and 8 (shot_02.exr): swapped", "sign": "line 6 (shot_04.exr): its heading with the other sign",
                               "x": "line 6 (shot_04.exr): x with the other sign", "heading": "line 6 (shot_04.exr): a heading of"}[kind] in said[0], r.err
    off, turn = left(small, report)
    assert np.abs(off).max() < .02 and np.abs(turn).max() < .5
    assert len(report["wrong_lines"]) == 1


def test_headings_counted_clockwise(small):
    write_table(small.folder / "compass.txt", small.poses * (1, 1, 1, -1, 1, 1))
    r, report = small.pack("compass.txt", "--geometry", small.folder / "walls.oct", name="compass")
    assert report["wrong_lines"] == ["all lines: its heading with the other sign"]
    assert np.abs(left(small, report)[1]).max() < .2


def test_what_nothing_explains_is_refused(small):
    poses = small.poses.copy()
    poses[3, 3:] = poses[3, 3] + 100, 40, -60
    write_table(small.folder / "lost.txt", poses)
    r, _ = small.pack("lost.txt", name="lost", code=1)
    assert "line 5 (shot_03.exr): expected a picture that agrees" in r.err and not (small.folder / "lost.ilf.exr").exists()


def test_order_and_threads_change_nothing(small):
    names = [f"shot_{k:02}.exr" for k in range(9)]
    write_table(small.folder / "back.txt", small.poses[::-1], names[::-1])
    small.pack("poses.txt", "--threads", "1", name="one")
    small.pack("back.txt", "--threads", "3", *(small.folder / n for n in names[3:] + names[:3]), name="three")
    a, b = (read_mosaic(small.folder / f"{n}.ilf.exr")[1] for n in ("one", "three"))
    assert np.array_equal(a, b)


def test_without_lamps_between_nodes(small):
    """A room without lamps, its walls in squares: light everywhere to a per cent; what is far from all pictures is said."""
    small.pack("poses.txt", "--geometry", small.folder / "walls.oct", name="plain")
    error = irradiance(rooms.Score(small.room, patches=3, heights=(.02, .3), rest=3000), small.folder / "plain.ilf.exr")
    assert max(error.values()) < 1, error
    r, report = small.pack("poses.txt", "--plane", "-.5 -.5 0 3 0 0 0 1 0", "--grid", "7x3", name="far")
    nodes = {tuple(n["node"]): n for n in report["nodes"]}
    assert "node (6,0) is " in r.err and nodes[6, 0]["error"] > 3 * nodes[1, 1]["error"]


def test_lamps_may_stay_in(shoot):
    shoot.pack("poses.txt", "--geometry", shoot.folder / "walls.oct", "--refine", "never", "--lamps", "keep", "--grid", "5x5", name="kept")
    r = run("ilfinfo", shoot.folder / "kept.ilf.exr")
    assert "version 1" in r.text
    field, texels = read_mosaic(shoot.folder / "kept.ilf.exr")
    probes = unmosaic(texels, 5, 5)
    assert probes.max() > 500                                      # a lamp's texels


# ---- holes ----------------------------------------------------------------------------------------------

def test_holes_are_filled_from_the_other_pictures(tmp_path):
    """Behind each camera stands its operator, 50 degrees wide and 60 high, of whom alpha says that he is none of the room; every third hides a
    lamp.  The light is that of pictures without holes: no lamp is dimmer for it, and walls go on behind him as the others saw them."""
    room = rooms.Room([rooms.lamp(*YELLOW), rooms.lamp(*BLUE)], amp=.3, cell=.7)
    rng, rows, n = np.random.default_rng(5), 96, 10
    poses = np.c_[rng.uniform(-.5, .5, (n, 2)), rng.uniform(0, .04, n), rng.uniform(-180, 180, n), np.zeros((n, 2))]
    y, x = np.mgrid[0:rows, 0:2 * rows] + .5
    for k, p in enumerate(poses):
        picture = room.panorama(p[:3], rows, *p[3:])
        lamp = x[np.unravel_index(np.argmax(picture.sum(-1)), x.shape)]
        behind = lamp if k % 3 == 0 else rng.uniform(0, 2 * rows)
        seen = (abs((x - behind + rows) % (2 * rows) - rows) > rows * 25 / 180) | (y < rows * 30 / 180)
        write_picture(tmp_path / f"shot_{k:02}.exr", np.dstack([picture * seen[..., None], seen]))
    write_table(tmp_path / "poses.txt", poses)
    r = run("ilfpack", "--positions", tmp_path / "poses.txt", "--refine", "never", "--plane", "-.5 -.5 0 1 0 0 0 1 0", "-o", tmp_path / "o.ilf.exr")
    assert "holes (alpha 0) of" in r.err and "holes are filled from other pictures" in r.err and "2 of 2 lamps found taken out" in r.err
    error = irradiance(rooms.Score(room, patches=3, heights=(.02, .3), most=2500, rest=1500), tmp_path / "o.ilf.exr")
    assert max(error.values()) < .7, error


# ---- headings that nobody knows -------------------------------------------------------------------------

@pytest.fixture(scope="session")
def lit(tmp_path_factory):
    room = rooms.Room([rooms.lamp(*YELLOW), rooms.lamp(*BLUE)], amp=.3, cell=.7)
    return Shoot(tmp_path_factory.mktemp("lit"), room, n=8, rows=96, seed=6)


def headless(shoot, name, poses):
    (shoot.folder / f"{name}.txt").write_text("".join(f"shot_{k:02}.exr {x:.6g} {y:.6g} {z:.6g} ? {p:.6g} {r:.6g}\n"
                                                      for k, (x, y, z, _, p, r) in enumerate(poses)))
    return f"{name}.txt"


def test_headings_are_found_by_a_lamp(lit):
    r, report = lit.pack(headless(lit, "unknown", lit.poses), "--refine", "never", name="unknown")
    assert "8 headings found by a lamp" in r.err
    off, turn = left(lit, report)
    assert np.abs(off).max() < 1e-6 and np.abs(turn).max() < .6, turn      # of texels 1.9 degrees wide


def test_headings_that_can_not_be_found_are_refused(lit, small):
    r, _ = lit.pack(headless(lit, "mirrored", lit.poses * (-1, 1, 1, 1, 1, 1)), "--refine", "never", name="mirrored", code=0)
    assert "still disagree" in r.err           # the lamp is there, the walls are not: kept, as asked, and said
    r, _ = lit.pack("mirrored.txt", name="mirrored2", code=1)
    assert "expected pictures that agree at their places" in r.err
    r, _ = small.pack(headless(small, "dark", small.poses), name="dark", code=1)
    assert "expected headings, or a lamp that four pictures see, found one that 0 see" in r.err


# ---- refusals -------------------------------------------------------------------------------------------

@pytest.mark.parametrize("text, args, code, words", [
    ("shot_00.exr 1 2\n", (), 1, 'line 1: expected "picture x y z heading [pitch roll]"'),
    ("shot_00.exr 1 2 3 4 5 6 7\n", (), 1, "line 1: expected"),
    ("shot_00.exr 1 2 north\n", (), 1, "line 1: expected"),
    ("# nothing\n", (), 1, "found none"),
    ("shot_00.exr 0 0 0\nshot_01.exr 0 1 0\n", (), 1, "spread over a plane"),
    ("other.exr 0 0 0\nshot_01.exr 1 1 0\n", ("shot_00.exr", "shot_01.exr"), 1, "expected a line for"),
    ("shot_00.exr 0 0 0\nshot_00.exr 1 1 0\n", ("shot_00.exr",), 1, "expected one line for"),
    ("shot_00.exr 0 0 0\nshot_01.exr 1 1 0\n", ("--lamps", "some"), 2, "--lamps: expected auto or keep"),
    ("shot_00.exr 0 0 0\nshot_01.exr 1 1 0\n", ("--refine", "some"), 2, "--refine: expected auto, always or never"),
    ("shot_00.exr 0 0 0\nmissing.exr 1 1 0\n", (), 1, "missing.exr"),
    ("shot_00.exr 0 0 0\nodd.exr 1 1 0\n", (), 1, "expected 192x96 pixels as the first picture has, found 64x32")])
def test_refusals(small, text, args, code, words):
    write_picture(small.folder / "odd.exr", np.ones((32, 64, 3)))
    (small.folder / "bad.txt").write_text(text)
    r = run("ilfpack", "--positions", small.folder / "bad.txt", "-o", small.folder / "bad.ilf.exr",
            *(small.folder / a if a.endswith(".exr") else a for a in args), code=code)
    lines = [line for line in r.err.splitlines() if "no --" not in line]
    assert len(lines) == 1 and words in lines[0], r.err
    assert not (small.folder / "bad.ilf.exr").exists()


def test_options_that_need_positions(small):
    for option in (("--geometry", "x"), ("--lamps", "auto"), ("--refine", "auto"), ("--report", "x")):
        r = run("ilfpack", *option, "--grid", "1x1", "--plane", "0 0 0 1 0 0 0 1 0", "-o", "x", "y", code=2)
        assert "go with --positions" in r.err
    r = run("ilfpack", "--positions", small.folder / "poses.txt", "--dry-run", "-o", small.folder / "dry.ilf.exr")
    assert not (small.folder / "dry.ilf.exr").exists() and r.err == ""
