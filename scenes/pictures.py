"""Reads pictures for the reports: Radiance .hdr/.pic, OpenEXR and ordinary photographs.

Everything comes back as float64 arrays (rows, columns, 3), top row first, linear radiance (photographs:
display values in 0..1, so only to be shown, never compared).
"""
import numpy as np


class PictureError(Exception):
    """One line that names the file, what was expected and what was found."""


def read_radiance(path):
    """A Radiance RGBE picture, standard orientation (-Y rows +X columns), flat or run-length coded."""
    with open(path, "rb") as f:
        data = f.read()
    end = data.find(b"\n\n")
    if not data.startswith(b"#?") or end < 0:
        raise PictureError(f"{path}: expected a Radiance picture, found no #? header")
    header = data[:end]
    if b"32-bit_rle_xyze" in header:
        raise PictureError(f"{path}: expected 32-bit_rle_rgbe, found XYZE")
    eol = data.find(b"\n", end + 2)
    size = data[end + 2:eol].split()
    if len(size) != 4 or size[0] != b"-Y" or size[2] != b"+X":
        raise PictureError(f"{path}: expected a size line -Y rows +X columns, found {data[end + 2:eol]!r}")
    rows, cols = int(size[1]), int(size[3])
    exposure = 1.0
    for line in header.split(b"\n"):
        if line.startswith(b"EXPOSURE="):
            exposure *= float(line[9:])
    rgbe = np.zeros((rows, cols, 4), np.uint8)
    p = eol + 1
    try:
        for y in range(rows):
            if data[p] == 2 and data[p + 1] == 2 and data[p + 2] < 128 and 8 <= cols < 32768:
                p += 4
                for c in range(4):
                    x = 0
                    while x < cols:
                        n = data[p]
                        if n > 128:
                            rgbe[y, x:x + n - 128, c] = data[p + 1]
                            x, p = x + n - 128, p + 2
                        else:
                            rgbe[y, x:x + n, c] = np.frombuffer(data, np.uint8, n, p + 1)
                            x, p = x + n, p + 1 + n
            else:
                rgbe[y] = np.frombuffer(data, np.uint8, 4 * cols, p).reshape(cols, 4)
                p += 4 * cols
    except (IndexError, ValueError) as err:
        raise PictureError(f"{path}: expected {rows} whole rows, found the end in row {y}") from err
    e = rgbe[..., 3].astype(int)
    scale = np.where(e > 0, np.ldexp(1.0, e - 136), 0.0) / exposure
    return (rgbe[..., :3] + 0.5) * scale[..., None]


def read_exr(path):
    import OpenEXR
    with OpenEXR.File(str(path)) as f:
        channels = f.parts[0].channels
        if "RGB" in channels:
            a = channels["RGB"].pixels
        elif "RGBA" in channels:
            a = channels["RGBA"].pixels[..., :3]
        elif all(c in channels for c in "RGB"):
            a = np.stack([channels[c].pixels for c in "RGB"], -1)
        else:
            raise PictureError(f"{path}: expected channels R, G, B, found {', '.join(channels)}")
        return np.asarray(a, float)


def read_photograph(path):
    from PIL import Image
    with Image.open(path) as im:
        return np.asarray(im.convert("RGB"), float) / 255.0


def read(path):
    """Any of them, by the name's ending; .hdr, .pic and .exr are linear."""
    low = str(path).lower()
    try:
        if low.endswith((".hdr", ".pic")):
            return read_radiance(path)
        if low.endswith(".exr"):
            return read_exr(path)
        return read_photograph(path)
    except OSError as err:
        raise PictureError(f"{path}: {err.strerror or err}") from err


def is_linear(path):
    return str(path).lower().endswith((".hdr", ".pic", ".exr"))
