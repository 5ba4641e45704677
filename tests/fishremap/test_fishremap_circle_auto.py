"""--centre auto and --corners auto: right at every size, cut, blur and JPEG quality, or a refusal in words.  The scenes are made
here; the photographs on which the search was wrong are tried where they are at hand."""
import io
import json

import numpy as np
import pytest
from PIL import Image

import fishremap_util as U
from conftest import one_line_error, run, shared_case, shared_data

BALL, LENS = ("--from", "ball"), ("--lens", "equidistant", "--fov", "180")


def find(tmp_path, picture, view=BALL):
    """x, y, radius, the report's goodness; or the words of the refusal."""
    r = run("fishremap", *view, "--centre", "auto", "--size", "8x4", "--report", tmp_path / "r.json", "-o", tmp_path / "o.exr", picture, code=None)
    if r.code:
        assert r.code == 1 and not (tmp_path / "o.exr").exists()
        return one_line_error(r, "fishremap", "--centre")
    found = json.loads((tmp_path / "r.json").read_text())
    return np.array([*found["centre"], found["radius"]]), found["circle"]


def room(seed, sharpest=2.2):
    """What a ball mirrors: lobes, two lamps, and a floor of tiles that runs into the rim as rings."""
    rng = np.random.default_rng(seed)
    smooth = U.lobes(18, seed, sharpest)
    lamps = [U.lamp(rng.uniform(0, 360), rng.uniform(5, 60), 8, 40) for _ in range(2)]
    tiles = rng.uniform(.5, 1.5, (8, 8))

    def scene(d):
        out = smooth(d) + sum(f(d) for f in lamps)
        k = np.floor(4 * (d[..., :2] + 1)).astype(int).clip(0, 7)
        return out * tiles[k[..., 0], k[..., 1]][..., None]
    return scene


