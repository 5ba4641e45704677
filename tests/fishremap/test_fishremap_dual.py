"""Two circles in one picture: each lens by its own calibration, both merged.

The pictures are made by numpy alone, from the definition of each lens: OpenCV's fisheye model, radius f (t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9),
pixel (0,0) in the middle of the first.  Colours are directions, so that what comes out tells where each texel is believed to look.
"""
import json

import numpy as np
import pytest
from PIL import Image

import fishremap_util as U
from conftest import one_line_error, run, shared_data
from test_fishremap_panorama import coded, panorama, pose

N = 240        # pixels a side of each half


def field(K, D, w, h, most=np.radians(130)):
    """Directions in the lens's own frame (right, down, ahead) of its picture's pixels and their angles; beyond what the model reaches the angle is nan."""
    t = np.linspace(0, most, 20001)
    r = t * (1 + sum(k * t ** (2 * i + 2) for i, k in enumerate(D)))
    stop = np.flatnonzero(~(np.diff(r) > 0))
    n = stop[0] + 1 if len(stop) else len(t)
    y, x = np.mgrid[0:h, 0:w]
    a, b = (x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1]
    theta = np.interp(np.hypot(a, b), r[:n], t[:n], right=np.nan)
    psi = np.arctan2(b, a)
    return np.stack([np.sin(theta) * np.cos(psi), np.sin(theta) * np.sin(psi), np.cos(theta)], -1), theta


def matrix(fx, fy, cx, cy):
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.]])


BACK = np.diag([-1., 1, -1])     # from the first lens's (right, down, ahead) to a second's that looks back


def in_camera(d, from_first=np.eye(3)):
    """(right, down, ahead) of a lens as (forward, left, up) of the camera."""
    first = d @ from_first     # rows times R = R transposed times columns
    return np.stack([first[..., 2], -first[..., 0], -first[..., 1]], -1)


