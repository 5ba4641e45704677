"""hdrgen --align: shots moved by hand come out as if they had stood still; what stood still is left alone.

The scene is a function of the place, sampled at the moved pixels (3 x 3 points each): no picture is interpolated to make another.
"""
from functools import lru_cache

import numpy as np
import pytest

from hdrgen_util import expose, f_gamma, f_linear, hdrgen, radiance, read_exr, write_png, write_times

W, H = 320, 240
TIMES = 4.0 ** np.arange(-5, 2)
LAMPS = [(80.3, 60.7, 4.2, 300), (240.6, 180.2, 3.1, 800), (150.1, 200.8, 2.6, 500)]   # x, y, radius, radiance


def light(turn, middle, dx, dy, seed=4):
    """Radiance at the places middle + turn @ (dx, dy), in pixels, of a grid of columns and rows: three decades of waves, boxes with
    hard edges, lamps; tinted."""
    rng = np.random.default_rng(seed)
    waves = []
    for _ in range(30):
        a = rng.normal(size=2) * 2 * np.pi * rng.uniform(.5, 8) / W
        waves.append((*(a @ turn), a @ middle + rng.uniform(0, 6.28)))
    a, b, c = (np.array(k)[:, None] for k in zip(*waves))
    v = (np.exp(1j * (b * dy + c)).T @ np.exp(1j * a * dx)).real / 4       # a sum of cosines

    def around(px, py, s):
        """The part of the grid that holds all places less than s from there along x and y, and how far its places are."""
        at = turn.T @ (np.array([px, py]) - middle)
        j, i = (slice(*np.searchsorted(d, (at[k] - 1.5 * s, at[k] + 1.5 * s))) for d, k in ((dy, 1), (dx, 0)))
        return (j, i), *(turn[k, 0] * (dx[i] - at[0]) + turn[k, 1] * (dy[j, None] - at[1]) for k in (0, 1))
    for _ in range(25):
        bx, by, s = rng.uniform(-40, W + 40), rng.uniform(-40, H + 40), rng.uniform(5, 30)
        part, x, y = around(bx, by, s)
        v[part] += rng.uniform(-1, 1) * ((abs(x) < s) & (abs(y) < s))
    grey = 10 ** (-1.2 + 0.6 * v)
    for lx, ly, r, value in LAMPS:
        part, x, y = around(lx, ly, r)
        grey[part] = np.where(x ** 2 + y ** 2 < r * r, value, grey[part])
    return grey[..., None] * np.array([1.1, 1, .8])


def seen(m):
    return _seen(tuple(float(v) for v in m))


@lru_cache(maxsize=64)
def _seen(m):
    """What a camera sees that has moved by m = (degrees about the picture's middle, dx, dy)."""
    a, middle = np.radians(m[0]), np.array([W / 2, H / 2])
    turn, total = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]), 0
    for sy in (np.arange(3) + .5) / 3:
        for sx in (np.arange(3) + .5) / 3:
            total = total + light(turn, middle + m[1:], np.arange(W) + sx - middle[0], np.arange(H) + sy - middle[1])
    return total / 9


