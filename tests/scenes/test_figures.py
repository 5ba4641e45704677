"""What the figures are made with: generators, the array's camera, one probe, the profile spotlight, the shift between pictures,
and the whole chain of figures 10 and 11 at a thumbnail's size."""
import os
import sys

import numpy as np
import pytest

from common_util import rgbe_of, write_hdr
from conftest import TOP, environment, run
from ilf_util import Lamp, random_ilf, write_ilf
from process import execute

SCENES = TOP / "scenes"
sys.path.insert(0, str(SCENES))
sys.path.insert(0, str(SCENES / "models"))

import branch  # noqa: E402
import camera  # noqa: E402
import pictures  # noqa: E402
import plots  # noqa: E402
import shift  # noqa: E402


def script(name, *args, code=0):
    p = execute([sys.executable, str(SCENES / name), *map(str, args)], capture_output=True, text=True)
    assert p.returncode == code, p.stderr
    return p


# ---- the branch ------------------------------------------------------------------------------------------------
def area(verts, tris):
    p = verts[tris]
    return 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum()


def test_leaf_is_as_wide_as_its_formula():
    """A flat leaf's area is twice the integral of w(t) = w_max sin(pi t^0.8), here on 20,000 steps."""
    verts, tris = branch.leaf((0, 0, 0), (0.1, 0, 0), np.array([0, 0, 1.0]), 0.05, 0.0, steps=400)
    t = (np.arange(20000) + 0.5) / 20000
    flat = 0.1 * 0.05 * np.sin(np.pi * t ** 0.8).mean()
    droop = np.sqrt(1 + (2 * 0.06 * t) ** 2) @ np.sin(np.pi * t ** 0.8) / np.sin(np.pi * t ** 0.8).sum()
    assert area(verts, tris) == pytest.approx(flat * droop, rel=1e-3)
    assert np.ptp(verts[:, 1]) == pytest.approx(0.05, rel=1e-3)


def test_tube_is_a_tube():
    verts, tris = branch.tube([(0, 0, 0), (0, 0, 1), (0, 0, 2)], [0.1, 0.1, 0.1], sides=64)
    assert np.hypot(verts[:, 0], verts[:, 1]) == pytest.approx(np.full(len(verts), 0.1))
    assert area(verts, tris) == pytest.approx(2 * np.pi * 0.1 * 2, rel=2e-3)


def test_branch_is_its_seed(tmp_path):
    first, again, other = (branch.branch(0.6, 0.1, s) for s in (2, 2, 3))
    assert np.array_equal(first[0], again[0]) and np.array_equal(first[1], again[1])
    assert first[0].shape != other[0].shape or not np.allclose(first[0], other[0])
    verts, tris = first
    assert np.isfinite(verts).all() and tris.min() == 0 and tris.max() < len(verts)
    assert 0.5 < np.ptp(verts[:, 0]) < 1.1 and 0.3 < np.ptp(verts[:, 1]) < 0.9 and np.ptp(verts[:, 2]) < 0.3
    script("models/branch.py", "--seed", 2, "--leaf", 0.1, "-o", tmp_path / "a.obj")
    lines = (tmp_path / "a.obj").read_text().splitlines()
    assert sum(x.startswith("f ") for x in lines) == len(tris) and sum(x.startswith("v ") for x in lines) == len(verts)
    assert "leaf" in script("models/branch.py", "--leaf", 2, "-o", tmp_path / "b.obj", code=2).stderr
    assert not (tmp_path / "b.obj").exists()


# ---- the array's camera -------------------------------------------------------------------------------------------
def srgb_inverse(code):
    v = np.asarray(code, float) / 255
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def test_codes_have_the_mean_and_spread_of_electrons():
    """A grey card of radiance 4 at 1/16 s: mean F/4 electrons, variance F/4 + E^2, and what rounding adds."""
    rng = np.random.default_rng(1)
    code = camera.develop(np.full((200, 200, 3), 4.0), 1 / 16, 1.0, 20000.0, 30.0, rng)
    x = srgb_inverse(code)
    n = x.size
    slope = 0.25 ** (1 - 1 / 2.4) * 2.4 / 1.055 / 255          # d(linear)/d(code), nearly: (v)^2.4 about 0.25
    sigma = np.sqrt((5000 + 900) / 20000.0 ** 2 + slope ** 2 / 12)
    assert x.mean() == pytest.approx(0.25, abs=5 * sigma / np.sqrt(n) + 0.05 * slope)
    assert x.std() == pytest.approx(sigma, rel=0.1)


