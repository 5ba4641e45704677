"""Rooms of our own for tuning and judging ilflamps: what a perfect camera captures in them, and how far a light field is from it.

    rooms.py make ROOM[:SEED] 8x8 256x128 OUT.ilf.exr [KEY=X...]   capture it (area means); plane 1 m x 1 m round (0, 0, 0).  Standard
                                   deviations by KEY: noise= of a texel, gain= of a probe, move= in m, turn= in degrees; seed=
    rooms.py walls ROOM[:SEED] OUT.rad                       its walls, for ilflamps --geometry (oconv makes the octree)
    rooms.py score ROOM[:SEED] FIELD.ilf.exr [OPTION...]     errors of version 1 and of what ilflamps OPTION... makes of it
    rooms.py list

score compares radiance along the rays of a quadrature (lamps, 8 degrees round them, the rest) at 75 points, .02, .1 and .3 m above the
plane, with the room itself.  Figures in %: up (rms error of irradiance upwards, of its mean), side (the same for four sides), rad
(mean of the integral of |L - L_true| cos over E), worst (largest single up).  Needs numpy, the package ilf (python/), build/test/caster.so (make makes it);
ilflamps on PATH.
"""
import ctypes, json, os, subprocess, sys, tempfile
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
BALL, QUAD, ELLIPSE, ROD, SUN = range(5)
BODY = np.dtype([("kind", "i4"), ("lamp", "i4"), ("gate", "i4"), ("spare", "i4"), ("c", "f8", 3), ("u", "f8", 3), ("v", "f8", 3),
                 ("r", "f8"), ("L", "f8", 3), ("axis", "f8", 3), ("k", "f8"), ("focus", "f8"), ("gx", "f8"), ("gy", "f8"), ("gr", "f8"),
                 ("soft", "f8"), ("amp", "f8"), ("cell", "f8")])
D3 = ctypes.c_double * 3


class _Room(ctypes.Structure):
    _fields_ = [("lo", D3), ("hi", D3)] + [(k, ctypes.c_double) for k in ("amp", "cell", "bright", "mirror", "phase")] + \
               [("n", ctypes.c_int), ("spare", ctypes.c_int), ("b", ctypes.c_void_p)]


def library():
    top = os.path.dirname(os.path.dirname(HERE))
    at = os.path.join(top, os.environ.get("ILF_BUILD", "build"), "test", "caster.so")
    if not os.path.exists(at):
        sys.exit(f"rooms.py: {at} is not there: make {os.path.relpath(at, top)}")
    return ctypes.CDLL(at)


LIB = library()
ptr = lambda a: a.ctypes.data_as(ctypes.c_void_p)


def body(kind, c, L, u=(0, 0, 0), v=(0, 0, 0), r=0., **more):
    b = np.zeros((), BODY)
    for k, x in dict(kind=kind, c=c, L=L, u=u, v=v, r=r, **more).items(): b[k] = x
    return b


def unit(v): return np.asarray(v, float) / np.linalg.norm(v)


def turned_camera(heading, pitch, roll):
    "columns: a camera's forward, left, up"
    h, p, r = np.radians([heading, pitch, roll]); c, s = np.cos, np.sin
    return np.array([[c(h), -s(h), 0], [s(h), c(h), 0], [0, 0, 1]]) @ [[c(p), 0, -s(p)], [0, 1, 0], [s(p), 0, c(p)]] @ np.array([[1, 0, 0], [0, c(r), -s(r)], [0, s(r), c(r)]])


