"""What Radiance 6 has beside 5.4: spectra, the simulation managers' programs, a programmable Ward material."""
import os

import numpy as np
import pytest

from conftest import BIN, FETCHED, environment, run
from ilf_util import PI, directional_ilf, f32, unit, write_ilf
from process import execute
from rad_util import Polygon, Ring, Source, Sphere, Surface, material, oconv, read_picture
from render_scene import LUMINANCE, VIEW, far_dome, small_room
from test_radiance_di import EXACT, block_means, integral, replicas

SIX = "RADIANCE 6" in run("rtrace", "-version").text
six_only = pytest.mark.skipif(not SIX, reason="a matter of Radiance 6: build with RADIANCE_SRC")
BANDS = 18
GREY = "\nvoid plastic grey 0 0 5 .5 .5 .5 0 0\n"


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    folder = tmp_path_factory.mktemp("spectra")
    write_ilf(folder / "room.ilf.exr", small_room().light_field(8, 8, 48, 24))
    for name, radiance in (("white", (1, 1, 1)), ("red", (3, 0.5, 0.25))):
        write_ilf(folder / f"{name}.ilf.exr", directional_ilf(lambda d: 0 * d + np.array(radiance), 16, 8, origin=(-0.5, -0.5, 0)))
    return folder


def spectra(folder, octree, rays, *options, bands=BANDS, program="rtrace"):
    """(rays, bands) of rtrace -co+."""
    text = "".join(" ".join(map(repr, map(float, np.ravel(r)))) + "\n" for r in rays)
    r = run(program, "-h", "-cs", bands, "-co+", *options, octree, stdin=text, cwd=folder)
    return np.array([line.split() for line in r.text.splitlines()], float)


def channels(a):
    """Means over the bands of red, green and blue, as Radiance parts 780 ... 380 nm: at 588 and 480 nm."""
    nm = 780 - (np.arange(a.shape[-1]) + 0.5) * 400 / a.shape[-1]
    return np.stack([a[..., part].mean(-1) for part in (nm > 588, (nm < 588) & (nm > 479.9), nm < 479.9)], -1)


def constant(folder, name):
    return oconv(folder, material("env", f"{name}.ilf.exr") + Sphere((0, 0, 0), 10, "bubble").rad("env", "dome") + GREY
                 + Ring((0, 0, 0), (0, 0, 1), 0, 1).rad("grey", "disc"), name)


UP, DOWN = (0, 0, 1, 0, 0.3, 1), (0, 0, 1, 0, 0, -1)


@six_only
@pytest.mark.parametrize("samples", [0, 16])
@pytest.mark.parametrize("bands", [3, 6, 18, 24])
def test_white_is_a_flat_spectrum(room, samples, bands):
    got = spectra(room, constant(room, "white"), [UP, DOWN], "-ab", "1", "-ad", "256", "-di", samples, bands=bands)
    assert got.shape == (2, bands)
    assert np.allclose(got, got[:, :1], rtol=1e-6) and np.allclose(got[:, 0], (1, 0.5), rtol=1e-5)


@six_only
def test_a_color_is_the_spectrum_that_radiance_makes_of_it(room):
    """That of a glow of the same color, in every band and as converted back; and its bands' means are the color."""
    octree = constant(room, "red")
    lamp = oconv(room, "\nvoid glow env 0 0 4 3 .5 .25 0\n" + Sphere((0, 0, 0), 10, "bubble").rad("env", "dome"), "glow")
    got = spectra(room, octree, [UP], "-ab", "0")
    assert np.allclose(got, spectra(room, lamp, [UP], "-ab", "0"), rtol=1e-5)
    assert np.allclose(channels(got), (3, 0.5, 0.25), rtol=1e-6)
    back = [run("rtrace", "-h", "-cs", BANDS, "-ab", "0", o, stdin=" ".join(map(str, UP)), cwd=room).text.split() for o in (octree, lamp)]
    assert np.allclose(*np.array(back, float), rtol=1e-5)


