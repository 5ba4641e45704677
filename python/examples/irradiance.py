"""Irradiance over a light field's plane at three heights, drawn in false colour.

    irradiance.py room.ilf.exr -o irradiance.png
    irradiance.py room.ilf.exr -o irradiance.png --heights "0 .1 .3" --ball ".4 .4 0 3"

At each point the light from the plane's side falls on a surface that lies flat: E = integral of L cos(theta) over the hemisphere, here the mean of L
over directions that are spread evenly by cos(theta), times pi.  Small lamps need many directions (--samples).
"""
import argparse
import sys

import numpy as np

import ilf


def directions(frame, k, turn):
    """k x k unit vectors (k*k, 3) about the plane's normal, of density cos(theta)/pi; turn (2,) in [0, 1) shifts them within their cells."""
    a, b = (np.meshgrid(*(2 * [np.arange(k)]), indexing="ij"))
    r, angle = np.sqrt((a + turn[0]) / k), 2 * np.pi * (b + turn[1]) / k
    own = np.stack([r * np.cos(angle), r * np.sin(angle), np.sqrt(1 - r * r)], -1)
    return own.reshape(-1, 3) @ frame.axes


def on_ball(points, d, ball):
    """Where rays from points (..., 3) along unit d (..., 3) leave the ball (centre, radius) that they begin in."""
    e = points - ball[:3]
    m = (e * d).sum(-1, keepdims=True)
    return points + d * (-m + np.sqrt(m * m + ball[3] ** 2 - (e * e).sum(-1, keepdims=True)))


def irradiance(field, points, samples, ball=None, seed=1):
    """Luminous irradiance (rows, columns), lux, at points (rows, columns, 3); ball: auxiliary geometry, or None for infinitely far light."""
    k, rng = max(1, round(samples ** .5)), np.random.default_rng(seed)
    out = np.empty(points.shape[:2])
    for j, row in enumerate(points):
        d = np.stack([directions(field.frame, k, rng.uniform(size=2)) for _ in row])
        o = row[:, None]
        out[j] = ilf.luminance(field.eval(o, d, None if ball is None else on_ball(o, d, ball)).mean(1)) * np.pi
    return out


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
    ap.add_argument("--cells", type=int, default=48, metavar="N", help="points along each edge (48)")
    ap.add_argument("--samples", type=int, default=1024, metavar="N", help="directions at each point (1024)")
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
