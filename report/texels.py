"""How far the texels of one light field are from another's: RMS difference relative to the mean.

usage: python -m report texels REFERENCE.ilf.exr FILE.ilf.exr
"""
import numpy as np

from . import fields


def main(argv):
    if len(argv) != 2:
        raise ValueError(f"expected two light fields, found {len(argv)}")
    a, b = (fields.read(f).astype(float) for f in argv)
    if a.shape != b.shape:
        raise ValueError(f"{argv[1]}: expected probes as in {argv[0]}, {a.shape}, found {b.shape}")
    print(f"texels {np.sqrt(((b - a) ** 2).mean()) / a.mean():.6g}")
    return 0
