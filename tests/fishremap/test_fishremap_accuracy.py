"""fishremap against analytic scenes: exact area means, Gaussian means, energy, round trips."""
import numpy as np
import pytest

import fishremap_util as U
from conftest import one_line_error, run
from fishremap_util import remap


# ---- accuracy against exact area means (1024-pixel fisheye, 185 degrees, as in the peers' measurement) -------

SIZES = [(400, 400, 90, 2), (1024, 512, 180, 2), (64, 64, 90, 6)]     # the last: points along a texel where all is smooth


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes")
    scene = U.lobes()
    U.write_exr(folder / "lobes.exr", U.fisheye(scene, 1024, 185, samples=2, smooth=True))
    U.write_exr(folder / "checker.exr", U.fisheye(U.checker, 1024, 185, samples=3))
    return folder, {"lobes": scene, "checker": U.checker}


def inside(h, polar_max):
    return U.probe_angles(1, h, polar_max)[1] < 91


@pytest.mark.parametrize("w, h, polar_max, samples", SIZES)
def test_lobes_to_1e_4(pictures, tmp_path, w, h, polar_max, samples):
    folder, scenes = pictures
    run("fishremap", "--lens", "equidistant", "--fov", 185, "--size", f"{w}x{h}", "--polar-max", polar_max, "-o", tmp_path / "o.exr", folder / "lobes.exr")
    got = U.read_exr(tmp_path / "o.exr")[0][..., :3]
    exact = U.probe(scenes["lobes"], w, h, polar_max, samples, smooth=True)
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
    exact = U.probe(scenes["checker"], w, h, polar_max, 23 if w == 64 else 5)
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
