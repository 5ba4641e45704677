"""ilfview: what its page holds, decoded by another program than the page's own script; that is tested in a browser (make test-view)."""
import re

import numpy as np
import pytest
from conftest import one_line_error, run
from ilf_util import ILF, random_directions, random_ilf, rays_text, write_ilf
from page_util import as_ilf, decode
from test_ilf_lamps import lamps_of, lit, masks_of, rays_at

ROOM = '--geometry=box -4 -4 -4 3.5 4 3.8'


def page(folder, *files, args=(ROOM,), code=0):
    out = folder / "view.html"
    r = run("ilfview", *args, "-o", out, *files, code=code)
    return out, r


def traced(path, o, d):
    text = run("ilftrace", path, stdin=rays_text(o, d, np.full_like(o, np.inf))).text
    return np.array(text.split(), float).reshape(-1, 3)


def rays(rng, f, n=200):
    """From places on the plane, up."""
    d = random_directions(rng, n)
    d[:, 2] = np.abs(d[:, 2]) + .02
    return f.node(*rng.uniform(0, 2, (2, n))) if f.n_u > 2 else f.origin + rng.uniform(0, 1, (n, 1)) * f.U, d @ f.frame()


# ---- values -----------------------------------------------------------------------------------------------

@pytest.mark.parametrize("kind", ["hemisphere", "185deg", "sphere"])
def test_the_page_holds_the_light_field(tmp_path, kind):
    """Texels to a half's precision, and rays as ilftrace has them."""
    rng = np.random.default_rng(1)
    f = random_ilf(rng, 3, 3, 24, 12, kind=kind, decades=3)
    path = write_ilf(tmp_path / "a.ilf.exr", f)
    (g,) = decode(page(tmp_path, path)[0])
    assert np.abs(g["probes"] / f.probes - 1).max() < 2 ** -11
    np.testing.assert_allclose(g["poles"], np.stack([f.probes[:, :, 0].mean(2), f.probes[:, :, -1].mean(2)], 2), rtol=1e-3)
    o, d = rays(rng, f)
    np.testing.assert_allclose(as_ilf(g).eval(o, d), traced(path, o, d), rtol=2e-3)


def test_nothing_is_clipped(tmp_path):
    """Values beyond a half's, below 0, and eleven decades below the largest."""
    f = random_ilf(np.random.default_rng(2), 2, 2, 8, 4)
    f.probes[0, 0, 1, 2] = 3e7, -2e6, 1e-3
    (g,) = decode(page(tmp_path, write_ilf(tmp_path / "a.ilf.exr", f))[0])
    np.testing.assert_allclose(g["probes"], f.probes, rtol=2 ** -10, atol=3e7 * 2.0 ** -38)


def test_halves_stay_as_they_are(tmp_path):
    f = random_ilf(np.random.default_rng(3), 2, 2, 16, 8, half=True, decades=8)
    f.probes[0, 0, 0, 0] = 65504, 6e-8, -1
    f.probes = f.probes.astype(np.float16).astype(float)
    (g,) = decode(page(tmp_path, write_ilf(tmp_path / "a.ilf.exr", f, half=True))[0])
    assert (g["probes"] == f.probes).all()


# ---- sizes --------------------------------------------------------------------------------------------------

def test_probes_are_made_smaller_to_fit_and_that_is_said(tmp_path):
    """The light stays: the mean of each probe over its solid angle."""
    f = random_ilf(np.random.default_rng(4), 4, 3, 96, 48, decades=2)
    path = write_ilf(tmp_path / "a.ilf.exr", f)
    out, r = page(tmp_path, path, args=("--size-mb", ".3"))
    assert "96 x 48 texels made" in r.err and .24e6 < out.stat().st_size <= .3e6
    (g,) = decode(out)
    assert g["stored"] == [96, 48] and g["texels"][0] < 96
    smaller = as_ilf(g)
    for a in (f, smaller):
        edge = np.cos(np.arange(a.n_phi + 1) * a.polar_max / a.n_phi)
        a.mean = np.einsum("jiyxc,y->jic", a.probes, edge[:-1] - edge[1:]) / a.n_theta
    np.testing.assert_allclose(smaller.mean, f.mean, rtol=1e-3)


def test_a_page_too_small_for_its_probes_is_refused(tmp_path):
    f = random_ilf(np.random.default_rng(4), 60, 60, 8, 8)
    out, r = page(tmp_path, write_ilf(tmp_path / "a.ilf.exr", f), args=("--size-mb", ".2"), code=1)
    one_line_error(r, "ilfview", "a.ilf.exr", "--size-mb")
    assert not out.exists()


# ---- light on the plane ---------------------------------------------------------------------------------------

def test_irradiance_of_an_even_sky_and_of_a_slope(tmp_path):
    """L = 1: pi.  L = cos(phi): 2 pi/3.  L = max(0, cos theta) beside: the azimuth's mean, 1/pi of it."""
    f = ILF(np.ones((1, 3, 64, 128, 3)))
    up = f.texel_directions()
    f.probes[0, 0, ..., 1] = up[..., 2]
    f.probes[0, 1, ..., 2] = np.maximum(0, np.cos(-np.pi + (np.arange(128) + .5) * 2 * np.pi / 128))
    (g,) = decode(page(tmp_path, write_ilf(tmp_path / "a.ilf.exr", f))[0])
    np.testing.assert_allclose(g["irradiance"][0, 2], np.pi, rtol=1e-5)
    np.testing.assert_allclose(g["irradiance"][0, 0], [np.pi, 2 * np.pi / 3, np.pi], rtol=1e-3)
    np.testing.assert_allclose(g["irradiance"][0, 1], [np.pi, np.pi, 1], rtol=1e-3)


