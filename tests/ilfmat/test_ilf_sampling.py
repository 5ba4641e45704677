"""libilf's sampler against its own density, and against the oracle: nothing bright may be missed.

Statistical tests have fixed seeds; the chance that a right program fails at another seed is at most 1e-6 per
test (statistics beyond 5 standard deviations, or the chi-square's upper 1e-6 tail).
"""
import subprocess

import numpy as np
import pytest

from conftest import driver, environment, sweep
from ilf_util import ILF, MIRROR_ARRAY_VALID, PI, POLAR_MAX, unit, write_ilf
from process import execute
from render_scene import LUMINANCE, small_room, smooth_room

UNIFORM = 0.02 / (2 * PI)      # the density that every direction has at least
BOX = (-3, -3, -0.1, 3, 3, 2.8)
BALL = (0.1, -0.2, 0.3, 4.0)
BULB = (0.6, 0.25, 1.3, 0.35)
AUX = {"far": ["--nodepth"], "box": ["--box", ",".join(map(str, BOX))], "ball": ["--sphere", ",".join(map(str, BALL))],
       "bulb": ["--box", ",".join(map(str, BOX)), "--ball", ",".join(map(str, BULB))]}


def ilfdraw(what, path, rows, width, *options, code=0):
    p = execute([driver("ilfdraw"), what, str(path), *map(str, options)], input=np.asarray(rows, float).tobytes(),
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment())
    assert p.returncode == code, p.stderr.decode()
    return np.frombuffer(p.stdout, "<f8").reshape(-1, width) if code == 0 else p.stderr.decode()


def sample(path, points, u, *options):
    return ilfdraw("sample", path, np.concatenate([np.broadcast_to(points, u.shape), u], 1), 6, *options)


def density(path, points, d, *options):
    return ilfdraw("pdf", path, np.concatenate([np.broadcast_to(points, d.shape), d], 1), 1, *options)[:, 0]


def info(path, *options):
    p = execute([driver("ilfdraw"), "info", str(path), *map(str, options)], stdout=subprocess.PIPE, check=True, env=environment())
    threshold, patches = p.stdout.split()
    return float(threshold), int(patches)


def hemisphere(rng, n):
    """Directions over the hemisphere, even in solid angle, stratified: sample k lies in its own one of n strips of height."""
    z = 1 - (np.arange(n) + rng.uniform(size=n)) / n
    t = 2 * PI * ((np.arange(n) * 0.6180339887498949) % 1 + rng.uniform(size=n) / np.sqrt(n))
    s = np.sqrt(1 - z * z)
    return np.stack([s * np.cos(t), s * np.sin(t), z], -1)


# ---- light fields --------------------------------------------------------------------------------------------

def lamps_field(kind="hemisphere"):
    return small_room().light_field(5, 4, 48, 24, polar_max=POLAR_MAX[kind])


def one_texel(i, j, x, y, n=(4, 3), texels=(16, 12), kind="hemisphere", valid=None, size=(1.5, 1.0)):
    """Dark but for texel (x, y) of probe (i, j)."""
    f = ILF(np.full((n[1], n[0], texels[1], texels[0], 3), 0.01), (-size[0] / 2, -size[1] / 2, 0), (size[0], 0, 0), (0, size[1], 0),
            POLAR_MAX[kind], valid)
    f.probes[j, i, y, x] = (900, 1000, 800)
    return f


SPARSE = {
    "inside": one_texel(1, 1, 5, 4), "corner probe": one_texel(3, 2, 5, 4), "pole": one_texel(1, 2, 3, 0),
    "seam left": one_texel(0, 1, 0, 6), "seam right": one_texel(2, 1, 15, 6), "horizon": one_texel(1, 1, 9, 11),
    "185 degrees": one_texel(1, 1, 7, 11, kind="185deg"), "full sphere": one_texel(2, 0, 7, 5, kind="sphere"),
    "full sphere, pole": one_texel(2, 0, 7, 0, kind="sphere"),
    "last valid row": one_texel(1, 1, 4, 10, valid=MIRROR_ARRAY_VALID), "1x1": one_texel(0, 0, 11, 3, (1, 1)),
    "1x1, pole": one_texel(0, 0, 11, 0, (1, 1)), "1x5": one_texel(0, 3, 2, 8, (1, 5)), "5x1": one_texel(2, 0, 13, 7, (5, 1)),
    "odd": one_texel(1, 0, 2, 3, (2, 3), (7, 5)), "one texel wide": one_texel(1, 1, 0, 3, (2, 2), (1, 6)),
    "one texel high": one_texel(1, 1, 2, 0, (2, 2), (6, 1)), "one texel in all": one_texel(1, 0, 0, 0, (3, 2), (1, 1)),
    "long plane": one_texel(3, 1, 5, 7, size=(4.4, 0.3)),
}
FIELDS = {"lamps": lamps_field(), "lamps, 185 degrees": lamps_field("185deg"), "lamps, sphere": lamps_field("sphere"), **SPARSE}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fields")
    return {name: write_ilf(folder / f"{k}.ilf.exr", f) for k, (name, f) in enumerate(FIELDS.items())}


