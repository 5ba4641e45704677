"""ilfmat/examples/pathtrace.c, a host of libilf's that knows no Radiance, against rtrace in the same scene."""
import numpy as np
import OpenEXR

from conftest import BUILD, environment
from process import execute
from ilf_util import ILF, f32, unit, write_ilf
from rad_util import Polygon, Sphere, material, oconv, rtrace
from render_scene import LUMINANCE, small_room, smooth_room

PATHTRACE = BUILD / "examples" / "pathtrace"
EYE, LOOK_AT, WIDTH_AT_1, SIZE = np.array([0, -2.2, 1.1]), np.array([0, 0, .12]), .45, (48, 36)
SCENE = """
void plastic grey 0 0 5 .5 .5 .5 0 0
void plastic red 0 0 5 .7 .3 .2 0 0
void plastic blue 0 0 5 .3 .5 .7 0 0
void metal white 0 0 5 1 1 1 1 0
""" + Polygon((-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)).rad("grey", "floor") \
    + Sphere((-.3, .2, .15), .15).rad("red", "left") + Sphere((.05, .35, .1), .1).rad("blue", "behind") \
    + Sphere((.1, -.05, .17), .17).rad("white", "mirror") \
    + material("env", "room.ilf.exr") + Sphere((0, 0, .5), 3.5).rad("env", "dome")


def pathtrace(folder, out, *options):
    assert PATHTRACE.is_file(), "the example is not built: run make examples"
    p = execute([str(PATHTRACE), "room.ilf.exr", out, *map(str, options)], cwd=folder, env=environment(), capture_output=True, text=True)
    assert p.returncode == 0 and not p.stdout + p.stderr, p.stderr
    return np.asarray(OpenEXR.File(str(folder / out)).channels()["RGB"].pixels, float)


def pixel_rays():
    look = unit(LOOK_AT - EYE)
    right = unit(np.cross(look, [0, 0, 1]))
    down = np.cross(look, right)
    w, h = SIZE
    a, b = np.meshgrid((np.arange(w) + .5 - .5 * w) * WIDTH_AT_1 / w, (np.arange(h) + .5 - .5 * h) * WIDTH_AT_1 / w)
    d = unit(look + a[..., None] * right + b[..., None] * down).reshape(-1, 3)
    return f32(np.broadcast_to(EYE, d.shape)), f32(d)


def test_example_agrees_with_rtrace(tmp_path):
    """The picture's mean, and the means of 6 x 6 pixels, within 3 standard errors: of all, and of all but as many as chance has."""
    write_ilf(tmp_path / "room.ilf.exr", small_room().light_field(8, 8, 48, 24))
    ours = np.array([pathtrace(tmp_path, f"{seed}.exr", 32, seed) for seed in (1, 2)]) @ LUMINANCE
    assert (ours[0] != ours[1]).any(), "the seed is not used"
    octree = oconv(tmp_path, SCENE, "scene")
    o, d = pixel_rays()
    copies = 4
    theirs = rtrace(tmp_path, octree, np.tile(o, (copies, 1)), np.tile(d, (copies, 1)), "-u-", "-ab", "2", "-aa", "0", "-ad", "32", "-as", "0",
                    "-lw", "1e-6", "-di", "16", literal=False).reshape(copies, SIZE[1], SIZE[0], 3) @ LUMINANCE

    def blocks(a):
        return a.reshape(*a.shape[:-2], SIZE[1] // 6, 6, SIZE[0] // 6, 6).sum((-3, -1))
    # two pictures tell the variance of their pixels' mean, in a block 36 times over
    mine, var = ours.mean(0), (ours[0] - ours[1]) ** 2 / 4
    other, other_var = theirs.mean(0), theirs.var(0, ddof=1) / copies
    # where the light field itself is seen nothing varies, and a thing's edge may fall to either side of a pixel's centre
    z = blocks(mine - other) / np.sqrt(blocks(var + other_var) + (1e-3 * blocks(other)) ** 2)
    total = (mine - other).sum() / np.sqrt((var + other_var).sum())
    error = np.sqrt((var + other_var).sum()) / other.sum()
    words = f"mean ratio {mine.mean() / other.mean():.5f} +- {error:.5f}, blocks: rms z {np.sqrt((z ** 2).mean()):.2f}, worst {np.abs(z).max():.2f}"
    print(words)
    assert error < 5e-3, "not much of a comparison"
    assert abs(total) < 3, words
    assert (np.abs(z) > 3).sum() <= 1 and np.abs(z).max() < 5 and (z ** 2).mean() < 1.6, words


def test_example_is_a_picture_like_any(tmp_path):
    """The same for the same seed, and nothing in it that is no light."""
    write_ilf(tmp_path / "room.ilf.exr", smooth_room().light_field(2, 1, 12, 6))      # no lamps: each is looked for at every point
    a, b = (pathtrace(tmp_path, f"{n}.exr", 1, 5) for n in (1, 2))
    assert (a == b).all() and np.isfinite(a).all() and (a >= 0).all()


def test_example_says_what_is_wrong(tmp_path):
    assert PATHTRACE.is_file(), "the example is not built: run make examples"
    r = execute([str(PATHTRACE), "none.exr", "out.exr"], cwd=tmp_path, capture_output=True, text=True)
    assert r.returncode == 1 and r.stderr.startswith("pathtrace: none.exr") and r.stderr.count("\n") == 1
    assert execute([str(PATHTRACE)], capture_output=True).returncode == 2
    write_ilf(tmp_path / "room.ilf.exr", ILF(np.zeros((1, 1, 2, 4, 3))))
    r = execute([str(PATHTRACE), "room.ilf.exr", "no/such/folder.exr", "1"], cwd=tmp_path, capture_output=True, text=True)
    assert r.returncode == 1 and "no/such/folder.exr" in r.stderr
