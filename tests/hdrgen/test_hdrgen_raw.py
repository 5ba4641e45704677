"""hdrgen on camera raw: merged as the sensor saw it; then one white balance, one matrix, one turn for the series."""
import numpy as np
import pytest

from common_util import load
from conftest import one_line_error, shared_case
from dng_util import BAYER, XTRANS, camera_values, shoot, write_raw
from exif_util import rational, save
from hdrgen_util import *  # noqa: F403
from PIL import Image

NEUTRAL = (0.45, 1.0, 0.62)                       # a sensor that sees little red
TIMES_RAW = [1 / 4096, 1 / 1024, 1 / 256, 1 / 64, 1 / 16, 1 / 4]
# linear sRGB: white, lamps of one colour, tungsten, skin
PATCHES = np.array([[40, 40, 40], [0.6, 30, 1.5], [0.6, 1.8, 30], [60, 33, 9], [30, 0.6, 0.3], [1.2, 0.675, 0.495]])
TO_XYZ = np.array([[0.4123908, 0.3575843, 0.1804808], [0.2126390, 0.7151687, 0.0721923], [0.0193308, 0.1191948, 0.9505322]])
BT709 = [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329]
AP1 = [0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767]


def to_xyz(c):
    """RGB to XYZ from the chromaticities of red, green, blue and white (SMPTE RP 177)."""
    xyz = lambda x, y: np.array([x / y, 1, (1 - x - y) / y])
    m = np.array([xyz(*c[i:i + 2]) for i in (0, 2, 4)]).T
    return m * np.linalg.solve(m, xyz(*c[6:8]))


def patches(size=36, rows=48):
    return np.repeat(np.repeat(PATCHES[None], size, 1), rows, 0)


def series(folder, rgb, pattern, times=TIMES_RAW, seed=1, **more):
    rng = np.random.default_rng(seed)
    names = []
    neutral = more.pop("neutral", NEUTRAL)
    each = more.pop("each", None)
    for k, t in enumerate(times):
        z = shoot(camera_values(rgb), t, rng, pattern, neutral)
        names.append(f"s{k}.dng")
        write_raw(folder / names[-1], z, pattern, seconds=t, **{"neutral": neutral, "black": 512, **more, **(each(k) if each else {})})
    return names


def words(p):
    return p.err


def patch_means(im, n=6, margin=6):
    w = im.shape[1] // n
    return np.array([im[margin:-margin, k * w + margin:(k + 1) * w - margin].mean((0, 1)) for k in range(n)])


@pytest.mark.parametrize("how", [[], ["--half-size"], ["--weight", "debevec"], ["--weight", "debevec", "--half-size"]], ids=" ".join)
@pytest.mark.parametrize("order", ["RGGB", "GBRG"])
def test_coloured_lamps_keep_their_colours(tmp_path, order, how):
    names = series(tmp_path, patches(), BAYER[order])
    hdrgen(tmp_path, names, *how, times=None)
    got = patch_means(radiance(tmp_path / "out.exr"), margin=3 if how else 6)
    assert (np.abs(got - PATCHES).max(1) / PATCHES.max(1) < 0.015).all(), got


@pytest.mark.parametrize("kind", ["BGGR", "GRBG", "X-Trans", "linear"])
def test_every_kind_of_sensor(tmp_path, kind):
    pattern = {"X-Trans": XTRANS, "linear": None}.get(kind) or BAYER.get(kind)
    names = series(tmp_path, patches(), pattern)
    hdrgen(tmp_path, names, times=None)
    got = patch_means(radiance(tmp_path / "out.exr"))
    assert (np.abs(got - PATCHES).max(1) / PATCHES.max(1) < 0.015).all(), got
    if kind == "X-Trans":
        one_line_error(hdrgen(tmp_path, names, "--half-size", times=None, code=1), "hdrgen", "Bayer")


