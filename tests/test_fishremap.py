"""fishremap on one picture: frames, accuracy against analytic scenes, energy, round trips, bad input."""
import json

import numpy as np
import pytest

import fishremap_util as U
from conftest import one_line_error, run, shared_data


def remap(tmp_path, image, *args, name="in.exr", code=0):
    """Write the picture, remap it; pixels of the result (or the failed run)."""
    U.write_exr(tmp_path / name, image)
    r = run("fishremap", *args, "-o", tmp_path / "out.exr", tmp_path / name, code=code)
    return r if code else U.read_exr(tmp_path / "out.exr")[0]


# ---- the command ---------------------------------------------------------------------------------

def test_help_version_and_usage():
    assert "--polar-max" in run("fishremap", "--help").text
    assert run("fishremap", "--version").text.startswith("fishremap")
    one_line_error(run("fishremap", code=2), "fishremap", "expected", "input")
    one_line_error(run("fishremap", "--lens", "equidistant", "--size", "8x8", "a.exr", code=2), "fishremap", "-o")
    one_line_error(run("fishremap", "--size", "8x8", "-o", "b.exr", "a.exr", code=2), "fishremap", "--lens")
    one_line_error(run("fishremap", "--size", "8by8", "-o", "b.exr", "a.exr", code=2), "fishremap", "8by8")


@pytest.mark.parametrize("args, words", [
    (("--lens", "equidistant", "--fov", "185"), ("missing.exr",)),
    (("--lens", "nolens", "--fov", "185"), ("equisolid", "nolens")),
    (("--lens", "orthographic", "--fov", "185"), ("180", "185")),
    (("--lens", "equidistant"), ("--fov",)),
    (("--lens", "equidistant", "--fov", "400"), ("360", "400")),
])
def test_refusals(tmp_path, args, words):
    if "missing.exr" not in words:
        U.write_exr(tmp_path / "missing.exr", np.ones((16, 16, 3)))
    r = run("fishremap", *args, "--size", "8x8", "-o", tmp_path / "o.exr", tmp_path / "missing.exr", code=1)
    one_line_error(r, "fishremap", *words)
    assert not (tmp_path / "o.exr").exists()


# ---- frames (contract, section 1) -----------------------------------------------------------------

@pytest.mark.parametrize("model", U.MODELS)
@pytest.mark.parametrize("theta, phi", [(0, 30), (90, 50), (-140, 70), (35, 8)])
def test_one_lit_direction_fisheye(tmp_path, model, theta, phi):
    fov = 180 if model == "orthographic" else 190
    image = U.fisheye(U.lamp(theta, phi, 6), 200, fov, model, samples=4)
    got = U.brightest(remap(tmp_path, image, "--lens", model, "--fov", fov, "--size", "120x60"), 90)
    assert got == pytest.approx((theta, phi), abs=0.25)


@pytest.mark.parametrize("theta, phi", [(0, 30), (90, 50), (-140, 85), (35, 140)])
def test_one_lit_direction_ball(tmp_path, theta, phi):
    image = U.disc(U.lamp(theta, phi, 8), 220, 200, 100, 105, 90, U.ball_angle, mirror=True, samples=4, outside=0)
    got = remap(tmp_path, image, "--from", "ball", "--centre", "100,105", "--radius", 90, "--size", "120x90", "--polar-max", 180)
    assert U.brightest(got, 180) == pytest.approx((theta, phi), abs=0.5)


@pytest.mark.parametrize("rotate", [90, -37.5, 180])
def test_rotate_turns_the_picture_first(tmp_path, rotate):
    image = U.fisheye(U.lamp(20, 40, 6), 200, 185, rotate=rotate, samples=4)
    got = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "120x60", "--rotate", rotate)
    assert U.brightest(got, 90) == pytest.approx((20, 40), abs=0.25)


def test_tilt_leans_the_axis(tmp_path):
    # the lamp on the axis of a camera that leans 10 degrees to the picture's top (+v) stands at phi 10, theta 90
    image = U.fisheye(U.lamp(0, 0, 6), 200, 185, samples=4)
    got = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "120x60", "--tilt", 10)
    assert U.brightest(got, 90) == pytest.approx((90, 10), abs=0.25)
    # and to the picture's right (-u)
    got = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "120x60", "--tilt", 10, "--tilt-to", 0)
    theta, phi = U.brightest(got, 90)
    assert (abs(theta), phi) == pytest.approx((180, 10), abs=0.25)


def test_centre_and_radius_off_the_middle(tmp_path):
    image = U.disc(U.lamp(20, 40, 6), 260, 210, 120.3, 99.6, 95.5, lambda r: r * np.radians(92.5), samples=4, outside=0)
    got = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "120x60", "--centre", "120.3,99.6", "--radius", 95.5)
    assert U.brightest(got, 90) == pytest.approx((20, 40), abs=0.1)


# ---- accuracy against exact area means (1024-pixel fisheye, 185 degrees, as in the peers' measurement) -------

SIZES = [(400, 400, 90, 4), (1024, 512, 180, 3), (64, 64, 90, 20)]


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes")
    scene = U.lobes()
    U.write_exr(folder / "lobes.exr", U.fisheye(scene, 1024, 185, samples=3))
    U.write_exr(folder / "checker.exr", U.fisheye(U.checker, 1024, 185, samples=3))
    return folder, {"lobes": scene, "checker": U.checker}


def inside(h, polar_max):
    return U.probe_angles(1, h, polar_max)[1] < 91


