"""Incident light fields: open, look up, write.

    import numpy as np
    import ilf

    with ilf.open("room.ilf.exr") as field:
        print(field.info.n_u, field.info.n_v, field.frame.origin)
        up = field.eval(field.nodes(), field.frame.n)           # (n_v, n_u, 3): radiance straight from above
        first = field.probe(0, 0)                               # (n_phi, n_theta, 3), where it lies in the file

Lengths are in the scene's unit, angles in radians, radiance in W/(sr m^2) for each of R, G, B (luminance: `luminance`).  Arrays of points and
directions have x, y, z in their last axis.  What libilf refuses is an `Error` whose text is one line.  docs/FORMAT.md of the project says what a
file means; the library is libilf (`library_path`).
"""
import os

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import ArgumentError, ChangedError, Error, FileError, FormatError, OutOfMemory, TexelError
from ._field import Field, Info, Usage
from ._frame import Frame
from ._lamps import Lamp, Mask
from ._library import path as _path
from ._write import write

__version__ = "0.1.0"
__all__ = ["open", "write", "luminance", "library_path", "Field", "Info", "Usage", "Frame", "Lamp", "Mask",
           "Error", "FileError", "FormatError", "TexelError", "ArgumentError", "OutOfMemory", "ChangedError"]


def open(path: str | os.PathLike) -> Field:
    """Open and check a light field.  Reads its header; probes come in when they are first needed.

    Raises `FileError` or `FormatError`.
    """
    return Field(path)


def luminance(rgb: ArrayLike) -> NDArray:
    """cd/m^2 of radiance (..., 3); lux of irradiance."""
    return 179 * (np.asarray(rgb) @ np.array([0.265, 0.670, 0.065]))


def library_path() -> str:
    """The libilf that is used."""
    return _path
