"""ilflamps on rooms whose lamps are known (bench/lamps/rooms.py): what it finds, that it never harms, what its options do."""
import json
import sys

import numpy as np
import pytest
from conftest import TOP, run

sys.path.insert(0, str(TOP / "bench" / "lamps"))
import rooms                                                           # noqa: E402

GREY = (.3, .3, .3)
YELLOW, BLUE = ((1.3, .7, 2.4), .06, (9000, 8000, 6000)), ((-1.1, -1.6, 2.3), .07, (5000, 6000, 9000))


def carded(lamps=(YELLOW, BLUE)):
    return rooms.Room([rooms.lamp(*l) for l in lamps] + [rooms.tilted(YELLOW[0], (.1, -.1), 1.2, .3, .25, 0, 0, 20, GREY)])


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    d = tmp_path_factory.mktemp("lamps")
    rooms.make(carded(), 6, 6, 160, 80, str(d / "card.ilf.exr"))
    rooms.make(carded((YELLOW,)), 6, 6, 160, 80, str(d / "yellow.ilf.exr"))
    rooms.make(rooms.Room([]), 4, 4, 64, 32, str(d / "none.ilf.exr"))
    rooms.make(rooms.Room([rooms.lamp(*YELLOW)]), 4, 4, 128, 64, str(d / "bare.ilf.exr"))
    return d


@pytest.fixture(scope="session")
def card(folder):
    run("ilflamps", "--report", folder / "card.json", "--picture", folder / "card.png", folder / "card.ilf.exr")
    return json.loads((folder / "card.json").read_text())


def texels(path):
    import OpenEXR
    with OpenEXR.File(str(path)) as f:
        return np.array(f.parts[0].channels["RGB"].pixels, float)


def irradiance(img, nu, nv, n_theta, n_phi):
    "of each probe, upwards"
    edge = np.arange(n_phi + 1) * np.pi / 2 / n_phi
    w = (np.sin(edge[1:]) ** 2 - np.sin(edge[:-1]) ** 2) * np.pi / n_theta
    v = img.reshape(nv, n_phi, nu, n_theta, 3)
    return np.einsum("jyixc,y->jic", v, w)


@pytest.mark.sweep
def test_lamps_stand_where_they_stand(card):
    assert len(card["lamps"]) == 2
    for centre, radius, rgb in (YELLOW, BLUE):
        found = min(card["lamps"], key=lambda l: np.linalg.norm(np.subtract(l["position"], centre)))
        assert found["fate"] == "taken out" and found["shape"] == "sphere"
        assert np.linalg.norm(np.subtract(found["position"], centre)) < .01
        assert found["radius"] == pytest.approx(radius, rel=.02)
        power = np.array(found["radiance"]) * found["radius"] ** 2 / (np.array(rgb) * radius ** 2)
        assert power == pytest.approx(1, abs=.01)


@pytest.mark.sweep
def test_the_card_is_found(card):
    hidden = max(card["lamps"], key=lambda l: l["error_of_interpolation"])
    assert "sheet" in hidden["model"] and hidden["height"] == pytest.approx(1.2, abs=.02)
    assert hidden["error"] < .4 * hidden["error_of_interpolation"]


@pytest.mark.sweep
def test_better_where_it_matters_and_never_worse(folder, card):
    one, two, _ = rooms.run(carded(), str(folder / "card.ilf.exr"), [], rooms.Score(carded(), patches=3), run)
    for z in one:
        assert two[z]["up"] < one[z]["up"] / 3 and two[z]["side"] < one[z]["side"] / 3 and two[z]["rad"] < 6, (one, two)


