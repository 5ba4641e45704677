"""Light from an ilf on surfaces, against analytic answers, in rtrace, rpict and rcontrib."""
import re

import numpy as np
import pytest

from conftest import run
from ilf_util import PI, f32
from rad_util import (FLOOR, L, UPRIGHT, Polygon, Source, Sphere, Surface, dome_scene, file_and_ilf, irradiance,
                      material, matrix, oconv, read_picture, rtrace, scene_value)

RENDERERS = ["rpict", "rtrace", "rcontrib"]

# ---- light on surfaces ---------------------------------------------------------------------------------

@pytest.mark.parametrize("shape", [Sphere((0, 0, 0), 10), Source((0, 0, 1), 180), Source((0, 0, 1), 360),
                                   Polygon((-9e5, -9e5, 10), (9e5, -9e5, 10), (9e5, 9e5, 10), (-9e5, 9e5, 10))],
                         ids=["dome", "half of the sky", "all of the sky", "a wide ceiling"])
def test_constant_radiance_gives_pi_times_it(tmp_path, shape):
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8, shape=shape)
    got = irradiance(tmp_path, octree, [(0, 0, 1)])
    assert np.allclose(got, PI * L, rtol=2e-3), got / PI / L


def test_tilted_surface_in_constant_light(tmp_path):
    """A dome over a surface tilted by b: (1 + cos b) / 2 of pi L."""
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    b = np.deg2rad([0, 30, 90, 150, 180])
    got = irradiance(tmp_path, octree, np.stack([np.sin(b), 0 * b, np.cos(b)], -1))
    assert np.allclose(got, PI * L * (1 + np.cos(b))[:, None] / 2, rtol=4e-3, atol=2e-3)


@pytest.mark.parametrize("depth", [True, False])
def test_two_half_plane_lights_have_the_analytic_form_factors(tmp_path, depth):
    """Light L1 from the half x > 0 of the hemisphere, L2 from the other.

    Directions between two half-planes through the y axis, at angles a..b from z towards x, are
    d = (cos s sin g, sin s, cos s cos g) with solid angle cos s ds dg.  Their irradiance on a surface
    whose normal is tilted by c from z towards x is the integral of cos^2 s cos(g - c) = pi/2 [sin(b - c) - sin(a - c)],
    taken over the part within 90 degrees of the normal.
    """
    L1, L2 = np.array([3.0, 1.0, 0.25]), np.array([0.5, 2.0, 5.0])
    octree = dome_scene(tmp_path, lambda d: np.where(d[..., :1] > 0, L1, L2), depth=depth)
    for c in np.deg2rad([0, 25, 60, 90, 120, -45, -90]):
        def wedge(a, b):
            a, b = max(a, c - PI / 2), min(b, c + PI / 2)
            return PI / 2 * (np.sin(b - c) - np.sin(a - c)) if b > a else 0.0
        expected = L1 * wedge(0, PI / 2) + L2 * wedge(-PI / 2, 0)
        got = irradiance(tmp_path, octree, [(np.sin(c), 0, np.cos(c))])[0]
        assert np.allclose(got, expected, rtol=4e-3, atol=4e-3 * PI), (np.rad2deg(c), got, expected)


def test_small_lamp_has_its_form_factor(tmp_path):
    """A cap of half-angle w about the direction at 40 degrees: irradiance pi sin^2 w cos(40 deg)."""
    tilt, w = np.deg2rad(40), np.deg2rad(12)
    axis = np.array([np.sin(tilt), 0, np.cos(tilt)])
    octree = dome_scene(tmp_path, lambda d: np.where((d @ axis > np.cos(w))[..., None], L, 0), n_theta=1024, n_phi=512)
    got = irradiance(tmp_path, octree, [(0, 0, 1)])
    assert np.allclose(got, PI * np.sin(w) ** 2 * np.cos(tilt) * L, rtol=0.01), got


