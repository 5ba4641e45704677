"""Light fields into files."""
import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from ._errors import ArgumentError, call
from ._field import Field
from ._frame import vector3
from ._lamps import Lamp, lamps_to
from ._library import ffi, lib

TYPES = {np.dtype(np.float16): lib.ILF_HALF, np.dtype(np.float32): lib.ILF_FLOAT}
COPIED = "origin U V polar_max polar_valid comments owner cap_date white_luminance".split()


def _type(dtype, probes):
    t = np.dtype(dtype) if dtype is not None else np.dtype(np.float16 if probes.dtype == np.float16 else np.float32)
    if t not in TYPES:
        raise ArgumentError(f"dtype: expected float16 or float32, found {t}")
    return TYPES[t]


def _spec(probes, a, dtype, compression, interleave, lamps, name):
    """ilf_spec, and what must be kept as long as it is used."""
    if probes.ndim != 5 or probes.shape[-1] != 3:
        raise ArgumentError(f"probes: expected shape (n_v, n_u, n_phi, n_theta, 3), found {probes.shape}")
    s, keep = ffi.new("ilf_spec *"), []

    def text(value):
        if value is None:
            return ffi.NULL
        keep.append(ffi.new("char[]", value if isinstance(value, bytes) else os.fsencode(value)))
        return keep[-1]

    s.n_v, s.n_u, s.n_phi, s.n_theta = probes.shape[:4]
    s.origin, s.U, s.V = (vector3(a[k], k).tolist() for k in ("origin", "U", "V"))
    s.polar_max, s.polar_valid, s.white_luminance = a["polar_max"], a["polar_valid"] or 0, a["white_luminance"] or 0
    s.type, s.compression, s.interleave, s.name = _type(dtype, probes), text(compression), int(interleave), text(name)
    s.comments, s.owner, s.cap_date = text(a["comments"]), text(a["owner"]), text(a["cap_date"])
    if lamps:
        # what a field of a struct gives back owns nothing: the array itself is kept
        array, parts = lamps_to(lamps, s.n_u, s.n_v)
        s.lamps = array
        keep += [array, parts]
        s.n_lamps = len(lamps)
    return s, keep


def _write_probes(path, spec, probes):
    writer = ffi.new("ilf_writer **")
    call(lib.ilf_writer_open, writer, os.fsencode(path), spec)
    try:
        for row in probes:
            for probe in row:
                texels = np.ascontiguousarray(probe, np.float32)
                call(lib.ilf_writer_probe, writer[0], ffi.from_buffer("float[]", texels))
    except BaseException:
        lib.ilf_writer_abort(writer[0])
        raise
    call(lib.ilf_writer_close, writer[0])


def write(path: str | os.PathLike, probes: ArrayLike, *, origin: ArrayLike | None = None, U: ArrayLike | None = None, V: ArrayLike | None = None,
          polar_max: float | None = None, polar_valid: float | None = None, dtype: DTypeLike | None = None, compression: str = "none",
          interleave: bool = False, comments: str | None = None, owner: str | None = None, cap_date: str | None = None,
          white_luminance: float | None = None, lamps: Sequence[Lamp] | None = None, like: Field | None = None) -> None:
    """Write a light field.  The file is there whole under its name, or not at all.

    Parameters
    ----------
    path : path
        Commonly ``*.ilf.exr``.
    probes : array (n_v, n_u, n_phi, n_theta, 3)
        Radiance, W/(sr m^2), of R, G, B, as `Field.probes` returns it.  Finite; at most 65504 for float16.
    origin, U, V : (3,)
        The sampled rectangle: probe (0, 0), and the edges along i and j, scene's unit; needed unless `like` is given.
    polar_max : float
        Polar angle at the probes' lower edge, radians; default: pi/2, a hemisphere.
    polar_valid : float, optional
        Beyond it the texels don't count; radians.
    dtype : float16 or float32
        Default: float16 where probes are, else float32.
    compression : str
        none rle zips zip piz pxr24 b44 b44a.
    interleave : bool
        Write the texels a second time, for faster lookups; without compression only.
    comments, owner : str, optional
    cap_date : str, optional
        "YYYY:MM:DD HH:MM:SS"
    white_luminance : float, optional
        cd/m^2 of RGB (1, 1, 1)
    lamps : sequence of Lamp, optional
        Lamps that were taken out of the probes: makes a file of version 2.
    like : Field, optional
        Where plane, angles, notes and lamps come from that are not given (``lamps=[]`` leaves its lamps out).

    Raises
    ------
    ArgumentError, FormatError
        What is to be written breaks the format: shapes, sizes and names, or plane and angles.
    TexelError
        A texel is not finite, or beyond float16; the words name probe and pixel.
    FileError
        The system refused.
    """
    probes = np.asarray(probes)
    given = {"origin": origin, "U": U, "V": V, "polar_max": polar_max, "polar_valid": polar_valid, "comments": comments, "owner": owner,
             "cap_date": cap_date, "white_luminance": white_luminance}
    if like is not None:
        given = {k: getattr(like.info, k) if v is None else v for k, v in given.items()}
        lamps = like.lamps if lamps is None else lamps
    for k in ("origin", "U", "V"):
        if given[k] is None:
            raise ArgumentError(f"{k}: expected 3 numbers (or like=FIELD), found none")
    if given["polar_max"] is None:
        given["polar_max"] = np.pi / 2
    path = os.fspath(path)
    folder, name = os.path.split(os.fsdecode(path))
    part = os.path.join(folder, f".{name}.{os.getpid()}.part")
    spec, keep = _spec(probes, given, dtype, compression, interleave, lamps, path)
    try:
        _write_probes(part, spec, probes)
        os.replace(part, path)
    finally:
        del keep
        if os.path.exists(part):
            os.unlink(part)