def test_no_lamps_nothing_changes(folder):
    run("ilflamps", "--report", folder / "n.json", "--compose", folder / "n.ilf.exr", folder / "none.ilf.exr")
    assert json.loads((folder / "n.json").read_text())["lamps"] == []
    assert np.array_equal(texels(folder / "n.ilf.exr"), texels(folder / "none.ilf.exr"))
    run("ilflamps", "--lamps", "keep", "--compose", folder / "k.ilf.exr", folder / "card.ilf.exr")
    assert np.array_equal(texels(folder / "k.ilf.exr"), texels(folder / "card.ilf.exr"))


@pytest.mark.sweep
def test_composed_it_is_the_field_again(folder, card):
    run("ilflamps", "--compose", folder / "again.ilf.exr", folder / "card.ilf.exr")
    a, b = (irradiance(texels(folder / f"{n}.ilf.exr"), 6, 6, 160, 80) for n in ("again", "card"))
    assert np.sqrt(((a - b) ** 2).mean()) < .02 * b.mean()


@pytest.mark.sweep
def test_a_lamp_put_out_is_a_room_without_it(folder, card):
    blue = 1 + min(range(2), key=lambda k: np.linalg.norm(np.subtract(card["lamps"][k]["position"], BLUE[0])))
    run("ilflamps", "--set", f"{blue}.off", "--compose", folder / "off.ilf.exr", folder / "card.ilf.exr")
    whole, off, true = (irradiance(texels(folder / f"{n}.ilf.exr"), 6, 6, 160, 80) for n in ("again", "off", "yellow"))
    blue_only = irradiance(texels(folder / "card.ilf.exr"), 6, 6, 160, 80) - true
    # of the blue lamp's own light next to nothing is left; the yellow one's is what "again" makes of it
    assert np.abs((whole - off) - blue_only).mean() < .01 * blue_only.mean()
    assert np.sqrt(((off - true) ** 2).mean()) < .02 * true.mean()


@pytest.mark.sweep
def test_threads_change_nothing(folder, card):
    for n in (1, 3):
        run("ilflamps", "--threads", str(n), "--report", folder / f"t{n}.json", "--compose", folder / f"t{n}.ilf.exr", folder / "card.ilf.exr")
    a, b = (json.loads((folder / f"t{n}.json").read_text()) for n in (1, 3))
    assert a["lamps"] == b["lamps"]
    assert np.array_equal(texels(folder / "t1.ilf.exr"), texels(folder / "t3.ilf.exr"))


SUN = rooms.Room([rooms.body(rooms.SUN, rooms.unit((.5, .3, .8)), (4e4, 4e4, 3.5e4), r=.01, lamp=1),
                  rooms.card((.6, .3, .9), (.25, 0, 0), (0, .2, 0), GREY)], lo=(-30, -30, -.001), hi=(30, 30, 30))
# A card whose edge falls between two rows of probes: a beam's edge would fit what they measured as well, anywhere between them.
EDGE = rooms.Room([rooms.lamp((.2, 1.9, 2.2), .045, (8000, 8000, 8000)), rooms.tilted((.2, 1.9, 2.2), (0, -.2), 1.3, .3, .2, 10, 0, 0, GREY)])
# Of a lamp behind a card only some probes in a corner see anything, two of them all.
CORNER = rooms.Room([rooms.lamp((-1.1, -1.6, 2.3), .06, (5000, 6000, 9000)),
                     rooms.tilted((-1.1, -1.6, 2.3), (-.1, .1), 1.1, .33, .3, 12, 30, 10, (.4, .35, .3))])


@pytest.mark.parametrize("room, height", [(EDGE, 1.28), pytest.param(SUN, .9, marks=pytest.mark.sweep)], ids=["edge", "sun"])
def test_what_is_seen_in_the_pictures_is_believed(folder, room, height):
    """Rows alone said "gate" (as probes on both sides of an edge can't tell where it runs), and no sheet was looked for below a lamp at
    infinity, whose height has no end."""
    rooms.make(room, 6, 6, 128, 64, str(folder / "seen.ilf.exr"))
    run("ilflamps", "--report", folder / "seen.json", folder / "seen.ilf.exr")
    lamp, = json.loads((folder / "seen.json").read_text())["lamps"]
    assert lamp["fate"] == "taken out" and lamp["model"].startswith("sheet") and lamp["height"] == pytest.approx(height, abs=.04)