def wall(w, h, seed, contrast=.5):
    """Textured surroundings: planks, a shelf, a gradient, mottled."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:h, :w] / max(w, h)
    planks = rng.uniform(-.5, .5, 40)[(np.floor(14 * (x + .2 * y))).astype(int) % 40]
    mottled = np.array(Image.fromarray(rng.normal(size=(h // 6 + 2, w // 6 + 2)).astype(np.float32)).resize((w, h), Image.BICUBIC))
    g = .25 * (1 + .6 * y) * np.exp(contrast * (planks + .15 * mottled) + .4 * (y > .75))
    return g[..., None] * rng.uniform(.8, 1.2, 3)


def shot(image, sd=0., seed=0, quality=None):
    """Blurred, with a camera's noise, as codes of sRGB (PNG, or JPEG of a quality): bytes."""
    if sd:
        k = np.exp(-.5 * (np.arange(-int(4 * sd) - 1, int(4 * sd) + 2) / sd) ** 2)
        for axis in (0, 1):
            image = np.apply_along_axis(lambda v: np.convolve(np.pad(v, len(k) // 2, "edge"), k / k.sum(), "valid"), axis, image)
    image = (image * np.random.default_rng(seed).normal(1, .01, image.shape)).clip(0, 1)
    code = np.where(image <= .0031308, 12.92 * image, 1.055 * image ** (1 / 2.4) - .055)
    out = io.BytesIO()
    Image.fromarray((255 * code + .5).astype(np.uint8)).save(out, "JPEG" if quality else "PNG", **({"quality": quality} if quality else {}))
    return out.getvalue()


def with_ball(image, x, y, r, seed):
    h, w = image.shape[:2]
    box = (max(int(x - r) - 1, 0), max(int(y - r) - 1, 0), min(int(x + r) + 2, w), min(int(y + r) + 2, h))
    part = (slice(box[1], box[3]), slice(box[0], box[2]))
    inside = U.disc(lambda d: np.ones(d.shape[:-1] + (3,)), w, h, x, y, r, U.ball_angle, samples=3, outside=0, window=box)
    image[part] = image[part] * (1 - inside) + .7 * U.disc(room(seed), w, h, x, y, r, U.ball_angle, mirror=True, samples=3, outside=0, window=box)
    return image


def lies_at(answer, truth, share=.02):
    assert not isinstance(answer, str), answer
    off = max(np.hypot(*(answer[0][:2] - truth[:2])), abs(answer[0][2] - truth[2])) / truth[2]
    assert off < share, (answer, truth)


# ---- balls -------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("w, x, y, r, sd, quality", [
    (400, 170, 120, 80, .5, 92), pytest.param(900, 382, 270, 180, .5, 92, marks=pytest.mark.sweep), (900, 382, 270, 180, 2.5, 60),   # one scene at two sizes, and blurred
    (500, 80, 170, 110, .7, 92),      # cut by the frame
])
def test_a_ball_before_a_textured_wall(tmp_path, w, x, y, r, sd, quality):
    image = with_ball(wall(w, w * 2 // 3, 3), x, y, r, 5)
    (tmp_path / "in.jpg").write_bytes(shot(image, sd, quality=quality))
    answer = find(tmp_path, tmp_path / "in.jpg")
    lies_at(answer, (x, y, r))
    assert .3 < answer[1]["rim_seen"] <= answer[1]["in_picture"] <= 1 and answer[1]["margin"] > 0 and answer[1]["rms_px"] < .02 * r


@pytest.mark.parametrize("dark", [1, .1])
def test_a_small_ball_is_right_or_refused(tmp_path, dark):
    """5 % of the shorter side.  The outermost pixel or two of a small ball hold half of the room as rings beside the rim: then it is
    found to a pixel, if at all; where the room is dark against the wall the rim is clear."""
    image = 2.2 * wall(700, 466, 3)
    r, x, y = 24, 480, 300
    ball = with_ball(image.copy(), x, y, r, 5)
    image = np.where(ball != image, np.minimum(dark * ball, dark * 3) + (1 - dark) * .05, image)
    (tmp_path / "in.png").write_bytes(shot(image, .6))
    answer = find(tmp_path, tmp_path / "in.png")
    if dark == .1 or not isinstance(answer, str):
        lies_at(answer, (x, y, r), .02 if dark == .1 else 1 / r)


def test_a_cut_does_not_move_the_ball(tmp_path):
    """The same pixels with less around them: the same circle."""
    image = shot(with_ball(wall(600, 400, 8), 260, 210, 100, 6), .6)
    whole = np.array(Image.open(io.BytesIO(image)))
    places = []
    for x0, y0, x1, y1 in ((0, 0, 600, 400), (130, 70, 420, 360)):
        Image.fromarray(whole[y0:y1, x0:x1]).save(tmp_path / "in.png")
        answer = find(tmp_path, tmp_path / "in.png")
        lies_at(answer, (260 - x0, 210 - y0, 100))
        places.append(answer[0] + (x0, y0, 0))
    assert np.ptp(places, axis=0).max() < 1


def test_two_balls_are_not_chosen_between(tmp_path):
    """Which one is meant?  Not for us to say."""
    image = with_ball(with_ball(wall(600, 400, 4), 160, 200, 100, 5), 440, 200, 100, 6)
    (tmp_path / "in.png").write_bytes(shot(image, .6))
    assert isinstance(find(tmp_path, tmp_path / "in.png"), str)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.sweep), 2])
@pytest.mark.parametrize("view", [BALL, LENS], ids=["ball", "fisheye"])
def test_no_circle_is_refused(tmp_path, view, seed):
    (tmp_path / "in.png").write_bytes(shot(wall(500, 400, 20 + seed, 1 + seed), .6))
    words = find(tmp_path, tmp_path / "in.png", view)
    assert isinstance(words, str), words


# ---- image circles -------------------------------------------------------------------------------------------