class Room:
    def __init__(self, bodies, lo=(-3.2, -2.9, -.001), hi=(2.9, 3.1, 2.9), amp=0, cell=.5, bright=.7, mirror=0, phase=.4):
        self.bodies, self.lo, self.hi = np.array(bodies, BODY), lo, hi
        self.w = _Room(D3(*lo), D3(*hi), amp, cell, bright, mirror, phase, len(self.bodies), 0, self.bodies.ctypes.data)

    def rays(self, o, d):
        o, d = np.ascontiguousarray(o, float), np.ascontiguousarray(d, float)
        L, h = np.empty((len(d), 3)), np.empty((len(d), 3))
        LIB.rays(ctypes.byref(self.w), ctypes.c_long(len(d)), ptr(o), ptr(d), ptr(L), ptr(h))
        return L, h

    def probe(self, at, n_theta, n_phi, S=3, fine=20, turn=np.eye(3)):
        "turn: its axes in the room's, in columns"
        out, at, turn = np.empty((n_phi, n_theta, 3), np.float32), np.array(at, float), np.ascontiguousarray(np.transpose(turn), float)
        LIB.probe(ctypes.byref(self.w), ptr(at), ptr(turn), n_phi, n_theta, S, fine, ptr(out))
        return out

    def panorama(self, at, height, heading=0., pitch=0., roll=0., S=3, fine=20):
        """What a 360-degree camera writes: equirectangular, middle column forward, columns to the right, top row up.  Degrees: heading of
        forward counter-clockwise from +x about +z, then pitch (nose up), then roll (right side down)."""
        axes, out = np.ascontiguousarray(turned_camera(heading, pitch, roll).T), np.empty((height, 2 * height, 3), np.float32)
        LIB.sphere(ctypes.byref(self.w), ptr(np.array(at, float)), ptr(axes), height, 2 * height, S, fine, ptr(out))
        return out[:, ::-1].copy()

    def caps(self, x):
        "axis and half angle of each lamp as seen from x"
        out = []
        for b in self.bodies[self.bodies["lamp"] == 1]:
            if b["kind"] == SUN: out.append((b["c"], b["r"])); continue
            c, r = b["c"], b["r"]
            if b["kind"] == QUAD: r = np.hypot(np.linalg.norm(b["u"]), np.linalg.norm(b["v"]))
            if b["kind"] == ELLIPSE: r = max(np.linalg.norm(b["u"]), np.linalg.norm(b["v"]))
            if b["kind"] == ROD: r, c = r + np.linalg.norm(b["u"] - c) / 2, (c + b["u"]) / 2
            vs = [c - x]
            if self.w.mirror: vs.append(np.array([2 * self.hi[0] - c[0], c[1], c[2]]) - x)
            out += [(v / np.linalg.norm(v), np.arcsin(min(1, r / np.linalg.norm(v)))) for v in vs]
        return out


# ---- bodies of rooms ----
def lamp(c, r, L, **m): return body(BALL, c, L, r=r, lamp=1, **m)
def panel(c, u, v, L, **m): return body(QUAD, c, L, u=u, v=v, lamp=1, **m)
def tube(a, b, r, L): return body(ROD, a, L, u=b, r=r, lamp=1)
def disc(c, n, r, L, **m):
    t = unit(np.cross(n, [0, 0, 1] if abs(unit(n)[2]) < .9 else [1, 0, 0])); return body(ELLIPSE, c, L, u=t * r, v=np.cross(unit(n), t) * r, **m)
def card(c, u, v, L, **m): return body(QUAD, c, L, u=u, v=v, **m)
def ball(c, r, L): return body(BALL, c, L, r=r)
def rod(a, b, r, L): return body(ROD, a, L, u=b, r=r)
W1, W2, W3 = ((1.3, .7, 2.4), .05, (9000, 8000, 6000)), ((-1.1, -1.6, 2.3), .06, (5000, 6000, 9000)), ((.2, 1.9, 2.2), .045, (8000, 8000, 8000))
GREY = (.3, .3, .3)


def turned(tilt, about, turn=0.):
    "half axes of a unit square, tilted by degrees about a direction in the plane, turned before"
    t, a, g = np.radians([tilt, about, turn]); ax = np.array([np.cos(a), np.sin(a), 0])
    rot = lambda p: p * np.cos(t) + np.cross(ax, p) * np.sin(t) + ax * (ax @ p) * (1 - np.cos(t))
    return rot(np.array([np.cos(g), np.sin(g), 0])), rot(np.array([-np.sin(g), np.cos(g), 0]))