def test_saturated_and_black():
    rng = np.random.default_rng(1)
    code = camera.develop(np.array([[[0.0, 1.0, 1e9]]] * 50), 1.0, 1.0, 20000.0, 8.0, rng)
    dark = 255 * 12.92 * 5 * 8 / 20000 + 0.5                  # five sigma of the read noise on the curve's straight foot
    full = 255 * (1.055 * (1 - 5 / np.sqrt(20000)) ** (1 / 2.4) - 0.055) - 0.5
    assert (code[..., 2] == 255).all() and (code[..., 0] <= dark).all() and (code[..., 1] >= full).all()


def test_exposures_merge_to_the_picture(tmp_path):
    """Four decades through camera and hdrgen come back: the noise that is left is the electrons'."""
    ramp = np.repeat(np.logspace(-1.5, 2.5, 120)[None, :, None], 40, 0) * [1.0, 0.7, 0.4]
    write_hdr(tmp_path / "a.hdr", rgbe_of(ramp), line=bytes)
    script("camera.py", *(w for k in (-9, -6, -3, 0) for w in ("--seconds", f"1/{2 ** -k}")), "-o", tmp_path / "e", tmp_path / "a.hdr")
    run("hdrgen", "--quiet", "--response", "srgb", "--times", tmp_path / "e/times.txt", "-o", tmp_path / "m.exr",
        *sorted((tmp_path / "e").glob("*.png")))
    given, merged = pictures.read(tmp_path / "a.hdr"), pictures.read(tmp_path / "m.exr")
    assert merged.mean(0) == pytest.approx(given.mean(0), rel=0.02, abs=1e-3)
    assert np.abs(merged / given - 1)[:, 60:].max() < 0.1
    first = [p.read_bytes() for p in sorted((tmp_path / "e").iterdir())]
    script("camera.py", *(w for k in (-9, -6, -3, 0) for w in ("--seconds", f"1/{2 ** -k}")), "-o", tmp_path / "f", tmp_path / "a.hdr")
    assert first == [p.read_bytes() for p in sorted((tmp_path / "f").iterdir())]


def test_camera_refuses(tmp_path):
    (tmp_path / "bad.hdr").write_bytes(b"hello")
    e = script("camera.py", "--seconds", 1, "-o", tmp_path / "e", tmp_path / "bad.hdr", code=1)
    assert e.stderr.count("\n") == 1 and "bad.hdr: expected" in e.stderr and not (tmp_path / "e").exists()
    assert "seconds" in script("camera.py", "--seconds", "1/0", "-o", tmp_path / "e", tmp_path / "bad.hdr", code=2).stderr


# ---- one probe of a field -------------------------------------------------------------------------------------------
def test_one_probe(tmp_path):
    import OpenEXR
    rng = np.random.default_rng(4)
    probes = rng.uniform(0, 3, (6, 4, 8, 3)).astype("float32")
    for k, p in enumerate(probes):
        with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, {"RGB": p}) as f:
            f.write(str(tmp_path / f"p{k}.exr"))
    run("ilfpack", "--grid", "3x2", "--plane", "0 0 0 1 0 0 0 1 0", "--type", "float", "--polar-valid", 79.64, "-o", tmp_path / "a.ilf.exr",
        *(tmp_path / f"p{k}.exr" for k in range(6)))
    script("oneprobe.py", "--node", "2_1", "-o", tmp_path / "one.exr", tmp_path / "a.ilf.exr")
    assert np.array_equal(pictures.read(tmp_path / "one.exr"), probes[5])
    run("ilfpack", "--grid", "1x1", "--plane", "0 0 0 1 0 0 0 1 0", "-o", tmp_path / "one.ilf.exr", tmp_path / "one.exr")
    with OpenEXR.File(str(tmp_path / "one.ilf.exr")) as f:
        assert f.parts[0].header["ilf:polarValid"] == pytest.approx(np.radians(79.64), rel=1e-5)
    lit = random_ilf(np.random.default_rng(1), 2, 1, 8, 4)
    lit.lamps = [Lamp("sphere", (0, 0, 2), (1, 1, 1), radius=.1)]
    e = script("oneprobe.py", "--node", "0_0", "-o", tmp_path / "no.exr", write_ilf(tmp_path / "lit.ilf.exr", lit), code=1)
    assert "ilf:version: expected 1, found 2" in e.stderr and not (tmp_path / "no.exr").exists()
    e = script("oneprobe.py", "--node", "3_0", "-o", tmp_path / "no.exr", tmp_path / "a.ilf.exr", code=1)
    assert "expected a node of 3 x 2" in e.stderr and not (tmp_path / "no.exr").exists()


