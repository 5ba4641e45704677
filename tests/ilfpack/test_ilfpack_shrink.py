"""Light fields that shrink: ilfpack --tolerance, ilflamps --tolerance and --probes, ilfinfo --shrink."""
import os
import re

import numpy as np
import pytest
from conftest import run
from ilf_util import ILF, Lamp, Mask, directional_ilf, random_ilf, read_mosaic, write_ilf
from test_ilf_lamps import contents

LUM = np.array([.265, .67, .065])
BITS = {.05: 4, .01: 6, .001: 9, .0001: 13}   # after the leading one: 2^-(bits + 1) <= tolerance


def nearest(v, bits, step):
    """The nearest multiple of 2^(e-bits), v in [2^e, 2^(e+1)), or of the type's own smallest step; ties to even."""
    _, e = np.frexp(v)
    q = np.exp2(np.maximum(e - 1. - bits, step))
    return np.round(v / q) * q


def mosaic(path):
    return read_mosaic(path)[1].astype(float)


def field(v, **plane):
    return ILF(v, **plane)


def values(rng, shape, half):
    """Twelve decades of either sign, with what is stiff among them."""
    v = 10 ** rng.uniform(-8, 4, shape) * rng.choice([-1, 1, 1, 1], shape)
    stiff = [0, 65504, -65504, 65000, 2. ** -14, 2. ** -15 * 1.01, 2. ** -24, -3 * 2. ** -24, 1.0039062, 1.01171875, 1.9999, -1.9999]
    v.reshape(-1)[:len(stiff)] = stiff
    return v.astype(np.float16 if half else np.float32).astype(float)


@pytest.mark.parametrize("kind", ["half", "float"])
def test_texels_within_the_tolerance(tmp_path, kind):
    v = values(np.random.default_rng(1), (2, 3, 8, 16, 3), kind == "half")
    path = write_ilf(tmp_path / "a.ilf.exr", field(v), half=kind == "half")
    least, most, step = (2. ** -14, 65504, -24) if kind == "half" else (2. ** -126, 3.4e38, -149)
    for tolerance, bits in BITS.items():
        p = run("ilfpack", "--tolerance", f"{100 * tolerance:g}%", "-o", tmp_path / "b.ilf.exr", path)
        was, found = mosaic(path), mosaic(tmp_path / "b.ilf.exr")
        expected = nearest(np.where(was == 0, 1, was), min(bits, 10) if kind == "half" else bits, step) * (was != 0)
        expected = np.where(abs(expected) > most, was, expected)
        assert np.array_equal(found, expected) and np.array_equal(found == 0, was == 0)
        off = abs(found / np.where(was == 0, 1, was) - (was != 0))[abs(was) >= least].max()
        assert off <= tolerance and f"by {100 * off:.2g} % at most" in p.err
        assert contents(tmp_path / "b.ilf.exr")[0].keys() == contents(path)[0].keys()
        run("ilfpack", "--tolerance", str(tolerance), "-o", tmp_path / "c.ilf.exr", tmp_path / "b.ilf.exr")
        assert np.array_equal(found, mosaic(tmp_path / "c.ilf.exr"))


def test_up_as_often_as_down(tmp_path):
    v = np.exp(np.random.default_rng(2).normal(size=(4, 4, 32, 64, 3))).astype(np.float32).astype(float)
    path = write_ilf(tmp_path / "a.ilf.exr", field(v))
    p = run("ilfpack", "--tolerance", "5%", "-t", "half", "-o", tmp_path / "b.ilf.exr", path)
    was, found = mosaic(path), mosaic(tmp_path / "b.ilf.exr")
    change = found / was - 1
    n = change.size
    # relative steps even over an octave of a smooth density shift a mean by less than their square
    assert abs(change.mean()) < 4 * change.std() / np.sqrt(n) + .5 ** 10 / 6
    assert abs((found - was).mean()) < 4 * (found - was).std() / np.sqrt(n)
    up = (change > 0).sum() / (change != 0).sum()
    assert abs(up - .5) < 4 * .5 / np.sqrt(n) + .03
    # what is said of irradiance, from its definition
    phi = (np.arange(33)) * np.pi / 64
    w = (np.sin(phi[1:]) ** 2 - np.sin(phi[:-1]) ** 2) * np.pi / 64
    E = [(f.reshape(4, 32, 4, 64, 3) @ LUM).sum(3).transpose(0, 2, 1) @ w for f in (was, found)]
    rel = E[1] / E[0] - 1
    said = re.search(r"by (\S+) % \(rms\), at worst (\S+) % \(probe \((\d),(\d)\)\), all together (\S+) %", p.err).groups()
    j, i = np.unravel_index(abs(rel).argmax(), rel.shape)
    assert float(said[0]) == pytest.approx(100 * np.sqrt((rel ** 2).mean()), rel=.06)
    assert float(said[1]) == pytest.approx(100 * rel[j, i], rel=.06) and (int(said[2]), int(said[3])) == (i, j)
    assert float(said[4]) == pytest.approx(100 * (E[1].sum() / E[0].sum() - 1), rel=.6, abs=1e-6)


def lamps(rng):
    m = Mask("layer", rng.uniform(0, 1, (5, 7)), plane=(.8, 0, 0), at=(-.2, -.2), step=(.2, .3))
    return [Lamp("sphere", (.3, .4, 2), (90, 80, 60), radius=.2, masks=[m], errors=(.1, .2, .003, .01), seen=rng.uniform(0, 1, (6, 6)))]