def motions(reach, turn, seed=1):
    rng = np.random.default_rng(seed)
    m = np.stack([rng.uniform(-turn, turn, len(TIMES)), rng.uniform(-reach, reach, len(TIMES)),
                  rng.uniform(-reach, reach, len(TIMES))], -1)
    m[len(TIMES) // 2] = 0
    return m


def shoot(folder, moved, f=f_gamma, max_code=255, noise=True):
    rng = np.random.default_rng(8)
    names = [f"s{k}.png" for k in range(len(TIMES))]
    for k, t in enumerate(TIMES):
        write_png(folder / names[k], expose(seen(moved[k]), t, f, max_code, rng=rng, noise=noise))
    write_times(folder, names, TIMES)
    return names


def errors(got, truth, border=24):
    g, t = got[border:-border, border:-border], truth[border:-border, border:-border]
    d = np.log2(np.maximum(g, 1e-9) / t)
    d -= np.median(d)
    return np.sqrt((d ** 2).mean())


def lamp_light(got, truth):
    """Energy of the lamps and their surroundings, with the dim part's scale."""
    scale = np.median(got / truth)
    y, x = np.mgrid[0:H, 0:W] + .5
    near = np.any([(x - lx) ** 2 + (y - ly) ** 2 < (r + 5) ** 2 for lx, ly, r, _ in LAMPS], axis=0)
    return got[near].sum() / truth[near].sum() / scale


@pytest.mark.parametrize("camera", ["gamma", "linear16"])
def test_moved_by_hand_comes_out_as_if_still(tmp_path, camera):
    f, top = (f_gamma, 255) if camera == "gamma" else (f_linear, 65535)
    how = ["-r", "gamma:2.2" if camera == "gamma" else "linear"]
    truth = seen((0, 0, 0))
    names = shoot(tmp_path, motions(9, .3), f, top)
    hdrgen(tmp_path, names, *how, out="never.exr")
    hdrgen(tmp_path, names, *how, "--align", out="moved.exr")
    (tmp_path / "still").mkdir()
    shoot(tmp_path / "still", motions(0, 0), f, top)
    hdrgen(tmp_path / "still", names, *how)
    still, moved, never = (radiance(p) for p in (tmp_path / "still" / "out.exr", tmp_path / "moved.exr", tmp_path / "never.exr"))
    assert errors(never, truth) > 3 * errors(moved, truth)
    # interpolation at hard edges (measured: .09 stop) comes on top of the still series' noise (.026)
    assert errors(moved, truth) < errors(still, truth) + .12
    assert abs(lamp_light(moved, truth) - 1) < .02
    assert abs(lamp_light(never, truth) - 1) > .05


def test_a_recovered_response_is_that_of_the_still_series(tmp_path):
    truth = seen((0, 0, 0))
    names = shoot(tmp_path, motions(6, .2, seed=3))
    hdrgen(tmp_path, names, "--align", out="moved.exr")
    moved = radiance(tmp_path / "moved.exr")
    assert errors(moved, truth) < .35
    assert abs(lamp_light(moved, truth) - 1) < .05


def said_motions(err):
    """degrees, pixels by name, from the lines on stderr."""
    out = {}
    for line in err.splitlines():
        words = line.split()
        if "degrees;" in words:
            out[words[1].rstrip(":")] = (float(words[words.index("degrees;") - 1]), float(words[words.index("pixels,") - 1]))
    return out


def test_the_motions_that_are_said_are_the_true_ones(tmp_path):
    moved = motions(12, .4, seed=5)
    names = shoot(tmp_path, moved)
    found = said_motions(hdrgen(tmp_path, names, "-r", "gamma:2.2", "--align").err)
    assert len(found) == len(TIMES) - 1
    for name, m in zip(names, moved):
        if name not in found:
            continue
        # a camera that turns one way sees its scene turn the other way: the found motion is the inverse
        a = -np.radians(m[0])
        back = -np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) @ m[1:]
        corners = np.array([[x - W / 2, y - H / 2] for x in (0, W) for y in (0, H)])
        turn = np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
        reach = max(np.linalg.norm(turn @ c + back - c) for c in corners)
        assert abs(found[name][0] + m[0]) < .08
        assert abs(found[name][1] - reach) < .35


def test_a_still_series_is_left_alone(tmp_path):
    names = shoot(tmp_path, motions(0, 0))
    hdrgen(tmp_path, names, out="never.exr")
    for mode in ("auto", "always"):
        hdrgen(tmp_path, names, f"--align={mode}", out=f"{mode}.exr")
        assert np.array_equal(radiance(tmp_path / "never.exr"), radiance(tmp_path / f"{mode}.exr")), mode


def test_what_lies_outside_a_moved_shot_is_missing_not_black(tmp_path):
    moved = motions(0, 0)
    moved[0] = (0, 30, 0)       # the shortest shot looks to the right: the left 30 columns are not in it
    names = shoot(tmp_path, moved)
    hdrgen(tmp_path, names, "-r", "gamma:2.2", "--align", "--count")
    count = read_exr(tmp_path / "out.exr")[0]["exposures"]
    got, truth = radiance(tmp_path / "out.exr"), seen((0, 0, 0))
    d = np.log2(got[8:-8, 2:28] / truth[8:-8, 2:28])
    assert np.sqrt(np.mean((d - np.median(d)) ** 2)) < .3
    assert count[8:-8, 2:26].max() <= len(TIMES) - 1