# ---- rooms ------------------------------------------------------------------------------------------------------------
def scene_environment():
    env = environment()
    env["RAYPATH"] += ":" + ":".join(str(SCENES / d) for d in ("figure10", "figure11", "figure12", "studio", "demo"))
    return env


def rays(octree, points, aims, *options):
    text = "".join("%.9g %.9g %.9g %.9g %.9g %.9g\n" % (*p, *(np.subtract(q, p))) for p, q in zip(points, aims))
    out = run("rtrace", "-h", "-ab", 0, *options, octree, stdin=text, env=scene_environment()).text
    return np.array([[float(x) for x in line.split()] for line in out.splitlines() if line.strip()])


def oconv(path, *files, text=""):
    path.write_bytes(run("oconv", "-f", *(["-"] if text else []), *files, stdin=text, env=scene_environment()).out)
    return path


def test_profile_spotlight_images_its_aperture(tmp_path):
    """Where the ray towards any place of the lens comes from decides: full within one radius in the plane of focus, dark beyond the other."""
    text = """void brightfunc pool_pattern
2 pool profile.cal
0
3 2 .10 .14
pool_pattern light glass 0 0 3 7 5 3
glass ring lens 0 0 8  0 0 0  0 0 -1  0 .3
"""
    octree = oconv(tmp_path / "a.oct", text=text)
    rng = np.random.default_rng(7)
    turn, radius = rng.uniform(0, 2 * np.pi, (2, 300)), rng.uniform(0, 0.25, 300)
    on_plane = np.stack([radius * np.cos(turn[0]), radius * np.sin(turn[0]), np.full(300, -2.0)], -1)
    on_lens = np.stack([0.29 * np.cos(turn[1]), 0.29 * np.sin(turn[1]), np.zeros(300)], -1)
    t = np.clip((0.14 - radius) / 0.04, 0, 1)
    expected = (t * t * (3 - 2 * t))[:, None] * [7, 5, 3]
    assert rays(octree, on_plane, on_lens) == pytest.approx(expected, abs=2e-3)
    # seen from below the plane of focus the same ray has the same radiance
    assert rays(octree, on_plane - 0.5 * (on_lens - on_plane), on_lens) == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("figure, lamps, aim", [
    ("figure10", {"warm": (-.72, -.42, 1.30), "cool": (.66, .30, 1.42)}, (0, 0, -.01905)),
    ("figure11", {"yellow": (-.70, -.50, 1.55)}, (0, 0, 0))])
def test_spotlights_aim_at_the_centre(tmp_path, figure, lamps, aim):
    """From the table's middle each lens shines fully from its whole face; from 30 cm beside it not at all."""
    octree = oconv(tmp_path / "a.oct", SCENES / "demo/room_materials.rad", SCENES / figure / "lamps.rad")
    for place in lamps.values():
        full = rays(octree, [aim], [place], "-w")[0]
        assert full.max() > 1000
        # four places of the lens, 4 cm from its middle
        side = np.cross(np.subtract(place, aim), [0, 0, 1.0])
        side /= np.linalg.norm(side)
        up = np.cross(side, np.subtract(place, aim))
        up /= np.linalg.norm(up)
        spread = [np.add(place, 0.04 * d) for d in (side, -side, up, -up)]
        assert rays(octree, [aim] * 4, spread, "-w") == pytest.approx(np.tile(full, (4, 1)), rel=1e-3)
        away = [np.add(aim, (0.3 * np.cos(a), 0.3 * np.sin(a), 0)) for a in range(6)]
        assert (rays(octree, away, [place] * 6, "-w") == 0).all()


