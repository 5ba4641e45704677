"""Charts against each other: directions written into colours, every pair of charts, every turn of the camera.

The oracle is numpy's alone and follows the man page's words: what is right, up and ahead in each picture, what --rotate, --tilt
and --heading do to it, whose camera they mean.  A chart that is mirrored, turned the wrong way or about the wrong axis gives a
matrix other than 1, whatever the pictures' sizes.
"""
import itertools
import json

import numpy as np
import pytest
from PIL import Image

import fishremap_util as U
from conftest import one_line_error, run, shared_case

CHARTS = ("fisheye", "ball", "probe", "latlong", "angular")
DISCS = ("fisheye", "ball", "angular")
SIZE = {"fisheye": (120, 120), "ball": (160, 160), "probe": (120, 60), "latlong": (120, 60), "angular": (140, 140)}
FOV = 200
TURNS = ({}, {"rotate": 37, "tilt": 25, "tilt-to": 200}, {"tilt": 90, "rotate": 180}, {"tilt": 130, "tilt-to": -20}, {"heading": 35},
         {"heading": -110, "rotate": -15, "tilt": 8, "tilt-to": 60})


def turned(p, ball, turn):
    """Directions as a camera has them (right, up, ahead; of a ball: towards the camera) in the plane's frame (u, v, n)."""
    r, t, to = (np.radians(turn.get(k, d)) for k, d in (("rotate", 0), ("tilt", 0), ("tilt-to", 90)))
    right, up, ahead = p[..., 0], p[..., 1], p[..., 2]
    right, up = right * np.cos(r) - up * np.sin(r), right * np.sin(r) + up * np.cos(r)
    along, across = right * np.cos(to) + up * np.sin(to), up * np.cos(to) - right * np.sin(to)
    along, ahead = along * np.cos(t) + ahead * np.sin(t), ahead * np.cos(t) - along * np.sin(t)
    right, up = along * np.cos(to) - across * np.sin(to), along * np.sin(to) + across * np.cos(to)
    s = 1 if ball else -1      # +u to the right in a ball's picture seen from above, to the left for a camera that looks up
    if "heading" not in turn:
        return np.stack([s * right, up, ahead], -1)
    h = np.radians(turn["heading"])
    return np.stack([ahead * np.cos(h) - s * right * np.sin(h), ahead * np.sin(h) + s * right * np.cos(h), up], -1)


def picture_directions(view, w, h, turn={}, x=None, y=None):
    """Direction of each pixel (or of the positions x, y), and whether the picture shows it well."""
    if x is None:
        y, x = np.mgrid[0:h, 0:w] + .5
    if view == "probe":
        az, pol = x / w * 2 * np.pi - np.pi, y / h * np.pi
        u, v, n = np.sin(pol) * np.cos(az), np.sin(pol) * np.sin(az), np.cos(pol)
        return turned(np.stack([-u, v, n], -1), False, turn), np.ones(x.shape, bool)
    if view == "latlong":
        lon, lat = (x / w - .5) * 2 * np.pi, (.5 - y / h) * np.pi
        return turned(np.stack([np.cos(lat) * np.sin(lon), np.sin(lat), np.cos(lat) * np.cos(lon)], -1), False, turn), np.ones(x.shape, bool)
    px, py = (x - w / 2) / (min(w, h) / 2), (h / 2 - y) / (min(w, h) / 2)
    r, psi = np.hypot(px, py), np.arctan2(py, px)
    theta = {"fisheye": r * np.radians(FOV / 2), "angular": r * np.pi, "ball": 2 * np.arcsin(np.clip(r, 0, 1))}[view]
    p = np.stack([np.sin(theta) * np.cos(psi), np.sin(theta) * np.sin(psi), np.cos(theta)], -1)
    return turned(p, view == "ball", turn), r < {"fisheye": .97, "angular": .95, "ball": .9}[view]


def ahead_of(view, turn):
    return turned(np.array([0., 0, 1]), view == "ball", turn)


REACH = {"fisheye": FOV / 2 - 4, "ball": 140, "angular": 165}   # degrees from ahead, beyond which a picture shows little