def test_a_grey_sensor_stays_grey(tmp_path):
    rng = np.random.default_rng(2)
    truth = np.geomspace(0.05, 200, 96)[None, :, None] * np.ones((40, 1, 1))
    names = []
    for k, t in enumerate(TIMES_RAW):
        names.append(f"m{k}.dng")
        write_raw(tmp_path / names[-1], shoot(truth, t, rng, None, [1])[..., 0], seconds=t, black=512)
    hdrgen(tmp_path, names, times=None)
    ch = read_exr(tmp_path / "out.exr")[0]
    assert set(ch) == {"Y"}
    d = np.log2(ch["Y"].mean(0) / truth[0, :, 0])
    assert np.abs(d[20:]).max() < 0.03 and np.abs(d).max() < 0.15
    one_line_error(hdrgen(tmp_path, names, "--colour", "xyz", times=None, code=1), "hdrgen", "grey sensor")


def test_levels_belong_to_each_photosite(tmp_path):
    """The same light, black levels different in the four positions: the same picture."""
    rgb = patches(16, 24)
    black = np.array([[500, 640], [580, 520]])
    names, other = series(tmp_path, rgb, BAYER["RGGB"]), []
    for k, name in enumerate(names):
        rng = np.random.default_rng(100 + k)
        z = shoot(camera_values(rgb), TIMES_RAW[k], rng, BAYER["RGGB"], NEUTRAL, black=0, white=15743)
        z = np.minimum(z + np.tile(black, (12, 48)), 16383)
        other.append("b" + name)
        write_raw(tmp_path / other[-1], z, BAYER["RGGB"], black_pattern=black, neutral=NEUTRAL, seconds=TIMES_RAW[k])
    hdrgen(tmp_path, other, times=None)
    got = patch_means(radiance(tmp_path / "out.exr"), margin=4)
    assert (np.abs(got - PATCHES * 15743 / 15883).max(1) / PATCHES.max(1) < 0.02).all(), got / PATCHES


def test_colour_spaces_and_their_primaries(tmp_path):
    names = series(tmp_path, patches(16, 24), BAYER["RGGB"])
    out, light = {}, {}
    for space in ("srgb", "xyz", "acescg", "camera"):
        hdrgen(tmp_path, names, "--colour", space, times=None)
        out[space] = radiance(tmp_path / "out.exr").reshape(-1, 3)
        _, header = read_exr(tmp_path / "out.exr")
        assert header["hdrgen:colour"] == space
        if space != "camera":  # as our other programs read it
            read = load(tmp_path / "out.exr", tmp_path).reshape(-1, 3)
            assert np.abs(read - out["srgb"]).max() < 1e-5 * out["srgb"].max()
        c = header.get("chromaticities")
        if space == "camera":
            assert c is None
            continue
        c = np.array(c, float).reshape(-1)
        light[space] = out[space] @ (np.eye(3) if space == "xyz" else to_xyz(c)).T
        assert np.allclose(c, {"srgb": BT709,
                               "xyz": [1, 0, 0, 1, 0, 0, 1 / 3, 1 / 3],
                               "acescg": AP1}[space], atol=1e-6)
    scale = out["srgb"].max()
    assert np.abs(out["srgb"] @ TO_XYZ.T - out["xyz"]).max() < 2e-4 * scale
    for space in ("xyz", "acescg"):  # what the attribute says of the numbers is the same light
        assert np.abs(light[space] - light["srgb"]).max() < 2e-4 * scale
    assert np.abs(camera_values(out["srgb"]) - out["camera"]).max() < 1e-3 * scale
    hdrgen(tmp_path, names, times=None, out="default.exr")
    assert (radiance(tmp_path / "default.exr").reshape(-1, 3) == out["srgb"]).all()
    one_line_error(hdrgen(tmp_path, names, "--colour", "xyz", times=None, out="a.hdr", code=2), "hdrgen", ".exr")
    one_line_error(hdrgen(tmp_path, names, "--colour", "camera", "--calibrate", "1,1,4,4=100", times=None, code=1), "hdrgen", "camera")


def test_calibrated_luminance_does_not_depend_on_the_space(tmp_path):
    names = series(tmp_path, patches(16, 24), BAYER["RGGB"])
    for space in ("srgb", "xyz", "acescg"):
        hdrgen(tmp_path, names, "--colour", space, "--calibrate", "4,4,6,14=500", times=None)
        v = radiance(tmp_path / "out.exr")[4:18, 4:10].mean((0, 1))
        rgb = np.linalg.solve({"srgb": np.eye(3), "xyz": TO_XYZ, "acescg": np.linalg.solve(to_xyz(AP1), to_xyz(BT709))}[space], v)
        assert 179 * rgb @ [0.265, 0.67, 0.065] == pytest.approx(500, rel=2e-3)