@pytest.mark.parametrize("x, y, r, vignette", [(300, 200, 170, 0), (290, 205, 230, 0), (310, 190, 160, .8)])
def test_a_fisheye_circle(tmp_path, x, y, r, vignette):
    """Whole, cut above and below, and darkened towards the rim."""
    image = U.disc(room(3), 600, 400, x, y, r, lambda q: q * np.pi / 2, samples=2, outside=0)
    far = (np.hypot(*np.meshgrid(np.arange(600) + .5 - x, np.arange(400) + .5 - y)) / r).clip(0, 1)
    image = .6 * image * (1 - vignette * far ** 4)[..., None] + 2e-4
    (tmp_path / "in.jpg").write_bytes(shot(image, .8, quality=90))
    lies_at(find(tmp_path, tmp_path / "in.jpg", LENS), (x, y, r))


# ---- what was wrong ----------------------------------------------------------------------------------------------

@pytest.mark.parametrize("name, truth", [
    pytest.param("tokyo_700", (355.4, 349.2, 341.1), marks=pytest.mark.sweep), ("tokyo_800", (406.2, 399.1, 389.8)), ("gene_miller_800", (404.4, 275.3, 112)),
    ("gene_miller_600", (303.3, 206.4, 84)), pytest.param("winter_700", (350, 350, 350), marks=pytest.mark.sweep), ("winter_800", (400, 400, 400))])
def test_photographs_at_several_sizes(tmp_path, name, truth):
    lies_at(find(tmp_path, shared_case("ball_auto_unstable") / f"{name}.jpg"), truth)


def test_a_chrome_ball_in_the_dark(tmp_path):
    answer = find(tmp_path, shared_case("ball_auto_satellite_and_chrome") / "chrome0.png")
    if not isinstance(answer, str):
        lies_at(answer, (253.8, 148.3, 119.5))


def test_frames_without_a_circle(tmp_path):
    assert isinstance(find(tmp_path, shared_case("no_circle_auto") / "euroc.jpg", LENS), str)
    answer = find(tmp_path, shared_case("canopy_circle") / "canopy.jpg", LENS)   # its rim hardly shows
    if not isinstance(answer, str):
        lies_at(answer, (637.8, 490.1, 392.9))


@pytest.mark.parametrize("k", [1, pytest.param(2, marks=pytest.mark.sweep), 3])
def test_a_ball_in_its_room(tmp_path, k):
    """The whole frame; the ball's place is stated to 6 pixels of its own crop's 816, that is 1.5 %."""
    s = 180 / 816
    answer = find(tmp_path, shared_data("mirrorball_bracket_desk_sony") / f"desk_{k}.JPG")
    if not isinstance(answer, str):
        lies_at(answer, (341 + 405 * s, 293 + 403 * s, 404 * s), .035)


# ---- arrays ---------------------------------------------------------------------------------------------------------

def found_array(tmp_path, picture, n, m):
    r = run("fishremap", "--array", f"{n}x{m}", "--corners", "auto", "--size", "8x4", "--report", tmp_path / "a.json", "-o", tmp_path / "a.ilf.exr", picture, code=None)
    if r.code:
        assert r.code == 1
        return one_line_error(r, "fishremap", "--corners")
    return np.array(json.loads((tmp_path / "a.json").read_text())["spheres"])


def test_a_wrong_grid_is_refused(tmp_path):
    folder = shared_case("array_auto_wrong_grid")
    corners = np.array([[float(v) for v in c.split(",")] for c in (folder / "corners.txt").read_text().split()])
    answer = found_array(tmp_path, folder / "room8x8.png", 8, 8)
    if not isinstance(answer, str):
        assert np.abs(answer[[0, 7, 63, 56]] - corners).max() < 1


def test_more_spheres_than_asked_for_are_refused(tmp_path):
    """5 x 4 spheres in the picture and 4 x 4 asked for: either four columns would do."""
    image = wall(420, 340, 2, .2)
    for i in range(5):
        for j in range(4):
            with_ball(image, 50 + 80 * i, 290 - 80 * j, 36, 5)
    (tmp_path / "in.png").write_bytes(shot(image, .5))
    assert isinstance(found_array(tmp_path, tmp_path / "in.png", 4, 4), str)
    answer = found_array(tmp_path, tmp_path / "in.png", 5, 4)
    if not isinstance(answer, str):
        assert np.abs(answer[0] - (50, 290, 36)).max() < 1.5
