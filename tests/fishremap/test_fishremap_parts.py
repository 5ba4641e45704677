"""fishremap's pure parts, each against a second method."""
import itertools

import numpy as np
import pytest

from conftest import BUILD
from process import execute

PARTS = BUILD / "test/fishremapparts"


def nnls(systems):
    m, n = systems[0][0].shape
    text = "\n".join(" ".join(f"{v:.17g}" for v in np.column_stack(s).ravel()) for s in systems)
    p = execute([PARTS, "nnls", str(m), str(n)], input=text.encode(), capture_output=True)
    assert p.returncode == 0, p.stderr
    return np.array([[float(x) for x in line.split()] for line in p.stdout.decode().splitlines()])


def best_of_all_supports(a, b):
    """The least |A x - b|^2 over x >= 0: it is plain least squares over some set of unknowns, the others 0; try them all."""
    best = b @ b
    for r in range(1, a.shape[1] + 1):
        for s in itertools.combinations(range(a.shape[1]), r):
            x = np.linalg.lstsq(a[:, s], b, rcond=None)[0]
            if (x >= 0).all():
                best = min(best, np.sum((a[:, s] @ x - b) ** 2))
    return best


@pytest.mark.parametrize("kind", ["any", "all positive", "all negative", "nearly dependent", "scaled"])
def test_least_squares_with_unknowns_that_are_not_negative(kind):
    rng = np.random.default_rng(74)
    systems = []
    for _ in range(20):
        a, x = rng.normal(size=(9, 6)), rng.normal(size=6)
        if kind == "nearly dependent":
            a[:, 1] = a[:, 0] + 1e-5 * rng.normal(size=9)
        if kind == "scaled":
            a *= 10.0 ** rng.uniform(-6, 6, 6)
        x = {"all positive": abs(x), "all negative": -abs(x)}.get(kind, x) / np.linalg.norm(a, axis=0)
        systems.append((a, a @ x + 0.1 * rng.normal(size=9)))
    got = nnls(systems)
    assert got.shape == (20, 6) and (got >= 0).all()
    for (a, b), x in zip(systems, got):
        assert np.sum((a @ x - b) ** 2) <= best_of_all_supports(a, b) * (1 + 1e-9)
        # Kuhn and Tucker: no unknown at 0 would fall further, none above 0 has a slope
        slope = a.T @ (b - a @ x) / np.linalg.norm(a, axis=0) / np.linalg.norm(b)
        assert (slope <= 1e-8).all() and (abs(slope[x > 0]) <= 1e-8).all()