def test_lamps_light_the_plane_behind_what_hides_them(tmp_path):
    """Against rays of numpy's in even steps over the hemisphere, lamps less what they hide."""
    rng = np.random.default_rng(5)
    f = lit(rng, lamps_of(rng, [masks_of(rng)["layer"]]))
    (g,) = decode(page(tmp_path, write_ilf(tmp_path / "a.ilf.exr", f))[0])
    assert g["lamps"] == 4 and g["masks"] == 4
    z, t = np.meshgrid((np.arange(200) + .5) / 200, (np.arange(400) + .5) / 400 * 2 * np.pi, indexing="ij")
    d = np.stack([np.sqrt(1 - z * z) * np.cos(t), np.sqrt(1 - z * z) * np.sin(t), z], -1).reshape(-1, 3)
    for i, j in ((0, 0), (g["light"][0] // 2, g["light"][1] - 1)):
        o = f.origin + i / (g["light"][0] - 1) * f.U + j / (g["light"][1] - 1) * f.V
        plain = ILF(f.probes, f.origin, f.U, f.V, f.polar_max)
        at = np.repeat(o[None], len(d), 0)
        want = ((f.eval(at, d @ f.frame()) - plain.eval(at, d @ f.frame())) * d[:, 2:]).mean(0) * 2 * np.pi
        np.testing.assert_allclose(g["lamp_light"][j, i], want, rtol=.03)


def test_lamps_and_masks_come_as_they_are(tmp_path):
    rng = np.random.default_rng(6)
    f = lit(rng, lamps_of(rng, list(masks_of(rng).values())))
    path = write_ilf(tmp_path / "a.ilf.exr", f)
    (g,) = decode(page(tmp_path, path)[0])
    o, d, _ = rays_at(rng, f, 400)
    mine = as_ilf(g).eval(o, d)
    np.testing.assert_allclose(mine, traced(path, o, d), rtol=5e-3, atol=1e-4)


# ---- the page ------------------------------------------------------------------------------------------------------

def test_nothing_comes_from_elsewhere(tmp_path):
    out, r = page(tmp_path, write_ilf(tmp_path / "a.ilf.exr", random_ilf(np.random.default_rng(7), 2, 2, 8, 4)))
    text = out.read_text()
    assert not re.search(r"https?:|\bsrc=|\bhref=|@import|\burl\(|@[a-zA-Z]+\.[a-z]+@|@DATA@", text)
    assert "default-src 'none'" in text and r.err == ""


def test_two_files_and_names_that_look_like_tags(tmp_path):
    rng = np.random.default_rng(8)
    paths = [write_ilf(tmp_path / n, random_ilf(rng, 2, 2, 8, 4)) for n in ('a"<!--<script>\\ä.ilf.exr', "b.ilf.exr")]
    facts = decode(page(tmp_path, *paths)[0])
    assert [f["name"] for f in facts] == [p.name for p in paths]


def test_geometry_in_the_scenes_coordinates(tmp_path):
    """The first surface is the one that was given: its map takes the box's corners to (+-1, +-1, +-1)."""
    f = random_ilf(np.random.default_rng(9), 2, 2, 8, 4)
    (g,) = decode(page(tmp_path, write_ilf(tmp_path / "a.ilf.exr", f))[0])
    s = g["surfaces"][0]
    corner = (np.array([3.5, -4, 3.8]) - g["origin"]) @ np.array([g["u"], g["v"], g["n"]]).T
    np.testing.assert_allclose(np.reshape(s["M"], (3, 3)) @ (corner - s["centre"]), [1, -1, 1], atol=1e-9)
    assert [x["kind"] for x in g["surfaces"]] == ["box", "box", "sphere", "far"]


def test_what_is_assumed_is_said(tmp_path):
    f = random_ilf(np.random.default_rng(9), 2, 2, 8, 4)
    path = write_ilf(tmp_path / "a.ilf.exr", f)
    assert "estimated" in page(tmp_path, path, args=())[1].err
    assert page(tmp_path, path, args=("--quiet",))[1].err == ""


@pytest.mark.parametrize("args, code, words", [
    ((), 2, "expected one light field or two"), (("-o", "v.html"), 2, "found 0"), (("a", "b", "c", "-o", "v.html"), 2, "found 3"), (("a",), 2, "-o"),
    (("a", "-o", "v.html", "--size-mb", "0"), 2, "--size-mb"), (("a", "-o", "v.html", "--geometry", "ball 1"), 2, "sphere X Y Z"),
    (("a", "-o", "v.html", "--geometry", "box 1 1 1 0 2 2"), 2, "lowest corner"), (("missing.exr", "-o", "v.html"), 1, "missing.exr")])
def test_refusals(tmp_path, args, code, words):
    one_line_error(run("ilfview", *args, code=code, cwd=tmp_path), "ilfview", words)
    assert not (tmp_path / "v.html").exists()
