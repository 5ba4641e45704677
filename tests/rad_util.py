"""Radiance scenes twice: as text for oconv, and as numpy geometry that is intersected here.

Each shape gives rad(modifier, name) and hit(o, d) -> t (inf: missed), d of any length.  A Scene is
evaluated with ilf_util's oracle; it knows surfaces that carry an `ilf` and nothing else.
"""
import sys

import numpy as np

from conftest import TOP, run
from ilf_util import ILF, assert_same, directional_ilf, f32, random_directions, random_ilf, unit, write_ilf

sys.path.insert(0, str(TOP / "scenes"))
import rgbe  # noqa: E402

EPS = 1e-6      # Radiance ignores hits nearer than FTINY
INF = np.inf


def numbers(a):
    return " ".join(f"{x:.17g}" for x in np.ravel(a))


def nearest(*ts):
    """The smallest t beyond EPS."""
    t = np.stack(np.broadcast_arrays(*ts))
    return np.where(t > EPS, t, INF).min(0)


class Sphere:
    """Also the bubble: the same surface seen from inside."""

    def __init__(self, centre, radius, kind="sphere"):
        self.c, self.r, self.kind = np.asarray(centre, float), float(radius), kind

    def rad(self, mod, name):
        return f"\n{mod} {self.kind} {name}\n0\n0\n4 {numbers(self.c)} {self.r:.17g}\n"

    def hit(self, o, d):
        w = o - self.c
        a, b, c = (d * d).sum(1), (w * d).sum(1), (w * w).sum(1) - self.r ** 2
        disc = b * b - a * c
        root = np.sqrt(np.maximum(disc, 0))
        return np.where(disc > 0, nearest((-b - root) / a, (-b + root) / a), INF)


class Polygon:
    """A convex polygon."""

    def __init__(self, *corners):
        self.p = np.asarray(corners, float)

    def rad(self, mod, name):
        return f"\n{mod} polygon {name}\n0\n0\n{self.p.size} {numbers(self.p)}\n"

    def hit(self, o, d):
        n = np.cross(self.p[1] - self.p[0], self.p[2] - self.p[0])
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((self.p[0] - o) @ n) / (d @ n)
        x = o + np.where(np.isfinite(t), t, 0)[:, None] * d
        inside = np.isfinite(t)
        for a, b in zip(self.p, np.roll(self.p, -1, 0)):
            inside &= np.cross(b - a, x - a) @ n > 0
        return nearest(np.where(inside, t, INF))


class Ring:
    def __init__(self, centre, normal, r0, r1):
        self.c, self.n, self.r = np.asarray(centre, float), np.asarray(normal, float), (r0, r1)

    def rad(self, mod, name):
        return f"\n{mod} ring {name}\n0\n0\n8 {numbers(self.c)} {numbers(self.n)} {numbers(self.r)}\n"

    def hit(self, o, d):
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((self.c - o) @ self.n) / (d @ self.n)
        x = np.linalg.norm(o + np.where(np.isfinite(t), t, 0)[:, None] * d - self.c, axis=1)
        return nearest(np.where(np.isfinite(t) & (x > self.r[0]) & (x < self.r[1]), t, INF))


class Cone:
    """Also cup, cylinder and tube."""

    def __init__(self, a, b, r0, r1=None, kind="cone"):
        self.a, self.b, self.kind = np.asarray(a, float), np.asarray(b, float), kind
        self.r = (float(r0), float(r0 if r1 is None else r1))

    def rad(self, mod, name):
        r = self.r[:1] if self.kind in ("cylinder", "tube") else self.r
        return f"\n{mod} {self.kind} {name}\n0\n0\n{6 + len(r)} {numbers(self.a)} {numbers(self.b)} {numbers(r)}\n"

    def hit(self, o, d):
        axis = self.b - self.a
        length = np.linalg.norm(axis)
        axis = axis / length
        k = (self.r[1] - self.r[0]) / length
        w = o - self.a
        wz, dz = w @ axis, d @ axis
        wr, dr = w - wz[:, None] * axis, d - dz[:, None] * axis
        q0, q1 = self.r[0] + k * wz, k * dz            # radius of the cone along the ray: q0 + t q1
        a = (dr * dr).sum(1) - q1 ** 2
        b = (wr * dr).sum(1) - q0 * q1
        c = (wr * wr).sum(1) - q0 ** 2
        disc = b * b - a * c
        root = np.sqrt(np.maximum(disc, 0))
        ts = []
        for t in ((-b - root) / a, (-b + root) / a):
            z = wz + t * dz
            ts.append(np.where((disc > 0) & (z > 0) & (z < length) & (q0 + t * q1 >= 0), t, INF))
        return nearest(*ts)