def turned(picture, degrees):
    """A camera's picture that must be turned counter-clockwise by so many quarters to stand upright."""
    return np.rot90(picture, -degrees // 90)


def plain(fov=200, n=N, seen=None):
    """Both halves of an equidistant camera: directions, black beyond the circle."""
    half = np.radians(fov / 2)
    K = matrix(n / 2 / half, n / 2 / half, (n - 1) / 2, (n - 1) / 2)
    out = []
    for R in (np.eye(3), BACK):
        d, theta = field(K, (), n, n, half * 1.5)
        out.append(np.where((theta <= (seen or half) * 1.02)[..., None], (1 + in_camera(d, R)) / 2, 0))
    return out


def beside(a, b):
    return np.concatenate([a, b], 1)


def remap(tmp_path, picture, *args, size="128x64", polar=180, name="in.exr"):
    """To the sphere's probe in the camera's upright frame (forward, left, up): directions, what they should be, alpha, the run."""
    U.write_exr(tmp_path / name, picture)
    r = run("fishremap", *args, "--heading", 0, "--polar-max", polar, "--size", size, "-o", tmp_path / "out.exr", tmp_path / name)
    got, want = U.read_exr(tmp_path / "out.exr")[0], U.probe(lambda q: q, *map(int, size.split("x")), polar, 3)
    return 2 * got[..., :3] - 1, want, got[..., 3] if got.shape[2] == 4 else np.ones(got.shape[:2]), r


LENS = ("--lens", "equidistant", "--fov", 200)


# ---- where each pixel looks -----------------------------------------------------------------------------------

def test_two_halves_make_the_sphere(tmp_path):
    got, want, seen, r = remap(tmp_path, beside(*plain()), "--dual", *LENS)
    assert (seen == 1).all() and np.abs(got - want).max() < .02
    assert "matched" in r.err
    # one above the other
    got, want, seen, _ = remap(tmp_path, np.concatenate(plain(), 0), "--dual", *LENS)
    assert (seen == 1).all() and np.abs(got - want).max() < .02


def test_circles_where_they_are(tmp_path):
    """Off the halves' middles, of other sizes, back lens first in the file; with a border."""
    a, b = plain(n=200), plain(n=160)
    picture = np.zeros((300, 500, 3))
    picture[70:230, 30:190] = b[1]
    picture[50:250, 250:450] = a[0]
    got, want, seen, _ = remap(tmp_path, picture, "--circles", "350,150,100 110,150,80", *LENS, "--report", tmp_path / "r.json")
    assert (seen == 1).all() and np.abs(got - want).max() < .025
    circles = json.loads((tmp_path / "r.json").read_text())["circles"]
    assert [c["centre"] + [c["radius"], c["fov_deg"]] for c in circles] == [pytest.approx(q) for q in ([350, 150, 100, 200], [110, 150, 80, 200])]
    # the other order turns the world about the camera's up by half a turn
    got, want, _, _ = remap(tmp_path, picture, "--circles", "110,150,80;350,150,100", *LENS)
    assert np.abs(got - want * [-1, -1, 1]).max() < .025


def test_circles_are_found(tmp_path):
    """A room through two lenses that are not in their halves' middles; where there is none, that is said with its number."""
    scene = U.lobes(count=12, sharpest=1.5)
    picture, at = np.zeros((300, 600, 3)), ((140.3, 155.6, 118.4), (452.8, 147.2, 121.7))
    for k, ((x, y, r), R) in enumerate(zip(at, (np.eye(3), BACK))):
        part = U.disc(scene_of(scene, R), 300, 300, x - 300 * k, y, r, lambda q: q * np.radians(100), samples=3, outside=0)
        picture[:, 300 * k:300 * k + 300] = part
    U.write_exr(tmp_path / "in.exr", picture + .002)
    args = ("--circles", "auto", *LENS, "--to", "latlong", "--size", "128x64", "-o", tmp_path / "o.exr", "--report", tmp_path / "r.json", tmp_path / "in.exr")
    run("fishremap", *args)
    found = [c["centre"] + [c["radius"]] for c in json.loads((tmp_path / "r.json").read_text())["circles"]]
    assert np.abs(np.array(found) - at).max() < .6
    got, want = U.read_exr(tmp_path / "o.exr")[0][..., :3], scene(panorama(128, 64))
    assert np.median(np.abs(got / want - 1)) < .02
    picture[:, 300:] = .01
    U.write_exr(tmp_path / "in.exr", picture + .002)
    r = run("fishremap", *args, code=1)
    one_line_error(r, "fishremap", "second circle", "in.exr")


@pytest.mark.parametrize("degrees", [(90, -90), (180, 0), (-90, -90)])
def test_circles_that_lie_on_their_sides(tmp_path, degrees):
    a, b = (turned(p, k) for p, k in zip(plain(), degrees))
    got, want, seen, _ = remap(tmp_path, beside(a, b), "--dual", "--circle-rotate", "{},{}".format(*degrees), *LENS)
    assert (seen == 1).all() and np.abs(got - want).max() < .02


@pytest.mark.parametrize("to", ["latlong", "probe", "angular", "ball"])
@pytest.mark.parametrize("turn", [{}, {"heading": 40}, {"rotate": 30, "tilt": 20, "tilt-to": 200}, {"pose": "70,15,-40"}])
def test_every_chart_and_turn_is_that_of_a_panorama(tmp_path, to, turn):
    """The two circles, and the panorama of the same camera, come out alike: what the one is tested for holds for the other."""
    U.write_exr(tmp_path / "two.exr", beside(*plain()))
    U.write_exr(tmp_path / "pan.exr", (1 + panorama(360, 180)) / 2)
    size = {"latlong": "120x60", "probe": "120x60", "angular": "120x120", "ball": "160x160"}[to]
    if to in ("angular", "ball") and turn:       # of a panorama these mean OUT's camera: by way of a probe
        run("fishremap", "--from", "latlong", "--to", "probe", "--polar-max", 180, *[str(w) for k, v in turn.items() for w in (f"--{k}", v)], "--size", "360x180",
            "-o", tmp_path / "via.exr", tmp_path / "pan.exr")
        run("fishremap", "--from", "probe", "--to", to, "--polar-max", 180, "--size", size, "-o", tmp_path / "b.exr", tmp_path / "via.exr")
    else:
        run("fishremap", "--from", "latlong", "--to", to, *(("--polar-max", 180) if to == "probe" else ()), *[str(w) for k, v in turn.items() for w in (f"--{k}", v)],
            "--size", size, "-o", tmp_path / "b.exr", tmp_path / "pan.exr")
    run("fishremap", "--dual", *LENS, "--to", to, "--polar-max", 180, *[str(w) for k, v in turn.items() for w in (f"--{k}", v)], "--size", size, "-o", tmp_path / "a.exr",
        tmp_path / "two.exr")
    a, b = (U.read_exr(tmp_path / f"{k}.exr")[0] for k in "ab")
    y, x = np.mgrid[0:a.shape[0], 0:a.shape[1]] + .5
    sure = np.ones(a.shape[:2], bool) if to in ("latlong", "probe") else np.hypot(x / a.shape[1] - .5, y / a.shape[0] - .5) < (.47 if to == "angular" else .44)
    assert np.abs(a - b)[sure][:, :3].max() < .02


# ---- calibrations ------------------------------------------------------------------------------------------------

def texel_directions(w, h, n=4):
    """Mean directions of a panorama's texels by solid angle, of unit length: towards a pole they are not the centres'."""
    total = 0
    for i in range(n):
        for j in range(n):
            dx, dy = ((k + .5) / n - .5 for k in (i, j))
            d = panorama(w, h, left=-180 + dx * 360 / w, right=180 + dx * 360 / w, top=90 - dy * 180 / h, bottom=-90 - dy * 180 / h)
            total = total + d * np.hypot(d[..., 0], d[..., 1])[..., None]
    return total / np.linalg.norm(total, axis=-1, keepdims=True)


def theta_z1():
    """(K, D, rotation from the first) of the left and the right lens."""
    folder = shared_data("theta_z1_fisheye_calibration")

    def load(side, name):
        return np.loadtxt(folder / f"theta_{side}_{name}.txt")
    return [(load(s, "K"), load(s, "dist_coeffs"), load(s, "rig_extrinsics")[:3, :3]) for s in ("left", "right")]


def own_lens(K, D, size, R=None):
    text = f"kannala-brandt {' '.join(map(repr, map(float, D)))}\ncamera {float(K[0, 0])!r} {float(K[1, 1])!r} {float(K[0, 2])!r} {float(K[1, 2])!r}\nsize {size[0]} {size[1]}\n"
    return text + ("" if R is None else "from-first " + " ".join(map(repr, map(float, np.ravel(R)))) + "\n")


def kalibr(cameras, size):
    text = ""
    for k, (K, D, R) in enumerate(cameras):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R, (.001, 0, -.02)
        text += f"cam{k}:\n  camera_model: pinhole\n  distortion_coeffs: {list(map(float, D))}\n  distortion_model: equidistant\n" \
            f"  intrinsics: {[float(v) for v in (K[0, 0], K[1, 1], K[0, 2], K[1, 2])]}\n  resolution: [{size[0]}, {size[1]}]\n" \
            + (f"  T_cn_cnm1:\n" + "".join(f"  - {[float(v) for v in row]}\n" for row in T) if k else "")
    return text


def theta_picture(n, scale):
    """Both circles at n x n pixels each, and the true direction and angle of each pixel."""
    halves = []
    for K, D, R in theta_z1():
        S = K.copy()
        S[:2] *= scale
        S[:2, 2] += scale / 2 - .5      # (0,0) in the middle of the first pixel
        d, theta = field(S, D, n, n)
        halves.append((in_camera(d, R), theta))
    return halves


FORMS = ["two files", "sections", "Kalibr", "of the whole"]


@pytest.mark.parametrize("form", FORMS)
def test_a_real_calibration_is_honoured(tmp_path, form):
    """Ricoh Theta Z1: where fishremap looks is within 0.05 degree of OpenCV's model over both circles."""
    n, cameras = 912, theta_z1()
    halves = theta_picture(n, n / 3648)
    U.write_exr(tmp_path / "in.exr", beside(*[np.where(np.isfinite(t)[..., None], (1 + d) / 2, .5) for d, t in halves]))
    (a, b), size = cameras, (3648, 3648)
    if form == "two files":
        (tmp_path / "left").write_text(own_lens(*a[:2], size))
        (tmp_path / "right").write_text(own_lens(b[0], b[1], size, b[2]))
        lenses = ("--lens", tmp_path / "left", "--lens", tmp_path / "right")
    elif form == "Kalibr":
        (tmp_path / "rig.yaml").write_text(kalibr(cameras, size))
        lenses = ("--lens", tmp_path / "rig.yaml")
    else:
        wide = (7296, 3648) if form == "of the whole" else size
        shifted = b[0] + (np.array([[0, 0, 3648.], [0, 0, 0], [0, 0, 0]]) if form == "of the whole" else 0)
        (tmp_path / "rig").write_text("# both\n[left]\n" + own_lens(a[0], a[1], wide) + "[right]\n" + own_lens(shifted, b[1], wide, b[2]))
        lenses = ("--lens", tmp_path / "rig")
    r = run("fishremap", "--dual", *lenses, "--to", "latlong", "--size", "720x360", "-o", tmp_path / "o.exr", "--report", tmp_path / "r.json", tmp_path / "in.exr")
    got = U.read_exr(tmp_path / "o.exr")[0]
    seen = got[..., 3] == 1 if got.shape[2] == 4 else np.ones(got.shape[:2], bool)
    d = 2 * got[..., :3] - 1
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    off = np.degrees(np.linalg.norm(d - texel_directions(720, 360), axis=-1))
    assert seen.all() and np.median(off) < .003 and off.max() < .05
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["second_gain"] == pytest.approx(1, abs=1e-3) and report["second_residual"] < 2e-3
    assert 190 < report["circles"][0]["fov_deg"] < 194 and 182 < report["circles"][1]["fov_deg"] < 185


def test_the_real_calibration_against_opencv(tmp_path):
    cv2 = pytest.importorskip("cv2")
    for K, D, _ in theta_z1():
        d, theta = field(K, D, 3648, 3648)
        rows, columns = np.mgrid[100:3600:173, 100:3600:173]
        p, t = d[rows, columns].reshape(-1, 3), theta[rows, columns].ravel()
        ok = np.isfinite(t) & (t < np.radians(89))
        xy, _ = cv2.fisheye.projectPoints(p[ok][None] / p[ok][:, 2:][None], np.zeros(3), np.zeros(3), K, D)
        assert np.abs(xy[0] - np.stack([columns.ravel(), rows.ravel()], -1)[ok]).max() < .05


def test_given_circles_keep_a_calibrations_shape(tmp_path):
    """fx and fy that differ by a tenth, circles given at the frame's edge: the radius is that to the right, at half the field of view."""
    n, D = 300, (.02, -.004, 0, 0)
    half = np.radians(95)
    focal = 140 / (half * (1 + D[0] * half ** 2 + D[1] * half ** 4))
    K = matrix(focal, .9 * focal, 139.5, 149.5)
    d, theta = field(K, D, n, n)
    halves = [np.where((theta < half * 1.02)[..., None], (1 + in_camera(d, R)) / 2, 0) for R in (np.eye(3), BACK)]
    (tmp_path / "lens").write_text(own_lens(K, D, (1000, 1000)))
    got, want, seen, _ = remap(tmp_path, beside(*halves), "--circles", f"140,150,140 {n + 140},150,140", "--lens", tmp_path / "lens", "--fov", 190)
    assert (seen == 1).all() and np.abs(got - want).max() < .02 and np.median(np.abs(got - want)) < .001


def test_a_rotation_that_is_left_out_shows(tmp_path):
    """The rig's 2.3 degrees: directions of the second circle are off by as much, and only there."""
    n, (a, b) = 912, theta_z1()
    U.write_exr(tmp_path / "in.exr", beside(*[np.where(np.isfinite(t)[..., None], (1 + d) / 2, .5) for d, t in theta_picture(n, n / 3648)]))
    (tmp_path / "rig").write_text("[left]\n" + own_lens(*a[:2], (3648, 3648)) + "[right]\n" + own_lens(*b[:2], (3648, 3648)))
    run("fishremap", "--dual", "--lens", tmp_path / "rig", "--to", "latlong", "--size", "180x90", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    off = np.degrees(np.linalg.norm(2 * U.read_exr(tmp_path / "o.exr")[0][..., :3] - 1 - texel_directions(180, 90), axis=-1))
    turn = np.degrees(np.arccos((np.trace(b[2] @ BACK) - 1) / 2))
    assert off[40:50, 60:120].max() < .1 and np.abs(off[:, :20].max() - turn) < .2


@pytest.mark.parametrize("text, words", [
    ("[a]\nmodel equisolid\n", ()), ("[a]\nmodel equisolid\n[b]\nmodel equisolid\n[c]\nmodel equisolid\n", ("two cameras", "3")),
    ("[a]\nmodel equisolid\n[b]\nmodel equisolid\nfrom-first 1 0 0 0 1 0 0 0\n", ("line 5", "from-first")),
    ("[a]\nmodel equisolid\n[b]\nmodel equisolid\nfrom-first 1 0 0 0 1 0 0 0 -1\n", ("rotation", "-1")),
    ("[a]\nmodel equisolid\n[b]\nmodel equisolid\nfrom-first 1 0 0 0 2 0 0 0 1\n", ("rotation",)), ("[a]\nmodel equisolid\n[b]\nmodel nothing\n", ("line 4",))])
def test_lens_files_of_several_cameras(tmp_path, text, words):
    (tmp_path / "rig").write_text(text)
    U.write_exr(tmp_path / "in.exr", np.ones((40, 80, 3)))
    r = run("fishremap", "--dual", "--lens", tmp_path / "rig", "--fov", 200, "--size", "16x8", "-o", tmp_path / "o.exr", tmp_path / "in.exr", code=1 if words else 0)
    dry = run("fishremap", "--dual", "--lens", tmp_path / "rig", "--fov", 200, "--size", "16x8", "-o", tmp_path / "o.exr", "--dry-run", tmp_path / "in.exr", code=1 if words else 0)
    for q in (r, dry) if words else ():
        one_line_error(q, "fishremap", "rig", *words)


def test_one_camera_of_two_has_a_name(tmp_path):
    (tmp_path / "rig").write_text("[a]\nmodel equisolid\n[b]\nmodel orthographic\n")
    U.write_exr(tmp_path / "in.exr", np.random.default_rng(1).uniform(0, 1, (40, 40, 3)))
    args = ("--fov", 170, "--size", "16x8", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    one_line_error(run("fishremap", "--lens", tmp_path / "rig", *args, code=1), "fishremap", "a, b", "@NAME")
    one_line_error(run("fishremap", "--lens", f"{tmp_path / 'rig'}@c", *args, code=1), "fishremap", "[c]", "a, b")
    for name, model in (("a", "equisolid"), ("b", "orthographic")):
        run("fishremap", "--lens", f"{tmp_path / 'rig'}@{name}", *args)
        got = U.read_exr(tmp_path / "o.exr")[0]
        run("fishremap", "--lens", model, *args)
        assert np.array_equal(got, U.read_exr(tmp_path / "o.exr")[0])


# ---- light ---------------------------------------------------------------------------------------------------------

def lit(scene, fov=200, n=N, gain=1., samples=3):
    """Both halves of a scene, the second at gain times the exposure."""
    half = np.radians(fov / 2)
    out = [U.disc(scene_of(scene, R), n, n, n / 2, n / 2, n / 2, lambda r: r * half, samples=samples, outside=0) for R in (np.eye(3), BACK)]
    return beside(out[0], gain * out[1])


def scene_of(scene, R):
    """U.disc's directions are (u, v, n) of a camera along n with u to the left: as (right, down, ahead), then as the camera's (forward, left, up)."""
    return lambda d: scene(in_camera(np.stack([-d[..., 0], -d[..., 1], d[..., 2]], -1), R))


@pytest.mark.parametrize("gain", [1, .4, 3])
def test_exposures_are_matched_and_the_residual_is_said(tmp_path, gain):
    scene = U.lobes(count=12, sharpest=1.5)
    rng = np.random.default_rng(4)
    picture = lit(scene, gain=gain)
    picture *= np.exp(rng.normal(0, .03, picture.shape))
    U.write_exr(tmp_path / "in.exr", picture)
    r = run("fishremap", "--dual", *LENS, "--to", "latlong", "--size", "256x128", "-o", tmp_path / "o.exr", "--report", tmp_path / "r.json", tmp_path / "in.exr")
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["second_gain"] == pytest.approx(1 / gain, rel=.003) and .002 < report["second_residual"] < .04
    assert f"{100 * report['second_residual']:.1f} %" in r.err
    got = U.read_exr(tmp_path / "o.exr")[0]
    want = scene(panorama(256, 128))
    assert np.abs(got / want - 1).mean() < .02
    # given: used, and what would match is said
    r = run("fishremap", "--dual", *LENS, "--to", "latlong", "--second-gain", 2, "--size", "64x32", "-o", tmp_path / "o.exr", "--report", tmp_path / "r.json",
            tmp_path / "in.exr")
    assert "as given" in r.err and json.loads((tmp_path / "r.json").read_text())["second_gain"] == 2


def test_colours_that_differ_are_said_and_left(tmp_path):
    a, b = np.split(lit(U.lobes(count=12, sharpest=1.5)), 2, 1)
    for tint, said in (((1.2, 1, .8), True), ((1, 1, 1), False)):
        U.write_exr(tmp_path / "in.exr", beside(a, b * tint))
        r = run("fishremap", "--dual", *LENS, "--to", "latlong", "--size", "128x64", "-o", tmp_path / "o.exr", "--report", tmp_path / "r.json", tmp_path / "in.exr")
        report = json.loads((tmp_path / "r.json").read_text())
        assert ("colours differ" in r.err) == said
        assert np.allclose(np.array(report["second_colour"]) * report["second_gain"], 1 / np.array(tint), rtol=.01)


def test_energy_of_lamps_however_they_fall(tmp_path):
    """Lamps in one circle, in the other, in the seam: each keeps its energy."""
    for lon, lat in ((0, 10), (180, -20), (90, 0), (-88, 30), (93, -50)):
        a = np.array([np.cos(np.radians(lat)) * np.cos(np.radians(lon)), -np.cos(np.radians(lat)) * np.sin(np.radians(lon)), np.sin(np.radians(lat))])
        c = np.cos(np.radians(2.5))
        picture = lit(lambda d: np.repeat(((d @ a) > c)[..., None] * 1000. + .01, 3, -1), samples=8)
        U.write_exr(tmp_path / "in.exr", picture)
        run("fishremap", "--dual", *LENS, "--to", "latlong", "--size", "128x64", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
        got = U.read_exr(tmp_path / "o.exr")[0][..., 0]
        w = (np.sin(np.pi / 2 - np.pi * np.arange(64) / 64) - np.sin(np.pi / 2 - np.pi * np.arange(1, 65) / 64))[:, None] * 2 * np.pi / 128
        assert (w * got).sum() == pytest.approx(1000 * 2 * np.pi * (1 - c) + .01 * 4 * np.pi, rel=.01), (lon, lat)


def test_nothing_jumps_where_a_field_ends(tmp_path):
    """A second circle that is half as bright again, and a gain that is told to stay 1: the seam is a ramp."""
    U.write_exr(tmp_path / "in.exr", lit(lambda d: np.ones(d.shape), gain=1.5))
    run("fishremap", "--dual", *LENS, "--to", "latlong", "--second-gain", 1, "--size", "360x180", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    row = U.read_exr(tmp_path / "o.exr")[0][90, :, 0]
    assert row.min() == pytest.approx(1, abs=.002) and row.max() == pytest.approx(1.5, abs=.002) and np.abs(np.diff(row)).max() < .04


def test_a_falloff_for_each(tmp_path):
    (tmp_path / "a.txt").write_text("polynomial rn 1 0 -.5\n")
    (tmp_path / "b.txt").write_text("polynomial rn 1 0 -.3\n")
    n, half = N, np.radians(100)
    y, x = (np.mgrid[0:n, 0:n] + .5) / (n / 2) - 1
    r = np.minimum(np.hypot(x, y), 1)[..., None] * np.ones(3)
    U.write_exr(tmp_path / "in.exr", beside(1 - .5 * r ** 2, 1 - .3 * r ** 2))
    run("fishremap", "--dual", *LENS, "--to", "latlong", "--falloff", tmp_path / "a.txt", "--falloff", tmp_path / "b.txt", "--second-gain", 1, "--size", "90x45", "-o",
        tmp_path / "o.exr", tmp_path / "in.exr")
    assert np.allclose(U.read_exr(tmp_path / "o.exr")[0], 1, atol=.005)


# ---- what is missing ------------------------------------------------------------------------------------------------

def test_rims_that_meet_leave_no_line(tmp_path):
    """180 degrees each: nothing to match, nothing missing."""
    U.write_exr(tmp_path / "in.exr", lit(lambda d: np.ones(d.shape), fov=180))
    r = run("fishremap", "--dual", "--lens", "equidistant", "--fov", 180, "--to", "latlong", "--size", "180x90", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    got = U.read_exr(tmp_path / "o.exr")[0]
    assert "not matched" in r.err and (got.shape[2] == 3 or got[..., 3].min() > .99)
    assert np.allclose(got[..., :3], 1, atol=.01)


def test_a_gap_between_fields_is_a_hole(tmp_path):
    U.write_exr(tmp_path / "in.exr", lit(lambda d: np.ones(d.shape), fov=160))
    run("fishremap", "--dual", "--lens", "equidistant", "--fov", 160, "--to", "latlong", "--size", "180x90", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    a = U.read_exr(tmp_path / "o.exr")[0][..., 3]
    w = np.cos(np.radians(90 - 2 * np.arange(90) - 1))[:, None] * np.ones(180)
    assert (a * w).sum() / w.sum() == pytest.approx(1 - np.cos(np.radians(80)), rel=.005)
    assert (a[40:50, 42:48] == 0).all() and (a[40:50, 60:120] == 1).all()


def test_mask_and_nadir_become_alpha(tmp_path):
    """A mask of the two circles, half its size; and below the camera, of circles that lie on their sides."""
    a, b = (turned(p, k) for p, k in zip(plain(), (90, -90)))
    mask = np.full((N // 2, N, 3), 255, np.uint8)
    # ahead of the first lens, 20 degrees: stored centre
    y, x = np.mgrid[0:N // 2, 0:N] + .5
    mask[np.hypot(x - N / 4, y - N / 4) < N / 4 * .2] = 0
    Image.fromarray(mask).save(tmp_path / "m.png")
    got, want, seen, _ = remap(tmp_path, beside(a, b), "--dual", "--circle-rotate", "90,-90", "--nadir", 25, "--mask", tmp_path / "m.png", *LENS)
    ahead, down = (np.degrees(np.arccos(np.clip(want @ v / np.linalg.norm(want, axis=-1), -1, 1))) for v in (np.array([1., 0, 0]), np.array([0, 0, -1.])))
    assert (seen[(ahead < 16) | (down < 21)] == 0).all() and (seen[(ahead > 24) & (down > 29)] == 1).all()
    assert np.abs(got - want)[seen == 1].max() < .03
    omega = U.probe_solid_angle(128, 64, 180)[:, None]
    assert ((1 - seen) * omega).sum() == pytest.approx(2 * np.pi * (2 - np.cos(np.radians(20)) - np.cos(np.radians(25))), rel=.02)


def test_the_overlay_shows_both_circles(tmp_path):
    U.write_exr(tmp_path / "in.exr", beside(*plain()))
    run("fishremap", "--dual", *LENS, "--size", "16x8", "--overlay", tmp_path / "o.png", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    image = np.asarray(Image.open(tmp_path / "o.png").convert("RGB")).astype(int)
    for k, colour in ((0, 0), (1, 2)):      # the first is red, the last blue
        pure = (image[..., colour] > 200) & (image.sum(-1) < 260)
        y, x = np.argwhere(pure).T
        r = np.hypot(x + .5 - (k + .5) * N, y + .5 - N / 2)
        assert len(r) > 400 and ((np.abs(r - N / 2) < 2) | (r < 7)).all()


def test_a_heading_puts_the_zenith_into_a_panoramas_middle_and_says_so(tmp_path):
    U.write_exr(tmp_path / "in.exr", beside(*plain()))
    for more, said in ((("--heading", 10), True), (("--pose", 10), True), (("--tilt", 5), False)):
        r = run("fishremap", "--dual", *LENS, *more, "--to", "latlong", "--size", "64x32", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
        assert ("the zenith is" in r.err) == said
        up = 2 * U.read_exr(tmp_path / "o.exr")[0][..., 2] - 1
        assert (up[15:17, 31:33].mean() > .98) == said and (up[0].mean() > .98) == (not said)


def test_several_pictures_share_the_weights_of_both_circles(tmp_path):
    for k, gain in enumerate((1, 2)):
        U.write_exr(tmp_path / f"p{k}.exr", gain * beside(*plain()))
    args = ("--dual", *LENS, "--to", "latlong", "--size", "64x32", "--quiet", "-o")
    run("fishremap", *args, tmp_path / "all_%.exr", tmp_path / "p0.exr", tmp_path / "p1.exr")
    for k in range(2):
        run("fishremap", *args, tmp_path / "one.exr", tmp_path / f"p{k}.exr")
        assert np.allclose(U.read_exr(tmp_path / f"all_p{k}.exr")[0], U.read_exr(tmp_path / "one.exr")[0], rtol=1e-4, atol=1e-5)


def test_what_means_nothing_is_refused(tmp_path):
    U.write_exr(tmp_path / "in.exr", np.ones((40, 80, 3)))
    end = ("--size", "16x8", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    for args, word in ((("--dual", "--from", "latlong"), "--dual"), (("--dual", *LENS, "--to", "fisheye"), "--dual"), (("--dual", *LENS, "--centre", "3,3"), "--centre"),
                       (("--dual", *LENS, "--radius", 9), "--radius"), ((*LENS, "--circle-rotate", "3,3"), "--circle-rotate"), ((*LENS, "--lens", "equisolid"), "--lens"),
                       (("--dual", *LENS, "--lens", "equisolid", "--lens", "equisolid"), "--lens"), (("--circles", "1,2,3", *LENS), "--circles"),
                       (("--circles", "1,2,3 4,5,-6", *LENS), "--circles"), (("--circles", "1,2,3 4,5,1e30", *LENS), "--circles"), ((*LENS, "--second-gain", 2), "--second-gain"),
                       (("--dual", "--circle-rotate", "nan,0", *LENS), "--circle-rotate"), (("--from", "ball", "--nadir", 20), "--nadir")):
        one_line_error(run("fishremap", *args, *end, code=2), "fishremap", word)
    r = run("fishremap", "--circles", "500,500,30 20,20,20", *LENS, *end, code=1)
    one_line_error(r, "fishremap", "circle", "in.exr")
    (tmp_path / "rig").write_text("[a]\nmodel equisolid\n[b]\nmodel equisolid\nfrom-first -1 0 0 0 1 0 0 0 -1\n")
    one_line_error(run("fishremap", "--dual", "--lens", tmp_path / "rig", "--fov", 200, "--circle-rotate", "0,90", *end, code=1), "fishremap", "--circle-rotate")