def options(view_from, view_to, turn):
    given = ["--from", view_from, "--to", view_to]
    if "fisheye" in (view_from, view_to):
        given += ["--lens", "equidistant", "--fov", FOV]
    if "probe" in (view_from, view_to):
        given += ["--polar-max", 180]
    return given + [str(w) for k, v in turn.items() for w in (f"--{k}", v)]


def well_seen(view_from, view_to, source, target):
    """What the remap is to be: directions of OUT's pixels, those to compare, and IN's picture."""
    d, sure = picture_directions(view_to, *SIZE[view_to], target)
    for view, turn in ((view_from, source), (view_to, target)):
        if view in DISCS:
            sure &= d @ ahead_of(view, turn) > np.cos(np.radians(REACH[view]))
    image = (1 + picture_directions(view_from, *SIZE[view_from], source)[0]) / 2
    return d, sure, image


@pytest.mark.parametrize("view_from, view_to", list(itertools.product(CHARTS, CHARTS)))
def test_every_pair_is_a_rotation_and_the_right_one(tmp_path, view_from, view_to):
    w, h = SIZE[view_to]
    for turn in TURNS:
        outs = view_to in DISCS and view_from not in DISCS     # a camera's view of a map: its camera; else IN's
        d, sure, image = well_seen(view_from, view_to, {} if outs else turn, turn if outs else {})
        U.write_exr(tmp_path / "in.exr", image)
        run("fishremap", *options(view_from, view_to, turn), "--size", f"{w}x{h}", "-o", tmp_path / "out.exr", tmp_path / "in.exr")
        got = 2 * U.read_exr(tmp_path / "out.exr")[0][..., :3] - 1
        m = np.linalg.lstsq(d[sure], got[sure], rcond=None)[0].T
        assert np.linalg.det(m) > .98, (turn, m)
        assert np.abs(m - np.eye(3)).max() < .01, (turn, m)
        assert np.abs(got - d)[sure].max() < .03, turn


@pytest.mark.parametrize("view_from, view_to", [p for p in itertools.product(CHARTS, CHARTS) if p[0] in DISCS and p[1] not in DISCS])
def test_the_same_options_lead_there_and_back(tmp_path, view_from, view_to):
    turn = {"rotate": 37, "tilt": 25, "tilt-to": 200, "heading": 70}
    _, sure, image = well_seen(view_to, view_from, {}, turn)
    image = (1 + picture_directions(view_from, *SIZE[view_from], turn)[0]) / 2
    U.write_exr(tmp_path / "a.exr", image)
    run("fishremap", *options(view_from, view_to, turn), "--size", "160x80", "-o", tmp_path / "b.exr", tmp_path / "a.exr")
    run("fishremap", *options(view_to, view_from, turn), "--size", "{}x{}".format(*SIZE[view_from]), "-o", tmp_path / "c.exr", tmp_path / "b.exr")
    assert np.abs(U.read_exr(tmp_path / "c.exr")[0][..., :3] - image)[sure].max() < .02


@pytest.mark.parametrize("turn", [t for t in TURNS if t])
@pytest.mark.parametrize("view", ["latlong", "probe"])
def test_turned_panoramas_keep_their_energy(tmp_path, view, turn):
    """Random lamps, two of them at the poles, whose texels a turned map cuts in every way."""
    rng = np.random.default_rng(3)
    image = rng.uniform(0, 1, (45, 90, 3)) ** 8
    image[0], image[-1] = 20, 5
    U.write_exr(tmp_path / "in.exr", image)
    run("fishremap", *options(view, "probe", turn), "--size", "50x26", "-o", tmp_path / "out.exr", tmp_path / "in.exr")
    got = U.read_exr(tmp_path / "out.exr")[0]
    assert got.shape[2] == 3      # all is seen
    light = [(i * U.probe_solid_angle(*i.shape[1::-1], 180)[:, None, None]).sum((0, 1)) for i in (image, got)]
    assert np.allclose(*light, rtol=2e-4)
    U.write_exr(tmp_path / "in.exr", np.full((45, 90, 3), 3.))
    run("fishremap", *options(view, "probe", turn), "--size", "50x26", "-o", tmp_path / "out.exr", tmp_path / "in.exr")
    assert np.allclose(U.read_exr(tmp_path / "out.exr")[0], 3, rtol=1e-5)


