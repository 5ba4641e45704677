"""Open light fields: what they say, their probes, and the radiance of rays."""
import os
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import ArgumentError, Error, call
from ._frame import Frame
from ._lamps import Lamp, lamp_from
from ._library import ffi, lib

TYPES: dict[int, np.dtype] = {lib.ILF_HALF: np.dtype(np.float16), lib.ILF_FLOAT: np.dtype(np.float32)}


@dataclass(frozen=True, eq=False)
class Info:
    """What a file's header says (docs/FORMAT.md, section 1.3).

    Attributes
    ----------
    version : int
        1: the probes hold all light; 2: lamps were taken out of them.
    n_u, n_v : int
        Grid of probes.
    n_theta, n_phi : int
        A probe's columns (azimuth) and rows (polar angle).
    dtype : numpy.dtype
        Of the texels as stored, float16 or float32.
    compression : str
        OpenEXR's name.
    interleaved : bool
        The file holds the texels a second time, in the order that lookups like best.
    origin, U, V : (3,)
        The sampled rectangle, scene's unit.
    polar_max, polar_valid : float
        Polar angle at a probe's lower edge, and beyond which lookups hold the value at it; radians.
    file_bytes : int
    comments, owner, cap_date : str or None
    white_luminance : float or None
        cd/m^2 of RGB (1, 1, 1), where the file says so.
    """

    version: int
    n_u: int
    n_v: int
    n_theta: int
    n_phi: int
    dtype: np.dtype
    compression: str
    interleaved: bool
    origin: NDArray[np.float64]
    U: NDArray[np.float64]
    V: NDArray[np.float64]
    polar_max: float
    polar_valid: float
    file_bytes: int
    comments: str | None
    owner: str | None
    cap_date: str | None
    white_luminance: float | None


@dataclass(frozen=True)
class Usage:
    """What this process has used of a field: probes, and of them bytes used in place in the file and bytes decoded into memory."""

    probes: int
    mapped_bytes: int
    decoded_bytes: int


class _Texels:
    """Texels where libilf has them, for numpy, which keeps this, which keeps the field open."""

    def __init__(self, handle, view, shape, strides):
        self.handle = handle
        self.__array_interface__ = {"version": 3, "shape": shape, "strides": strides, "typestr": TYPES[view.type].str,
                                    "data": (int(ffi.cast("uintptr_t", view.red)), True)}


def _text(pointer):
    return None if pointer == ffi.NULL else ffi.string(pointer).decode("utf-8", "replace")


def _points(values, name):
    a = np.asarray(values, float)
    if a.ndim == 0 or a.shape[-1] != 3:
        raise ArgumentError(f"{name}: expected shape (..., 3), found {a.shape}")
    return a


def _rows(a, shape):
    """(array to be kept, pointer, step) for ilf_rays: one row for all, or a row for each ray."""
    one = a.size == 3
    flat = np.ascontiguousarray(a if one else np.broadcast_to(a, (*shape, 3))).reshape(-1)
    return flat, ffi.from_buffer("double[]", flat), 0 if one else 3