def test_sphere_array_stands_as_said():
    """144 spheres of one inch that touch, on the table; the plane lies at their focus."""
    where = SCENES / "figure10"
    out = run("xform", "-e", "spheres.rad", cwd=where, env=None).text
    q = np.array([[float(x) for x in line.split()] for line in out.splitlines() if len(line.split()) == 5 and line.split()[0] == "4"])[:, 1:]
    assert q.shape == (144, 4) and (q[:, 3] == 0.0127).all()
    gaps = np.linalg.norm(q[:, None, :3] - q[None, :, :3], axis=-1) + np.eye(144)
    assert gaps.min() == pytest.approx(0.0254, rel=1e-6)
    table = [float(line.split()[-1]) for line in (where / "table.rad").read_text().splitlines() if "polygon" in line][0]
    assert (q[:, 2] - 0.0127).min() == pytest.approx(table, abs=1e-9)
    # rays from above, reflected and traced back: they pass the axis about r/2 above the centre (z = 0)
    r, theta = 0.0127, np.radians(np.linspace(2, 40, 20))
    crossing = q[0, 2] + r * np.cos(theta / 2) - r * np.sin(theta / 2) / np.tan(theta)
    assert np.abs(crossing).max() < 0.05 * r
    corner = sorted(map(tuple, np.round(q[:, :2], 6)))[0]
    assert corner == (-.1397, -.1397)


# ---- shift and plots -----------------------------------------------------------------------------------------------------
def field(x, y):
    return 2 + np.sin(x / 7) * np.cos(y / 9 + 1) + 0.5 * np.exp(-((x - 40) ** 2 + (y - 30) ** 2) / 60)


def test_shift_is_found_beside_softness_and_gain():
    y, x = np.mgrid[0:80, 0:110].astype(float)
    where = np.ones(x.shape, bool)
    where[20:40, 50:70] = False
    b = field(x, y)
    soft = sum(field(x - 0.3 + i, y + 0.2 + j) for i in (-1, 0, 1) for j in (-1, 0, 1)) / 9       # lies 0.3 right, 0.2 up
    noise = np.random.default_rng(2).normal(0, 0.01, x.shape)
    d, sd = shift.shift(1.1 * soft + noise, b, where)
    assert d == pytest.approx([1.1 * 0.3, 1.1 * -0.2], abs=0.03) and (sd < 0.03).all() and (sd > 0).all()
    assert shift.shift(b, b, where)[0] == pytest.approx([0, 0], abs=1e-12)


def test_times_of_a_strip(tmp_path):
    (tmp_path / "times.txt").write_text("# a comment\nb.png 2\na.png 1/16384\n")
    assert plots.exposures(str(tmp_path / "times.txt")) == [(1 / 16384, str(tmp_path / "a.png")), (2.0, str(tmp_path / "b.png"))]
    assert [plots.time_label(t) for t in (1 / 16384, 0.5, 2)] == ["1/16384 s", "1/2 s", "2 s"]
    (tmp_path / "none.txt").write_text("# nothing\n")
    e = script("plots.py", "strip", "--times", tmp_path / "none.txt", "-o", tmp_path / "o.png", code=1)
    assert e.stderr.count("\n") == 1 and "none.txt: expected" in e.stderr and not (tmp_path / "o.png").exists()


def test_falloff_file_of_our_own_is_read(tmp_path):
    (tmp_path / "f.txt").write_text("# readings end at 90\n# reading   10.0 deg  0.9 0.8 0.7\n0 2 4 8 0 0 0\n90 1 1 1 0 0 0\n")
    angle, value = plots.curve(str(tmp_path / "f.txt"))
    assert list(angle) == [0, 90] and value.tolist() == [[1, 1, 1], [0.5, 0.25, 0.125]]
    at, read = plots.readings(str(tmp_path / "f.txt"))
    assert list(at) == [10] and read.tolist() == [[0.9, 0.8, 0.7]]


