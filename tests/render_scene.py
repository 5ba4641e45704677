"""Scenes that lighting with a light field is judged on: a room with lamps, what a probe sees of it, and objects.

A Room is light far away that depends on direction alone, ball-shaped lamps at finite places, and a card that hides
lamps from a part of the plane.  Probes are made as a camera with a box filter makes them: texels near a lamp
are sampled over their area, so that a lamp's energy does not depend on where it falls between texels.
"""
import numpy as np

from ilf_util import PI, ILF, unit

LUMINANCE = np.array([0.265, 0.670, 0.065])


class Lamp:
    def __init__(self, centre, radius, radiance):
        self.c, self.r, self.radiance = np.asarray(centre, float), float(radius), np.asarray(radiance, float)

    def seen(self, q, d):
        """Is the ball met by rays from point q in unit directions d?"""
        w = self.c - q
        dist = np.linalg.norm(w)
        return d @ (w / dist) > np.sqrt(1 - (self.r / dist) ** 2)


class Card:
    """A rectangle: its centre and two edge vectors at right angles."""

    def __init__(self, centre, edge_1, edge_2, reflectance=0.3):
        self.c, self.e1, self.e2 = (np.asarray(a, float) for a in (centre, edge_1, edge_2))
        self.n, self.reflectance = unit(np.cross(self.e1, self.e2)), reflectance

    def hides(self, q, d):
        with np.errstate(divide="ignore", invalid="ignore"):
            t = ((self.c - q) @ self.n) / (d @ self.n)
        x = q - self.c + np.where(np.isfinite(t), t, 0)[..., None] * d
        inside = (np.abs(x @ self.e1) <= self.e1 @ self.e1 / 2) & (np.abs(x @ self.e2) <= self.e2 @ self.e2 / 2)
        return inside & np.isfinite(t) & (t > 0)


def daylight(d):
    """A smooth dome, brightest overhead; luminance 0.4 to 0.7."""
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    return np.stack([0.35 + 0.25 * z + 0.15 * x, 0.40 + 0.25 * z + 0.05 * y, 0.55 + 0.30 * z - 0.10 * x], -1)


class Room:
    def __init__(self, lamps=(), card=None, base=daylight):
        self.lamps, self.card, self.base = list(lamps), card, base

    def radiance(self, q, d):
        """Seen from point q in unit directions d (..., 3)."""
        out = self.base(d)
        hidden = np.zeros(d.shape[:-1], bool) if self.card is None else self.card.hides(q, d)
        out = np.where(hidden[..., None], out * (self.card.reflectance if self.card else 1), out)
        for lamp in self.lamps:
            out = out + (lamp.seen(q, d) & ~hidden)[..., None] * lamp.radiance
        return out

    def probe(self, q, n_theta, n_phi, polar_max=PI / 2, fine=12):
        """(n_phi, n_theta, 3) from point q of a plane with n = z, u = x, v = y."""
        step_t, step_p = 2 * PI / n_theta, polar_max / n_phi

        def directions(col, row):
            t, p = col * step_t - PI, row * step_p
            return np.stack([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)], -1)
        col, row = np.meshgrid(np.arange(n_theta) + 0.5, np.arange(n_phi) + 0.5)
        centres = directions(col, row)
        out = self.radiance(q, centres)
        near = np.zeros(col.shape, bool)
        reach = np.hypot(step_t, step_p)
        for lamp in self.lamps:
            w = lamp.c - q
            dist = np.linalg.norm(w)
            near |= np.arccos(np.clip(centres @ (w / dist), -1, 1)) < np.arcsin(lamp.r / dist) + reach
        y, x = np.nonzero(near)
        sub = (np.arange(fine) + 0.5) / fine
        a, b = np.meshgrid(sub, sub)
        d = directions(x[:, None] + a.ravel(), y[:, None] + b.ravel())
        # rows of texels shrink towards the pole: weigh by solid angle
        w = np.sin((y[:, None] + b.ravel()) * step_p)
        out[y, x] = (self.radiance(q, d) * w[..., None]).sum(1) / w.sum(1)[:, None]
        return out

    def light_field(self, n_u, n_v, n_theta, n_phi, size=1.5, polar_max=PI / 2, dtype=np.float64):
        """Probes over the square of that size about the origin, in the plane z = 0."""
        f = ILF(np.zeros((n_v, n_u, 1, 1, 3)), (-size / 2, -size / 2, 0), (size, 0, 0), (0, size, 0), polar_max)
        probes = np.zeros((n_v, n_u, n_phi, n_theta, 3), dtype)
        for j in range(n_v):
            for i in range(n_u):
                q = f.node(np.array(i), np.array(j))
                probes[j, i] = np.minimum(self.probe(q, n_theta, n_phi, f.polar_max), 65504)
        f.probes = probes
        return f


# ---- the judged room: two lamps of 2 degrees, 6,000 and 9,400 times the ambient light, one half hidden -----------

