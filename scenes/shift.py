"""Says how far the light in a picture lies beside the reference's, in pixels: are the two aligned?

On the table both pictures have the same geometry, so what differs is light.  With b the reference, a the picture (luminance,
clipped at white), least squares over the table's pixels of

    a - b = -dx db/dx - dy db/dy + k (d2b/dx2 + d2b/dy2) + g b + c

gives the shift (dx to the right, dy down) apart from softness k, gain g and offset c, which a light field that is
merely coarse has too.  The uncertainty is the scatter of the same fit with each eighth of the rows and each eighth of the columns left
out (jackknife).  A half-texel or half-node offset anywhere in the chain would show as a shift.

usage: shift.py --reference FILE --mask FILE --picture LABEL=FILE ... -o OUT.csv
"""
import argparse
import csv
import os
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import compare  # noqa: E402
import pictures  # noqa: E402


def inner(where, by):
    """The region without what lies within `by` pixels of its edge: there pixels may hold an object's outline."""
    keep = where.copy()
    for _ in range(by):
        p = np.pad(keep, 1)
        keep = p[1:-1, 1:-1] & p[:-2, 1:-1] & p[2:, 1:-1] & p[1:-1, :-2] & p[1:-1, 2:]
    return keep


def fit(a, b, where):
    """(dx, dy) in pixels."""
    gy, gx = np.gradient(b)
    bend = np.gradient(gy, axis=0) + np.gradient(gx, axis=1)
    columns = np.stack([-gx, -gy, bend, b, np.ones_like(b)], -1)[where]
    scale = np.sqrt((columns * columns).mean(0))
    found = np.linalg.lstsq(columns / scale, (a - b)[where], rcond=None)[0] / scale
    return found[:2]


def shift(a, b, where, parts=8):
    """(dx, dy), (uncertainty of dx, of dy)."""
    whole = fit(a, b, where)
    yy, xx = np.nonzero(where)
    left_out = []
    for at, along in ((yy, 0), (xx, 1)):
        edges = np.quantile(at, np.linspace(0, 1, parts + 1))
        for k in range(parts):
            part = where.copy()
            line = slice(int(edges[k]), int(edges[k + 1]) + (k == parts - 1))
            part[(line, slice(None)) if along == 0 else (slice(None), line)] = False
            left_out.append(fit(a, b, part) - whole)
    return whole, np.sqrt((parts - 1) / parts * (np.square(left_out).sum(0) / 2))


def main():
    ap = argparse.ArgumentParser(description="how far the light in pictures lies beside the reference's")
    ap.add_argument("--reference", required=True, metavar="FILE")
    ap.add_argument("--mask", required=True, metavar="FILE", help="red = table, as for compare.py")
    ap.add_argument("--picture", type=compare.labelled, action="append", required=True, metavar="LABEL=FILE")
    ap.add_argument("-o", "--output", required=True, metavar="CSV")
    a = ap.parse_args()
    try:
        reference, mask = compare.read_finite(a.reference), compare.read_finite(a.mask)
        if mask.shape != reference.shape:
            raise pictures.PictureError(f"{a.mask}: expected the size of {a.reference}, found another")
        where = inner(mask[..., 0] >= 0.999, 3)
        if where.sum() < 400:
            raise pictures.PictureError(f"{a.mask}: expected a table, found {where.sum()} pixels of it")
        white = 1.0 / compare.exposure_of(reference, where)
        b = np.minimum(reference @ compare.LUMINANCE, white)
        rows = []
        for label, path in a.picture:
            picture = compare.read_finite(path)
            if picture.shape != reference.shape:
                raise pictures.PictureError(f"{path}: expected the size of {a.reference}, found another")
            d, sd = shift(np.minimum(picture @ compare.LUMINANCE, white), b, where)
            rows.append([label, *(f"{x:.4f}" for x in (*d, *sd))])
    except (pictures.PictureError, OSError) as err:
        print(f"shift.py: {err}", file=sys.stderr)
        return 1

    def write(tmp):
        with open(tmp, "w", newline="") as f:
            out = csv.writer(f)
            out.writerow(["picture", "dx_px", "dy_px", "sd_dx_px", "sd_dy_px"])
            out.writerows(rows)
    compare.write_whole(a.output, write)
    return 0


if __name__ == "__main__":
    sys.exit(main())
