"""-di N: the light field as a light source, against the oracle's integrals and against the literal method.

Repeated rays tell the standard errors.  They need independent random numbers (-us SEED: the fixed sequence of -u- comes
back after 2048 rays, and copies of a ray would share it).  Means are compared within 5 standard errors, sums of squared
deviations within 5 of their own: a right program fails a comparison for about one seed in 1e5 (Student's tails included).
"""
import re

import numpy as np
import pytest

from conftest import run, sweep
from ilf_util import PI, f32, random_directions, unit, write_ilf
from rad_util import Mesh, Polygon, Ring, Source, Sphere, Surface, material, matrix, oconv, read_picture, rtrace, scene_value
from render_scene import LUMINANCE, MIRROR_BALL, Lamp, VIEW, Room, far_dome, judged_objects, judged_room, lumpy_ball, obj_text, small_room, smooth_room

EXACT = ["-us", "1", "-ab", "1", "-aa", "0", "-as", "0", "-lw", "1e-9", "-st", "0"]
ROOM = small_room().light_field(8, 8, 48, 24)
DARK = Room([], None, lambda d: 0 * d + 0.2).light_field(2, 2, 8, 4)
WALLS = [Polygon(*(np.array(c) - (0, 0, 0.1))) for c in (
    [(-3, -3, 2.9), (-3, 3, 2.9), (3, 3, 2.9), (3, -3, 2.9)], [(-3, -3, 0), (-3, 3, 0), (-3, 3, 2.9), (-3, -3, 2.9)],
    [(3, -3, 0), (3, -3, 2.9), (3, 3, 2.9), (3, 3, 0)], [(-3, -3, 0), (-3, -3, 2.9), (3, -3, 2.9), (3, -3, 0)],
    [(-3, 3, 0), (3, 3, 0), (3, 3, 2.9), (-3, 3, 2.9)])]


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A folder with the light fields."""
    folder = tmp_path_factory.mktemp("room")
    write_ilf(folder / "room.ilf.exr", ROOM)
    write_ilf(folder / "dark.ilf.exr", DARK)
    return folder


# ---- irradiance against the oracle's integral -------------------------------------------------------------------

def integral(surfaces, x, normal, fine=(288, 144)):
    """Irradiance at x by midpoints of a grid six times as fine as the probes' texels, over the whole sphere: to 1e-3."""
    t = (np.arange(fine[0]) + 0.5) * 2 * PI / fine[0]
    p = (np.arange(fine[1]) + 0.5) * PI / fine[1]
    P, T = np.meshgrid(p, t, indexing="ij")
    d = np.stack([np.sin(P) * np.cos(T), np.sin(P) * np.sin(T), np.cos(P)], -1).reshape(-1, 3)
    w = (np.cos(P - PI / fine[1] / 2) - np.cos(P + PI / fine[1] / 2)).ravel() * 2 * PI / fine[0]
    c = d @ normal
    d, w = d[c > 0], (w * c)[c > 0]
    return (scene_value(surfaces, np.broadcast_to(x, d.shape), d) * w[:, None]).sum(0)


def points_and_normals(rng, n, spread=(0.8, 0.8), height=(0.02, 0.6)):
    x = np.stack([rng.uniform(-spread[0], spread[0], n), rng.uniform(-spread[1], spread[1], n), rng.uniform(*height, n)], -1)
    normals = random_directions(rng, n)
    normals[:, 2] = np.abs(normals[:, 2])
    normals[0] = (0, 0, 1)
    return f32(x), f32(normals)


def check_irradiance(folder, octree, surfaces, x, normals, *options, copies=64, aimed=True):
    o, n = np.repeat(x, copies, 0), np.repeat(normals, copies, 0)
    got = rtrace(folder, octree, o, n, "-I", *EXACT, *options, literal=False).reshape(len(x), copies, 3)
    for k in range(len(x)):
        truth = integral(surfaces, x[k].astype(float), unit(normals[k]))
        mean, error = got[k].mean(0), got[k].std(0, ddof=1) / np.sqrt(copies)
        # 3e-3: the grid of the integral; its own error shows at lamps' edges
        assert (np.abs(mean - truth) < 5 * error + 3e-3 * truth).all(), (k, mean, truth, error)
        if aimed:
            assert (error < 0.02 * truth + 1e-6).all(), "not much of an estimate"


