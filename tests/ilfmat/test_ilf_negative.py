"""Values below 0: kept, looked up as they are by every estimator, never aimed at; no NaN, and -di N converges to what -di 0 gives."""
import re

import numpy as np
import pytest

from conftest import run
from ilf_util import ILF, random_directions, random_ilf, rays_text, assert_same, unit, write_ilf
from test_ilf_sampling import info

SCENE = """void ilf room
1 f.ilf.exr
0
0

room bubble b
0
0
4 0 0 0 8

void plastic w
0
0
5 .6 .5 .4 0 0

void plastic glossy
0
0
5 .6 .5 .4 .1 .1

w polygon floor
0
0
12 -3 -3 0 0 -3 0 0 3 0 -3 3 0

glossy polygon shiny_floor
0
0
12 0 -3 0 3 -3 0 3 3 0 0 3 0
"""


def base():
    return random_ilf(np.random.default_rng(71), 4, 4, 32, 16, decades=1, plane=((-1, -1, 0), (2, 0, 0), (0, 2, 0)))


def fields():
    def of(change):
        f = base()
        change(f.probes)
        return f

    def mean_below_0(p):
        p -= 1.5 * p.mean()

    def noise_about_0(p):
        p[...] = np.random.default_rng(72).normal(size=p.shape)

    def mean_0(p):
        p[:, :, :, ::2], p[:, :, :, 1::2] = 1, -1

    def zero(p):
        p[...] = 0

    def all_below_0(p):
        p[...] = -1

    def one_below_0(p):
        p[1, 1, 3, 4] = -5

    def half_below_0_and_a_lamp(p):
        p[:, :, :, 16:] *= -1
        p[:, :, 3:5, 7:9] = 200

    def below_0_and_a_lamp(p):
        p[...] = -1
        p[:, :, 3:5, 7:9] = 200

    def lamp_with_red_below_0(p):
        p[..., 0] *= -1
        p[:, :, 3:5, 7:9] = (-100, 300, 5)

    def black_but_for_a_texel(p):
        p[...] = 0
        p[1, 2, 3, 4] = 100

    def black_with_one_below_0(p):
        p[...] = 0
        p[1, 2, 3, 4] = -100

    return {k.replace("_", " "): of(v) for k, v in locals().items() if k not in ("of",) and callable(v)}


FIELDS = fields()


def render(folder, rays, *options):
    out = run("rtrace", "-h", "-ff", "-u-", "-lw", "1e-6", "-ab", "1", *options, "s.oct", stdin=rays, cwd=folder).out
    v = np.frombuffer(out, "<f4").reshape(-1, 3).astype(float)
    assert np.isfinite(v).all()
    return v


@pytest.fixture(scope="module")
def views():
    """A place on the dull floor, and one on the shiny."""
    rng = np.random.default_rng(73)
    to = np.repeat([[-0.8, 0.6, 0], [0.5, -0.8, 0]], 40, 0) + rng.uniform(-0.02, 0.02, (80, 3)) * (1, 1, 0)
    o = np.tile([0.0, -3, 2.0], (80, 1))
    return np.concatenate([o, unit(to - o)], 1).astype("<f4").tobytes()


@pytest.mark.parametrize("name", FIELDS)
def test_both_methods_agree(tmp_path, name, views):
    """Means over 40 rays at each place; 5 standard errors, of the literal method's noise above all, and 1 % of the largest."""
    write_ilf(tmp_path / "f.ilf.exr", FIELDS[name])
    (tmp_path / "s.rad").write_text(SCENE)
    (tmp_path / "s.oct").write_bytes(run("oconv", "s.rad", cwd=tmp_path).out)
    common = ["-aa", "0", "-ad", "1024"]
    literal, sampled = (render(tmp_path, views, *common, "-di", n).reshape(2, 40, 3) for n in ("0", "16"))
    error = np.hypot(literal.std(1), sampled.std(1)) / np.sqrt(40)
    scale = np.abs(literal).mean((0, 1)).max()
    assert (np.abs(literal.mean(1) - sampled.mean(1)) <= 5 * error + 0.01 * scale).all(), (literal.mean(1), sampled.mean(1), error)
    if name == "zero":
        assert (literal == 0).all() and (sampled == 0).all()
    if name == "all below 0":
        assert (sampled < 0).all()


