"""Cuts one probe out of a light field, with what its header says of its polar angles, for ilfpack to make a field of it alone.

usage: oneprobe.py --node I_J -o PROBE.exr FIELD.ilf.exr      (tile (i, j) is the probe at grid node (i, j))
"""
import argparse
import os
import sys

import numpy as np


def cut(field, i, j):
    """Pixels (rows, columns, 3) of probe (i, j), and the header entries that go with it."""
    import ilf
    with ilf.open(field) as f:
        info = f.info
        if info.version != 1:
            raise ValueError(f"{field}: ilf:version: expected 1, found {info.version} (ilflamps --compose writes 1)")
        if not (0 <= i < info.n_u and 0 <= j < info.n_v):
            raise ValueError(f"{field}: expected a node of {info.n_u} x {info.n_v}, found {i}_{j}")
        keep = {"ilf:polarMax": info.polar_max}
        if info.polar_valid < info.polar_max:
            keep["ilf:polarValid"] = info.polar_valid
        return np.ascontiguousarray(f.probe(i, j)), keep


def main():
    ap = argparse.ArgumentParser(description="cut one probe out of a light field")
    ap.add_argument("--node", required=True, metavar="I_J", help="grid node, I along u, J along v")
    ap.add_argument("-o", "--output", required=True, metavar="PROBE.exr")
    ap.add_argument("field")
    a = ap.parse_args()
    import OpenEXR
    tmp = f"{a.output}.{os.getpid()}.tmp.exr"
    try:
        i, j = (int(x) for x in a.node.split("_"))
        pixels, header = cut(a.field, i, j)
        header.update(compression=OpenEXR.ZIP_COMPRESSION, type=OpenEXR.scanlineimage)
        with OpenEXR.File(header, {"RGB": pixels}) as f:
            f.write(tmp)
        os.replace(tmp, a.output)
    except (ValueError, OSError, RuntimeError) as err:
        print(f"oneprobe.py: {err}", file=sys.stderr)
        return 1
    finally:
        if os.path.exists(tmp):
            os.unlink(tmp)
    return 0


if __name__ == "__main__":
    sys.exit(main())
