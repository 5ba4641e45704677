"""virtualcamera against what can be worked out by hand, and against rpict."""
import math
import shutil
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from conftest import environment, run
from stage_util import script

RTRACE = shutil.which("rtrace", path=environment()["PATH"])
PLANE = "0 0 0 1 0 0 0 1 0"
BLACK = "void plastic black\n0\n0\n5 0 0 0 0 0\nblack bubble room\n0\n0\n4 0 0 0 9\n"


def lamp(x, y, z, radius, radiance, name="lamp"):
    return (f"void light {name}_l\n0\n0\n3 {' '.join(map(str, radiance))}\n"
            f"{name}_l sphere {name}\n0\n0\n4 {x} {y} {z} {radius}\n")


def octree(folder, scene, name="scene"):
    (folder / f"{name}.rad").write_text(scene)
    (folder / f"{name}.oct").write_bytes(run("oconv", "-f", folder / f"{name}.rad").out)
    return folder / f"{name}.oct"


def dome(folder, r=1.0, g=1.0, b=1.0):
    """The same radiance from everywhere."""
    return octree(folder, f"void glow g\n0\n0\n4 {r} {g} {b} 0\ng bubble sky\n0\n0\n4 0 0 0 9\n", "dome")


def camera(tree, out, *args, **kw):
    place = [] if "--at" in args or "--node" in args else ["--at", "0,0"]
    plane = [] if "--plane" in args else ["--plane", PLANE]
    return run("virtualcamera", "--octree", tree, *plane, *place, "-o", out, *args, **kw)


def read_ppm(path):
    """Codes and highest code of a P6 file."""
    data = Path(path).read_bytes()
    fields, at = [], 2
    while len(fields) < 3:
        line_end = data.index(b"\n", at)
        line = data[at:line_end]
        at = line_end + 1
        fields += [] if line.startswith(b"#") else list(map(int, line.split()))
    w, h, top = fields
    return np.frombuffer(data, ">u2" if top > 255 else "u1", offset=at).reshape(h, w, 3).astype(int), top


def read_map(path):
    """A portable float map as (h, w, 3), top row first."""
    with open(path, "rb") as f:
        assert f.readline() == b"PF\n"
        w, h = map(int, f.readline().split())
        assert float(f.readline()) == -1
        return np.frombuffer(f.read(), "<f4").reshape(h, w, 3)[::-1].astype(float)


def radiance(tree, folder, *args):
    """What the camera sees, from its cache."""
    cache = folder / f"cache{len(list(folder.iterdir()))}"
    camera(tree, folder / "any.ppm", "--seconds", 1, "--cache", cache, *args)
    (entry,) = cache.iterdir()
    return read_map(entry)


def circle(n, share=1.0):
    y, x = np.mgrid[0:n, 0:n] + 0.5
    return np.hypot(x - n / 2, y - n / 2) <= share * n / 2


# ---- development --------------------------------------------------------------------------------------------

def srgb(x):
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


@pytest.mark.parametrize("response, curve", [("linear", lambda x: x), ("srgb", srgb), ("gamma:2.2", lambda x: x ** (1 / 2.2))])
@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_codes_of_a_constant_scene(tmp_path, response, curve, bits):
    tree = dome(tmp_path, 1, 0.5, 0.01)
    camera(tree, tmp_path / "a.ppm", "--seconds", "1/5", "--full-scale", 0.3, "--no-noise", "--response", response, "--bits", bits, "--size", 64)
    code, top = read_ppm(tmp_path / "a.ppm")
    want = np.floor((2 ** bits - 1) * curve(np.array([1, 0.5, 0.01]) / 5 / 0.3) + 0.5)
    assert top == 2 ** bits - 1
    assert (np.abs(code[circle(64, 0.95)] - want) <= (1 if bits > 12 else 0)).all()
    assert not code[~circle(64, 1.03)].any()


def test_clips_at_full_scale(tmp_path):
    tree = dome(tmp_path, 4, 1.001, 0.999)
    camera(tree, tmp_path / "a.ppm", "--seconds", 1, "--no-noise", "--size", 32, "--bits", 16)
    code, top = read_ppm(tmp_path / "a.ppm")
    assert tuple(code[16, 16]) == (top, top, round(0.999 * top))


