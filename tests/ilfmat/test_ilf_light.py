"""libilf's estimator without a renderer: ilf_light's mean against the oracle's integrals, what counts where, threads.

Seeds are fixed.  Means are compared within 5 of their standard errors and the integral's own error; the chance that a right
program fails at another seed is below 1e-4 a test.
"""
import re
import subprocess

import numpy as np
import pytest

from conftest import BUILD, TOP, environment
from process import execute
from ilf_util import ILF, PI, unit, write_ilf
from render_scene import LUMINANCE, small_room
from test_ilf_sampling import AUX, SPARSE, aimed_rays, excess, info, way_out

FIELDS = {"lamps": small_room().light_field(5, 4, 48, 24), **SPARSE}
BLOCK = (0.55, 0.2, 1.1, 0.28)     # before the larger lamp, as most points see it
MIRROR = (0.35, -0.1, 0.3, 0.25)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fields")
    return {name: write_ilf(folder / f"{k}.ilf.exr", f) for k, (name, f) in enumerate(FIELDS.items())}


def numbers(v):
    return ",".join(map(str, v))


def ilflight(path, records, *options):
    """Mean and mean square of estimates: (records, 4, 3)."""
    program = BUILD / "test" / "ilflight"
    assert program.is_file(), "the test driver ilflight is not built: run make test"
    p = execute([str(program), str(path), *map(str, options)], input=np.asarray(records, float).tobytes(),
                       stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment())
    assert p.returncode == 0, p.stderr.decode()
    return np.frombuffer(p.stdout, "<f8").reshape(-1, 4, 3)


def sphere_grid(n_theta, n_phi, most=PI):
    """Midpoints (unit vectors) and solid angles of a grid about the z axis, down to polar angle most."""
    t, p = (np.arange(n_theta) + 0.5) * 2 * PI / n_theta, (np.arange(n_phi) + 0.5) * most / n_phi
    P, T = np.meshgrid(p, t, indexing="ij")
    h = most / n_phi / 2
    d = np.stack([np.sin(P) * np.cos(T), np.sin(P) * np.sin(T), np.cos(P)], -1).reshape(-1, 3)
    return d, (np.cos(P - h) - np.cos(P + h)).ravel() * 2 * PI / n_theta


def blocked(x, d, ball):
    w = x - np.array(ball[:3])
    b = (d * w).sum(-1)
    return (b < 0) & (b * b > (w * w).sum(-1) - ball[3] ** 2)


def rgb_excess(f, aux, x, d, threshold):
    h = way_out(aux, x, d)
    value = f.eval(x, d, x if h is None else h, aux != "far")
    y = value @ LUMINANCE
    return value * np.where(y > threshold, 1 - threshold / np.where(y > threshold, y, 1), 0)[:, None]


def integrals(f, aux, x, n, threshold, balls=((),), power=1, grid=(240, 300)):
    """The excess that arrives at x, times the lobe, over the plane's hemisphere: with each of the balls in the way, () for none."""
    d, w = sphere_grid(*grid, PI / 2)
    lobe = np.maximum(d @ n, 0) ** power
    d, w = d[lobe > 1e-9], (w * lobe)[lobe > 1e-9]
    light = rgb_excess(f, aux, np.broadcast_to(x, d.shape), d, threshold) * w[:, None]
    return [light[~blocked(x, d, ball)].sum(0) if ball else light.sum(0) for ball in balls]


def integral(*a, **more):
    return integrals(*a, **more)[0]


def points_and_normals(rng, n):
    x = np.stack([rng.uniform(-.7, .7, n), rng.uniform(-.45, .45, n), rng.uniform(.02, .6, n)], -1)
    normals = rng.normal(size=(n, 3))
    normals[:, 2] = np.abs(normals[:, 2]) + .3
    return x, normals / np.linalg.norm(normals, axis=1)[:, None]


def check(got, truth, copies, slack=6e-3, least=0.0):
    """Means and mean squares (2, 3) against a truth of which `slack` is not known; by luminance."""
    mean, square = got
    error = np.sqrt(np.maximum(square - mean ** 2, 0) / (copies - 1))
    assert (np.abs(mean - truth) <= 5 * error + slack * truth + least).all(), (mean, truth, error)
    return error, mean


# ---- straight from the light field --------------------------------------------------------------------------