def test_one_white_balance_for_the_series(tmp_path):
    """Four greys of very different brightness; the files' balances differ; so does nothing else."""
    grey = np.repeat(np.array([300, 30, 3, 0.3]), 24)[None, :, None] * np.ones((32, 1, 3))
    wander = [(0.45, 1, 0.62), (0.5, 1, 0.55), (0.41, 1, 0.7), (0.6, 1, 0.6), (0.45, 1, 0.5), (0.55, 1, 0.8)]
    names = series(tmp_path, grey, BAYER["RGGB"], each=lambda k: {"neutral": wander[k]})
    p = hdrgen(tmp_path, names, times=None)
    assert "white balances differ" in words(p) and "s3.dng" in words(p)
    m = patch_means(radiance(tmp_path / "out.exr"), 4, 4)
    assert np.ptp(m[:, 0] / m[:, 1]) < 0.015 and np.ptp(m[:, 2] / m[:, 1]) < 0.015
    _, header = read_exr(tmp_path / "out.exr")
    assert header["hdrgen:whiteBalanceOf"] == "s3.dng"
    balance = 1 / np.array(wander[3])
    assert np.allclose(np.array(header["hdrgen:whiteBalance"], float), balance / balance.min(), rtol=1e-4)
    first = (tmp_path / "out.exr").read_bytes()
    hdrgen(tmp_path, names[::-1], times=None, out="back.exr")
    a, b = radiance(tmp_path / "out.exr"), radiance(tmp_path / "back.exr")
    assert first and (a == b).all()                                       # the command line's order says nothing
    same = series(tmp_path, grey, BAYER["RGGB"])
    assert "balance" not in words(hdrgen(tmp_path, same, times=None))


TURN = {1: lambda a: a, 2: lambda a: a[:, ::-1], 3: lambda a: a[::-1, ::-1], 4: lambda a: a[::-1],
        5: lambda a: a.swapaxes(0, 1), 6: lambda a: a.swapaxes(0, 1)[:, ::-1], 7: lambda a: a.swapaxes(0, 1)[::-1, ::-1],
        8: lambda a: a.swapaxes(0, 1)[::-1]}


@pytest.mark.parametrize("first", [1, 3, 6, 8])
def test_one_orientation_for_the_series_raw(tmp_path, first):
    rgb = np.geomspace(0.05, 100, 64)[None, :, None] * np.geomspace(1, 2, 40)[:, None, None] * np.ones(3)
    names = series(tmp_path, rgb, BAYER["RGGB"])
    hdrgen(tmp_path, names, "--sigma", "--count", "--flags", times=None)
    plain = read_exr(tmp_path / "out.exr")[0]
    tags = [first, 3, 6, 1, 8, first]
    names = series(tmp_path, rgb, BAYER["RGGB"], each=lambda k: {"orientation": tags[k]})
    p = hdrgen(tmp_path, names, "--sigma", "--count", "--flags", times=None)
    assert "orientation tags differ" in words(p) and "s0.dng" in words(p)
    got = read_exr(tmp_path / "out.exr")[0]
    for name, a in plain.items():
        assert np.array_equal(got[name], TURN[first](a)), name


@pytest.mark.parametrize("suffix", ["jpg", "png", "tif"])
def test_one_orientation_for_the_series_coded(tmp_path, suffix):
    truth = scene(40, 56, decades=2)
    times = [0.05, 0.2, 0.8]
    names = []
    for tags in ([1, 1, 1], [6, 3, 1]):
        for k, t in enumerate(times):
            name = f"{tags[k]}{k}.{suffix}"
            save(tmp_path / name, expose(truth, t, f_srgb, max_code=255, rng=np.random.default_rng(k)), {0x829A: (5, [rational(t)])}, tags[k])
            names.append(name)
    plain = hdrgen(tmp_path, names[:3], "-r", "srgb", times=None, out="plain.exr")
    p = hdrgen(tmp_path, names[3:], "-r", "srgb", times=None)
    assert "orientation" not in words(plain) and "orientation tags differ" in words(p)
    assert np.array_equal(radiance(tmp_path / "out.exr"), TURN[6](radiance(tmp_path / "plain.exr")))


