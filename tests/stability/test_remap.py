"""The remap's Jacobian where it is far from constant: a whole hemisphere in few texels."""
import numpy as np
import pytest

import fishremap_util as U
from conftest import run


@pytest.mark.parametrize("lens, tolerance", [("equidistant", .002), ("equisolid", .002), ("stereographic", .002), ("orthographic", .01)])
@pytest.mark.parametrize("size", ["1x1", "4x1", "3x2"])
@pytest.mark.case("a hemisphere in a few texels", "tools/fishremap/weights.c", "solid angle per area varies up to 1/cos", "mean of 1 + cos over solid angle: 3/2")
def test_mean_of_a_hemisphere(tmp_path, lens, tolerance, size, row):
    """Without the Jacobian: 1.667 (orthographic), 1.463 (equidistant)."""
    w, h = map(int, size.split("x"))
    U.write_exr(tmp_path / "in.exr", U.fisheye(lambda d: np.repeat(1 + np.clip(d[..., 2:], 0, 1), 3, -1), 400, 180, lens))
    run("fishremap", "--lens", lens, "--fov", 180, "--size", size, "--polar-max", 90, "-o", tmp_path / "o.exr", tmp_path / "in.exr")
    got = U.read_exr(tmp_path / "o.exr")[0][..., :3]
    edge = np.cos(np.pi / 2 * np.arange(h + 1) / h)
    exact = 1 + (edge[:-1] + edge[1:]) / 2                     # mean of cos over a ring
    error = np.abs(got / exact[:, None, None] - 1).max()
    row(condition=f"{lens} to {w}x{h}", error=f"{error:.1e} <= {tolerance}")
    assert error <= tolerance