@pytest.mark.parametrize("w, h, polar_max, samples", SIZES)
def test_lobes_to_1e_4(pictures, tmp_path, w, h, polar_max, samples):
    folder, scenes = pictures
    run("fishremap", "--lens", "equidistant", "--fov", 185, "--size", f"{w}x{h}", "--polar-max", polar_max, "-o", tmp_path / "o.exr", folder / "lobes.exr")
    got = U.read_exr(tmp_path / "o.exr")[0][..., :3]
    exact = U.probe(scenes["lobes"], w, h, polar_max, samples)
    assert U.rel_rmse(got, exact, inside(h, polar_max)) < 1e-4


def bilinear(image, x, y):
    """OpenCV's remap with INTER_LINEAR and a black border, written out."""
    h, w = image.shape[:2]
    x, y = x - .5, y - .5
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    u, v = (x - i)[..., None], (y - j)[..., None]

    def at(jj, ii):
        ok = (ii >= 0) & (jj >= 0) & (ii < w) & (jj < h)
        return np.where(ok[..., None], image[jj.clip(0, h - 1), ii.clip(0, w - 1)], 0)
    return (1 - v) * ((1 - u) * at(j, i) + u * at(j, i + 1)) + v * ((1 - u) * at(j + 1, i) + u * at(j + 1, i + 1))


def supersampled(image, w, h, polar_max, n):
    """The best of the measured peers on edges: n x n bilinear samples a texel, averaged."""
    total = 0
    for a in range(n):
        for b in range(n):
            y, x = np.mgrid[0:h, 0:w]
            theta, phi = -np.pi + (x + (a + .5) / n) * 2 * np.pi / w, (y + (b + .5) / n) * polar_max / h
            r = phi / 92.5 * 512
            total = total + bilinear(image, 512 - r * np.cos(theta), 512 - r * np.sin(theta))
    return total / n ** 2


@pytest.mark.parametrize("w, h, polar_max, samples", SIZES)
def test_checker_beats_the_best_peer_by_a_quarter(pictures, tmp_path, w, h, polar_max, samples):
    folder, scenes = pictures
    run("fishremap", "--lens", "equidistant", "--fov", 185, "--size", f"{w}x{h}", "--polar-max", polar_max, "-o", tmp_path / "o.exr", folder / "checker.exr")
    source = U.read_exr(folder / "checker.exr")[0]
    exact = U.probe(scenes["checker"], w, h, polar_max, samples + 3)
    rows = inside(h, polar_max)
    ours = U.rel_rmse(U.read_exr(tmp_path / "o.exr")[0][..., :3], exact, rows)
    peers = min(U.rel_rmse(supersampled(source, w, h, polar_max, n), exact, rows) for n in (1, 3))
    assert ours < 0.75 * peers, (ours, peers)


@pytest.mark.parametrize("size", ["64x64", "400x400", "1024x512"])
@pytest.mark.parametrize("diameter", [2, 0.2])
@pytest.mark.parametrize("theta, phi", [(33.3, 61.7), (-100.2, 7.03), (179.9, 84.1)])
def test_a_lamp_keeps_its_energy(tmp_path, size, diameter, theta, phi):
    scene, n, fov = U.lamp(theta, phi, diameter), 1024, 185
    # only the window around the lamp needs samples: 40 x 40 a pixel
    r, c = phi / 92.5 * 512, np.radians(theta)
    x, y, reach = 512 - r * np.cos(c), 512 - r * np.sin(c), int(3 + diameter * 6)
    window = (max(int(x) - reach, 0), max(int(y) - reach, 0), min(int(x) + reach, n), min(int(y) + reach, n))
    image = np.zeros((n, n, 3))
    image[window[1]:window[3], window[0]:window[2]] = U.disc(scene, n, n, 512, 512, 512, lambda q: q * np.radians(fov / 2), samples=40, window=window)
    w, h = map(int, size.split("x"))
    polar_max = 180 if w == 1024 else 90
    got = remap(tmp_path, image, "--lens", "equidistant", "--fov", fov, "--size", size, "--polar-max", polar_max)
    energy = (got[..., 1] * U.probe_solid_angle(w, h, polar_max)[:, None]).sum()
    exact = 1000 * 2 * np.pi * (1 - np.cos(np.radians(diameter / 2)))
    assert energy == pytest.approx(exact, rel=0.005)
    assert got.min() >= 0


# ---- properties ------------------------------------------------------------------------------------

@pytest.mark.parametrize("args", [
    ("--lens", "equidistant", "--fov", "185", "--size", "400x400"),
    ("--lens", "equisolid", "--fov", "180", "--size", "37x91"),
    ("--lens", "orthographic", "--fov", "180", "--size", "64x64"),
    ("--lens", "stereographic", "--fov", "220", "--size", "300x200", "--polar-max", "110", "--tilt", "20"),
    ("--from", "ball", "--size", "128x128", "--polar-max", "180"),
    ("--from", "latlong", "--to", "probe", "--size", "90x45"),
    ("--from", "probe", "--to", "fisheye", "--lens", "equidistant", "--fov", "180", "--size", "64x64"),
])
def test_a_constant_stays_constant(tmp_path, args):
    got = remap(tmp_path, np.full((256, 256, 3), .7), *args)
    seen = got[..., 3] > 0 if got.shape[2] == 4 else np.ones(got.shape[:2], bool)
    assert seen.any()
    assert np.abs(got[seen][:, :3] / np.float32(.7) - 1).max() < 1e-6


def test_results_do_not_depend_on_threads(tmp_path):
    image = U.write_exr(tmp_path / "in.exr", U.fisheye(U.lobes(), 200, 185))
    for t in (1, 2, 5):
        run("fishremap", "--threads", t, "--lens", "equidistant", "--fov", 185, "--size", "90x70", "-o", tmp_path / f"{t}.exr", image)
    first = U.read_exr(tmp_path / "1.exr")[0]
    assert all(np.array_equal(first, U.read_exr(tmp_path / f"{t}.exr")[0]) for t in (2, 5))


