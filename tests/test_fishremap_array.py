"""Mirror-sphere arrays: analytic photographs, hand-given and found corners, refusals, and rpict's virtual photograph."""
import json

import numpy as np
import pytest

import fishremap_util as U
from conftest import BIN, FETCHED, one_line_error, run

FREE_CONE = 2 * np.degrees(np.arcsin((1 + np.sqrt(17)) / 8))   # touching spheres: 79.64 degrees


def photograph(scene, n, m, radius=40., pitch=None, turn=0., ground=0.15, margin=1.2, seed=0):
    """Orthographic picture of n x m mirror spheres from above, and the centres' pixels, (n*m, 2), i fastest.

    +u points right, turned counter-clockwise by `turn` degrees.  What a sphere reflects below the free cone is
    its neighbours: some mottled grey here."""
    pitch = pitch or 2 * radius
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    i, j = np.meshgrid(np.arange(n), np.arange(m))
    a, b = (i.ravel() - (n - 1) / 2) * pitch, (j.ravel() - (m - 1) / 2) * pitch
    reach = np.abs(np.array([[c, s], [s, c]])) @ np.array([n, m]) * pitch / 2 * margin + 4
    w, h = (int(x) for x in np.ceil(2 * reach))
    centres = np.stack([w / 2 + a * c - b * s, h / 2 - a * s - b * c], -1)
    rng = np.random.default_rng(seed)

    def lights(d):
        out = scene(d)
        phi = np.degrees(np.arccos(d[..., 2].clip(-1, 1)))
        dark = mottled[(7 + 7 * d[..., 0]).astype(int), (7 + 7 * d[..., 1]).astype(int)]
        return np.where((phi < FREE_CONE)[..., None], out, dark[..., None])
    image = np.full((h, w, 3), ground)
    for x, y in centres:
        mottled = rng.uniform(.02, .3, (15, 15))
        box = [max(int(x - radius) - 1, 0), max(int(y - radius) - 1, 0), min(int(x + radius) + 2, w), min(int(y + radius) + 2, h)]
        part = image[box[1]:box[3], box[0]:box[2]]
        # the ground shows where the sphere does not reach; coverage and content averaged over 4 x 4 points
        inside = U.disc(lambda d: np.ones(d.shape[:-1] + (3,)), w, h, x, y, radius, U.ball_angle, samples=4, outside=0, window=box)
        seen = U.disc(lights, w, h, x, y, radius, U.ball_angle, mirror=True, rotate=-turn, samples=4, outside=0, window=box)
        image[box[1]:box[3], box[0]:box[2]] = part * (1 - inside) + seen
    return image, centres


def corner_text(centres, n, m, radius, rng=None, error=0):
    pick = [0, n - 1, n * m - 1, n * (m - 1)]
    e = rng.uniform(-error, error, (4, 3)) if rng is not None else np.zeros((4, 3))
    return " ".join(f"{centres[k][0] + d[0]:.2f},{centres[k][1] + d[1]:.2f},{radius + d[2] / 2:.2f}" for k, d in zip(pick, e))


def field(tmp_path, image, n, m, *args, size="48x32", code=0):
    U.write_exr(tmp_path / "array.exr", image)
    out = tmp_path / "out.ilf.exr"
    r = run("fishremap", "--array", f"{n}x{m}", "--size", size, "--report", tmp_path / "r.json", *args, "-o", out, tmp_path / "array.exr", code=code)
    if code:
        return r
    pixels, header = U.read_exr(out)
    return pixels, header, json.loads((tmp_path / "r.json").read_text())


SCENE = U.lobes(14, 11, 1.5)   # nothing that a sphere of 40 pixels could not show


def check_probes(pixels, n, m, w=48, h=32, tolerance=0.01, of=max):
    """The probes' errors; `of` them: the worst, or the median where the spheres had to be found."""
    exact = U.probe(SCENE, w, h, 90, 6)
    rows = U.probe_angles(w, h, 90)[1] < 68   # beyond, a pixel of a small sphere already sees neighbours
    errors = [U.rel_rmse(pixels[j * h:(j + 1) * h, i * w:(i + 1) * w], exact, rows) for j in range(m) for i in range(n)]
    assert of(errors) < tolerance, np.round(errors, 3)