def way_out(aux, o, d):
    """Where rays from o leave the auxiliary geometry; None at infinity."""
    if aux == "far":
        return None
    if aux == "ball":
        w = o - np.array(BALL[:3])
        b, c = (w * d).sum(1), (w * w).sum(1) - BALL[3] ** 2
        return o + (-b + np.sqrt(b * b - c))[:, None] * d
    with np.errstate(divide="ignore"):
        t = (np.where(d > 0, BOX[3:], BOX[:3]) - o) / d
    t = np.where(np.isfinite(t), t, np.inf).min(1)
    if aux == "bulb":
        w = o - np.array(BULB[:3])
        b = (w * d).sum(1)
        disc = b * b - (w * w).sum(1) + BULB[3] ** 2
        front = -b - np.sqrt(np.maximum(disc, 0))
        t = np.where((disc > 0) & (front > 0) & (front < t), front, t)
    return o + t[:, None] * d


def excess(f, aux, x, d, threshold):
    """By the oracle: d in the plane's coordinates, which are the world's here."""
    # without depth correction any hit point on the ray gives the same lookup: the point itself
    h = way_out(aux, x, d)
    value = f.eval(x, d, x if h is None else h, aux != "far") @ LUMINANCE
    return np.maximum(value - threshold, 0)


def aimed_rays(rng, f, aux, n, low=0.0, high=1.2, spots=0):
    """Rays from all over the space above the plane, or from so many spots in it, towards where some probe has its bright texels."""
    j, i, y, x = np.nonzero((f.probes @ LUMINANCE) > 3 * (f.probes @ LUMINANCE).mean())
    k = rng.integers(len(j), size=n)
    theta = -PI + (x[k] + rng.uniform(-0.5, 1.5, n)) * 2 * PI / f.n_theta
    phi = np.clip((y[k] + rng.uniform(-0.5, 1.5, n)) * f.polar_max / f.n_phi, 0, PI / 2 - 1e-4)
    d = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], -1)
    q = f.node(i[k], j[k])
    points = np.stack([rng.uniform(-1, 1, n), rng.uniform(-0.8, 0.8, n), rng.uniform(low, high, n)], -1)
    # half of them along the plane's own rays, or the narrow weights of far-off probes are hardly met
    own = rng.uniform(size=n) < (0 if spots else 0.5)
    if spots:
        points = points[rng.integers(spots, size=n)]
    off = rng.uniform(-1, 1, (n, 2)) * [np.linalg.norm(f.U) / max(f.n_u - 1, 1), np.linalg.norm(f.V) / max(f.n_v - 1, 1)]
    foot = q + np.concatenate([off, np.zeros((n, 1))], 1)
    if aux == "far":
        inside = foot + d * (points[:, 2:] / d[:, 2:])
    else:
        h = way_out(aux, q, d)
        inside = foot + rng.uniform(0, 0.9, (n, 1)) * (h - foot)
        d = np.where(own[:, None], unit(h - inside), unit(h - points))
    good = (np.abs(inside) < 2.5).all(1) & own
    points = np.where(good[:, None], inside, points)
    keep = (d[:, 2] > 1e-6) & (np.abs(points) < 2.7).all(1) & (points[:, 2] > -0.09)
    return points[keep], d[keep]


def around(rng, points, d):
    """The same points with other directions near by: from 0.0005 to 0.5 off, to meet what narrow and what broad patches leave out."""
    d = unit(d + unit(rng.normal(size=d.shape)) * 10 ** rng.uniform(-3.3, -0.3, (len(d), 1)))
    keep = d[:, 2] > 1e-6
    return points[keep], d[keep]


# ---- the draw and its density -------------------------------------------------------------------------------

DRAWN = ["lamps", "lamps, 185 degrees", "inside", "pole", "seam left", "horizon", "full sphere", "1x1", "1x5", "odd", "one texel in all"]