def between(l, x, z):
    "the point at height z between lamp l and plane point x"
    l, x = np.asarray(l, float), np.r_[x, 0.]; return x + (l - x) * z / l[2]


def twigs(rng, n=80, z=(.35, .55), wide=1.2):
    out = []
    for _ in range(n):
        c = np.r_[rng.uniform(-wide, wide, 2), rng.uniform(*z)]; s = np.r_[unit(rng.normal(size=2)), rng.uniform(-.3, .3)] * rng.uniform(.08, .3)
        out.append(rod(c - s, c + s, rng.uniform(.004, .014), rng.uniform(.1, .4) * np.array([.8, .8, .5])))
    return out


def leaves(rng, n=60, z=(.5, .8)):
    out = []
    for _ in range(n):
        u, v = turned(rng.uniform(0, 40), rng.uniform(0, 360), rng.uniform(0, 360)); s = rng.uniform(.03, .07)
        out.append(body(ELLIPSE, np.r_[rng.uniform(-.9, .9, 2), rng.uniform(*z)], rng.uniform(.1, .35) * np.array([.6, 1, .4]), u=u * s, v=v * s * .6))
    return out


def tilted(l, x, z, su, sv, tilt, about, turn, L, **m):
    u, v = turned(tilt, about, turn); return card(between(l, x, z), u * su, v * sv, L, **m)