ROUNDS = [("lamps", "far"), ("lamps", "box"), ("lamps", "ball"), ("lamps", "bulb"), ("inside", "far"), ("inside", "box"), ("odd", "far"),
          ("odd", "bulb"), ("pole", "box"), ("seam left", "far"), ("seam right", "box"), ("185 degrees", "far"), ("last valid row", "box"),
          ("1x5", "box"), ("5x1", "far"), ("one texel in all", "far"), ("one texel wide", "box"), ("long plane", "far")]


@pytest.mark.parametrize("name, aux", ROUNDS)
def test_mean_is_the_integral(files, name, aux):
    f = FIELDS[name]
    rng = np.random.default_rng(60)
    threshold, patches = info(files[name], *AUX[aux])
    assert patches > 0
    x, d = aimed_rays(rng, f, aux, 400)
    lit = np.flatnonzero(excess(f, aux, x, d, threshold) > 0)[:3]
    assert len(lit) == 3, "the rays see nothing bright"
    x, n = x[lit], unit(d[lit] + .4 * rng.normal(size=(3, 3)))
    got = ilflight(files[name], np.concatenate([x, n], 1), *AUX[aux], "--copies", 300)
    for k in range(3):
        check(got[k, :2], integral(f, aux, x[k], n[k], threshold), 300, least=1e-4 * threshold)


@pytest.fixture(scope="module")
def three_points(files):
    """Points with normals, and what arrives there."""
    threshold, _ = info(files["lamps"], *AUX["box"])
    x, n = points_and_normals(np.random.default_rng(61), 3)
    return np.concatenate([x, n], 1), [integral(FIELDS["lamps"], "box", x[k], n[k], threshold) for k in range(3)]


@pytest.mark.parametrize("options", [("--samples", 1), ("--samples", 3), ("--samples", 256), ("--weight", .01), ("--samples", 4, "--weight", .3)],
                         ids=lambda o: " ".join(map(str, o)))
def test_any_number_of_samples_has_the_same_mean(files, three_points, options):
    records, truth = three_points
    for got, true in zip(ilflight(files["lamps"], records, *AUX["box"], "--copies", 400, *options), truth):
        check(got[:2], true, 400)


def test_error_falls_with_samples(files):
    """Sixteen times the rays, a part of the error: at least as for independent ones, within what few points tell."""
    x, n = points_and_normals(np.random.default_rng(62), 4)
    records = np.concatenate([x, n], 1)
    few, many = (ilflight(files["lamps"], records, *AUX["box"], "--block", numbers(BLOCK), "--copies", 300, "--samples", s)[:, :2] for s in (4, 64))
    spread = [np.sqrt(np.maximum(g[:, 1] - g[:, 0] ** 2, 0) @ LUMINANCE ** 2).sum() for g in (few, many)]
    assert spread[1] < .35 * spread[0], spread


@pytest.mark.parametrize("aux", ["far", "box"])
def test_what_hides_a_lamp(files, aux):
    threshold, _ = info(files["lamps"], *AUX[aux])
    x, n = points_and_normals(np.random.default_rng(63), 8)
    got = ilflight(files["lamps"], np.concatenate([x, n], 1), *AUX[aux], "--block", numbers(BLOCK), "--copies", 800)
    hidden = 0
    for k in range(len(x)):
        truth, free = integrals(FIELDS["lamps"], aux, x[k], n[k], threshold, (BLOCK, ()))
        check(got[k, :2], truth, 800, 1e-2)
        hidden += truth.sum() < .8 * free.sum()
    assert hidden >= 2, "the ball hides nothing"


@pytest.mark.parametrize("power", [5, 40, 400])
def test_narrow_lobes(files, power):
    threshold, _ = info(files["lamps"], *AUX["box"])
    rng = np.random.default_rng(64)
    x, _ = points_and_normals(rng, 3)
    to = np.array(small_room().lamps[0].c) - x + rng.normal(size=x.shape) * .3
    n = to / np.linalg.norm(to, axis=1)[:, None]
    got = ilflight(files["lamps"], np.concatenate([x, n], 1), *AUX["box"], "--power", power, "--copies", 500)
    for k in range(len(x)):
        check(got[k, :2], integral(FIELDS["lamps"], "box", x[k], n[k], threshold, power=power, grid=(400, 400) if power > 10 else (240, 300)), 500)


