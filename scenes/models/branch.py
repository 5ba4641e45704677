"""Owns the shape of the branch: stem, side twigs and leaves as triangles, written as a Wavefront .obj.

The branch lies about the plane z = 0 in metres: the stem runs along +x through the origin, twigs leave it alternately to both
sides, leaves stand alternately along stem and twigs.  A leaf is folded along its midrib; its half width at the
fraction t of its length l is

    w(t) = w_max sin(pi t^0.8) ,

so it is widest a little before the middle and pointed at both ends.  Everything random comes from one generator with
the given seed.

usage: branch.py [--length M] [--leaf M] [--seed N] -o OUT.obj
"""
import argparse
import os
import sys

import numpy as np


def unit(v):
    return v / np.linalg.norm(v)


def tube(points, radii, sides=6):
    """Triangles of a tube about a polyline, open at its ends: vertices (n, 3), triangles (m, 3)."""
    points = np.asarray(points, float)
    along = np.gradient(points, axis=0)
    verts = []
    for p, a, r in zip(points, along, radii):
        a = unit(a)
        e = unit(np.cross(a, [0.0, 0.0, 1.0] if abs(a[2]) < 0.9 else [1.0, 0.0, 0.0]))
        f = np.cross(a, e)
        turn = 2 * np.pi * np.arange(sides) / sides
        verts.append(p + r * (np.cos(turn)[:, None] * e + np.sin(turn)[:, None] * f))
    k = np.arange(sides)
    tris = []
    for n in range(len(points) - 1):
        a, b = n * sides + k, n * sides + (k + 1) % sides
        tris += [np.stack([a, b, b + sides], -1), np.stack([a, b + sides, a + sides], -1)]
    return np.concatenate(verts), np.concatenate(tris)


def leaf(foot, tip, up, width, fold, steps=8):
    """Triangles of one leaf from foot to tip; its halves rise by the angle `fold` from the plane across `up`."""
    foot, tip = np.asarray(foot, float), np.asarray(tip, float)
    along = tip - foot
    side = unit(np.cross(up, along))
    up = unit(np.cross(along, side))
    t = np.linspace(0, 1, steps + 1)
    middle = foot + t[:, None] * along - 0.06 * np.linalg.norm(along) * (t * t)[:, None] * up
    out = (0.5 * width * np.sin(np.pi * t ** 0.8))[:, None]
    verts = np.concatenate([middle, middle + out * (np.cos(fold) * side + np.sin(fold) * up),
                            middle + out * (-np.cos(fold) * side + np.sin(fold) * up)])
    n, tris = steps + 1, []
    for k in range(steps):
        for edge in (n, 2 * n):
            tris += [[k, k + 1, edge + k + 1], [k, edge + k + 1, edge + k]]
    return verts, np.array(tris)


def path(rng, start, direction, length, steps, wander):
    """A polyline whose direction turns a little at each step."""
    points, d = [np.asarray(start, float)], unit(np.asarray(direction, float))
    for _ in range(steps):
        points.append(points[-1] + d * length / steps)
        d = unit(d + wander * rng.normal(size=3) * [1.0, 1.0, 0.5])
    return np.array(points)


def branch(length, leaf_length, seed):
    """Vertices (n, 3) and triangles (m, 3) of a branch `length` metres long with leaves of `leaf_length`."""
    rng = np.random.default_rng(seed)
    parts = []

    def leaves_along(points, gap, first):
        """Leaves every `gap` metres of a polyline, to its left and right in turn, and one at its end."""
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        total, at, hand = steps.sum(), first, 1
        where = np.concatenate([[0], np.cumsum(steps)])
        while at < total:
            p = np.array([np.interp(at, where, points[:, c]) for c in range(3)])
            k = min(np.searchsorted(where, at, "right"), len(points) - 1)
            a = unit(points[k] - points[k - 1])
            side = unit(np.cross([0, 0, 1.0], a)) * hand
            place_leaf(p, unit(a * rng.uniform(0.4, 0.8) + side))
            at, hand = at + gap * rng.uniform(0.8, 1.2), -hand
        place_leaf(points[-1], unit(points[-1] - points[-2]))

    def place_leaf(p, d):
        d = unit(d + [0, 0, rng.normal(0, 0.25)])
        up = unit(np.array([0, 0, 1.0]) + rng.normal(0, 0.35, 3))
        size = leaf_length * rng.uniform(0.75, 1.15)
        stalk = 0.15 * size
        parts.append(tube([p, p + d * stalk], [0.0009, 0.0007], 4))
        parts.append(leaf(p + d * stalk, p + d * (stalk + size), up, size * rng.uniform(0.5, 0.62), rng.uniform(0.1, 0.4)))

    stem = path(rng, (-length / 2, 0, 0), (1, 0, 0), length, 16, 0.05)
    parts.append(tube(stem, np.linspace(0.006, 0.002, len(stem))))
    hand = 1
    for k in range(1, len(stem) - 1):
        a = unit(stem[k + 1] - stem[k])
        side = unit(np.cross([0, 0, 1.0], a)) * hand
        reach = length * rng.uniform(0.26, 0.42) * (1.0 - 0.35 * k / len(stem))
        twig = path(rng, stem[k], a * rng.uniform(0.5, 0.9) + side, reach, 6, 0.10)
        parts.append(tube(twig, np.linspace(0.0028, 0.0012, len(twig)), 5))
        leaves_along(twig, 0.42 * leaf_length, 0.35 * leaf_length)
        hand = -hand
    place_leaf(stem[-1], unit(stem[-1] - stem[-2]))

    verts, tris, base = [], [], 0
    for v, t in parts:
        verts.append(v)
        tris.append(t + base)
        base += len(v)
    verts, tris = np.round(np.concatenate(verts), 6), np.concatenate(tris)
    p = verts[tris]
    area = 0.5 * np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    return verts, tris[area > 1e-11]                     # a leaf's two ends are points


def main():
    ap = argparse.ArgumentParser(description="write a branch with leaves as a triangle mesh")
    ap.add_argument("--length", type=float, default=0.6, help="metres (default 0.6)")
    ap.add_argument("--leaf", type=float, default=0.08, help="length of a leaf, metres (default 0.08)")
    ap.add_argument("--seed", type=int, default=1, help="of all that is random (default 1)")
    ap.add_argument("-o", "--output", required=True, help="file to write (.obj)")
    a = ap.parse_args()
    if not (a.length > 0 and 0 < a.leaf <= a.length and a.seed >= 0):
        ap.error("expected a positive length, a leaf not longer than that, and a seed of 0 or more")
    v, t = branch(a.length, a.leaf, a.seed)
    tmp = f"{a.output}.{os.getpid()}.tmp"
    with open(tmp, "w") as out:
        out.write(f"# branch.py --length {a.length:g} --leaf {a.leaf:g} --seed {a.seed}: {len(t)} triangles\n")
        np.savetxt(out, v, "v %.6f %.6f %.6f")
        np.savetxt(out, t + 1, "f %d %d %d")
    os.replace(tmp, a.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
