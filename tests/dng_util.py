"""DNGs as cameras might write them: mosaics of any pattern, linear and grey sensors, levels, balance, orientation."""
import struct

import numpy as np

from common_util import write_tiff

XYZ_TO_SRGB = [3.2405, -1.5371, -0.4985, -0.9693, 1.8760, 0.0416, 0.0556, -0.2040, 1.0572]
# XYZ to the camera's RGB, as a DNG states it: a sensor whose colours overlap (made up, of the usual kind)
OVERLAPPING = [0.6, -0.05, -0.08, -0.45, 1.25, 0.22, -0.08, 0.18, 0.62]
BAYER = {o: [["RGB".index(c) for c in o[:2]], ["RGB".index(c) for c in o[2:]]] for o in ("RGGB", "BGGR", "GRBG", "GBRG")}
XTRANS = [[c for c in row] for row in ("GBGGRG", "RGRBGB", "GBGGRG", "GRGGBG", "BGBRGR", "GRGGBG")]
XTRANS = [["RGB".index(c) for c in row] for row in XTRANS]


def camera_values(rgb, matrix=OVERLAPPING):
    """Linear sRGB to what such a sensor sees, balanced: grey stays grey (the DNG specification's colour matrix)."""
    m = np.reshape(matrix, (3, 3)) @ np.linalg.inv(np.reshape(XYZ_TO_SRGB, (3, 3)))
    m /= m.sum(1, keepdims=True)
    return rgb @ m.T


def mosaic_of(rgb, pattern):
    """One value per pixel of an (h, w, 3) picture."""
    p = np.array(pattern)
    h, w = rgb.shape[:2]
    c = np.tile(p, (h // p.shape[0] + 1, w // p.shape[1] + 1))[:h, :w]
    return np.take_along_axis(rgb, c[..., None], 2)[..., 0]


def write_raw(path, values, pattern=None, white=16383, black=0, black_pattern=None, seconds=1.0, f_number=8, iso=100,
              neutral=(1, 1, 1), matrix=OVERLAPPING, orientation=1, model="Test"):
    """values: (h, w) with a pattern (None: a grey sensor) or (h, w, 3): a linear DNG.  seconds None: no EXIF."""
    values = np.asarray(values)
    make = list(model.encode() + b"\0")
    more = {254: (4, [0]), 271: (2, make), 272: (2, make), 274: (3, [orientation]), 50706: (1, [1, 4, 0, 0]),
            50707: (1, [1, 1, 0, 0]), 50708: (2, make), 50717: (4, [white] * (3 if values.ndim == 3 else 1)), 50778: (3, [21])}
    if pattern is not None:
        p = np.array(pattern)
        more[33421] = (3, list(p.shape))
        more[33422] = (1, p.ravel().tolist())
    if pattern is not None or values.ndim == 3:
        more[50721] = (10, [x for v in matrix for x in (int(round(v * 10000)), 10000)])
        more[50728] = (5, [x for v in neutral for x in (int(round(v * 100000)), 100000)])
    if black_pattern is not None:
        b = np.array(black_pattern)
        more[50713] = (3, list(b.shape))
        more[50714] = (3, b.ravel().tolist())
    else:
        more[50714] = (3, [black])
    if seconds is not None:
        more[34665] = (4, [0])
    cfa = pattern is not None
    pixels = values.astype(np.uint16)
    pixels = pixels if values.ndim == 3 else pixels[:, :, None]
    exif = {33434: (5, [int(round(seconds * 1e6)), 1000000])} if seconds is not None else {}
    if f_number:
        exif[33437] = (5, [int(f_number * 10), 10])
    if iso:
        exif[34855] = (3, [iso])
    for _ in range(2 if seconds is not None else 1):  # the second time with the place of the EXIF directory
        write_tiff(path, pixels, photometric=32803 if cfa else 34892, rows=values.shape[0], more=more)
        end = path.stat().st_size
        more[34665] = (4, [end])
    if seconds is None:
        return
    at = end + 2 + 12 * len(exif) + 4
    entries = tail = b""
    for tag, (kind, v) in sorted(exif.items()):
        if kind == 3:
            entries += struct.pack("<HHII", tag, kind, 1, v[0])
        else:
            entries += struct.pack("<HHII", tag, kind, 1, at + len(tail))
            tail += struct.pack("<II", *v)
    path.write_bytes(path.read_bytes() + struct.pack("<H", len(exif)) + entries + struct.pack("<I", 0) + tail)


def shoot(camera, seconds, rng, pattern, gain, white=16383, black=512, full=15000, read=3.0):
    """One exposure of an (h, w, 3) picture in balanced camera values: the sensor's own numbers.  gain: sensor value per
    balanced value by colour (the balance's inverse); 1 in one second fills the well."""
    e = mosaic_of(camera * np.asarray(gain), pattern) if pattern is not None else camera * np.asarray(gain)
    e = np.maximum(e, 0) * seconds * full
    e = rng.poisson(np.minimum(e, 10 * full)) + rng.normal(0, read, e.shape)
    return np.clip(np.round(black + e / full * (white - black)), 0, white).astype(int)