def point_with_light(name, path, *options):
    """A point that sees light by the oracle."""
    threshold = info(path, *options)[0]
    points, d = aimed_rays(np.random.default_rng(5), FIELDS[name], "far", 200)
    return points[np.argmax(excess(FIELDS[name], "far", points, d, threshold) > 1e-4 * threshold)]


@pytest.mark.parametrize("name", DRAWN)
def test_density_belongs_to_the_draw(files, name):
    """What ilf_sample says of its direction is what ilf_pdf says, the direction is a unit vector above the plane."""
    rng = np.random.default_rng(10)
    x = point_with_light(name, files[name], *AUX["far"])
    r = sample(files[name], x, rng.uniform(size=(5000, 3)), *AUX["far"])
    assert (r[:, 3] >= UNIFORM).all() and (r[:, 2] > 0).all()
    assert np.allclose(np.linalg.norm(r[:, :3], axis=1), 1, atol=1e-12)
    p = density(files[name], x, r[:, :3], *AUX["far"])
    assert (np.abs(p - r[:, 3]) <= 1e-9 * p).mean() > 0.9999


def cells(rng, side=256):
    """A direction from each of the cells of equal solid angle in which the density is constant: Shirley and Chiu's square (1997)."""
    k = np.arange(side)
    a, b = ((q.ravel() + rng.uniform(0.01, 0.99, side * side)) * 2 / side - 1 for q in np.meshgrid(k, k))
    across = np.abs(a) <= np.abs(b)
    r = np.where(across, b, a)
    t = np.where(across, a, b) / np.where(r == 0, 1, r) * PI / 4
    s = r * np.sqrt(2 - r * r)
    return np.stack([s * np.where(across, np.sin(t), np.cos(t)), s * np.where(across, np.cos(t), np.sin(t)), 1 - r * r], -1)


@pytest.mark.parametrize("name", DRAWN)
def test_integrals_of_the_density(files, name):
    """The density's integral is 1; the mean of 1/density over draws is the hemisphere's solid angle."""
    rng = np.random.default_rng(11)
    x = point_with_light(name, files[name], *AUX["far"])
    assert abs(density(files[name], x, cells(rng), *AUX["far"]).mean() * 2 * PI - 1) < 1e-5
    r = sample(files[name], x, rng.uniform(size=(60000, 3)), *AUX["far"])
    w = 1 / r[:, 3]
    assert abs(w.mean() - 2 * PI) < 5 * w.std() / np.sqrt(len(w)), w.mean()


@pytest.mark.parametrize("name", DRAWN)
def test_chi_square_of_draws_against_density(files, name):
    """Draws in bins of height and azimuth against the density's integral over each, which has an error of its own."""
    scipy_free_limit = 4.75     # normal quantile of 1e-6
    rng = np.random.default_rng(12)
    x = point_with_light(name, files[name], *AUX["far"])
    n, bins = 50000, (24, 36)

    def bin_of(d):
        a = np.minimum((d[:, 2] * bins[0]).astype(int), bins[0] - 1)
        b = ((np.arctan2(d[:, 1], d[:, 0]) + PI) / (2 * PI) * bins[1]).astype(int) % bins[1]
        return a * bins[1] + b
    size = bins[0] * bins[1]
    d = hemisphere(rng, 1 << 18)
    p = density(files[name], x, d, *AUX["far"])
    k = bin_of(d)
    count = np.bincount(k, minlength=size)
    omega = 2 * PI / size
    mean = np.bincount(k, p, size) / count
    var = (np.bincount(k, p * p, size) / count - mean ** 2) / (count - 1)
    expected, error = n * omega * mean, (n * omega) ** 2 * np.maximum(var, 0)
    found = np.bincount(bin_of(sample(files[name], x, rng.uniform(size=(n, 3)), *AUX["far"])), minlength=size)
    # bins with less than 5 expected are merged: the statistic's distribution is not a chi-square below that
    few = expected < 5
    e = np.append(expected[~few], expected[few].sum())
    s = np.append(error[~few], error[few].sum())
    o = np.append(found[~few], found[few].sum())
    e, s, o = (a[e > 0] for a in (e, s, o))
    chi = ((o - e) ** 2 / (e + s)).sum()
    dof = len(e) - 1
    # Wilson and Hilferty: the cube root of chi-square over its degrees is nearly normal
    z = ((chi / dof) ** (1 / 3) - (1 - 2 / (9 * dof))) / np.sqrt(2 / (9 * dof))
    assert z < scipy_free_limit, (chi, dof)