# ---- the whole chain, thumbnail ---------------------------------------------------------------------------------------------
THUMBNAIL = ["figure11_NU=3", "figure11_NV=3", "figure11_TIMES=1/16384 1/512 1/16 2", "figure11_PROBE=256x128", "figure11_SINGLE=0_1",
             "figure11_CAMERA=--size 256 --supersample 2 --refine 8 --bits 8 --full-scale 1", "figure11_CORRECT=scenes/demo/lens_falloff.txt",
             "figure11_LIGHT=-ab 0 -av .05 .05 .05 -ds .2 -w", "figure11_RES=-x 64 -y 48", "figure11_LIGHT_photo=-ab 0 -ds .1"]


def lamp_error(probe, node, lamp):
    """How far the lamp's centre of light in the probe lies from where it is, (theta, phi), in texels (which are smaller than the lamp: a
    texel is a mean, so it does not say where in it a point is)."""
    h, w = probe.shape
    to = np.subtract(lamp, node)
    to = to / np.linalg.norm(to)
    y, x = np.mgrid[0:h, 0:w] + 0.5
    theta, phi = -np.pi + x * 2 * np.pi / w, y * np.pi / 2 / h
    d = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], -1)
    near = d @ to > np.cos(np.radians(4))
    c = (d * (np.where(near, probe - np.median(probe[near]), 0) * np.sin(phi))[..., None]).sum((0, 1))
    c /= np.linalg.norm(c)
    return [(np.arctan2(c[1], c[0]) - np.arctan2(to[1], to[0])) / (2 * np.pi / w), (np.arccos(c[2]) - np.arccos(to[2])) / (np.pi / 2 / h)]


def test_figure_11_as_a_thumbnail(tmp_path):
    """At a node the light field has the light of the room: the irradiance there is the room's own, the blue lamp is seen where it
    stands.  A second make makes nothing."""
    fig = os.path.relpath(tmp_path, TOP)
    out = tmp_path / "figure11"
    goals = ("room.ilf.exr", "single.ilf.exr", "photo.oct", "with_room.oct", "with_single.oct", "photo.hdr", "mask.hdr")
    env = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}

    def make():
        p = execute(["make", "--no-print-directory", f"FIG={fig}", *THUMBNAIL, *(f"{fig}/figure11/{f}" for f in goals)], cwd=TOP,
                    env=env, capture_output=True, text=True)
        assert p.returncode == 0, p.stdout + p.stderr
    make()
    assert (out / "photo.json").stat().st_size > 0
    # the blue lamp stands where it stands: a half-texel offset anywhere would be 0.5 here
    errors = [lamp_error(pictures.read(out / f"nodes/0_{j}/probe.exr")[..., 2], (-.381, -.381 + .381 * j, 0), (.90, .15, 1.30)) for j in range(3)]
    assert np.abs(np.mean(errors, 0)).max() < 0.15, errors
    # irradiance at two nodes, in the room itself and in its light field: the yellow spotlight, the blue lamp
    scene = run("xform", "-m", "room_light", SCENES / "demo/room.rad", SCENES / "figure11/lamps.rad", env=scene_environment()).text
    inside = oconv(tmp_path / "inside.oct", text=f"void ilf room_light\n1 {out}/room.ilf.exr\n0\n0\n" + (SCENES / "demo/room_materials.rad").read_text() + scene)
    ask = "0 0 0 0 0 1\n-.381 0 0 0 0 1\n"
    found = {}
    for name, octree, options in (("room", out / "stage.oct", ("-ds", .02, "-av", .05, .05, .05)), ("field", inside, ("-di", 256))):
        text = run("rtrace", "-h", "-w", "-I", "-ab", 1, "-aa", 0, "-ad", 2048, *options, octree, stdin=ask, env=scene_environment()).text
        found[name] = np.array([[float(v) for v in line.split()] for line in text.splitlines() if line.strip()])
    # The lamps are some 6 and 24 pixels of the camera: their outlines cost 1 %, the shortest exposure's electrons 1 %, its 8 bits 1 %, the
    # samples of the renderings 1 to 2 %.
    assert found["field"] == pytest.approx(found["room"], rel=0.05)
    stamps = {p: p.stat().st_mtime_ns for p in out.rglob("*") if p.is_file()}
    make()
    assert stamps == {p: p.stat().st_mtime_ns for p in out.rglob("*") if p.is_file()}
