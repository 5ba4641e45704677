"""Series that contradict themselves: the response survives, it is said, and series at rest stay as they are."""
import numpy as np
import pytest
from PIL import Image

from conftest import one_line_error, shared_case, shared_data
from hdrgen_util import expose, f_gamma, f_srgb, hdrgen, make_series, radiance, scene, write_png, write_times

TIMES = 2.0 ** np.arange(-7, 2)


def walker_series(folder, times, walk=True, seed=4):
    """A scene, and someone dark who stands at another place in each shot, on 5 % of the picture.  Names, where nobody stood."""
    truth = scene(170, 250, decades=3, lowest=-1.7, seed=9)
    rng, names, free = np.random.default_rng(seed), [], np.ones((170, 250), bool)
    for k, t in enumerate(times):
        now = truth.copy()
        at = np.s_[60:150, 20 + 70 * k:44 + 70 * k]
        if walk:
            now[at] = .04 * (1 + .5 * np.sin(np.arange(24) / 3))[None, :, None]
        free[at] = False
        names.append(f"w{k}.png")
        write_png(folder / names[-1], expose(now, t, f_srgb, rng=rng))
    write_times(folder, names, times)
    return names, free


@pytest.mark.parametrize("more", [(), ("--deghost",), ("--response", "mitsunaga")])
def test_a_walker_does_not_spoil_the_response(tmp_path, more):
    names, free = walker_series(tmp_path, [.05, .2, .8], walk=False)
    hdrgen(tmp_path, names, *more, out="rest.exr")
    names, free = walker_series(tmp_path, [.05, .2, .8])
    r = hdrgen(tmp_path, names, *more)
    d = np.log2(radiance(tmp_path / "out.exr")[free] / radiance(tmp_path / "rest.exr")[free])
    d -= np.median(d)
    assert (np.abs(d) > .25).mean() < .02 and np.sqrt(np.mean(d ** 2)) < .08
    assert "disagree" in r.err


def test_case_walker(tmp_path):
    """Against the same shots without him: every second pixel of the series from which the case was made."""
    case, data = shared_case("walker_spoils_response"), shared_data("bracket_window_nikon_e995")
    shots, free = sorted(data.glob("*.jpg")), np.ones((170, 250), bool)
    for i, k in enumerate((4, 6, 8)):
        clean = np.asarray(Image.open(shots[k]))[::2, ::2][120:290, 150:400]
        free &= (clean == np.asarray(Image.open(case / f"w{i}.png").convert("RGB"))).all(axis=-1)
        write_png(tmp_path / f"w{i}.png", clean)
    assert .8 < free.mean() < .9
    hdrgen(tmp_path, ["w0.png", "w1.png", "w2.png"], times=case / "times.txt", out="rest.exr")
    rest = radiance(tmp_path / "rest.exr")
    for more in ((), ("--deghost",)):
        r = hdrgen(tmp_path, [case / f"w{i}.png" for i in range(3)], *more, times=case / "times.txt")
        d = np.log2(radiance(tmp_path / "out.exr")[free] / rest[free])
        assert (np.abs(d - np.median(d)) > .25).mean() < .02
    assert "something moving" in r.err


def synthetic(folder, said=TIMES, change=None):
    names = make_series(folder, scene(160, 200, decades=4, lowest=-2), TIMES, f_gamma)
    for k, n in enumerate(names):
        if change:
            write_png(folder / n, change(np.asarray(Image.open(folder / n)), k))
    write_times(folder, names, said)
    return names


def swapped(t, i, j):
    t = t.copy()
    t[[i, j]] = t[[j, i]]
    return t


def one_wrong(t, i, by):
    t = t.copy()
    t[i] *= by
    return t


def moved(z, k):
    rng = np.random.default_rng(k)
    return np.roll(z, tuple(rng.integers(-4, 5, 2)), (0, 1))


def tone_mapped(z, k):
    g = z / 255
    mean = np.clip(g.mean(), .02, .98)
    return np.round(255 * g ** (np.log(.4) / np.log(mean))).astype(np.uint8)


