"""hdrgen --flare: light that a lens scattered by a known point spread function is taken out and put back; what is there stays.

The scenes are the bench's (bench/hdrgen/flare.py): the lens is a convolution by FFT, which shares nothing with the program's mixture of
Gaussians but what is being looked for.
"""
import numpy as np
import pytest

from hdrgen_util import hdrgen, radiance, read_exr
from flare import compare, lit, psf, shoot, through, wide


def both(folder, seen, camera, *args, seed=1):
    """The merge with and without --flare, and what was said."""
    names, how = shoot(folder, seen, camera, seed=seed)
    hdrgen(folder, names, *how, *args, out="without.exr")
    said = hdrgen(folder, names, *how, *args, "--flare", out="with.exr").err
    return radiance(folder / "with.exr"), radiance(folder / "without.exr"), said


@pytest.mark.parametrize("name,kind,part,camera,seed", [
    ("waves", "exp30", .001, "gamma", 1), ("waves", "pow2", .01, "recovered", 2), ("room", "exp100", .05, "linear", 1),
    *(pytest.param(*p, marks=pytest.mark.sweep) for p in (("room", "pow3", .05, "gamma", 2), ("room", "both", .01, "gamma", 1))),
    ("night", "pow2", .01, "gamma", 1)])
def test_a_known_spread_is_taken_out_and_put_back(tmp_path, name, kind, part, camera, seed):
    scene, spots, circle = lit(name, seed=seed)
    seen = through(scene, psf(kind, *spots.shape, part))
    got, without, said = both(tmp_path, seen, camera, seed=seed)
    left, _, before, after = compare(got, without, scene, seen, spots, circle)
    assert "the lens scattered" in said
    assert left < .2
    assert abs(after - 1) < .01 and abs(after - 1) <= abs(before - 1)
    assert got.min() >= 0


def test_a_core_is_no_flare(tmp_path):
    """A blur of a pixel stays: it is sharpness, not veil, and the skirt is found all the same."""
    scene, spots, circle = lit("room", seed=3)
    seen = through(scene, psf("exp30", *spots.shape, .01, core=1.2))
    got, without, _ = both(tmp_path, seen, "gamma")
    around, scale = ~wide(spots, 12), np.median(without / seen)
    plain = through(scene, psf("exp30", *spots.shape, 0, core=1.2))
    assert np.abs(got / scale - plain)[around].sum() < .2 * np.abs(without / scale - plain)[around].sum()
    assert abs((got / scale)[wide(spots, 4)].sum() / scene[wide(spots, 4)].sum() - 1) < .01


@pytest.mark.parametrize("name,lamps,glow", [
    ("waves", 4, 0), ("grey", 4, 0), ("room", 0, 0), ("grey", 1, 1), ("room", 4, 2),
    *(pytest.param(*p, marks=pytest.mark.sweep) for p in (("murk", 4, 0), ("room", 4, 0), ("room", 1, 1)))])
def test_without_flare_nothing_changes(tmp_path, name, lamps, glow):
    """A wall that a lamp lights, too, is light that is there."""
    scene, *_ = lit(name, lamps=lamps, glow=glow)
    got, without, said = both(tmp_path, scene, "gamma")
    assert np.array_equal(got, without)
    assert "flare: " in said and "the lens scattered" not in said and "at most" in said


def test_a_lit_wall_stays_while_flare_goes(tmp_path):
    scene, spots, circle = lit("room", seed=1, glow=1)
    bare, *_ = lit("room", seed=1)
    seen = through(scene, psf("exp30", *spots.shape, .01))
    got, without, said = both(tmp_path, seen, "gamma")
    left, *_ = compare(got, without, scene, seen, spots, circle)
    wall = (scene / bare)[..., 1] > 3
    wall &= ~wide(spots, 6)
    scale = np.median((without / seen)[~spots])
    assert wall.sum() > 500 and "the lens scattered" in said
    assert left < .2
    assert abs((got / scale)[wall].sum() / scene[wall].sum() - 1) < .1


def test_an_even_veil_is_known_outside_the_circle(tmp_path):
    scene, spots, circle = lit("fisheye")
    seen = through(scene, psf("even", *spots.shape, .01))
    got, without, said = both(tmp_path, seen, "gamma", "--circle", "0.98")
    left, *_ = compare(got, without, scene, seen, spots, circle)
    assert "outside the circle" in said and left < .2
    blind, without, said = both(tmp_path, seen, "gamma")        # nobody knows that it is dark there
    assert np.array_equal(blind, without)


def test_lamps_may_be_coloured_and_channels_scatter_by_themselves(tmp_path):
    scene, spots, circle = lit("room", seed=2)
    seen = np.concatenate([through(scene[..., c:c + 1], psf("exp30", *spots.shape, p)) for c, p in enumerate((.02, .01, .005))], -1)
    names, how = shoot(tmp_path, seen, "gamma")
    hdrgen(tmp_path, names, *how, "--flare")
    header = read_exr(tmp_path / "out.exr")[1]
    assert np.allclose(np.array(header["hdrgen:flare"]), (.02, .01, .005), rtol=.1)
    assert (np.array(header["hdrgen:flareMost"]) >= np.array(header["hdrgen:flare"])).all()


def test_header_sigma_and_threads(tmp_path):
    scene, spots, _ = lit("room", seed=2)
    names, how = shoot(tmp_path, through(scene, psf("exp30", *spots.shape, .02)), "gamma")
    hdrgen(tmp_path, names, *how, "--sigma", out="without.exr")
    for threads in (1, 3):
        hdrgen(tmp_path, names, *how, "--flare", "--sigma", "--threads", threads, out=f"{threads}.exr")
    one, header = read_exr(tmp_path / "1.exr")
    three, _ = read_exr(tmp_path / "3.exr")
    assert all(np.array_equal(one[c], three[c]) for c in one)
    without, bare = read_exr(tmp_path / "without.exr")
    assert (one["sigma.G"] >= without["sigma.G"]).all()
    widths, parts = np.array(header["hdrgen:flareWidths"]), np.array(header["hdrgen:flareParts"]).reshape(3, -1)
    assert parts.shape[1] == len(widths) and (parts >= 0).all() and (np.diff(widths) > 0).all()
    assert abs(header["hdrgen:flare"][1] - .02) < .002 and header["hdrgen:flareError"][1] < .2
    assert not [k for k in bare if "flare" in k]


def test_the_unit_does_not_matter(tmp_path):
    """A scene that is a thousand times brighter, with times a thousand times shorter, comes out the same."""
    scene, spots, _ = lit("room", seed=2)
    seen = through(scene, psf("exp30", *spots.shape, .02))
    out = []
    for k in (1, 1024):
        names, how = shoot(tmp_path / str(k), seen * k, "gamma")
        hdrgen(tmp_path / str(k), names, *how, "--flare")
        out.append(radiance(tmp_path / str(k) / "out.exr") / k)
    assert np.allclose(out[0], out[1], rtol=2e-3, atol=1e-4 * np.median(out[0]))


def test_small_pictures_and_black_ones(tmp_path):
    for h, w in ((3, 5), (8, 8), (40, 9)):
        folder = tmp_path / f"{h}x{w}"
        scene = np.full((h, w, 3), .1)
        scene[h // 2, w // 2] = 50
        got, without, said = both(folder, scene, "gamma")
        assert np.array_equal(got, without) and "none found" in said
