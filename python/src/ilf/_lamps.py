"""Lamps that were taken out of a light field, and what hides or shapes them (docs/FORMAT.md, sections 1.8 to 1.10)."""
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ._errors import ArgumentError
from ._library import ffi

Shape = Literal["sphere", "rectangle", "disc", "tube"]
Kind = Literal["layer", "foot", "gate", "beam", "stack", "ball"]
SHAPES = ("sphere", "rectangle", "disc", "tube")
KINDS = ("layer", "foot", "gate", "beam", "stack", "ball")
LINKS = ("value", "logistic")


def _zeros(n):
    return field(default_factory=lambda: np.zeros(n))


def _make_arrays(owner, whose, **sizes):
    """Vectors may be given as any sequence of numbers."""
    for name, n in sizes.items():
        a = np.asarray(getattr(owner, name), float)
        if a.shape != (n,):
            raise ArgumentError(f"{whose} {name}: expected {n} numbers, found shape {a.shape}")
        setattr(owner, name, a)


def _number(name, names, what):
    if name not in names:
        raise ArgumentError(f"{what}: expected one of {' '.join(names)}, found {name!r}")
    return names.index(name)


@dataclass(eq=False)
class Mask:
    """What hides or shapes a lamp.  Vectors may be given as any sequence of numbers.

    Parameters
    ----------
    kind : "layer", "foot", "gate", "beam", "stack" or "ball"
    picture : array (ny, nx), of a stack (nz, ny, nx), or None
        Of layer, foot and stack.  float16 or float32, as it is written.
    start, step : (2,)
        Sample (iy, ix) of the picture stands at start + (ix, iy)*step, scene's unit (foot coordinates at infinity: a direction's slope).
    link : "value" or "logistic"
        How a picture's value becomes the share that passes.
    adds : bool
        Adds to the product of the masks that multiply, rather than to multiply.
    beta : float
        Of foot and gate: -1 a beam of directions, 0 sharp on the plane.
    plane : (3,)
    coef : (6,)
    """

    kind: Kind
    picture: NDArray | None = None
    start: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    step: NDArray[np.float64] = field(default_factory=lambda: np.ones(2))
    link: Literal["value", "logistic"] = "value"
    adds: bool = False
    beta: float = 0.0
    plane: NDArray[np.float64] = _zeros(3)
    coef: NDArray[np.float64] = _zeros(6)

    def __post_init__(self):
        _make_arrays(self, "mask's", start=2, step=2, plane=3, coef=6)


@dataclass(eq=False)
class Lamp:
    """A lamp, in the field's own coordinates: x along u, y along v, z along n from probe (0, 0), in the scene's unit (`Frame.to_scene`).
    Vectors may be given as any sequence of numbers.

    Parameters
    ----------
    shape : "sphere", "rectangle", "disc" or "tube"
    centre : (3,)
    rgb : (3,)
        Radiance, W/(sr m^2); all 0: put out.
    a, b : (3,)
        Rectangle: half edges; disc: radii at right angles; tube: a is half its length.
    radius : float
        Of sphere and tube.
    far : bool
        At infinity: met whatever the auxiliary geometry says.
    masks : sequence of Mask
    error_masks, error_interpolation, error_radiance : float
        How sure: relative root mean square errors; 0: not known.
    error_position : float
        Standard error, scene's unit; 0: not known.
    seen : array (n_v, n_u) or None
        What each probe measured of the lamp's light: 1 all, below 0 none expected.
    """

    shape: Shape
    centre: NDArray[np.float64]
    rgb: NDArray[np.float64]
    a: NDArray[np.float64] = _zeros(3)
    b: NDArray[np.float64] = _zeros(3)
    radius: float = 0.0
    far: bool = False
    masks: tuple[Mask, ...] = ()
    error_masks: float = 0.0
    error_interpolation: float = 0.0
    error_position: float = 0.0
    error_radiance: float = 0.0
    seen: NDArray | None = None

    def __post_init__(self):
        _make_arrays(self, "lamp's", centre=3, rgb=3, a=3, b=3)

    @property
    def extent(self) -> float:
        """Radius of a ball round the centre that holds the lamp, scene's unit."""
        a, b = float(np.linalg.norm(self.a)), float(np.linalg.norm(self.b))
        return {"sphere": self.radius, "rectangle": float(np.hypot(a, b)), "disc": max(a, b), "tube": a + self.radius}[self.shape]


