"""What a light field asks for: the irradiance at the sensors, about a place in it.

Directions are the field's own texels (finer where those are coarse), each with its solid angle, so that without depth correction the sum is that
over the probes themselves.  A lamp that was taken out of the field (version 2) is small: the cone about it is summed by itself.  What the field
knows nothing of, light from below its plane, counts as none.
"""
import numpy as np
from scipy.spatial import cKDTree

import ilf

from . import radiance
from .errors import Bad
from .matrix import bins

ROWS = 64           # as finely as this at least, from the pole to the lower edge
CONE = 24           # a lamp's cone has CONE x CONE rays
POINTS = 24         # of a mesh, points from which the field is looked at: its samples are gathered into as many
FAR = 1e9


def texels(field):
    """(directions (n, 3), solid angles (n,)) of the hemisphere, in the field's scene axes."""
    i = field.info
    k = min(16, -(-ROWS // i.n_phi))
    n_theta, n_phi = i.n_theta * k, i.n_phi * k
    phi = np.arange(n_phi + 1) * (i.polar_max / n_phi)
    theta, middle = -np.pi + (np.arange(n_theta) + .5) * (2 * np.pi / n_theta), (phi[:-1] + phi[1:])[:, None] / 2
    own = np.stack(np.broadcast_arrays(np.sin(middle) * np.cos(theta), np.sin(middle) * np.sin(theta), np.cos(middle)), -1).reshape(-1, 3)
    solid = np.repeat((np.cos(phi[:-1]) - np.cos(phi[1:])) * (2 * np.pi / n_theta), n_theta)
    up = own[:, 2] > 0
    return own[up] @ field.frame.axes, solid[up]


def gathered(points, most):
    """(places (p, 3), which of them each point belongs to): points themselves where they are few, else the means of cells."""
    places, which = np.unique(points, axis=0, return_inverse=True)
    if len(places) <= 1000 and most is None:
        return places, which.ravel()
    low, cells = points.min(0), 16
    while True:
        step = max(np.ptp(points, axis=0).max(), 1e-9) / cells
        _, which = np.unique(((points - low) / step).astype(int), axis=0, return_inverse=True)
        which = which.ravel()
        if which.max() < most or cells == 1:
            return np.stack([points[which == k].mean(0) for k in range(which.max() + 1)]), which
        cells -= 1


def cones(field, at):
    """For each lamp, as seen from points (p, 3): rays (p, m, 3), solid angle of each (p,), axis (p, 3), cosine (p,)."""
    u = (np.arange(CONE) + .5) / CONE
    s, angle = np.repeat(u, CONE)[:, None], 2 * np.pi * np.tile(u, CONE)[:, None]
    for lamp in field.lamps:
        to = field.frame.to_scene(lamp.centre) - at
        far = np.linalg.norm(to, axis=1)
        sine = np.minimum(lamp.extent / far, 1)
        cosine, axis = np.sqrt(1 - sine * sine), to / far[:, None]
        a = np.cross(np.where(np.abs(axis[:, 2:]) < .9, [0, 0, 1.], [1., 0, 0]), axis)
        a /= np.linalg.norm(a, axis=1, keepdims=True)
        z = 1 - s * (1 - cosine[:, None, None])
        d = z * axis[:, None] + np.sqrt(1 - z * z) * (np.cos(angle) * a[:, None] + np.sin(angle) * np.cross(axis, a)[:, None])
        yield d, 2 * np.pi * (1 - cosine) / CONE ** 2, axis, cosine


class Target:
    """irradiance(place): (s, 3), times the match's factor and `exposure`.  unit: metres in a unit of the field; seen: what a mesh's
    points see (Matrix); geometry: octree of the field's surroundings."""

    def __init__(self, field, match, unit=1., seen=None, geometry=None, exposure=1., threads=None):
        self.field, self.match, self.unit, self.seen = field, match, unit, seen
        self.geometry, self.exposure, self.threads = geometry, exposure, threads
        self.d, self.solid = texels(field)
        self.places, self.which = gathered(match.points, POINTS if match.mesh is not None else None)
        self.normals, self.row = (match.normals, np.arange(len(match.normals))) if seen is not None else self.distinct(match.normals)
        self.tree = cKDTree(bins()) if seen is not None else None
        self.turned, self.kernel = None, None

    @staticmethod
    def distinct(normals):
        n, row = np.unique(normals, axis=0, return_inverse=True)
        return n, row.ravel()

    def lobes(self, d, turn, rows=slice(None)):
        """(normals, directions): cosine where above 0 and not hidden by the mesh."""
        k = np.maximum((self.normals[rows] @ turn).astype(np.float32) @ d.T.astype(np.float32), 0)
        if self.seen is not None:
            k *= self.seen[rows][:, self.tree.query(d @ turn.T)[1]]
        return k

    def hits(self, o, d):
        """Where rays meet the surroundings, by rtrace; None without any."""
        if self.geometry is None:
            return None
        o, d = np.broadcast_arrays(o, d)
        out = radiance.run("rtrace", "-h", "-w", "-fdf", "-oL", "-ab", 0, "-di", 0, self.geometry, data=radiance.rays(o, d))
        far = np.frombuffer(out, np.float32).astype(float).reshape(*o.shape[:-1], 1)
        return np.where(far < FAR, o + far * d, np.inf)

    def look(self, o, d):
        try:
            return self.field.eval(o, d, self.hits(o, d), threads=self.threads)
        except ilf.Error as e:
            raise Bad(str(e)) from None

    def lamps(self, at, turn, outside):
        """Light of the cones about lamps, (s, 3); marks in `outside` (p, n) the texels that none of them holds."""
        E, before = np.zeros((len(self.which), 3)), []
        for d, solid, axis, cosine in cones(self.field, at):
            outside &= axis @ self.d.T <= cosine[:, None]
            L = self.look(at[:, None], d) * solid[:, None, None]
            for a, c in before:
                L[np.einsum("pmk,pk->pm", d, a) > c[:, None]] = 0      # a direction counts in one cone only
            before.append((axis, cosine))
            for p in range(len(at)):
                mine = np.flatnonzero(self.which == p)
                E[mine] += self.lobes(d[p], turn, self.row[mine]) @ L[p]
        return E

    def irradiance(self, place):
        """(s, 3)."""
        turn = place.turn
        if self.turned is None or not np.array_equal(turn, self.turned):
            self.turned, self.kernel = turn, self.lobes(self.d, turn)
        at = place.at + self.places @ turn / self.unit
        outside = np.ones((len(at), len(self.d)), bool)
        E = self.lamps(at, turn, outside) if self.field.lamps else np.zeros((len(self.which), 3))
        L = self.look(at[:, None], self.d[None]) * (self.solid * outside)[..., None].astype(np.float32)
        for p in range(len(at)):
            mine = np.flatnonzero(self.which == p)
            part = self.kernel @ L[p] if len(mine) == len(self.kernel) else self.kernel[self.row[mine]] @ L[p]
            E[mine] += part[self.row[mine]] if len(mine) == len(self.kernel) else part
        return E * self.match.factor * self.exposure