def test_rtrace_i_shows_irradiance_on_things_and_the_light_itself(tmp_path):
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    oconv(tmp_path, (tmp_path / "scene.rad").read_text() + FLOOR)
    text = "0 0 2 0 0.5 -1\n0 0 2 0.3 0 1\n0 0 2 0 1 0.5\n"
    r = run("rtrace", "-h", "-i", "-di", "0", "-ab", "1", "-ad", "4096", "-lw", "1e-6", octree, stdin=text, cwd=tmp_path)
    got = np.array([x.split() for x in r.text.splitlines()], float)
    assert np.allclose(got[0], PI * L, rtol=0.02)
    assert np.allclose(got[1:], L, rtol=1e-5), "the light field, not a white wall"


def test_diffuse_surface_reflects_the_light_field(tmp_path):
    """Radiance of the grey floor: rho E / pi = 0.5 L, by the ambient calculation."""
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    oconv(tmp_path, (tmp_path / "scene.rad").read_text() + FLOOR)
    r = run("rtrace", "-h", "-di", "0", "-ab", "1", "-ad", "16384", "-as", "0", "-lw", "1e-7", octree, stdin="0 0 2 0 0 -1\n", cwd=tmp_path)
    assert np.allclose(np.array(r.text.split(), float), L / 2, rtol=5e-3)


# ---- rpict ---------------------------------------------------------------------------------------------

VIEW = ["-vtv", "-vp", "0.2", "-2.5", "0.7", "-vd", "0", "1", "0.15", "-vu", "0", "0", "1", "-vh", "70", "-vv", "55"]
QUICK = ["-x", "40", "-y", "30", "-ps", "1", "-pj", "0", "-di", "0"]


def render(folder, octree, view, *options):
    r = run("rpict", *view, *QUICK, *options, octree, cwd=folder)
    (folder / "p.hdr").write_bytes(r.out)
    return read_picture(folder, "p.hdr")


def view_rays(folder, view, w, h):
    out = run("vwrays", "-fd", "-pa", "0", "-x", w, "-y", h, *view, cwd=folder).out
    r = np.frombuffer(out, "<f8").reshape(-1, 6)
    return r[:, :3], r[:, 3:]


def rgbe_same(a, b, share=1.0):
    """Equal within the picture format: 8 bits against the largest component."""
    close = np.abs(a - b) <= 1.05 / 128 * np.maximum(a, b).max(-1, keepdims=True) + 1e-9
    assert close.all(-1).mean() >= share, f"{(~close.all(-1)).mean():.4f} of the pixels differ"


def test_rpict_shows_what_the_oracle_sees(tmp_path):
    rng = np.random.default_rng(60)
    f, file = file_and_ilf(tmp_path, rng, plane=UPRIGHT)
    s = Surface(Sphere((0, 0, 0), 5), f)
    octree = oconv(tmp_path, material("room", file) + s.shape.rad("room", "dome"))
    picture = render(tmp_path, octree, VIEW, "-ab", "0")
    h, w = picture.shape[:2]
    o, d = view_rays(tmp_path, VIEW, 40, 30)
    assert len(o) == w * h
    rgbe_same(picture, scene_value([s], o, d).reshape(h, w, 3))
    assert (picture > 0).mean() > 0.4


def test_rpict_i(tmp_path):
    """Irradiance on the floor, and above it the light field itself."""
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    oconv(tmp_path, (tmp_path / "scene.rad").read_text() + FLOOR)
    p = render(tmp_path, octree, VIEW, "-i", "-ab", "1", "-ad", "1024", "-aa", "0", "-lw", "1e-6")
    assert np.allclose(p[0], L, rtol=0.02), "sky"    # 8 bits against the largest component
    assert np.allclose(p[-1], PI * L, rtol=0.04), "floor"


RIGID = {"rotate": "-rx 20 -rz 130", "translate": "-t 2 -3 1", "scale": "-s 0.2", "all": "-rz 40 -rx -70 -s 3 -t 1 2 3"}