def test_probes_that_are_turned(folder):
    """By .2 degrees about each axis: no shape fitted, and all stayed in the field without a word.  Lamps say by how much; steady probes are let alone."""
    args = 5, 5, 160, 80
    rooms.make(carded(), *args, str(folder / "turned.ilf.exr"), turn=.2, seed=3)
    words = run("ilflamps", "--report", folder / "turned.json", folder / "turned.ilf.exr").err
    report = json.loads((folder / "turned.json").read_text())
    expected = np.degrees(np.sqrt((np.radians(.2) ** 2 * np.random.default_rng(3).normal(size=(25, 9))[:, 6:] ** 2).sum(1).mean()))
    assert "turned by" in words and report["turned_probes"]["measured"] == 25
    assert report["turned_probes"]["degrees"] == pytest.approx(expected, rel=.35)
    lamps = sorted(report["lamps"], key=lambda k: k["position"][0])
    assert [k["fate"] for k in lamps] == ["taken out"] * 2
    for k, (at, radius, _) in zip(lamps, (BLUE, YELLOW)):
        assert np.linalg.norm(np.subtract(k["position"], at)) < .02 and k["radius"] == pytest.approx(radius, rel=.05)
    assert "turned" not in run("ilflamps", "--report", folder / "steady.json", folder / "card.ilf.exr").err
    assert "turned_probes" not in json.loads((folder / "steady.json").read_text())


@pytest.mark.sweep
def test_a_spotlight_that_few_probes_see(folder):
    "Shares were even, rows were not: hypotheses were asked without pictures (a crash)."
    spot = rooms.Room([rooms.panel((-.9, .5, 2.6), (.15, 0, 0), (0, .15, 0), (8000, 8000, 7000), gate=1, focus=0., gx=.05, gy=-.05, gr=.4, soft=.03)])
    rooms.make(spot, 6, 6, 128, 64, str(folder / "spot.ilf.exr"))
    run("ilflamps", "--report", folder / "spot.json", folder / "spot.ilf.exr")
    lamp, = json.loads((folder / "spot.json").read_text())["lamps"]
    assert lamp["error_of_interpolation"] > .1                           # they were asked


def lens(c, aim, half, turn, k, L):
    "a theatre spotlight: a square lens that looks at a place; its radiance is cos^k of the direction"
    n, t = rooms.unit(np.subtract(aim, c)), np.radians(turn)
    u = rooms.unit(np.cross(n, [0, 0, 1])); v = np.cross(n, u)
    return rooms.panel(c, (u * np.cos(t) + v * np.sin(t)) * half, (v * np.cos(t) - u * np.sin(t)) * half, L, axis=n, k=k)


@pytest.mark.parametrize("spot, gain", [
    (((-.9, .2, 1.6), (.05, 0, 0), .17, 20, 90., (620, 400, 130)), 4),
    pytest.param(((1, .3, 1.9), (-.1, .1, 0), .2, 0, 60., (150, 270, 560)), 1.2, marks=pytest.mark.sweep)], ids=["narrow", "broad"])
def test_a_wide_lens_with_a_beam(folder, spot, gain):
    "The gradient over the lens moved its middle as if it hung half as high again, and no even body looked like it."
    at, _, half, _, _, rgb = spot
    room = rooms.Room([lens(*spot)])
    rooms.make(room, 6, 6, 128, 64, str(folder / "lens.ilf.exr"))
    one, two, report = rooms.run(room, str(folder / "lens.ilf.exr"), [], rooms.Score(room, patches=3, most=3000, rest=2000), run)
    lamp, = report["lamps"]
    assert lamp["fate"] == "taken out" and lamp["shape"] == "rectangle"
    assert np.linalg.norm(np.subtract(lamp["position"], at)) < .04
    assert [np.linalg.norm(lamp[k]) for k in "ab"] == pytest.approx([half, half], rel=.08)
    assert lamp["radiance"] == pytest.approx(rgb, rel=.05)
    for z in one:
        assert two[z]["up"] < one[z]["up"] / gain and two[z]["side"] < one[z]["side"] / gain and two[z]["rad"] < 5, (one, two)