ERRORS = ("error_masks", "error_interpolation", "error_position", "error_radiance")


# ---- from libilf -------------------------------------------------------------------------------------------

def _copied(pointer, shape):
    if pointer == ffi.NULL:
        return None
    n = int(np.prod(shape))
    return np.frombuffer(ffi.buffer(pointer, 4 * n), np.float32).reshape(shape).copy()


def _mask_from(m):
    shape = (m.nz, m.ny, m.nx) if KINDS[m.kind] == "stack" else (m.ny, m.nx)
    return Mask(KINDS[m.kind], _copied(m.grid, shape), np.array([m.x0, m.y0]), np.array([m.dx, m.dy]), LINKS[m.link], bool(m.adds), m.beta,
                np.array(list(m.plane)), np.array(list(m.coef)))


def lamp_from(c, n_u, n_v):
    """An ilf_luminaire, copied."""
    return Lamp(SHAPES[c.shape], np.array(list(c.centre)), np.array(list(c.rgb)), np.array(list(c.a)), np.array(list(c.b)), c.radius, bool(c.far),
                tuple(_mask_from(c.masks[k]) for k in range(c.nmasks)), *(getattr(c, e) for e in ERRORS), _copied(c.seen, (n_v, n_u)))


# ---- to libilf ---------------------------------------------------------------------------------------------

def _samples(values, keep):
    a = np.ascontiguousarray(values, np.float32)
    keep.append(a)
    return ffi.from_buffer("float[]", a)


def _mask_to(c, m, keep):
    c.kind, c.link = _number(m.kind, KINDS, "mask"), _number(m.link, LINKS, "mask's link")
    c.adds, c.beta, c.plane, c.coef = int(m.adds), m.beta, list(m.plane), list(m.coef)
    if m.picture is None:
        return
    shape, axes = np.shape(m.picture), 3 if m.kind == "stack" else 2
    if len(shape) != axes or 0 in shape:
        raise ArgumentError(f"mask's picture: expected {axes} axes of a {m.kind}, found shape {shape}")
    c.ny, c.nx = shape[-2:]
    c.nz = shape[0] if axes == 3 else 0
    (c.x0, c.y0), (c.dx, c.dy) = m.start, m.step
    c.grid = _samples(m.picture, keep)


def lamps_to(lamps, n_u, n_v):
    """ilf_luminaire[], and what must be kept as long as it is used."""
    out, keep = ffi.new("ilf_luminaire[]", len(lamps)), []
    for c, lamp in zip(out, lamps, strict=True):
        c.shape, c.far, c.radius = _number(lamp.shape, SHAPES, "lamp"), int(lamp.far), lamp.radius
        for name in ("centre", "a", "b", "rgb"):
            setattr(c, name, list(getattr(lamp, name)))
        for name in ERRORS:
            setattr(c, name, getattr(lamp, name))
        masks = ffi.new("ilf_mask[]", len(lamp.masks))
        keep.append(masks)
        for m, mask in zip(masks, lamp.masks, strict=True):
            _mask_to(m, mask, keep)
        c.masks, c.nmasks = masks if len(lamp.masks) else ffi.NULL, len(lamp.masks)
        if lamp.seen is not None:
            if np.shape(lamp.seen) != (n_v, n_u):
                raise ArgumentError(f"lamp's seen: expected shape {(n_v, n_u)}, found {np.shape(lamp.seen)}")
            c.seen = _samples(lamp.seen, keep)
    return out, keep
