"""Files with the names that the examples of README and man pages use, small enough that these end quickly.

make(folder) writes IMG_1.jpg ... IMG_5.jpg (EXIF times) and times.txt, fisheye.exr, flat.exr, source_00.exr ..., lens.txt,
panorama.hdr, dual.exr and its rig.txt, shots.txt, shot_0.exr ..., spheres.exr, left.exr, right.exr, probe.exr, probe_0.exr ..., room.ilf.exr, lamps.ilf.exr, rays.txt, room.rad, objects.rad,
surroundings.rad, view.vf, places.txt, session.conf, stage.toml, walk.txt.  `with stage(folder):` has a stage at the name port.
"""
import numpy as np

import exif_util
import fishremap_util as U
from conftest import run
from ilf_util import Lamp, Mask, random_ilf, write_ilf
from stage_util import Stage, session
from test_fishremap_array import photograph

FOV = 186.
ANGLES = (0, 13, 26, 39, 52, 65, 78, 88)
TIMES = (1 / 500, 1 / 125, 1 / 30, 1 / 8, 1 / 2)
ROOM = """void plastic paint 0 0 5 .6 .5 .4 0 0
void light bulb 0 0 3 90 80 60
paint polygon floor 0 0 12 -2 -2 -1  3 -2 -1  3 3 -1  -2 3 -1
paint polygon back 0 0 12 -2 3 -1  3 3 -1  3 3 2  -2 3 2
paint polygon left 0 0 12 -2 -2 -1  -2 3 -1  -2 3 2  -2 -2 2
paint polygon top 0 0 12 -2 -2 2  -2 3 2  3 3 2  3 -2 2
bulb sphere lamp 0 0 4 1 .5 1.6 .2
"""
OBJECTS = """void plastic clay 0 0 5 .7 .7 .7 0 0
clay sphere ball 0 0 4 .4 .4 .15 .15
clay polygon board 0 0 12 0 0 -.01  .75 0 -.01  .75 .75 -.01  0 .75 -.01
"""


def falloff(angle):
    """Of the lens that all these pictures are taken with."""
    return 1 - .4 * (angle / np.radians(FOV / 2)) ** 4


def field_angle(n):
    """Angle from the axis of each pixel of an equisolid picture of n x n pixels; nan outside of its circle."""
    y, x = (np.mgrid[0:n, 0:n] + .5) / (n / 2) - 1
    with np.errstate(invalid="ignore"):
        return 2 * np.arcsin(np.where(np.hypot(x, y) <= 1, np.hypot(x, y) * np.sin(np.radians(FOV / 4)), np.nan))


def fisheye(n=256):
    """A room of lobes and a lamp as such a lens shows it, dark outside of the circle."""
    lobes, lamp = U.lobes(count=8, sharpest=2), U.lamp(40, 30, 6., 20.)
    image = U.fisheye(lambda d: lobes(d) + lamp(d), n, FOV, "equisolid", samples=2, outside=0)
    return image * np.nan_to_num(falloff(field_angle(n)))[..., None]


def write_series(folder):
    """Five exposures through an sRGB-like curve, with noise of less than a code."""
    rng = np.random.default_rng(121)
    light = fisheye()
    lines = []
    for k, t in enumerate(TIMES):
        e = np.clip(light * t * 4 + rng.normal(0, 5e-4, light.shape), 0, 1)
        codes = np.round(255 * np.where(e <= .0031308, 12.92 * e, 1.055 * e ** (1 / 2.4) - .055))
        exif_util.save(folder / f"IMG_{k + 1}.jpg", codes, {33434: (5, [exif_util.rational(t)]), 33437: (5, [exif_util.rational(5.6)]), 34855: (3, [100])})
        lines.append(f"IMG_{k + 1}.jpg {t:.6g}\n")
    (folder / "times.txt").write_text("".join(lines))


def write_lens(folder, n=256):
    """Pictures for falloffcal: a diffuse source at known angles, a flat field; and the curve itself."""
    angle = field_angle(n)
    V = np.nan_to_num(falloff(angle))
    U.write_exr(folder / "flat.exr", np.repeat(V[..., None], 3, -1))
    y, x = (np.mgrid[0:n, 0:n] + .5) / (n / 2) - 1
    for deg in ANGLES:
        at = np.sin(np.radians(deg / 2)) / np.sin(np.radians(FOV / 4))
        near = np.hypot(x - at, y) < .06
        U.write_exr(folder / f"source_{deg:02}.exr", np.repeat(np.where(near, V, .002)[..., None], 3, -1))
    (folder / "lens.txt").write_text("".join(f"{d} " + " ".join([f"{falloff(np.radians(d)):.5f}"] * 3) + "\n" for d in range(0, 94, 3)))


def write_dual(folder, n=128):
    """Both circles of a camera with lenses of 200 degrees, and their calibration."""
    scene = U.lobes(count=8, sharpest=2)
    halves = [U.fisheye(lambda d, s=s: scene(d * [s, 1, s]), n, 200, samples=2, outside=0) for s in (1, -1)]
    U.write_exr(folder / "dual.exr", np.concatenate(halves, 1))
    focal = n / 2 / np.radians(100)
    one = f"kannala-brandt 0 0 0 0\ncamera {focal:.6g} {focal:.6g} {(n - 1) / 2} {(n - 1) / 2}\nsize {n} {n}\n"
    (folder / "rig.txt").write_text(f"[front]\n{one}[back]\n{one}from-first -1 0 0  0 1 0  0 0 -1\n")