@pytest.mark.parametrize("between, size", [("latlong", "1024x512"), ("angular", "640x640"), ("probe", "900x450")])
def test_there_and_back(tmp_path, between, size):
    """Twice through a finer grid: the picture's own pixels come back, blurred by less than a third of a pixel."""
    image = U.fisheye(U.lobes(12, 3), 200, 185, samples=3)
    lens = ("--lens", "equidistant", "--fov", 185)
    polar = ("--polar-max", 100) if between == "probe" else ()
    U.write_exr(tmp_path / "a.exr", image)
    run("fishremap", *lens, *polar, "--to", between, "--size", size, "-o", tmp_path / "b.exr", tmp_path / "a.exr")
    run("fishremap", *lens, *polar, "--from", between, "--to", "fisheye", "--size", "200x200", "-o", tmp_path / "c.exr", tmp_path / "b.exr")
    back = U.read_exr(tmp_path / "c.exr")[0]
    y, x = np.mgrid[0:200, 0:200]
    well = np.hypot(x + .5 - 100, y + .5 - 100) < 97
    blur = np.zeros_like(image)   # a third of a pixel, as a stencil: variance 1/9
    blur[1:-1, 1:-1] = image[1:-1, 1:-1] + (image[2:, 1:-1] + image[:-2, 1:-1] + image[1:-1, 2:] + image[1:-1, :-2] - 4 * image[1:-1, 1:-1]) / 18
    error = np.sqrt(((back[..., :3] - image)[well] ** 2).mean())
    assert error < np.sqrt(((blur - image)[well] ** 2).mean()) + 1e-3 * image.mean()


def test_full_circles_of_rotation(tmp_path):
    image = U.write_exr(tmp_path / "in.exr", U.fisheye(U.lobes(), 200, 185))
    got = []
    for turn in (0, 360, -720):
        run("fishremap", "--lens", "equidistant", "--fov", 185, "--size", "90x70", "--rotate", turn, "-o", tmp_path / "o.exr", image)
        got.append(U.read_exr(tmp_path / "o.exr")[0])
    assert np.allclose(got[0], got[1], rtol=1e-5) and np.allclose(got[0], got[2], rtol=1e-5)


# ---- outside the picture ---------------------------------------------------------------------------

def test_outside_is_marked_never_invented(tmp_path):
    image = np.ones((200, 200, 3))
    args = ("--lens", "equidistant", "--fov", "185", "--size", "72x60", "--polar-max", "180")
    got = remap(tmp_path, image, *args)
    phi = U.probe_angles(72, 60, 180)[1]
    assert got.shape[2] == 4
    assert (got[phi < 90][..., 3] == 1).all() and (got[phi > 94] == 0).all()
    black = remap(tmp_path, image, *args, "--outside", "black")
    assert black.shape[2] == 3 and (black[phi > 94] == 0).all()
    hold = remap(tmp_path, image, *args, "--outside", "hold")
    assert hold.shape[2] == 3 and np.allclose(hold, 1, rtol=1e-6)


def test_circle_partly_outside_the_frame(tmp_path):
    """The lower third of the image circle is cut off: there alpha is 0, elsewhere the values are right."""
    scene = U.lobes(8, 2)
    image = U.disc(scene, 300, 200, 150, 150, 150, lambda r: r * np.radians(92.5), samples=3)
    got = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "90x45", "--centre", "150,150", "--radius", 150)
    exact = U.probe(scene, 90, 45, 90, 8)
    seen = got[..., 3] == 1
    assert 0.6 < seen.mean() < 0.95
    assert np.sqrt(((got[..., :3] - exact)[seen] ** 2).mean()) < 2e-3 * exact.mean()
    theta, phi = np.meshgrid(*U.probe_angles(90, 45, 90))
    below = np.sin(np.radians(-theta)) * phi / 92.5 * 150 > 60   # picture y beyond the frame by more than a texel
    assert (got[below] == 0).all()


# ---- --filter --------------------------------------------------------------------------------------------

def gaussian_probe(scene, w, h, polar_max, sd, rows, samples=10, reach=4):
    """Gaussian means by solid angle at all texels of some rows, summed over points; beyond the pole half a turn on."""
    out = np.zeros((len(rows), w, 3))
    offset = (np.arange(-reach * samples, reach * samples) + .5) / samples * sd * 1.25
    g = np.exp(-offset ** 2 / 2 / sd ** 2)
    theta = -np.pi + (np.arange(w)[:, None] + .5 + offset) * 2 * np.pi / w
    for k, y in enumerate(rows):
        phi = (y + .5 + offset) * np.radians(polar_max) / h
        inside = phi <= np.radians(polar_max)
        for p, gp in zip(phi[inside], g[inside]):
            d = np.stack([np.sin(p) * np.cos(theta), np.sin(p) * np.sin(theta), np.full_like(theta, np.cos(p))], -1)
            out[k] += gp * abs(np.sin(p)) * (scene(d) * g[:, None]).sum(1)
        out[k] /= (g[inside] * np.abs(np.sin(phi[inside]))).sum() * g.sum()
    return out


@pytest.mark.parametrize("sd", [.25, .5, 2])
def test_gaussian_filter(pictures, tmp_path, sd):
    """The program's sums over finer texels against sums over points of the scene itself."""
    folder, scenes = pictures
    w, h = 48, 32
    name = "gaussian" if sd == .5 else f"gaussian:{sd}"
    run("fishremap", "--lens", "equidistant", "--fov", 185, "--size", f"{w}x{h}", "--filter", name, "-o", tmp_path / "o.exr", folder / "lobes.exr")
    got = U.read_exr(tmp_path / "o.exr")[0]
    assert got.shape == (h, w, 3)
    rows = [0, 1, 2, 9, 21, 30, 31]
    exact = gaussian_probe(scenes["lobes"], w, h, 90, sd, rows)
    assert np.sqrt(((got[rows] - exact) ** 2).mean()) < 2e-3 * exact.mean()
    # and it is not the mean over the area, which is about as wide as a Gaussian of .29
    run("fishremap", "--lens", "equidistant", "--fov", 185, "--size", f"{w}x{h}", "--filter", "area", "-o", tmp_path / "a.exr", folder / "lobes.exr")
    area = U.read_exr(tmp_path / "a.exr")[0]
    assert np.sqrt(((area[rows] - exact) ** 2).mean()) > (2e-3 if sd == .25 else 5e-3) * exact.mean()