@pytest.mark.parametrize("args", [("--tilt", 90, "--rotate", 180), ("--heading", 90)])
def test_a_panorama_becomes_a_probe_of_a_horizontal_plane(tmp_path, args):
    """Zenith at the top, +y in the middle, +x to the right of it: n is up and u, v, n are x, y, z."""
    w, h = 160, 80
    d = picture_directions("latlong", w, h)[0]
    east, up, north = -d[..., 0], d[..., 1], d[..., 2]
    U.write_exr(tmp_path / "sky.exr", (1 + np.stack([east, north, up], -1)) / 2)
    for size, polar in (((64, 16), 90), ((64, 32), 180)):
        run("fishremap", "--from", "latlong", *args, "--polar-max", polar, "--size", "{}x{}".format(*size), "-o", tmp_path / "p.exr", tmp_path / "sky.exr")
        got = 2 * U.read_exr(tmp_path / "p.exr")[0] - 1
        want = U.probe(lambda q: q, *size, polar, 4)
        assert np.abs(got - want).max() < .01


# ---- real and rendered pictures ------------------------------------------------------------------------------

def test_a_ball_by_way_of_a_panorama(tmp_path):
    """The one way and the other to a probe; determinant of the fit +1."""
    ball = shared_case("ball_to_latlong_mirrored") / "A.exr"
    run("fishremap", "--from", "ball", "--polar-max", 180, "--size", "128x64", "-o", tmp_path / "direct.exr", ball)
    direct = U.read_exr(tmp_path / "direct.exr")[0]
    sure = np.degrees(np.arange(64)[:, None] + .5) * np.pi / 64 < 135
    sure = np.broadcast_to(sure, (64, 128))
    for via, size, more in (("latlong", "512x256", ()), ("angular", "512x512", ()), ("fisheye", "512x512", ("--lens", "equidistant", "--fov", 300))):
        run("fishremap", "--from", "ball", "--to", via, *more, "--size", size, "-o", tmp_path / "v.exr", ball)
        run("fishremap", "--from", via, *more, "--to", "probe", "--polar-max", 180, "--size", "128x64", "-o", tmp_path / "via.exr", tmp_path / "v.exr")
        assert np.abs(U.read_exr(tmp_path / "via.exr")[0][..., :3] - direct[..., :3])[sure].max() < .02


def test_signs_of_a_shop_can_be_read(tmp_path):
    """A real ball: the panorama correlates with one sampled by numpy as a viewer within the sphere sees it, not with its mirror image."""
    shop = shared_case("ball_to_latlong_mirrored") / "shop.jpg"
    run("fishremap", "--from", "ball", "--centre", "710,704", "--radius", 666, "--to", "latlong", "--size", "600x300", "-o", tmp_path / "s.exr", shop)
    got = U.read_exr(tmp_path / "s.exr")[0][..., :3].mean(-1)
    y, x = np.mgrid[0:300, 0:600] + .5
    d = picture_directions("latlong", 600, 300)[0]
    # the ball's picture has +u to its right; half way between the direction and the camera lies the ball's normal
    m = d + [0, 0, 1]
    m /= np.linalg.norm(m, axis=-1, keepdims=True)
    code = np.asarray(Image.open(shop).convert("RGB"), float) / 255
    light = np.where(code <= .04045, code / 12.92, ((code + .055) / 1.055) ** 2.4).mean(-1)
    px, py = 710 + 666 * m[..., 0] - .5, 704 - 666 * m[..., 1] - .5
    sure = (d[..., 2] > -.7) & (px > 1) & (py > 1) & (px < light.shape[1] - 2) & (py < light.shape[0] - 2)
    want = light[np.clip(np.rint(py).astype(int), 0, light.shape[0] - 1), np.clip(np.rint(px).astype(int), 0, light.shape[1] - 1)]
    assert np.corrcoef(got[sure], want[sure])[0, 1] > .95
    both = sure & sure[:, ::-1]
    assert np.corrcoef(got[both], want[:, ::-1][both])[0, 1] < .6


