"""What is clipped or black says nothing: the weights' ends."""
import numpy as np
import pytest

from hdrgen_util import hdrgen, radiance, write_png, write_times


@pytest.mark.parametrize("weight, apart", [("debevec", 400), ("debevec", 4), ("noise", 400)])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
@pytest.mark.case("clipped and black samples beside a good one", "tools/hdrgen/mergetab.c", "codes 255, 128, 0 of one pixel", "the good one alone (noise: to 1 %)")
def test_ends_of_the_range_weigh_nothing(tmp_path, weight, order, apart, row):
    """One pixel of every middle code z, exposed 1/apart, 1, and apart times: code 0, z, 255 with a linear response.  400 apart, exposures so
    short and so long have no say whatever their codes; 4 apart, a 0 is a dead pixel, which has none by its own weight."""
    z = np.arange(60, 200, dtype=np.uint8)
    z = np.repeat(np.tile(z, (8, 1))[..., None], 3, -1)
    pictures, times = [np.zeros_like(z), z, np.full_like(z, 255)], [1 / apart, 1.0, apart]
    names = []
    for k in order:
        names.append(f"{k}.png")
        write_png(tmp_path / names[-1], pictures[k])
    write_times(tmp_path, names, [times[k] for k in order])
    options = ["--response", "linear", "--weight", weight]
    hdrgen(tmp_path, names, *options, out="all.exr")
    hdrgen(tmp_path, ["1.png"], *options, out="one.exr")
    ratio = radiance(tmp_path / "all.exr") / radiance(tmp_path / "one.exr")
    # the middle exposure's own weight is the same in both: what differs came from the ends
    worst = np.abs(ratio / np.median(ratio) - 1).max()
    level = abs(np.median(ratio) - 1)
    row(condition=f"{weight}, {apart} apart, order {order}", error=f"{max(worst, level):.1e}")
    assert worst < (1e-6 if weight == "debevec" else 1e-2) and level < 1e-2


@pytest.mark.parametrize("times", [(1.0, 2.0), (2.0, 1.0)], ids=["longer", "shorter"])
@pytest.mark.case("clipped though it should not be", "tools/hdrgen/mergetab.c", "codes 110..125, and 255 in an exposure of half or twice the time", "the one that is not clipped alone, to 1 %")
def test_clipped_against_expectation(tmp_path, times, row):
    """A glint in the other exposure: 255 means at least that much, not that much."""
    z = np.repeat(np.tile(np.arange(110, 126, dtype=np.uint8), (8, 1))[..., None], 3, -1)
    for name, codes in (("a.png", z), ("b.png", np.full_like(z, 255))):
        write_png(tmp_path / name, codes)
    write_times(tmp_path, ["a.png", "b.png"], times)
    hdrgen(tmp_path, ["a.png", "b.png"], "--response", "linear", out="all.exr")
    hdrgen(tmp_path, ["a.png"], "--response", "linear", out="one.exr")
    worst = np.abs(radiance(tmp_path / "all.exr") / radiance(tmp_path / "one.exr") - 1).max()
    row(error=f"{worst:.1e} <= 1e-2")
    assert worst <= 1e-2
