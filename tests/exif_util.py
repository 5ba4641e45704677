"""EXIF blocks of any content, and pictures that carry them: JPEG, PNG, TIFF."""
import struct

import numpy as np
from PIL import Image

from common_util import write_tiff

SIZE = {3: 2, 4: 4, 5: 8, 10: 8}
FORM = {3: "H", 4: "I", 5: "II", 10: "ii"}


def rational(x):
    """(numerator, denominator) of a positive number, to 1e-7."""
    return (round(x * 10**7), 10**7) if x < 100 else (round(x * 1000), 1000)


def directory(tags, at, more=b""):
    """An IFD at this offset, little-endian; tags: {tag: (type, values)}."""
    entries, tail = b"", b""
    tail_at = at + 2 + 12 * len(tags) + 4
    for tag in sorted(tags):
        kind, v = tags[tag]
        raw = b"".join(struct.pack("<" + FORM[kind], *(x if isinstance(x, tuple) else (x,))) for x in v)
        if len(raw) > 4:
            entries += struct.pack("<HHII", tag, kind, len(v), tail_at + len(tail))
            tail += raw
        else:
            entries += struct.pack("<HHI", tag, kind, len(v)) + raw.ljust(4, b"\0")
    return struct.pack("<H", len(tags)) + entries + struct.pack("<I", 0) + tail


def block(exif, orientation=1):
    """A TIFF of one picture's facts without the picture."""
    first = {274: (3, [orientation]), 34665: (4, [0])}
    size = len(directory(first, 8))
    first[34665] = (4, [8 + size])
    return b"II*\0" + struct.pack("<I", 8) + directory(first, 8) + directory(exif, 8 + size)


def save(path, codes, exif, orientation=1, ep=False):
    """codes: (h, w, 3) uint8; the ending decides.  ep: the facts beside the picture's own tags (TIFF/EP), TIFF only."""
    codes = np.asarray(codes, np.uint8)
    if path.suffix in (".tif", ".tiff"):
        code = {k: v for k, v in exif.items()}
        if ep:
            flat = {t: (k, [y for x in v for y in (x if isinstance(x, tuple) else (x,))]) for t, (k, v) in code.items()}
            write_tiff(path, codes, rows=codes.shape[0], orientation=orientation, more=flat)
            return
        for pointer in (0, None):
            if pointer is None:
                pointer = path.stat().st_size
            write_tiff(path, codes, rows=codes.shape[0], orientation=orientation, more={34665: (4, [pointer])})
        path.write_bytes(path.read_bytes() + directory(exif, pointer))
        return
    Image.fromarray(codes).save(path, exif=b"Exif\0\0" + block(exif, orientation), **({"quality": 95} if path.suffix == ".jpg" else {}))
