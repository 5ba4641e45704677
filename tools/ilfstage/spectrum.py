"""From a spectrum to R, G, B as Radiance has them.

The colour matching functions are the sums of lobes of Wyman, Sloan and Shirley (2013), table 1, CIE 1931; Radiance's primaries are (.640, .330),
(.290, .600), (.150, .060) with equal energy as white; 179 lm/W.
"""
import numpy as np

from . import textfile
from .errors import Bad

WHITE_EFFICACY = 179.
LOBES = {   # height, centre nm, width below, width above
    "x": [(1.056, 599.8, 37.9, 31.0), (.362, 442.0, 16.0, 26.7), (-.065, 501.1, 20.4, 26.2)],
    "y": [(.821, 568.8, 46.9, 40.5), (.286, 530.9, 16.3, 31.1)],
    "z": [(1.217, 437.0, 11.8, 36.0), (.681, 459.0, 26.0, 13.8)],
}


def matching(nm):
    """(n, 3): x, y, z at wavelengths (n,) in nm."""
    def one(height, centre, below, above):
        t = (nm - centre) / np.where(nm < centre, below, above)
        return height * np.exp(-.5 * t * t)
    return np.stack([sum(one(*lobe) for lobe in LOBES[k]) for k in "xyz"], -1)


def to_rgb():
    """(3, 3): R, G, B of X, Y, Z."""
    xy = np.array([(.640, .330), (.290, .600), (.150, .060)])
    columns = np.stack([xy[:, 0] / xy[:, 1], np.ones(3), (1 - xy.sum(1)) / xy[:, 1]])
    return np.linalg.inv(columns * np.linalg.solve(columns, np.ones(3)))


def rgb(nm, power):
    """R, G, B (W/sr, as Radiance counts them) of a spectrum in W/(sr nm)."""
    step = np.arange(360, 831)
    xyz = 683 * (matching(step) * np.interp(step, nm, power, 0, 0)[:, None]).sum(0)
    return to_rgb() @ xyz / WHITE_EFFICACY


def read(path):
    """R, G, B of a file with lines "nm value", blanks or a comma between; raises Bad."""
    rows = []
    for k, row, line in textfile.rows(path, ","):
        if len(row) != 2 or not np.isfinite(row).all() or row[1] < 0 or (rows and row[0] <= rows[-1][0]):
            raise Bad(f"{path}: line {k}: expected a wavelength (nm, rising) and a value of 0 or more, found '{line.strip()[:40]}'")
        rows.append(row)
    if len(rows) < 2:
        raise Bad(f"{path}: expected a spectrum of two wavelengths or more, found {len(rows)}")
    nm, power = np.array(rows).T
    found = rgb(nm, power)
    if np.abs(found).max() == 0:
        raise Bad(f"{path}: expected some visible light, found none")
    return found
