"""A light field of a lamp beside the lamp itself, as one of Radiance's sources: where they agree, where not, and why.

The light field is made here, analytically, of a round lamp at infinity in a constant sky.
"""
import numpy as np
import pytest

from ilf_util import PI, ILF, f32, unit, write_ilf
from rad_util import numbers, oconv, rtrace

L = unit(np.array([0.5, 0.2, 0.9]))         # towards the lamp
LAMP, SKY = 1000.0, 1.0
EXACT = ["-us", "1", "-aa", "0", "-as", "0", "-lw", "1e-9", "-st", "0"]
SHARP = ["-ds", ".05", "-dj", ".9", "-dt", "0", "-dc", "1"]       # as we sample: all of the lamp's disc
PANEL = "\nm polygon panel\n0\n0\n12 -1 -1 1 1 -1 1 1 1 1 -1 1 1\n"
FLOOR = "\nvoid plastic grey\n0\n0\n5 .5 .5 .5 0 0\ngrey polygon floor\n0\n0\n12 -4 -4 0 4 -4 0 4 4 0 -4 4 0\n"


def probe(n_theta, diameter, fine=12):
    """Texels are means over their area: fine x fine points each."""
    n_phi = n_theta // 4
    t = -PI + (np.arange(n_theta * fine) + 0.5) * 2 * PI / (n_theta * fine)
    p = (np.arange(n_phi * fine) + 0.5) * PI / 2 / (n_phi * fine)
    inside = (np.sin(p)[:, None] * (np.cos(t) * L[0] + np.sin(t) * L[1]) + np.cos(p)[:, None] * L[2]) > np.cos(np.deg2rad(diameter / 2))
    share = inside.reshape(n_phi, fine, n_theta, fine).mean((1, 3))
    return ILF(f32(SKY + (LAMP - SKY) * share)[None, None, :, :, None] * np.ones(3), origin=(-.5, -.5, 0))


def lights(folder, n_theta, diameter):
    """Text of the light field's sky, of the lamp as a source, and of the lamp as a surface that rays must find."""
    f = probe(n_theta, diameter)
    write_ilf(folder / f"lamp{n_theta}.ilf.exr", f)
    disc = f"lamp source disc\n0\n0\n4 {numbers(L)} {diameter}\n"
    sky = f"void glow sky\n0\n0\n4 {SKY} {SKY} {SKY} 0\nsky source sky\n0\n0\n4 0 0 1 180\n"
    return f, {"ilf": f"void ilf env\n1 lamp{n_theta}.ilf.exr\n0\n0\nenv source sky\n0\n0\n4 0 0 1 360\n",
               "lamp": f"void light lamp\n0\n0\n3 {LAMP} {LAMP} {LAMP}\n" + disc + sky,
               "glow": f"void glow lamp\n0\n0\n4 {LAMP} {LAMP} {LAMP} 0\n" + disc + sky}