def scenes():
    f = ROOM
    yield "dome, nodepth", material("env", "room.ilf.exr", depth=False) + Sphere((0, 0, 0), 12).rad("env", "dome"), \
        [Surface(Sphere((0, 0, 0), 12), f, False)]
    yield "dome, depth", material("env", "room.ilf.exr") + Sphere((0, 0, 0.5), 3.5).rad("env", "dome"), \
        [Surface(Sphere((0, 0, 0.5), 3.5), f)]
    walls = "".join(w.rad("env", f"w{k}") for k, w in enumerate(WALLS))
    yield "box, depth", material("env", "room.ilf.exr") + walls, [Surface(w, f) for w in WALLS]
    yield "box, nodepth", material("env", "room.ilf.exr", depth=False) + walls, [Surface(w, f, False) for w in WALLS]
    yield "source", material("env", "room.ilf.exr") + Source((0, 0, 1), 360).rad("env", "sky"), \
        [Surface(Source((0, 0, 1), 360), f)]
    mixed = material("env", "room.ilf.exr") + material("dim", "dark.ilf.exr") + "".join(
        w.rad("env" if k % 2 else "dim", f"w{k}") for k, w in enumerate(WALLS))
    yield "two light fields", mixed, [Surface(w, f if k % 2 else DARK) for k, w in enumerate(WALLS)]
    both = material("env", "room.ilf.exr", depth=False) + material("low", "room.ilf.exr", f.placed((-2, -1, -0.2), (2.5, 0, 0), (0, 2, 0)), 9) \
        + WALLS[0].rad("env", "ceiling") + "".join(w.rad("low", f"w{k}") for k, w in enumerate(WALLS[1:]))
    g = f.placed((-2, -1, -0.2), (2.5, 0, 0), (0, 2, 0))
    yield "one file twice", both, [Surface(WALLS[0], f, False)] + [Surface(w, g) for w in WALLS[1:]]
    h = f.placed((0.7, -0.7, 0), (-1.4, 0, 0), (0, 1.4, 0), (0, 0, 1))
    yield "left-handed", material("env", "room.ilf.exr", h, 12) + walls, [Surface(w, h) for w in WALLS]
    a, b = np.cos(0.5), np.sin(0.5)
    tilted = f.placed((-0.7, -0.6, 0.1), (1.4 * a, 0, 1.4 * b), (0, 1.3, 0))
    yield "tilted plane", material("env", "room.ilf.exr", tilted, 9) + Sphere((0, 0, 0.5), 3.5).rad("env", "dome"), \
        [Surface(Sphere((0, 0, 0.5), 3.5), tilted)]


SCENES = {name: (text, surfaces) for name, text, surfaces in scenes()}


@pytest.mark.parametrize("name", SCENES)
def test_irradiance_is_the_oracles_integral(room, name):
    text, surfaces = SCENES[name]
    rng = np.random.default_rng(40)
    octree = oconv(room, text, "irr_" + re.sub(r"\W", "_", name))
    x, normals = points_and_normals(rng, 5)
    check_irradiance(room, octree, surfaces, x, normals, "-di", "16", "-ad", "256")


@pytest.mark.parametrize("samples", [1, 3, 256])
def test_any_number_of_samples_has_the_same_mean(room, samples):
    text, surfaces = SCENES["box, depth"]
    octree = oconv(room, text, f"n{samples}")
    x, normals = points_and_normals(np.random.default_rng(41), 4)
    check_irradiance(room, octree, surfaces, x, normals, "-di", samples, "-ad", "256", copies=96, aimed=samples > 16)


def test_random_numbers_by_seed(room):
    """-us: another seed has other numbers and the same mean, the same seed the same numbers."""
    text, surfaces = SCENES["dome, nodepth"]
    octree = oconv(room, text, "either")
    x, normals = points_and_normals(np.random.default_rng(42), 4)
    check_irradiance(room, octree, surfaces, x, normals, "-us", "99", "-di", "16", "-ad", "256")
    a, b, c = (rtrace(room, octree, x, normals, "-I", *EXACT, "-us", seed, "-di", "16", "-ad", "256", literal=False) for seed in (1, 2, 1))
    assert (a != b).all() and np.array_equal(a, c)
    for program in ("rpict", "rtrace", "rcontrib"):
        assert "-us: expected a number greater than 0" in run(program, "-us", "0", octree, cwd=room, code=1).err


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_scaled_scenes(room, scale):
    """Seen on surfaces: rtrace -I starts 1e-4 off its points, whatever the scale."""
    g = ROOM.placed(ROOM.origin * scale, ROOM.U * scale, ROOM.V * scale)
    dome = Sphere((0, 0, 0.5 * scale), 3.5 * scale)
    x, normals = points_and_normals(np.random.default_rng(43), 4)
    n = unit(normals)
    discs = "".join(Ring(p * scale, m, 0, 0.01 * scale).rad("white", f"d{k}") for k, (p, m) in enumerate(zip(x, n)))
    octree = oconv(room, "void plastic white 0 0 5 1 1 1 0 0\n" + discs + material("env", "room.ilf.exr", g, 9) + dome.rad("env", "dome"), "scaled")
    got = replicas(room, octree, (f32((x + 0.05 * n) * scale), f32(-n)), 64, *EXACT, "-i", "-di", "16", "-ad", "256")
    for k in range(len(x)):
        truth = integral([Surface(dome, g)], x[k] * scale, n[k])
        error = got[:, k].std(0, ddof=1) / 8
        assert (np.abs(got[:, k].mean(0) - truth) < 5 * error + 3e-3 * truth).all(), (k, got[:, k].mean(0), truth, error)


@pytest.mark.parametrize("move", ["-rx 20 -t .1 .2 -.1", "-mx -rz 40", "-s 1.5 -mz -ry 10"])
def test_light_field_inside_an_instance(room, move):
    """A light source like any other."""
    g = ROOM.placed(ROOM.origin, ROOM.U, ROOM.V)
    dome = Sphere((0, 0, 0.5), 3.5)
    oconv(room, material("env", "room.ilf.exr", g, 9) + dome.rad("env", "dome"), "inner")
    octree = oconv(room, f"void instance it\n{1 + len(move.split())} inner.oct {move}\n0\n0\n", "outer")
    surface = Surface(dome, g).moved(matrix(move.split()))
    x, normals = points_and_normals(np.random.default_rng(44), 3, (0.4, 0.4), (0.02, 0.3))
    check_irradiance(room, octree, [surface], x, normals, "-di", "16", "-ad", "1024", aimed="-mz" not in move)  # below it all is dark