def test_falloff_by_angle_and_channel(tmp_path):
    tree = dome(tmp_path)
    (tmp_path / "falloff").write_text("# degrees R G B\n0 1 1 1\n45 .9 .8 .7\n92.5 .5 .4 .3\n")
    n = 200
    camera(tree, tmp_path / "a.ppm", "--seconds", 1, "--no-noise", "--size", n, "--bits", 16, "--falloff", tmp_path / "falloff")
    code, top = read_ppm(tmp_path / "a.ppm")
    for x in (100, 130, 160, 190):
        degrees = math.hypot(x + 0.5 - n / 2, 0.5) / (n / 2) * 92.5
        for c, points in enumerate([(1, .9, .5), (1, .8, .4), (1, .7, .3)]):
            assert code[100, x, c] == pytest.approx(top * np.interp(degrees, [0, 45, 92.5], points), abs=2)


def test_noise_has_the_stated_mean_and_variance(tmp_path):
    """Poisson of F H plus read noise: mean and variance in electrons of 20,000 pixels at four levels, each within five of
    their own standard errors (a chance of 1 in 200,000 that a right program fails)."""
    tree = dome(tmp_path)
    full, read = 3000.0, 7.0
    for h in (0.003, 0.03, 0.2, 0.6):
        camera(tree, tmp_path / "a.ppm", "--seconds", h, "--electrons", full, "--read-noise", read, "--size", 180, "--bits", 16, "--seed", 5)
        code, top = read_ppm(tmp_path / "a.ppm")
        q = code[circle(180, 0.95)][:, :].ravel() / top * full
        mean, var = h * full, h * full + read ** 2
        kurtosis_term = var * math.sqrt(2 / q.size) * 1.2
        if mean > 5 * math.sqrt(var):       # else clipping at zero shifts both
            assert abs(q.mean() - mean) < 5 * math.sqrt(var / q.size) + full / top
            assert abs(q.var() - var) < 5 * kurtosis_term
        else:
            g = np.random.default_rng(1)
            ref = np.clip(g.poisson(mean, 400000) + read * g.standard_normal(400000), 0, None)
            assert abs(q.mean() - ref.mean()) < 6 * math.sqrt(ref.var() / q.size) and abs(q.var() / ref.var() - 1) < 0.06


def test_noise_is_the_same_for_the_same_seed_place_and_time_only(tmp_path):
    tree = dome(tmp_path)

    def take(*args):
        camera(tree, tmp_path / "n.ppm", "--size", 48, "--supersample", 1, *args)
        return read_ppm(tmp_path / "n.ppm")[0].tobytes()
    base = take("--seconds", "0.1", "--seed", 1)
    assert take("--seconds", "0.1", "--seed", 1) == base
    assert take("--seconds", "0.1", "--seed", 1, "--threads", 2) == base
    assert len({base, take("--seconds", "0.1", "--seed", 2), take("--seconds", "0.11", "--seed", 1), take("--seconds", "0.1", "--seed", 1, "--at", "0,0.1")}) == 4


def test_response_from_a_file_of_hdrgen(tmp_path):
    tree = dome(tmp_path, 0.09, 0.25, 0.64)
    lines = "".join(f"{z} {(z / 255) ** 2} {(z / 255) ** 2} {(z / 255) ** 2}\n" for z in range(256))
    (tmp_path / "r.txt").write_text("hdrgen-response 1\nchannels 3\nmax_code 255\n" + lines)
    camera(tree, tmp_path / "a.ppm", "--seconds", 1, "--no-noise", "--size", 16, "--response", tmp_path / "r.txt")
    assert np.abs(read_ppm(tmp_path / "a.ppm")[0][8, 8] - np.array([.3, .5, .8]) * 255).max() <= 1


