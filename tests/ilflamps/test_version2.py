"""ilflamps on light fields of version 2: what is written, changed, composed, and exported to a Radiance without our patches."""
import json
import os

import numpy as np
import pytest
from conftest import BUILD, TOP, environment, run
from ilf_util import Lamp, Mask, assert_same, directional_ilf, random_ilf, rays_text, read_mosaic, unit, write_ilf
from process import execute
from test_ilf_lamps import contents, masks_of

STOCK = BUILD / "test" / "stock" / "bin"
PLANE = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


def field(rng, lamps, n=(3, 3), polar="hemisphere"):
    f = random_ilf(rng, *n, 64, 32, kind=polar, plane=((1, -2, .5), PLANE[0], .8 * PLANE[1]))
    f.lamps = lamps
    return f


def two(rng):
    return [Lamp("sphere", (.3, .4, 2), (90, 80, 60), radius=.2, masks=[masks_of(rng)["layer"]], errors=(.1, .2, .003, .01)),
            Lamp("disc", (-.5, .2, 1.8), (20, 30, 60), a=(.3, 0, 0), b=(0, .3, 0), seen=np.ones((3, 3)))]


@pytest.fixture(scope="module")
def lit(tmp_path_factory):
    rng = np.random.default_rng(5)
    f = field(rng, two(rng))
    return f, write_ilf(tmp_path_factory.mktemp("lit") / "a.ilf.exr", f, extra={"owner": "the house", "capDate": "2026:01:02 03:04:05",
                                                                                "whiteLuminance": 179.0, "comments": "made by hand"})


def test_handed_on_as_it_is(lit, tmp_path):
    _, path = lit
    run("ilflamps", "-t", "float", "-c", "zips", "-o", tmp_path / "b.ilf.exr", path)
    (head, pixels), (head2, pixels2) = contents(path), contents(tmp_path / "b.ilf.exr")
    for key in head:
        assert np.allclose(head[key], head2[key], rtol=1e-6), key
    assert pixels.keys() == pixels2.keys() - {("measured", "lamp.1")} and all(np.array_equal(pixels[k], pixels2[k]) for k in pixels)
    header = read_mosaic(tmp_path / "b.ilf.exr")[0]
    assert header["owner"] == "the house" and header["capDate"] == "2026:01:02 03:04:05" and header["whiteLuminance"] == 179
    assert header["comments"].startswith("made by hand\nilflamps -t float -c zips -o ")


def test_changed_lamps(lit, tmp_path):
    f, path = lit
    run("ilflamps", "--set", "1.gain=.5", "--set", "2.rgb=1,2,3", "-t", "float", "-o", tmp_path / "b.ilf.exr", path)
    rows = contents(tmp_path / "b.ilf.exr")[0]["ilf:lamps"]
    assert rows[12:15] == [45, 40, 30] and rows[36:39] == [1, 2, 3]
    run("ilflamps", "--set", "2.off", "-t", "float", "-o", tmp_path / "c.ilf.exr", path)
    rng = np.random.default_rng(4)
    f = field(np.random.default_rng(5), f.lamps[:1])
    target = np.array([l.c for l in lit[0].lamps])[rng.integers(2, size=300)] + rng.normal(size=(300, 3)) * .15
    o = rng.uniform(0, .8, (300, 3)) * [1, 1, .3]
    world = lambda p: f.origin + p @ f.frame()                         # noqa: E731
    o, d, h = world(o), unit(target - o) @ f.frame(), world(o + 3 * unit(target - o))
    found = np.array(run("ilftrace", tmp_path / "c.ilf.exr", stdin=rays_text(o, d, h)).text.split(), float).reshape(-1, 3)
    f.probes = lit[0].probes
    assert_same(found, f.eval(o, d, h))


def test_composed_it_is_version_1_with_the_lamps_in_its_texels(lit, tmp_path):
    f, path = lit
    run("ilflamps", "--compose", tmp_path / "c.ilf.exr", path)
    assert "version 1\n" in run("ilfinfo", "--header", tmp_path / "c.ilf.exr").text
    header, image = read_mosaic(tmp_path / "c.ilf.exr")
    probe = image[:32, :64]                                            # probe (0,0)
    side = 16
    th = -np.pi + (np.arange(64 * side) + .5) * 2 * np.pi / 64 / side
    ph = (np.arange(32 * side) + .5) * np.pi / 2 / 32 / side
    P, T = (x.ravel() for x in np.meshgrid(ph, th, indexing="ij"))
    d = np.stack([np.sin(P) * np.cos(T), np.sin(P) * np.sin(T), np.cos(P)], 1)
    light = np.zeros((len(d), 3))
    left = np.repeat(np.repeat(f.probes[0, 0], side, 0), side, 1).reshape(-1, 3)
    for lamp in f.lamps:
        met = np.isfinite(lamp.met(np.zeros_like(d), d))
        v = lamp.passed(np.zeros((met.sum(), 3)), d[met])[:, None]
        light[met] = v * lamp.rgb - np.minimum(v, 1) * left[met]
    whole = (np.sin(P)[:, None] * light).reshape(32, side, 64, side, 3).sum((1, 3)).sum((0, 1))
    texel = np.sin((np.arange(32) + .5) * np.pi / 2 / 32)[:, None, None] * (probe - f.probes[0, 0])
    assert np.allclose(texel.sum((0, 1)) * side * side, whole, rtol=.02)