@pytest.mark.parametrize("to, size", [("probe", "40x21"), ("probe", "7x9"), ("latlong", "64x32"), ("fisheye", "50x50")])
def test_gaussian_filter_keeps_constants_and_energy(tmp_path, to, size):
    lens = ("--lens", "equidistant", "--fov", 360)
    got = remap(tmp_path, np.full((300, 300, 3), .25), *lens, "--to", to, "--polar-max", 180, "--size", size, "--filter", "gaussian:0.8")
    seen = got[got[..., 3] > 0] if got.shape[2] == 4 else got
    assert np.abs(seen[..., :3] / .25 - 1).max() < 1e-6
    if size != "40x21":
        return
    # away from the poles a row's weights are sin(phi) times the Gaussian, whose sum is exp(-sd^2/2) sin(phi): a mean that keeps
    # constants gives a lamp exp(sd^2/2) of its energy, sd without the finer texels' own width, whose solid angles are sines, too
    U.write_exr(tmp_path / "lamp.exr", U.fisheye(U.lamp(40, 70, 30), 1200, 360))
    row = np.pi / 21
    expected = np.exp((.8 ** 2 - 1 / 12 / 9) * row ** 2 / 2) * np.sin(row / 2) / (3 * np.sin(row / 6))
    sums = []
    for name in ("area", "gaussian:0.8"):
        run("fishremap", *lens, "--polar-max", 180, "--size", size, "--filter", name, "-o", tmp_path / "o.exr", tmp_path / "lamp.exr")
        sums.append((U.read_exr(tmp_path / "o.exr")[0][..., 1] * U.probe_solid_angle(40, 21, 180)[:, None]).sum())
    assert abs(sums[1] / sums[0] / expected - 1) < 3e-4


def test_gaussian_filter_goes_over_the_pole(tmp_path):
    """A lamp just beside it: its Gaussian reaches as far on the other side, in an even and in an odd number of columns."""
    image = U.fisheye(U.lamp(90, 3, 5), 400, 185, samples=3)
    for w in (24, 25):
        got = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", f"{w}x30", "--filter", "gaussian:2")[0, :, 1]
        exact = gaussian_probe(U.lamp(90, 3, 5), w, 30, 90, 2, [0], samples=40)[0, :, 1]
        assert np.abs(got - exact).max() < .02 * exact.max()


@pytest.mark.parametrize("bad", ["lanczos", "gaussian:", "gaussian:0", "gaussian:99", "gaussian:nan", "gaussians"])
def test_filters_that_are_none(tmp_path, bad):
    U.write_exr(tmp_path / "in.exr", np.ones((8, 8, 3)))
    r = run("fishremap", "--lens", "equidistant", "--fov", 185, "--size", "8x8", "--filter", bad, "-o", tmp_path / "o.exr", tmp_path / "in.exr", code=2)
    one_line_error(r, "fishremap", "--filter", "expected")


@pytest.mark.parametrize("tilt", [0, 3])
def test_texels_that_are_wholly_seen_have_alpha_one(tmp_path, tilt):
    """Half of a coarse picture, about the pole, in few wide columns: each texel is a speck of a pixel, and bent."""
    got = remap(tmp_path, np.ones((12, 40, 3)), "--lens", "equidistant", "--fov", 90, "--centre", "0,6", "--radius", 32, "--tilt", tilt, "--tilt-to", 0,
                "--polar-max", 5, "--size", "18x8")
    theta = np.abs(np.arange(18) - 8.5) * 20
    assert (got[:, theta > 100 if tilt == 0 else theta > 170, 3] == 1).all()
    if tilt == 0:
        assert (got[:, theta < 80] == 0).all() and np.abs(got[:, theta == 90, 3] - .5).max() < .002


def test_bad_pixels_are_left_out(tmp_path):
    image = np.full((128, 128, 3), 2.)
    image[40:44, 40:44] = np.nan
    image[80, 80, 1] = np.inf
    U.write_exr(tmp_path / "in.exr", image)
    r = run("fishremap", "--lens", "equidistant", "--fov", 185, "--size", "64x32", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    assert "17 pixels" in r.err
    got = U.read_exr(tmp_path / "o.exr")[0]
    assert np.isfinite(got).all()
    seen = got[..., 3] > 0
    assert np.allclose(got[seen][:, :3], 2, rtol=1e-6)
    all_bad = remap(tmp_path, np.full((8, 8, 3), np.nan), "--lens", "equidistant", "--fov", 185, "--size", "8x8", code=1)
    one_line_error(all_bad, "fishremap", "expected")


def test_mask(tmp_path):
    image = np.ones((128, 128, 3))
    mask = np.ones((128, 128, 3))
    image[:, 64:], mask[:, 64:] = 1000, 0
    U.write_exr(tmp_path / "mask.exr", mask)
    got = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "64x32", "--mask", tmp_path / "mask.exr")
    seen = got[..., 3] > 0
    assert 0.4 < seen.mean() < 0.6 and np.allclose(got[seen][:, :3], 1, rtol=1e-6)
    U.write_exr(tmp_path / "small.exr", mask[:50])
    r = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "64x32", "--mask", tmp_path / "small.exr", code=1)
    one_line_error(r, "fishremap", "128 x 128")


