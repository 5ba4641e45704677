"""The material where Radiance's own numbers are hard: far from the origin, tiny, huge."""
import numpy as np
import pytest

from conftest import run
from ilf_util import f32, random_ilf, unit, write_ilf
from stability.test_lookup import Precise


def sphere_hits(o, d, centre, radius):
    L = np.longdouble
    o, d, w = np.asarray(o, L), np.asarray(d, L), np.asarray(o, L) - np.asarray(centre, L)
    d = d / np.sqrt((d * d).sum(1))[:, None]
    b = (w * d).sum(1)
    t = -b + np.sqrt(b * b - (w * w).sum(1) + L(radius) ** 2)
    return o + t[:, None] * d


def traced(folder, offset, scale, n=1500):
    rng = np.random.default_rng(1)
    g = random_ilf(rng, 5, 4, 24, 8, decades=0.6, plane=((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    write_ilf(folder / "f.ilf.exr", g)
    p = Precise(g.probes, polar_max=g.polar_max)
    shift = np.array([1, -1, .5]) * offset
    p.origin, p.U, p.V = shift + np.array([-.5, -.5, 0]) * scale, np.array([1., 0, 0]) * scale, np.array([0, 1., 0]) * scale
    centre, radius = shift + np.array([0, 0, .2]) * scale, 3 * scale
    reals = " ".join(f"{x:.17g}" for x in [*p.origin, *p.U, *p.V])
    (folder / "s.rad").write_text(f"void ilf env\n1 f.ilf.exr\n0\n9 {reals}\nenv bubble b\n0\n0\n4 {' '.join(f'{x:.17g}' for x in centre)} {radius:.17g}\n")
    (folder / "s.oct").write_bytes(run("oconv", "s.rad", cwd=folder).out)
    o = shift + np.stack([*rng.uniform(-.4, .4, (2, n)), rng.uniform(.01, .3, n)], -1) * scale
    d = unit(np.stack([*rng.normal(size=(2, n)), rng.uniform(.3, 1.5, n)], -1))
    text = "".join(" ".join(f"{x:.17g}" for x in r) + "\n" for r in np.concatenate([o, d], 1))
    got = np.array(run("rtrace", "-h", "-w", "-ab", "0", "-di", "0", "-fa", "s.oct", stdin=text, cwd=folder).text.split(), float).reshape(-1, 3)
    h = sphere_hits(o, d, centre, radius)
    return got, p.eval(o, d, h)


@pytest.mark.parametrize("offset", [0, 1e2, 1e4, 1e6])
@pytest.mark.case("rtrace far from the world's origin", "radiance_patch/m_ilf.c", "offset / size of the plane", "error grows no faster than eps x offset")
def test_offset(tmp_path, offset, row):
    """The printed 7 digits, and what rounding of positions (2^-52 of the offset, some of it at the hit) does through a lookup of
    24/2pi texels a radian, a probe each 1/4."""
    got, true = traced(tmp_path, offset, 1)
    error = np.abs(got / true - 1).max()
    bound = 2e-6 + 256 * 2.0 ** -52 * offset * 24
    row(condition=f"offset {offset:g}", error=f"{error:.1e} <= {bound:.1e}", result="double suffices")
    assert error <= bound


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3, 1e6])
@pytest.mark.case("rtrace of a scaled scene", "radiance_patch/m_ilf.c", "scale", "the same radiance to 1e-4")
def test_scale(tmp_path, scale, row):
    got, true = traced(tmp_path, 0, scale)
    error = np.abs(got / true - 1).max()
    row(condition=f"scale {scale:g}", error=f"{error:.1e} <= 1e-4")
    assert error <= 1e-4


@pytest.mark.case("rtrace of a scene below Radiance's own resolution", "radiance_patch/m_ilf.c", "scale 1e-6", "Radiance's tolerance (1e-6) is absolute: the same, or black")
def test_scale_below_radiance(tmp_path, row):
    """Radiance takes distances under 1e-6 for none: that is the host's, whatever the material.  What is seen at all is right."""
    got, true = traced(tmp_path, 0, 1e-6)
    seen = got.any(axis=1)
    error = np.abs(got[seen] / true[seen] - 1).max() if seen.any() else 0
    row(result=f"{seen.mean():.0%} of rays meet the bubble of radius 3e-6", error=f"{error:.1e} <= 1e-4 of those")
    assert np.isfinite(got).all() and error <= 1e-4
