"""fishremap on one picture: frames, what is not seen, lens and falloff files, several pictures, bad input."""
import json

import numpy as np
import pytest

import fishremap_util as U
from conftest import one_line_error, run, shared_data
from fishremap_util import remap


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


# ---- frames (docs/FORMAT.md, section 1.4) -----------------------------------------------------------------

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


DEEP = '{"f4": ' + '{"a": ' * 5000 + "1" + "}" * 5000 + "}"


@pytest.mark.parametrize("text, said", [
    ('{\n "f4": {"2": 0.1},\n}', "line 3"), ('{"f4": {"2": NaN}}', "line 1"), ('{"f4": {"2": 1e999}}', "line 1"), ('{"f4": {"2": Infinity}}', "line 1"),
    ('{"f4": {"2": 0.1}, "f4": {"2": 0.2}}', "f4"), ('{"f4": {"2": 0.1, "2": 0.2}}', "duplicate"), (DEEP, "depth"), ('{"x": ' + "[" * 3000, "depth"),
    ('{"f4": {"2": {"4": 1}}}', "f4"), ('{"f4": {"2": "0.1"}}', "number for power 2"), ('{"f4": {"2": [0.1]}}', "number for power 2"),
    ('{"f4": {"33": 0.1}}', "0..32"), ('{"f4": {"-1": 0.1}}', "0..32"), ('{"f4": {}}', "none"), ('{"lens": "x"}', "none"), ('{"f4": {"2": 0.1}} x', "line 1"),
    ('{"f4": {"2": 0,1}}', "line 1"), ('{"f\xff": {"2": 0.1}}', "line 1"), ("{'f4': {'2': 0.1}}", "line 1")])
def test_what_is_no_falloff_in_json_is_refused(tmp_path, text, said):
    (tmp_path / "bad").write_bytes(text.encode("latin-1"))
    p = run("fishremap", "--dry-run", "--lens", "equidistant", "--fov", 180, "--size", "8x8", "--falloff", tmp_path / "bad", "-o", tmp_path / "o.exr", "in.exr", code=1)
    one_line_error(p, "fishremap", f"{tmp_path}/bad", said)


@pytest.mark.parametrize("more", [{}, {"remark": [1, {"x": None}, True]}, {"about": "f2 \u00e9 \" {", "n": 3, "none": None}])
def test_falloff_in_json_as_pythons_json_writes_it(tmp_path, more):
    """Whatever the form, the order and the remarks, the same curve as polynomial text."""
    image = np.ones((40, 40, 3), np.float32)
    c = {"2": -0.1, "4": 0.02, "7": -1e-2, "0": 1, "note": "x"}
    (tmp_path / "text").write_text("polynomial rn 1 0 -0.1 0 0.02 0 0 -0.01\n")
    args = ("--lens", "equidistant", "--fov", 180, "--size", "16x16", "--falloff")
    want = remap(tmp_path, image, *args, tmp_path / "text")
    for sets in ({"f4": c, **more}, {**more, "f9": {"2": 5}, "f4": dict(reversed(c.items()))}):
        for form in ({}, {"indent": 3}, {"ensure_ascii": False, "separators": (",", ":")}):
            (tmp_path / "a.json").write_text(json.dumps(sets, **form))
            assert np.array_equal(remap(tmp_path, image, *args, tmp_path / "a.json", "--falloff-set", "f4"), want)


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
        *sorted(folder.glob("IMG_*.jpg")))
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