def test_array_to_light_field(tmp_path):
    n, m = 4, 3
    image, centres = photograph(SCENE, n, m)
    pixels, header, found = field(tmp_path, image, n, m, "--corners", corner_text(centres, n, m, 40))
    assert pixels.shape == (m * 32, n * 48, 3)
    check_probes(pixels, n, m, tolerance=0.08)
    assert header["ilf:version"] == 1
    assert header["ilf:polarMax"] == pytest.approx(np.pi / 2)
    assert np.degrees(header["ilf:polarValid"]) == pytest.approx(FREE_CONE, abs=0.35)
    assert header["ilf:U"] == pytest.approx((3, 0, 0)) and header["ilf:V"] == pytest.approx((0, 2, 0))
    assert found["pitch_per_diameter"] == pytest.approx(1, abs=0.01)


def test_each_sphere_at_its_place(tmp_path):
    """Spheres of different brightness land at their own (i, j): i along u (right), j along v (up)."""
    n, m = 3, 2
    image, centres = photograph(lambda d: np.ones(d.shape[:-1] + (3,)), n, m, ground=0.05)
    for k, (x, y) in enumerate(centres):
        yy, xx = np.mgrid[0:image.shape[0], 0:image.shape[1]]
        image[np.hypot(xx + .5 - x, yy + .5 - y) < 39] *= k + 1
    pixels, _, _ = field(tmp_path, image, n, m, "--corners", corner_text(centres, n, m, 40), "--reflectance", "0.5,0.25,1")
    for k in range(n * m):
        part = pixels[k // n * 32:(k // n + 1) * 32, k % n * 48:(k % n + 1) * 48]
        assert part[5:20].mean((0, 1)) == pytest.approx((2 * (k + 1), 4 * (k + 1), k + 1), rel=0.02)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("turn", [0, 4])
def test_corners_by_hand_three_pixels_off(tmp_path, seed, turn):
    n, m, rng = 6, 5, np.random.default_rng(seed)
    image, centres = photograph(SCENE, n, m, turn=turn)
    pixels, _, found = field(tmp_path, image, n, m, "--corners", corner_text(centres, n, m, 40, rng, 3))
    q = np.array(found["spheres"])
    assert np.abs(q[:, :2] - centres).max() < 0.8   # 2 % of the radius
    assert np.abs(q[:, 2] - 40).max() < 0.4
    check_probes(pixels, n, m, tolerance=0.12)


@pytest.mark.parametrize("n, m, turn, pitch, rotate", [(6, 5, 0, 80, 0), (4, 6, 3, 80, 0), (5, 5, -2, 94, 0), (4, 3, -90, 80, 90), (5, 2, 1, 84, 0)])
def test_corners_found(tmp_path, n, m, turn, pitch, rotate):
    image, centres = photograph(SCENE, n, m, turn=turn, pitch=pitch)
    pixels, _, found = field(tmp_path, image, n, m, "--corners", "auto", "--rotate", rotate, "--overlay", tmp_path / "o.png")
    q = np.array(found["spheres"])
    assert np.sqrt(((q[:, :2] - centres) ** 2).sum(1).mean()) < 0.8
    assert np.abs(q[:, 2] - 40).max() < 0.6
    check_probes(pixels, n, m, tolerance=0.1, of=np.median)
    assert (tmp_path / "o.png").stat().st_size > 1000


def test_free_cone_from_pitch(tmp_path):
    """4k s^2 - s - (2k - 1) = 0, against the ray that just touches the neighbour, found by bisection."""
    for k in (1.0, 1.1, 1.4, 2.0):
        lo, hi = 0.3, np.pi / 4
        for _ in range(60):
            a = (lo + hi) / 2
            p, d = np.array([np.sin(a), np.cos(a)]), np.array([np.sin(2 * a), np.cos(2 * a)])
            to = np.array([2 * k, 0]) - p
            lo, hi = (a, hi) if abs(to[0] * d[1] - to[1] * d[0]) > 1 else (lo, a)
        image, centres = photograph(SCENE, 3, 3, pitch=80 * k)
        _, header, _ = field(tmp_path, image, 3, 3, "--corners", corner_text(centres, 3, 3, 40))
        assert np.degrees(header["ilf:polarValid"]) == pytest.approx(np.degrees(2 * lo), abs=0.35)
    assert np.degrees(2 * np.arcsin((1 + np.sqrt(17)) / 8)) == pytest.approx(79.64, abs=0.005)


def test_plane_is_written(tmp_path):
    image, centres = photograph(SCENE, 2, 2)
    _, header, _ = field(tmp_path, image, 2, 2, "--corners", corner_text(centres, 2, 2, 40), "--plane", "1 2 3 0.5 0 0 0 0.25 0")
    assert header["ilf:origin"] == pytest.approx((1, 2, 3))
    assert header["ilf:U"] == pytest.approx((.5, 0, 0)) and header["ilf:V"] == pytest.approx((0, .25, 0))
    r = field(tmp_path, image, 2, 2, "--corners", corner_text(centres, 2, 2, 40), "--plane", "1 2 3 1 0 0 1 0 0", code=1)
    one_line_error(r, "fishremap", "expected")


def test_single_sphere(tmp_path):
    """1 x 1: given by four equal corners or by one; a probe picture or a light field of one probe."""
    image, centres = photograph(SCENE, 1, 1, radius=60)
    one = corner_text(centres, 1, 1, 60)
    pixels, header, _ = field(tmp_path, image, 1, 1, "--corners", one)
    again, _, _ = field(tmp_path, image, 1, 1, "--corners", one.split()[0])
    assert np.array_equal(pixels, again)
    check_probes(pixels, 1, 1, tolerance=0.01)
    run("fishremap", "--array", "1x1", "--corners", one, "--size", "48x32", "-o", tmp_path / "probe.exr", tmp_path / "array.exr")
    plain, header = U.read_exr(tmp_path / "probe.exr")
    assert np.allclose(plain[..., :3], pixels, rtol=1e-6) and "ilf:version" not in header


def test_wrong_corners_are_refused(tmp_path):
    n, m = 4, 3
    image, centres = photograph(SCENE, n, m)
    c = corner_text(centres, n, m, 40).split()

    def refused(corners, *words, more=()):
        one_line_error(field(tmp_path, image, n, m, "--corners", " ".join(corners), *more, code=1), "fishremap", "corner", *words)
    refused([c[3], c[2], c[1], c[0]], "order")
    refused([c[0], c[2], c[1], c[3]])
    refused([c[1], c[2], c[3], c[0]])
    refused(c, "--rotate", more=("--rotate", "90"))
    refused([c[0], c[1], c[2], "20,20,80"], "radi")
    x, y, r = map(float, c[1].split(","))
    refused([c[0], f"{x - 80},{y},{r}", c[2], c[3]])
    refused([c[0], f"{x},{y},-3", c[2], c[3]], "radius")
    one_line_error(run("fishremap", "--array", "4x3", "--size", "8x8", "--corners", "1,2,3 4,5", "-o", "x.ilf.exr", "y.exr", code=2), "fishremap", "X,Y,R")
    one_line_error(run("fishremap", "--array", "4x3", "--size", "8x8", "--corners", "1,2,3 4,5,6", "-o", "x.ilf.exr", "y.exr", code=2), "fishremap", "four")
    assert not (tmp_path / "out.ilf.exr").exists()


def test_nothing_to_find_is_said(tmp_path):
    rng = np.random.default_rng(3)
    r = field(tmp_path, rng.uniform(.4, .6, (200, 200, 3)), 4, 4, "--corners", "auto", code=1)
    one_line_error(r, "fishremap", "expected")
    r = field(tmp_path, np.ones((200, 200, 3)), 4, 4, "--corners", "auto", code=1)
    one_line_error(r, "fishremap", "expected")


# ---- rpict's photograph of 12 x 12 spheres in a room ----------------------------------------------------

CAL = "br = 0.6 + 0.25*sin(.15*Px)*sin(0.12*Py+1) + 0.15*sin(0.1*Pz);\n"


def polygon(material, name, *points):
    return f"{material} polygon {name}\n0\n0\n{3 * len(points)} " + " ".join("%g %g %g" % p for p in points) + "\n"


def room():
    """120 x 120 x 145 sphere diameters, painted; two spotlights and two disc lamps."""
    a, low, high = 60, -5, 140
    text = """void brightfunc paint
2 br paint.cal
0
0
paint plastic warm
0
0
5 .7 .65 .55 0 0
paint plastic cold
0
0
5 .4 .5 .7 0 0
void plastic board
0
0
5 .25 .25 .25 0 0
void metal chrome
0
0
5 1 1 1 1 0
void light glow
0
0
3 900 850 700
glow ring lampA
0
0
8 20 -25 60 -20 25 -60 0 6
glow ring lampB
0
0
8 -30 10 45 30 -10 -45 0 5
void spotlight spot1
0
0
7 6000 5700 4500 30 -8 -10 -40
spot1 ring bulb1
0
0
8 12 15 70 -8 -10 -40 0 2
void spotlight spot2
0
0
7 3000 3800 6000 30 10 12 -40
spot2 ring bulb2
0
0
8 -14 -18 70 10 12 -40 0 2
"""
    return text + polygon("warm", "w1", (-a, -a, low), (-a, a, low), (-a, a, high), (-a, -a, high)) + \
        polygon("cold", "w2", (a, a, low), (a, -a, low), (a, -a, high), (a, a, high)) + \
        polygon("cold", "w3", (-a, a, low), (a, a, low), (a, a, high), (-a, a, high)) + \
        polygon("warm", "w4", (a, -a, low), (-a, -a, low), (-a, -a, high), (a, -a, high)) + \
        polygon("warm", "w5", (-a, -a, high), (-a, a, high), (a, a, high), (a, -a, high)) + \
        polygon("board", "floor", (-a, -a, low), (a, -a, low), (a, a, low), (-a, a, low))


RENDER = ("-ps", 1, "-dj", 0, "-ab", 0, "-av", .3, .3, .3, "-lr", 8, "-lw", 1e-3, "-st", 0)


@pytest.fixture(scope="module")
def virtual(tmp_path_factory):
    """The photograph from 120 diameters, the camera 4 degrees off the normal, and captures at four positions."""
    if not any((p / "rpict").is_file() for p in (BIN, FETCHED)):
        pytest.skip("needs the project's own rpict: make radiance")
    f = tmp_path_factory.mktemp("array")
    (f / "paint.cal").write_text(CAL)
    (f / "room.rad").write_text(room())
    (f / "spheres.rad").write_text("".join(f"chrome sphere s{i}_{j}\n0\n0\n4 {i - 5.5} {j - 5.5} 0 .5\n" for j in range(12) for i in range(12)) +
                                   polygon("board", "bd", (-7, -7, -.5), (7, -7, -.5), (7, 7, -.5), (-7, 7, -.5)))
    (f / "room.oct").write_bytes(run("oconv", "room.rad", cwd=f).out)
    (f / "array.oct").write_bytes(run("oconv", "room.rad", "spheres.rad", cwd=f).out)
    tilt = np.radians(4)
    eye = 120 * np.array([np.sin(tilt) * .6, np.sin(tilt) * .8, np.cos(tilt)])
    view = ("-vtv", "-vp", *eye, "-vd", *(-eye / 120), "-vu", 0, 1, 0, "-vh", 6.2, "-vv", 6.2)
    big = run("rpict", *view, "-x", 1536, "-y", 1536, *RENDER, "array.oct", cwd=f, timeout=300).out
    (f / "array.hdr").write_bytes(run("pfilt", "-1", "-x", "/2", "-y", "/2", stdin=big).out)
    for i, j in ((0, 0), (5, 6), (11, 2)):
        sky = run("rpict", "-vta", "-vp", i - 5.5, j - 5.5, 0, "-vd", 0, 0, 1, "-vu", 0, 1, 0, "-vh", 180, "-vv", 180, "-x", 800, "-y", 800, *RENDER, "room.oct", cwd=f).out
        (f / f"sky_{i}_{j}.hdr").write_bytes(run("pfilt", "-1", "-x", "/2", "-y", "/2", stdin=sky).out)
    # where a camera at eye sees the sphere centres
    forward = -eye / 120
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    i, j = np.meshgrid(np.arange(12), np.arange(12))
    p = np.stack([i.ravel() - 5.5, j.ravel() - 5.5, 0 * i.ravel()], -1) - eye
    k = 384 / np.tan(np.radians(3.1))
    centres = np.stack([384 + k * (p @ right) / (p @ forward), 384 - k * (p @ up) / (p @ forward)], -1)
    return f, centres


def band_errors(f, pixels, i, j, w=96, h=48):
    run("fishremap", "--lens", "equidistant", "--fov", 180, "--size", f"{w}x{h}", "-o", f / "sky.exr", f / f"sky_{i}_{j}.hdr")
    sky = U.read_exr(f / "sky.exr")[0][..., :3]
    ours = pixels[j * h:(j + 1) * h, i * w:(i + 1) * w, :3]
    phi = U.probe_angles(w, h, 90)[1]

    def median_error(a, b):   # a pixel of a 30-pixel sphere is 4 degrees wide: means would be all lamps' outlines
        m = (phi >= a) & (phi < b)
        return np.median(np.abs(ours[m] - sky[m])) / np.median(sky[m])
    return [median_error(a, b) for a, b in ((0, 40), (40, 78), (81, 90))]


@pytest.mark.parametrize("how", ["auto", "hand"])
def test_virtual_photograph(virtual, tmp_path, how):
    f, centres = virtual
    corners = "auto" if how == "auto" else corner_text(centres, 12, 12, 29.5, np.random.default_rng(4), 3)
    run("fishremap", "--array", "12x12", "--corners", corners, "--camera-distance", 120, "--size", "96x48", "--report", tmp_path / "r.json",
        "-o", tmp_path / "o.ilf.exr", f / "array.hdr")
    found = json.loads((tmp_path / "r.json").read_text())
    q = np.array(found["spheres"])
    assert np.sqrt(((q[:, :2] - centres) ** 2).sum(1).mean()) < 0.6
    assert found["tilt_deg"] == pytest.approx(4, abs=0.7)
    pixels, header = U.read_exr(tmp_path / "o.ilf.exr")
    assert np.degrees(header["ilf:polarValid"]) == pytest.approx(FREE_CONE, abs=0.5)
    for i, j in ((0, 0), (5, 6), (11, 2)):
        near, far, band = band_errors(f, pixels, i, j)
        print(how, (i, j), f"median error within 40 deg {near:.3f}, to 78 deg {far:.3f}, beyond 81 deg {band:.3f}")
        assert near < 0.1 and far < 0.1, (near, far)
        if (i, j) == (5, 6):   # the neighbours' reflections, where the paper has them; a corner has few neighbours
            assert band > 2 * far


def test_perspective_matters_and_is_corrected(virtual, tmp_path):
    f, centres = virtual
    error = {}
    for name, more in (("orthographic", ()), ("perspective", ("--camera-distance", 120))):
        run("fishremap", "--array", "12x12", "--corners", corner_text(centres, 12, 12, 29.5), *more, "--size", "96x48", "-o", tmp_path / "o.ilf.exr", f / "array.hdr")
        error[name] = band_errors(f, U.read_exr(tmp_path / "o.ilf.exr")[0], 0, 0)
    assert error["perspective"][0] < 0.7 * error["orthographic"][0]
    assert error["perspective"][1] < 0.7 * error["orthographic"][1]
