"""Puts rendered objects into a photograph of the place: differential rendering (Debevec 1998, section 5).

Of the photograph P (the backplate, without the objects), and of two renderings of the local scene in the place's light, W with the
objects and N without them, a pixel of the composite is

    an object's           W
    the local scene's     P + (W - N)        shadows are less light, what objects reflect is more  (difference, the default)
                          P W / N            the same if the local scene's paint is not the true one: it falls out  (ratio)
                          W                  nothing differential: what the rendering of the local scene lacks is seen  (replace)
                          P                  objects without shadows  (none)
    any other             P

W, N and the mask are rendered at a multiple of the photograph's size, one ray in each pixel's middle, so that each of their pixels is one of
the three; means over the multiple's squares then make the edges, P counting with the share that is no object's.  The mask is green where
an object is and red where the local scene is.

The photograph is linear, from the camera that the renderings have.  Where its scale is another than the light field's, --gain auto
brings it there: by the median of N / P over pixels of the local scene that the objects do not change (W = N within 2 %); paint and
exposure can't be told apart by it.  That median is always said, and how far pixels are from it (median of absolute deviations).

The output is OpenEXR (float), and NAME.json beside it has the sum of what W and N cost (timed.py).

usage: composite.py --with W.hdr --without N.hdr --mask MASK.hdr [--shadow KIND] [--gain G|auto] -o OUT.exr PHOTOGRAPH.exr
"""
import argparse
import json
import os
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pictures  # noqa: E402
from compare import cost, read_finite, write_whole  # noqa: E402

KINDS = ("difference", "ratio", "replace", "none")
UNCHANGED = 0.02        # relative difference of W and N up to which the objects do not count


class CompositeError(pictures.PictureError):
    pass


def reduce(a, k):
    """Means over k x k pixels."""
    h, w = a.shape[0] // k, a.shape[1] // k
    return a.reshape(h, k, w, k, *a.shape[2:]).mean((1, 3))


def spread(a, k):
    return a.repeat(k, 0).repeat(k, 1)


def multiple(photograph, rendering, name):
    """How many rendered pixels are on a side of the photograph's."""
    (h, w), (H, W) = photograph.shape[:2], rendering.shape[:2]
    k = H // h
    if k < 1 or (H, W) != (k * h, k * w):
        raise CompositeError(f"{name}: expected a multiple of the photograph's {w} x {h} pixels, found {W} x {H}")
    return k


def layers(mask):
    """(object, local): booleans of each rendered pixel."""
    thing = mask[..., 1] > 0.5
    return thing, (mask[..., 0] > 0.5) & ~thing


def composite(p, w, n, mask, shadow="difference"):
    """The composite at the photograph's size; p is on the renderings' scale."""
    k = w.shape[0] // p.shape[0]
    thing, local = (x[..., None] for x in layers(mask))
    if shadow == "difference":
        added = reduce(np.where(thing, w, np.where(local, w - n, 0.0)), k)
        kept = reduce((~thing).astype(float), k)
    elif shadow == "ratio":
        # (means of W and N, not of their ratio: a noisy pixel does not outweigh others)
        change = reduce(np.where(local, w, 0.0), k) / np.maximum(reduce(np.where(local, n, 0.0), k), 1e-30)
        share = reduce(local.astype(float), k)
        added = reduce(np.where(thing, w, 0.0), k)
        kept = reduce((~thing & ~local).astype(float), k) + share * np.where(share > 0, change, 1.0)
    else:
        taken = thing | local if shadow == "replace" else thing
        added = reduce(np.where(taken, w, 0.0), k)
        kept = reduce((~taken).astype(float), k)
    return np.maximum(added + kept * p, 0.0)