@pytest.mark.parametrize("n, size", [(1, "8x4"), (2, "5x5"), (3, "1x1")])
def test_tiny_pictures(tmp_path, n, size):
    got = remap(tmp_path, np.full((n, n, 3), .25), "--lens", "equidistant", "--fov", 185, "--size", size)
    assert np.isfinite(got).all()
    assert np.allclose(got[..., :3], .25, rtol=1e-6)


def test_wide_field_and_far_centre(tmp_path):
    image = U.fisheye(U.lobes(8, 2), 300, 220, samples=3)
    got = remap(tmp_path, image, "--lens", "equidistant", "--fov", 220, "--size", "90x55", "--polar-max", 110)
    assert U.rel_rmse(got[..., :3], U.probe(U.lobes(8, 2), 90, 55, 110, 8)) < 2e-3
    # centre outside of the picture, circle reaching in: an answer; circle outside: a refusal
    got = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "40x20", "--centre", "-50,-50", "--radius", 150)
    assert 0 < (got[..., 3] > 0).mean() < 0.5
    r = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "40x20", "--centre", "-500,0", "--radius", 150, code=1)
    one_line_error(r, "fishremap", "-500")


def solid_angle_seen(got, polar_max=90):
    alpha = got[..., 3] if got.shape[2] == 4 else np.ones(got.shape[:2])
    return (alpha * U.probe_solid_angle(got.shape[1], got.shape[0], polar_max)[:, None]).sum()


@pytest.mark.parametrize("tilt, to", [(45, 45), (45, 0), (60, 90), (30, 20), (10, 70)])
def test_a_narrow_field_is_not_lost_in_large_texels(tmp_path, tilt, to):
    """20 degrees of field lie within one texel of 4 x 2, or across an edge, without holding any of its corners."""
    scene = U.lobes(8, 2)
    got = remap(tmp_path, U.fisheye(scene, 100, 20, samples=3), "--lens", "equidistant", "--fov", 20, "--tilt", tilt, "--tilt-to", to, "--size", "4x2")
    assert solid_angle_seen(got) == pytest.approx(2 * np.pi * (1 - np.cos(np.radians(10))), rel=1e-3)
    flat = remap(tmp_path, np.full((100, 100, 3), 3.), "--lens", "equidistant", "--fov", 20, "--tilt", tilt, "--tilt-to", to, "--size", "4x2")
    assert np.allclose(flat[flat[..., 3] > 0][:, :3], 3, rtol=1e-6)


def test_texels_can_be_specks_of_a_pixel(tmp_path):
    """One pixel is enlarged as if to 4096 x 2048 texels, those at the pole 1e-10 of it: none is taken for a rounding error."""
    got = remap(tmp_path, np.full((1, 1, 3), .5), "--lens", "equidistant", "--fov", 185, "--size", "4096x64", "--polar-max", 2.8125)
    assert np.allclose(got[..., :3], .5, rtol=1e-6) and got.shape[2] == 3


@pytest.mark.parametrize("span", [90, 180, 200, 359])
@pytest.mark.parametrize("size, polar_max", [("37x18", 180), ("5x4", 180)])
def test_part_of_the_longitudes_is_used_to_its_ends(tmp_path, span, size, polar_max):
    """A texel across the end of a latlong picture takes what is there, on either side of the gap."""
    got = remap(tmp_path, np.full((100, 200, 3), 2.), "--from", "latlong", "--span", span, "--to", "probe", "--polar-max", polar_max, "--size", size)
    assert solid_angle_seen(got, polar_max) == pytest.approx(4 * np.pi * span / 360, rel=1e-3)
    assert np.allclose(got[got[..., 3] > 0][:, :3], 2, rtol=1e-6)


def test_huge_numbers_are_refused_or_answered(tmp_path):
    image = np.ones((16, 16, 3))
    for size, code in (("2000000x2000000", 1), ("100000x100000", 1), ("99999999999x2", 2)):
        one_line_error(remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", size, code=code), "fishremap", "expected")
    got = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "8x8", "--radius", 1e9)
    assert np.isfinite(got).all()


def test_radiance_over_twelve_decades(tmp_path):
    image = np.full((256, 256, 3), 1e-6)
    image[60, 60] = 1e6
    got = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "128x64")
    far = np.ones(got.shape[:2], bool)
    y, x = np.unravel_index(got[..., 0].argmax(), far.shape)
    far[max(y - 2, 0):y + 3, max(x - 2, 0):x + 3] = False
    assert got.min() >= 0 and np.allclose(got[far], 1e-6, rtol=1e-5)


# ---- lenses from files -------------------------------------------------------------------------------

def test_polynomial_equals_the_model_it_states(tmp_path):
    image = U.fisheye(U.lobes(), 256, 185)
    (tmp_path / "lens.txt").write_text("# equidistant, said otherwise\npolynomial 3.5\n")
    (tmp_path / "table.txt").write_text("table\n" + "".join(f"{d} {d * 2.5}\n" for d in range(0, 100, 5)))
    (tmp_path / "kb.txt").write_text("kannala-brandt 0 0 0 0\ncamera 79.27 79.27 127.5 127.5\n")
    want = remap(tmp_path, image, "--lens", "equidistant", "--fov", 185, "--size", "64x32")
    for lens in ("lens.txt", "table.txt"):
        got = remap(tmp_path, image, "--lens", tmp_path / lens, "--fov", 185, "--size", "64x32")
        assert np.allclose(got, want, rtol=1e-5)
    # camera matrix: f = 128 / 92.5 degrees in radians = 79.29
    got = remap(tmp_path, image, "--lens", tmp_path / "kb.txt", "--fov", 185, "--size", "64x32")
    assert U.rel_rmse(got[..., :3], want[..., :3]) < 0.01


