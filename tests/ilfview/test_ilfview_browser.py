"""ilfview's page in a real browser: make test-view (which installs chromium and selenium, and sets ILF_BROWSER).

Values are read back from the page's own WebGL program, the one that paints, and compared with ilftrace.
"""
import os
import shutil
import time

import numpy as np
import pytest
from conftest import needed, run
from ilf_util import random_directions, random_ilf, rays_text, write_ilf
from page_util import decode
from test_ilf_lamps import lamps_of, lit, masks_of, rays_at
from test_ilfview import ROOM

pytestmark = pytest.mark.skipif(not os.environ.get("ILF_BROWSER"), reason="wants a browser: make test-view")
PHONE, DESK = (400, 800), (1400, 1000)
COLOURS = "c => new Set(new Uint32Array(c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer)).size"


@pytest.fixture(scope="module")
def browser():
    webdriver = pytest.importorskip("selenium.webdriver")
    options = webdriver.ChromeOptions()
    needed("chromium", "chromedriver")
    options.binary_location = shutil.which("chromium")
    for a in ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
              "--force-device-scale-factor=1", "--disable-dev-shm-usage"):
        options.add_argument(a)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    b = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    b.set_script_timeout(300)
    yield b
    b.quit()


def opened(browser, folder, *files, args=(ROOM,), anchor="", size=DESK):
    out = folder / "view.html"
    run("ilfview", "--quiet", *args, "-o", out, *files)
    # window sizes have a floor that a phone lies under
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                            {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": size == PHONE})
    browser.get_log("browser")
    browser.get("about:blank")
    browser.get(f"file://{out}{anchor}")
    assert browser.get_log("browser") == []
    return out


def said(browser, name):
    """A row of the table of numbers."""
    browser.execute_script("ilfview.draw()")
    rows = browser.execute_script("return [...document.querySelectorAll('tr')].map(r => [r.cells[0].textContent, r.cells[1].textContent])")
    return dict(rows)[name]


def asked(browser, o, d, field=0, surface=0):
    """R G B of rays, and where the page says that they meet the room (nan: infinitely far away)."""
    got = browser.execute_script("ilfview.fields[arguments[1]].surface = arguments[2]; return ilfview.ask(arguments[1], arguments[0])",
                                 np.concatenate([o, d], 1).tolist(), field, surface)
    return np.array([g["rgb"] for g in got]), np.array([g["hit"] or [np.nan] * 3 for g in got])


def traced(path, o, d, h):
    text = run("ilftrace", path, stdin=rays_text(o, d, np.where(np.isnan(h), np.inf, h))).text
    return np.array(text.split(), float).reshape(-1, 3)


def alike(found, want):
    """To 1 %, but for values below a hundred-thousandth of the mean."""
    np.testing.assert_allclose(found, want, rtol=.01, atol=1e-5 * np.abs(want).mean())


def up(rng, n):
    d = random_directions(rng, n)
    d[:, 2] = np.abs(d[:, 2]) + .01
    return d


@pytest.mark.parametrize("kind, grid", [("hemisphere", (3, 4)), ("185deg", (1, 1)), ("sphere", (2, 1))])
def test_rays_are_those_of_ilftrace(browser, tmp_path, kind, grid):
    """Through a box, through a sphere, from infinitely far away; from on and above the plane, and beside it."""
    rng = np.random.default_rng(11)
    f = random_ilf(rng, *grid, 24, 12, kind=kind, decades=2, polar_valid=1.4 if kind == "185deg" else None)
    path = write_ilf(tmp_path / "a.ilf.exr", f)
    surfaces = decode(opened(browser, tmp_path, path))[0]["surfaces"]
    o = f.origin + rng.uniform(-.2, 1.2, (60, 1)) * f.U + rng.uniform(-.2, 1.2, (60, 1)) * f.V + rng.choice([0, .2], (60, 1)) * f.frame()[2]
    d = up(rng, 60) @ f.frame()
    for k, s in enumerate(surfaces):
        rgb, h = asked(browser, o, d, surface=k)
        assert np.isnan(h).all() if s["kind"] == "far" else not np.isnan(h).any() if k == 0 else np.isfinite(h).any()
        alike(rgb, traced(path, o, d, h))


def test_rays_meet_the_box_that_was_given(browser, tmp_path):
    rng = np.random.default_rng(12)
    f = random_ilf(rng, 2, 2, 8, 4)
    opened(browser, tmp_path, write_ilf(tmp_path / "a.ilf.exr", f))
    o, d = np.repeat(f.origin[None], 50, 0), up(rng, 50) @ f.frame()
    h = asked(browser, o, d)[1]
    lo, hi = np.array([-4, -4, -4]), np.array([3.5, 4, 3.8])
    t = np.where(d > 0, (hi - o) / d, (lo - o) / d).min(1)
    np.testing.assert_allclose(h, o + t[:, None] * d, atol=2e-5)


@pytest.mark.parametrize("kind", [*masks_of(np.random.default_rng(0)), "sum"])
def test_lamps_behind_what_hides_them_are_those_of_ilftrace(browser, tmp_path, kind):
    """All shapes; the few rays that pass a lamp's or a ball's very edge on the other side are let be."""
    rng = np.random.default_rng(13)
    masks = masks_of(rng)
    some = [masks["layer"], masks["gate"]] if kind == "sum" else [masks[kind]]
    if kind == "sum":
        some[1].adds = 1
    f = lit(rng, lamps_of(rng, some))
    f.lamps[2].far = 1
    path = write_ilf(tmp_path / "a.ilf.exr", f)
    opened(browser, tmp_path, path)
    o, d, _ = rays_at(rng, f, 150)
    keep = d @ f.frame()[2] > .02
    o, d = o[keep], d[keep]
    for surface in (0, 3):
        rgb, h = asked(browser, o, d, surface=surface)
        want = traced(path, o, d, h)
        bad = (np.abs(rgb - want) > .01 * np.abs(want) + 1e-3).any(1)
        assert bad.mean() < .015, (kind, surface, rgb[bad], want[bad])


def test_the_light_at_a_point_is_the_planes(browser, tmp_path):
    """The page's sum over all directions, without depth correction, beside what ilfview computed of the probes and the lamps."""
    rng = np.random.default_rng(14)
    f = lit(rng, lamps_of(rng, [masks_of(rng)["layer"]]))
    opened(browser, tmp_path, write_ilf(tmp_path / "a.ilf.exr", f), args=("--geometry", "none"))
    pairs = browser.execute_script("""const f = ilfview.fields[0];
        return [[.2, .3], [.5, .4], [.9, .7]].map(p => [facing(bundlesAt(ilfview.look, f, 0, [...p, 0]), [0, 0, 1]), onPlane(f, ...p)]);""")
    for there, plane in pairs:
        np.testing.assert_allclose(there, plane, rtol=.04)


def test_under_the_pointer_and_by_keyboard(browser, tmp_path):
    """What the table says is what ilftrace says of the direction that it names; keys move the point, turn the view, change the exposure."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys
    rng = np.random.default_rng(15)
    f = random_ilf(rng, 3, 3, 24, 12)
    path = write_ilf(tmp_path / "a.ilf.exr", f)
    opened(browser, tmp_path, path)
    plan, view = browser.find_elements("css selector", "canvas[tabindex]")
    before = said(browser, "point")
    browser.execute_script("arguments[0].focus()", plan)
    ActionChains(browser).send_keys(Keys.ARROW_RIGHT * 4, Keys.ARROW_UP).perform()
    assert said(browser, "point") != before
    yaw = browser.execute_script("return ilfview.yaw")
    browser.execute_script("arguments[0].focus()", view)
    ActionChains(browser).send_keys(Keys.ARROW_LEFT, "+", "]", "]", "f").perform()
    now = browser.execute_script("return [ilfview.yaw != arguments[0], ilfview.zoom < 1.2, ilfview.stops, ilfview.falseColour]", yaw)
    assert now == [True, True, 1, True]
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", view)
    ActionChains(browser).move_to_element_with_offset(view, 50, -60).perform()
    rgb = np.array(said(browser, "R G B").split(), float)
    d = np.array(said(browser, "direction").split(";")[0].split(), float)
    o = np.array(said(browser, "point").split(), float)
    h = np.array(said(browser, "probes").split("towards")[1].split(), float)
    alike(rgb, traced(path, o[None], d[None], h[None])[0])
    ActionChains(browser).drag_and_drop_by_offset(view, 80, 30).perform()
    assert browser.execute_script("return ilfview.yaw") != yaw


@pytest.mark.parametrize("size", [PHONE, DESK])
def test_it_is_painted_and_fits_the_width(browser, tmp_path, size):
    """No scrolling sideways, and no canvas of one colour; with ILF_BROWSER=FOLDER its picture is kept there."""
    rng = np.random.default_rng(16)
    paths = [write_ilf(tmp_path / f"{n}.ilf.exr", lit(rng, lamps_of(rng, [masks_of(rng)["layer"]]))) for n in "ab"]
    opened(browser, tmp_path, *paths, size=size)
    wide, colours = browser.execute_script("""ilfview.draw();
        return [document.documentElement.scrollWidth, [...document.querySelectorAll('figure canvas')].map(arguments[0])];""".replace(
        "arguments[0]", COLOURS))
    assert wide <= size[0] and len(colours) == 10 and min(colours) > 50
    if os.path.isdir(os.environ["ILF_BROWSER"]):
        time.sleep(1)
        browser.save_screenshot(os.path.join(os.environ["ILF_BROWSER"], f"view_{size[0]}.png"))


def test_without_webgl_words_and_the_plan(browser, tmp_path):
    path = write_ilf(tmp_path / "a.ilf.exr", random_ilf(np.random.default_rng(17), 3, 3, 24, 12))
    opened(browser, tmp_path, path, anchor="#nogl")
    assert not browser.find_element("css selector", ".view").is_displayed()
    assert "no WebGL 2" in browser.execute_script("return document.getElementById('message').textContent")
    assert browser.execute_script(f"return ({COLOURS})(document.querySelector('.plan canvas'))") > 50