class Mesh:
    """Triangles through obj2mesh; call build(folder) before use."""

    def __init__(self, vertices, triangles, name="mesh"):
        self.v, self.t, self.name = f32(vertices), np.asarray(triangles), name

    def build(self, folder):
        text = "".join(f"v {numbers(p)}\n" for p in self.v) + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in self.t)
        (folder / f"{self.name}.obj").write_text(text)
        run("obj2mesh", f"{self.name}.obj", f"{self.name}.rtm", cwd=folder)
        return self

    def rad(self, mod, name):
        return f"\n{mod} mesh {name}\n1 {self.name}.rtm\n0\n0\n"

    def hit(self, o, d):
        return nearest(*(Polygon(*self.v[list(t)]).hit(o, d) for t in self.t))


class Source:
    """Light at infinity within angle degrees (full cone) about a direction."""

    def __init__(self, direction, angle):
        self.d, self.angle = unit(direction), float(angle)

    def rad(self, mod, name):
        return f"\n{mod} source {name}\n0\n0\n4 {numbers(self.d)} {self.angle:.17g}\n"

    def hit(self, o, d):
        inside = unit(d) @ self.d > np.cos(np.deg2rad(self.angle / 2))
        return np.where(inside, np.finfo(float).max, INF)


class Moved:
    """A shape carried along by a 4x4 matrix; the scene text does it by xform or instance."""

    def __init__(self, shape, M):
        self.shape, self.inverse = shape, np.linalg.inv(M)

    def hit(self, o, d):
        return self.shape.hit(o @ self.inverse[:3, :3].T + self.inverse[:3, 3], d @ self.inverse[:3, :3].T)

    @property
    def at_infinity(self):
        return isinstance(self.shape, Source)


def matrix(options):
    """The 4x4 matrix (column vectors) of xform's options."""
    a = list(map(str, options))
    M = np.eye(4)
    while a:
        o = a.pop(0)
        X = np.eye(4)
        if o == "-t":
            X[:3, 3] = [float(a.pop(0)) for _ in range(3)]
        elif o in ("-rx", "-ry", "-rz"):
            w = np.deg2rad(float(a.pop(0)))
            i, j = {"-rx": (1, 2), "-ry": (2, 0), "-rz": (0, 1)}[o]
            X[i, i] = X[j, j] = np.cos(w)
            X[i, j], X[j, i] = -np.sin(w), np.sin(w)
        elif o == "-s":
            X[:3, :3] *= float(a.pop(0))
        elif o in ("-mx", "-my", "-mz"):
            X["-mx -my -mz".split().index(o)] *= -1
        else:
            raise ValueError(o)
        M = X @ M
    return M


def material(name, file, f=None, reals=0, depth=None, mod="void"):
    """The ilf primitive: reals 0, 9 or 12 from f's plane."""
    values = {0: [], 9: [f.origin, f.U, f.V] if reals else [], 12: [f.origin, f.U, f.V, f.N] if reals == 12 else []}[reals]
    words = [str(file)] + ([] if depth is None else ["depth" if depth else "nodepth"])
    return f"\n{mod} ilf {name}\n{len(words)} {' '.join(words)}\n0\n{reals} {numbers(np.ravel(values)) if reals else ''}\n"


class Surface:
    """A shape with an ilf on it; pattern(points, directions) -> factor."""

    def __init__(self, shape, ilf: ILF, depth=True, pattern=None):
        self.shape, self.ilf, self.depth, self.pattern = shape, ilf, depth, pattern

    @property
    def far(self):
        return isinstance(self.shape, Source) or getattr(self.shape, "at_infinity", False)

    def moved(self, M):
        return Surface(Moved(self.shape, M), self.ilf.moved(M), self.depth, self.pattern)


def scene_hits(surfaces, o, d):
    """Index of the nearest surface (-1: none) and t."""
    t = np.stack([s.shape.hit(o, d) for s in surfaces])
    k = t.argmin(0)
    t = t.min(0)
    return np.where(np.isfinite(t), k, -1), t


def scene_value(surfaces, o, d):
    """What rtrace -ab 0 -di 0 must find."""
    d = unit(d)
    k, t = scene_hits(surfaces, o, d)
    out = np.zeros((len(o), 3))
    for n, s in enumerate(surfaces):
        m = k == n
        if not m.any():
            continue
        h = None if s.far else o[m] + t[m, None] * d[m]
        value = s.ilf.eval(o[m], d[m], h, s.depth)
        out[m] = value if s.pattern is None else value * s.pattern(h, d[m])
    return out


