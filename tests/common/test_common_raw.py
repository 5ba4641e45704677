"""Camera raw as other programs read it: one picture developed by itself (common/image/image_raw.c)."""
import numpy as np
import pytest

from common_util import IMGTOOL, load, run
from dng_util import BAYER, XTRANS, camera_values, mosaic_of, write_raw

NEUTRAL = np.array([0.45, 1.0, 0.62])


def sensor(rgb, pattern, white=16383, black=512):
    v = camera_values(rgb) * NEUTRAL
    z = np.round(black + (mosaic_of(v, pattern) if pattern is not None else v) * (white - black))
    return np.clip(z, 0, white)


def flat(colour, shape=(48, 64)):
    return np.broadcast_to(np.asarray(colour, float), (*shape, 3))


def said(path, tmp_path):
    p = run(IMGTOOL, "dump", path, tmp_path / "p.f32")
    assert p.returncode == 0, p.stderr
    return p.stderr.decode()


@pytest.mark.parametrize("kind", ["RGGB", "GBRG", "X-Trans", "linear"])
@pytest.mark.parametrize("colour", [(0.5, 0.5, 0.5), (0.012, 0.6, 0.03), (0.012, 0.036, 0.6), (1.6, 0.4, 0.2), (0.8, 0.016, 0.008)])
def test_light_that_the_sensor_held_is_what_it_was(tmp_path, kind, colour):
    """Lamps of one colour, of more than 1 in red (its multiplier is the largest): neither clipped nor bent."""
    pattern = {"X-Trans": XTRANS, "linear": None}.get(kind) or BAYER.get(kind)
    shape = (516, 516) if kind == "X-Trans" else (48, 64)  # LibRaw wants a tile full
    write_raw(tmp_path / "a.dng", sensor(flat(colour, shape), pattern), pattern, black=512, neutral=NEUTRAL)
    got = load(tmp_path / "a.dng", tmp_path)[8:-8, 8:-8]
    assert np.abs(got.mean((0, 1)) - colour).max() < 0.003 * max(colour), got.mean((0, 1))
    words = said(tmp_path / "a.dng", tmp_path)
    assert "white balance as this picture was shot" in words and "clipped" not in words


def test_colours_beyond_the_primaries_stay_what_they_are(tmp_path):
    colour = np.array([-0.1, 0.6, -0.02])
    assert camera_values(colour).min() > 0
    write_raw(tmp_path / "a.dng", sensor(flat(colour), BAYER["RGGB"]), BAYER["RGGB"], black=512, neutral=NEUTRAL)
    got = load(tmp_path / "a.dng", tmp_path)[8:-8, 8:-8].mean((0, 1))
    assert np.abs(got - colour).max() < 0.003


def test_clipped_pixels_are_white_and_said(tmp_path):
    rgb = np.array(flat((0.5, 0.5, 0.5)))
    rgb[:, 32:] = 20
    write_raw(tmp_path / "a.dng", sensor(rgb, BAYER["RGGB"]), BAYER["RGGB"], black=512, neutral=NEUTRAL)
    got = load(tmp_path / "a.dng", tmp_path)
    assert np.allclose(got[8:-8, 40:-8], 1, atol=2e-3) and np.allclose(got[8:-8, 8:24], 0.5, atol=2e-3)
    words = said(tmp_path / "a.dng", tmp_path)
    assert "clipped in the sensor" in words and 48 * 28 <= int(words.split(" pixels (")[0].split()[-1]) <= 48 * 36


def test_no_balance_is_said(tmp_path):
    write_raw(tmp_path / "a.dng", sensor(flat((0.5, 0.5, 0.5)), BAYER["RGGB"]), BAYER["RGGB"], black=512, neutral=(1, 1, 1))
    assert "white balance" in said(tmp_path / "a.dng", tmp_path)
