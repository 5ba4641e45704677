"""scenes/composite.py, composite.mk: what differential rendering must leave alone, and a photograph with objects beside one that Radiance renders whole,
its sky a `source` and no light field."""
import json
import sys

import numpy as np
import pytest

from conftest import TOP, run
from ilf_util import directional_ilf, write_ilf
from process import execute
from test_compare import write_hdr
from test_install import make

SCENES = TOP / "scenes"
sys.path.insert(0, str(SCENES))

import compare  # noqa: E402
import composite  # noqa: E402
import pictures  # noqa: E402



@pytest.fixture
def made_up():
    """Photograph (6 x 8), renderings with and without the object (12 x 16), mask: object in the middle, local scene but for two columns."""
    rng = np.random.default_rng(3)
    n = rng.uniform(0.5, 2, (12, 16, 3))
    w = n * rng.uniform(0.6, 1.1, n.shape)
    mask = np.zeros_like(n)
    mask[:, :14, 0] = 1
    mask[3:8, 5:10] = 0, 1, 0
    w[:, 14:] = n[:, 14:]
    return rng.uniform(0.5, 2, (6, 8, 3)), w, n, mask


def test_a_true_local_scene_gives_the_rendering_itself(made_up):
    """Where the photograph is what the rendering without objects shows, both ways give the rendering with them, edges and all."""
    _, w, n, mask = made_up
    p = composite.reduce(n, 2)
    mask[:, 14:, 0] = 1
    whole = composite.reduce(w, 2)
    inner = ~((composite.reduce(mask, 2)[..., 1] > 0) & (composite.reduce(mask, 2)[..., 1] < 1))
    # at an object's edge the photograph is a mean over what the object hides, too
    assert np.allclose(composite.composite(p, w, n, mask)[inner], whole[inner], rtol=1e-12)
    assert np.allclose(composite.composite(p, w, n, mask, "ratio")[inner], whole[inner], rtol=1e-12)


@pytest.mark.parametrize("kind", composite.KINDS)
def test_relations(made_up, kind):
    p, w, n, mask = made_up
    made = composite.composite(p, w, n, mask, kind)
    assert np.allclose(composite.composite(3 * p, 3 * w, 3 * n, mask, kind), 3 * made, rtol=1e-12)                 # another unit
    mirrored = composite.composite(*(np.ascontiguousarray(a[:, ::-1]) for a in (p, w, n, mask)), kind)
    assert np.allclose(mirrored[:, ::-1], made, rtol=1e-12)
    assert np.array_equal(made[:, 7], p[:, 7])                                      # neither local nor object: the photograph
    thing = composite.reduce(mask, 2)[..., 1] == 1
    assert np.allclose(made[thing], composite.reduce(w, 2)[thing], rtol=1e-12) and thing.any()
    if kind != "replace":
        still = composite.composite(p, n, n, mask, kind)
        away = composite.reduce(mask, 2)[..., 1] == 0
        assert np.allclose(still[away], p[away], rtol=1e-12)                        # objects that change nothing


def test_paint_falls_out_of_the_ratio(made_up):
    p, w, n, mask = made_up
    local = mask[..., :1] > 0.5
    other = composite.composite(p, np.where(local, 0.3 * w, w), np.where(local, 0.3 * n, n), mask, "ratio")
    assert np.allclose(other, composite.composite(p, w, n, mask, "ratio"), rtol=1e-12)


def script(*args, code=0):
    p = execute([sys.executable, str(SCENES / "composite.py"), *map(str, args)], capture_output=True, text=True)
    assert p.returncode == code, p.stderr
    return p.stderr


def test_gain_and_refusals(made_up, tmp_path):
    p, w, n, mask = made_up
    w = np.where(mask[..., 1:2] > 0.5, w, n)
    files = {k: write_hdr(tmp_path / f"{k}.hdr", a) for k, a in (("p", composite.reduce(n, 2) / 8), ("w", w), ("n", n), ("m", mask), ("bad", w[:11]))}
    common = "--with", files["w"], "--without", files["n"], "--mask", files["m"], "-o", tmp_path / "out.exr"
    said = script(*common, "--gain", "auto", files["p"])
    assert float(said.split("gain ")[1]) == pytest.approx(8, rel=0.01) and said.count("\n") == 1
    assert [float(x) for x in said.split("rendered is ")[1].split(" of")[0].split(",")] == pytest.approx([1] * 3, abs=0.01)
    got = pictures.read(tmp_path / "out.exr")
    assert np.allclose(got, composite.composite(composite.reduce(n, 2), w, n, mask), rtol=0.03)
    (tmp_path / "out.exr").unlink()
    for args, words in (((*common[:1], files["bad"], *common[2:], files["p"]), "expected a multiple of the photograph's 8 x 6 pixels, found 16 x 11"),
                        ((*common[:4], "--mask", files["n"], *common[6:], files["bad"]), "expected a multiple of the photograph's 16 x 11 pixels"),
                        ((*common, tmp_path / "none.hdr"), "No such file")):
        said = script(*args, code=1)
        assert words in said and said.count("\n") == 1
    assert "expected auto or a number above 0, found 0" in script(*common, "--gain", "0", files["p"], code=2)
    assert not list(tmp_path.glob("out*"))