def test_png_8_and_16_bit(tmp_path):
    """The same codes as in the PPM; 10 bits stretched over 16 with the depth in sBIT."""
    tree = dome(tmp_path, .7, .2, .05)
    for bits, depth in ((8, 8), (10, 16)):
        for ending in ("ppm", "png"):
            camera(tree, tmp_path / f"a.{ending}", "--seconds", 1, "--size", 24, "--bits", bits)
        data = (tmp_path / "a.png").read_bytes()
        chunks, at = {}, 8
        while at < len(data):
            size, kind = struct.unpack(">I4s", data[at:at + 8])
            chunks[kind] = data[at + 8:at + 8 + size]
            at += 12 + size
        assert chunks[b"IHDR"][8:10] == bytes([depth, 2]) and chunks[b"sBIT"] == bytes([bits] * 3)
        from PIL import Image   # PIL reads 16-bit RGB as 8: take our own reading of the rows
        raw = zlib.decompress(chunks[b"IDAT"])
        assert len(raw) == 24 * (1 + 24 * 3 * depth // 8) and Image.open(tmp_path / "a.png").size == (24, 24)
        code, top = read_ppm(tmp_path / "a.ppm")
        if depth == 8:
            assert np.array_equal(np.asarray(Image.open(tmp_path / "a.png")), code)
        else:
            high = np.asarray(Image.open(tmp_path / "a.png")).astype(int)
            assert np.abs(high - np.round(code * 65535 / top) // 256).max() <= 1


# ---- what it sees ----------------------------------------------------------------------------------------------

def solid_angle(n, fov=185):
    """Of each pixel of an equidistant fisheye: sin(theta)/theta (dtheta per pixel)^2."""
    y, x = np.mgrid[0:n, 0:n] + 0.5
    theta = np.hypot(x - n / 2, y - n / 2) / (n / 2) * math.radians(fov / 2)
    return np.sinc(theta / math.pi) * (math.radians(fov) / n) ** 2


@pytest.mark.parametrize("at", [(0, 0.5), (0.1, 0.2), (0.77, 0.31), (-2, 1)])
def test_energy_of_a_small_lamp(tmp_path, at):
    """2 degrees wide: radiance times solid angle to 0.4 % at 256 pixels, where a pixel is 0.7 degrees."""
    tree = octree(tmp_path, BLACK + lamp(0, 0, 2, 0.035, (1000, 500, 100)))
    seen = radiance(tree, tmp_path, "--size", 256, "--at", f"{at[0]},{at[1]}")
    d = math.sqrt(at[0] ** 2 + at[1] ** 2 + 4)
    want = 2 * math.pi * (1 - math.sqrt(1 - (0.035 / d) ** 2))
    got = (seen * solid_angle(256)[..., None]).sum((0, 1)) / (1000, 500, 100)
    assert np.abs(got / want - 1).max() < 0.004, got / want - 1


@pytest.mark.parametrize("lens, rho", [("equidistant", lambda t, h: t / h), ("equisolid", lambda t, h: math.sin(t / 2) / math.sin(h / 2)),
                                       ("stereographic", lambda t, h: math.tan(t / 2) / math.tan(h / 2)),
                                       ("orthographic", lambda t, h: math.sin(t) / math.sin(h))])
def test_where_a_lamp_stands_in_the_picture(tmp_path, lens, rho):
    """A tilted plane: +v up, +u to the left, the lens map as published."""
    u, v = np.array([0.6, 0.8, 0]), np.array([-0.8, 0.6, 0])
    n = np.cross(u, v)
    o = np.array([5.0, -3.0, 2.0])
    fov = 170
    for theta, phi in ((30, 20), (60, 200), (80, 110)):
        t, p = math.radians(theta), math.radians(phi)
        d = math.sin(t) * math.cos(p) * u + math.sin(t) * math.sin(p) * v + math.cos(t) * n
        x, y, z = o + 2 * u + 1 * v + 3 * d     # node (1,1) of 3 x 3: U = 4 u, V = 2 v
        tree = octree(tmp_path, lamp(x, y, z, 0.05, (1, 1, 1)))
        plane = " ".join(map(repr, map(float, [*o, *(4 * u), *(2 * v)])))
        seen = radiance(tree, tmp_path, "--size", 200, "--lens", lens, "--fov", fov, "--plane", plane, "--grid", "3x3", "--node", "1,1")[..., 0]
        yy, xx = np.mgrid[0:200, 0:200] + 0.5
        cx, cy = (seen * xx).sum() / seen.sum(), (seen * yy).sum() / seen.sum()
        r = 100 * rho(t, math.radians(fov / 2))
        assert (cx, cy) == pytest.approx((100 - r * math.cos(p), 100 - r * math.sin(p)), abs=0.35)


def test_same_picture_as_rpict(tmp_path):
    """The host's own angular fisheye of a lit room, averaged over 8 x 8 rays a pixel; RGBE's steps are 1/256."""
    scene = ("void plastic w\n0\n0\n5 .5 .4 .3 0 0\n!genbox w box 4 3 2.5 -i | xform -t -2 -1.5 -.5\n" +
             lamp(0.5, 0.3, 1.5, 0.1, (30, 20, 10)) + "w sphere ball\n0\n0\n4 -.7 .4 .6 .3\n")
    tree = octree(tmp_path, scene)
    n = 64
    seen = radiance(tree, tmp_path, "--size", n, "--render-options", "-ab 0 -av .01 .01 .01 -dj 0", "--supersample", 8, "--refine", 0)
    view = "-vta -vp 0 0 0 -vd 0 0 1 -vu 0 1 0 -vh 185 -vv 185".split()
    hdr = run("rpict", *view, "-x", 8 * n, "-y", 8 * n, "-ps", 1, "-pj", 0, "-ab", 0, "-av", .01, .01, .01, "-dj", 0, tree).out
    text = run("pvalue", "-h", "-H", "-d", stdin=hdr).text
    big = np.array([list(map(float, s.split())) for s in text.splitlines()]).reshape(8 * n, 8 * n, 3)
    want = big.reshape(n, 8, n, 8, 3).mean((1, 3))
    inside = circle(n, 0.96)
    assert want[inside].min() > 0
    error = np.abs(seen - want)[inside]
    assert np.median(error / want[inside]) < 0.005
    # the lamp's energy has a test of its own: here no pixel of which a ray may meet it, and no neighbour of one
    bright = np.pad(big.reshape(n, 8, n, 8, 3).max((1, 3, 4)) > 1, 1)
    near = sum(bright[a:a + n, b:b + n] for a in range(3) for b in range(3)) > 0
    walls = inside & ~near
    assert np.abs(seen[walls].mean(0) / want[walls].mean(0) - 1).max() < 0.004


def test_beyond_the_horizon(tmp_path):
    """185 degrees: a lamp 1.5 degrees below the plane is seen, one 4 degrees below is not."""
    for below, there in ((1.5, True), (4, False)):
        t = math.radians(90 + below)
        tree = octree(tmp_path, lamp(2 * math.sin(t), 0, 2 * math.cos(t), 0.02, (1, 1, 1)))
        assert (radiance(tree, tmp_path, "--size", 128).sum() > 0) == there


def test_exr_and_hdr_are_the_radiance_itself(tmp_path):
    tree = dome(tmp_path, 1234.5, 0.25, 3e-4)
    camera(tree, tmp_path / "a.exr", "--size", 16)
    import OpenEXR
    with OpenEXR.File(str(tmp_path / "a.exr")) as f:
        pixel = f.channels()["RGB"].pixels[8, 8]
    assert pixel == pytest.approx((1234.5, 0.25, 3e-4), rel=1e-6)


# ---- cache -------------------------------------------------------------------------------------------------------

def test_rendered_once_per_place(tmp_path):
    tree = octree(tmp_path, BLACK + lamp(0, 0, 2, 0.1, (1, 1, 1)))
    count = script(tmp_path, f"#!/bin/sh\necho run >> {tmp_path}/runs\nexec {RTRACE} \"$@\"\n", "rtrace")

    def take(*args):
        camera(tree, tmp_path / "o.ppm", "--size", 32, "--refine", 0, "--cache", tmp_path / "cache", "--rtrace", count, *args)
        return len((tmp_path / "runs").read_text().splitlines())
    base = ["--seconds", 1]
    assert take(*base) == 1 and take("--seconds", 2) == 1 and take("--seconds", 1, "--bits", 10, "--no-noise") == 1
    assert take(*base, "--at", "0,0.1") == 2 and take(*base, "--size", 33) == 3 and take(*base, "--fov", 180) == 4
    assert take(*base, "--render-options", "-av 1 1 1") == 5 and take(*base, "--lens", "equisolid") == 6
    (tmp_path / "scene.rad").write_text(lamp(0, 0, 2, 0.2, (1, 1, 1)))
    tree.write_bytes(run("oconv", "-f", tmp_path / "scene.rad").out)
    assert take(*base) == 7
    newest = max((tmp_path / "cache").iterdir(), key=lambda p: p.stat().st_mtime_ns)
    whole = newest.read_bytes()
    newest.write_bytes(whole[:-5])          # damaged: made again
    assert take(*base) == 8 and newest.read_bytes() == whole and take(*base) == 8


def test_an_octree_that_names_its_files_counts_with_their_contents(tmp_path):
    (tmp_path / "a.rad").write_text(lamp(0, 0, 2, 0.1, (1, 1, 1)))
    (tmp_path / "t.oct").write_bytes(run("oconv", tmp_path / "a.rad").out)
    args = ["--seconds", 1, "--size", 32, "--cache", tmp_path / "c"]
    camera(tmp_path / "t.oct", tmp_path / "1.ppm", *args)
    (tmp_path / "a.rad").write_text(lamp(0, 0, 2, 0.1, (0.5, 1, 1)))
    camera(tmp_path / "t.oct", tmp_path / "2.ppm", *args)
    assert len(list((tmp_path / "c").iterdir())) == 2


# ---- refusals ------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("args, code, words", [
    (["--size", 1], 2, "2..8192"), (["--size", 100000], 2, "2..8192"), (["--fov", 0], 2, "field of view"), (["--fov", 400], 2, "field of view"),
    (["--lens", "orthographic", "--fov", 181], 2, "field of view"), (["--lens", "pinhole"], 2, "lens"), (["--bits", 17], 2, "1..16"),
    (["--seconds", 0], 2, "above 0"), (["--seconds", "soon"], 2, ""), (["--full-scale", 0], 2, "above 0"), (["--electrons", 0], 2, "electrons"),
    (["--read-noise", -1], 2, "electrons"), (["--response", "gamma:0"], 2, "gamma"), (["--response", "no-file"], 1, "no-file"),
    (["--falloff", "no-file"], 1, "no-file"), (["--at", "1"], 2, ""), (["--node", "3,0", "--grid", "3x3"], 2, "node: expected 0..2 along u"),
    (["--node", "0,0"], 2, "--grid"), (["--plane", "0 0 0 1 0 0 1 0 0"], 2, "right angles"), (["--plane", "0 0 0 1 0 0"], 2, ""),
    (["--render-options", "-fff"], 2, "light and sampling"), (["--render-options", "-i"], 2, "light and sampling"),
    (["--render-options", "-ab x"], 1, ""), (["--rtrace", "/no/rtrace"], 1, "/no/rtrace"), (["--cache", "/proc/nope"], 1, "/proc/nope"),
    (["-o", "a.gif"], 2, ".png"), (["--octree", "none.oct"], 1, "none.oct")])