@pytest.mark.parametrize("said, change, words", [
    (one_wrong(TIMES, 4, 2), None, "exp_04.png"), (one_wrong(TIMES, 5, .5), None, "exp_05.png"), (swapped(TIMES, 3, 5), None, ""),
    (TIMES, moved, "moved camera"), (TIMES, tone_mapped, "")])
def test_contradictions_are_said_and_strict_fails(tmp_path, said, change, words):
    names = synthetic(tmp_path, said, change)
    r = hdrgen(tmp_path, names)
    lines = [x for x in r.err.splitlines() if "exposures disagree" in x]
    assert len(lines) == 1 and words in lines[0]
    (tmp_path / "out.exr").unlink()
    one_line_error(hdrgen(tmp_path, names, "--strict", code=1), "hdrgen", "disagree")
    assert not (tmp_path / "out.exr").exists()


@pytest.mark.parametrize("step", [2.0, 4.0, 8.0])
def test_clean_series_pass_strictly(tmp_path, step):
    truth = scene(160, 200, decades=3, lowest=-2)
    names = make_series(tmp_path, truth, step ** np.arange(-3, 1), f_gamma)
    assert "disagree" not in hdrgen(tmp_path, names, "--strict").err


REAL = {"bracket_memorial_church": ("memorial*.png", ("--fill", "0,0,255")), "bracket_window_nikon_e995": ("*.jpg", ()),
        "fisheye_bracket_office_canon5d2_8mm": ("IMG_*.jpg", ()), "mirrorball_bracket_desk_sony": ("desk_[123].JPG", ())}


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.sweep) if "office" in n or "window" in n else n for n in REAL])
def test_real_series_at_rest(tmp_path, name):
    """They pass strictly, and --deghost leaves them alone: no light of the lamps goes, next to no pixel changes."""
    data = shared_data(name)
    pattern, more = REAL[name]
    files = sorted(data.glob(pattern))
    (tmp_path / "t.txt").write_text("".join(
        f'"{data / x[0]}" {x[1]}\n' for x in (line.split() for line in (data / "exposures.txt").read_text().splitlines())
        if len(x) > 1 and x[0][0] != "#"))
    assert "disagree" not in hdrgen(tmp_path, files, "--strict", *more, times="t.txt", out="a.exr").err
    hdrgen(tmp_path, files, "--deghost", *more, times="t.txt", out="b.exr")
    a, b = radiance(tmp_path / "a.exr"), radiance(tmp_path / "b.exr")
    changed = np.abs(np.log2((b + 1e-12) / (a + 1e-12))).max(axis=-1) > .25
    lamps = a.sum(axis=-1) >= np.quantile(a.sum(axis=-1), .995)
    assert changed.mean() < .001
    assert abs(b[lamps].sum() / a[lamps].sum() - 1) < .005


def test_hand_held_series_are_said(tmp_path):
    case = shared_case("handheld")
    names = sorted(case.glob("h*.png"))
    assert "moved camera" in hdrgen(tmp_path, names, times=case / "times.txt").err
    one_line_error(hdrgen(tmp_path, names, "--strict", times=case / "times.txt", code=1), "hdrgen", "disagree")


@pytest.mark.parametrize("head, words", [
    (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", ("HEIC", "heif-convert")), (b"\0\0\0\x1cftypavif\0\0\0\0avif", ("AVIF", "avifdec")),
    (b"RIFF\x24\0\0\0WEBPVP8 ", ("WebP", "dwebp")), (b"\xff\x0a\xfa\x1f\x41\x91", ("JPEG XL", "djxl")),
    (b"\0\0\0\x0cJXL \r\n\x87\n\0\0\0\x14ftypjxl ", ("JPEG XL", "djxl"))])
def test_formats_of_phones_are_named(tmp_path, head, words):
    (tmp_path / "a.jpg").write_bytes(head + bytes(64))
    one_line_error(hdrgen(tmp_path, ["a.jpg"], times=None, code=1), "hdrgen", "a.jpg", *words)