@pytest.mark.parametrize("grid, texels", [((1, 1), (8, 4)), ((3, 2), (7, 5))], ids=str)
@pytest.mark.parametrize("aux", ["far", "box"])
def test_white_furnace(tmp_path, grid, texels, aux):
    """Light of 1 from everywhere, a quarter of it base: what comes straight is three quarters of pi, or of 2 pi / (P + 1)."""
    f = ILF(np.ones((grid[1], grid[0], texels[1], texels[0], 3)), (-.5, -.5, 0), (1, 0, 0), (0, 1, 0))
    path = write_ilf(tmp_path / "white.ilf.exr", f)
    records = [[*x, 0, 0, 1] for x in ((0, 0, 0), (.3, -.4, .25), (-1, 1, .5))]
    for power in (1, 3, 50):
        got = ilflight(path, records, *AUX[aux], "--threshold", .25, "--power", power, "--copies", 500)
        truth = .75 * 2 * PI / (power + 1)
        for g in got:
            error, _ = check(g[:2], np.full(3, truth), 500, 1e-6)
            assert (error < .01 * truth).all()


# ---- by way of a mirror ball ---------------------------------------------------------------------------------

def mirrored(f, aux, x, n, threshold, balls=(), grid=(240, 240)):
    """What arrives at x from within the mirror ball's outline: the excess that its rays meet."""
    centre, r = np.array(MIRROR[:3]), MIRROR[3]
    axis = centre - x
    dist = np.linalg.norm(axis)
    axis = axis / dist
    u = np.cross(axis, [0, 0, 1.0] if abs(axis[2]) < .9 else [1.0, 0, 0])
    u /= np.linalg.norm(u)
    # rays evenly in the sine's square about the axis: even in projected area of the ball
    s2 = (np.arange(grid[1]) + .5) / grid[1] * (r / dist) ** 2
    t = (np.arange(grid[0]) + .5) * 2 * PI / grid[0]
    S, T = np.meshgrid(np.sqrt(s2), t, indexing="ij")
    d = (S * np.cos(T))[..., None] * u + (S * np.sin(T))[..., None] * np.cross(axis, u) + np.sqrt(1 - S * S)[..., None] * axis
    w = np.broadcast_to((r / dist) ** 2 / grid[1] * PI / grid[0] / np.sqrt(1 - s2)[:, None], S.shape)   # sin dsin = cos domega
    d, w = d.reshape(-1, 3), w.ravel() * np.maximum(d.reshape(-1, 3) @ n, 0)
    for ball in balls:
        w = np.where(blocked(x, d, ball), 0, w)
    b = d @ (x - centre)
    hit = x + (-b - np.sqrt(np.maximum(b * b - dist ** 2 + r * r, 0)))[:, None] * d
    normal = (hit - centre) / r
    out = d - 2 * (d * normal).sum(1)[:, None] * normal
    keep = (w > 0) & (out[:, 2] > 1e-9)
    return (rgb_excess(f, aux, hit[keep], out[keep], threshold) * w[keep, None]).sum(0)


@pytest.mark.parametrize("rough", [0, .02, .2])
@pytest.mark.parametrize("aux", ["far", "box"])
def test_glints_and_blind_rays_are_all_that_the_ball_shows(files, aux, rough):
    """Whatever cones the roughness asks for, the ball being a mirror: their sum is the integral."""
    threshold, _ = info(files["lamps"], *AUX[aux])
    rng = np.random.default_rng(65)
    x = np.array([(-.3, -.2, .02), (.05, .25, .1), (.7, .3, .35), (.36, -.12, .7)]) + rng.uniform(-.02, .02, (4, 3))
    to = np.array(MIRROR[:3]) - x
    n = to / np.linalg.norm(to, axis=1)[:, None] + rng.normal(size=x.shape) * .3
    n /= np.linalg.norm(n, axis=1)[:, None]
    copies = 600
    options = [*AUX[aux], "--mirror", numbers(MIRROR), "--rough", rough, "--copies", copies]
    got = ilflight(files["lamps"], np.concatenate([x, n], 1), *options, "--blind", 64)
    for k in range(len(x)):
        truth = mirrored(FIELDS["lamps"], aux, x[k], n[k], threshold)
        assert truth.sum() > 0
        check(got[k, 2:], truth, copies, 1e-2)