def judged_room():
    card = Card((-0.75, -0.42, 1.2), (0, 0.6, 0), (0.25, 0, 0.15))
    return Room([Lamp((1.2, 0.5, 2.6), 0.050, np.array([1, 0.8, 0.5]) * 4000),
                 Lamp((-1.4, -0.8, 2.2), 0.047, np.array([0.4, 0.6, 1]) * 9000)], card)


def smooth_room():
    """Nothing above a few times the mean."""
    return Room()


def small_room():
    """For tests: lamps of 10 degrees, some hundred times the ambient light, that blind rays find often enough."""
    card = Card((-0.75, -0.42, 1.2), (0, 0.6, 0), (0.25, 0, 0.15))
    return Room([Lamp((1.2, 0.5, 2.6), 0.27, np.array([1, 0.8, 0.5]) * 60),
                 Lamp((-1.4, -0.8, 2.2), 0.22, np.array([0.4, 0.6, 1]) * 90)], card)


# ---- objects --------------------------------------------------------------------------------------------------------

def lumpy_ball(n=104, m=104):
    """Vertices and triangles (2 n m) of a closed, wavy surface about the origin, about 1 in radius."""
    s, t = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1), indexing="ij")
    r = 1 + 0.15 * np.sin(8 * PI * s) * np.sin(6 * PI * t)
    v = np.stack([r * np.sin(PI * t) * np.cos(2 * PI * s), r * np.sin(PI * t) * np.sin(2 * PI * s), 1.3 * r * np.cos(PI * t)], -1)
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    a = (i * (m + 1) + j).ravel()
    b, c = a + 1, a + m + 1
    return v.reshape(-1, 3), np.concatenate([np.stack([a, b, c + 1], -1), np.stack([a, c + 1, c], -1)])


def obj_text(vertices, triangles):
    a, b, c = (np.round(vertices, 6)[triangles[:, k]] for k in range(3))
    triangles = triangles[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0]     # none without area, at the poles
    return "".join(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in vertices) + "".join(
        f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in triangles)


MATERIALS = """
void plastic stone 0 0 5 .65 .6 .5 0 0
void plastic white 0 0 5 .6 .6 .6 0 0
void plastic red 0 0 5 .6 .2 .15 0 0
void metal mirror_metal 0 0 5 .9 .9 .9 1 0
void metal glossy_metal 0 0 5 .8 .7 .5 1 .1
"""


def polygon(mod, name, *corners):
    c = np.asarray(corners, float)
    return f"\n{mod} polygon {name} 0 0 {c.size} " + " ".join(f"{x:.9g}" for x in c.ravel()) + "\n"


def box(mod, name, size, turn=0.0, at=(0, 0, 0), inward=False):
    """Six polygons: a box with one corner at the origin, turned about z by degrees, then moved."""
    x, y, z = size
    c = np.array([(i * x, j * y, k * z) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    w = np.deg2rad(turn)
    c = c @ np.array([[np.cos(w), np.sin(w), 0], [-np.sin(w), np.cos(w), 0], [0, 0, 1]]) + at
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return "".join(polygon(mod, f"{name}{k}", *c[list(f[::-1] if inward else f)]) for k, f in enumerate(faces))


def sphere(mod, name, centre, radius, kind="sphere"):
    x, y, z = centre
    return f"\n{mod} {kind} {name} 0 0 4 {x:.9g} {y:.9g} {z:.9g} {radius:.9g}\n"


GROUND = polygon("white", "ground", (-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
MIRROR_BALL = sphere("mirror_metal", "mirror_ball", (0.35, -0.1, 0.15), 0.15)
BALLS = MIRROR_BALL + sphere("glossy_metal", "glossy_ball", (-0.05, -0.35, 0.12), 0.12)
BOXES = box("red", "low_box", (0.25, 0.25, 0.35), 20, (-0.3, 0.1, 0)) + box("white", "high_box", (0.2, 0.2, 0.5), -15, (0.15, 0.35, 0))
BLOB = "\nstone mesh blob 7 blob.rtm -s .15 -t -.45 -.4 .2 0 0\n"
VIEW = "-vtv -vp 0 -2.2 1.3 -vd 0 .85 -.5 -vu 0 0 1 -vh 38 -vv 38".split()


def ilf_material(file, depth=True, name="env"):
    return f"\nvoid ilf {name} {1 if depth else 2} {file} {'' if depth else 'nodepth'} 0 0\n"


def far_dome(file):
    """The light field without depth correction, on a large sphere."""
    return ilf_material(file, False) + sphere("env", "dome", (0, 0, 0), 12, "bubble")


def true_box(file):
    """With it, on a box about the size of the room."""
    return ilf_material(file) + box("env", "walls", (6, 6, 2.9), 0, (-3, -3, -0.1), inward=True)


def judged_objects(mesh=True, balls=True):
    return MATERIALS + GROUND + BOXES + (BALLS if balls else "") + (BLOB if mesh else "")