@pytest.fixture(scope="module")
def lit(tmp_path_factory):
    """The same light everywhere, and a lamp that was taken out."""
    rng = np.random.default_rng(4)
    one = directional_ilf(lambda d: 2 + d @ np.array([[1, .2, .3], [.1, .5, 1], [.4, .4, .4]]) + .2 * np.sin(9 * d), 32, 16)
    f = ILF(np.broadcast_to(one.probes, (6, 6, 16, 32, 3)).copy(), origin=(1, 2, 3))
    f.lamps = lamps(rng)
    return write_ilf(tmp_path_factory.mktemp("lit") / "a.ilf.exr", f, extra={"owner": "the house", "comments": "made by hand"})


def test_lamps_stay_as_they_are(lit, tmp_path):
    run("ilfpack", "--tolerance", "2%", "-o", tmp_path / "b.ilf.exr", lit)
    run("ilflamps", "--tolerance", "2%", "-t", "float", "-o", tmp_path / "c.ilf.exr", lit)
    (head, pixels), b, c = (contents(p) for p in (lit, tmp_path / "b.ilf.exr", tmp_path / "c.ilf.exr"))
    for other, texels in (b, c):
        assert all(np.array_equal(head[k], other[k]) for k in head)
        assert pixels.keys() == texels.keys() and all(np.array_equal(pixels[k], texels[k]) for k in pixels if k[0] != "probes")
    assert np.array_equal(mosaic(tmp_path / "b.ilf.exr"), mosaic(tmp_path / "c.ilf.exr"))
    header = read_mosaic(tmp_path / "b.ilf.exr")[0]
    assert header["owner"] == "the house" and header["comments"].startswith("made by hand\nilfpack --tolerance 2% -o ")


def test_forms_of_one_field_are_the_same_field(tmp_path):
    f = random_ilf(np.random.default_rng(6), 3, 2, 16, 8, half=True, kind="185deg", polar_valid=1.2)
    path = write_ilf(tmp_path / "a.ilf.exr", f, half=True)
    for k, form in enumerate((["-c", "piz"], ["--interleave"], ["-t", "float", "-c", "zips"], [])):
        run("ilfpack", *form, "-o", tmp_path / f"{k}.ilf.exr", tmp_path / f"{k - 1}.ilf.exr" if k else path)
        assert np.array_equal(mosaic(path), mosaic(tmp_path / f"{k}.ilf.exr"))
        assert [line for line in run("ilfinfo", tmp_path / f"{k}.ilf.exr").text.splitlines() if line[:5] in ("origi", "U    ", "V    ", "polar", "radia", "grid ")] == \
            [line for line in run("ilfinfo", path).text.splitlines() if line[:5] in ("origi", "U    ", "V    ", "polar", "radia", "grid ")]


@pytest.mark.parametrize("words, found", [
    (["--tolerance", "0"], "expected a share above 0 and to 50%"), (["--tolerance", "60%"], "found '60%'"), (["--tolerance", "one"], "found 'one'"),
    (["--polar-max", "90"], "expected no other option"), (["--type", "double"], "expected half or float")])
def test_refused(lit, tmp_path, words, found):
    p = run("ilfpack", *words, "-o", tmp_path / "b.ilf.exr", lit, code=2)
    assert found in p.err and p.err.count("\n") == 1 and os.listdir(tmp_path) == []


def test_as_few_probes_as_do(lit, tmp_path):
    p = run("ilflamps", "--probes", "auto", "-t", "float", "-o", tmp_path / "b.ilf.exr", lit)
    assert "2x2 probes for 6x6" in p.err and "rms" in p.err
    head, texels = contents(tmp_path / "b.ilf.exr")
    was = contents(lit)
    assert all(np.array_equal(was[0][k], head[k]) for k in head)
    assert np.array_equal(texels["mask.1", "Y"], was[1]["mask.1", "Y"])
    seen = was[1]["measured", "lamp.1"]
    assert np.array_equal(texels["measured", "lamp.1"], seen[::5, ::5])
    assert np.allclose(mosaic(tmp_path / "b.ilf.exr")[:16, :32], mosaic(lit)[:16, :32], rtol=2e-3)
    run("ilflamps", "--probes", "3x4", "-o", tmp_path / "c.ilf.exr", lit)
    assert "grid          3 x 4 probes" in run("ilfinfo", "--header", tmp_path / "c.ilf.exr").text
    assert "goes with --probes auto" in run("ilflamps", "--error", "1%", "-o", tmp_path / "d.ilf.exr", lit, code=2).err


def test_all_probes_where_fewer_do_not(tmp_path):
    rng = np.random.default_rng(8)
    f = random_ilf(rng, 6, 6, 16, 8)
    f.probes *= rng.uniform(.5, 1.5, (6, 6, 1, 1, 1))
    f.lamps = lamps(rng)
    p = run("ilflamps", "--probes", "auto", "-o", tmp_path / "b.ilf.exr", write_ilf(tmp_path / "a.ilf.exr", f))
    assert "all 6x6 probes stay" in p.err
    assert "grid          6 x 6 probes" in run("ilfinfo", "--header", tmp_path / "b.ilf.exr").text


def test_what_it_would_shrink_to(tmp_path):
    f = random_ilf(np.random.default_rng(9), 3, 3, 64, 32, half=True)
    path = write_ilf(tmp_path / "a.ilf.exr", f, half=True)
    text = run("ilfinfo", "--header", "--shrink", path).text
    for line, words in (("zipped", ["-c", "zip"]), ("rounded", ["--tolerance", "1%"])):
        run("ilfpack", *words, "-o", tmp_path / "b.ilf.exr", path)
        said = float(re.search(rf"{line} +about (\S+) MB", text).group(1))
        assert said == pytest.approx(os.path.getsize(tmp_path / "b.ilf.exr") / 1e6, rel=.02)
