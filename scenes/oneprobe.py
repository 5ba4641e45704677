"""Cuts one probe out of a light field, with what its header says of its polar angles, for ilfpack to make a field of it alone.

usage: oneprobe.py --node I_J -o PROBE.exr FIELD.ilf.exr      (tile (i, j) is the probe at grid node (i, j))
"""
import argparse
import os
import sys


def cut(field, i, j):
    """Pixels (rows, columns, 3) of probe (i, j), and the header entries that go with it."""
    import OpenEXR
    with OpenEXR.File(field) as f:
        header, channels = f.parts[0].header, f.parts[0].channels
        if header.get("ilf:version", 1) != 1:
            raise ValueError(f"{field}: ilf:version: expected 1, found {header['ilf:version']} (ilflamps --compose writes 1)")
        pixels = channels["RGB"].pixels
        tile = header["tiles"]
        w, h = tile.xSize, tile.ySize
        nu, nv = pixels.shape[1] // w, pixels.shape[0] // h
        if not (0 <= i < nu and 0 <= j < nv):
            raise ValueError(f"{field}: expected a node of {nu} x {nv}, found {i}_{j}")
        keep = {k: header[k] for k in ("ilf:polarMax", "ilf:polarValid") if k in header}
        return pixels[j * h:(j + 1) * h, i * w:(i + 1) * w].copy(), keep


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
