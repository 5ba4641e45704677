"""Light fields made coarser: every n-th probe, probes shrunk with a box filter.

Reads a light field (docs/FORMAT.md, section 1) and writes its probes again for ilfpack.  A shrunk texel is the mean of those
that it covers, weighted with their solid angles.

usage: python -m report coarser --every N --shrink K -o FOLDER FILE.ilf.exr
Writes FOLDER/p_JJ_II.exr; N must divide the number of intervals of the grid, K the probes' size.  --only I,J keeps one probe.
"""
import argparse
from pathlib import Path

import ilf
import numpy as np

from .probes import write_exr


def read(path):
    """probes (n_v, n_u, n_phi, n_theta, 3)."""
    with ilf.open(path) as f:
        if f.info.version != 1:
            raise ValueError(f"{path}: ilf:version: expected 1, found {f.info.version}")
        return f.probes().astype(np.float32)


def shrink(probes, k):
    """Probes (..., n_phi, n_theta, 3) of a hemisphere, k x k texels to one."""
    n_phi, n_theta = probes.shape[-3:-1]
    if n_phi % k or n_theta % k:
        raise ValueError(f"expected a factor that divides {n_theta}x{n_phi}, found {k}")
    edge = np.linspace(0, np.pi / 2, n_phi + 1)
    w = (np.cos(edge[:-1]) - np.cos(edge[1:]))[:, None, None]
    blocks = (*probes.shape[:-3], n_phi // k, k, n_theta // k, k, 3)
    total = (probes * w).reshape(blocks).sum((-4, -2))
    return total / (w.reshape(n_phi // k, k).sum(1) * k)[:, None, None]


def coarser(probes, every, factor):
    n_v, n_u = probes.shape[:2]
    if (n_u - 1) % every or (n_v - 1) % every:
        raise ValueError(f"expected a step that divides the {n_u - 1}x{n_v - 1} intervals, found {every}")
    return shrink(probes[::every, ::every].astype(float), factor)


def main(argv):
    ap = argparse.ArgumentParser(prog="report coarser", description="probes of a light field, fewer or smaller")
    ap.add_argument("--every", type=int, default=1, metavar="N", help="every N-th probe along u and v")
    ap.add_argument("--shrink", type=int, default=1, metavar="K", help="K x K texels become one")
    ap.add_argument("--only", metavar="I,J", help="one probe")
    ap.add_argument("-o", "--output", required=True, metavar="FOLDER")
    ap.add_argument("file")
    a = ap.parse_args(argv)
    found = read(a.file)
    if a.only:
        i, j = map(int, a.only.split(","))
        found = found[j:j + 1, i:i + 1]
    found = coarser(found, a.every, a.shrink)
    folder = Path(a.output)
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("p_*.exr"):
        old.unlink()
    for j, row in enumerate(found):
        for i, image in enumerate(row):
            write_exr(folder / f"p_{j:02d}_{i:02d}.exr", image)
    return 0
