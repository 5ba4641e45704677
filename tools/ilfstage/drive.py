"""From what shall match to drive values: weights, ranges, the ridge, few lights, time, quantisation."""
from dataclasses import dataclass

import numpy as np

from . import solve

DOWN = (1e-3, 1e-4, 1e-5, 1e-6)
NEARER = 2e-5, .01  # a ridge is small enough when a tenth of it makes errors smaller by no more, or by no more than this part of them
LADDER = (1e-6, 1e-5, 1e-4, 4e-4, 1e-3, 4e-3, 1e-2, 4e-2)
RISE = .025         # of the error, that noise in the matrix may bring (the aim is 3 points)


def colour_groups(A):
    """Lists of colours (0, 1, 2) that some channel has together: channels of one colour each are problems of their own."""
    lit = (np.abs(A).max(0) > 0).T              # (k, 3)
    groups = [{0}, {1}, {2}]
    for pattern in np.unique(lit, axis=0):
        mine = [g for g in groups if g & set(np.flatnonzero(pattern))]
        if len(mine) > 1:
            groups = [g for g in groups if g not in mine] + [set().union(*mine)]
    return [sorted(g) for g in groups]


class Part:
    """The problem of some colours and of the channels that have them."""

    def __init__(self, A, colours, top, ridge):
        self.rows = np.ravel(np.arange(A.shape[0])[:, None] * 3 + colours)
        flat = A.reshape(-1, A.shape[2])[self.rows]
        effect = (flat * flat).sum(0)
        self.channels = np.flatnonzero(effect > 1e-14 * max(effect.max(), 1e-300))
        flat, self.effect = flat[:, self.channels], effect[self.channels]
        self.Q, self.R = solve.compressed(flat)
        self.top = top[self.channels]
        self.set_ridge(ridge)
        self.y = None

    def set_ridge(self, ridge):
        self.problem = solve.Problem(self.R, self.top, ridge * self.effect, ridge)

    def fit(self, b, price=None, top=None):
        """x of this part's channels.  price: (k,) of all channels, the l of solve; top: limits in place of those given."""
        p = self.problem if top is None else solve.Problem(self.R, top[self.channels], self.problem.G, self.problem.ridge)
        x, y, gap = solve.solve(p, self.Q.T @ b[self.rows], None if price is None else price[self.channels], self.y)
        self.y = y
        return x, gap


class Fitter:
    """Fits of many frames to one matrix.

    A : (s, 3, k), what a channel at full drive does; weight : (s,), sum 1; low, high : (k,) ranges; ridge : number, as a part of each channel's own
    effect.  Without a place among `only` (k,) bool a channel is kept at its low end.
    """

    def __init__(self, A, weight, low, high, ridge, only=None):
        self.weight, self.low, self.high, self.ridge = np.sqrt(weight)[:, None], low, high, ridge
        self.A = A * self.weight[..., None]
        self.flat = self.A.reshape(-1, A.shape[2])
        self.used = np.ones(A.shape[2], bool) if only is None else only
        self.parts = [Part(self.A * self.used, np.array(g), high - low, ridge) for g in colour_groups(self.A)]
        self.parts = [p for p in self.parts if len(p.channels)]

    def set_ridge(self, ridge):
        self.ridge = ridge
        for p in self.parts:
            p.set_ridge(ridge)

    def weighted(self, b):
        return (b * self.weight).ravel()

    def fit(self, b, price=None, unlimited=False):
        """(x (k,), gap): outputs within the ranges for what is wanted, b (s, 3).  unlimited: not above 0 only, with no upper ends."""
        left, top = self.weighted(b), None
        low = np.zeros_like(self.low) if unlimited else self.low
        if unlimited:
            top = np.full(len(self.low), np.inf)
        left = left - self.flat @ low
        x, gap = low.copy(), 0.
        for p in self.parts:
            found, g = p.fit(left, price, top)
            x[p.channels] += found
            gap = max(gap, g)
        return x, gap

    def error(self, x, b):
        """Root mean square of what is missing, as a part of that of what is wanted."""
        b = self.weighted(b)
        return float(np.linalg.norm(self.flat @ x - b) / max(np.linalg.norm(b), 1e-300))

    def bound(self, b):
        """The error that the best drive values of all would leave, those below 0 and above 1 among them."""
        b = self.weighted(b)
        inside = sum(np.sum((p.Q.T @ b[p.rows]) ** 2) for p in self.parts)
        return float(np.sqrt(max(b @ b - inside, 0) / max(b @ b, 1e-300)))