def test_draws_run_along_the_map(files):
    """Neighbours in u are mostly neighbours in direction: the map's order spreads chosen candidates."""
    x = point_with_light("lamps", files["lamps"], *AUX["far"])
    u = np.stack([np.linspace(0.02, 1, 4000, endpoint=False), np.full(4000, 0.5), np.full(4000, 0.5)], 1)
    d = sample(files["lamps"], x, u, *AUX["far"])[:, :3]
    step = np.arccos(np.clip((d[1:] * d[:-1]).sum(1), -1, 1))
    shuffled = np.random.default_rng(0).permutation(d)
    assert np.median(step) < 0.05 and step.mean() < 0.2 * np.arccos(np.clip((shuffled[1:] * shuffled[:-1]).sum(1), -1, 1)).mean()


# ---- nothing bright is missed ---------------------------------------------------------------------------------

# something before the wall: a patch may lie half on it
ROUNDS = [(name, aux) for name in FIELDS for aux in AUX if aux != "bulb" or name in ("lamps", "lamps, 185 degrees", "inside", "1x1", "odd")]


@pytest.mark.parametrize("name, aux", ROUNDS)
def test_no_direction_with_excess_is_missed(files, name, aux):
    """Wherever the oracle finds more than the threshold, the density exceeds its uniform part."""
    f, options = FIELDS[name], AUX[aux]
    rng = np.random.default_rng(20)
    threshold, patches = info(files[name], *options)
    assert patches > 0
    # the map of a point costs most: 32 points anywhere that see light, and a few spots, each with many directions; the sweep below
    # takes 100,000 points
    x, d = aimed_rays(rng, f, aux, 2000)
    seen = np.flatnonzero(excess(f, aux, x, d, threshold) > 1e-4 * threshold)[:32]
    assert len(seen) > 30, "the rays miss what is tested"
    near = around(rng, np.repeat(x[seen], 96, 0), np.repeat(d[seen], 96, 0))
    x, d = (np.concatenate(a) for a in zip((x[seen], d[seen]), near, aimed_rays(rng, f, aux, 12000, spots=6)))
    e = excess(f, aux, x, d, threshold)
    lit = e > 1e-4 * threshold
    assert lit.sum() > 200, "the rays miss what is tested"
    x, d, e = x[lit], d[lit], e[lit]
    p = density(files[name], x, d, *options)
    missed = p <= UNIFORM * (1 + 1e-6)
    assert not missed.any(), (missed.sum(), lit.sum(), x[missed][:3], d[missed][:3], e[missed][:3], threshold)


@pytest.mark.sweep
def test_no_direction_with_excess_is_missed_by_far(files):
    def compare(name, aux, cube):
        f, options = FIELDS[name], [*AUX[aux], "--cube", cube]
        rng = np.random.default_rng(21)
        threshold, _ = info(files[name], *options)
        for low, high in ((-0.09, 0.05), (0, 0.3), (0, 2.6)):
            x, d = aimed_rays(rng, f, aux, 100000, low, high)
            e = excess(f, aux, x, d, threshold)
            lit = e > 1e-4 * threshold
            p = density(files[name], x[lit], d[lit], *options)
            missed = p <= UNIFORM * (1 + 1e-6)
            assert not missed.any(), (low, high, missed.sum(), lit.sum(), x[lit][missed][:3], d[lit][missed][:3], e[lit][missed][:3])
    sweep(compare, [(name, aux, cube) for name, aux in ROUNDS for cube in (0, 0.1, 0.5)])


