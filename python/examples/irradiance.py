"""Irradiance over a light field's plane at three heights, drawn in false colour.

    irradiance.py room.ilf.exr -o irradiance.png
    irradiance.py room.ilf.exr -o irradiance.png --heights "0 .1 .3" --ball ".4 .4 0 3"

At each point the light from the plane's side falls on a surface that lies flat: E = integral of L cos(theta) over the hemisphere.  It is
summed over directions that are spread evenly by cos(theta) (--samples), apart from cones about the field's lamps (a file of version 2), each
of which is summed by itself: a lamp is small, and few of the others would meet it.  Without lamps taken out, what is bright may be a texel
wide, so that many directions are needed.
"""
import argparse
import sys

import numpy as np

import ilf


def cells(k, rng, n):
    """n times k x k points in the unit square, one in each of its k x k cells, (n, k*k, 2)."""
    at = np.stack(np.meshgrid(np.arange(k), np.arange(k), indexing="ij"), -1).reshape(-1, 2)
    return (at + rng.uniform(size=(n, 1, 2))) / k


def hemisphere(frame, p):
    """Unit vectors (..., 3) about the plane's normal, of density cos(theta)/pi."""
    r, angle = np.sqrt(p[..., 0]), 2 * np.pi * p[..., 1]
    return np.stack([r * np.cos(angle), r * np.sin(angle), np.sqrt(1 - r * r)], -1) @ frame.axes


def cone(axis, cosine, p):
    """Unit vectors (n, m, 3), spread evenly in cones about the axes (n, 3) with half angles of those cosines (n,)."""
    across = np.where(np.abs(axis[:, 2:]) < .9, [0, 0, 1.], [1., 0, 0])
    a = np.cross(across, axis)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    z, angle = 1 - p[..., :1] * (1 - cosine[:, None, None]), 2 * np.pi * p[..., 1:]
    return z * axis[:, None] + np.sqrt(1 - z * z) * (np.cos(angle) * a[:, None] + np.sin(angle) * np.cross(axis, a)[:, None])


def about_lamps(field, points):
    """[(axis, cosine)] of cones at points (n, 3) that hold a lamp each; a lamp that is too near has a cone of cosine 1, which holds nothing."""
    found = []
    for lamp in field.lamps:
        to = field.frame.to_scene(lamp.centre) - points
        distance = np.linalg.norm(to, axis=1)
        sine = np.minimum(lamp.extent / distance, 1)
        found.append((to / distance[:, None], np.where(sine < .99, np.sqrt(1 - sine * sine), 1)))
    return found


def inside(d, cones):
    """Which of the directions (n, m, 3) lie in one of the cones."""
    return np.any([np.einsum("nmk,nk->nm", d, axis) > cosine[:, None] for axis, cosine in cones], axis=0) if cones else np.zeros(d.shape[:2], bool)


def on_ball(points, d, ball):
    """Where rays from points (..., 3) along unit d (..., 3) leave the ball (centre, radius) that they begin in."""
    e = points - ball[:3]
    m = (e * d).sum(-1, keepdims=True)
    return points + d * (-m + np.sqrt(m * m + ball[3] ** 2 - (e * e).sum(-1, keepdims=True)))


def row_irradiance(field, points, k, ball, rng):
    """Luminous irradiance (n,), lux, at points (n, 3)."""
    cones, o = about_lamps(field, points), points[:, None]
    d = hemisphere(field.frame, cells(k, rng, len(points)))
    sets = [(d, np.where(inside(d, cones), 0, np.pi / d.shape[1]))]
    for n, (axis, cosine) in enumerate(cones):
        d = cone(axis, cosine, cells(max(4, k // 4), rng, len(points)))
        weight = 2 * np.pi * (1 - cosine[:, None]) / d.shape[1] * np.maximum(d @ field.frame.n, 0)
        sets.append((d, np.where(inside(d, cones[:n]), 0, weight)))         # a direction counts in one cone only
    return sum((w * ilf.luminance(field.eval(o, d, None if ball is None else on_ball(o, d, ball)))).sum(1) for d, w in sets)


def irradiance(field, points, samples, ball=None, seed=1):
    """Luminous irradiance (rows, columns), lux, at points (rows, columns, 3); ball: auxiliary geometry, or None for infinitely far light."""
    k, rng = max(1, round(samples ** .5)), np.random.default_rng(seed)
    return np.stack([row_irradiance(field, row, k, ball, rng) for row in points])


def draw(path, maps, heights, frame):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    fig, axes = plt.subplots(1, len(maps), figsize=(4 * len(maps) + 1, 4), layout="constrained", squeeze=False)
    for ax, e, h in zip(axes[0], maps, heights, strict=True):
        shown = ax.imshow(e, origin="lower", extent=(0, frame.len_u, 0, frame.len_v), vmin=0, vmax=np.max(maps), cmap="inferno")
        ax.set(title=f"height {h:g}: mean {e.mean():.3g} lux", xlabel="along U (scene's unit)", ylabel="along V")
    fig.colorbar(shown, ax=axes, label="irradiance (lux)")
    fig.savefig(path, dpi=110)


def numbers(n=None):
    def read(text):
        values = [float(x) for x in text.split()]
        if not values or (n and len(values) != n):
            raise argparse.ArgumentTypeError(f"expected {n or 'some'} numbers, found {text!r}")
        return values
    return read


def main():
    ap = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ap.add_argument("field", metavar="FILE.ilf.exr")
    ap.add_argument("-o", "--output", required=True, metavar="PICTURE", help="in any of matplotlib's formats")
    ap.add_argument("--heights", type=numbers(), metavar="H...", help="above the plane, scene's unit (default: 0, 1/8 and 1/4 of the longer edge)")
    ap.add_argument("--ball", type=numbers(4), metavar="X Y Z R", help="auxiliary geometry: a ball about the scene (default: infinitely far away)")
    ap.add_argument("--cells", type=int, default=32, metavar="N", help="points along each edge (32)")
    ap.add_argument("--samples", type=int, default=4096, metavar="N", help="directions at each point (4096)")
    ap.add_argument("--csv", metavar="FILE", help="the numbers, too: height, s, t, lux")
    a = ap.parse_args()
    try:
        with ilf.open(a.field) as field:
            frame = field.frame
            heights = a.heights or [k / 8 * max(frame.len_u, frame.len_v) for k in (0, 1, 2)]
            s = (np.arange(a.cells) + .5) / a.cells
            maps = [irradiance(field, frame.at(s[None, :], s[:, None], h), a.samples, a.ball) for h in heights]
        draw(a.output, maps, heights, frame)
    except (ilf.Error, OSError) as e:
        print(f"irradiance.py: {e}", file=sys.stderr)
        return 1
    if a.csv:
        t, u = np.meshgrid(s, s, indexing="ij")
        rows = np.concatenate([np.stack([np.full(e.size, h), u.ravel(), t.ravel(), e.ravel()], 1) for h, e in zip(heights, maps, strict=True)])
        np.savetxt(a.csv, rows, delimiter=",", header="height,s,t,lux", comments="", fmt="%.9g")
    return 0


if __name__ == "__main__":
    sys.exit(main())