def clear(surfaces, o, d, rng):
    """Rays that no rounding can send to another surface: the same is hit, near by, a little beside them."""
    k, t = scene_hits(surfaces, o, d)
    good = np.ones(len(o), bool)
    up = np.stack([d @ s.ilf.frame()[2] > 0 for s in surfaces])
    for _ in range(6):
        e = d + 1e-6 * rng.normal(size=d.shape)
        k2, t2 = scene_hits(surfaces, o, e)
        with np.errstate(invalid="ignore"):
            good &= (k == k2) & ((t == t2) | (np.abs(t2 - t) < 1e-3 * t))
        good &= (up == np.stack([e @ s.ilf.frame()[2] > 0 for s in surfaces])).all(0)
    return good


def oconv(folder, text, name="scene", *options):
    (folder / f"{name}.rad").write_text(text)
    (folder / f"{name}.oct").write_bytes(run("oconv", *options, f"{name}.rad", cwd=folder).out)
    return f"{name}.oct"


LITERAL = ["-h", "-ab", "0", "-di", "0"]


def rtrace(folder, octree, o, d, *options, code=0, literal=True):
    """Radiance along rays, through binary floats; o and d must be float32 numbers already."""
    data = np.concatenate([o, d], 1).astype("<f4").tobytes()
    r = run("rtrace", *(LITERAL if literal else ["-h"]), "-ff", *options, octree, stdin=data, cwd=folder, code=code)
    return r if code else np.frombuffer(r.out, "<f4").reshape(-1, 3).astype(float)


def read_picture(folder, name):
    """(height, width, 3) of a Radiance picture, whatever its exposure."""
    return rgbe.values(rgbe.read(folder / name)[0])


# ---- scenes of the tests ---------------------------------------------------------------------------

UPRIGHT = ((-0.5, -0.4, 0), (1.1, 0.2, 0), (-0.2, 1.1, 0))    # a plane with n = z
L = np.array([1.0, 2.0, 4.0])    # radiance of the constant domes
MOVES = {
    "translate": "-t 3 -2 1.5", "rotate x": "-rx 37", "rotate y": "-ry -71", "rotate z": "-rz 200", "scale": "-s 0.03",
    "mirror x": "-mx", "mirror z": "-mz", "mirror twice": "-mx -my", "all": "-rx 30 -s 2.5 -t 1 2 3 -mz -rz 15 -ry 100 -t 0 -4 0.5",
    "far": "-t 1e3 -2e3 1e3",
}
FLOOR = "void plastic grey\n0\n0\n5 .5 .5 .5 0 0\n" + Polygon((-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)).rad("grey", "floor")


def file_and_ilf(folder, rng, grid=(4, 3), texels=(12, 8), kind="hemisphere", half=False, name="room", **more):
    f = random_ilf(rng, *grid, *texels, kind, half, **more)
    write_ilf(folder / f"{name}.ilf.exr", f, half)
    return f, f"{name}.ilf.exr"


def rays_about(rng, f, n, spread=0.5):
    """Float32 rays from about the plane, in all directions."""
    middle = f.origin + f.U / 2 + f.V / 2
    return f32(middle + rng.normal(size=(n, 3)) * spread), f32(random_directions(rng, n))


def compare(folder, octree, surfaces, o, d, rng, least=0.1, *options):
    """rtrace against the oracle, where no rounding decides what is hit."""
    expected = scene_value(surfaces, o, d)
    good = clear(surfaces, o, d, rng)
    assert good.mean() > 0.97
    assert (expected[good] > 0).all(1).mean() > least, "the rays miss what is tested"
    assert_same(rtrace(folder, octree, o, d, *options)[good], expected[good])


def elsewhere(f, rng, reals, sign=1):
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    n = np.cross(q[0], q[1]) * sign * rng.uniform(0.1, 30)
    return f.placed(rng.normal(size=3), q[0] * 1.7, q[1] * 0.6, n if reals == 12 else None)


def dome_scene(folder, radiance, file="dome.ilf.exr", n_theta=256, n_phi=128, shape=None, depth=None):
    f = directional_ilf(radiance, n_theta, n_phi, origin=(-0.5, -0.5, 0))
    write_ilf(folder / file, f, compression="zip")
    return oconv(folder, material("room", file, depth=depth) + (shape or Sphere((0, 0, 0), 10)).rad("room", "dome"))


def irradiance(folder, octree, normals, *options):
    text = "".join(f"0 0 0 {numbers(n)}\n" for n in normals)
    r = run("rtrace", "-h", "-I", "-di", "0", "-ab", "1", "-ad", "65536", "-lw", "1e-6", *options, octree, stdin=text, cwd=folder)
    return np.array([x.split() for x in r.text.splitlines()], float)
