"""Lenses as other programs write them: each picture is made by numpy from the format's own definition, the file as that program writes it.

A picture's colours are the directions that its pixels show, so that what comes out tells, texel by texel, where fishremap believes
each pixel to look: a focal length, a shear, a swapped row and column or a wrong size shows.
"""
import json

import numpy as np
import pytest

import fishremap_util as U
from conftest import one_line_error, run, shared_case, shared_data

W, H = 240, 200
CX, CY = 123.2, 96.4        # OpenCV's: (0,0) in the middle of the first pixel
KB = (.03, -.012, .004, -.0007)


def kb(t, k=KB):
    return t * (1 + sum(c * t ** (2 * i + 2) for i, c in enumerate(k)))


def pinhole(t, k):
    u = np.tan(t)
    return u * (1 + k[0] * u ** 2 + k[1] * u ** 4 + k[2] * u ** 6) / (1 + sum(c * u ** (2 * i + 2) for i, c in enumerate(k[3:])))


def growing(radius, limit):
    """Angles from 0 to where the radius stops growing, and their radii."""
    t = np.linspace(0, limit, 40001)
    r = radius(t)
    with np.errstate(invalid="ignore"):
        stop = np.flatnonzero(~(np.diff(r) > 0))
    n = stop[0] + 1 if len(stop) else len(t)
    return t[:n], r[:n]


def directions(radius, limit, matrix, centre, w=W, h=H):
    """(u, v, n) that each pixel shows, and its angle: centre + matrix (right, down) radius(angle), x right and y down in pixels."""
    y, x = np.mgrid[0:h, 0:w]
    q = np.stack([x - centre[0], y - centre[1]], -1) @ np.linalg.inv(np.asarray(matrix, float)).T
    t, r = growing(radius, limit)
    theta = np.interp(np.hypot(q[..., 0], q[..., 1]), r, t)
    psi = np.arctan2(-q[..., 1], q[..., 0])
    return np.stack([-np.sin(theta) * np.cos(psi), np.sin(theta) * np.sin(psi), np.cos(theta)], -1), theta


def yaml_matrix(name, m):
    m = np.atleast_2d(m)
    return f"{name}: !!opencv-matrix\n   rows: {m.shape[0]}\n   cols: {m.shape[1]}\n   dt: d\n   data: [ " + ",\n       ".join(repr(float(v)) for v in m.ravel()) + " ]\n"


def opencv_yaml(K, D, more=""):
    return f"%YAML:1.0\n---\ncalibration_time: \"Mon Nov 30 2026\"\nimage_width: {W}\nimage_height: {H}\n{more}" + yaml_matrix("camera_matrix", K) + \
        yaml_matrix("distortion_coefficients", np.reshape(D, (-1, 1))) + "avg_reprojection_error: 2.1e-01\n"


def opencv_xml(K, D):
    def m(name, v):
        v = np.atleast_2d(v)
        return f'<{name} type_id="opencv-matrix"><rows>{v.shape[0]}</rows><cols>{v.shape[1]}</cols><dt>d</dt><data>{" ".join(map(repr, map(float, v.ravel())))}</data></{name}>'
    return f'<?xml version="1.0"?>\n<opencv_storage>\n<image_Width>{W}</image_Width>\n<image_Height>{H}</image_Height>\n<fisheye_model>1</fisheye_model>\n' + \
        m("Camera_Matrix", K) + m("Distortion_Coefficients", np.reshape(D, (1, -1))) + "\n</opencv_storage>\n"


def opencv_json(K, D):
    def m(v):
        v = np.atleast_2d(v)
        return {"type_id": "opencv-matrix", "rows": v.shape[0], "cols": v.shape[1], "dt": "d", "data": [float(x) for x in v.ravel()]}
    return json.dumps({"image_width": W, "image_height": H, "K": m(K), "D": m(np.reshape(D, (-1, 1)))}, indent=4)


def gyroflow(K, D, **more):
    return json.dumps({"name": "Some \"camera\" [4k] {wide}", "note": None, "calib_dimension": {"w": W, "h": H}, "orig_dimension": {"w": W, "h": H}, "gyro_lpf": None,
                       "input_horizontal_stretch": 1.0, "input_vertical_stretch": 1.0, "asymmetrical": False, "compatible_settings": [], "sync_settings": {},
                       "digital_lens": None, "official": False,
                       "fisheye_params": {"RMS_error": .5, "camera_matrix": np.asarray(K).tolist(), "distortion_coeffs": list(D), "radial_distortion_limit": None}} | more)