def test_glints_take_the_noise_away(files):
    """Blind rays alone, where libilf is told of no ball, are noisier at the same mean."""
    x = np.array([(-.3, -.2, .02), (.05, .25, .1)])
    to = np.array(MIRROR[:3]) - x
    n = to / np.linalg.norm(to, axis=1)[:, None]
    got = ilflight(files["lamps"], np.concatenate([x, n], 1), *AUX["box"], "--mirror", numbers(MIRROR), "--copies", 600)
    threshold, _ = info(files["lamps"], *AUX["box"])
    for k in range(2):
        truth = mirrored(FIELDS["lamps"], "box", x[k], n[k], threshold)
        spread = np.sqrt(got[k, 3] - got[k, 2] ** 2)
        omega = PI * (MIRROR[3] / np.linalg.norm(to[k])) ** 2
        assert (spread < .5 * truth).all(), (spread, truth, omega)


# ---- threads, and lighting within lighting -------------------------------------------------------------------

def test_threads_give_the_same_numbers(files):
    x, n = points_and_normals(np.random.default_rng(66), 40)
    options = [*AUX["box"], "--mirror", numbers(MIRROR), "--block", numbers(BLOCK), "--copies", 20, "--blind", 2, "--chunk", 5]
    one, two, five = (ilflight(files["lamps"], np.concatenate([x, n], 1), *options, "--threads", t) for t in (1, 2, 5))
    assert one.any() and (one == two).all() and (one == five).all()


def test_lighting_within_lighting(files):
    """A ray may light the points that it meets: what it interrupts is not disturbed."""
    x, n = points_and_normals(np.random.default_rng(67), 8)
    options = [*AUX["box"], "--block", numbers(BLOCK), "--copies", 40]
    plain, nested = (ilflight(files["lamps"], np.concatenate([x, n], 1), *options, *more) for more in ([], ["--nested"]))
    assert plain.any() and (plain == nested).all()


# ---- the library itself -----------------------------------------------------------------------------------------

def symbols(file, dynamic=False):
    """(class, name, section) of a library's symbols."""
    p = execute(["nm", "-f", "sysv", *(["-D"] if dynamic else []), str(file)], capture_output=True, text=True, check=True)
    rows = [[w.strip() for w in line.split("|")] for line in p.stdout.splitlines() if line.count("|") == 6]
    return [(r[2], r[0].split("@")[0], r[6]) for r in rows if r[0] != "Name"]


def library_file(name):
    p = execute(["gcc", f"-print-file-name={name}"], capture_output=True, text=True, check=True)
    return p.stdout.strip()


def test_libilf_needs_few_libraries_and_keeps_no_state():
    """libc, libm, pthread and OpenEXRCore (and OpenEXR's C interface in the one file that reads DWA): no renderer, no globals."""
    if BUILD.name == "san":
        pytest.skip("the sanitizers bring symbols of their own")
    found = symbols(BUILD / "lib" / "libilf.a")
    own = {name for kind, name, _ in found if kind in "TRDBVW"}
    needs = {name for kind, name, _ in found if kind == "U"} - own
    # constants with addresses in them are no state, nor is what each thread has of its own
    state = sorted(name for _, name, section in found if section in (".data", ".bss", "*COM*"))
    assert not state, f"writable data: {state}"
    for lib in ("libc.so.6", "libm.so.6", "libpthread.so.0", "libOpenEXRCore.so"):
        needs -= {name for kind, name, _ in symbols(library_file(lib), dynamic=True) if kind != "U"}
    assert {n for n in needs if not n.startswith("Imf")} <= {"_GLOBAL_OFFSET_TABLE_", "__cpu_model"}, sorted(needs)   # the latter is the compiler's own


def test_hosts_meet_libilf_in_one_file():
    """ray.h and ilf.h are both included in the adapter only, and libilf's own files include nothing of Radiance's."""
    both = []
    for f in sorted((TOP / "radiance_patch").glob("*.[ch]")):
        names = set(re.findall(r'^\s*#\s*include\s+"([^"]+)"', f.read_text(), re.M))
        if {"ray.h", "ilf.h"} <= names:
            both.append(f.name)
    assert both == ["m_ilf.c"]