@pytest.mark.parametrize("name", ["mean below 0", "noise about 0", "half below 0 and a lamp", "zero"])
def test_never_nan(tmp_path, name, views):
    """Other options' ways: interpolated ambient values, supersampling, and direct light alone."""
    write_ilf(tmp_path / "f.ilf.exr", FIELDS[name])
    (tmp_path / "s.rad").write_text(SCENE)
    (tmp_path / "s.oct").write_bytes(run("oconv", "s.rad", cwd=tmp_path).out)
    for options in (["-aa", ".15", "-ad", "128", "-as", "64"], ["-aa", "0", "-ad", "128", "-as", "64"], ["-ab", "0"]):
        render(tmp_path, views, *options)


@pytest.mark.parametrize("name", FIELDS)
def test_threshold_is_not_below_0(tmp_path, name):
    """3 times the mean of what is above 0; and nothing below 0 is a patch."""
    path = write_ilf(tmp_path / "f.ilf.exr", FIELDS[name])
    threshold, patches = info(path)
    y = FIELDS[name].probes @ (0.265, 0.670, 0.065)
    edges = np.cos(np.arange(17) * np.pi / 32)
    omega = (edges[:-1] - edges[1:])[:, None] * np.ones(32)
    mean = (np.maximum(y, 0) * omega).sum((2, 3)).mean() / omega.sum()
    assert threshold == pytest.approx(3 * mean, rel=1e-5, abs=1e-12)
    assert (patches > 0) == bool((y > threshold).any())


def test_lookups_are_literal(tmp_path):
    rng = np.random.default_rng(74)
    f = FIELDS["noise about 0"]
    path = write_ilf(tmp_path / "f.ilf.exr", f)
    o, d, h = rng.uniform(-1, 1, (300, 3)), random_directions(rng, 300), rng.uniform(-3, 3, (300, 3))
    found = np.array([list(map(float, x.split())) for x in run("ilftrace", path, stdin=rays_text(o, d, h)).text.splitlines()])
    assert (found < 0).any()
    assert_same(found, f.eval(o, d, h), rel=1e-5, floor=0.1)


@pytest.mark.parametrize("kind", ["half", "float"])
def test_packing_says_how_many(tmp_path, kind):
    import OpenEXR
    p = np.random.default_rng(75).uniform(0.1, 1, (8, 16, 3)).astype(np.float32).reshape(16, 8, 3)     # of no panorama's shape
    files = []
    for k, (n, least) in enumerate([(0, 0), (3, -0.25), (5, -0.125)]):
        q = p.copy()
        q.reshape(-1)[7:7 + n] = least
        files.append(tmp_path / f"{k}.exr")
        OpenEXR.File({"type": OpenEXR.scanlineimage}, {c: np.ascontiguousarray(q[..., i]) for i, c in enumerate("RGB")}).write(str(files[-1]))
    base = ["--plane", "0 0 0 1 0 0 0 1 0", "--type", kind, "-o", tmp_path / "f.ilf.exr"]
    r = run("ilfpack", "--grid", "3x1", *base, *files)
    assert len(r.err.splitlines()) == 1 and "8 of 1152 values are below 0, down to -0.25" in r.err
    assert re.search(r"negative +8 of 1152 values \(0\.69 %\), down to -0\.25\n", run("ilfinfo", tmp_path / "f.ilf.exr").text)
    r = run("ilfpack", "--grid", "1x1", *base, files[0])
    assert r.err == "" and "negative" not in run("ilfinfo", tmp_path / "f.ilf.exr").text