@pytest.mark.sweep
def test_a_lamp_that_two_probes_see_whole(folder):
    rooms.make(CORNER, 8, 8, 256, 128, str(folder / "corner.ilf.exr"))
    run("ilflamps", "--report", folder / "corner.json", folder / "corner.ilf.exr")
    lamp, = json.loads((folder / "corner.json").read_text())["lamps"]
    assert lamp["shape"] == "sphere" and lamp["radius"] == pytest.approx(.06, rel=.02)
    assert np.linalg.norm(np.subtract(lamp["position"], (-1.1, -1.6, 2.3))) < .01


@pytest.mark.sweep
def test_dark_twigs_before_dark_walls(folder):
    "Where a wall is as dark as a twig, that probe's picture says nothing about it; it counted as clear, and twigs went missing."
    lamp = ((1.3, .7, 2.4), .05, (9000, 8000, 6000))
    branch = rooms.Room([rooms.lamp(*lamp)] + rooms.twigs(rooms.R(21), 60), bright=.45)
    rooms.make(branch, 8, 8, 256, 128, str(folder / "twigs.ilf.exr"))
    one, two, report = rooms.run(branch, str(folder / "twigs.ilf.exr"), [], rooms.Score(branch, patches=5, most=3000, rest=2000), run)
    for z in one:
        assert two[z]["up"] < one[z]["up"] / 2.5, (one, two)


BEFORE = rooms.between(YELLOW[0], (.1, -.05), 1.1)
BODIES = {"ball": rooms.ball(BEFORE, .16, (.3, .2, .2)),
          "card": rooms.tilted(YELLOW[0], (.3, -.2), 1.1, .3, .25, 20, 60, 30, (.35, .35, .3), amp=.5, cell=.11)}


@pytest.mark.parametrize("what", ["ball", pytest.param("card", marks=pytest.mark.sweep)])
def test_a_body_in_space_hides_a_lamp(folder, what):
    "A ball's outline is another one from every probe; a textured and tilted card's outline was jagged, and lay level."
    room = rooms.Room([rooms.lamp(*YELLOW), BODIES[what]], amp=.25)
    rooms.make(room, 7, 7, 160, 80, str(folder / "body.ilf.exr"))
    one, two, report = rooms.run(room, str(folder / "body.ilf.exr"), [], rooms.Score(room, patches=3, most=3000, rest=2000), run)
    lamp, = report["lamps"]
    mask = lamp["masks"][0]
    assert mask["kind"] in {"card": ["sheet"], "ball": ["ball", "stack"]}[what]      # twenty slices of a ball are as good where probes are few
    if what == "card":
        n = np.cross(BODIES[what]["u"], BODIES[what]["v"])
        assert lamp["height"] == pytest.approx(1.1, abs=.06) and mask["plane"][1:] == pytest.approx(list(-n[:2] / n[2]), abs=.06)
    for z in one:
        assert two[z]["up"] < one[z]["up"] / 3, (one, two)


