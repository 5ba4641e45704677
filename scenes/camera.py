"""Develops a rendered picture into the exposures that a digital camera would take of it.

The camera is virtualcamera's (its manual page has the same equations), for pictures that are no fisheye view:

    H = L t / R            relative exposure: radiance L, seconds t, radiance R that saturates in 1 s
    q ~ Poisson(F H) + E Normal                    electrons: full well F, read noise E
    code = round((2^8 - 1) s(clip(q / F)))         s: the sRGB curve

usage: camera.py --seconds T --seconds T ... [options] -o FOLDER IN.hdr
FOLDER gets e00.png, e01.png, ... and times.txt, which hdrgen --times reads.
"""
import argparse
import os
import sys
from fractions import Fraction

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pictures  # noqa: E402


def srgb(x):
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055)


def develop(radiance, seconds, full_scale, electrons, read_noise, rng):
    """Codes 0..255 (uint8) of one exposure."""
    mean = np.minimum(radiance * (seconds / full_scale), 4.0) * electrons    # far beyond saturation all is one
    q = rng.poisson(mean) + read_noise * rng.standard_normal(mean.shape)
    return np.rint(255.0 * srgb(np.clip(q / electrons, 0.0, 1.0))).astype(np.uint8)


def seconds(text):
    try:
        t = float(Fraction(text))
    except (ValueError, ZeroDivisionError):
        t = 0.0
    if not 0 < t < 1e6:
        raise argparse.ArgumentTypeError(f"expected seconds such as 2 or 1/60, found {text}")
    return t


def main():
    ap = argparse.ArgumentParser(description="develop a rendered picture into exposures")
    ap.add_argument("--seconds", type=seconds, action="append", required=True, help="exposure time; again for each")
    ap.add_argument("--full-scale", type=float, default=1.0, help="radiance that saturates in 1 s (1)")
    ap.add_argument("--electrons", type=float, default=20000.0, help="full well (20000)")
    ap.add_argument("--read-noise", type=float, default=8.0, help="electrons rms (8)")
    ap.add_argument("--seed", type=int, default=1, help="of the noise (1)")
    ap.add_argument("-o", "--output", required=True, metavar="FOLDER")
    ap.add_argument("picture")
    a = ap.parse_args()
    if not (a.full_scale > 0 and a.electrons > 0 and a.read_noise >= 0 and a.seed >= 0):
        ap.error("expected a positive full scale and full well, and read noise and seed of 0 or more")
    from PIL import Image
    try:
        radiance = pictures.read(a.picture)
        if not (np.isfinite(radiance).all() and (radiance >= 0).all()):
            raise pictures.PictureError(f"{a.picture}: expected finite radiance, found NaN, infinity or negative values")
        os.makedirs(a.output, exist_ok=True)
        lines = []
        for k, t in enumerate(a.seconds):
            name = f"e{k:02d}.png"
            code = develop(radiance, t, a.full_scale, a.electrons, a.read_noise, np.random.default_rng([a.seed, k]))
            Image.fromarray(code).save(os.path.join(a.output, name))
            lines.append(f"{name} {t!r}\n")
        tmp = os.path.join(a.output, f"times.txt.{os.getpid()}.tmp")
        with open(tmp, "w") as out:
            out.writelines(lines)
        os.replace(tmp, os.path.join(a.output, "times.txt"))
    except (pictures.PictureError, OSError) as err:
        print(f"camera.py: {err}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