# ---- beside Radiance ---------------------------------------------------------------------------------------------------
SKY = "void brightfunc west\n2 sky sky.cal\n0\n0\nwest glow all\n0\n0\n4 1 1 1 0\nall source sky\n0\n0\n4 0 0 1 180\n"
TABLE = "void plastic paint\n0\n0\n5 {0} {0} {0} 0 0\npaint ring top\n0\n0\n8 0 0 -.001 0 0 1 0 4\n"
THINGS = "void plastic red\n0\n0\n5 .5 .1 .1 0 0\nred sphere ball\n0\n0\n4 -.1 0 .1 .1\n!genbox red cube .12 .12 .2 | xform -t .05 -.1 0\n"
VIEW = "rvu -vtv -vp .1 -1.1 .8 -vd -.1 1.1 -.72 -vu 0 0 1 -vh 36 -vv 27.4\n"


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A table under a sky that is nine times as bright in the east as in the west: photographs by stock materials, the light field by its formula."""
    d = tmp_path_factory.mktemp("place")
    (d / "sky.cal").write_text("sky = 1 + .8*Dx;\n")
    (d / "sky.rad").write_text(SKY)
    (d / "table.rad").write_text(TABLE.format(".5"))
    (d / "dark.rad").write_text(TABLE.format(".35"))
    (d / "things.rad").write_text(THINGS)
    (d / "view.vf").write_text(VIEW)
    (d / "far.rad").write_text("far source all\n0\n0\n4 0 0 1 180\n")
    field = directional_ilf(lambda v: np.repeat(1 + 0.8 * v[..., :1], 3, -1), 48, 96)
    write_ilf(d / "room.ilf.exr", field)
    for name, parts in (("photo", ["sky.rad", "table.rad", "things.rad"]), ("plate", ["sky.rad", "table.rad"])):
        (d / f"{name}.oct").write_bytes(run("oconv", *parts, cwd=d).out)
        (d / f"{name}.big.hdr").write_bytes(run("rpict", "-w", "-vf", "view.vf", "-pa", "0", "-x", 96, "-y", 72, "-ps", 1, "-pj", 0, "-ab", 2, "-aa", ".1", "-ad", 1024,
                                                "-as", 0, "-ar", 64, f"{name}.oct", cwd=d).out)
        (d / f"{name}.hdr").write_bytes(run("pfilt", "-1", "-x", "/2", "-y", "/2", f"{name}.big.hdr", cwd=d).out)
    return d


def test_a_photograph_with_objects(place):
    """make composite with files of one's own: the difference beside Radiance's own photograph; a wrong paint, which is said, and ratios."""
    p = make("composite", f"PLATE={place}/plate.hdr", f"FIELD={place}/room.ilf.exr", f"VIEW={place}/view.vf", f"LOCAL={place}/dark.rad",
             f"OBJECTS={place}/things.rad", f"AROUND={place}/far.rad", f"OUT={place}/out", "GAIN=1", "AD=128")
    assert p.returncode == 0, p.stderr
    factors = [float(x) for x in p.stderr.split("rendered is ")[1].split(" of")[0].split(",")]
    assert factors == pytest.approx([0.7] * 3, abs=0.03), p.stderr
    photo, plate = (pictures.read(place / f"{k}.hdr") for k in ("photo", "plate"))
    w, n, mask = (pictures.read(place / f"out/{k}.big.hdr") for k in ("with_room", "without_room", "mask"))
    local = composite.reduce(composite.layers(mask)[1].astype(float), 2) == 1
    shadowed = local & (np.abs(photo - plate).sum(-1) > 0.05 * plate.sum(-1))
    assert 100 < shadowed.sum() < 1200

    def error(kind, scale=1.0):
        made = composite.composite(plate, *(np.where(mask[..., :1] > 0.5, scale * a, a) for a in (w, n)), mask, kind)
        return compare.rmse(made, photo, shadowed)
    right, ratio, dark, replaced, pasted = error("difference", 1 / 0.7), error("ratio"), error("difference"), error("replace"), error("none")
    print(f"shadow of the objects, RMSE: difference {right:.3f}, ratio {ratio:.3f}, difference with a dark paint {dark:.3f}, "
          f"rendered with it {replaced:.3f}, no shadow {pasted:.3f}")
    assert right < 0.04 and ratio < 0.04 and right < dark / 2 and replaced > 0.2 and pasted > 4 * right
    made = pictures.read(place / "out/composite.difference.exr")
    assert compare.rmse(made, photo, shadowed) == pytest.approx(dark, rel=0.05)
    log = json.loads((place / "out/composite.difference.json").read_text())
    assert log["cpu_s"] > 0 and log["command"].count("rpict") == 2


def test_what_is_missing_is_said(place):
    p = make("composite", f"PLATE={place}/plate.hdr", f"FIELD={place}/room.ilf.exr", f"VIEW={place}/view.vf")
    assert p.returncode == 2 and "expected LOCAL=FILE OBJECTS=FILE AROUND=FILE, too" in p.stderr
    p = make("composite", *(f"{k}={place}/plate.hdr" for k in ("PLATE", "FIELD", "VIEW", "LOCAL", "OBJECTS")), f"AROUND={place}/none.rad")
    assert p.returncode == 2 and "expected a file, found none" in p.stderr and "none.rad" in p.stderr