@pytest.mark.sweep
@pytest.mark.parametrize("focus, gain", [(-.55, 6), (.5, 6)])
def test_a_profile_spotlight_out_of_focus(folder, focus, gain):
    "What several gates fit as well is asked of all of them: a soft edge is told by every part of the lens, and was thought unknown."
    lens = rooms.panel((.3, .7, 2.6), (.17, 0, 0), (0, .17, 0), (9000, 9000, 9000), gate=1, focus=focus, gx=.05, gy=.05, gr=.4, soft=.1)
    room = rooms.Room([lens])
    rooms.make(room, 8, 8, 160, 80, str(folder / "gate.ilf.exr"))
    one, two, report = rooms.run(room, str(folder / "gate.ilf.exr"), [], rooms.Score(room, patches=4, most=3000, rest=2000), run)
    lamp = report["lamps"][0]
    assert lamp["fate"] == "taken out" and lamp["masks"][0]["beta"] == pytest.approx(focus / (2.6 - focus), abs=.03)
    for z in one:
        assert two[z]["up"] < one[z]["up"] / gain, (one, two)


def blurred(path, sd, noise, seed):
    "a field's probes again: blurred by sd degrees, half as many texels a side, each wrong by part of its light"
    import ilf
    with ilf.open(path) as f: p = f.probes()
    sd, phi = np.radians(sd), (np.arange(p.shape[2]) + .5) * np.pi / 2 / p.shape[2]
    m = np.arange(p.shape[3] // 2 + 1)
    p = np.fft.irfft(np.fft.rfft(p, axis=3) * np.exp(-.5 * (m * sd / np.sin(phi)[:, None]) ** 2)[..., None], axis=3)
    k = np.exp(-.5 * ((phi[:, None] - phi) / sd) ** 2)
    p = np.einsum("ab,vubtc->vuatc", k / k.sum(1, keepdims=True), p)
    p = p.reshape(*p.shape[:2], p.shape[2] // 2, 2, p.shape[3] // 2, 2, 3).mean((3, 5))
    p *= (1 + noise * np.random.default_rng(seed).normal(size=p.shape[:4] + (1,))).clip(0)
    ilf.write(path, p.clip(0), origin=(-.5, -.5, 0), U=(1, 0, 0), V=(0, 1, 0), compression="zip")


def test_a_spotlight_in_blurred_pictures(folder):
    "As photographs of small mirror balls are: no body fitted the smeared spot of two texels, and all stayed in the field."
    room = rooms.Room([rooms.disc((-.9, .5, 2.6), (-.3, .2, 1), .11, (8000, 8000, 7000), lamp=1, gate=1, focus=.05, gx=.05, gy=-.05, gr=.33, soft=.1)])
    path = str(folder / "blurred.ilf.exr")
    rooms.make(room, 8, 8, 256, 128, path)
    blurred(path, 1., .12, 5)
    one, two, report = rooms.run(room, path, [], rooms.Score(room, patches=3, most=2000, rest=1000), run)
    lamp = report["lamps"][0]
    assert report["blur"]["degrees"] == pytest.approx(1, rel=.3) and report["blur"]["misfit"] < .8 * report["blur"]["misfit_if_sharp"]
    assert lamp["fate"] == "taken out" and lamp["model"].startswith("gate") and lamp["radius"] == pytest.approx(.11, rel=.15)
    assert np.linalg.norm(np.subtract(lamp["position"], (-.9, .5, 2.6))) < .1
    for z in one:
        assert two[z]["up"] < one[z]["up"] / 2, (one, two)


@pytest.mark.parametrize("args, words", [
    (("--lamps", "some"), "--lamps: expected keep, auto or a number"),
    (("--max-width", "0"), "--max-width: expected more than 0"),
    (("--set", "1.hue=3"), "--set: expected K.gain=X"),
    (("--set", "7.off"), "expected a lamp from 1 to"),
    (("--grid", "3x3"), "expected --compose"),
    (("--rays", "x"), "--rays and --radiance go together")])
def test_refusals(folder, args, words):
    more = [] if "--grid" in args else ["--report", folder / "x.json"]
    r = run("ilflamps", *args, *more, folder / "bare.ilf.exr", code=2)
    assert words in r.err and len(r.err.splitlines()) == 1
    assert not (folder / "x.json").exists()
