"""hdrgen's pure parts, each against a second method or an exact answer."""

import numpy as np
import pytest

from conftest import BUILD
from process import execute

PARTS = BUILD / "test" / "hdrgenparts"


def parts(*args, numbers):
    text = "\n".join(" ".join(f"{v:.17g}" for v in np.atleast_1d(row)) for row in numbers)
    p = execute([PARTS, *map(str, args)], input=text.encode(), capture_output=True)
    assert p.returncode == 0, p.stderr
    return [np.array([float(x) for x in line.split()]) for line in p.stdout.decode().splitlines()]


def test_splines_are_a_partition_of_one_with_the_right_derivatives():
    v = np.linspace(0.01, np.log(255) - 0.01, 301)
    rows = np.array(parts("basis", 255, 0, numbers=v))
    assert np.allclose(rows[:, 0], 1, atol=1e-14) and (rows[:, 2:] >= -1e-15).all()

    def dense(at, deriv):
        out = np.zeros((len(at), 40))
        for i, r in enumerate(parts("basis", 255, deriv, numbers=at)):
            out[i, int(r[1]):int(r[1]) + 4] = r[2:]
        return out
    h = 1e-5
    first = (dense(v + h, 0) - dense(v - h, 0)) / (2 * h)
    second = (dense(v + h, 1) - dense(v - h, 1)) / (2 * h)
    assert np.abs(dense(v, 1) - first).max() < 1e-5 * np.abs(first).max()
    assert np.abs(dense(v, 2) - second).max() < 1e-3 * np.abs(second).max()


@pytest.mark.parametrize("rows, columns", [(40, 7), (2000, 30), (5, 5)])
def test_least_squares_by_blocks_is_least_squares(rows, columns):
    rng = np.random.default_rng(rows)
    a, b = rng.normal(size=(rows, columns)) * 10 ** rng.uniform(-3, 3, columns), rng.normal(size=rows)
    out = parts("lsq", columns, numbers=np.column_stack([a, b]))[0]
    x, rss, rank, s = np.linalg.lstsq(a, b, rcond=1e-13)
    assert np.allclose(out[:columns], x, rtol=1e-8)
    assert np.isclose(out[columns], s[0] / s[-1], rtol=1e-6) and out[columns + 1] == rank
    assert np.isclose(out[columns + 2], rss[0] if rows > columns else 0, rtol=1e-8, atol=1e-12)


def test_rank_deficient_gives_the_shortest_solution():
    rng = np.random.default_rng(1)
    a = rng.normal(size=(50, 4))
    a = np.column_stack([a, a[:, 0] + a[:, 1]])
    b = rng.normal(size=50)
    out = parts("lsq", 5, numbers=np.column_stack([a, b]))[0]
    assert out[6] == 4 and np.allclose(out[:5], np.linalg.pinv(a) @ b, rtol=1e-8)


def test_eliminated_unknowns_are_solved_for_all_the_same():
    rng = np.random.default_rng(2)
    blocks, n = 60, 5
    u, a, b = rng.normal(size=3 * blocks), rng.normal(size=(3 * blocks, n)), rng.normal(size=3 * blocks)
    out = parts("eliminate", n, numbers=np.column_stack([u, a, b]))[0]
    full = np.zeros((3 * blocks, n + blocks))
    full[:, :n] = a
    full[np.arange(3 * blocks), n + np.arange(3 * blocks) // 3] = u
    x, rss, *_ = np.linalg.lstsq(full, b, rcond=None)
    assert np.allclose(out[:n], x[:n], rtol=1e-9) and np.isclose(out[n + 2], rss[0])


def test_monotone_is_isotonic_regression_of_the_logarithm():
    rng = np.random.default_rng(3)
    y = np.log(np.arange(1, 61)) * 2 + rng.normal(size=60) * 0.2
    rows = parts("monotone", numbers=np.exp(y))
    got = np.log(np.array(rows[2:]).ravel())
    # min-max formula: max over i <= k of min over j >= k of mean(y[i..j])
    best = [max(min(y[i:j + 1].mean() for j in range(k, 60)) for i in range(k + 1)) for k in range(60)]
    assert np.abs(got - best).max() < 1e-6 and (np.diff(got) > 0).all()
    rising = np.exp(np.sort(y))
    assert parts("monotone", numbers=rising)[0][0] == 0
    assert parts("monotone", numbers=[1, -2, 3])[0][0] == -1


@pytest.mark.parametrize("photon, read, code", [(5e-5, 4e-4, 1 / 12), (1e-3, 0, 1 / 12), (0, 2e-3, 4.0), (2e-5, 1e-4, 0.5)])
def test_noise_parameters_come_back(photon, read, code):
    rng = np.random.default_rng(4)
    e = np.geomspace(1e-4, 0.9, 40)
    slope = 1 / 255 * 2.2 * e ** (1 - 1 / 2.2)
    var = (photon * e + read ** 2 + code * slope ** 2) / e ** 2
    n = np.full(40, 4000.0)
    measured = var * rng.chisquare(n) / n
    bad, p, r, c = parts("noise", numbers=np.column_stack([n, e, slope, measured]))[0]
    model = (p * e + r ** 2 + c * slope ** 2) / e ** 2
    assert bad == 0 and min(p, r) >= 0 and c >= 1 / 12 - 1e-12
    assert np.abs(model / var - 1).max() < 0.1     # the sum is known well even where the shares are not
    assert parts("noise", numbers=np.ones((2, 4)))[0][0] == -1


@pytest.mark.parametrize("order", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_mosaic_of_a_grey_ramp_is_exact_inside(order):
    h, w = 16, 20
    yy, xx = np.mgrid[0:h, 0:w]
    ramp = 1 + 0.1 * xx + 0.05 * yy
    rgb = np.array(parts("mosaic", order, w, h, numbers=ramp.ravel())).reshape(h, w, 3)
    assert np.abs(rgb[2:-2, 2:-2] / ramp[2:-2, 2:-2, None] - 1).max() < 1e-5
    assert (rgb > 0).all()
    flat = np.array(parts("mosaic", order, 3, 3, numbers=np.full(9, 2.0)))
    assert np.allclose(flat, 2)