@pytest.mark.parametrize("move", ["-rx 25 -t 1 2 3", "-mx -rz 30 -t -1 0 2"])
def test_moved_by_xform(room, move):
    g = ROOM.placed(ROOM.origin, ROOM.U, ROOM.V)
    dome = Sphere((0, 0, 0.5), 3.5)
    (room / "flat.rad").write_text(material("env", "room.ilf.exr", g, 9) + dome.rad("env", "dome"))
    octree = oconv(room, run("xform", *move.split(), "flat.rad", cwd=room).text, "xformed")
    M = matrix(move.split())
    x, normals = points_and_normals(np.random.default_rng(45), 4)
    surface = Surface(dome, g).moved(M)
    check_irradiance(room, octree, [surface], f32(x @ M[:3, :3].T + M[:3, 3]), f32(normals @ M[:3, :3].T), "-di", "16", "-ad", "256")


def test_light_field_with_a_pattern(room):
    """A brightness pattern scales all of it, what is aimed at as well."""
    text, surfaces = SCENES["dome, nodepth"]
    pattern = "void brightfunc half\n2 half .\n0\n0\n"
    (room / "half.cal").write_text("half = 0.25;\n")
    text = pattern.replace("half .", "half half.cal") + text.replace("void ilf env", "half ilf env")
    octree = oconv(room, text, "pattern")
    quarter = [Surface(s.shape, s.ilf, s.depth, lambda h, d: 0.25) for s in surfaces]
    x, normals = points_and_normals(np.random.default_rng(46), 3)
    check_irradiance(room, octree, quarter, x, normals, "-di", "16", "-ad", "256")


# ---- objects: images of the literal method against -di ------------------------------------------------------------

THINGS = """
void plastic grey 0 0 5 .5 .5 .5 0 0
void plastic shiny 0 0 5 .3 .25 .2 .06 .12
void plastic glazed 0 0 5 .4 .1 .1 .05 0
void metal rough 0 0 5 .8 .7 .5 .9 .15
void metal chrome 0 0 5 .9 .9 .9 1 0
void mirror looking 0 0 3 .8 .8 .8
void glass pane 0 0 3 .85 .9 .9
void dielectric crystal 0 0 5 .95 .95 .9 1.5 0
void trans sheet 0 0 7 .6 .7 .6 .05 .1 .6 .4
void plastic2 brushed 4 1 0 0 . 0 6 .4 .35 .3 .1 .05 .2
void ashik2 lacquer 4 0 1 0 . 0 8 .3 .2 .2 .1 .1 .1 60 200
void BRTDfunc velvet 10 .2*(1-NyP*NyP) .1 .1 0 0 0 0 0 0 . 0 9 .3 .2 .3 0 0 0 0 0 0
"""
GROUND = Polygon((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)).rad("grey", "ground")


def things(folder):
    v, t = lumpy_ball(12, 12)
    (folder / "lump.obj").write_text(obj_text(v, t))
    run("obj2mesh", "lump.obj", "lump.rtm", cwd=folder)
    return (THINGS + GROUND
            + Polygon((-0.9, 0.35, 0), (-0.5, 0.5, 0), (-0.5, 0.5, 0.5), (-0.9, 0.35, 0.5)).rad("shiny", "screen")
            + Sphere((-0.62, -0.25, 0.12), 0.12).rad("rough", "brass") + Sphere((-0.25, -0.3, 0.12), 0.12).rad("chrome", "ball")
            + Sphere((0.35, -0.45, 0.11), 0.11).rad("crystal", "bead") + Sphere((0.75, 0.1, 0.14), 0.14).rad("glazed", "cherry")
            + Polygon((0.2, -0.1, 0), (0.55, 0.1, 0), (0.55, 0.1, 0.4), (0.2, -0.1, 0.4)).rad("sheet", "blind")
            + Polygon((0.3, 0.5, 0), (0.8, 0.4, 0), (0.8, 0.4, 0.45), (0.3, 0.5, 0.45)).rad("looking", "glass")
            + Polygon((-0.1, 0.05, 0.02), (0.15, 0.15, 0.02), (0.15, 0.15, 0.5), (-0.1, 0.05, 0.5)).rad("pane", "window")
            + Sphere((-0.1, 0.5, 0.15), 0.15).rad("brushed", "pot") + Sphere((0.1, -0.62, 0.1), 0.1).rad("lacquer", "box")
            + Ring((-0.35, 0.15, 0.1), (0.2, -0.6, 0.7), 0, 0.12).rad("velvet", "hat")
            + Polygon((-0.5, 0, 0.7), (-0.1, 0, 0.75), (-0.1, 0.3, 0.75), (-0.5, 0.3, 0.7)).rad("grey", "card")
            + "\ngrey mesh lump 7 lump.rtm -s .12 -t .62 -.25 .15 0 0\n")