def test_kannala_brandt_and_odd_polynomial(tmp_path):
    k = (0.02, -0.01, 0.003, -0.0004)
    half = np.radians(92.5)

    def radius(t):
        return t * (1 + k[0] * t ** 2 + k[1] * t ** 4 + k[2] * t ** 6 + k[3] * t ** 8)
    t = np.linspace(0, half * 1.05, 20001)
    image = U.disc(U.lamp(50, 75, 6), 300, 300, 150, 150, 150, lambda r: np.interp(r * radius(half), radius(t), t), samples=3)
    (tmp_path / "kb.txt").write_text("kannala-brandt " + " ".join(map(str, k)) + "\nfov 185\n")
    got = remap(tmp_path, image, "--lens", tmp_path / "kb.txt", "--size", "120x60")
    assert U.brightest(got, 90) == pytest.approx((50, 75), abs=0.1)


def test_lens_that_stops_growing_is_refused_with_the_angle(tmp_path):
    # r = t - 0.2 t^3 grows up to t = sqrt(1 / 0.6) = 1.291 rad = 73.97 degrees
    (tmp_path / "lens.txt").write_text("polynomial 1 0 -0.2\n")
    r = remap(tmp_path, np.ones((64, 64, 3)), "--lens", tmp_path / "lens.txt", "--fov", 180, "--size", "8x8", code=1)
    one_line_error(r, "fishremap", "73.97")
    for text in ("table\n0 0\n10 1\n20 0.9\n", "polynomial\n", "hello world\n", "model equidistant\nmodel equisolid\n", "table\n10 1\n20 2\n"):
        (tmp_path / "bad.txt").write_text(text)
        r = remap(tmp_path, np.ones((64, 64, 3)), "--lens", tmp_path / "bad.txt", "--fov", 180, "--size", "8x8", code=1)
        one_line_error(r, "fishremap", "expected")


def test_pin_positions_give_the_projection(tmp_path):
    """A table made of the measured pins agrees with the projection that the lens's calibration publishes."""
    folder = shared_data("fisheye_falloff_and_projection_calibration")
    rows = np.genfromtxt(folder / "pushpin_calibration_points.csv", delimiter=",", skip_header=1)
    r = np.hypot(*(rows[:19, 5:7] - rows[0, 5:7]).T)
    (tmp_path / "pins.txt").write_text("table\n" + "".join(f"{5 * i} {r[i]}\n" for i in range(1, 19)))
    (tmp_path / "published.txt").write_text("polynomial 0.6380 0.0307 -0.0200\n")
    for theta, phi in ((10, 20), (100, 45), (-60, 80)):
        t = np.linspace(0, 2, 20001)
        p = 0.6380 * t + 0.0307 * t ** 2 - 0.0200 * t ** 3
        image = U.disc(U.lamp(theta, phi, 5), 400, 400, 200, 200, 200, lambda q: np.interp(q * np.interp(np.pi / 2, t, p), p, t), samples=3)
        for lens in ("pins.txt", "published.txt"):
            got = remap(tmp_path, image, "--lens", tmp_path / lens, "--fov", 180, "--size", "120x60")
            assert U.brightest(got, 90) == pytest.approx((theta, phi), abs=0.5 if lens == "pins.txt" else 0.1)


# ---- falloff ---------------------------------------------------------------------------------------------

def test_falloff_files(tmp_path):
    """The same curve as polynomial text, table and JSON takes the same falloff out of a picture."""
    half = np.radians(92.5)
    image = U.disc(lambda d: np.repeat((1 + .1755 * (np.arccos(d[..., 2].clip(-1, 1)) / half) ** 2 - .5286 * (np.arccos(d[..., 2].clip(-1, 1)) / half) ** 4)[..., None], 3, -1),
                   300, 300, 150, 150, 150, lambda r: r * half, samples=2)
    rn = np.arange(0, 94) / 92.5
    v = 1 + .1755 * rn ** 2 - .5286 * rn ** 4
    (tmp_path / "poly.txt").write_text("polynomial rn 1 0 0.1755 0 -0.5286\n")
    (tmp_path / "table.txt").write_text("".join(f"{d} {a} {a} {a} 0 0 0\n" for d, a in enumerate(v)))
    (tmp_path / "one.json").write_text(json.dumps({"lens": "x", "f5.6": {"2": .1755, "4": -.5286}}))
    (tmp_path / "two.json").write_text(json.dumps({"f5.6": {"2": .1755, "4": -.5286}, "f11": {"2": .5}}))
    args = ("--lens", "equidistant", "--fov", 185, "--size", "64x64")
    for f, more in (("poly.txt", ()), ("table.txt", ()), ("one.json", ()), ("two.json", ("--aperture", 5.6)), ("two.json", ("--falloff-set", "f5.6")), ("two.json", ())):
        got = remap(tmp_path, image, *args, "--falloff", tmp_path / f, *more)
        assert np.abs(got - 1).max() < (2e-3 if f == "table.txt" else 1e-3), f
    one_line_error(remap(tmp_path, image, *args, "--falloff", tmp_path / "two.json", "--aperture", 8, code=1), "fishremap", "f8", "f11")
    long = "polynomial rn 1 " + "0 " * 2 + " " * 1000 + "12345\n"   # cut after "123" it would still be a number
    for text in ("{", "{\"f1\": 3", "{\"f1\": {\"2\": 0.1}} {", "0 1 1\n", long, "0 1 1 1\n50 0 1 1\n", "polynomial rn 1 0 -2\n", "polynomial px 1\n", ""):
        (tmp_path / "bad").write_text(text)
        one_line_error(remap(tmp_path, image, *args, "--falloff", tmp_path / "bad", code=1), "fishremap", "expected")


