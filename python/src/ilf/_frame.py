"""Where a light field lies."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import ArgumentError, call
from ._library import ffi, lib


def vector3(values, name):
    a = np.asarray(values, float)
    if a.shape != (3,):
        raise ArgumentError(f"{name}: expected 3 numbers, found shape {a.shape}")
    return a


@dataclass(frozen=True, eq=False)
class Frame:
    """A light field's plane: probe (i, j) stands at origin + i/(n_u-1) U + j/(n_v-1) V.

    Attributes
    ----------
    origin : (3,)
        Position of probe (0, 0), scene's unit.
    u, v, n : (3,)
        Unit vectors along the edges, and to the side from which the light comes.
    len_u, len_v : float
        |U|, |V|, scene's unit.
    cos_uv : float
        u.v, at most 1e-4 off 0.
    """

    origin: NDArray[np.float64]
    u: NDArray[np.float64]
    v: NDArray[np.float64]
    n: NDArray[np.float64]
    len_u: float
    len_v: float
    cos_uv: float

    @classmethod
    def of(cls, origin: ArrayLike, U: ArrayLike, V: ArrayLike, normal: ArrayLike | None = None) -> "Frame":
        """The frame of a plane with corner `origin` and edges `U`, `V`; `normal` (U x V or its opposite) says from which side light comes."""
        o, a, b = vector3(origin, "origin"), vector3(U, "U"), vector3(V, "V")
        side = ffi.NULL if normal is None else ffi.new("double[3]", vector3(normal, "normal").tolist())
        c = ffi.new("ilf_frame *")
        call(lib.ilf_frame_init, c, o.tolist(), a.tolist(), b.tolist(), side)
        return cls._from(c)

    @classmethod
    def _from(cls, c):
        return cls(*(np.array(list(getattr(c, k))) for k in ("origin", "u", "v", "n")), c.len_u, c.len_v, c.cos_uv)

    def _struct(self):
        return ffi.new("ilf_frame *", [self.origin.tolist(), self.u.tolist(), self.v.tolist(), self.n.tolist(), self.len_u, self.len_v, self.cos_uv])

    @property
    def U(self) -> NDArray[np.float64]:
        """Edge along u, (3,), scene's unit."""
        return self.len_u * self.u

    @property
    def V(self) -> NDArray[np.float64]:
        """Edge along v, (3,), scene's unit."""
        return self.len_v * self.v

    @property
    def axes(self) -> NDArray[np.float64]:
        """Rows u, v, n, (3, 3)."""
        return np.stack([self.u, self.v, self.n])

    def to_scene(self, points: ArrayLike) -> NDArray[np.float64]:
        """Points (..., 3) in the field's own coordinates (along u, v, n from the origin), as of lamps, in the scene's."""
        return self.origin + np.asarray(points, float) @ self.axes

    def to_field(self, points: ArrayLike) -> NDArray[np.float64]:
        """The inverse of `to_scene`."""
        return (np.asarray(points, float) - self.origin) @ self.axes.T

    def at(self, s: ArrayLike, t: ArrayLike, height: ArrayLike = 0.0) -> NDArray[np.float64]:
        """Points (..., 3) at s U + t V from the origin, `height` above the plane (scene's unit); arguments broadcast."""
        s, t, h = np.broadcast_arrays(*(np.asarray(a, float)[..., None] for a in (s, t, height)))
        return self.origin + s * self.U + t * self.V + h * self.n