def agreement(p, w, n, mask):
    """(factor, deviation, pixels): the median of N / P per colour where the local scene is unchanged, the relative median deviation from
    it, and how many pixels that were."""
    k = w.shape[0] // p.shape[0]
    local = reduce(layers(mask)[1].astype(float), k) == 1.0
    small_w, small_n = reduce(w, k), reduce(n, k)
    same = local & (np.abs(small_w - small_n).sum(-1) <= UNCHANGED * small_n.sum(-1)) & (p.min(-1) > 0) & (small_n.min(-1) > 0)
    if not same.any():
        return None, None, 0
    q = small_n[same] / p[same]
    factor = np.median(q, 0)
    return factor, float(np.median(np.abs(q / factor - 1.0))), int(same.sum())


def write_exr(path, a):
    import OpenEXR
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": np.ascontiguousarray(a, np.float32)}) as f:
        f.write(str(path))


def scale(a, found):
    if a.gain != "auto":
        return float(a.gain)
    if found is None:
        raise CompositeError("--gain auto: expected pixels of the local scene that the objects don't change, found none; give --gain G")
    return float(np.median(found))


def gain(text):
    try:
        if text == "auto" or 0 < float(text) < 1e30:
            return text
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(f"expected auto or a number above 0, found {text}")


def make(a):
    p, w, n, mask = (read_finite(f) for f in (a.photograph, a.with_objects, a.without, a.mask))
    if not pictures.is_linear(a.photograph):
        raise CompositeError(f"{a.photograph}: expected linear radiance (.exr, .hdr), found a photograph's codes: hdrgen merges an exposure series")
    multiple(p, w, a.with_objects)
    for name, picture in ((a.without, n), (a.mask, mask)):
        if picture.shape != w.shape:
            raise CompositeError(f"{name}: expected the size of {a.with_objects}, {w.shape[1]} x {w.shape[0]}, found {picture.shape[1]} x {picture.shape[0]}")
    if not layers(mask)[0].any():
        raise CompositeError(f"{a.mask}: expected pixels of objects (green), found none")
    factor, off, pixels = agreement(p, w, n, mask)
    g = scale(a, factor)
    if not a.quiet:
        words = "no pixel of the local scene is unchanged by the objects: its paint and the photograph's scale are not checked"
        if factor is not None:
            words = (f"the local scene as rendered is {', '.join(f'{x / g:.3f}' for x in factor)} of the photograph's (R, G, B; "
                     f"{pixels} unchanged pixels, half of them within {off:.1%})" + (f"; gain {g:.4g}" if g != 1 else ""))
        print(f"composite.py: {words}", file=sys.stderr)
    write_whole(a.output, lambda tmp: write_exr(tmp, composite(p * g, w, n, mask, a.shadow)))
    spent = [cost(f.replace(".big.", ".")) for f in ([a.with_objects] if a.shadow in ("replace", "none") else [a.with_objects, a.without])]
    if all(spent):
        log = {"command": "; ".join(s["command"] for s in spent), "cpu_s": round(sum(s["cpu_s"] for s in spent), 2)}
        write_whole(os.path.splitext(a.output)[0] + ".json", lambda tmp: open(tmp, "w").write(json.dumps(log, indent=1) + "\n"))


def main():
    ap = argparse.ArgumentParser(description="put rendered objects into a photograph by differential rendering")
    ap.add_argument("--with", dest="with_objects", required=True, metavar="FILE", help="the local scene with the objects")
    ap.add_argument("--without", required=True, metavar="FILE", help="the local scene alone")
    ap.add_argument("--mask", required=True, metavar="FILE", help="green: objects, red: the local scene")
    ap.add_argument("--shadow", choices=KINDS, default="difference", help="what becomes of the local scene's pixels (difference)")
    ap.add_argument("--gain", type=gain, default="1", metavar="G|auto", help="factor of the photograph (1)")
    ap.add_argument("--quiet", action="store_true", help="say nothing")
    ap.add_argument("-o", "--output", required=True, metavar="OUT.exr")
    ap.add_argument("photograph", help="the backplate: linear radiance")
    a = ap.parse_args()
    try:
        make(a)
    except (pictures.PictureError, OSError, ValueError) as err:
        print(f"composite.py: {err}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
