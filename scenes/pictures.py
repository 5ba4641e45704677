"""Reads pictures for the reports: Radiance .hdr/.pic, OpenEXR and ordinary photographs.

Everything comes back as float64 arrays (rows, columns, 3), top row first, linear radiance (photographs:
display values in 0..1, so only to be shown, never compared).
"""
import numpy as np

import rgbe


class PictureError(Exception):
    """One line that names the file, what was expected and what was found."""


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
            return rgbe.radiance(path)
        if low.endswith(".exr"):
            return read_exr(path)
        return read_photograph(path)
    except rgbe.RgbeError as err:
        raise PictureError(str(err)) from err
    except OSError as err:
        raise PictureError(f"{path}: {err.strerror or err}") from err


def is_linear(path):
    return str(path).lower().endswith((".hdr", ".pic", ".exr"))