@six_only
@pytest.mark.parametrize("around", ["far", "box"])
def test_spectral_irradiance_is_the_oracles_integral(room, around):
    """-di with 18 bands: each channel's bands have its irradiance, to 5 standard errors."""
    shape = Sphere((0, 0, 0.5), 3.5, "bubble")
    octree = oconv(room, material("env", "room.ilf.exr", depth=around == "box") + shape.rad("env", "dome"), "bands_" + around)
    f = small_room().light_field(8, 8, 48, 24)
    x, n = np.array([0.3, -0.2, 0.1]), unit(np.array([0.2, 0.1, 1.0]))
    got = spectra(room, octree, [np.concatenate([x, n])] * 48, "-I", *EXACT, "-di", "16", "-ad", "256")
    truth = integral([Surface(shape, f, around == "box")], x, n)
    error = channels(got).std(0, ddof=1) / np.sqrt(len(got))
    assert (np.abs(channels(got).mean(0) - truth) < 5 * error + 3e-3 * truth).all(), (channels(got).mean(0), truth, error)
    assert (error < 0.03 * truth).all()


WGMD = """
void WGMDfunc satin 13 void .2 .2 .3 void .15 .1 .2 void 1 0 0 . 0 9 .3 .2 .1 .3 .2 .1 .1 .1 .1
void WGMDfunc coated 13 void .1 0 0 void 0 0 0 void 1 0 0 . 0 9 .4 .3 .2 .4 .3 .2 .1 .1 .1
"""


@six_only
@pytest.mark.parametrize("threshold", ["0", "0.5"])
@pytest.mark.parametrize("mod", ["satin", "coated"])
def test_programmable_ward_material(room, mod, threshold):
    """-di against the literal method, from above, below and near grazing."""
    octree = oconv(room, WGMD + Ring((0, 0, 0.3), (0, 0, 1), 0, 0.3).rad(mod, "disc") + far_dome("room.ilf.exr"), f"wgmd_{mod}{threshold}")
    d = unit(np.array([(0.1, 0.2, -1), (0.1, 0.3, 1), (1, 0.2, -0.5), (-0.3, 1, -0.3)]))
    rays = f32((0, 0, 0.3) - 0.1 * d), f32(d)
    options = [*EXACT, "-st", threshold, "-ss", "16"]
    A, B = (replicas(room, octree, rays, 96, *options, "-di", di, "-ad", ad) @ LUMINANCE for di, ad in (("0", "2048"), ("16", "256")))
    error = np.sqrt((A.var(0, ddof=1) + B.var(0, ddof=1)) / len(A))
    assert (np.abs(A.mean(0) - B.mean(0)) < 5 * error).all(), (A.mean(0), B.mean(0), error)
    assert (error < 0.05 * A.mean(0)).all(), "not much of a comparison"


# ---- the simulation managers' programs ------------------------------------------------------------------------------

SCENE = material("env", "room.ilf.exr") + Sphere((0, 0, 0.5), 3.5, "bubble").rad("env", "dome") + GREY \
    + Polygon((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)).rad("grey", "floor")


@six_only
def test_rxpiece_draws_what_rpict_draws(room):
    octree = oconv(room, SCENE, "piece")
    options = [*VIEW, "-x", "64", "-y", "64", "-ps", "1", "-ab", "1", "-aa", "0", "-ad", "64", "-di", "16"]
    (room / "rpict.hdr").write_bytes(run("rpict", *options, octree, cwd=room).out)
    run("rxpiece", *options, "-X", "2", "-Y", "2", "-o", "rxpiece.hdr", octree, cwd=room)
    a, b = (block_means(read_picture(room, f"{p}.hdr").reshape(1, -1, 3), 64, 64, 16)[0] for p in ("rpict", "rxpiece"))
    assert (a > 0).sum() > 8 and np.allclose(a, b, rtol=0.1, atol=1e-3) and abs(b.sum() / a.sum() - 1) < 0.02