def test_a_rendered_sky(tmp_path):
    """A room with one coloured wall a side, as a panorama: red in +x, green in +y, blue in -y."""
    sky = shared_case("latlong_tilt") / "sky.hdr"
    run("fishremap", "--from", "latlong", "--tilt", 90, "--rotate", 180, "--size", "128x64", "-o", tmp_path / "a.exr", sky)
    got = U.read_exr(tmp_path / "a.exr")[0]
    row = 50    # polar angle 71
    assert np.allclose(got[row, 64], [5.016, .516, .516], rtol=.03)
    assert got[row, 96].argmax() == 1 and got[row, 32].argmax() == 2


def test_a_world_of_directions(tmp_path):
    world = shared_case("panorama_tilt_ignored") / "world.exr"
    run("fishremap", "--from", "latlong", "--tilt", 90, "--tilt-to", 270, "--size", "64x16", "-o", tmp_path / "p.exr", world)
    got, d = 2 * U.read_exr(tmp_path / "p.exr")[0] - 1, U.probe(lambda q: q, 64, 16, 90, 3)
    assert np.abs(got - d * [-1, -1, 1]).max() < .05      # u = west, v = south, n = up


# ---- a second view of the ball --------------------------------------------------------------------------------

def ball_from(azimuth, n=96):
    """Picture of a ball on a stand, taken upright from that side; colour = direction in (east, north, up)."""
    return (1 + picture_directions("ball", n, n, {"heading": azimuth})[0]) / 2


TWO = ("--from", "ball", "--centre", "48,48", "--radius", 48, "--polar-max", 180, "--size", "64x32")


@pytest.mark.parametrize("gain", [1, .37])
def test_a_second_view_with_a_rotation_of_its_own(tmp_path, gain):
    """From the south and from the east, the second at another exposure, with a hand before it that a mask takes out."""
    U.write_exr(tmp_path / "a.exr", ball_from(270))
    b = gain * ball_from(0)
    b[30:60, 60:80] = 7
    U.write_exr(tmp_path / "b.exr", b)
    mask = np.ones((96, 96, 3))
    mask[29:61, 59:81] = 0
    U.write_exr(tmp_path / "m.exr", mask)
    want = U.probe(lambda q: (1 + q) / 2, 64, 32, 180, 3)
    second = ("--second", tmp_path / "b.exr", "--second-mask", tmp_path / "m.exr", "--report", tmp_path / "r.json")
    # A is upright and seen from the south: its top is n, and +v is behind it
    r = run("fishremap", *TWO, "--tilt", 90, "--tilt-to", 270, *second, "--second-view", "48,48,48,90,0,90", "-o", tmp_path / "p.exr", tmp_path / "a.exr")
    got = U.read_exr(tmp_path / "p.exr")[0]
    assert np.sqrt(((got[..., :3] - want) ** 2).mean()) < .01 and np.quantile(np.abs(got[..., :3] - want), .95) < .01
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["second_gain"] == pytest.approx(1 / gain, rel=.01) and report["second_residual"] < .02
    assert "matched" in r.err
    # what is given is used, and what would match is said
    r = run("fishremap", *TWO, "--tilt", 90, "--tilt-to", 270, *second, "--second-gain", 2, "--second-view", "48,48,48,90,0,90", "-o", tmp_path / "q.exr",
            tmp_path / "a.exr")
    assert "as given" in r.err
    # the second's place wrong: said
    r = run("fishremap", *TWO, "--tilt", 90, "--tilt-to", 270, *second, "--second-view", "48,48,48,90,180,270", "-o", tmp_path / "q.exr", tmp_path / "a.exr")
    assert "--second-view" in r.err


