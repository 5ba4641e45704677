"""How far a picture is from a reference, over the pixels that count.

The definitions are those of scenes/compare.py.  For the sweeps

    rmse   sqrt(<(a - b)^2>) / <b>      over pixels and R, G, B, unclipped linear radiance
    ssim   structural similarity (Wang et al. 2004) of the pictures as they are shown, mean over the same pixels

over the lit pixels: wholly covered by table or objects in the mask (red + green >= 0.999), reference above zero.  No mirror
shows a lamp in the sweeps' scene, so that nothing needs clipping.
"""
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "scenes"))
import compare  # noqa: E402
import pictures  # noqa: E402

RMSE = "RMSE / mean over lit pixels"


def lit(mask, reference):
    where = (mask[..., 0] + mask[..., 1] >= 0.999) & (reference @ compare.LUMINANCE > 0)
    if not where.any():
        raise pictures.PictureError("expected lit pixels, found none")
    return where


def errors(picture, reference, mask):
    """{rmse, bias, ssim} of a picture."""
    if not picture.shape == reference.shape == mask.shape:
        raise pictures.PictureError(f"expected pictures of one size, found {picture.shape[:2]}, {reference.shape[:2]}, {mask.shape[:2]}")
    where = lit(mask, reference)
    exposure = compare.exposure_of(reference, where)
    grey = compare.display(np.stack([picture @ compare.LUMINANCE, reference @ compare.LUMINANCE]), exposure)
    return {"rmse": compare.rmse(picture, reference, where), "bias": compare.bias(picture, reference, where),
            "ssim": float(compare.ssim_map(grey[0], grey[1])[where].mean())}


def split_error(halves, mask):
    """Error of the mean of two independent pictures of one thing: half of the RMS of their difference."""
    a, b = halves
    mean = (a + b) / 2
    where = lit(mask, mean)
    return float(np.sqrt((((a - b)[where] / 2) ** 2).mean()) / mean[where].mean())


def of_files(picture, reference, mask):
    return errors(compare.read_finite(picture), compare.read_finite(reference), compare.read_finite(mask))


def of_files_clipped(picture, reference, mask):
    """As scenes/compare.py judges a figure: clipped at its white, all covered pixels."""
    a, b, m = (compare.read_finite(f) for f in (picture, reference, mask))
    if not a.shape == b.shape == m.shape:
        raise pictures.PictureError(f"{picture}: expected the size of {reference}, {b.shape[:2]}, found {a.shape[:2]}")
    where = {"all": compare.regions_of(m)["all"]}
    return {name: value for _, name, value in compare.measures(a, b, where, compare.exposure_of(b, where["all"]))}