def test_light_shows_on_what_stands_behind_a_lamp(tmp_path):
    """A lookup asks for the direction from the probe to where the ray ends: on the ceiling beyond a lamp that hangs free it finds the lamp."""
    room, rng, n = small_room(), np.random.default_rng(24), 4000
    f = room.light_field(1, 1, 192, 96)
    lamp, height = room.lamps[0], 6.0
    path = write_ilf(tmp_path / "one.ilf.exr", f)
    options = ["--box", f"-4,-4,-.1,4,4,{height}", "--ball", ",".join(map(str, [*lamp.c, lamp.r]))]
    q = f.node(np.zeros(n, int), np.zeros(n, int))
    d = unit(lamp.c + rng.uniform(-0.5, 0.5, (n, 3)) * lamp.r - q)
    h = q + d * (height / d[:, 2:])
    x = np.tile(rng.uniform((-2, -2, 0), (2, 2, 1), (80, 3)), (n // 80, 1))      # a map costs more than a ray
    d = unit(h - x)
    w = lamp.c - x
    clear = np.linalg.norm(w - (w * d).sum(1)[:, None] * d, axis=1) > 1.1 * lamp.r
    e = np.maximum(f.eval(x, d, h, True) @ LUMINANCE - info(path, *options)[0], 0)
    assert (clear & (e > 0)).sum() > 1000, "the rays miss what is tested"
    p = density(path, x, d, *options)[clear & (e > 0)]
    assert (p > UNIFORM * (1 + 1e-6)).all(), (p <= UNIFORM * (1 + 1e-6)).mean()


def test_distance_is_about_right(files):
    """In the box, where a patch's light comes from is where the ray leaves the box."""
    f, options = FIELDS["lamps"], AUX["box"]
    rng = np.random.default_rng(23)
    x, _ = aimed_rays(rng, f, "box", 20000, spots=80)
    r = sample(files["lamps"], x, rng.uniform(size=(len(x), 3)), *options)
    known = np.isfinite(r[:, 4]) & (r[:, 3] > 0)
    true = np.linalg.norm(way_out("box", x[known], r[known, :3]) - x[known], axis=1)
    assert known.sum() > 5000
    ratio = r[known, 4] / true
    assert np.median(np.abs(np.log(ratio))) < 0.15 and (np.abs(np.log(ratio)) < 1).mean() > 0.95


# ---- what is bright ---------------------------------------------------------------------------------------------

def test_smooth_light_has_nothing_bright(tmp_path):
    path = write_ilf(tmp_path / "smooth.ilf.exr", smooth_room().light_field(3, 3, 16, 8))
    assert info(path)[1] == 0
    assert (density(path, np.zeros(3), hemisphere(np.random.default_rng(0), 100)) == -1).all()


def test_black_field_has_nothing_bright(tmp_path):
    path = write_ilf(tmp_path / "black.ilf.exr", ILF(np.zeros((2, 2, 4, 8, 3))))
    assert info(path) == (0, 0)


def test_texels_beyond_polar_valid_are_not_bright(tmp_path):
    """Lookups never see them."""
    f = one_texel(1, 1, 4, 11, valid=PI / 3)
    assert info(write_ilf(tmp_path / "beyond.ilf.exr", f))[1] == 0


def test_threshold_is_three_times_the_mean_unless_given(files, tmp_path):
    f = smooth_room().light_field(1, 1, 32, 16)
    y = (np.arange(17)) * PI / 2 / 16
    mean = ((f.probes[0, 0] @ LUMINANCE).mean(1) * (np.cos(y[:-1]) - np.cos(y[1:]))).sum()
    assert np.isclose(info(write_ilf(tmp_path / "s.ilf.exr", f))[0], 3 * mean, rtol=1e-6)
    assert info(files["lamps"], "--threshold", 1e4) == (1e4, 0)
    assert info(files["lamps"], "--threshold", 7.5)[0] == 7.5


def test_lamps_are_found(files):
    """In the box, seen from its middle: both lamps, the brightest first, in their true directions."""
    room = small_room()
    here = np.array([0.3, -0.1, 0.1])
    r = ilfdraw("lamps", files["lamps"], [[*here, 0.05]], 41, *AUX["box"])[0]
    n, lamps = int(r[0]), r[1:].reshape(8, 5)
    assert n >= 2
    for lamp in room.lamps:
        to = unit(lamp.c - here)
        angles = [np.arccos(np.clip(to @ unit(k[:3] - here), -1, 1)) for k in lamps[:n]]
        assert min(angles) < 0.25, np.rad2deg(angles)
    assert (np.diff(lamps[:n, 4]) <= 0).all() and (lamps[:n, 3] > 0).all()


def test_points_that_are_not_finite_are_refused(files):
    for bad in (np.nan, np.inf, 1e300):
        words = ilfdraw("pdf", files["lamps"], [[bad, 0, 0, 0, 0, 1]], 1, code=1)
        assert words.startswith("ilfdraw: point: expected finite coordinates"), words


def test_far_corners_of_space_are_answered(files):
    """Far above, below and beside the plane: a density or no slice, never NaN."""
    rng = np.random.default_rng(30)
    x = rng.normal(size=(300, 3)) * 10.0 ** rng.integers(-3, 9, (300, 1))
    p = density(files["lamps"], x, hemisphere(rng, 300), *AUX["far"])
    assert np.isfinite(p).all() and ((p == -1) | (p >= UNIFORM)).all()