def kalibr(model, intrinsics, dist, coefs):
    return f"cam0:\n  cam_overlaps: []\n  camera_model: {model}\n  distortion_coeffs: {list(coefs)}\n  distortion_model: {dist}\n  intrinsics: {list(intrinsics)}\n" \
        f"  T_cam_imu:\n  - [1.0, 0.0, 0.0,\n    0.1]\n  - [0.0, 1.0, 0.0, 0.0]\n  resolution: [{W}, {H}]\n  rostopic: /cam0/image_raw\n"


def ros(K, D, model):
    return f"image_width: {W}\nimage_height: {H}\ncamera_name: narrow\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: {[float(v) for v in np.ravel(K)]}\n" \
        f"distortion_model: {model}\ndistortion_coefficients:\n  rows: 1\n  cols: {len(D)}\n  data: {list(D)}\n"


def K(fx, fy, skew=0):
    return [[fx, skew, CX], [0, fy, CY], [0, 0, 1]]


def eucm(t, a=.6, b=1.1):
    return np.sin(t) / (a * np.sqrt(b * np.sin(t) ** 2 + np.cos(t) ** 2) + (1 - a) * np.cos(t))


def ds(t, xi=-.2, a=.55):
    z = xi + np.cos(t)
    return np.sin(t) / (a * np.sqrt(np.sin(t) ** 2 + z ** 2) + (1 - a) * z)


def omni(t, xi=1.2, k=(-.1, .02)):
    u = np.sin(t) / (np.cos(t) + xi)
    return u * (1 + k[0] * u ** 2 + k[1] * u ** 4)


# OCamCalib: z = f(rho) with rho in pixels; row - xc = c x + d y, column - yc = e x + y, x down and y right
OCAM_F = (-60., 0, 2.2e-3, -6e-6, 4e-8)
OCAM_AFFINE = (.95, .03, -.04)


def ocam(affine=OCAM_AFFINE, size=(H, W)):
    return "#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB). These are used by cam2world\n\n" \
        f"{len(OCAM_F)} {' '.join(map(str, OCAM_F))} \n\n#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB). These are used by " \
        f"world2cam\n\n3 80.0 40.0 -3.0 \n\n#center: \"row\" and \"column\", starting from 0 (C convention)\n\n{CY} {CX}\n\n#affine parameters \"c\", \"d\", \"e\"\n\n" \
        f"{affine[0]} {affine[1]} {affine[2]}\n\n#image size: \"height\" and \"width\"\n\n{size[0]} {size[1]}\n"


def ocam_radius(t):
    rho = np.linspace(0, 200, 20001)
    return np.interp(t, np.arctan2(rho, -np.polyval(OCAM_F[::-1], rho)), rho)


C, D_, E_ = OCAM_AFFINE
RATIONAL = (-.2, .05, 0, 0, .01, .1, .02, .003)
FORMATS = {   # text, radius of the angle, its end, matrix of (right, down)
    "own": (f"kannala-brandt {' '.join(map(str, KB))}\ncamera 70 62 {CX} {CY}\nsize {W} {H}\n", kb, 3.1, [[70, 0], [0, 62]]),
    "own, skewed": (f"kannala-brandt {' '.join(map(str, KB))}\ncamera 70 62 {CX} {CY} 6\nsize {W} {H}\n", kb, 3.1, [[70, 6], [0, 62]]),
    "OpenCV YAML": (opencv_yaml(K(70, 62), KB, "fisheye_model: 1\n"), kb, 3.1, [[70, 0], [0, 62]]),
    "OpenCV YAML, alpha": (opencv_yaml(K(70, 62, 4), KB), kb, 3.1, [[70, 4], [0, 62]]),
    "OpenCV XML": (opencv_xml(K(70, 62), KB), kb, 3.1, [[70, 0], [0, 62]]),
    "OpenCV JSON": (opencv_json(K(70, 62), KB), kb, 3.1, [[70, 0], [0, 62]]),
    "OpenCV pinhole": (opencv_yaml(K(120, 110), (-.2, .05, 0, 0, .01)), lambda t: pinhole(t, (-.2, .05, .01)), 1.56, [[120, 0], [0, 110]]),
    "OpenCV rational": (opencv_yaml(K(120, 110), RATIONAL), lambda t: pinhole(t, RATIONAL[:2] + RATIONAL[4:]), 1.56, [[120, 0], [0, 110]]),
    "gyroflow": (gyroflow(K(70, 62), KB), kb, 3.1, [[70, 0], [0, 62]]),
    "ROS": (ros(K(70, 62), KB, "equidistant"), kb, 3.1, [[70, 0], [0, 62]]),
    "ROS plumb_bob": (ros(K(120, 110), (-.2, .05, 0, 0, 0), "plumb_bob"), lambda t: pinhole(t, (-.2, .05, 0)), 1.56, [[120, 0], [0, 110]]),
    "Kalibr equi": (kalibr("pinhole", (70, 62, CX, CY), "equidistant", KB), kb, 3.1, [[70, 0], [0, 62]]),
    "Kalibr eucm": (kalibr("eucm", (.6, 1.1, 80, 75, CX, CY), "none", ()), eucm, 2.2, [[80, 0], [0, 75]]),
    "Kalibr ds": (kalibr("ds", (-.2, .55, 60, 58, CX, CY), "none", ()), ds, 2.2, [[60, 0], [0, 58]]),
    "Kalibr omni": (kalibr("omni", (1.2, 160, 150, CX, CY), "radtan", (-.1, .02, 0, 0)), omni, 2.5, [[160, 0], [0, 150]]),
    "OCamCalib": (ocam(), ocam_radius, 3.1, [[1, E_], [D_, C]]),     # (right, down) = (y, x)
}