def test_report_and_picture_of_it(lit, tmp_path):
    _, path = lit
    run("ilflamps", "--report", tmp_path / "r.json", "--picture", tmp_path / "p.png", path)
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["version"] == 2 and [l["shape"] for l in report["lamps"]] == ["sphere", "disc"] and "spots" not in report
    assert report["lamps"][0]["error"] == pytest.approx(.1) and report["lamps"][0]["model"] == "sheet"
    assert (tmp_path / "p.png").stat().st_size > 1000


@pytest.mark.parametrize("args, words", [
    (("--lamps", "1"), "expected a light field of version 1"), (("--max-width", "9"), "expected a light field of version 1"),
    (("--rays", "x", "--radiance", "y"), "expected a light field of version 1"), (("--set", "3.off"), "expected a lamp from 1 to 2"),
    (("--set", "1.gain=-1"), "expected a number from 0"), (("--type", "quarter"), "expected half or float"),
    (("-c", "dwaa"), "expected another"), (("-c", "zip", "--interleave"), "expected none for a file")])
def test_refusals(lit, tmp_path, args, words):
    r = run("ilflamps", *args, "-o", tmp_path / "x.ilf.exr", lit[1], code=2)
    assert words in r.err and len(r.err.splitlines()) == 1 and not list(tmp_path.iterdir())


def test_without_lamps_it_is_version_1(tmp_path):
    even = directional_ilf(lambda d: 1 + .5 * d[..., :1] * [1, 2, 3], 64, 32)
    even.probes = np.tile(even.probes, (4, 4, 1, 1, 1))
    write_ilf(tmp_path / "none.ilf.exr", even)
    r = run("ilflamps", "-o", tmp_path / "b.ilf.exr", "-t", "float", tmp_path / "none.ilf.exr")
    assert "no lamp was taken out" in r.err and "version 1\n" in run("ilfinfo", "--header", tmp_path / "b.ilf.exr").text
    assert np.array_equal(read_mosaic(tmp_path / "b.ilf.exr")[1], read_mosaic(tmp_path / "none.ilf.exr")[1])


@pytest.mark.sweep
def test_found_and_written_it_is_what_rays_say(tmp_path):
    from test_ilflamps import carded, rooms                            # which needs a library that sanitizers don't let in
    rooms.make(carded(), 6, 6, 160, 80, str(tmp_path / "card.ilf.exr"))
    rng = np.random.default_rng(1)
    o = np.concatenate([rng.uniform(-.5, .5, (2000, 2)), rng.uniform(0, .3, (2000, 1))], 1)
    lamp = np.array([(1.3, .7, 2.4), (-1.1, -1.6, 2.3)])[rng.integers(2, size=2000)]
    d = unit(lamp + rng.normal(size=(2000, 3)) * .05 - o)
    h = o + d * (2.6 / d[:, 2:])
    np.concatenate([o, d, h], 1).tofile(tmp_path / "rays")
    run("ilflamps", "-t", "float", "-o", tmp_path / "b.ilf.exr", "--rays", tmp_path / "rays", "--radiance", tmp_path / "rgb", tmp_path / "card.ilf.exr")
    expected = np.fromfile(tmp_path / "rgb", np.float32).reshape(2, 2000, 3)[1]
    found = np.array(run("ilftrace", tmp_path / "b.ilf.exr", stdin=rays_text(o, d, h)).text.split(), float).reshape(-1, 3)
    # rows of floats move a lamp's outline, and a mask's pictures, by little
    assert (np.abs(found - expected).max(1) < 1e-3 * expected.max()).mean() > .99


# ---- a Radiance without our patches --------------------------------------------------------------------

def stock(program, *args, cwd, stdin=b""):
    env = environment(RAYPATH=f".:{BUILD / 'lib'}:{TOP / 'build/lib'}", PATH=f"{STOCK}:{os.environ['PATH']}")
    return execute([STOCK / program, *map(str, args)], cwd=cwd, env=env, input=stdin, capture_output=True, check=True).stdout