def replicas(folder, octree, rays, copies, *options, some=None):
    """(copies, rays, 3): the copies of one ray do not follow each other, for the pattern of random numbers repeats."""
    o, d = rays
    got, some = [], some or copies
    for first in range(0, copies, some):
        n = min(some, copies - first)
        got.append(rtrace(folder, octree, np.tile(o, (n, 1)), np.tile(d, (n, 1)), *options, "-us", 1 + first, literal=False).reshape(n, len(o), 3))
    return np.concatenate(got)


def view_rays(folder, w, h, view=VIEW):
    r = np.frombuffer(run("vwrays", "-ff", "-pa", "0", "-x", w, "-y", h, *view, cwd=folder).out, "<f4").reshape(-1, 6)
    return r[:, :3].copy(), r[:, 3:].copy()


def block_means(a, w, h, size):
    """(copies, blocks) luminance of size x size pixels."""
    y = (a @ LUMINANCE).reshape(len(a), h // size, size, w // size, size)
    return y.mean((2, 4)).reshape(len(a), -1)


def same_images(a, b, w, h, size, what=""):
    """Block means of two sets of pictures: squared deviations in sum, and the ratio of the means of all."""
    A, B = block_means(a, w, h, size), block_means(b, w, h, size)
    va, vb = A.var(0, ddof=1) / len(A), B.var(0, ddof=1) / len(B)
    some = va + vb > 1e-12 * A.mean() ** 2
    assert np.allclose(A.mean(0)[~some], B.mean(0)[~some], rtol=1e-5), what
    if not some.any():
        return 1.0, 0.0
    t = (A.mean(0) - B.mean(0))[some] / np.sqrt(va + vb)[some]
    n = min(len(A), len(B)) - 1          # Student's distribution with at least that many degrees of freedom
    mean, var = n / (n - 2), 2 * n * n * (n - 1) / ((n - 2) ** 2 * (n - 4))
    # the sum of few squares is skewed: a gamma distribution of the same mean and variance, its cube root nearly normal (Wilson & Hilferty 1931)
    narrow = var / (9 * mean ** 2 * len(t))
    z = (((t ** 2).mean() / mean) ** (1 / 3) - 1 + narrow) / np.sqrt(narrow)
    ratio = B.mean() / A.mean()
    error = np.sqrt(A.mean(1).var(ddof=1) / len(A) / A.mean() ** 2 + B.mean(1).var(ddof=1) / len(B) / B.mean() ** 2)
    words = f"{what} chi-square {(t ** 2).sum():.1f} of {len(t)} blocks (z {z:.2f}), worst {np.abs(t).max():.2f}, mean {ratio:.5f} +- {error:.5f}"
    print(words)
    assert z < 5, words
    assert abs(ratio - 1) < 5 * error, words
    return ratio, error


AROUND = {
    "far": material("env", "room.ilf.exr", depth=False) + Sphere((0, 0, 0), 12).rad("env", "dome"),
    "box": material("env", "room.ilf.exr") + "".join(w.rad("env", f"w{k}") for k, w in enumerate(WALLS)),
    "source": material("env", "room.ilf.exr") + Source((0, 0, 1), 180).rad("env", "sky"),
}


@pytest.mark.parametrize("around", [pytest.param("far", marks=pytest.mark.sweep), "box"])
def test_picture_of_all_materials_is_the_literal_one(room, around):
    octree = oconv(room, things(room) + AROUND[around], "things_" + around)
    w, h = 16, 16
    rays = view_rays(room, w, h)
    # many scattered rays: a glossy pixel's one ray meets a lamp in one copy of a dozen, which tells no standard error; where each ray
    # of the aimed picture ends, lamps are looked for, which is dear
    literal = replicas(room, octree, rays, 12, *EXACT, "-ss", "64", "-di", "0", "-ad", "512", some=4)
    aimed = replicas(room, octree, rays, 8, *EXACT, "-ss", "16", "-di", "4", "-ad", "16", some=8)
    assert np.isfinite(aimed).all() and (aimed >= 0).all()
    same_images(literal, aimed, w, h, 8 if around == "far" else 4, around)


@pytest.mark.sweep
def test_picture_of_all_materials_is_the_literal_one_to_0_2_percent(room):
    """Mean ratio 1 +- 0.2 %, blocks of 4 x 4 pixels, 49,152 blind rays a pixel."""
    def compare_pictures(around, options):
        octree = oconv(room, things(room) + AROUND[around], "long_" + around)
        w, h = 32, 24
        rays = view_rays(room, w, h)
        copies = 192
        literal = replicas(room, octree, rays, copies, *EXACT, "-ss", "64", *options.split(), "-di", "0", "-ad", "256", some=8)
        aimed = replicas(room, octree, rays, copies, *EXACT, "-ss", "64", "-di", "8", "-ad", "64", *options.split(), some=16)
        ratio, error = same_images(literal, aimed, w, h, 4, f"{around} {options}")
        assert error < 1e-3, "not much of a comparison"
        assert abs(ratio - 1) < 2e-3 + 3 * error
    sweep(compare_pictures, [(around, options) for around in AROUND for options in ("", "-st .15", "-ss 4", "-ab 2", "-di 1", "-di 64")])


ONE_BY_ONE = [line.split()[2] for line in THINGS.strip().splitlines()]


@pytest.mark.parametrize("mod", [m for m in ONE_BY_ONE if m not in ("grey", "looking", "pane", "crystal")])
def test_each_material_alone(room, mod):
    """A tilted disc, from either side."""
    disc = Ring((0, 0, 0.3), (0.3, -0.5, 0.8), 0, 0.2).rad(mod, "disc")
    octree = oconv(room, THINGS + disc + AROUND["box"], "one_" + mod)
    n, u = unit(np.array([0.3, -0.5, 0.8])), unit(np.array([0.5, 0.3, 0]))
    target = np.array([0, 0, 0.3]) + np.linspace(-0.1, 0.1, 8)[:, None] * u
    # towards mirror images of the lamps, or a little beside, and a view from the back
    lamp = unit(small_room().lamps[0].c - (0, 0, 0.3))
    image = lamp - 2 * (lamp @ n) * n
    froms = [-image, unit(-image + [0.1, 0.05, 0]), unit(n + 0.7 * u), unit(-n + 0.4 * u)]
    o = f32(np.concatenate([target + 0.25 * f for f in froms]))
    d = f32(np.concatenate([np.tile(-f, (8, 1)) for f in froms]))
    literal = replicas(room, octree, (o, d), 24, *EXACT, "-di", "0", "-ad", "256", "-ss", "8")
    aimed = replicas(room, octree, (o, d), 24, *EXACT, "-di", "16", "-ad", "64", "-ss", "8")
    same_images(literal, aimed, 8, len(froms), 4 if mod == "lacquer" else 2, mod)


# Radiance's coefficients for lamps are not those that its ambient and scattered rays stand for (Fresnel's factor of a
# smooth coat, highlights below -st, functions): light fields need the latter, as the literal method has them.
COATS = """
void plastic coated 0 0 5 .4 .3 .2 .05 0
void plastic satin 0 0 5 .4 .3 .2 .1 .2
void plastic2 combed 4 1 0 0 . 0 6 .4 .3 .2 .1 .1 .3
void trans paper 0 0 7 .6 .6 .5 .05 .2 .6 .3
void trans2 cloth 4 1 0 0 . 0 8 .6 .6 .5 .05 .2 .1 .6 .3
void ashik2 varnish 4 0 1 0 . 0 8 .3 .2 .2 .1 .1 .1 20 40
void plasfunc sheen 2 noneg(1-dz) . 0 4 .5 .4 .3 .2
void transfunc veil 2 noneg(1-dz) . 0 6 .5 .4 .3 .2 .5 .5
void BRTDfunc felt 10 0 0 0 .05 .05 .05 .2+0*dx .2+0*dx .2+0*dx . 0 9 .3 .2 .3 .1 .1 .1 .1 .2 .1
"""


@pytest.fixture(scope="module")
def low_lamp(room):
    """A dim dome with a lamp of 25 degrees, 20 above the horizon."""
    c, r = np.array([np.cos(np.deg2rad(20)), 0, np.sin(np.deg2rad(20))]) * 1000, 1000 * np.sin(np.deg2rad(12.5))
    write_ilf(room / "low.ilf.exr", Room([Lamp(c, r, np.array([20.0, 15, 10]))], None, lambda d: 0 * d + 0.1).light_field(1, 1, 96, 48))
    return room


ROUGH = "satin combed paper cloth varnish".split()      # the others' rays are the same whatever -st is


@pytest.mark.parametrize("mod, threshold", [(line.split()[2], st) for line in COATS.strip().splitlines() for st in ("0", "0.5")
                                            if st == "0" or line.split()[2] in ROUGH])
def test_coefficients_are_those_of_scattered_rays(low_lamp, mod, threshold):
    """Level discs seen from above, below, and low towards the lamp and away from it."""
    octree = oconv(low_lamp, COATS + Ring((0, 0, 0), (0, 0, 1), 0, 0.2).rad(mod, "disc") + far_dome("low.ilf.exr")
                   + Ring((0, 0, -11), (0, 0, 1), 0, 20).rad("coated", "below"), f"coat_{mod}{threshold}")
    d = unit(np.array([(0.1, 0.2, -1), (0.1, 0.3, 1), (1, 0.2, -0.5), (-1, 0, -0.4), (0.3, 1, -0.6), (1, 0, 0.5)]))
    got = {}
    for name, di, copies in (("literal", 0, 80), ("aimed", 16, 80)):
        got[name] = replicas(low_lamp, octree, (f32(-0.1 * d), f32(d)), copies, *EXACT, "-st", threshold, "-ss", "32" if di else "128", "-di", di,
                             "-ad", "256" if di else "2048")
    A, B = got["literal"] @ LUMINANCE, got["aimed"] @ LUMINANCE
    error = np.sqrt((A.var(0, ddof=1) + B.var(0, ddof=1)) / len(A))
    assert (np.abs(A.mean(0) - B.mean(0)) < 5 * error + 1e-6).all(), (A.mean(0), B.mean(0), error)
    assert (error < 0.025 * np.maximum(A.mean(0), 0.05 * A.mean(0).max())).all(), "not much of a comparison"


@pytest.mark.parametrize("pane", ["pane", "crystal", "sheet"])
def test_through_a_pane(room, pane):
    """The light reaches a floor through it: shadow rays that a surface passes on must find the lamp, or count it elsewhere."""
    roof = Sphere((0, 0, 0.1), 0.6).rad(pane, "ball") if pane == "crystal" else \
        Polygon((-2, -2, 0.4), (2, -2, 0.4), (2, 2, 0.4), (-2, 2, 0.4)).rad(pane, "roof")
    octree = oconv(room, THINGS + roof + AROUND["box"], "through_" + pane)
    o, d = f32(np.array([[0, 0, 0.1], [0.3, -0.2, 0.05], [-0.3, 0.1, 0.2]])), f32(np.array([[0, 0, 1], [0.1, 0, 1], [0, 0.4, 1]]))
    got = {}
    for name, options in (("literal", ["-di", "0", "-ad", "4096"]), ("aimed", ["-di", "16", "-ad", "256"])):
        got[name] = replicas(room, octree, (o, d), 60 if pane == "crystal" else 24, "-I", *EXACT, *options)
    A, B = got["literal"] @ LUMINANCE, got["aimed"] @ LUMINANCE
    error = np.sqrt((A.var(0, ddof=1) + B.var(0, ddof=1)) / len(A))
    assert (np.abs(A.mean(0) - B.mean(0)) < 5 * error).all(), (A.mean(0), B.mean(0), error)
    assert (error < 0.03 * A.mean(0)).all()


def bsdf_file(path):
    """A sheet after Klems's quarter basis (41 patches): diffuse, with a broad ridge that depends on both patches."""
    k = np.arange(41)
    ridge = 0.06 + 0.5 * (np.abs(k[:, None] - k) < 2)
    data = "\n".join(", ".join(f"{x:.4f}" for x in row) + "," for row in ridge)

    def block(direction, kind):
        return f"""<WavelengthData><LayerNumber>System</LayerNumber><Wavelength unit="Integral">Visible</Wavelength>
<SourceSpectrum>CIE Illuminant D65 1nm.ssp</SourceSpectrum><DetectorSpectrum>ASTM E308 1931 Y.dsp</DetectorSpectrum>
<WavelengthDataBlock><WavelengthDataDirection>{direction}</WavelengthDataDirection><ColumnAngleBasis>LBNL/Klems Quarter</ColumnAngleBasis>
<RowAngleBasis>LBNL/Klems Quarter</RowAngleBasis><ScatteringDataType>{kind}</ScatteringDataType><ScatteringData>
{data}
</ScatteringData></WavelengthDataBlock></WavelengthData>"""
    path.write_text('<?xml version="1.0" encoding="UTF-8"?>\n<WindowElement xmlns="http://windows.lbl.gov">'
                    "<WindowElementType>System</WindowElementType><Optical><Layer><Material><Name>sheet</Name><Manufacturer>none</Manufacturer>"
                    '<Thickness unit="Meter">0</Thickness><DeviceType>Other</DeviceType></Material>'
                    "<DataDefinition><IncidentDataStructure>Columns</IncidentDataStructure></DataDefinition>"
                    + block("Transmission Front", "BTDF") + block("Reflection Front", "BRDF") + block("Reflection Back", "BRDF")
                    + "</Layer></Optical></WindowElement>\n")


def test_bsdf_material(room):
    bsdf_file(room / "sheet.xml")
    disc = Ring((0, 0, 0.3), (0.3, -0.5, 0.8), 0, 0.2).rad("klems", "disc")
    octree = oconv(room, "\nvoid BSDF klems 6 0 sheet.xml 0 0 1 . 0 9 .1 .1 .2 .1 .1 .1 0 0 0\n" + disc + AROUND["far"], "bsdf")
    n, u = unit(np.array([0.3, -0.5, 0.8])), unit(np.array([0.5, 0.3, 0]))
    target = np.array([0, 0, 0.3]) + np.linspace(-0.1, 0.1, 8)[:, None] * u
    froms = [unit(n + 0.7 * u), unit(-n + 0.4 * u)]
    o, d = f32(np.concatenate([target + 0.25 * f for f in froms])), f32(np.concatenate([np.tile(-f, (8, 1)) for f in froms]))
    literal = replicas(room, octree, (o, d), 24, *EXACT, "-di", "0", "-ad", "256", "-ss", "64")
    aimed = replicas(room, octree, (o, d), 24, *EXACT, "-di", "16", "-ad", "64", "-ss", "16")
    assert (literal.mean((0, 1)) > 0.1).all()
    same_images(literal, aimed, 8, 2, 2, "BSDF")


def test_lamps_of_the_scene_count_once(room):
    """An ordinary light beside the light field: neither hides in the other's samples."""
    lamp = "\nvoid light bulb 0 0 3 30 20 10\n" + Sphere((0.5, -0.5, 1.0), 0.08).rad("bulb", "lamp")
    octree = oconv(room, THINGS + GROUND + lamp + AROUND["far"], "bulb")
    rays = view_rays(room, 16, 16)
    literal = replicas(room, octree, rays, 16, *EXACT, "-di", "0", "-ad", "512")
    aimed = replicas(room, octree, rays, 16, *EXACT, "-di", "8", "-ad", "64")
    same_images(literal, aimed, 16, 16, 4, "bulb")


def test_two_bounces_with_and_without_the_cache(room):
    """-ab 2: the cached picture is as bright as the literal, uncached one, within what interpolation does (2 %)."""
    octree = oconv(room, things(room) + AROUND["far"], "bounce")
    rays = view_rays(room, 12, 8)
    a, b, cached = (replicas(room, octree, rays, 12, *EXACT, "-ab", "2", *options).mean(1) @ LUMINANCE for options in (
        ["-di", "0", "-ad", "512"], ["-di", "4", "-ad", "12"], ["-di", "4", "-ad", "64", "-aa", ".15", "-ar", "64"]))
    of_literal, of_aimed = a.var(ddof=1) / len(a), b.var(ddof=1) / len(b)
    assert abs(b.mean() - a.mean()) < 5 * np.sqrt(of_literal + of_aimed), (a, b)
    assert abs(cached.mean() - a.mean()) < 5 * np.sqrt(of_literal) + 0.02 * a.mean(), (a, cached)


# ---- white dots -------------------------------------------------------------------------------------------------------

def dots(tmp_path):
    """Largest deviation over the root mean square, and that, of both methods: lamps of 2 degrees and a mirror ball."""
    write_ilf(tmp_path / "room.ilf.exr", judged_room().light_field(10, 10, 64, 32), half=True)
    (tmp_path / "blob.obj").write_text(obj_text(*lumpy_ball(24, 24)))
    run("obj2mesh", "blob.obj", "blob.rtm", cwd=tmp_path)
    octree = oconv(tmp_path, judged_objects(balls=False) + MIRROR_BALL + far_dome("room.ilf.exr"))
    rays = view_rays(tmp_path, 32, 24)
    worst, rms = {}, {}
    for name, options in (("literal", ["-di", "0", "-ad", "128"]), ("aimed", ["-di", "4", "-ad", "16"])):
        got = replicas(tmp_path, octree, rays, 24, *EXACT, *options) @ LUMINANCE
        seen = got.mean(0) < 20 * np.median(got)        # lamps and their mirror images are not estimated
        off = (got - got.mean(0))[:, seen]
        rms[name] = np.sqrt((off ** 2).mean())
        worst[name] = np.abs(off).max() / rms[name]
    return worst, rms


def test_white_dots_are_small(tmp_path):
    """With an eighth of its rays, the largest deviation is well below half the literal method's."""
    worst, rms = dots(tmp_path)
    assert rms["aimed"] < 0.4 * rms["literal"], rms
    assert worst["aimed"] * rms["aimed"] < 0.5 * worst["literal"] * rms["literal"], (worst, rms)


@pytest.mark.sweep
def test_white_dots_are_no_larger_for_the_error(tmp_path):
    """Issue 5's measure: the largest deviation / RMSE is no worse than the literal method's."""
    worst, _ = dots(tmp_path)
    assert worst["aimed"] <= worst["literal"], worst


# ---- furnaces and identity ----------------------------------------------------------------------------------------------

@pytest.mark.parametrize("field", ["constant", "smooth"])
def test_light_without_lamps_is_the_literal_picture(tmp_path, field):
    """Nothing above the threshold: nothing is sampled, and not one bit differs."""
    r = Room([], None, lambda d: 0 * d + (1.0, 2.0, 4.0)) if field == "constant" else smooth_room()
    write_ilf(tmp_path / "room.ilf.exr", r.light_field(3, 3, 16, 8))
    octree = oconv(tmp_path, things(tmp_path) + AROUND["far"])
    pictures = [run("rpict", *VIEW, "-x", "32", "-y", "24", "-ab", "1", "-ad", "64", "-di", n, octree, cwd=tmp_path).out.split(b"\n\n", 1)[1]
                for n in (0, 1, 16, 256)]
    assert all(p == pictures[0] for p in pictures[1:])


def test_white_furnace(tmp_path):
    """White diffuse things in constant light of 1 cannot be told from it, at any number of samples."""
    write_ilf(tmp_path / "room.ilf.exr", Room([], None, lambda d: 0 * d + 1.0).light_field(2, 2, 8, 4, polar_max=PI))
    octree = oconv(tmp_path, "void plastic white 0 0 5 1 1 1 0 0\n" + Sphere((0, 0, 0.5), 0.2).rad("white", "ball")
                   + material("env", "room.ilf.exr") + material("down", "room.ilf.exr", ROOM.placed((-1, -1, 0), (0, 2, 0), (2, 0, 0)), 9)
                   + Source((0, 0, 1), 180).rad("env", "up") + Source((0, 0, -1), 180).rad("down", "low"))
    o = f32(np.array([[0.05, -0.03, 3], [0.1, 0.1, 3], [-0.05, 0.1, -2], [1, 1, 1]]))
    d = f32(np.array([[0, 0, -1], [0, 0, -1], [0, 0, 1], [0.3, 0, 1]]))
    for n in (0, 16):
        got = rtrace(tmp_path, octree, o, d, *EXACT, "-di", n, "-ad", "256", literal=False)
        assert np.allclose(got, 1, rtol=1e-4), got


def test_scene_without_a_light_field_is_untouched_by_the_option(tmp_path):
    lamp = "\nvoid light bulb 0 0 3 30 20 10\n" + Sphere((0.5, -0.5, 1.5), 0.1).rad("bulb", "lamp")
    octree = oconv(tmp_path, things(tmp_path) + lamp)
    pictures = [run("rpict", *VIEW, "-x", "48", "-y", "36", "-ab", "1", "-ad", "64", "-di", n, octree, cwd=tmp_path).out.split(b"\n\n", 1)[1]
                for n in (0, 16)]
    assert pictures[0] == pictures[1]


# ---- programs and options --------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("program", ["rpict", "rtrace", "rcontrib"])
def test_a_negative_number_of_samples_is_refused(room, program):
    octree = oconv(room, SCENES["dome, nodepth"][0], "negative")
    more = ["-m", "env"] if program == "rcontrib" else []
    r = run(program, *more, "-di", "-1", octree, stdin="0 0 0 0 0 1\n", cwd=room, code=None)
    lines = [x for x in r.err.splitlines() if " rays, " not in x]      # rpict takes leave with its statistics
    assert r.code == 1 and len(lines) == 1 and "-di: expected a number of samples" in lines[0] and not r.out, r


def test_default_is_16():
    for program in ("rpict", "rtrace", "rcontrib"):
        assert re.search(r"^-di 16\s", run(program, "-defaults").text, re.M)


def test_statistics_of_rpict(room):
    """-t: samples drawn, rays traced, probes, set-up time; the surer the fewer rays."""
    octree = oconv(room, things(room) + AROUND["far"], "stats")
    err = run("rpict", "-t", "1000", *VIEW, "-x", "32", "-y", "24", "-ab", "1", "-ad", "16", "-di", "16", octree, cwd=room).err
    m = re.search(r"light fields: (\d+) bright patches in ([\d.]+) s, (\d+) slices, (\d+) candidates, (\d+) shadow rays", err.splitlines()[-1])
    assert m, err
    patches, _, slices, candidates, rays = (float(x) for x in m.groups())
    assert patches > 0 and slices > 0 and candidates > 4 * rays * 0.9 and rays > 0
    assert re.search(r"room.ilf.exr: \d+ of 64 probes used", err)


def test_rcontrib_sums_are_rtraces(room):
    """-V+: the light field's contribution is the irradiance itself."""
    octree = oconv(room, SCENES["box, depth"][0], "contrib")
    line = "0.2 -0.1 0.1 0.2 0.1 1\n"
    common = ["-u-", "-ab", "1", "-ad", "512", "-lw", "1e-9", "-di", "16"]
    a = np.array(run("rcontrib", "-h", "-I+", "-V+", *common, "-m", "env", octree, stdin=line * 64, cwd=room).text.split(), float).reshape(-1, 3)
    b = np.array(run("rtrace", "-h", "-I", *common, "-as", "0", "-aa", "0", octree, stdin=line * 64, cwd=room).text.split(), float).reshape(-1, 3)
    error = np.sqrt((a.var(0, ddof=1) + b.var(0, ddof=1)) / len(a))
    assert len(a) == len(b) == 64
    assert (np.abs(a.mean(0) - b.mean(0)) < 5 * error).all(), (a.mean(0), b.mean(0), error)
    assert (error < 0.02 * a.mean(0)).all()


def test_several_processes(room):
    """rtrace -n 2: as many results, in order, with the same mean."""
    text, surfaces = SCENES["box, depth"]
    octree = oconv(room, text, "processes")
    x, normals = points_and_normals(np.random.default_rng(47), 3)
    check_irradiance(room, octree, surfaces, x, normals, "-n", "2", "-di", "16", "-ad", "256")


def test_rpict_and_rtrace_agree(room):
    """A picture against many rays through its pixels."""
    octree = oconv(room, things(room) + AROUND["box"], "agree")
    w, h = 12, 8
    out = run("rpict", *VIEW, "-x", w, "-y", h, "-pa", "0", "-pj", "0", "-ps", "1", *EXACT[2:], "-di", "16", "-ad", "24", octree, cwd=room).out
    (room / "agree.hdr").write_bytes(out)
    picture = read_picture(room, "agree.hdr") @ LUMINANCE
    assert picture.shape == (h, w)
    rays = view_rays(room, w, h)
    got = replicas(room, octree, rays, 8, *EXACT, "-di", "16", "-ad", "24") @ LUMINANCE
    close = np.abs(got.mean(0) - picture.ravel()) <= 6 * got.std(0, ddof=1) + 0.02 * picture.ravel()
    assert close.mean() > 0.97, close.mean()
    assert abs(picture.mean() / got.mean() - 1) < 0.02


def test_irradiance_picture(room):
    """rpict -i and rtrace -i: the floor's irradiance is the oracle's."""
    octree = oconv(room, THINGS + GROUND + AROUND["box"], "irradiance")
    o, d = f32(np.array([[0.3, -0.2, 1.0]])), f32(np.array([[0, 0, -1.0]]))
    got = replicas(room, octree, (o, d), 64, "-i", *EXACT, "-di", "16", "-ad", "512")[:, 0]
    truth = integral(SCENES["box, depth"][1], np.array([0.3, -0.2, 0.0]), np.array([0, 0, 1.0]))
    error = got.std(0, ddof=1) / 8
    assert (np.abs(got.mean(0) - truth) < 5 * error + 3e-3 * truth).all(), (got.mean(0), truth, error)
