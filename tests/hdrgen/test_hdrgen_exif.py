"""hdrgen: exposures as files state them, in every form; what is missing or contradicts itself is said or refused."""
import numpy as np
import pytest

from conftest import one_line_error, run, shared_case
from exif_util import rational, save
from hdrgen_util import *  # noqa: F403

TIME, FN, ISO, TV, AV = 0x829A, 0x829D, 0x8827, 0x9201, 0x9202
TYPE, SOS, REI, SPEED = 0x8830, 0x8831, 0x8832, 0x8833
EXPOSURES = [1 / 64, 1 / 16, 1 / 4]


def pictures(exposures=EXPOSURES):
    truth, rng = scene(48, 64, decades=2.5), np.random.default_rng(8)
    return [expose(truth, t, f_srgb, max_code=255, rng=rng).astype(np.uint8) for t in exposures]


def facts(t, n=8.0, iso=100):
    return {TIME: (5, [rational(t)]), FN: (5, [rational(n)]), ISO: (3, [iso])}


def series(folder, each, suffix=".jpg", images=None, **more):
    names = []
    for k, z in enumerate(images or pictures()):
        names.append(f"i{k}{suffix}")
        save(folder / names[-1], z, each[k], **more)
    return names


def times_of(path):
    return np.array(read_exr(path)[1]["hdrgen:times"], float)