def spread(n, most):
    """Some of n frames, first and last among them."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(int))


def rise_by_noise(A, weight, low, high, ridge, wanted, noise):
    """By how much an error grows, at most, when the matrix that is solved with is off by `noise`, each number by itself."""
    true, rng = Fitter(A, weight, low, high, ridge), np.random.default_rng(5)
    off = Fitter(A * (1 + noise * rng.normal(size=A.shape)), weight, low, high, ridge)
    return max(true.error(off.fit(b)[0], b) - true.error(true.fit(b)[0], b) for b in wanted)


def small_enough(fitter, wanted):
    """The greatest ridge that leaves errors what they are: a smaller one costs time, and gains nothing."""
    last = np.inf
    for k, ridge in enumerate(DOWN):
        fitter.set_ridge(ridge)
        now = np.array([fitter.error(fitter.fit(b)[0], b) for b in wanted])
        if np.all(last - now <= np.maximum(NEARER[0], NEARER[1] * now)):
            return DOWN[k - 1]
        last = now
    return DOWN[-1]


def ridge_for(A, weight, low, high, wanted, noise):
    """(ridge, rise): the least that is worth having with which that noise raises no error by more than RISE."""
    least = small_enough(Fitter(A, weight, low, high, DOWN[0]), wanted)
    for ridge in [r for r in LADDER if r >= least]:
        rise = rise_by_noise(A, weight, low, high, ridge, wanted, noise) if noise else 0.
        if rise <= RISE:
            break
    return ridge, rise


def few_lights(fitter, wanted, owner, most):
    """(k,) bool: channels of `most` lights.  owner: (k,) number of the light that a channel belongs to.

    Each light has a price by the output it was used with before (reweighted L1): what is used little is dear.  The price goes up until so few are
    left; places that a large step left free are given to those that lasted longest.
    """
    effect = np.sqrt((fitter.flat ** 2).sum(0))
    scale = max(np.linalg.norm(fitter.weighted(b)) for b in wanted)

    def use(price):
        x = np.stack([fitter.fit(b, price)[0] for b in wanted]) - fitter.low
        return np.sqrt(np.bincount(owner, ((x * effect) ** 2).mean(0)))
    used, price = use(None), 1e-3
    lasted = used / used.max()          # how many rounds a light was worth its price, then how much it was used
    for k in range(1, 60):
        keep = used > 1e-3 * used.max()
        lasted[keep] = k + used[keep] / used.max()
        if keep.sum() <= most:
            break
        used = use(price * scale * effect * (used.max() / np.maximum(used, 1e-3 * used.max()))[owner] * .1)
        price *= 1.35
    return np.isin(owner, np.argsort(-lasted)[:most])


def coded(coding, fitter, x, wanted):
    """Codes (t, k) of outputs (t, k): rounded, and where steps are coarse (up to 12 bits) settled among each other."""
    codes = coding.codes(x)
    if coding.top.min() >= 4096:
        return codes
    together = fitter.flat.T @ fitter.flat
    own = fitter.used & (np.diag(together) > 0)
    kept = Coding(coding.top, coding.gamma, np.where(own, coding.low, codes[0]), np.where(own, coding.high, codes[0]))
    return np.stack([kept.settled(c, fitter.flat.T @ fitter.weighted(b), np.diag(together), together) for c, b in zip(codes, wanted)])


def smoothed(x, frames):
    """Drive values (t, k) averaged over time by a bell curve of that standard deviation, in frames: what lies in the ranges stays there."""
    if frames <= 0 or len(x) < 2:
        return x
    reach = int(np.ceil(3 * frames))
    bell = np.exp(-.5 * (np.arange(-reach, reach + 1) / frames) ** 2)
    at = np.arange(len(x))[:, None] + np.arange(-reach, reach + 1)
    w = np.where((at >= 0) & (at < len(x)), bell, 0)
    return np.stack([row_w @ x[np.clip(row, 0, len(x) - 1)] / row_w.sum() for row, row_w in zip(at, w)])


@dataclass(frozen=True, eq=False)
class Coding:
    """How outputs become whole numbers: drive = output ** (1 / gamma), code = drive (2^bits - 1)."""
    top: np.ndarray         # (k,) the greatest code
    gamma: np.ndarray
    low: np.ndarray         # (k,) least and greatest code that are in the range
    high: np.ndarray

    @classmethod
    def of(cls, channels):
        top = np.array([2 ** c.bits - 1 for c in channels], float)
        gamma = np.array([c.gamma for c in channels])
        low, high = (np.array([getattr(c, k) for c in channels]) ** (1 / gamma) * top for k in ("low", "high"))
        low, high = np.ceil(low - 1e-9), np.floor(high + 1e-9)
        return cls(top, gamma, np.minimum(low, high), high)

    def codes(self, x):
        return np.clip(np.round(np.maximum(x, 0) ** (1 / self.gamma) * self.top), self.low, self.high).astype(int)

    def settled(self, codes, b, effect, together):
        """Codes, moved one step here and there as long as that brings the sum of all lights nearer to what is wanted: rounded each by itself, their
        errors add up.

        b: (k,) of A'b, effect: (k,) of |a|^2, together: (k, k) of A'A.
        """
        codes, x = codes.copy(), self.output(codes)
        slope = together @ x - b
        for _ in range(4 * len(codes)):
            best, k, step = 0., -1, 0
            for d in (1, -1):
                new = codes + d
                move = np.where((new >= self.low) & (new <= self.high), self.output(np.clip(new, 0, None)) - x, 0)
                gain = -2 * move * slope - move * move * effect
                if gain.max() > best * (1 + 1e-9) + 1e-15 * abs(b @ x):
                    best, k, step = gain.max(), int(gain.argmax()), d
            if k < 0:
                break
            codes[k] += step
            was, x[k] = x[k], (codes[k] / self.top[k]) ** self.gamma[k]
            slope += together[:, k] * (x[k] - was)
        return codes

    def output(self, codes):
        return (codes / self.top) ** self.gamma