@pytest.fixture(scope="module")
def six_degrees(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lamps")
    return folder, lights(folder, 512, 6)[1]


def seen(folder, octree, d, n, *options):
    """Mean along a ray through the panel's middle, and its standard error."""
    d = unit(np.array(d, float))
    got = rtrace(folder, octree, f32(np.tile((0, 0, 1) - 0.3 * d, (n, 1))), f32(np.tile(d, (n, 1))), *EXACT, *options, literal=False)[:, 1]
    return got.mean(), got.std(ddof=1) / np.sqrt(n)


MATERIALS = {"rough trans": "trans m\n0\n0\n7 .8 .8 .8 .05 .1 .6 .4", "milk glass": "trans m\n0\n0\n7 .8 .8 .8 0 0 .6 0",
             "clear trans": "trans m\n0\n0\n7 .8 .8 .8 .03 0 .6 .4", "plastic": "plastic m\n0\n0\n5 .5 .5 .5 .03 .1"}


# plastic is opaque: black from below
@pytest.mark.parametrize("name, side", [(name, side) for side in ("below", "above") for name in MATERIALS if (name, side) != ("plastic", "below")])
def test_off_its_highlights_a_panel_is_as_bright_as_under_the_lamp(six_degrees, name, side):
    """Diffuse reflection and transmission, both methods: within 1 % (Radiance's Fresnel term for lamps is 0.4 %)."""
    folder, light = six_degrees
    d = (-.6, -.3, .8) if side == "below" else (-.5, .3, -.9)
    key = name.replace(" ", "_")
    scene = {k: oconv(folder, "void " + MATERIALS[name] + PANEL + light[k], f"{key}_{k}") for k in ("ilf", "lamp")}
    truth, e0 = seen(folder, scene["lamp"], d, 32, "-ab", "1", "-ad", "1024", *SHARP)
    for options, n in ((["-di", "16", "-ad", "256"], 128), (["-di", "0", "-ad", "16384"], 24)):
        got, e1 = seen(folder, scene["ilf"], d, n, "-ab", "1", *options)
        assert abs(got - truth) < 0.01 * truth + 5 * np.hypot(e0, e1), (options, got, truth, e0, e1)
        assert e1 < 0.02 * truth


def test_a_light_field_is_one_bounce_behind_a_lamp(six_degrees):
    """Its light comes as an ambient bounce, a lamp's does not: over a floor, -ab N here lies between -ab N-1 and -ab N there."""
    folder, light = six_degrees
    scene = {k: oconv(folder, "void " + MATERIALS["rough trans"] + PANEL + FLOOR + light[k], f"over_floor_{k}") for k in ("ilf", "lamp")}
    d = (-.3, -.4, .8)
    lamp = [seen(folder, scene["lamp"], d, 24, "-ab", n, "-ad", 64, *SHARP) for n in (0, 1, 2)]
    for n in (1, 2):
        for options in (["-di", "16", "-ad", "64"], *([["-di", "0", "-ad", "16384"]] if n == 1 else [])):
            got, error = seen(folder, scene["ilf"], d, 96 if "16" in options else 12, "-ab", n, *options)
            assert got > lamp[n - 1][0] - 5 * np.hypot(error, lamp[n - 1][1])
            assert got < lamp[n][0] - 5 * np.hypot(error, lamp[n][1]) if n == 1 else got < lamp[n][0] + 5 * np.hypot(error, lamp[n][1])


def test_rough_transmission_is_that_of_radiances_surfaces(six_degrees):
    """In the highlight Radiance's lamps go by another formula than its surfaces: here it is the surfaces'."""
    folder, light = six_degrees
    scene = {k: oconv(folder, "void trans m\n0\n0\n7 .8 .8 .8 .05 .15 .6 .4" + PANEL + light[k], f"lobe_{k}") for k in ("ilf", "lamp", "glow")}
    across = unit(np.cross(L, (0, 0, 1)))
    for off in (0, .1, .2):
        d = L + np.tan(off) * across
        # 2 %: a texel's blur of a lobe of 8.6 degrees
        glow, e0 = seen(folder, scene["glow"], d, 60, "-ab", "0", "-ss", "2000")
        got, e1 = seen(folder, scene["ilf"], d, 60, "-ab", "0", "-di", "0", "-ss", "2000")
        assert abs(got - glow) < 5 * np.hypot(e0, e1) + 0.02 * glow, (off, got, glow)
        aimed, e2 = seen(folder, scene["ilf"], d, 60, "-ab", "1", "-di", "64", "-ad", "64")
        blind, e3 = seen(folder, scene["ilf"], d, 60, "-ab", "1", "-di", "0", "-ss", "2000", "-ad", "4096")
        assert abs(aimed - blind) < 5 * np.hypot(e2, e3), (off, aimed, blind)
    lamp, e0 = seen(folder, scene["lamp"], L, 60, "-ab", "0", *SHARP)
    got, e1 = seen(folder, scene["ilf"], L, 60, "-ab", "0", "-di", "0", "-ss", "2000")
    assert got > 1.15 * lamp, "Radiance's formulas agree now: the man page says that they don't"


@pytest.mark.parametrize("texels_wide", [1.5, 3.5, 8])
def test_mirror_image_in_glass_is_blurred_by_a_texel_and_loses_nothing(tmp_path, texels_wide):
    """Into the lamp's image the lookup is too dark by just what it should be after the oracle; over image and surroundings it is right."""
    n_theta = 128
    diameter = texels_wide * 360 / n_theta
    f, light = lights(tmp_path, n_theta, diameter)
    pane = "void glass m\n0\n0\n3 .9 .9 .9\nm polygon p\n0\n0\n12 -9 -9 1 9 -9 1 9 9 1 -9 9 1\n"
    scene = {k: oconv(tmp_path, pane + light[k], k) for k in ("ilf", "lamp")}
    rng = np.random.default_rng(80)
    across = unit(np.cross(L, (0, 0, 1)))
    ratio = []
    for half in (0.98 * diameter / 2, diameter / 2 + 4 * 360 / n_theta):
        n = 30000
        c, a = 1 - rng.random(n) * (1 - np.cos(np.deg2rad(half))), rng.random(n) * 2 * PI
        s = np.sqrt(1 - c * c)
        up = c[:, None] * L + s[:, None] * (np.cos(a)[:, None] * across + np.sin(a)[:, None] * np.cross(L, across))
        o, d = f32(np.tile((0, 0, 2), (n, 1))), f32(up * (1, 1, -1))
        got, truth = (rtrace(tmp_path, scene[k], o, d)[:, 1] for k in ("ilf", "lamp"))
        if not ratio:
            expected = f.eval(o * 0 + (0, 0, 1), up)[:, 1].sum() / (LAMP * n)
            assert abs(got.sum() / truth.sum() - expected) < 2e-3
            low, high = {1.5: (.3, .6), 3.5: (.75, .85), 8: (.88, .95)}[texels_wide]
            assert low < expected < high
        else:
            share = (1 - np.cos(np.deg2rad(diameter / 2))) / (1 - np.cos(np.deg2rad(half)))
            error = np.sqrt((1 - share) / (share * n))          # of the rays that meet the lamp
            assert abs(got.sum() / truth.sum() - 1) < 5 * error + 0.01
        ratio.append(got.sum() / truth.sum())


def test_light_below_the_probes_horizon_is_aimed_at(tmp_path):
    """One full-sphere probe in the middle of a room, a bright patch of wall below its plane: a point on the floor sees it above itself, with
    depth correction.  Rays are aimed there as anywhere (blind ones would find it one time in a thousand)."""
    side, n = 4.0, 200
    theta, phi = -PI + (np.arange(512) + .5) * 2 * PI / 512, (np.arange(256) + .5) * PI / 256
    d = np.stack([np.sin(phi)[:, None] * np.cos(theta), np.sin(phi)[:, None] * np.sin(theta), np.cos(phi)[:, None] * np.ones(512)], -1)
    on = 2 + d * (2 / np.maximum(d[..., :1], 1e-9))       # where it meets the plane of the wall
    lit = (d[..., 0] > 0) & (np.abs(on[..., 1] - 2) < .25) & (np.abs(on[..., 2] - 1) < .25)
    write_ilf(tmp_path / "room.ilf.exr", ILF(f32(100. * lit)[None, None, :, :, None] * np.ones(3), (1.5, 1.5, 2), polar_max=PI))
    walls = "".join(f"env polygon p{k}\n0\n0\n12 {' '.join(f'{side * c:g}' for c in corners)}\n" for k, corners in enumerate(
        [(0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0), (0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1, 1), (0, 0, 0, 1, 0, 0, 1, 0, 1, 0, 0, 1),
         (0, 1, 0, 1, 1, 0, 1, 1, 1, 0, 1, 1), (0, 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1), (1, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1)]))
    octree = oconv(tmp_path, "void ilf env\n1 room.ilf.exr\n0\n0\n" + walls)
    y, z = np.meshgrid(*2 * [(np.arange(200) + .5) / 400 - .25], indexing="ij")
    for p in ((2, 2, .02), (.5, 1, .02), (3, 3, .3)):
        r = np.stack([np.full(y.shape, 4.), y + 2, z + 1], -1) - p
        far = np.sqrt((r ** 2).sum(-1))
        true = 100 * (r[..., 2] * r[..., 0] / far ** 4).mean() * .25
        got = rtrace(tmp_path, octree, f32(np.tile(p, (n, 1))), f32(np.tile((0, 0, 1), (n, 1))), *EXACT, "-I", "-ab", "0", "-di", "16",
                     literal=False)[:, 1]
        assert abs(got.mean() / true - 1) < .04, (p, got.mean(), true)      # texels at the patch's edge are .7 degrees wide
        assert got.std(ddof=1) / true < .3, (p, got.std(ddof=1), true)