def test_lamps_keep_their_energy(tmp_path):
    """Small coloured lamps anywhere on the mosaic, far above the scene: what comes out is what was there, and nothing beside
    them is negative."""
    rng = np.random.default_rng(3)
    h, w = 180, 240
    rgb = np.full((h, w, 3), 0.05)
    y, x = np.mgrid[:h, :w]
    lamps = []
    for cy in range(15, h, 30):
        for cx in range(15, w, 30):
            colour = PATCHES[rng.integers(len(PATCHES))] * rng.uniform(5, 30)
            s = rng.uniform(0.9, 1.6)
            py, px = cy + rng.uniform(-1, 1), cx + rng.uniform(-1, 1)
            rgb += np.exp(-((x - px) ** 2 + (y - py) ** 2) / (2 * s * s))[..., None] * colour
            lamps.append((cy, cx))
    names = series(tmp_path, rgb, BAYER["RGGB"], [t / 16 for t in TIMES_RAW] + [1 / 16, 1 / 4, 1])
    hdrgen(tmp_path, names, "--colour", "camera", times=None)
    got, truth = radiance(tmp_path / "out.exr"), camera_values(rgb)
    assert got.min() >= 0
    cut = lambda a: np.array([a[cy - 13:cy + 14, cx - 13:cx + 14].sum((0, 1)) for cy, cx in lamps])
    ratio = cut(got) / cut(truth)
    assert np.abs(ratio.mean(0) - 1).max() < 0.015 and ratio.std(0).max() < 0.05, (ratio.mean(0), ratio.std(0))


@pytest.mark.parametrize("how", [[], ["--half-size"]], ids=" ".join)
def test_sigma_is_the_scatter(tmp_path, how):
    names = series(tmp_path, patches(40, 60), BAYER["RGGB"])
    hdrgen(tmp_path, names, "--sigma", *how, times=None)
    ch = read_exr(tmp_path / "out.exr")[0]
    step = 20 if how else 40
    for k in range(6):
        at = np.s_[5:-5, k * step + 5:(k + 1) * step - 5]
        for c in "RGB":
            said, is_ = ch[f"sigma.{c}"][at].mean(), ch[c][at].std()
            assert 0.7 < said / is_ < 1.5, (k, c, said, is_)


def test_what_is_clipped_everywhere_is_white(tmp_path):
    """Nothing is known of its colour; its value is below any channel's bound."""
    rgb = patches(16, 24)
    rgb[:, 32:] = 1e4
    names = series(tmp_path, rgb, BAYER["RGGB"], [1 / 64, 1 / 16, 1 / 4])
    p = hdrgen(tmp_path, names, "--flags", times=None)
    got, flags = radiance(tmp_path / "out.exr"), read_exr(tmp_path / "out.exr")[0]["flags"]
    assert "clipped in every exposure" in words(p)
    inside = got[4:-4, 40:-8]
    assert np.allclose(inside, 64, rtol=2e-3) and (flags[4:-4, 40:-8] == 1).all()


def test_flat_field_in_raw_has_no_colour(tmp_path):
    rng = np.random.default_rng(5)
    vignette = 1 - 0.6 * ((np.mgrid[:40, :72] - np.array([20, 36])[:, None, None]) ** 2).sum(0) / 1700
    rgb = np.full((40, 72, 3), 3.0)
    names = series(tmp_path, rgb * vignette[..., None], BAYER["RGGB"])
    flat = np.mean([shoot(camera_values(np.array([1.2, 0.8, 0.5]) * np.ones((40, 72, 3))) * vignette[..., None], 0.5, rng, BAYER["RGGB"],
                          NEUTRAL) for _ in range(16)], axis=0)
    write_raw(tmp_path / "flat.dng", np.round(flat), BAYER["RGGB"], black=512)
    hdrgen(tmp_path, names, "--flat", "flat.dng", times=None)
    got = radiance(tmp_path / "out.exr")
    assert np.allclose(got.mean((0, 1)), got.mean(), rtol=0.01)
    assert np.std(got.mean(2)) / got.mean() < 0.02 < 0.1 < np.std(vignette) / vignette.mean()
    write_raw(tmp_path / "flat.dng", np.full((40, 72), 16383), BAYER["RGGB"], black=512)
    one_line_error(hdrgen(tmp_path, names, "--flat", "flat.dng", times=None, code=1), "hdrgen", "not clipped")