class Field:
    """An open light field, by `ilf.open`.  A context manager; any number of threads may call it at once.

    Arrays that `probe` and `probes` return without a copy keep the file open as long as they live, `close` or not.  They lie in the mapped file:
    where another process cuts the file short meanwhile, to look at them ends this process (SIGBUS), as with every mapped file.
    """

    def __init__(self, path: str | os.PathLike):
        out = ffi.new("ilf **")
        call(lib.ilf_open, out, os.fsencode(path))
        self._open = ffi.gc(out[0], lib.ilf_close)
        self.path: str = os.fsdecode(path)

    @property
    def _c(self):
        if self._open is None:
            raise Error(f"{self.path}: expected an open light field, found it closed")
        return self._open

    def close(self) -> None:
        """Give up the file; what was returned from it stays valid."""
        self._open = None

    def __enter__(self) -> "Field":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def __repr__(self):
        if self._open is None:
            return f"<ilf.Field {self.path!r}, closed>"
        i = self.info
        return f"<ilf.Field {self.path!r}, version {i.version}: {i.n_u}x{i.n_v} probes of {i.n_theta}x{i.n_phi} {i.dtype}>"

    # ---- what it says ----

    @cached_property
    def info(self) -> Info:
        """What the header says."""
        c, n = lib.ilf_get_info(self._c), ffi.new("ilf_notes *")
        lib.ilf_get_notes(n, self._c)
        return Info(c.version, c.n_u, c.n_v, c.n_theta, c.n_phi, TYPES[c.type], _text(c.compression), bool(c.interleaved),
                    np.array(list(c.origin)), np.array(list(c.U)), np.array(list(c.V)), c.polar_max, c.polar_valid, c.file_bytes,
                    _text(n.comments), _text(n.owner), _text(n.cap_date), n.white_luminance or None)

    @cached_property
    def frame(self) -> Frame:
        """The plane, as the header has it."""
        return Frame._from(lib.ilf_get_frame(self._c))

    @cached_property
    def lamps(self) -> tuple[Lamp, ...]:
        """The lamps that were taken out of the probes (copies, in the field's own coordinates); () in a file of version 1."""
        n = ffi.new("int *")
        c = lib.ilf_get_luminaires(n, self._c)
        return tuple(lamp_from(c[k], self.info.n_u, self.info.n_v) for k in range(n[0]))

    def usage(self) -> Usage:
        """What this process has used so far."""
        u = ffi.new("ilf_usage *")
        lib.ilf_get_usage(u, self._c)
        return Usage(u.probes, u.mapped_bytes, u.decoded_bytes)

    def digest(self) -> int:
        """A 64-bit number: the same for the same values, however they are stored.  Looks through every probe."""
        d = ffi.new("uint64_t *")
        call(lib.ilf_digest, d, self._c)
        return d[0]

    def nodes(self) -> NDArray[np.float64]:
        """Where the probes stand, (n_v, n_u, 3), scene's unit."""
        i = self.info
        s = np.linspace(0, 1, i.n_u) if i.n_u > 1 else np.array([0.5])
        t = np.linspace(0, 1, i.n_v) if i.n_v > 1 else np.array([0.5])
        return self.frame.at(s[None, :], t[:, None])

    def directions(self) -> NDArray[np.float64]:
        """Unit vectors to the texels' centres, towards the light, (n_phi, n_theta, 3), scene's axes."""
        i = self.info
        theta = -np.pi + (np.arange(i.n_theta) + 0.5) * (2 * np.pi / i.n_theta)
        phi = ((np.arange(i.n_phi) + 0.5) * (i.polar_max / i.n_phi))[:, None]
        own = np.stack(np.broadcast_arrays(np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)), -1)
        return own @ self.frame.axes

    def solid_angles(self) -> NDArray[np.float64]:
        """Of the texels, (n_phi, n_theta), steradians."""
        i = self.info
        edge = np.cos(np.arange(i.n_phi + 1) * (i.polar_max / i.n_phi))
        return np.repeat(((edge[:-1] - edge[1:]) * (2 * np.pi / i.n_theta))[:, None], i.n_theta, 1)

    # ---- probes ----

    def _view(self, i, j):
        v = ffi.new("ilf_view *")
        call(lib.ilf_view_probe, v, self._c, i, j)
        return v

    def probe(self, i: int, j: int) -> NDArray:
        """Probe (i, j): i along U, j along V.

        Returns
        -------
        array (n_phi, n_theta, 3), float16 or float32, read-only
            Radiance, W/(sr m^2), of R, G, B; row 0 is at the plane's normal.  Never a copy: of an uncompressed file a view of the mapped file, else
            of the memory into which libilf decoded the probe.  (In a file whose channels have different types, float32.)
        """
        v = self._view(i, j)
        return np.asarray(_Texels(self._c, v, (self.info.n_phi, self.info.n_theta, 3), (v.row, v.column, v.channel)))

    def probes(self, copy: bool | None = None) -> NDArray:
        """All probes.

        Parameters
        ----------
        copy : bool, optional
            None: a view of the mapped file where the probes lie there evenly (an uncompressed file, as `ilf.write` and `ilfpack --compression none`
            make it), else one copy.  True: a copy.  False: a view, or an `ArgumentError`.

        Returns
        -------
        array (n_v, n_u, n_phi, n_theta, 3), float16 or float32
            Radiance, W/(sr m^2), of R, G, B.  Read-only where it is a view (``flags.owndata`` is then False, ``flags.writeable`` too).
        """
        info = self.info
        if copy is not True:
            even = self._evenly()
            if even is not None:
                return even
            if copy is False:
                raise ArgumentError(f"{self.path}: expected probes that lie evenly in an uncompressed file, found others: they need a copy")
        out = np.empty((info.n_v, info.n_u, info.n_phi, info.n_theta, 3), TYPES[self._view(0, 0).type])
        for j in range(info.n_v):
            for i in range(info.n_u):
                out[j, i] = self.probe(i, j)
        return out

    def _evenly(self):
        """All probes as one view of the file, or None."""
        info, first = self.info, self._view(0, 0)
        if not first.in_file:
            return None
        at = np.array([[int(ffi.cast("uintptr_t", self._view(i, j).red)) for i in range(info.n_u)] for j in range(info.n_v)], np.int64)
        along = int(at[0, 1] - at[0, 0]) if info.n_u > 1 else 0
        down = int(at[1, 0] - at[0, 0]) if info.n_v > 1 else 0
        if (at != at[0, 0] + np.arange(info.n_u) * along + np.arange(info.n_v)[:, None] * down).any():
            return None
        shape = info.n_v, info.n_u, info.n_phi, info.n_theta, 3
        return np.asarray(_Texels(self._c, first, shape, (down, along, first.row, first.column, first.channel)))

    # ---- lookup ----

    def eval(self, origins: ArrayLike, directions: ArrayLike, hits: ArrayLike | None = None, *, depth: bool = True, frame: Frame | None = None,
             threads: int | None = None, out: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
        """Radiance that arrives along rays (docs/FORMAT.md, section 2).

        Parameters
        ----------
        origins : (..., 3)
            Where the rays begin, scene's unit.  Arguments broadcast against each other but for the last axis.
        directions : (..., 3)
            Towards the light, any length above 0.
        hits : (..., 3), optional
            Where the rays meet the auxiliary geometry (the room's walls, or a ball about the scene), scene's unit.  None, or an infinite coordinate:
            infinitely far away.
        depth : bool
            Depth correction: each probe is looked up towards the hit rather than along the ray.
        frame : Frame, optional
            Where the light field lies; default: the header's.  A field with lamps can be moved, turned, mirrored and scaled evenly.
        threads : int, optional
            Default: one for each processor.  What comes out does not hang on it.  Other Python threads run meanwhile.
        out : array (..., 3), float32, C-contiguous, optional
            Where to put the result.

        Returns
        -------
        array (..., 3), float32
            Radiance, W/(sr m^2), of R, G, B; 0 for rays from below the plane.

        Raises
        ------
        ArgumentError
            A direction is zero, a coordinate not finite (the words say of which ray), the shapes don't fit, or lamps don't fit the frame.
        TexelError, FormatError, FileError
            A probe that a ray needs can't be read.
        ChangedError
            The file was changed in place since it was opened.
        """
        field, rays = self._c, ffi.new("ilf_rays *")
        given = {"origins": _points(origins, "origins"), "directions": _points(directions, "directions")}
        if hits is not None:
            given["hits"] = _points(hits, "hits")
        try:
            shape = np.broadcast_shapes(*(a.shape[:-1] for a in given.values()))
        except ValueError:
            raise ArgumentError("rays: expected shapes that broadcast, found " + ", ".join(f"{k} {a.shape}" for k, a in given.items())) from None
        result = self._result(out, (*shape, 3))
        where = lib.ilf_get_frame(field) if frame is None else frame._struct()
        if frame is not None:
            call(lib.ilf_check_frame, field, where)
        rays.n = result.size // 3
        if rays.n == 0:
            return result
        o, rays.origins, rays.origin_step = _rows(given["origins"], shape)
        d, rays.dirs, rays.dir_step = _rows(given["directions"], shape)
        if hits is not None:
            h, rays.hits, rays.hit_step = _rows(given["hits"], shape)
        call(lib.ilf_eval_many, ffi.from_buffer("float[]", result), field, where, rays, lib.ILF_DEPTH if depth else lib.ILF_NO_DEPTH,
             0 if threads is None else threads)
        call(lib.ilf_check_unchanged, field)
        return result

    @staticmethod
    def _result(out, shape):
        if out is None:
            return np.empty(shape, np.float32)
        if out.shape != shape or out.dtype != np.float32 or not out.flags.c_contiguous or not out.flags.writeable:
            raise ArgumentError(f"out: expected a C-contiguous float32 array of shape {shape}, found {out.dtype} {out.shape}")
        return out