def test_what_is_missing_in_either_shot_steers_no_registration(tmp_path):
    """Borders of a fill colour, others in each shot and lying still, around a scene that moved."""
    moved, rng = motions(9, .3, seed=7), np.random.default_rng(3)
    names = shoot(tmp_path, moved, noise=True)
    for k, (n, t) in enumerate(zip(names, TIMES)):
        codes = expose(seen(moved[k]), t, f_gamma, 255, rng=rng)
        left, top, right, low = rng.integers(6, 30, 4)
        inner = np.zeros(codes.shape[:2], bool)
        inner[top:-low, left:-right] = True
        codes[~inner] = (0, 0, 255)
        write_png(tmp_path / n, codes)
    r = hdrgen(tmp_path, names, "-r", "gamma:2.2", "--align", "--fill", "0,0,255")
    found, middle = said_motions(r.err), names[len(TIMES) // 2]
    for name, m in zip(names, moved):
        if name != middle and np.hypot(*m[1:]) > 1:
            assert abs(found[name][0] + m[0]) < .1, name
    got, truth = radiance(tmp_path / "out.exr"), seen((0, 0, 0))
    assert errors(got, truth, 44) < .2


def test_one_picture_of_something_else(tmp_path):
    names = shoot(tmp_path, motions(5, .1))
    rng = np.random.default_rng(2)
    write_png(tmp_path / names[1], rng.integers(0, 256, (H, W, 3)).astype(np.uint8))
    refused = hdrgen(tmp_path, names, "-r", "gamma:2.2", "--align", out="a.exr", code=1)
    assert names[1] in refused.err and "--align=auto" in refused.err
    assert not (tmp_path / "a.exr").exists()
    said = hdrgen(tmp_path, names, "-r", "gamma:2.2", "--align=auto", out="b.exr")
    assert f"{names[1]}: can't be registered" in said.err


def test_a_mosaic_is_moved_colour_by_colour(tmp_path):
    moved, rng, names = motions(6, .2), np.random.default_rng(8), [f"m{k}.png" for k in range(len(TIMES))]
    for k, t in enumerate(TIMES):
        full = expose(seen(moved[k]), t, f_linear, 65535, rng=rng)
        mosaic = full[..., 1].copy()
        mosaic[0::2, 0::2], mosaic[1::2, 1::2] = full[0::2, 0::2, 0], full[1::2, 1::2, 2]
        write_png(tmp_path / names[k], mosaic)
    write_times(tmp_path, names, TIMES)
    hdrgen(tmp_path, names, "-r", "linear", "--bayer", "RGGB", "--align")
    truth = seen((0, 0, 0))
    got = radiance(tmp_path / "out.exr")
    smooth = np.log2(got[24:-24, 24:-24] / truth[24:-24, 24:-24])
    assert np.median(abs(smooth - np.median(smooth))) < .1
    for c in range(3):      # no colour has leaked into another
        assert abs(np.median(smooth[..., c]) - np.median(smooth)) < .03
    # half of the green and three quarters of the others are interpolated: lamps of 2.6 to 4 pixels suffer
    assert abs(lamp_light(got, truth) - 1) < .12


def test_same_for_any_number_of_threads_and_any_order(tmp_path):
    names = shoot(tmp_path, motions(5, .2))
    hdrgen(tmp_path, names, "--align", "--threads", "1", out="one.exr")
    hdrgen(tmp_path, names[::-1], "--align", "--threads", "3", out="three.exr")
    assert np.array_equal(radiance(tmp_path / "one.exr"), radiance(tmp_path / "three.exr"))


def test_usage(tmp_path):
    names = shoot(tmp_path, motions(0, 0))
    assert "expected auto, always or never" in hdrgen(tmp_path, names, "--align=yes", code=2).err
    assert "--dark" in hdrgen(tmp_path, names, "--align", "--dark", names[0], code=2).err
