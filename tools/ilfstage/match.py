"""What shall match: points and normals about the subject.

    sphere   one point, normals spread evenly over all directions: a small ball
    volume   a grid of points in a box, a ball at each
    mesh     points of a mesh by its area, with their normals, the mesh's own shadows on them: what it reflects
"""
from dataclasses import dataclass

import numpy as np

from .errors import Bad

GOLDEN = np.pi * (3 - np.sqrt(5))


@dataclass(eq=False)
class Match:
    """Sensors.  points: (s, 3) metres from the subject's place; normals: (s, 3) unit; factor: (3,) from irradiance to what is matched, W/(sr m2) of a
    mesh; weight: (s,) of squared errors, sum 1; mesh: (vertices, triangles) or None; kind: its name."""
    kind: str
    points: np.ndarray
    normals: np.ndarray
    factor: np.ndarray
    weight: np.ndarray
    mesh: tuple | None = None


def even(n):
    """n unit vectors, spread evenly, (n, 3)."""
    z = 1 - (2 * np.arange(n) + 1) / n
    r, angle = np.sqrt(1 - z * z), np.arange(n) * GOLDEN
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], -1)


def read_obj(path):
    """(vertices (n, 3), triangles (m, 3)) of a Wavefront OBJ; raises Bad."""
    vertices, triangles = [], []
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as e:
        raise Bad(f"{path}: can't be opened: {getattr(e, 'strerror', None) or 'not a text'}") from None
    for k, line in enumerate(lines, 1):
        words = line.split()
        try:
            if words[:1] == ["v"]:
                x, y, z = map(float, words[1:4])
                vertices.append((x, y, z))
            elif words[:1] == ["f"]:
                corner = [int(w.partition("/")[0]) for w in words[1:]]
                corner = [c - 1 if c > 0 else len(vertices) + c for c in corner]
                if len(corner) < 3:
                    raise ValueError
                triangles += [(corner[0], corner[i], corner[i + 1]) for i in range(1, len(corner) - 1)]
        except ValueError:
            raise Bad(f"{path}: line {k}: expected a vertex or a face, found '{line[:40]}'") from None
    v, t = np.array(vertices, float), np.array(triangles, int)
    if not len(t) or not np.isfinite(v).all() or v.shape[1:] != (3,):
        raise Bad(f"{path}: expected a mesh of finite vertices, found {len(v)} vertices, {len(t)} triangles")
    if t.min() < 0 or t.max() >= len(v):
        raise Bad(f"{path}: expected faces of its {len(v)} vertices, found vertex {max(t.max() + 1, -t.min())}")
    return v, t


def sphere(n):
    return Match("sphere", np.zeros((n, 3)), even(n), np.ones(3), np.full(n, 1 / n))


def volume(edges, counts, n, unit):
    axes = [(np.arange(k) - (k - 1) / 2) * (e * unit / max(k - 1, 1)) for e, k in zip(edges, counts)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    s = len(points) * n
    return Match("volume", np.repeat(points, n, 0), np.tile(even(n), (len(points), 1)), np.ones(3), np.full(s, 1 / s))


def mesh(vertices, triangles, n, reflectance, unit, path="mesh"):
    """n points, one of each n-th part of the mesh's area; the same for the same mesh."""
    v = vertices * unit
    a, b, c = (v[triangles[:, k]] for k in range(3))
    cross = np.cross(b - a, c - a)
    area = np.linalg.norm(cross, axis=1) / 2
    if not area.sum() > 0:
        raise Bad(f"{path}: expected a mesh with an area, found none")
    upto = np.cumsum(area)
    rng = np.random.default_rng(1)
    k = np.minimum(np.searchsorted(upto, (np.arange(n) + rng.uniform(size=n)) / n * upto[-1]), len(area) - 1)
    r, s = np.sqrt(rng.uniform(size=n))[:, None], rng.uniform(size=n)[:, None]
    normals = cross[k] / (2 * area[k, None])
    lift = 1e-4 * np.ptp(v, axis=0).max()
    points = (1 - r) * a[k] + r * (1 - s) * b[k] + r * s * c[k] + lift * normals
    return Match("mesh", points, normals, np.asarray(reflectance, float) / np.pi, np.full(n, 1 / n), (v, triangles))


def towards(m, direction):
    """The same, with what faces away from `direction` counting a tenth."""
    d = np.asarray(direction, float)
    w = m.weight * np.where(m.normals @ (d / np.linalg.norm(d)) > 0, 1, .1)
    m.weight = w / w.sum()
    return m