def lens(tmp_path, text):
    (tmp_path / "lens").write_text(text)
    return ("--lens", tmp_path / "lens")


def seen_directions(tmp_path, image, *args):
    """Remap to a panorama; what its texels hold, what they are, where they are wholly seen."""
    U.write_exr(tmp_path / "in.exr", image)
    r = run("fishremap", *args, "--to", "latlong", "--size", "180x90", "-o", tmp_path / "out.exr", tmp_path / "in.exr")
    got = U.read_exr(tmp_path / "out.exr")[0]
    y, x = np.mgrid[0:90, 0:180] + .5
    lon, lat = (x / 180 - .5) * 2 * np.pi, (.5 - y / 90) * np.pi
    d = np.stack([-np.cos(lat) * np.sin(lon), np.sin(lat), np.cos(lat) * np.cos(lon)], -1)
    return 2 * got[..., :3] - 1, d, got[..., 3] == 1 if got.shape[2] == 4 else np.ones(got.shape[:2], bool), r


@pytest.mark.parametrize("name", FORMATS)
def test_a_calibration_is_read_as_its_program_means_it(tmp_path, name):
    text, radius, limit, matrix = FORMATS[name]
    image = (1 + directions(radius, limit, matrix, (CX, CY))[0]) / 2
    got, d, sure, r = seen_directions(tmp_path, image, *lens(tmp_path, text))
    assert sure.sum() > 1000
    error = np.linalg.norm(got - d, axis=-1)[sure]
    assert np.median(error) < .002 and np.quantile(error, .98) < .015, (np.median(error), error.max())
    # and the other way: that camera's picture of a panorama shows these directions
    y, x = np.mgrid[0:180, 0:360] + .5
    lon, lat = (x / 360 - .5) * 2 * np.pi, (.5 - y / 180) * np.pi
    U.write_exr(tmp_path / "pan.exr", (1 + np.stack([-np.cos(lat) * np.sin(lon), np.sin(lat), np.cos(lat) * np.cos(lon)], -1)) / 2)
    run("fishremap", "--from", "latlong", "--to", "fisheye", "--lens", tmp_path / "lens", "--size", f"{W}x{H}", "-o", tmp_path / "back.exr", tmp_path / "pan.exr")
    back = U.read_exr(tmp_path / "back.exr")[0]
    whole = back[..., 3] == 1 if back.shape[2] == 4 else np.ones(back.shape[:2], bool)
    error = np.abs(back[..., :3] - image)[whole]
    assert whole.mean() > .5 and np.median(error) < .001 and np.quantile(error, .99) < .01