def test_the_second_view_of_the_case(tmp_path):
    folder = shared_case("second_view_no_rotate")
    run("fishremap", *TWO, "--tilt", 90, "--tilt-to", 270, "--second", folder / "B.exr", "--second-view", "48,48,48,90,0,90", "-o", tmp_path / "p.exr", folder / "A.exr")
    run("fishremap", *TWO, "--tilt", 90, "--tilt-to", 270, "-o", tmp_path / "a.exr", folder / "A.exr")
    p, a = U.read_exr(tmp_path / "p.exr")[0][..., :3], U.read_exr(tmp_path / "a.exr")[0]
    sure = (a[..., 3] == 1 if a.shape[2] == 4 else np.ones((32, 64), bool)) & (U.probe(lambda q: q, 64, 32, 180, 1)[..., 1] < .5)
    assert np.sqrt(((p - a[..., :3])[sure] ** 2).mean()) < .01


# ---- what Radiance is told -----------------------------------------------------------------------------------

@pytest.mark.parametrize("lens, fov, size, turn", [
    ("equidistant", 180, "60x60", {}), ("equidistant", 200, "60x60", {"tilt": 30, "tilt-to": 100, "rotate": 20}), ("orthographic", 180, "60x60", {}),
    ("stereographic", 170, "60x60", {"heading": 40}), ("orthographic", 100, "60x50", {}), ("equidistant", 150, "64x50", {}), ("angular", 360, "60x60", {})])
def test_a_picture_for_radiance_names_its_view(tmp_path, lens, fov, size, turn):
    """vwrays, which has never heard of fishremap, asks the VIEW line which direction each pixel shows: it is the pixel's colour."""
    d = picture_directions("latlong", 256, 128)[0]
    U.write_exr(tmp_path / "in.exr", (1 + d) / 2)
    to = ("--to", "angular") if lens == "angular" else ("--to", "fisheye", "--lens", lens, "--fov", fov)
    run("fishremap", "--from", "latlong", *to, *[str(w) for k, v in turn.items() for w in (f"--{k}", v)], "--size", size, "-o", tmp_path / "x.hdr", tmp_path / "in.exr")
    w, h = map(int, size.split("x"))
    rays = np.frombuffer(run("vwrays", "-ff", tmp_path / "x.hdr").out, np.float32).reshape(h, w, 6)[..., 3:]
    (tmp_path / "y.txt").write_bytes(run("pvalue", "-h", "-H", "-d", tmp_path / "x.hdr").out)
    colour = 2 * np.loadtxt(tmp_path / "y.txt").reshape(h, w, 3) - 1
    y, x = np.mgrid[0:h, 0:w] + .5
    inside = np.hypot(x - w / 2, y - h / 2) < .95 * min(w, h) / 2
    assert np.abs(rays - colour)[inside].max() < .06


def test_a_view_without_a_name_is_said(tmp_path):
    U.write_exr(tmp_path / "in.exr", np.ones((32, 64, 3)))
    r = run("fishremap", "--from", "latlong", "--to", "fisheye", "--lens", "equisolid", "--fov", 180, "--size", "32x32", "-o", tmp_path / "x.hdr", tmp_path / "in.exr")
    assert "VIEW" in r.err and b"VIEW" not in (tmp_path / "x.hdr").read_bytes()


# ---- options without a meaning ----------------------------------------------------------------------------------

GIVEN = {"lens": "equidistant", "fov": "180", "centre": "10,10", "radius": "9", "falloff": "f.txt", "falloff-set": "f4", "aperture": "4", "polar-max": "120",
         "span": "180", "rotate": "10", "tilt": "10", "tilt-to": "10", "heading": "10", "outside": "black", "overlay": "o.png", "corners": "auto",
         "plane": "0 0 0 1 0 0 0 1 0", "camera-distance": "5", "diameter": "2", "reflectance": ".5", "hide-camera": "5", "second": "b.exr",
         "second-view": "1,1,1,0,0", "second-mask": "m.exr", "second-gain": "2"}
ALONE = {"falloff-set", "aperture", "tilt-to", "diameter", "second", "second-view", "second-mask", "second-gain", "corners", "plane"}   # these go with another