def write_probes(folder):
    scene = U.lobes(count=8, sharpest=2)
    for k, name in enumerate(["probe", "left", "right", *(f"probe_{k}" for k in range(6))]):
        U.write_exr(folder / f"{name}.exr", (1 + .1 * k) * U.probe(scene, 32, 8, 90, 2))
    run("ilfpack", "--quiet", "--grid", "3x2", "--plane", "0 0 0 .75 0 0 0 .75 0", "-o", "room.ilf.exr", *(f"probe_{k}.exr" for k in range(6)), cwd=folder)


def write_lamps(folder):
    f = random_ilf(np.random.default_rng(1), 3, 2, 32, 8, plane=((0, 0, 0), (.75, 0, 0), (0, .75, 0)))
    card = Mask("layer", np.kron([[1, 1], [0, 1]], np.ones((4, 4))), plane=(.8, 0, 0), at=(-.1, -.1), step=(.12, .12))
    f.lamps = [Lamp("sphere", (1, .5, 1.6), (90, 80, 60), radius=.2, masks=[card]), Lamp("disc", (-.5, .2, 1.8), (20, 30, 60), a=(.1, 0, 0), b=(0, .1, 0))]
    write_ilf(folder / "lamps.ilf.exr", f)


def wall_light(x):
    "of ROOM's walls and floor, with no part like another"
    v = .6 + .25 * np.sin(1.3 * x[..., 0] + .4) * np.cos(1.1 * x[..., 1]) + .15 * np.cos(2 * x[..., 2])
    return v[..., None] * np.stack([1 + .2 * np.sin(x[..., 0]), np.ones_like(v), 1 + .3 * np.cos(x[..., 1])], -1)


def room_panorama(at, heading, rows=64, S=4):
    "ROOM as a 360-degree camera sees it, upright"
    y, x = (np.mgrid[0:rows * S, 0:2 * rows * S] + .5) / S
    lon, lat = np.radians(heading) + np.pi - x / rows * np.pi, np.pi / 2 - y / rows * np.pi
    d = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], -1)
    wall = np.where(d > 0, (3, 3, 2), (-2, -2, -1))
    t = ((wall - at) / d).min(-1)
    light = wall_light(at + t[..., None] * d)
    e = np.subtract((1, .5, 1.6), at)
    light[(d @ e > 0) & ((d @ e) ** 2 - e @ e + .2 ** 2 > 0)] = 90, 80, 60
    return light.reshape(rows, S, 2 * rows, S, 3).mean((1, 3))


def write_shots(folder, n=8):
    rng, lines = np.random.default_rng(20), []
    for k in range(n):
        at, heading = np.r_[rng.uniform(0, .75, 2), rng.uniform(0, .03)], rng.uniform(-180, 180)
        U.write_exr(folder / f"shot_{k}.exr", room_panorama(at, heading))
        lines.append(f"shot_{k}.exr {at[0]:.4f} {at[1]:.4f} {at[2]:.4f} {heading:.2f}\n")
    (folder / "shots.txt").write_text("".join(lines))


def write_scene(folder):
    (folder / "room.rad").write_text(ROOM)
    (folder / "objects.rad").write_text(OBJECTS)
    (folder / "surroundings.rad").write_text("void ilf room\n1 room.ilf.exr\n0\n9 0 0 0 .75 0 0 0 .75 0\nroom bubble surroundings\n0\n0\n4 .4 .4 0 3\n")
    (folder / "view.vf").write_text("rvu -vtv -vp .4 -1.5 1 -vd 0 1 -.6 -vu 0 0 1 -vh 40 -vv 30\n")


def write_stage(folder):
    """Eight lamps about a subject, and its way through room.ilf.exr."""
    lines = ["[fixture.spot]", "size = 0.1", *(f"[fixture.spot.channel.{c}]\nrgb = {rgb}" for c, rgb in (("red", [9, .3, .1]), ("green", [.5, 8, .4]), ("blue", [.2, .6, 7])))]
    for k in range(8):
        angle = k * np.pi / 4
        lines.append(f'[[light]]\nname = "l{k}"\nfixture = "spot"\nposition = [{1.5 * np.cos(angle):.4f}, {1.5 * np.sin(angle):.4f}, {.5 + k % 2}]\naim = [0, 0, 0]')
    (folder / "stage.toml").write_text("\n".join(lines) + "\n")
    (folder / "walk.txt").write_text("0 .1 .1 0 0\n1 .6 .5 0 45\n")


def make(folder):
    write_series(folder)
    U.write_exr(folder / "fisheye.exr", fisheye())
    write_lens(folder)
    scene = U.lobes(count=8, sharpest=2)
    lon, lat = np.meshgrid(np.pi - 2 * np.pi * (np.arange(128) + .5) / 128, np.pi / 2 - np.pi * (np.arange(64) + .5) / 64)
    U.write_exr(folder / "panorama.exr", scene(np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], -1)))
    run("fishremap", "--quiet", "--from", "latlong", "--to", "latlong", "--size", "128x64", "-o", "panorama.hdr", "panorama.exr", cwd=folder)
    write_dual(folder)
    write_lamps(folder)
    U.write_exr(folder / "spheres.exr", photograph(U.lobes(count=3, sharpest=2), 12, 12, radius=15.)[0])
    write_probes(folder)
    (folder / "rays.txt").write_text("".join(f"{x} {x} 0  {x} 0 1  {2 * x} {x} 1\n" for x in (.1, .2, .3)))
    (folder / "places.txt").write_text("panorama.exr 0 0 1.5 0\npanorama.hdr .2 0 1.5 0  # beside it\n")
    write_scene(folder)
    write_shots(folder)
    write_stage(folder)
    session(folder, camera={"exposures": "1/60 1/8"}, stage={"port": "port"})


def stage(folder):
    return Stage(folder)
