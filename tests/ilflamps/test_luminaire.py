"""Lamps' bodies (ilfmat/lamps): their solid angles three ways, and directions drawn towards them."""
import numpy as np
import pytest
from conftest import BUILD
from process import execute

SPHERE, RECTANGLE, DISC, TUBE = range(4)


def ask(shape, centre, a=(0, 0, 0), b=(0, 0, 0), radius=0., eye=(0, 0, 0)):
    line = " ".join(map(repr, map(float, [*centre, *a, *b, radius, *eye])))
    r = execute([BUILD / "test" / "luminaire"], input=f"{shape} {line}\n", capture_output=True, text=True, check=True)
    return dict(zip("omega shot drawn missed least most".split(), map(float, r.stdout.split())))


def turned(rng):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q


def bodies():
    rng = np.random.default_rng(5)
    for k in range(6):
        e, c = turned(rng), np.r_[rng.uniform(-1, 1, 2), rng.uniform(1, 3)]
        s, t = rng.uniform(.02, .5, 2)
        yield SPHERE, dict(centre=c, radius=s)
        yield RECTANGLE, dict(centre=c, a=e[0] * s, b=e[1] * t)
        yield DISC, dict(centre=c, a=e[0] * s, b=e[1] * s)
        yield TUBE, dict(centre=c, a=e[0] * s, radius=.1 * t)


@pytest.mark.parametrize("shape, body", list(bodies()))
def test_solid_angle_by_formula_by_rays_and_by_draws(shape, body):
    v = ask(shape, **body)
    assert v["shot"] == pytest.approx(v["omega"], rel=.02)             # 160000 rays, of which a slim body gets few
    # a tube's outline is cut out of a rectangle: its omega is the cylinder's middle line to first order
    assert v["drawn"] == pytest.approx(v["omega"], rel=.02 if shape == TUBE else 2e-3)
    assert v["missed"] < 1e-3
    if shape in (SPHERE, RECTANGLE):
        assert v["least"] == pytest.approx(1, abs=1e-6) and v["most"] == pytest.approx(1, abs=1e-6)


def test_closed_forms():
    ball = ask(SPHERE, (0, 0, 2), radius=.3)
    assert ball["omega"] == pytest.approx(2 * np.pi * (1 - np.sqrt(1 - .15 ** 2)), rel=1e-8)
    plate = ask(RECTANGLE, (0, 0, 1.5), a=(.4, 0, 0), b=(0, .7, 0))
    x, y, z = .4, .7, 1.5
    assert plate["omega"] == pytest.approx(4 * np.arctan(x * y / (z * np.sqrt(x * x + y * y + z * z))), rel=1e-8)
    disc = ask(DISC, (0, 0, 1.5), a=(.4, 0, 0), b=(0, .4, 0))
    assert disc["omega"] == pytest.approx(2 * np.pi * (1 - 1.5 / np.hypot(1.5, .4)), rel=1e-3)