# the middle shot's exposure is 1/16 s at f/8, ISO 100 in each of these
FORMS = {
    "iso": {TIME: (5, [(1, 64)]), FN: (5, [(8, 1)]), ISO: (3, [400])},
    "f-number": {TIME: (5, [(1, 4)]), FN: (5, [(16, 1)]), ISO: (3, [100])},
    "aperture by APEX": {TIME: (5, [(1, 4)]), AV: (5, [(8, 1)]), ISO: (3, [100])},
    "f-number 0/0, aperture by APEX": {TIME: (5, [(1, 4)]), FN: (5, [(0, 0)]), AV: (5, [(8, 1)]), ISO: (3, [100])},
    "time by APEX": {TV: (10, [(4, 1)]), FN: (5, [(8, 1)]), ISO: (3, [100])},
    "time 0/0 and by APEX": {TIME: (5, [(0, 0)]), TV: (10, [(4, 1)]), FN: (5, [(8, 1)]), ISO: (3, [100])},
    "iso in REI": {TIME: (5, [(1, 16000)]), FN: (5, [(8, 1)]), ISO: (3, [65535]), TYPE: (3, [2]), REI: (4, [100000])},
    "iso in SOS": {TIME: (5, [(1, 16000)]), FN: (5, [(8, 1)]), ISO: (3, [65535]), TYPE: (3, [1]), SOS: (4, [100000]), REI: (4, [7])},
    "iso in ISOSpeed": {TIME: (5, [(1, 16000)]), FN: (5, [(8, 1)]), TYPE: (3, [3]), SPEED: (4, [100000]), REI: (4, [7])},
    "iso 0, no type": {TIME: (5, [(1, 64)]), FN: (5, [(8, 1)]), ISO: (3, [0]), REI: (4, [400])},
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_every_form_gives_the_same_exposures(tmp_path, suffix, form):
    each = [facts(EXPOSURES[0]), FORMS[form], facts(EXPOSURES[2])]
    names = series(tmp_path, each, suffix)
    p = hdrgen(tmp_path, names, "-r", "srgb", times=None)
    assert np.allclose(times_of(tmp_path / "out.exr"), EXPOSURES, rtol=1e-5)
    assert "the pixels" not in p.err and "no ISO" not in p.err and "no f-number" not in p.err
    a = radiance(tmp_path / "out.exr")
    names = series(tmp_path, [facts(t) for t in EXPOSURES], suffix)
    hdrgen(tmp_path, names, "-r", "srgb", times=None)
    assert np.allclose(a, radiance(tmp_path / "out.exr"), rtol=1e-4)


def test_facts_beside_the_picture(tmp_path):
    names = series(tmp_path, [facts(t) for t in EXPOSURES], ".tif", ep=True)
    hdrgen(tmp_path, names, "-r", "srgb", times=None)
    assert np.allclose(times_of(tmp_path / "out.exr"), EXPOSURES, rtol=1e-5)


def test_the_order_of_the_command_line_says_nothing(tmp_path):
    each = [facts(EXPOSURES[0], iso=100), facts(EXPOSURES[1] / 4, iso=400), facts(EXPOSURES[2] * 4, n=16)]
    names = series(tmp_path, each)
    got = []
    for order in (names, names[::-1], [names[1], names[2], names[0]]):
        hdrgen(tmp_path, order, times=None)
        got.append(radiance(tmp_path / "out.exr"))
        assert np.allclose(times_of(tmp_path / "out.exr"), EXPOSURES, rtol=1e-6)
    assert (got[0] == got[1]).all() and (got[0] == got[2]).all()


@pytest.mark.parametrize("tag, name", [(ISO, "ISO"), (FN, "f-number")])
def test_one_lacks_what_others_state(tmp_path, tag, name):
    each = [facts(t) for t in EXPOSURES]
    del each[2][tag]
    names = series(tmp_path, each)
    p = hdrgen(tmp_path, names, "-r", "srgb", times=None)            # the others agree: theirs
    assert f"i2.jpg: no {name}" in p.err and np.allclose(times_of(tmp_path / "out.exr"), EXPOSURES, rtol=1e-5)
    each[1] = facts(EXPOSURES[1] / 4, iso=400) if tag == ISO else facts(EXPOSURES[1] * 4, n=16)
    names = series(tmp_path, each)                                    # they don't
    one_line_error(hdrgen(tmp_path, names, "-r", "srgb", times=None, code=1), "hdrgen", "i2.jpg", name, "--times")
    write_times(tmp_path, names, EXPOSURES)                           # as the message asks
    p = hdrgen(tmp_path, names, "-r", "srgb")
    assert "taken as they are" in p.err and np.allclose(times_of(tmp_path / "out.exr"), EXPOSURES, rtol=1e-6)


def test_none_states_it(tmp_path):
    """Lenses without contacts: nothing to say."""
    each = [{TIME: facts(t)[TIME], ISO: (3, [100])} for t in EXPOSURES]
    p = hdrgen(tmp_path, series(tmp_path, each), "-r", "srgb", times=None)
    assert "f-number" not in p.err
    assert "aperture" not in read_exr(tmp_path / "out.exr")[1]


@pytest.mark.parametrize("bad", [{}, {TIME: (5, [(0, 0)])}, {TIME: (5, [(1, 0)])}, {TIME: (5, [(0, 1)])}, {TV: (10, [(1, 0)])}])
def test_no_time_is_no_time(tmp_path, bad):
    each = [facts(EXPOSURES[0]), {**bad, FN: (5, [(8, 1)]), ISO: (3, [100])}, facts(EXPOSURES[2])]
    one_line_error(hdrgen(tmp_path, series(tmp_path, each), "-r", "srgb", times=None, code=1), "hdrgen", "i1.jpg", "exposure time", "--times")


@pytest.mark.parametrize("how", [[], ["-r", "srgb"], ["-r", "linear"]], ids=" ".join)
def test_one_time_for_all_though_the_pictures_differ(tmp_path, how):
    names = series(tmp_path, [facts(1 / 80)] * 3)
    line = one_line_error(hdrgen(tmp_path, names, *how, times=None, code=1), "hdrgen", "0.0125 s", "--times", "brightness")
    assert "--response" not in line
    write_times(tmp_path, names, EXPOSURES)
    hdrgen(tmp_path, names, *how)


def test_repeats_of_one_exposure_are_a_series(tmp_path):
    names = series(tmp_path, [facts(1 / 80)] * 3, images=pictures([1 / 16] * 3))
    p = hdrgen(tmp_path, names, "-r", "srgb", times=None)
    assert "pixels" not in p.err.replace(" pixels (", "")
    one_line_error(hdrgen(tmp_path, names, times=None, code=1), "hdrgen", "same", "--response")


def test_facts_that_the_pixels_contradict_are_said(tmp_path):
    """Two stops more by EXIF, none by the pixels (an ISO that is not stated, a filter); and a right series says nothing."""
    names = series(tmp_path, [facts(t) for t in (1 / 64, 1 / 16, 1 / 4)], images=pictures([1 / 64, 1 / 16, 1 / 16]))
    p = hdrgen(tmp_path, names, "-r", "srgb", times=None)
    assert "i2.jpg" in p.err and "2.0 stops more light than i1.jpg" in p.err and "--times" in p.err
    names = series(tmp_path, [facts(t) for t in EXPOSURES])
    for how in (["-r", "srgb"], []):
        assert "stops more light" not in hdrgen(tmp_path, names, *how, times=None).err


def test_what_was_used_stands_in_the_header(tmp_path):
    each = [facts(EXPOSURES[0]), facts(EXPOSURES[1] / 4, iso=400), facts(EXPOSURES[2])]
    p = hdrgen(tmp_path, series(tmp_path, each), "-r", "srgb", "-v", times=None)
    h = read_exr(tmp_path / "out.exr")[1]
    assert np.allclose(np.array(h["hdrgen:seconds"], float), [1 / 64, 1 / 64, 1 / 4], rtol=1e-6)
    assert np.allclose(np.array(h["hdrgen:isos"], float), [100, 400, 100]) and "isoSpeed" not in h
    assert np.allclose(np.array(h["hdrgen:fNumbers"], float), 8) and h["aperture"] == pytest.approx(8)
    assert "i1.jpg: 0.015625 s, f/8, ISO 400: exposure 0.0625" in p.err
    hdrgen(tmp_path, series(tmp_path, each), "-r", "srgb", times=None, out="out.hdr")
    assert b"\naperture=8\n" in (tmp_path / "out.hdr").read_bytes()[:4096]


@pytest.mark.parametrize("suffix", ["exr", "hdr"])
def test_fishremap_takes_the_falloff_of_that_aperture(tmp_path, suffix):
    """The falloff's set is chosen by the f-number that the camera wrote."""
    (tmp_path / "f.json").write_text('{"f4": {"2": -0.5}, "f8": {"2": -0.1}}')
    for n in (4, 8):
        hdrgen(tmp_path, series(tmp_path, [facts(t, n=n) for t in EXPOSURES]), "-r", "srgb", times=None, out=f"in{n}.{suffix}")
    common = ["fishremap", "--lens", "equidistant", "--fov", "180", "--size", "32x16", "--falloff", "f.json"]
    for n in (4, 8):
        run(*common, "-o", "auto.exr", f"in{n}.{suffix}", cwd=tmp_path)
        run(*common, "--aperture", str(n), "-o", "told.exr", f"in{n}.{suffix}", cwd=tmp_path)
        run(*common, "--aperture", str(12 - n), "-o", "other.exr", f"in{n}.{suffix}", cwd=tmp_path)
        a, b, c = (radiance(tmp_path / f"{x}.exr") for x in ("auto", "told", "other"))
        assert (a == b).all() and not np.allclose(a, c)


def test_the_stated_cases(tmp_path):
    """Brackets from outside, exposures known."""
    right = [2.0**-9, 2.0**-7, 2.0**-5, 2.0**-3, 2.0**-1]
    for case in ("exif_aperture_as_apex_only", "exif_iso_above_65535"):
        hdrgen(tmp_path, sorted(shared_case(case).glob("*.jpg")), times=None)
        assert np.allclose(times_of(tmp_path / "out.exr"), right, rtol=1e-3), case
    names = sorted(shared_case("exif_iso_missing_in_one").glob("*.jpg"))
    one_line_error(hdrgen(tmp_path, names, times=None, code=1), "hdrgen", "i4.jpg", "ISO")
    names = sorted(shared_case("exif_all_the_same").glob("*.jpg"))
    for how in ([], ["-r", "srgb"]):
        one_line_error(hdrgen(tmp_path, names, *how, times=None, code=1), "hdrgen", "--times", "0.0125 s")