@six_only
@pytest.mark.parametrize("kind, samples", [("-V+", 16), ("-V+", 0), ("-V-", 16)])
def test_rxfluxmtx(room, kind, samples):
    """Contributions of a sky that shows a light field: its irradiance.  Coefficients: pi, by the literal method."""
    f = small_room().light_field(8, 8, 48, 24)
    (room / "scene.rad").write_text(material("env", "room.ilf.exr") + GREY + Ring((0, 0, -0.01), (0, 0, 1), 0, 1).rad("grey", "disc"))
    sky = Source((0, 0, 1), 180)
    (room / "sky.rad").write_text("#@rfluxmtx h=u u=+Y o=flux.mtx\n" + sky.rad("env", "sky"))
    (room / "flux.mtx").unlink(missing_ok=True)
    run("rxfluxmtx", "-fad", "-I+", kind, "-y", "1", "-ab", "1", "-ad", "20000", "-lw", "1e-9", "-di", samples, "-", "sky.rad", "scene.rad",
        stdin="0 0 0.2 0 0 1\n", cwd=room)
    data = (room / "flux.mtx").read_bytes().split(b"\n\n", 1)[1]
    got = np.frombuffer(data[:len(data) // 24 * 24], "<f8").reshape(-1, 3).sum(0)
    expected = integral([Surface(sky, f)], np.array([0, 0, 0.2]), np.array([0, 0, 1.0])) if kind == "-V+" else np.full(3, PI)
    assert np.allclose(got, expected, rtol=0.04 if kind == "-V+" else 1e-3), (got, expected)


def built(program):
    if not os.access(BIN / program, os.X_OK):
        pytest.skip(f"{program} is not built: make {program}")


def test_photon_maps_refuse_in_words(room):
    built("mkpmap")
    octree = oconv(room, SCENE + "\nvoid light bulb 0 0 3 9 9 9\n" + Sphere((0, 0, 1), 0.1).rad("bulb", "lamp"), "photons")
    r = run("mkpmap", "-apg", "photons.pm", "1000", octree, cwd=room, code=None)
    assert r.code == 1 and not (room / "photons.pm").exists()
    assert len(r.err.splitlines()) == 1 and 'photon maps know none of its light for ilf "env"' in r.err, r


# ---- two Radiances -----------------------------------------------------------------------------------------------------

@six_only
@pytest.mark.skipif(BIN == FETCHED or not (FETCHED / "rtrace").is_file(), reason="there is no other Radiance beside this one")
def test_irradiance_is_the_other_radiances(room):
    """The same scene in both: equal to 5 standard errors."""
    octree = oconv(room, SCENE, "both")
    rays = f32(np.array([(0.3, -0.2, 1), (-0.4, 0.3, 1), (0, 0.6, 1)])), f32(np.array([(0, 0, -1.0)] * 3))
    options = ["-h", "-ff", "-i", *EXACT, "-di", "16", "-ad", "256", octree]
    data = np.tile(np.concatenate(rays, 1), (64, 1)).astype("<f4").tobytes()
    got = [np.frombuffer(execute([b / "rtrace", *options], input=data, capture_output=True, cwd=room, env=environment(), check=True).stdout,
                         "<f4").reshape(64, 3, 3) for b in (BIN, FETCHED)]
    error = np.sqrt(sum(a.var(0, ddof=1) / len(a) for a in got))
    assert (np.abs(got[0].mean(0) - got[1].mean(0)) < 5 * error).all(), (got[0].mean(0), got[1].mean(0), error)
    assert (error < 0.02 * got[0].mean(0)).all()


# ---- make radiance-all ------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("program", "rvu mkillum rsensor rxtrace rxpict rxcontrib rxpiece".split())
def test_programs_that_trace_rays_take_the_option(program):
    built(program)
    assert "-di 16 " in run(program, "-defaults").text


@six_only
def test_rtpict_passes_the_option_on(room):
    """rtrace's picture in rpict's clothes: the samples are many, or none."""
    built("rtpict")
    octree = oconv(room, SCENE, "rtpict")
    means = []
    for samples in ("0", "64"):
        out = run("rtpict", "-n", "2", *VIEW, "-x", "24", "-y", "24", "-ps", "1", "-ab", "1", "-aa", "0", "-ad", "4", "-di", samples, octree, cwd=room).out
        (room / "rtpict.hdr").write_bytes(out)
        picture = read_picture(room, "rtpict.hdr") @ LUMINANCE
        means.append(np.abs(np.diff(picture[picture > 0])).mean())
    assert means[1] < 0.6 * means[0], means


@six_only
def test_mkillum_with_the_light_field_behind_the_window(room):
    """The window's distribution holds as much light by either method."""
    built("mkillum")
    octree = oconv(room, SCENE, "illum")
    window = "void glass pane 0 0 3 .9 .9 .9\n#@mkillum i=pane d=32 s=16\n" + Polygon((-0.3, 0.5, 0.1), (0.3, 0.5, 0.1), (0.3, 0.5, 0.5), (-0.3, 0.5, 0.5)).rad("pane", "win")
    got = []
    for samples in ("0", "16"):
        text = run("mkillum", "-di", samples, "-ab", "1", "-ad", "256", octree, stdin=window, cwd=room).text
        assert "illum" in text and ".dat" in text, text
        name = next(w for w in text.split() if w.endswith(".dat"))
        rows = [line.split() for line in (room / name).read_text().splitlines()]
        got.append(np.array([float(x) for row in rows[4:] for x in row]).mean())
    assert got[0] > 0 and abs(got[1] / got[0] - 1) < 0.25, got
