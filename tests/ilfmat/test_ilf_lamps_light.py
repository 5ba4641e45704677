"""libilf's estimator where lamps were taken out of the field: its mean against numpy's integrals, its noise, what base and excess are."""
import numpy as np
import pytest
from ilf_util import ILF, PI, Lamp, random_ilf, unit, write_ilf
from render_scene import LUMINANCE
from test_ilf_lamps import masks_of
from test_ilf_light import blocked, check, ilflight, numbers, rgb_excess, sphere_grid
from test_ilf_sampling import AUX, info, way_out

RNG = np.random.default_rng(1900)
BLOCK = (.1, 0, .9, .2)
PLACE = dict(plane=((-.6, -.5, 0), (1.2, 0, 0), (0, 1, 0)))
MADE = masks_of(RNG)


def four(**masks):
    """A lamp of each shape, within the box; masks by the shape's name."""
    a, b = np.linalg.qr(RNG.normal(size=(3, 3)))[0][:2]
    made = dict(sphere=dict(c=(.9, .6, 2.1), radius=.2), rectangle=dict(c=(-.4, .5, 1.7), a=a * .2, b=b * .15), disc=dict(c=(1.5, .2, 1.9), a=a * .2, b=b * .1),
                tube=dict(c=(.6, -.3, 1.6), a=(.2, .05, .1), radius=.06))
    return [Lamp(shape, rgb=RNG.uniform(20, 90, 3), masks=masks.get(shape, ()), **how) for shape, how in made.items()]


def residual(bright):
    f = random_ilf(RNG, 4, 3, 24, 12, **PLACE)
    f.probes = f.probes / f.probes.mean()
    if bright:                                 # something in the texels is worth aiming at, too: beside the lamps and behind them
        f.probes[:, :, 0:3] += 30
    return f


FIELDS = {
    "open": (residual(False), four()),
    "masked": (residual(False), four(sphere=[MADE["layer"]], rectangle=[MADE["gate"], MADE["foot"]], disc=[MADE["stack"]], tube=[MADE["beam"], MADE["ball"]])),
    "bright texels too": (residual(True), four(sphere=[MADE["foot-beam"]])),
    "one behind another": (residual(False), [Lamp("sphere", (.5, .5, 2.1), (60, 20, 9), radius=.25), Lamp("disc", (.5, .5, 1.6), (9, 30, 40), a=(.15, 0, 0), b=(0, .15, 0))]),
}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lamps")
    out = {}
    for name, (f, lamps) in FIELDS.items():
        f.lamps = lamps
        out[name] = write_ilf(folder / f"{name.replace(' ', '-')}.ilf.exr", f)
    return out


def without_lamps(f):
    left = ILF.__new__(ILF)
    left.__dict__ = {**f.__dict__, "lamps": ()}
    return left


def towards(lamp, f, x, n):
    """Directions that hold the lamp as seen from x, evenly, and the solid angle that each stands for."""
    e = f.origin + lamp.c @ f.frame() - x
    far = np.linalg.norm(e)
    z = np.sqrt(1 - min((lamp.radius + np.linalg.norm(lamp.a) + np.linalg.norm(lamp.b)) / far, 1) ** 2)
    k = np.arange(n) + .5
    cos, phi = 1 - k / n * (1 - z), k * PI * (3 - 5 ** .5)
    w = e / far
    u = unit(np.cross(w, (.1, .9, .3)))
    s = np.sqrt(1 - cos * cos)[:, None]
    return cos[:, None] * w + s * (np.cos(phi)[:, None] * u + np.sin(phi)[:, None] * np.cross(w, u)), 2 * PI * (1 - z) / n


def first_lamp(f, x, d):
    """Number of the lamp that each direction meets first from x, -1 for none."""
    o = np.broadcast_to((x - f.origin) @ f.frame().T, d.shape)
    t = np.stack([lamp.met(o, d @ f.frame().T) for lamp in f.lamps])
    return np.where(np.isfinite(t.min(0)), t.argmin(0), -1)


