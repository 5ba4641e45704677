"""--centre auto: what is round and is not the ball's rim is refused, and the answer goes with the picture: mirrored, resized, softened.

Each scene is one that a search of a single copy answers wrongly: a flange around a mirror, a wheel, a saucer, a star out of focus,
coins.  The rim of a ball is where the picture of the room ends, all around, and nothing else round is beside it.
"""
import io

import numpy as np
import pytest
from PIL import Image, ImageFilter, ImageOps

import fishremap_util as U
from test_fishremap_circle_auto import BALL, find, lies_at, room, shot, wall, with_ball


def distance(w, h, x, y):
    return np.hypot(*np.meshgrid(np.arange(w) + .5 - x, np.arange(h) + .5 - y))


def step(d, at):
    """1 within `at`, 0 outside, over a pixel."""
    return np.clip(at + .5 - d, 0, 1)[..., None]


def ringed(w, h, x, y, radii, levels):
    """Discs about one centre, the largest first, on the wall."""
    image, d = wall(w, h, 3, .2), distance(w, h, x, y)
    for r, level in zip(radii, levels):
        image = image * (1 - step(d, r)) + level * step(d, r)
    return image


@pytest.mark.parametrize("ratio", [1.08, 1.2, 1.35])
def test_a_flange_is_not_the_rim(tmp_path, ratio):
    """A security mirror in its ring.  Its rim may be found, or nothing."""
    w, h, x, y, r = 600, 420, 290, 205, 120
    image = wall(w, h, 3, .2)
    s = step(distance(w, h, x, y), ratio * r)
    image = with_ball(image * (1 - s) + .75 * s, x, y, r, 5)
    (tmp_path / "in.png").write_bytes(shot(image, .7))
    answer = find(tmp_path, tmp_path / "in.png")
    if not isinstance(answer, str):
        lies_at(answer, (x, y, r))


@pytest.mark.parametrize("name, radii, levels", [
    ("wheel", (150, 135, 112, 106, 92, 88, 40, 30), (.03, .1, .5, .08, .6, .12, .5, .05)),
    ("saucer", (160, 150, 118, 90, 84), (.5, .35, .42, .8, .1)),
])
def test_nested_rings_are_refused(tmp_path, name, radii, levels):
    (tmp_path / "in.png").write_bytes(shot(ringed(560, 400, 270, 205, radii, levels), .7))
    words = find(tmp_path, tmp_path / "in.png")
    assert isinstance(words, str), (name, words)


def test_stars_and_coins_are_refused(tmp_path):
    """Many alike: no one of them is meant."""
    rng = np.random.default_rng(5)
    sky = np.full((420, 600, 3), .004)
    for _ in range(60):
        d = distance(600, 420, rng.uniform(0, 600), rng.uniform(0, 420))
        sky += rng.uniform(.1, .9) * np.exp(-.5 * (d / rng.uniform(1, 7)) ** 2)[..., None]
    coins = wall(600, 420, 9, .2)
    for i in range(5):
        for j in range(3):
            s = step(distance(600, 420, 80 + 110 * i, 80 + 130 * j), 36 + 2 * rng.normal())
            coins = coins * (1 - s) + s * rng.uniform(.3, .7)
    for name, image in (("sky", sky), ("coins", coins)):
        (tmp_path / "in.png").write_bytes(shot(image, .6))
        words = find(tmp_path, tmp_path / "in.png")
        assert isinstance(words, str), (name, words)


def test_the_answer_goes_with_the_picture(tmp_path):
    """Mirrored, turned, smaller, larger, softer: the same ball, and the report says that the looks agree."""
    truth = np.array([262.3, 198.6, 96.4])
    whole = Image.open(io.BytesIO(shot(with_ball(wall(600, 400, 8), *truth, 6), .7)))
    w, h = whole.size
    changed = [
        (ImageOps.mirror(whole), (w - truth[0], truth[1], truth[2])),
        (whole.rotate(90, expand=True), (truth[1], w - truth[0], truth[2])),
        (whole.resize((420, 280), Image.LANCZOS), .7 * truth),
        (whole.resize((780, 520), Image.BICUBIC), 1.3 * truth),
        (whole.filter(ImageFilter.GaussianBlur(1.5)), truth),
    ]
    for k, (picture, where) in enumerate([(whole, truth), *changed]):
        (folder := tmp_path / str(k)).mkdir()
        picture.save(folder / "in.png")
        answer = find(folder, folder / "in.png")
        if k == len(changed) and isinstance(answer, str):
            continue   # blur may hide a part of the rim, never move it
        lies_at(answer, where, .015)
        assert 0 < answer[1]["apart"] <= .03, (k, answer)


def test_a_rim_that_is_half_lost_in_the_dark_is_right_or_refused(tmp_path):
    """A chrome ball, lit from above in a dark room: below, its rim is one step of 8 bits, or none."""
    w, h, x, y, r = 512, 340, 253.8, 148.3, 119.5
    d = distance(w, h, x, y)
    down = (np.arange(h) / h)[:, None, None]
    inside = .004 * np.clip(1.2 - 2 * down, 0, 1) + .8 * np.exp(-.5 * (distance(w, h, 262, 118) / 5) ** 2)[..., None]
    image = (.0006 * (1 - down ** 2)) * (1 - step(d, r)) + inside * step(d, r) * np.ones(3)
    (tmp_path / "in.png").write_bytes(shot(image, .6))
    answer = find(tmp_path, tmp_path / "in.png")
    if not isinstance(answer, str):
        lies_at(answer, (x, y, r))


def test_a_fisheye_circle_in_its_barrel(tmp_path):
    """Overexposed, the inside of the lens shows as a second, fainter circle: the sharp one is meant, or none."""
    x, y, r = 300, 205, 150
    image = U.disc(room(3), 600, 400, x, y, r, lambda q: q * np.pi / 2, samples=2, outside=0)
    d = distance(600, 400, x, y)
    image = image + .02 * step(d, 1.3 * r) * (1 - step(d, r)) + 2e-4
    (tmp_path / "in.jpg").write_bytes(shot(.6 * image, .8, quality=90))
    answer = find(tmp_path, tmp_path / "in.jpg", ("--lens", "equidistant", "--fov", "180"))
    if not isinstance(answer, str):
        lies_at(answer, (x, y, r))


def test_two_copies_of_one_search_agree(tmp_path):
    """No chance in it: the same file twice is the same circle, to the last digit."""
    (tmp_path / "in.png").write_bytes(shot(with_ball(wall(400, 300, 8), 180, 150, 70, 6), .7))
    first, second = find(tmp_path, tmp_path / "in.png", BALL), find(tmp_path, tmp_path / "in.png", BALL)
    assert not isinstance(first, str) and (first[0] == second[0]).all()