# ---- finding the circle --------------------------------------------------------------------------------

@pytest.mark.parametrize("cx, cy, r", [(300, 240, 200), (331.7, 222.4, 180.3), (300, 300, 290)])
def test_centre_auto(tmp_path, cx, cy, r):
    image = U.disc(U.lobes(20, 7), 600, 480, cx, cy, r, lambda q: q * np.radians(92.5), samples=3, outside=1e-4)
    U.write_exr(tmp_path / "in.exr", image)
    run("fishremap", "--lens", "equidistant", "--fov", 185, "--size", "32x16", "--centre", "auto", "--report", tmp_path / "r.json",
        "--overlay", tmp_path / "o.png", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    found = json.loads((tmp_path / "r.json").read_text())
    assert found["centre"] == pytest.approx((cx, cy), abs=0.7) and found["radius"] == pytest.approx(r, abs=0.7)
    assert (tmp_path / "o.png").read_bytes()[:4] == b"\x89PNG"


def test_no_circle_is_said(tmp_path):
    r = remap(tmp_path, np.ones((100, 100, 3)), "--lens", "equidistant", "--fov", 185, "--size", "32x16", "--centre", "auto", code=1)
    one_line_error(r, "fishremap", "circle")


def test_office_circle(tmp_path):
    folder = shared_data("fisheye_bracket_office_canon5d2_8mm")
    run("fishremap", "--lens", "equisolid", "--fov", 186, "--size", "32x16", "--centre", "auto", "--report", tmp_path / "r.json",
        "-o", tmp_path / "o.exr", folder / "IMG_6962.jpg")
    found = json.loads((tmp_path / "r.json").read_text())
    # stated to 1-2 pixels: centre (706, 466), radius 451.5
    assert found["centre"] == pytest.approx((706, 466), abs=3) and found["radius"] == pytest.approx(451.5, abs=3)


@pytest.mark.parametrize("folder, name, centre, radius, slack", [
    *(("mirrorball_bracket_desk_sony", f"desk_{k}.png", (405, 403), 404, 6) for k in (1, 2, 3)),   # stated to 6 pixels
    *(("mirrorball_bracket_uiuc_lab", f"ball_1_{k}.png", (132, 132), 131, 1.31) for k in (24, 60, 120, 205)),
])
def test_real_mirror_balls(tmp_path, folder, name, centre, radius, slack):
    picture = shared_data(folder) / name
    run("fishremap", "--array", "1x1", "--corners", "auto", "--size", "32x16", "--report", tmp_path / "r.json", "-o", tmp_path / "o.ilf.exr", picture)
    x, y, r = json.loads((tmp_path / "r.json").read_text())["spheres"][0]
    assert r == pytest.approx(radius, rel=0.01)
    assert (x, y) == pytest.approx(centre, abs=slack)


def photographed_ball(w, h, cx, cy, r, blur, seed=1):
    """A mirror ball before a ground that it partly has the brightness of; 1 % noise."""
    rng = np.random.default_rng(seed)
    inside = U.disc(lambda d: np.ones(d.shape[:-1] + (3,)), w, h, cx, cy, r, U.ball_angle, samples=4, outside=0)
    image = U.disc(U.lobes(14, 11, 2.), w, h, cx, cy, r, U.ball_angle, mirror=True, samples=3, outside=0)
    image += (1 - inside) * (.3 + .1 * np.sin(np.arange(w) / 40))[:, None]
    k = np.exp(-.5 * (np.arange(-4, 5) / blur) ** 2) if blur else np.ones(1)
    for axis in (0, 1):
        image = np.apply_along_axis(lambda line: np.convolve(np.pad(line, len(k) // 2, "edge"), k / k.sum(), "valid"), axis, image)
    return image * rng.normal(1, .01, image.shape)


@pytest.mark.parametrize("w, h, cx, cy, r, blur", [
    (300, 260, 140.3, 131.7, 90.4, 0), (300, 260, 140.3, 131.7, 90.4, 1), (264, 264, 132.4, 131.7, 131.2, 1),   # whole; cut to the ball
    (264, 264, 132, 132, 134, 1), (300, 260, 60, 131.7, 90.4, .5),   # cut by the frame, on all sides and on one
])
def test_a_ball_is_found_within_a_hundredth(tmp_path, w, h, cx, cy, r, blur):
    U.write_exr(tmp_path / "in.exr", photographed_ball(w, h, cx, cy, r, blur))
    run("fishremap", "--array", "1x1", "--corners", "auto", "--size", "8x8", "--report", tmp_path / "r.json", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    found = json.loads((tmp_path / "r.json").read_text())["spheres"][0]
    assert found == pytest.approx((cx, cy, r), abs=.01 * r)


# ---- several pictures, two views of a ball, the camera's reflection ---------------------------------------

def test_several_pictures_share_their_weights(tmp_path):
    """The same pixels as one at a time, whether or not a picture has bad pixels."""
    names = []
    for k in range(3):
        image = U.fisheye(U.lobes(8, k), 150, 185)
        if k == 2:
            image[70, 70] = np.nan
        names.append(U.write_exr(tmp_path / f"p{k}.exr", image))
    args = ("--quiet", "--lens", "equidistant", "--fov", 185, "--size", "60x40", "--tilt", 3)
    run("fishremap", *args, "-o", tmp_path / "%_probe.exr", *names)
    for k, name in enumerate(names):
        run("fishremap", *args, "-o", tmp_path / "alone.exr", name)
        alone, shared = U.read_exr(tmp_path / "alone.exr")[0], U.read_exr(tmp_path / f"p{k}_probe.exr")[0]
        assert alone.shape == shared.shape and np.allclose(alone, shared, rtol=2e-6, atol=1e-7)
    one_line_error(run("fishremap", *args, "-o", tmp_path / "x.exr", *names, code=2), "fishremap", "%")


@pytest.mark.parametrize("w, h, size", [(1, 1, "2x2"), (3, 1, "2x2"), (5, 1, "2x2"), (5, 3, "2x2"), (7, 5, "3x2"), (33, 31, "4x2"), (150, 150, "7x3")])
def test_shared_weights_of_few_pixels_and_large_texels(tmp_path, w, h, size):
    """Pixels that no outline cuts are summed in runs: the same as one at a time, wherever a run ends."""
    names = []
    for k in range(2):
        names.append(U.write_exr(tmp_path / f"p{k}.exr", np.random.default_rng(k).uniform(0, 1, (h, w, 3))))
    for args in (("--lens", "equidistant", "--fov", 185, "--radius", max(w, h), "--polar-max", 90), ("--from", "probe", "--to", "fisheye", "--lens", "equidistant", "--fov", 180)):
        run("fishremap", "--quiet", *args, "--size", size, "-o", tmp_path / "%_out.exr", *names)
        for k, name in enumerate(names):
            run("fishremap", "--quiet", *args, "--size", size, "-o", tmp_path / "alone.exr", name)
            alone, shared = U.read_exr(tmp_path / "alone.exr")[0], U.read_exr(tmp_path / f"p{k}_out.exr")[0]
            assert alone.shape == shared.shape and np.allclose(alone, shared, rtol=2e-6, atol=1e-7)


def ball_picture(scene, tilt_deg, to_deg, n=220):
    """A mirror ball seen by a camera that leans by tilt towards the picture's azimuth to."""
    t, a = np.radians(tilt_deg), np.radians(to_deg)
    lean, axis = np.array([np.cos(a), np.sin(a), 0]), np.array([0, 0, 1.])
    side = np.cross(axis, lean)
    turn = np.stack([np.cos(t) * lean - np.sin(t) * axis, side, np.cos(t) * axis + np.sin(t) * lean], -1) @ np.stack([lean, side, axis])
    return U.disc(lambda d: scene(d @ turn.T), n, n, n / 2, n / 2, n / 2 - 5, U.ball_angle, mirror=True, samples=3, outside=0)


def test_two_views_of_a_ball(tmp_path):
    """Each alone is bad behind its ball; together they are right everywhere, without the camera's reflection."""
    scene = U.lobes(12, 4, 1.3)
    exact = U.probe(scene, 72, 72, 180, 4)
    for name, tilt in (("a", 0), ("b", 90)):
        image = ball_picture(scene, tilt, 0)
        y, x = np.mgrid[0:220, 0:220]
        image[np.hypot(x + .5 - 110, y + .5 - 110) < 10] = 50   # the photographer
        U.write_exr(tmp_path / f"{name}.exr", image)
    args = ("--from", "ball", "--radius", 105, "--size", "72x72", "--polar-max", 180, "--hide-camera", 12)
    run("fishremap", *args, "-o", tmp_path / "one.exr", tmp_path / "a.exr")
    run("fishremap", *args, "--second", tmp_path / "b.exr", "--second-view", "110,110,105,90,0", "-o", tmp_path / "two.exr", tmp_path / "a.exr")
    one, two = U.read_exr(tmp_path / "one.exr")[0], U.read_exr(tmp_path / "two.exr")[0]
    assert (one[0, :, 3] == 0).all() and (two[..., 3] if two.shape[2] == 4 else np.ones(1)).min() > .97
    weight = U.probe_solid_angle(72, 72, 180)[:, None, None]
    error = {k: np.sqrt((weight * (v[..., :3] - exact) ** 2).sum() / weight.sum() / 216) / exact.mean() for k, v in (("one", one), ("two", two))}
    assert error["two"] < 0.03 and error["two"] < error["one"] / 3, error


# ---- a real series end to end --------------------------------------------------------------------------

def test_office_series(tmp_path):
    """Eighteen exposures to a probe: its vertical illuminance against one summed over the fisheye's own pixels."""
    folder = shared_data("fisheye_bracket_office_canon5d2_8mm")
    run("hdrgen", "--response", folder / "Response_function.rsp", "--times", folder / "exposures.txt", "-o", tmp_path / "office.exr",
        *sorted(folder.glob("IMG_*.jpg")), timeout=300)
    run("fishremap", "--lens", "equisolid", "--fov", 186, "--centre", "706,466", "--radius", 451.5, "--falloff", folder / "vignetting.json",
        "--aperture", 5.6, "--size", "400x400", "-o", tmp_path / "probe.exr", tmp_path / "office.exr")
    probe, weights = U.read_exr(tmp_path / "probe.exr")[0][..., :3], np.array([.265, .670, .065])
    phi = np.radians(U.probe_angles(400, 400, 90)[1])
    ours = ((probe @ weights) * (np.cos(phi) * U.probe_solid_angle(400, 400, 90))[:, None]).sum()
    picture = U.read_exr(tmp_path / "office.exr")[0][..., :3] @ weights
    y, x = np.mgrid[0:picture.shape[0], 0:picture.shape[1]]
    r = np.hypot(x + .5 - 706, y + .5 - 466) / 451.5
    theta = 2 * np.arcsin(np.clip(r * np.sin(np.radians(46.5)), 0, 1))
    rn = theta / np.radians(93)
    v = 1 + .1755458928191 * rn ** 2 - .528613562104476 * rn ** 4
    solid = (2 * np.sin(np.radians(46.5)) / 451.5) ** 2   # equisolid: the same for each pixel
    theirs = np.where(theta < np.pi / 2, picture / v * np.cos(theta), 0).sum() * solid
    assert ours == pytest.approx(theirs, rel=0.002)