def test_refusals_are_one_line_and_leave_nothing(tmp_path, args, code, words):
    tree = dome(tmp_path)
    full = ["--octree", tree, *([] if "--plane" in args else ["--plane", PLANE]),
            *([] if "--at" in args or "--node" in args else ["--at", "0,0"]), *([] if "--seconds" in args else ["--seconds", 1]),
            *([] if "-o" in args else ["-o", tmp_path / "out.png"]), "--size", 16, *args]
    r = run("virtualcamera", *full, code=code, cwd=tmp_path)
    lines = r.err.splitlines()
    assert len(lines) == 1 and lines[0].startswith("virtualcamera: ") and words in lines[0], r.err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["dome.oct", "dome.rad"]


@pytest.mark.parametrize("text, words", [("", "two points"), ("0 1\n", "two points"), ("0 1\n0 2\n", "above 0"), ("0 1\n50 -1\n", "above zero"),
                                         ("0 1 1\n", "x R G B"), ("zero one\n", "x R G B"), ("0 1\n90 nan\n", "x R G B")])
def test_bad_falloff_files(tmp_path, text, words):
    (tmp_path / "f").write_text(text)
    r = camera(dome(tmp_path), tmp_path / "a.png", "--seconds", 1, "--falloff", tmp_path / "f", code=1)
    assert words in r.err and not (tmp_path / "a.png").exists()