def things_scene(file, g, reals):
    """A light field, a mirror ball, a pane of glass and a floor."""
    return (material("room", file, g, reals) + Sphere((0, 0, 0), 8).rad("room", "dome") + FLOOR
            + "void metal chrome\n0\n0\n5 .9 .9 .9 1 0\n" + Sphere((0, 0, 0.5), 0.5).rad("chrome", "ball")
            + "void glass pane\n0\n0\n3 .9 .9 .9\n" + Polygon((0.6, 0, 0.1), (1.6, 0.3, 0.1), (1.6, 0.3, 1.4), (0.6, 0, 1.4)).rad("pane", "p"))


@pytest.mark.parametrize("move", RIGID)
def test_moved_scene_from_the_moved_view_is_the_same_picture(tmp_path, move):
    rng = np.random.default_rng(61)
    f, file = file_and_ilf(tmp_path, rng, texels=(24, 16))
    g = f.placed(*UPRIGHT)
    options = RIGID[move].split()
    octree = oconv(tmp_path, things_scene(file, g, 9))
    moved = oconv(tmp_path, run("xform", *options, "scene.rad", cwd=tmp_path).text, "moved")
    M = matrix(options)
    v = VIEW.copy()
    at = {k: np.array(v[v.index(k) + 1:v.index(k) + 4], float) for k in ("-vp", "-vd", "-vu")}
    for k, x in at.items():
        y = M[:3, :3] @ x + (M[:3, 3] if k == "-vp" else 0)
        v[v.index(k) + 1:v.index(k) + 4] = [repr(float(c)) for c in y]
    a, b = render(tmp_path, octree, VIEW, "-ab", "0"), render(tmp_path, moved, v, "-ab", "0")
    rgbe_same(a, b, 0.995)
    # with interreflection the sample directions differ, so only the mean is compared
    light = ["-ab", "1", "-aa", "0", "-ad", "256", "-lw", "1e-6"]
    a, b = render(tmp_path, octree, VIEW, *light), render(tmp_path, moved, v, *light)
    assert np.allclose(a.mean((0, 1)), b.mean((0, 1)), rtol=0.01)
    assert (a[-5:] > 0).all()


@pytest.mark.parametrize("move", ["-mx", "-mz -rx 30 -t 1 2 3", "-my -s 4"])
def test_mirrored_scene_along_mirrored_rays_is_the_same(tmp_path, move):
    rng = np.random.default_rng(62)
    f, file = file_and_ilf(tmp_path, rng, texels=(24, 16))
    octree = oconv(tmp_path, things_scene(file, f.placed(*UPRIGHT), 9))
    moved = oconv(tmp_path, run("xform", *move.split(), "scene.rad", cwd=tmp_path).text, "moved")
    o, d = (f32(x) for x in view_rays(tmp_path, VIEW, 60, 45))
    M = matrix(move.split())
    a = rtrace(tmp_path, octree, o, d)
    b = rtrace(tmp_path, moved, f32(o @ M[:3, :3].T + M[:3, 3]), f32(d @ M[:3, :3].T))
    close = np.abs(a - b) <= 1e-4 * np.maximum(np.abs(a), 1e-3)
    assert close.all(1).mean() > 0.99 and (a > 0).all(1).mean() > 0.3


@pytest.mark.parametrize("program", RENDERERS)
def test_defaults_show_the_option(program):
    text = run(program, "-defaults").text
    assert re.search(r"^-di \d+\s+#", text, re.M), text


# ---- rcontrib ------------------------------------------------------------------------------------------

def test_rcontrib_counts_the_light_field(tmp_path):
    """Contribution of the dome to an upward surface: pi L with -V+, pi with -V-."""
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    for switch, expected in (("-V+", PI * L), ("-V-", PI * np.ones(3))):
        r = run("rcontrib", "-h", "-I+", switch, "-di", "0", "-ab", "1", "-ad", "16384", "-lw", "1e-7", "-m", "room", octree,
                stdin="0 0 0 0 0 1\n", cwd=tmp_path)
        assert np.allclose(np.array(r.text.split(), float), expected, rtol=5e-3), (switch, r.text)
