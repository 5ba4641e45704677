"""Drive values that match best: least squares with a ridge, within ranges (docs/THEORY.md, "Lights that reproduce a field").

    min over 0 <= x <= top of   |A x - b|^2 / 2  +  sum_k G_k x_k^2 / 2  +  sum_k l_k x_k

A is (m, n) with few rows and maybe thousands of columns, G > 0.  Its dual has m unknowns y = b - A x, and is convex and piecewise quadratic: x follows from y by
x_k = clip((a_k.y - l_k) / G_k, 0, top_k), and Newton's method with a line search ends after a few steps, the fewer the nearer it begins (the frame before).  The duality gap says how
far from the best the result can be at most.
"""
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

STEPS = 200
ENOUGH = 1e-12      # of |b|^2, for the gap


@dataclass(eq=False)
class Problem:
    """What stays the same from frame to frame.  A: (m, n); top: (n,), may be infinite; G: (n,)."""
    A: np.ndarray
    top: np.ndarray
    G: np.ndarray

    def primal(self, x, b, l):
        r = self.A @ x - b
        return r @ r / 2 + self.G @ (x * x) / 2 + l @ x

    def dual(self, y, b, l):
        """(negative dual value, x): its gradient is y - b + A x."""
        z = y @ self.A - l
        x = np.clip(z / self.G, 0, self.top)
        return y @ y / 2 - b @ y + z @ x - self.G @ (x * x) / 2, x


def newton_step(p, y, b, x):
    """The step that the quadratic at hand asks for: (1 + F F')^-1 of the slope, by the smaller side of F."""
    free = (x > 0) & (x < p.top)
    F, down = p.A[:, free] / np.sqrt(p.G[free]), b - y - p.A @ x
    few = F.shape[1] < F.shape[0]
    H = F.T @ F if few else F @ F.T
    H[np.diag_indices_from(H)] += 1
    factor = cho_factor(H, overwrite_a=True, check_finite=False)
    if few:
        return down - F @ cho_solve(factor, F.T @ down, check_finite=False)
    return cho_solve(factor, down, check_finite=False)


def descend(p, b, l, y):
    """(x, y, gap) from a start y: Newton's method with a line search, to the end or as far as it gets."""
    scale = max(b @ b, 1e-300)
    value, x = p.dual(y, b, l)
    for _ in range(STEPS):
        if p.primal(x, b, l) + value <= ENOUGH * scale:
            break
        step = newton_step(p, y, b, x)
        slope, t = step @ (y - b + p.A @ x), 1.
        new, new_x = p.dual(y + step, b, l)
        while new > value + 1e-4 * t * slope and t > 1e-8:
            t /= 2
            new, new_x = p.dual(y + t * step, b, l)
        if t <= 1e-8:
            break
        y, value, x = y + t * step, new, new_x
    return x, y, max(0., p.primal(x, b, l) + value)


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
    y, least = np.zeros(len(b)), np.median(p.G / np.maximum((p.A * p.A).sum(0), 1e-300))
    for more in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        if more > 2 * least:
            _, y, _ = descend(Problem(p.A, p.top, p.G * (more / least)), b, l, y)
    x, y, gap = descend(p, b, l, y)
    return x, y, gap / scale


def compressed(A):
    """(Q (m, r), R (r, n)) with A = Q R to 1e-6 of its greatest singular value: fewer rows for the same problem."""
    w, V = np.linalg.eigh(A @ A.T)
    keep = w > 1e-12 * max(w[-1], 1e-300)
    return V[:, keep], V[:, keep].T @ A