@pytest.mark.parametrize("view_from", CHARTS)
def test_an_option_does_something_or_is_refused(tmp_path, view_from):
    """Each option alone, for each pair of charts: other light than without it, or exit 2 with its name."""
    rng = np.random.default_rng(1)
    w, h = (40, 20) if view_from in ("probe", "latlong") else (40, 40)
    U.write_exr(tmp_path / "in.exr", rng.uniform(.5, 1, (h, w, 3)))
    (tmp_path / "f.txt").write_text("0 1 1 1\n180 .5 .5 .5\n")
    for view_to in CHARTS:
        need = ["--lens", "equisolid", "--fov", 190] if "fisheye" in (view_from, view_to) else []
        size = "16x8" if view_to in ("probe", "latlong") else "16x16"

        def light(*more, code=0):
            r = run("fishremap", "--from", view_from, "--to", view_to, *need, *more, "--size", size, "-o", tmp_path / "out.exr", tmp_path / "in.exr", code=None)
            assert r.code == code or code is None, r
            return U.read_exr(tmp_path / "out.exr")[0] if r.code == 0 else r
        plain = light()
        for name, value in GIVEN.items():
            if name == "overlay" or (need and name in ("lens", "fov")):
                continue
            got = light(f"--{name}", str(tmp_path / value) if value.endswith((".txt", ".exr")) else value, code=None)
            if isinstance(got, np.ndarray):
                assert name not in ALONE
                nothing_to_do = (name == "outside" and plain.shape[2] == 3) or (name == "span" and view_from == view_to)
                assert got.shape != plain.shape or np.abs(got - plain).max() > 1e-4 or nothing_to_do, (view_from, view_to, name)
            else:
                assert got.code == 2
                one_line_error(got, "fishremap", f"--{name}")


@pytest.mark.parametrize("args", [
    ("--from", "ball", "--radius", "1e30"), ("--from", "ball", "--radius", "-3"), ("--from", "ball", "--radius", "nan"), ("--from", "ball", "--centre", "1e30,4"),
    ("--from", "ball", "--rotate", "1e300"), ("--from", "ball", "--camera-distance", ".4"), ("--from", "latlong", "--span", "0"), ("--polar-max", "0"),
    ("--from", "ball", "--polar-max", "-10"), ("--from", "ball", "--hide-camera", "90"), ("--array", "1x1", "--corners", "1e30,5,5"),
    ("--array", "2x2", "--corners", "5,5,3 1e30,5,3 15,15,3 5,15,3"), ("--array", "1x1", "--corners", "5,5,inf"), ("--from", "ball", "--heading", "inf"),
    ("--from", "ball", "--second", "b.exr", "--second-view", "1,1,1e30,0,0"), ("--from", "ball", "--second", "b.exr", "--second-view", "1,1,1,0,0,1,2"),
    ("--from", "ball", "--second", "b.exr", "--second-view", "1,1,-1,0,0"), ("--from", "ball", "--diameter", "1e-300", "--camera-distance", "2"),
    ("--from", "ball", "--second", "b.exr", "--second-view", "1,1,1,0,0", "--second-gain", "0")])
def test_numbers_out_of_range_are_refused_in_words(tmp_path, args):
    U.write_exr(tmp_path / "in.exr", np.ones((20, 20, 3)))
    r = run("fishremap", *args, "--size", "8x8", "-o", tmp_path / "o.exr", tmp_path / "in.exr", code=2)
    one_line_error(r, "fishremap", "expected")
    assert "memory" not in r.err and not (tmp_path / "o.exr").exists()


def test_help_has_no_torn_lines():
    """Sentences run on until the line is full: no line of an option's text ends early."""
    text = run("fishremap", "--help").text.splitlines()
    column = next(len(line) - len(line.lstrip()) for line in text if line.startswith(" " * 12))
    seen = 0
    for line, following in zip(text, text[1:]):
        if following.startswith(" " * column) and (line.startswith(" " * column) or line[column - 2:column] == "  "):
            assert len(line) + 1 + len(following.split()[0]) > 80, line
            seen += 1
    assert seen > 10
