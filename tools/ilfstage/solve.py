"""Drive values that match best: least squares with a ridge, within ranges (docs/THEORY.md, "Lights that reproduce a field").

    min over 0 <= x <= top of   |A x - b|^2 / 2  +  sum_k G_k x_k^2 / 2  +  sum_k l_k x_k

A is (m, n) with few rows and maybe thousands of columns, G > 0.  Its dual has m unknowns y = b - A x, and is convex and piecewise quadratic: x
follows from y by x_k = clip((a_k.y - l_k) / G_k, 0, top_k), and Newton's method with a line search ends after a few steps, the fewer the nearer it
begins (the frame before).  The duality gap says how far from the best the result can be at most.
"""
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

STEPS = 200
ENOUGH = 1e-12      # of |b|^2, for the gap


@dataclass(eq=False)
class Problem:
    """What stays the same from frame to frame.  A: (m, n), best in Fortran's order; top: (n,), may be infinite; G: (n,), `ridge` times each column's
    own square."""
    A: np.ndarray
    top: np.ndarray
    G: np.ndarray
    ridge: float

    def x_at(self, z):
        """x where A'y - l is z."""
        return np.clip(z / self.G, 0, self.top)

    def sent(self, x):
        """A x, of which most are 0."""
        on = np.flatnonzero(x)
        return self.A[:, on] @ x[on]


def newton_step(p, x, down):
    """The step that the quadratic at hand asks for: (1 + F F')^-1 `down`, by the smaller side of F."""
    free = np.flatnonzero((x > 0) & (x < p.top))
    F = p.A[:, free] / np.sqrt(p.G[free])
    few = F.shape[1] < F.shape[0]
    H = F.T @ F if few else F @ F.T
    H[np.diag_indices_from(H)] += 1
    factor = cho_factor(H, overwrite_a=True, check_finite=False)
    if few:
        return down - F @ cho_solve(factor, F.T @ down, check_finite=False)
    return cho_solve(factor, down, check_finite=False)


def length_of_step(p, b, y, z, step, dz):
    """Where the dual value is least along a step: its slope there rises from below 0, and is a sum of straight pieces."""
    def slope(t):
        return step @ (y + t * step - b) + dz @ p.x_at(z + t * dz)
    low, high = 0., 1.
    if slope(high) <= 0:
        return high
    for _ in range(30):
        middle = (low + high) / 2
        if slope(middle) > 0:
            high = middle
        else:
            low = middle
        if high - low < .05 * high:
            break
    return low or high / 2


def descend(p, b, l, y):
    """(x, y, gap) from a start y: Newton's method, to the end or as far as it gets."""
    scale, z, last = max(b @ b, 1e-300), y @ p.A - l, np.inf
    for _ in range(STEPS):
        x = p.x_at(z)
        sent = p.sent(x)
        own = p.G @ (x * x) / 2
        value = y @ y / 2 - b @ y + z @ x - own
        gap = (sent - b) @ (sent - b) / 2 + own + l @ x + value
        if gap <= ENOUGH * scale or not value < last:
            break
        last = value
        step = newton_step(p, x, b - y - sent)
        dz = step @ p.A
        t = length_of_step(p, b, y, z, step, dz)
        y, z = y + t * step, z + t * dz
    return x, y, max(0., gap)


def solve(p, b, l=None, y=None):
    """(x (n,), y (m,), gap): the gap is that between the primal and the dual value, of |b|^2.  y: where to begin, that of a similar b.

    Far from the end a small ridge makes steps that help little, so what begins anew goes by way of greater ridges.
    """
    l = np.zeros(p.A.shape[1]) if l is None else l
    scale = max(b @ b, 1e-300)
    if y is not None:
        x, end, gap = descend(p, b, l, y)
        if gap <= 1e-9 * scale:
            return x, end, gap / scale
    y, least = np.zeros(len(b)), p.ridge
    for more in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        if more > 2 * least:
            _, y, _ = descend(Problem(p.A, p.top, p.G * (more / least), more), b, l, y)
    x, y, gap = descend(p, b, l, y)
    return x, y, gap / scale


def compressed(A):
    """(Q (m, r), R (r, n)) with A = Q R to 1e-6 of its greatest singular value: fewer rows for the same problem."""
    w, V = np.linalg.eigh(A @ A.T)
    keep = w > 1e-12 * max(w[-1], 1e-300)
    return V[:, keep], np.asfortranarray(V[:, keep].T @ A)
