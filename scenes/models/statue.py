"""Owns the shape of the statue: a draped, caryatid-like figure, written as a Wavefront .obj.

The figure is the zero set of a signed distance-like function f(x, y, z) in metres, z up, the foot of
its base at z = 0, its face towards -y.  Parts (ellipsoids, cones with round ends, a pleated skirt) are
joined with the polynomial smooth minimum

    smin(a, b; k) = min(a, b) - k/4 max(k - |a - b|, 0)^2 / k^2 ,

and the surface is taken out of a regular grid with naive surface nets: one vertex in each cell that
the surface crosses, at the mean of the crossings on the cell's edges, and one quadrilateral around
each crossed grid edge.  Vertices are then pulled on to f = 0 along the gradient, which also is the
vertex normal.

usage: statue.py [--height METRES] [--cells N] -o OUT.obj
"""
import argparse
import os
import sys

import numpy as np


def smin(a, b, k):
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - 0.25 * k * h * h


def ellipsoid(p, centre, radii):
    q = (p - centre) / radii
    k0 = np.sqrt((q * q).sum(-1))
    k1 = np.sqrt(((q / radii) ** 2).sum(-1))
    return k0 * (k0 - 1.0) / np.maximum(k1, 1e-9)


def round_cone(p, a, b, ra, rb):
    """Capsule from a to b whose radius goes linearly from ra to rb."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    ab = b - a
    t = np.clip(((p - a) @ ab) / (ab @ ab), 0.0, 1.0)
    return np.linalg.norm(p - (a + t[..., None] * ab), axis=-1) - (ra + t * (rb - ra))


def box(p, centre, half, r):
    q = np.abs(p - centre) - (np.asarray(half) - r)
    return np.linalg.norm(np.maximum(q, 0.0), axis=-1) + np.minimum(q.max(-1), 0.0) - r


def figure(p):
    """The figure at height 1 (before scaling)."""
    x, y, z = p[..., 0], p[..., 1], p[..., 2]
    plinth = box(p, (0, 0, 0.03), (0.145, 0.125, 0.03), 0.006)

    # pleated skirt: an elliptic cone whose radius carries folds that fade towards the hips
    ang = np.arctan2(y, x)
    t = np.clip((z - 0.06) / 0.44, 0.0, 1.0)
    knee = 0.012 * np.exp(-((z - 0.32) / 0.09) ** 2) * np.exp(-((x - 0.035) / 0.04) ** 2) * (y < 0)
    fold = (1.0 - t) ** 0.7 * (0.0065 * np.sin(17 * ang + 3.0 * z) + 0.003 * np.sin(29 * ang - 4.0 * z))
    radius = 0.106 - 0.034 * t + fold + knee
    skirt = (np.hypot(x, y / 0.82) - radius) * 0.75
    skirt = np.maximum(skirt, np.maximum(0.055 - z, z - 0.52))

    hips = ellipsoid(p, (0, 0.004, 0.50), (0.083, 0.068, 0.075))
    overfold = np.maximum((np.hypot(x, y / 0.8) - (0.079 + 0.12 * np.maximum(0.50 - z, 0)
                           + 0.003 * np.sin(14 * ang))) * 0.8, np.maximum(0.43 - z, z - 0.60))
    waist = ellipsoid(p, (0, 0, 0.60), (0.060, 0.048, 0.085))
    chest = ellipsoid(p, (0, 0.002, 0.69), (0.076, 0.054, 0.072))
    bust = np.minimum(ellipsoid(p, (0.031, -0.034, 0.683), (0.030, 0.028, 0.029)),
                      ellipsoid(p, (-0.031, -0.034, 0.683), (0.030, 0.028, 0.029)))
    shoulders = round_cone(p, (-0.075, 0.005, 0.745), (0.075, 0.005, 0.745), 0.028, 0.028)
    body = smin(skirt, hips, 0.04)
    body = smin(body, overfold, 0.012)
    body = smin(body, waist, 0.04)
    body = smin(body, chest, 0.04)
    body = smin(body, bust, 0.02)
    body = smin(body, shoulders, 0.035)

    # right arm hangs, left arm holds a bowl before the body
    r_up = round_cone(p, (0.098, 0.006, 0.735), (0.118, 0.016, 0.60), 0.026, 0.021)
    r_lo = round_cone(p, (0.118, 0.016, 0.60), (0.112, -0.012, 0.475), 0.021, 0.014)
    r_hand = ellipsoid(p, (0.111, -0.016, 0.452), (0.013, 0.017, 0.028))
    l_up = round_cone(p, (-0.098, 0.006, 0.735), (-0.125, 0.0, 0.61), 0.026, 0.021)
    l_lo = round_cone(p, (-0.125, 0.0, 0.61), (-0.085, -0.105, 0.645), 0.021, 0.014)
    bowl = np.maximum(ellipsoid(p, (-0.075, -0.128, 0.680), (0.042, 0.042, 0.030)),
                      np.maximum(z - 0.690, -ellipsoid(p, (-0.075, -0.128, 0.692), (0.035, 0.035, 0.024))))
    for part, k in ((r_up, 0.02), (r_lo, 0.01), (r_hand, 0.012), (l_up, 0.02), (l_lo, 0.01), (bowl, 0.008)):
        body = smin(body, part, k)

    neck = round_cone(p, (0, 0.004, 0.755), (0, -0.002, 0.83), 0.029, 0.025)
    skull = ellipsoid(p, (0, 0.003, 0.885), (0.043, 0.052, 0.058))
    jaw = ellipsoid(p, (0, -0.020, 0.856), (0.030, 0.032, 0.036))
    nose = round_cone(p, (0, -0.047, 0.888), (0, -0.056, 0.868), 0.004, 0.0075)
    brow = round_cone(p, (-0.020, -0.041, 0.893), (0.020, -0.041, 0.893), 0.006, 0.006)
    lips = ellipsoid(p, (0, -0.048, 0.848), (0.012, 0.007, 0.005))
    chin = ellipsoid(p, (0, -0.043, 0.832), (0.011, 0.010, 0.009))
    head = smin(skull, jaw, 0.02)
    for part, k in ((nose, 0.010), (brow, 0.012), (lips, 0.006), (chin, 0.012)):
        head = smin(head, part, k)
    for sx in (-1, 1):                                   # eye sockets
        s = ellipsoid(p, (sx * 0.017, -0.050, 0.880), (0.009, 0.008, 0.006))
        head = -smin(-head, s, 0.008)
    wave = 0.0022 * np.sin(70 * (z + 0.35 * np.abs(x))) * (y > -0.045)
    hair = ellipsoid(p, (0, 0.012, 0.898), (0.052, 0.056, 0.058)) + wave
    hair = np.maximum(hair, -0.9 * (y + 0.031) + 0.55 * (0.915 - z))     # the hair line
    bun = ellipsoid(p, (0, 0.060, 0.862), (0.030, 0.026, 0.034)) + wave
    locks = np.minimum(round_cone(p, (0.030, 0.026, 0.83), (0.055, -0.012, 0.745), 0.012, 0.009),
                       round_cone(p, (-0.030, 0.026, 0.83), (-0.055, -0.012, 0.745), 0.012, 0.009))
    head = smin(head, hair, 0.006)
    head = smin(head, bun, 0.010)
    crown = np.maximum(np.abs(np.hypot(x, (y - 0.006) / 1.05) - 0.046) - 0.006, np.abs(z - 0.950) - 0.013) - 0.002
    body = smin(body, neck, 0.022)
    body = smin(body, locks, 0.010)
    body = smin(body, head, 0.012)
    body = smin(body, crown, 0.006)
    return smin(body, plinth, 0.008)


BOUNDS = np.array([[-0.165, -0.185, -0.02], [0.165, 0.145, 0.99]])


def gradient(f, p, h=2e-4):
    g = np.stack([f(p + h * e) - f(p - h * e) for e in np.eye(3)], -1)
    return g / np.maximum(np.linalg.norm(g, axis=-1, keepdims=True), 1e-12)


def surface_nets(f, lo, hi, step):
    """Vertices and quadrilaterals (counter-clockwise from outside) of f = 0 in the box lo..hi."""
    n = np.ceil((hi - lo) / step).astype(int) + 1
    axes = [lo[k] + step * np.arange(n[k]) for k in range(3)]
    val = np.empty(n)
    for i in range(n[0]):                                # slab by slab: memory stays small
        slab = np.stack(np.meshgrid(axes[0][i:i + 1], axes[1], axes[2], indexing="ij"), -1)
        val[i] = f(slab)[0]
    neg = val < 0
    cells = n - 1
    total = np.zeros((*cells, 3))
    count = np.zeros(cells, int)
    corners = [np.array([(c >> 2) & 1, (c >> 1) & 1, c & 1]) for c in range(8)]

    def at(a, c):
        return a[c[0]:c[0] + cells[0], c[1]:c[1] + cells[1], c[2]:c[2] + cells[2]]

    for c in corners:
        for k in range(3):
            if c[k]:
                continue
            d = c + np.eye(3, dtype=int)[k]
            va, vb = at(val, c), at(val, d)
            crossed = (va < 0) != (vb < 0)
            t = np.where(crossed, va / np.where(crossed, va - vb, 1.0), 0.0)
            pos = np.broadcast_to(c.astype(float), (*cells, 3)).copy()
            pos[..., k] += t
            total += np.where(crossed[..., None], pos, 0.0)
            count += crossed
    used = count > 0
    index = np.full(cells, -1)
    index[used] = np.arange(used.sum())
    base = np.stack(np.nonzero(used), -1)
    verts = lo + step * (base + total[used] / count[used][:, None])
    quads = []
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        sl = [slice(1, -1)] * 3
        sl[k] = slice(0, -1)
        nxt = list(sl)
        nxt[k] = slice(1, None)
        # grid edges along axis k, away from the border
        inside, outside = neg[tuple(sl)], neg[tuple(nxt)]
        e = np.stack(np.nonzero(inside != outside), -1)
        flip = outside[tuple(e.T)]
        for axis in range(3):
            if axis != k:
                e[:, axis] += 1
        ea, eb = np.eye(3, dtype=int)[a], np.eye(3, dtype=int)[b]
        q = np.stack([index[tuple((e - ea - eb).T)], index[tuple((e - eb).T)],
                      index[tuple(e.T)], index[tuple((e - ea).T)]], -1)
        q[flip] = q[flip][:, ::-1]
        quads.append(q)
    return verts, np.concatenate(quads)


def statue(height, cells):
    """Vertices (n, 3), normals (n, 3) and triangles (m, 3) of the figure, `height` metres tall."""
    lo, hi = BOUNDS
    verts, quads = surface_nets(figure, lo, hi, (hi[2] - lo[2]) / cells)
    for _ in range(3):                                   # on to the surface
        g = gradient(figure, verts)
        verts = verts - np.clip(figure(verts), -2e-3, 2e-3)[:, None] * g
    normals = gradient(figure, verts)
    verts = verts - [0, 0, verts[:, 2].min()]
    verts = np.round(verts * (height / verts[:, 2].max()), 6)      # as they will be written
    tris = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    area = np.linalg.norm(np.cross(verts[tris[:, 1]] - verts[tris[:, 0]],
                                   verts[tris[:, 2]] - verts[tris[:, 0]]), axis=1)
    return verts, normals, tris[area > 1e-9 * height * height]


def main():
    ap = argparse.ArgumentParser(description="write a statue-like triangle mesh")
    ap.add_argument("--height", type=float, default=0.30, help="metres (default 0.30)")
    ap.add_argument("--cells", type=int, default=150, help="grid cells over the height (default 150)")
    ap.add_argument("-o", "--output", required=True, help="file to write (.obj)")
    a = ap.parse_args()
    if not (a.height > 0 and 16 <= a.cells <= 1000):
        ap.error("the height must be positive and the cells from 16 to 1000")
    v, n, t = statue(a.height, a.cells)
    tmp = f"{a.output}.{os.getpid()}.tmp"
    with open(tmp, "w") as out:
        out.write(f"# statue.py --height {a.height:g} --cells {a.cells}: {len(t)} triangles\n")
        np.savetxt(out, v, "v %.6f %.6f %.6f")
        np.savetxt(out, n, "vn %.5f %.5f %.5f")
        f = t + 1
        np.savetxt(out, f[:, [0, 0, 1, 1, 2, 2]], "f %d//%d %d//%d %d//%d")
    os.replace(tmp, a.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