R = np.random.default_rng
FIXED = {
    "none": lambda: Room([]),
    "card": lambda: Room([lamp(*W1), lamp(*W2), tilted(W1[0], (.1, -.1), 1.2, .3, .25, 0, 0, 20, GREY)]),
    "textured": lambda: Room([lamp(*W1), lamp(*W2), tilted(W2[0], (-.1, .1), 1.1, .33, .3, 12, 30, 10, (.4, .35, .3), amp=.5, cell=.11)], amp=.25, cell=.4),
    "tilted": lambda: Room([lamp(*W1), lamp(*W2), tilted(W1[0], (0, 0), 1.0, .25, .3, 22, 70, 0, GREY)]),
    "round": lambda: Room([lamp(*W1), lamp(*W3), disc(between(W3[0], (.1, .1), .9), (0, .1, 1), .22, (.25, .3, .2))]),
    "twigs": lambda: Room([lamp(*W1), lamp(*W2)] + twigs(R(11))),
    "leaves": lambda: Room([lamp(*W1), lamp(*W3)] + leaves(R(12))),
    "three": lambda: Room([lamp(*W1), lamp(*W2), lamp(*W3), ball(between(W1[0], (.2, .1), 1.1), .17, (.3, .2, .2)),
                           tilted(W2[0], (-.2, -.1), .9, .12, .15, 0, 0, 30, GREY), tilted(W3[0], (0, -.2), 1.3, .3, .2, 10, 0, 0, (.4, .3, .3))]),
    "panel": lambda: Room([panel((.8, -.6, 2.5), (.2, 0, 0), (0, .2, 0), (900, 900, 900)), tilted((.8, -.6, 2.5), (0, .05), 1.1, .3, .25, 0, 0, 15, GREY)]),
    "window": lambda: Room([panel((2.85, .2, 1.6), (0, .7, 0), (0, 0, .55), (60, 70, 90))] +
                           [card((2.6, .2 + y, 1.6), (0, .02, 0), (0, 0, .6), (.1, .1, .1)) for y in (-.35, 0, .35)]),
    "beams": lambda: Room([lamp(*W1, axis=unit((-1.3, -.6, -2.4)), k=30.), lamp(*W2, axis=unit((1.2, 1.5, -2.3)), k=60.)]),
    "spot": lambda: Room([panel((-.9, .5, 2.6), (.15, 0, 0), (0, .15, 0), (8000, 8000, 7000), gate=1, focus=0., gx=.05, gy=-.05, gr=.4, soft=.03)]),
    "spotfar": lambda: Room([disc((1., .5, 2.5), (-.3, -.2, -1), .12, (9000, 9000, 8000), lamp=1, gate=1, focus=-.5, gx=-.1, gy=-.1, gr=.5, soft=.12)]),
    "spotnear": lambda: Room([lamp((.7, .9, 2.5), .12, (7000, 7000, 8000), gate=1, focus=.7, gx=.2, gy=.22, gr=.33, soft=.05)]),
    "dim": lambda: Room([lamp(W1[0], .06, (30, 30, 25)), lamp(W2[0], .07, (28, 30, 36)), tilted(W1[0], (.1, 0), 1.2, .3, .3, 0, 0, 0, GREY)]),
    "tubes": lambda: Room([tube((-.6, 1.2, 2.4), (.6, 1.2, 2.4), .02, (2500, 2500, 2500)), tilted((0, 1.2, 2.4), (0, 0), 1.2, .3, .3, 0, 0, 0, GREY)]),
    "touch": lambda: Room([lamp((1.3, .7, 2.4), .05, (9000, 8000, 6000)), lamp((1.3, .82, 2.4), .05, (5000, 6000, 9000)),
                           tilted(W1[0], (.1, -.1), 1.2, .3, .25, 0, 0, 20, GREY)]),
    "mirrored": lambda: Room([lamp(*W1), tilted(W1[0], (0, 0), 1.2, .3, .25, 0, 0, 0, GREY)], mirror=.5),
    "sun": lambda: Room([body(SUN, unit((.5, .3, .8)), (4e4, 4e4, 3.5e4), r=np.radians(.6), lamp=1), card((.6, .3, .9), (.25, 0, 0), (0, .2, 0), GREY)],
                        lo=(-30, -30, -.001), hi=(30, 30, 30)),
    "twenty": lambda: Room([lamp((-2 + .9 * (i % 5), -1.6 + 1.05 * (i // 5), 2.3 + .1 * (i % 3)), .03, (5000, 5000, 5000)) for i in range(20)] +
                           [tilted(W1[0], (.1, -.1), 1., .3, .25, 0, 0, 20, GREY)]),
    "two": lambda: Room([lamp(*W1), tilted(W1[0], (.15, -.2), 1.3, .3, .12, 0, 0, 20, GREY), tilted(W1[0], (-.2, .2), .8, .12, .2, 0, 0, 50, (.4, .35, .3))]),
    "beamcard": lambda: Room([lamp(*W1, axis=unit((-1.3, -.6, -2.4)), k=25.), tilted(W1[0], (.1, -.1), 1.2, .25, .25, 0, 0, 20, GREY)]),
    "low": lambda: Room([lamp((2.4, .3, .06), .05, (6000, 6000, 6000)), lamp(*W2)]),
    "never": lambda: Room([lamp(*W1), lamp(*W3), tilted(W1[0], (0, 0), 1.2, .75, .7, 0, 0, 0, GREY)]),
}


def anyroom(seed):
    "a room by chance"
    rng = R(seed); n = int(rng.integers(1, 4)); bodies, at = [], []
    while len(at) < n:
        c = np.r_[rng.uniform(-2, 2, 2), rng.uniform(1.9, 2.6)]
        if all(np.linalg.norm(c - a) > .7 for a in at): at.append(c)
    for c in at:
        L = 10 ** rng.uniform(2.6, 4) * (1 + .4 * rng.uniform(-1, 1, 3)); kind = rng.choice(["ball", "ball", "panel", "beam", "spot", "tube", "disc"])
        aim = unit(np.r_[rng.uniform(-.3, .3, 2), 0] - c)
        if kind == "ball": bodies.append(lamp(c, rng.uniform(.03, .09), L))
        if kind == "beam": bodies.append(lamp(c, rng.uniform(.04, .08), L, axis=aim, k=rng.uniform(8, 80)))
        if kind == "panel": u, v = turned(0, 0, rng.uniform(0, 90)); bodies.append(panel(c, u * rng.uniform(.06, .25), v * rng.uniform(.06, .25), L / 3))
        if kind == "disc": bodies.append(disc(c, aim, rng.uniform(.05, .15), L, lamp=1))
        if kind == "tube": u, v = turned(0, 0, rng.uniform(0, 180)); bodies.append(tube(c - .3 * u, c + .3 * u, rng.uniform(.012, .03), L))
        if kind == "spot": bodies.append(disc(c, aim, rng.uniform(.06, .12), L, lamp=1, gate=1, focus=rng.uniform(-.6, .7), gx=0, gy=0,
                                              gr=rng.uniform(.25, .5), soft=rng.uniform(.03, .15)))
        if kind == "spot": b = bodies[-1]; b["gx"], b["gy"] = between(c, rng.uniform(-.15, .15, 2), b["focus"])[:2]
    for c in at:
        what = rng.choice(["none", "card", "card", "textured", "round", "ball", "rods"]); x, z = rng.uniform(-.3, .3, 2), rng.uniform(.6, 1.4)
        col = rng.uniform(.1, .4) * (1 + .3 * rng.uniform(-1, 1, 3)); s = rng.uniform(.1, .35, 2)
        if what in ("card", "textured"):
            m = dict(amp=.5, cell=.1) if what == "textured" else {}
            bodies.append(tilted(c, x, z, *s, rng.choice([0, rng.uniform(0, 25)]), rng.uniform(0, 360), rng.uniform(0, 90), col, **m))
        if what == "round": bodies.append(disc(between(c, x, z), np.r_[rng.uniform(-.3, .3, 2), 1], s[0], col))
        if what == "ball": bodies.append(ball(between(c, x, z), .6 * s[0] + .03, col))
    rest = rng.choice(["none", "none", "none", "twigs", "leaves"])
    if rest == "twigs": bodies += twigs(rng, 60)
    if rest == "leaves": bodies += leaves(rng, 50)
    return Room(bodies, amp=rng.choice([0, 0, .25]), cell=.45, bright=rng.uniform(.3, 1), phase=rng.uniform(0, 6))


def oddroom(seed):
    "a room by chance, with what is rare: lamps that touch, few or many of them, windows, the sun, a mirror, a lamp at the horizon"
    room, rng = anyroom(seed), R(seed + 1000000)
    what = rng.choice(["plain"] * 6 + ["none", "twenty", "touch", "window", "sun", "mirror", "low", "never"]); b, kw = list(room.bodies), {}
    w = room.w; kw = dict(amp=w.amp, cell=w.cell, bright=w.bright, phase=w.phase)
    at = lambda: np.r_[rng.uniform(-2, 2, 2), rng.uniform(1.9, 2.6)]
    lights = [x for x in b if x["lamp"]]
    if what == "none": b = [x for x in b if not x["lamp"]]
    if what == "twenty": b += [lamp(at(), rng.uniform(.02, .05), 10 ** rng.uniform(2.6, 4) * np.ones(3)) for _ in range(20 - len(lights))]
    if what == "touch": c = at(); b += [lamp(c, .05, (6000, 6000, 5000)), lamp(c + .102 * np.r_[unit(rng.normal(size=2)), 0], .05, (4000, 5000, 7000))]
    if what == "window":
        y = rng.uniform(-.8, .8); b += [panel((2.85, y, 1.6), (0, rng.uniform(.3, .8), 0), (0, 0, .55), (60, 70, 90))]
        b += [card((2.6, y + k, 1.6), (0, .02, 0), (0, 0, .6), (.1, .1, .1)) for k in (-.35, 0, .35)]
    if what == "sun":
        d = unit(np.r_[rng.uniform(-.8, .8, 2), .8]); kw.update(lo=(-30, -30, -.001), hi=(30, 30, 30))
        b = [x for x in b if not x["lamp"]] + [body(SUN, d, (4e4, 4e4, 3.5e4), r=np.radians(rng.uniform(.3, 1)), lamp=1),
                                               card(d / d[2] * rng.uniform(.6, 1.2), (.25, 0, 0), (0, .2, 0), GREY)]
    if what == "mirror": kw.update(mirror=.5)
    if what == "low": a = rng.uniform(0, 6.3); b += [lamp((2.4 * np.cos(a), 2.4 * np.sin(a), .06), .05, (6000, 6000, 6000))]
    if what == "never" and lights: b += [tilted(lights[0]["c"] if lights[0]["kind"] != ROD else (lights[0]["c"] + lights[0]["u"]) / 2, (0, 0), 1.2, .75, .7, 0, 0, 0, GREY)]
    return Room(b, **kw)


def named(name):
    if name.startswith("odd:"): return oddroom(int(name[4:]))
    if name.startswith("any:"): return anyroom(int(name[4:]))
    if ":" in name:
        import kinds
        return kinds.room(name.split(":")[0], int(name.split(":")[1]))
    return FIXED[name]()


def rotation(v):
    "the rotation about v by |v| radians (Rodrigues)"
    k = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]]); a = np.linalg.norm(v)
    return np.eye(3) + np.sinc(a / np.pi) * k + .5 * np.sinc(a / (2 * np.pi)) ** 2 * k @ k


def make(room, n_u, n_v, n_theta, n_phi, path, noise=0, gain=0, move=0, turn=0, seed=1):
    import ilf
    rng, img = R(seed), np.zeros((n_v, n_phi, n_u, n_theta, 3), np.float32)
    for j in range(n_v):
        for i in range(n_u):
            p = room.probe(np.r_[-.5 + i / max(1, n_u - 1), -.5 + j / max(1, n_v - 1), 0] + move * rng.normal(size=3) * (1, 1, 0), n_theta, n_phi,
                           turn=rotation(np.radians(turn) * rng.normal(size=3)))
            img[j, :, i] = p * (1 + noise * rng.normal(size=p.shape)).clip(0) * (1 + gain * rng.normal())
    ilf.write(path, img.swapaxes(1, 2), origin=(-.5, -.5, 0), U=(1, 0, 0), V=(0, 1, 0), compression="zip")


def walls(room):
    lo, hi, f = np.array(room.lo), np.array(room.hi), ["void plastic wall\n0\n0\n5 .5 .5 .5 0 0\n"]
    for ax in range(3):
        a, b = [k for k in range(3) if k != ax]
        for s in (0, 1):
            p = np.tile((lo, hi)[s], (4, 1)); p[1:3, a] = hi[a]; p[2:, b] = hi[b]; p[[0, 3], a] = lo[a]; p[:2, b] = lo[b]
            f.append(f"wall polygon w{ax}{s}\n0\n0\n12 " + " ".join(map(repr, map(float, p.ravel()))) + "\n")
    return "\n".join(f)


# ---- the score ----
def spread(n, rng): return (np.arange(n)[:, None] * np.array([.7548776662466927, .5698402909980532]) + rng.random(2)) % 1


def ring(axis, a0, a1, n, rng):
    uv = spread(n, rng); z = np.cos(a0) + (np.cos(a1) - np.cos(a0)) * uv[:, :1]; s = np.sqrt(np.maximum(0, 1 - z * z)); p = 2 * np.pi * uv[:, 1:]
    t = unit(np.cross(axis, [0, 0, 1.] if abs(axis[2]) < .9 else [1., 0, 0])); b = np.cross(axis, t)
    return s * np.cos(p) * t + s * np.sin(p) * b + z * axis, np.full(n, 2 * np.pi * (np.cos(a0) - np.cos(a1)) / n)


def quadrature(room, x, rng, most=14000, rest=8000):
    caps = [(c, a * 1.02, a * 1.02 + np.radians(8)) for c, a in room.caps(x)]; D, W = [], []
    fine, near = min(3000, most * 3 // 7 // max(1, len(caps))), min(4000, most * 4 // 7 // max(1, len(caps)))
    def keep(d, w, k):
        ok = d[:, 2] > 0
        for ax, a, b in caps[:k]: ok &= d @ ax < np.cos(b)
        D.append(d[ok]); W.append(w[ok])
    for k, (ax, a, b) in enumerate(caps):
        keep(*ring(ax, 0, a, fine, rng), k); keep(*ring(ax, a, b, near, rng), k)
    keep(*ring(np.array([0, 0, 1.]), 0, np.pi / 2, rest, rng), len(caps))
    return np.concatenate(D), np.concatenate(W)


LUM = np.array([.265, .67, .065])
NORMALS = np.array([(0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)], float)


class Score:
    def __init__(self, room, patches=5, heights=(.02, .1, .3), seed=7, **rays):
        rng = R(seed); self.at, self.heights, self.n = [0], heights, patches ** 2; O, D, W = [], [], []
        for z in heights:
            for a in range(patches):
                for b in range(patches):
                    x = np.r_[((np.array([a, b]) + rng.random(2)) / patches - .5) * .9, z]; d, w = quadrature(room, x, rng, **rays)
                    O.append(np.broadcast_to(x, d.shape)); D.append(d); W.append(w); self.at.append(self.at[-1] + len(d))
        self.o, self.d, self.w = np.concatenate(O), np.concatenate(D), np.concatenate(W)
        L, self.hit = room.rays(self.o, self.d); self.true = L @ LUM

    def rays(self): return np.c_[self.o, self.d, self.hit].astype("<f8")

    def of(self, rgb):
        got, out = rgb @ LUM, {}
        E, Rd = np.zeros((2, len(self.at) - 1, 5)), np.zeros(len(self.at) - 1)
        for k in range(len(Rd)):
            s = slice(self.at[k], self.at[k + 1]); c = np.maximum(0, self.d[s] @ NORMALS.T) * self.w[s, None]
            E[0, k], E[1, k] = self.true[s] @ c, got[s] @ c; Rd[k] = abs(got[s] - self.true[s]) @ c[:, 0] / E[0, k, 0]
        for h, z in enumerate(self.heights):
            s = slice(h * self.n, (h + 1) * self.n); t, g = E[0, s], E[1, s]; e = g - t
            out[z] = dict(up=100 * np.sqrt((e[:, 0] ** 2).mean()) / t[:, 0].mean(), side=100 * np.sqrt((e[:, 1:] ** 2).mean()) / t[:, 1:].mean(),
                          rad=100 * Rd[s].mean(), worst=100 * abs(e[:, 0]).max() / t[:, 0].mean())
        return out


def shell(*words):
    "a program as the shell finds it; where it fails, so do we"
    code = subprocess.run(words).returncode
    if code: raise SystemExit(code)


def run(room, path, options, score=None, call=shell):
    "errors of version 1, errors of lamps and residual, ilflamps' report; call(program, word, ...) runs it"
    s = score or Score(room)
    with tempfile.TemporaryDirectory() as d:
        s.rays().tofile(f"{d}/rays")
        call("ilflamps", "--quiet", "--report", f"{d}/r.json", "--rays", f"{d}/rays", "--radiance", f"{d}/out", *options, path)
        v = np.fromfile(f"{d}/out", "<f4").reshape(2, -1, 3)
        return s.of(v[0]), s.of(v[1]), json.load(open(f"{d}/r.json"))


def line(v, k): return "/".join(f"{v[z][k]:.2f}" for z in v)


if __name__ == "__main__":
    a = sys.argv[1:]
    if len(a) >= 5 and a[0] == "make":
        more = {k: float(x) for k, x in (w.split("=") for w in a[5:])}
        make(named(a[1]), *map(int, a[2].split("x")), *map(int, a[3].split("x")), a[4], **more | {"seed": int(more.get("seed", 1))})
    elif len(a) == 3 and a[0] == "walls": open(a[2], "w").write(walls(named(a[1])))
    elif len(a) >= 3 and a[0] == "score":
        one, two, report = run(named(a[1]), a[2], a[3:])
        for k in ("up", "side", "rad", "worst"): print(f"{k:6s}{line(one, k):24s} -> {line(two, k)}")
        for l in report["lamps"]: print(l["fate"], l["shape"], l.get("model"), l.get("error"), l.get("error_of_interpolation"), l.get("height", ""))
        print(f"CPU {report['cpu_s']:.1f} s")
    elif a == ["list"]:
        import kinds
        print(*FIXED, *(f"{k}:SEED" for k in ("any", "odd", *kinds.KINDS)))
    else: raise SystemExit(__doc__)
