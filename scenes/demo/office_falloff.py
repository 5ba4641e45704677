"""The office lens's falloff polynomial as a falloff file.

The calibration gives V(r) = 1 + sum c_k r^k with r = 1 at the edge of an equidistant picture, which is
`--edge` degrees from the axis; fishremap wants lines "degrees R G B" of the relative brightness.

usage: office_falloff.py vignetting.json --aperture f5.6 --edge 93 -o FALLOFF
"""
import argparse
import json
import os
import sys


def main():
    ap = argparse.ArgumentParser(description="falloff polynomial to falloff file")
    ap.add_argument("calibration", help="vignetting.json")
    ap.add_argument("--aperture", default="f5.6", help="which of its polynomials (f5.6)")
    ap.add_argument("--edge", type=float, default=93.0, help="degrees from the axis where r = 1 (93)")
    ap.add_argument("-o", "--output", required=True)
    a = ap.parse_args()
    try:
        with open(a.calibration) as f:
            known = json.load(f)
        terms = {int(k): float(c) for k, c in known[a.aperture].items()}
    except (OSError, ValueError, KeyError, AttributeError) as err:
        print(f"office_falloff.py: {a.calibration}: expected a polynomial named {a.aperture}, found {err!r}", file=sys.stderr)
        return 1
    tmp = f"{a.output}.{os.getpid()}.tmp"
    with open(tmp, "w") as out:
        out.write(f"# degrees R G B: relative brightness, {known.get('lens', 'lens')}, {a.aperture}\n")
        for degrees in [*range(0, int(a.edge), 3), a.edge]:
            v = 1 + sum(c * (degrees / a.edge) ** k for k, c in terms.items())
            out.write(f"{degrees:g} {v:.6f} {v:.6f} {v:.6f}\n")
    os.replace(tmp, a.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
