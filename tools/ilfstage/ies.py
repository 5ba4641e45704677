"""Beams from IES files (ANSI/IES LM-63): what a lamp sends into each direction.

Type C photometry: theta is the angle from the lamp's axis (vertical angle, 0 is where the lamp points), phi turns about it, from the lamp's `up`.
A file holds a part of phi and the lamp's symmetry gives the rest.
"""
import re
from dataclasses import dataclass

import numpy as np

from .errors import Bad

SYMMETRIES = (0, 90, 180, 360)


@dataclass(frozen=True, eq=False)
class Beam:
    """Candela by direction.

    theta : (n,) degrees, rising, from 0 to 180
    phi : (m,) degrees, rising, from 0 to 360
    candela : (m, n)
    """
    theta: np.ndarray
    phi: np.ndarray
    candela: np.ndarray

    @property
    def greatest(self):
        return float(self.candela.max())


def numbers_after_tilt(path, text):
    """The numbers that follow TILT=, and what TILT= says."""
    m = re.search(r"^\s*TILT\s*=\s*(\S+)\s*$", text, re.M | re.I)
    if not m:
        raise Bad(f"{path}: expected an IES file with a line TILT=, found none")
    words = text[m.end():].replace(",", " ").split()
    values = []
    for w in words:
        try:
            values.append(float(w))
        except ValueError:
            raise Bad(f"{path}: expected numbers after TILT=, found '{w[:20]}'") from None
    return m[1].upper(), values


class Numbers:
    """A file's numbers, taken one after another."""

    def __init__(self, path, values):
        self.path, self.values, self.at = path, values, 0

    def take(self, n, what):
        part = self.values[self.at:self.at + n]
        if len(part) < n:
            raise Bad(f"{self.path}: expected {n} numbers ({what}), found {len(part)}")
        self.at += n
        return np.array(part)

    def count(self, what, least, most):
        value = self.take(1, what)[0]
        if value != int(value) or not least <= value <= most:
            raise Bad(f"{self.path}: expected {what} of {least} to {most}, found {value:g}")
        return int(value)


def unfolded(path, phi, candela):
    """phi over the whole circle."""
    last = phi[-1]
    if len(phi) == 1:
        return np.array([0., 360.]), np.repeat(candela, 2, 0)
    if phi[0] != 0 or last not in SYMMETRIES:
        raise Bad(f"{path}: expected horizontal angles from 0 to 0, 90, 180 or 360, found {phi[0]:g} to {last:g}")
    while last < 360:
        phi = np.concatenate([phi, 2 * last - phi[-2::-1]])
        candela = np.concatenate([candela, candela[-2::-1]])
        last *= 2
    return phi, candela


def whole_sphere(theta, candela):
    """theta from 0 to 180: dark where the file says nothing."""
    if theta[0] > 0:
        theta, candela = np.r_[0, theta[0] - min(theta[0], 1e-3), theta], np.c_[np.zeros((len(candela), 2)), candela]
    if theta[-1] < 180:
        theta, candela = np.r_[theta, theta[-1] + 1e-3, 180], np.c_[candela, np.zeros((len(candela), 2))]
    keep = np.r_[True, np.diff(theta) > 0]
    return theta[keep], candela[:, keep]


def read(path):
    """A Beam; raises Bad."""
    try:
        text = path.read_bytes().decode("latin-1")
    except OSError as e:
        raise Bad(f"{path}: can't be opened: {e.strerror}") from None
    tilt, values = numbers_after_tilt(path, text)
    if tilt not in ("NONE", "INCLUDE"):
        raise Bad(f"{path}: expected TILT=NONE or TILT=INCLUDE, found TILT={tilt[:40]}")
    n = Numbers(path, values)
    if tilt == "INCLUDE":
        n.take(1, "lamp's geometry")
        n.take(2 * n.count("angles of TILT", 1, 1000), "TILT")
    n.take(2, "number of lamps, lumens")
    factor = n.take(1, "multiplier")[0]
    n_theta, n_phi = n.count("vertical angles", 2, 2000), n.count("horizontal angles", 1, 2000)
    kind = n.count("photometric type", 1, 3)
    if kind != 1:
        raise Bad(f"{path}: expected photometry of type C (1), found type {' CBA'[kind]} ({kind})")
    n.take(4, "units, width, length, height")
    factor *= np.prod(n.take(3, "ballast factor, watts")[:2])
    if not 0 < factor < 1e9:
        raise Bad(f"{path}: expected a multiplier above 0, found {factor:g}")
    theta, phi = n.take(n_theta, "vertical angles"), n.take(n_phi, "horizontal angles")
    candela = n.take(n_theta * n_phi, "candela values").reshape(n_phi, n_theta) * factor
    if n.at != len(values):
        raise Bad(f"{path}: expected {n.at} numbers after TILT=, found {len(values)}")
    return checked(path, theta, phi, candela)


def checked(path, theta, phi, candela):
    for name, a in (("vertical", theta), ("horizontal", phi)):
        if not np.isfinite(a).all() or (np.diff(a) <= 0).any():
            raise Bad(f"{path}: expected {name} angles that rise, found others")
    if theta[0] < 0 or theta[-1] > 180:
        raise Bad(f"{path}: expected vertical angles from 0 to 180, found {theta[0]:g} to {theta[-1]:g}")
    if not np.isfinite(candela).all() or candela.min() < 0:
        raise Bad(f"{path}: expected candela of 0 or more, found {candela.min():g}")
    if candela.max() == 0:
        raise Bad(f"{path}: expected some light, found none")
    phi, candela = unfolded(path, phi, candela)
    theta, candela = whole_sphere(theta, candela)
    return Beam(theta, phi, candela)