def exportable(rng):
    m = masks_of(rng)
    return [(Lamp("sphere", (.3, .4, 2), (90, 80, 60), radius=.2), ["layer", "beam"]),
            (Lamp("rectangle", (-1, .2, 1.7), (50, 60, 70), a=(.3, .1, 0), b=(-.05, .15, 0)), ["layer-logistic"]),
            (Lamp("disc", (1.4, .2, 1.9), (10, 20, 90), a=(.3, 0, .1), b=(0, .3, 0)), ["foot", "gate"]),
            (Lamp("disc", (2.4, 1.2, 1.9), (10, 20, 90), a=(.3, 0, 0), b=(0, .2, 0)), ["foot-beam"]),
            (Lamp("tube", (.2, -1, 1.5), (30, 20, 10), a=(.4, .1, .2), radius=.15), ["ball"]),
            (Lamp("sphere", (-2, 2, 2.5), (30, 20, 10), radius=.2), ["foot-high"])], m


def test_exported_lamps_are_as_bright_behind_what_hides_them(tmp_path):
    rng = np.random.default_rng(12)
    lamps, m = exportable(rng)
    for lamp, masks in lamps:
        lamp.masks = [m[k] for k in masks]
    f = field(rng, [l for l, _ in lamps])
    run("ilflamps", "--export-rad", "out", write_ilf(tmp_path / "a.ilf.exr", f), cwd=tmp_path)
    (tmp_path / "o.oct").write_bytes(stock("oconv", "out/lamps.rad", cwd=tmp_path))
    n = 240
    which = np.arange(n) % len(lamps)
    o = np.stack([rng.uniform(0, 1, n), rng.uniform(0, .8, n), rng.choice([0., .05, .7, 1.1], n)], 1)
    d = unit(np.array([lamps[k][0].c for k in which]) + rng.normal(size=(n, 3)) * .03 - o)
    rays = np.concatenate([f.origin + o @ f.frame(), d @ f.frame()], 1)
    found = np.frombuffer(stock("rtrace", "-h", "-w", "-ffd", "o.oct", cwd=tmp_path, stdin=rays.astype("<f4").tobytes()), "<f8").reshape(-1, 3)
    expected, sure = np.zeros((n, 3)), np.zeros(n, bool)
    for k, (lamp, _) in enumerate(lamps):
        mine = which == k
        ts = np.stack([l.met(o[mine], d[mine]) for l, _ in lamps])
        expected[mine] = lamp.passed(o[mine], d[mine])[:, None] * lamp.rgb
        sure[mine] = np.isfinite(ts[k]) & (ts.argmin(0) == k)
    assert sure.mean() > .8
    off = np.abs(found - expected)[sure].max(1) / 90
    # a mask's edges (a ball, a sheet's samples) are met to a float's precision
    assert np.quantile(off, .97) < 1e-4 and off.mean() < .01


def test_what_has_no_pattern_is_said(tmp_path):
    rng = np.random.default_rng(12)
    m = masks_of(rng)
    rest = Mask("foot", np.zeros((2, 2)), adds=1)
    f = field(rng, [Lamp("sphere", (.3, .4, 2), (9, 8, 6), radius=.2, masks=[m["stack"], rest]),
                    Lamp("sphere", (.3, .4, 900), (9, 8, 6), radius=9, far=1, masks=[m["gate"]])])
    r = run("ilflamps", "--export-rad", "out", write_ilf(tmp_path / "a.ilf.exr", f), cwd=tmp_path)
    assert "lamp 1: twigs or leaves, lamp 1: what its masks leave, lamp 2: what hides it, at infinity" in r.err and len(r.err.splitlines()) == 1
    assert " source lamp_2" in (tmp_path / "out" / "lamps.rad").read_text()
    r = run("ilflamps", "--export-rad", "a b", tmp_path / "a.ilf.exr", cwd=tmp_path, code=1)
    assert "without spaces" in r.err and not (tmp_path / "a b").exists()


def test_the_exported_panorama_is_what_is_left(tmp_path):
    rng = np.random.default_rng(2)
    f = field(rng, two(rng)[:1], n=(1, 1))
    run("ilflamps", "--export-rad", "out", write_ilf(tmp_path / "a.ilf.exr", f), cwd=tmp_path)
    (tmp_path / "o.oct").write_bytes(stock("oconv", "out/panorama.rad", cwd=tmp_path))
    # through the picture's pixels, the outermost of which lie at its edges
    y, x = rng.integers(4, 60, 60), rng.integers(0, 128, 60)
    p, t = y * np.pi / 2 / 63, x * 2 * np.pi / 127 - np.pi
    d = np.stack([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)], 1) @ f.frame()
    o = np.tile(f.origin + f.U / 2 + f.V / 2, (60, 1))
    text = stock("rtrace", "-h", "o.oct", cwd=tmp_path, stdin="".join(" ".join(map(str, r)) + "\n" for r in np.concatenate([o, d], 1)).encode())
    found = np.array(text.split(), float).reshape(-1, 3)
    f.lamps = []
    assert np.abs(found / f.eval(o, d) - 1).max() < .02                # a picture has 8 bits
    assert np.array_equal(read_mosaic(tmp_path / "out" / "residual.ilf.exr")[1], f.mosaic())