@pytest.mark.parametrize("name", ["own", "gyroflow", "Kalibr ds", "OCamCalib"])
def test_other_sizes_of_the_same_aspect_scale_and_others_are_refused(tmp_path, name):
    text, radius, limit, matrix = FORMATS[name]
    for k in (.5, 1.5):
        w, h = int(W * k), int(H * k)
        centre = ((CX + .5) * k - .5, (CY + .5) * k - .5)
        image = (1 + directions(radius, limit, k * np.asarray(matrix), centre, w, h)[0]) / 2
        got, d, sure, _ = seen_directions(tmp_path, image, *lens(tmp_path, text))
        assert np.median(np.linalg.norm(got - d, axis=-1)[sure]) < .004
    U.write_exr(tmp_path / "in.exr", np.ones((H, W + 20, 3)))
    r = run("fishremap", *lens(tmp_path, text), "--size", "8x8", "-o", tmp_path / "o.exr", tmp_path / "in.exr", code=1)
    one_line_error(r, "fishremap", f"{W} x {H}", f"{W + 20} x {H}")


def test_a_size_that_is_not_stated_is_assumed_and_said(tmp_path):
    text = f"kannala-brandt {' '.join(map(str, KB))}\ncamera 70 62 {CX} {CY}\n"
    U.write_exr(tmp_path / "in.exr", np.ones((H, W, 3)))
    r = run("fishremap", *lens(tmp_path, text), "--size", "8x8", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    assert f"{W} x {H}" in r.err
    U.write_exr(tmp_path / "in.exr", np.ones((H * 3 // 4, W * 3 // 4, 3)))
    r = run("fishremap", *lens(tmp_path, text), "--fov", 110, "--size", "8x8", "-o", tmp_path / "o2.exr", tmp_path / "in.exr", code=1)
    one_line_error(r, "fishremap", "principal point", "size")
    assert not (tmp_path / "o2.exr").exists()


@pytest.mark.parametrize("text, words", [
    (opencv_yaml(K(120, 110), (-.2, .05, .01, -.02, 0)), ("tangential",)),
    (opencv_yaml(K(120, 110), (-.2, .05, 0, 0, 0, 0, 0, 0, .1, 0, 0, 0)), ("thin-prism",)),
    (opencv_yaml(K(120, 110), (-.2, .05, 0)), ("coefficients", "3")),
    (ros(K(70, 62), KB, "some_new_model"), ("some_new_model",)),
    (kalibr("pinhole", (70, 62, CX, CY), "some_new_model", KB), ("some_new_model",)),
    (kalibr("sphere9", (70, 62, CX, CY), "none", ()), ("sphere9",)),
    (kalibr("ds", (.2, .5, 70, 62, CX), "none", ()), ("6", "5")),
    (kalibr("pinhole", (70, 62, CX, CY), "equidistant", KB) + kalibr("pinhole", (70, 62, CX, CY), "equidistant", KB).replace("cam0", "cam1"), ("cam0, cam1", "@")),
    (gyroflow(K(70, 62), KB, digital_lens="gopro_superview"), ("gopro_superview",)),
    (gyroflow(K(70, 62), KB, input_horizontal_stretch=1.33), ("1.33",)),
    (gyroflow(K(70, 62), KB, distortion_model="ptlens"), ("ptlens",)),
    (gyroflow([[70, 0, 900], [0, 62, CY], [0, 0, 1]], KB), ("principal point",)),
    (gyroflow([[-70, 0, CX], [0, 62, CY], [0, 0, 1]], KB), ("-70",)),
    ("%YAML:1.0\n---\nhello: [1, 2", ()), ("{\"a\": ", ()), ("<?xml version=\"1.0\"?><a>", ()), ("a: b\n", ("camera matrix",)), ("{}", ()), ("{\"a\": 1}", ("camera matrix",)),
    (ocam().replace("#affine", "#fine").replace(".95 ", "x "), ("affine",)), (ocam()[:330], ("missing",)), (ocam().replace("-60.0", "60.0"), ("negative",))])
def test_what_is_not_understood_is_refused_by_name(tmp_path, text, words):
    U.write_exr(tmp_path / "in.exr", np.ones((H, W, 3)))
    r = run("fishremap", *lens(tmp_path, text), "--size", "8x8", "-o", tmp_path / "o.exr", tmp_path / "in.exr", code=1)
    one_line_error(r, "fishremap", *words)
    assert not (tmp_path / "o.exr").exists()


def test_small_tangential_terms_are_left_out_and_said(tmp_path):
    U.write_exr(tmp_path / "in.exr", np.ones((H, W, 3)))
    text = opencv_yaml([[500, 0, CX], [0, 500, CY], [0, 0, 1]], (-.2, .05, .0004, -.0002, 0))
    r = run("fishremap", *lens(tmp_path, text), "--size", "8x8", "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    assert "tangential" in r.err and "left out" in r.err


def test_one_of_two_cameras_by_name(tmp_path):
    two = kalibr("pinhole", (70, 62, CX, CY), "equidistant", KB) + kalibr("ds", (-.2, .55, 60, 58, CX, CY), "none", ()).replace("cam0", "cam1")
    (tmp_path / "chain.yaml").write_text(two)
    image = (1 + directions(ds, 2.2, [[60, 0], [0, 58]], (CX, CY))[0]) / 2
    got, d, sure, _ = seen_directions(tmp_path, image, "--lens", f"{tmp_path / 'chain.yaml'}@cam1")
    assert np.median(np.linalg.norm(got - d, axis=-1)[sure]) < .002


def test_a_polynomial_that_stops_growing(tmp_path):
    """r = t - .1 t^3 grows up to 104.6 degrees, where r = 1.217: beyond the corner it does not matter; within the picture it does."""
    text = f"kannala-brandt -.1\ncamera {{f}} {{f}} {CX} {CY}\nsize {W} {H}\n"
    def radius(t):
        return t - .1 * t ** 3
    image = (1 + directions(radius, 3, [[140, 0], [0, 140]], (CX, CY))[0]) / 2
    for more in ((), ("--fov", 220)):        # 154.6 pixels to the corner: r = 1.10
        got, d, sure, r = seen_directions(tmp_path, image, *lens(tmp_path, text.format(f=140)), *more)
        assert np.median(np.linalg.norm(got - d, axis=-1)[sure]) < .002 and "ends" not in r.err
    image = (1 + directions(radius, 3, [[80, 0], [0, 80]], (CX, CY))[0]) / 2
    got, d, sure, r = seen_directions(tmp_path, image, *lens(tmp_path, text.format(f=80)))
    assert "104.6" in r.err and np.degrees(np.arccos(d[..., 2][sure].min())) > 100
    r = run("fishremap", *lens(tmp_path, text.format(f=80)), "--fov", 220, "--size", "8x8", "-o", tmp_path / "o.exr", tmp_path / "in.exr", code=1)
    one_line_error(r, "fishremap", "104.6")


def test_the_files_of_the_case(tmp_path):
    folder = shared_case("kb_lens_files")
    for args, code in ((("fx_fy_2percent.txt", "grey.png"), 0), (("no_fov.txt", "grey.png"), 0), (("no_fov.txt", "grey_three_quarters.png"), 1)):
        run("fishremap", "--lens", folder / args[0], "--size", "32x16", "-o", tmp_path / "k.exr", folder / args[1], code=code)
    run("fishremap", "--lens", folder / "no_fov.txt", "--fov", 180, "--size", "32x16", "-o", tmp_path / "k.exr", folder / "grey.png", code=None)
    # OCamCalib's of a Theta: 3456 x 3456, so a picture of another aspect is told so, and one of its own is read
    r = run("fishremap", "--lens", folder / "calib_results.txt", "--fov", 190, "--size", "32x16", "-o", tmp_path / "o.exr", folder / "grey.png", code=1)
    one_line_error(r, "fishremap", "3456 x 3456")
    U.write_exr(tmp_path / "in.exr", np.full((432, 432, 3), .5))
    run("fishremap", "--lens", folder / "calib_results.txt", "--fov", 190, "--size", "32x16", "-o", tmp_path / "o.exr", tmp_path / "in.exr")


def test_the_theta_z1(tmp_path):
    """A published calibration of both lenses: angles to .05 degrees of cv::fisheye's equations, fx and fy both."""
    folder = shared_data("theta_z1_fisheye_calibration")
    for side in ("left", "right"):
        k, dist = np.loadtxt(folder / f"theta_{side}_K.txt"), np.loadtxt(folder / f"theta_{side}_dist_coeffs.txt")
        (tmp_path / "z1.txt").write_text(f"kannala-brandt {' '.join(map(str, dist))}\ncamera {k[0, 0]} {k[1, 1]} {k[0, 2]} {k[1, 2]}\nsize 3648 3648\n")
        s = 8    # an eighth of the size
        centre = ((k[0, 2] + .5) / s - .5, (k[1, 2] + .5) / s - .5)
        image = (1 + directions(lambda t: kb(t, dist), 3, [[k[0, 0] / s, 0], [0, k[1, 1] / s]], centre, 456, 456)[0]) / 2
        got, d, sure, _ = seen_directions(tmp_path, image, "--lens", tmp_path / "z1.txt", "--fov", 190)
        assert np.degrees(np.median(np.linalg.norm(got - d, axis=-1)[sure])) < .05
