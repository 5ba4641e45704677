"""fishremap --centre auto and single balls found: synthetic, and in real photographs."""
import json

import numpy as np
import pytest

import fishremap_util as U
from conftest import one_line_error, run, shared_data
from fishremap_util import remap


# ---- finding the circle --------------------------------------------------------------------------------

@pytest.mark.parametrize("cx, cy, r", [(300, 240, 200), (331.7, 222.4, 180.3), (300, 300, 290)])
def test_centre_auto(tmp_path, cx, cy, r):
    image = U.disc(U.lobes(20, 7), 600, 480, cx, cy, r, lambda q: q * np.radians(92.5), samples=2, outside=1e-4)
    U.write_exr(tmp_path / "in.exr", image)
    run("fishremap", "--lens", "equidistant", "--fov", 185, "--size", "32x16", "--centre", "auto", "--report", tmp_path / "r.json",
        "--overlay", tmp_path / "o.png", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    found = json.loads((tmp_path / "r.json").read_text())
    assert found["centre"] == pytest.approx((cx, cy), abs=0.7) and found["radius"] == pytest.approx(r, abs=0.7)
    assert (tmp_path / "o.png").read_bytes()[:4] == b"\x89PNG"


def test_no_circle_is_said(tmp_path):
    r = remap(tmp_path, np.ones((100, 100, 3)), "--lens", "equidistant", "--fov", 185, "--size", "32x16", "--centre", "auto", code=1)
    one_line_error(r, "fishremap", "circle")


def test_office_circle(tmp_path):
    folder = shared_data("fisheye_bracket_office_canon5d2_8mm")
    run("fishremap", "--lens", "equisolid", "--fov", 186, "--size", "32x16", "--centre", "auto", "--report", tmp_path / "r.json",
        "-o", tmp_path / "o.exr", folder / "IMG_6962.jpg")
    found = json.loads((tmp_path / "r.json").read_text())
    # stated to 1-2 pixels: centre (706, 466), radius 451.5
    assert found["centre"] == pytest.approx((706, 466), abs=3) and found["radius"] == pytest.approx(451.5, abs=3)


@pytest.mark.parametrize("folder, name, centre, radius, slack", [
    *(("mirrorball_bracket_desk_sony", f"desk_{k}.png", (405, 403), 404, 6) for k in (1, 3)),   # stated to 6 pixels
    *(("mirrorball_bracket_uiuc_lab", f"ball_1_{k}.png", (132, 132), 131, 1.31) for k in (24, 205)),
])
def test_real_mirror_balls(tmp_path, folder, name, centre, radius, slack):
    picture = shared_data(folder) / name
    run("fishremap", "--array", "1x1", "--corners", "auto", "--size", "32x16", "--report", tmp_path / "r.json", "-o", tmp_path / "o.ilf.exr", picture)
    x, y, r = json.loads((tmp_path / "r.json").read_text())["spheres"][0]
    assert r == pytest.approx(radius, rel=0.01)
    assert (x, y) == pytest.approx(centre, abs=slack)


def photographed_ball(w, h, cx, cy, r, blur, seed=1):
    """A mirror ball before a ground that it partly has the brightness of; 1 % noise."""
    rng = np.random.default_rng(seed)
    inside = U.disc(lambda d: np.ones(d.shape[:-1] + (3,)), w, h, cx, cy, r, U.ball_angle, samples=4, outside=0)
    image = U.disc(U.lobes(14, 11, 2.), w, h, cx, cy, r, U.ball_angle, mirror=True, samples=3, outside=0)
    image += (1 - inside) * (.3 + .1 * np.sin(np.arange(w) / 40))[:, None]
    k = np.exp(-.5 * (np.arange(-4, 5) / blur) ** 2) if blur else np.ones(1)
    for axis in (0, 1):
        image = np.apply_along_axis(lambda line: np.convolve(np.pad(line, len(k) // 2, "edge"), k / k.sum(), "valid"), axis, image)
    return image * rng.normal(1, .01, image.shape)


@pytest.mark.parametrize("w, h, cx, cy, r, blur", [
    (300, 260, 140.3, 131.7, 90.4, 0), (300, 260, 140.3, 131.7, 90.4, 1), (264, 264, 132.4, 131.7, 131.2, 1),   # whole; cut to the ball
    (264, 264, 132, 132, 134, 1), (300, 260, 60, 131.7, 90.4, .5),   # cut by the frame, on all sides and on one
])
def test_a_ball_is_found_within_a_hundredth(tmp_path, w, h, cx, cy, r, blur):
    U.write_exr(tmp_path / "in.exr", photographed_ball(w, h, cx, cy, r, blur))
    run("fishremap", "--array", "1x1", "--corners", "auto", "--size", "8x8", "--report", tmp_path / "r.json", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    found = json.loads((tmp_path / "r.json").read_text())["spheres"][0]
    assert found == pytest.approx((cx, cy, r), abs=.01 * r)