def test_one_series_is_of_one_kind(tmp_path):
    rgb = patches(16, 24)
    names = series(tmp_path, rgb, BAYER["RGGB"])[:3]
    z = shoot(camera_values(rgb), 0.01, np.random.default_rng(1), BAYER["RGGB"], NEUTRAL)
    Image.fromarray(np.zeros((24, 96, 3), np.uint8)).save(tmp_path / "a.png")
    for more, what in (({"model": "Other"}, "Other"), ({"pattern": BAYER["BGGR"]}, "filters"), ({"white": 4095, "black": 128}, "bit depth")):
        write_raw(tmp_path / "x.dng", z // 4 if "white" in more else z, more.pop("pattern", BAYER["RGGB"]), seconds=0.01,
                  **{"black": 512, **more})
        one_line_error(hdrgen(tmp_path, [*names, "x.dng"], times=None, code=1), "hdrgen", "x.dng", what)
    write_raw(tmp_path / "x.dng", z[:, :-2], BAYER["RGGB"], seconds=0.01)
    one_line_error(hdrgen(tmp_path, [*names, "x.dng"], times=None, code=1), "hdrgen", "x.dng", "94x24")
    write_times(tmp_path, [*names, "a.png"], [1, 2, 3, 4])
    one_line_error(hdrgen(tmp_path, [*names, "a.png"], code=1), "hdrgen", "a.png", "camera raw")
    one_line_error(hdrgen(tmp_path, ["a.png", *names], code=1), "hdrgen", "s0.dng", "png")
    for option in (["--bits", "12"], ["--fill", "0,0,0"], ["--dark", names[0]], ["--bayer", "RGGB"]):
        one_line_error(hdrgen(tmp_path, names, *option, times=None, code=1), "hdrgen", "camera raw")
    one_line_error(hdrgen(tmp_path, ["a.png"], "--colour", "xyz", "-r", "srgb", times=None, code=1), "hdrgen", "--colour", "png")


def test_a_sky_that_only_the_shortest_exposure_holds(tmp_path):
    names = sorted(shared_case("raw_white_is_65534").glob("*.dng"))
    hdrgen(tmp_path, names, times=None)
    got = radiance(tmp_path / "out.exr")[:, 34:54].mean((0, 1))
    assert np.allclose(got, [1612, 1586, 1872], rtol=0.01), got


@pytest.mark.parametrize("order", ["RGGB", "X-Trans"])
def test_a_walker_leaves_no_colours(tmp_path, order):
    """Something dark that is in one shot only: --deghost takes its photosites of all colours; a series at rest stays."""
    pattern = XTRANS if order == "X-Trans" else BAYER[order]
    rgb = np.geomspace(0.5, 30, 144)[None, :, None] * np.array([1, 0.6, 0.3]) * np.ones((96, 1, 1))
    walked = rgb.copy()
    walked[30:66, 50:80] *= 0.1
    names = series(tmp_path, rgb, pattern)
    for way in ([], ["--deghost"]):
        hdrgen(tmp_path, names, *way, times=None, out=f"rest{len(way)}.exr")
    a, b = (radiance(tmp_path / f"rest{k}.exr") for k in (0, 1))
    assert (np.abs(b / a - 1).max(2) > 0.1).mean() < 0.002
    z = shoot(camera_values(walked), TIMES_RAW[4], np.random.default_rng(9), pattern, NEUTRAL)
    write_raw(tmp_path / names[4], z, pattern, seconds=TIMES_RAW[4], neutral=NEUTRAL, black=512)
    hdrgen(tmp_path, names, "--deghost", times=None)
    got = radiance(tmp_path / "out.exr")[30:66, 50:80]
    off = np.abs(got / rgb[30:66, 50:80] - 1)
    assert np.median(off) < 0.03 and (off.max(2) > 0.25).mean() < 0.02, (np.median(off), (off.max(2) > 0.25).mean())
