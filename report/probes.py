"""Light probes without a camera: what a light field would hold if the capture made no error at all.

Each texel of a latitude/longitude map (docs/FORMAT.md, section 1.2: row y is the polar angle, column x the azimuth) is the mean radiance
over its solid angle, from rays traced through the scene from the probe's place on the plane.  A texel gets K x K rays at
the middles of its parts; where the brightness about it differs by more than half of the probe's mean (the
edge of a lamp) R x R.  A lamp must be wider than the K x K rays are apart, or it may be missed.

usage: python -m report probes --octree FILE --plane "O U V" --grid NxM --size WxH -o FOLDER
Writes FOLDER/p_JJ_II.exr (float) for node (I, J), so that FOLDER/p_*.exr come in ilfpack's order.
"""
import argparse
import os
import shlex
import subprocess
from pathlib import Path

import numpy as np

LUMINANCE = np.array([0.265, 0.670, 0.065])
BATCH = 1 << 20     # rays traced at a time; bounds memory


def frame(plane):
    """Origin, U, V and the rows u^, v^, n^."""
    o, u, v = np.asarray(plane, float).reshape(3, 3)
    a, b = u / np.linalg.norm(u), v / np.linalg.norm(v)
    return o, u, v, np.stack([a, b, np.cross(a, b)])


def places(plane, n_u, n_v, jitter=0.0, seed=1):
    """(n_v, n_u, 3) nodes; jitter is the standard deviation of an error along u and along v, in the scene's unit."""
    o, u, v, f = frame(plane)
    s = np.linspace(0, 1, n_u) if n_u > 1 else np.array([0.5])
    t = np.linspace(0, 1, n_v) if n_v > 1 else np.array([0.5])
    q = o + s[None, :, None] * u + t[:, None, None] * v
    if jitter:
        e = np.random.default_rng(seed).normal(scale=jitter, size=(n_v, n_u, 2))
        q = q + e @ f[:2]
    return q


def texel_rays(rows, cols, n_theta, n_phi, k):
    """Directions (texels, k*k, 3) in the plane's frame, and solid-angle weights (texels, k*k), of texels (row, column)."""
    sub = (np.arange(k) + 0.5) / k
    a, b = (x.ravel() for x in np.meshgrid(sub, sub))
    theta = (cols[:, None] + a) * (2 * np.pi / n_theta) - np.pi
    phi = (rows[:, None] + b) * (np.pi / 2 / n_phi)
    d = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], -1)
    return d, np.sin(phi)


def busy(image):
    """Texels about which the luminance differs by more than half of the probe's mean; columns wrap."""
    lum = image @ LUMINANCE
    p = np.pad(np.pad(lum, ((0, 0), (1, 1)), mode="wrap"), ((1, 1), (0, 0)), mode="edge")
    h, w = lum.shape
    around = np.stack([p[y:y + h, x:x + w] for y in range(3) for x in range(3)])
    return np.ptp(around, 0) > 0.5 * lum.mean()


def trace(octree, options, origin, directions):
    """Radiance (rays, 3) by rtrace."""
    rays = np.empty((len(directions), 6), "<f4")
    rays[:, :3], rays[:, 3:] = origin, directions
    p = subprocess.run(["rtrace", "-h", "-fff", "-w", *shlex.split(options), octree], input=rays.tobytes(), stdout=subprocess.PIPE, check=True)
    out = np.frombuffer(p.stdout, "<f4").reshape(-1, 3).astype(float)
    if len(out) != len(rays) or not np.isfinite(out).all():
        raise SystemExit(f"probes: expected {len(rays)} finite radiances of rtrace, found {len(out)}")
    return out


def means(octree, options, nodes, texels, f, size, k):
    """Mean radiance of texels [(node, row, column)]: k x k rays each, a batch of texels a process."""
    out = np.empty((len(texels), 3))
    step = max(1, BATCH // (k * k))
    for at in range(0, len(texels), step):
        n, y, x = texels[at:at + step].T
        d, w = texel_rays(y, x, *size, k)
        q = np.repeat(nodes[n], k * k, 0)
        value = trace(octree, options, q, d.reshape(-1, 3) @ f).reshape(len(n), k * k, 3)
        out[at:at + step] = (value * w[..., None]).sum(1) / w.sum(1)[:, None]
    return out


def probes(octree, options, plane, nodes, size, k=2, refine=8):
    """(nodes, n_phi, n_theta, 3) for places (nodes, 3); size = (n_theta, n_phi)."""
    f = frame(plane)[3]
    shape = (len(nodes), size[1], size[0])
    every = np.argwhere(np.ones(shape, bool))
    image = means(octree, options, nodes, every, f, size, k).reshape(*shape, 3)
    if refine > k:
        again = np.argwhere(np.stack([busy(p) for p in image]))
        if len(again):
            image[tuple(again.T)] = means(octree, options, nodes, again, f, size, refine)
    return image


def write_exr(path, image):
    import OpenEXR
    part = f"{path}.{os.getpid()}.exr"
    channels = {c: np.ascontiguousarray(image[..., n], np.float32) for n, c in enumerate("RGB")}
    OpenEXR.File({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}, channels).write(part)
    os.replace(part, path)


def pair(text):
    a, x, b = text.partition("x")
    if not x or not a.isdigit() or not b.isdigit() or not int(a) or not int(b):
        raise argparse.ArgumentTypeError(f"expected NxM, found {text}")
    return int(a), int(b)


def main(argv):
    ap = argparse.ArgumentParser(prog="report probes", description="light probes by rtrace, free of a camera's errors")
    ap.add_argument("--octree", required=True)
    ap.add_argument("--plane", required=True, type=lambda s: [float(x) for x in s.split()], help="nine numbers: O U V")
    ap.add_argument("--grid", required=True, type=pair, metavar="NxM")
    ap.add_argument("--size", required=True, type=pair, metavar="WxH")
    ap.add_argument("--supersample", type=int, default=2, metavar="K", help="K x K rays a texel (2)")
    ap.add_argument("--refine", type=int, default=8, metavar="R", help="R x R rays where the brightness changes (8)")
    ap.add_argument("--jitter", type=float, default=0.0, metavar="SIGMA", help="error of the place along u and v, standard deviation")
    ap.add_argument("--seed", type=int, default=1)
    ap.add_argument("--render-options", default="", metavar="WORDS", help="for rtrace")
    ap.add_argument("-o", "--output", required=True, metavar="FOLDER")
    a = ap.parse_args(argv)
    q = places(a.plane, *a.grid, a.jitter, a.seed)
    folder = Path(a.output)
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("p_*.exr"):
        old.unlink()
    for j, row in enumerate(q):
        for i, image in enumerate(probes(a.octree, a.render_options, a.plane, row, a.size, a.supersample, a.refine)):
            write_exr(folder / f"p_{j:02d}_{i:02d}.exr", image)
    return 0