def integral(f, aux, x, n, threshold, balls=(), bright=True, rays=12000):
    """The excess that comes to x: of bright texels between lamps, and of each lamp where it is the first."""
    left, total = without_lamps(f), np.zeros(3)

    def arriving(d, w, excess):
        keep = (d @ n > 0) & (d @ f.frame()[2] > 0)
        for ball in balls:
            keep &= ~blocked(x, d, ball)
        d, w = d[keep], w[keep]
        return (excess(np.broadcast_to(x, d.shape), d) * ((d @ n) * w)[:, None]).sum(0)

    def of_texels(o, d):
        return rgb_excess(left, aux, o, d, threshold)

    def of_all(o, d):
        h = way_out(aux, o, d)
        return f.eval(o, d, h, aux != "far") - left.eval(o, d, h, aux != "far") + of_texels(o, d)

    d, w = sphere_grid(240, 300, PI / 2)
    for part in np.array_split(np.arange(len(d)), 8) if bright else ():
        between = part[first_lamp(f, x, d[part]) < 0]
        total += arriving(d[between], w[between], of_texels)
    for k, lamp in enumerate(f.lamps):
        d, w = towards(lamp, f, x, rays)
        d = d[first_lamp(f, x, d) == k]
        total += arriving(d, np.full(len(d), w), of_all)
    return total


def points(n):
    rng = np.random.default_rng(1901)
    x = np.stack([rng.uniform(-.4, .4, n), rng.uniform(-.3, .3, n), rng.uniform(.02, .5, n)], -1)
    return x, unit(rng.normal(size=(n, 3)) * .4 + (0, 0, 1))


@pytest.mark.parametrize("aux", ["box", "far"])
@pytest.mark.parametrize("name", FIELDS)
def test_mean_is_the_integral(files, name, aux):
    f = FIELDS[name][0]
    threshold, n_bright = info(files[name], *AUX[aux])
    assert n_bright >= len(f.lamps)
    x, n = points(3)
    got = ilflight(files[name], np.concatenate([x, n], 1), *AUX[aux], "--block", numbers(BLOCK), "--copies", 600)
    for k in range(len(x)):
        check(got[k, :2], integral(f, aux, x[k], n[k], threshold, [BLOCK], n_bright > len(f.lamps)), 600)


@pytest.mark.parametrize("options", [("--samples", 1), ("--samples", 128), ("--weight", .02), ("--power", 60)], ids=lambda o: " ".join(map(str, o)))
def test_any_number_of_samples_has_the_same_mean(files, options):
    x, n = points(3)
    records = np.concatenate([x, n], 1)
    many, few = (ilflight(files["masked"], records, *AUX["box"], "--block", numbers(BLOCK), "--copies", 1500, *o)
                 for o in (("--samples", 32, *(options if "--power" in options else ())), options))
    for k in range(len(x)):
        check(few[k, :2], many[k, 0], 1500, least=1e-3 * many[k, 0].max() + 5 * np.sqrt((many[k, 1] - many[k, 0] ** 2).max() / 1500))


@pytest.mark.parametrize("samples, most", [(1, .05), (16, .02)])
def test_lamps_that_nothing_hides_make_next_to_no_noise(files, samples, most):
    """Four lamps of other colours at one ray each: exact but for how a lamp's cosine varies over it, and a tube's outline."""
    x, n = points(6)
    got = ilflight(files["open"], np.concatenate([x, n], 1), *AUX["box"], "--copies", 300, "--samples", samples)
    noise = np.sqrt(np.maximum(got[:, 1] - got[:, 0] ** 2, 0)) / got[:, 0]
    assert (noise < most).all(), noise


def test_texels_and_lamps_are_what_the_field_shows(files):
    """Base and excess of a ray add up to what a lookup gives, and the base knows no lamp."""
    f = FIELDS["masked"][0]
    threshold, _ = info(files["masked"], *AUX["box"])
    left = without_lamps(f)
    x, n = points(1)
    d, _ = towards(f.lamps[0], f, x[0], 2000)
    o = np.broadcast_to(x[0], d.shape)
    h = way_out("box", o, d)
    rest = left.eval(o, d, h) @ LUMINANCE
    assert (f.eval(o, d, h) @ LUMINANCE > 5 * threshold).any() and (rest <= threshold * 1.0001).all()
