"""Says how far pictures are from a reference, in numbers and in a labelled figure.

Owns the error measures.  With a the picture, b the reference (linear radiance, RGB) and the mean <>
over the pixels of a region and the three channels,

    rmse   sqrt(<(a - b)^2>) / <b>           bias   <a - b> / <b>

of what the figure can show: a and b are first clipped at the figure's white, because the few pixels in which the
mirror ball shows a lamp, hundreds of times the mean, would outweigh all the rest.  rmse_unclipped is
the same of the radiances as they are.

ssim is the structural similarity of Wang et al. 2004 on the pictures as they are shown (grey, 0..1, one
exposure for all): Gaussian window of sigma 1.5 (11 x 11), K1 = 0.01, K2 = 0.03, mean of the map over the
region.

The mask is a picture of the same view: red where the table is, green where an object is (1 = wholly
covered); pixels with less than 0.999 of red + green are left out of every measure and are shown dimmed
in the error maps.  Beside PICTURE.hdr a PICTURE.json from timed.py gives the CPU time and the command.

usage: compare.py --reference LABEL=FILE --picture LABEL=FILE ... --mask FILE --csv OUT.csv -o OUT.png
       compare.py --show LABEL=FILE[@FACTOR] ... -o OUT.png   (pictures side by side, no numbers)
"""
import argparse
import csv
import json
import os
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import pictures  # noqa: E402

LUMINANCE = np.array([0.265, 0.670, 0.065])


# ---- measures ------------------------------------------------------------------------------------
def rmse(a, b, where):
    """Root of the mean squared difference over the region, relative to the reference's mean."""
    d = (a - b)[where]
    return float(np.sqrt((d * d).mean()) / b[where].mean())


def bias(a, b, where):
    return float((a - b)[where].mean() / b[where].mean())


def gaussian(sigma=1.5, half=5):
    x = np.arange(-half, half + 1)
    w = np.exp(-0.5 * (x / sigma) ** 2)
    return w / w.sum()


def blur(a, w):
    """Separable convolution; the picture is continued by reflection about its edge."""
    half = len(w) // 2
    for axis in (0, 1):
        pad = [(0, 0), (0, 0)]
        pad[axis] = (half, half)
        p = np.pad(a, pad, mode="symmetric")
        n = a.shape[axis]
        a = sum(wk * np.take(p, np.arange(k, k + n), axis) for k, wk in enumerate(w))
    return a


def ssim_map(a, b, peak=1.0):
    """Structural similarity of two grey pictures, per pixel."""
    w = gaussian()
    c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
    ma, mb = blur(a, w), blur(b, w)
    va, vb = blur(a * a, w) - ma * ma, blur(b * b, w) - mb * mb
    cov = blur(a * b, w) - ma * mb
    return ((2 * ma * mb + c1) * (2 * cov + c2)) / ((ma * ma + mb * mb + c1) * (va + vb + c2))


def exposure_of(a, where=None):
    """Factor that brings the 98th percentile of luminance to 0.8."""
    lum = a @ LUMINANCE
    p = np.percentile(lum if where is None else lum[where], 98)
    return 0.8 / p if p > 0 else 1.0


def display(a, exposure):
    """Linear radiance to sRGB values in 0..1: one factor, clipped."""
    x = np.clip(a * exposure, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def measures(picture, reference, regions, exposure):
    """[(region, measure, value)]; regions is {name: boolean array}."""
    grey = display(np.stack([picture @ LUMINANCE, reference @ LUMINANCE]), exposure)
    similar = ssim_map(grey[0], grey[1])
    white = 1.0 / exposure
    a, b = np.minimum(picture, white), np.minimum(reference, white)
    rows = []
    for name, where in regions.items():
        rows += [(name, "rmse", rmse(a, b, where)),
                 (name, "bias", bias(a, b, where)),
                 (name, "ssim", float(similar[where].mean())),
                 (name, "rmse_unclipped", rmse(picture, reference, where))]
    return rows


def regions_of(mask):
    table, objects = mask[..., 0], mask[..., 1]
    found = {"all": table + objects >= 0.999, "objects": objects >= 0.999, "table": table >= 0.999}
    return {name: where for name, where in found.items() if where.any()}


# ---- files ---------------------------------------------------------------------------------------
def labelled(text):
    label, eq, path = text.partition("=")
    if not eq or not label or not path:
        raise argparse.ArgumentTypeError(f"expected LABEL=FILE, found {text}")
    return label, path


def cost(path):
    try:
        with open(os.path.splitext(path)[0] + ".json") as f:
            return json.load(f)
    except (OSError, ValueError):
        return {}


def read_finite(path):
    a = pictures.read(path)
    if not np.isfinite(a).all():
        raise pictures.PictureError(f"{path}: expected finite values, found NaN or infinity")
    return a


def write_whole(path, write):
    tmp = f"{path}.{os.getpid()}.tmp"
    try:
        write(tmp)
        os.replace(tmp, path)
    finally:
        if os.path.exists(tmp):
            os.unlink(tmp)


def write_csv(path, rows):
    def write(tmp):
        with open(tmp, "w", newline="") as f:
            out = csv.writer(f)
            out.writerow(["picture", "reference", "measure", "value", "cpu_s", "command"])
            out.writerows(rows)
    write_whole(path, write)


# ---- figures -------------------------------------------------------------------------------------
INK, PAPER, QUIET = "#1d1f21", "#ffffff", "#5b6066"


def figure(columns, width_px):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib.figure import Figure
    matplotlib.rcParams.update({"font.family": "DejaVu Sans", "font.size": 8})
    return Figure(figsize=(columns * width_px / 100, 1), dpi=100, facecolor=PAPER)


def place(fig, image, left, top, w, h, size, **kw):
    """An axes that shows `image` in the rectangle (pixels from the top left) of a figure of `size`."""
    ax = fig.add_axes([left / size[0], 1 - (top + h) / size[1], w / size[0], h / size[1]])
    shown = ax.imshow(image, interpolation="lanczos", aspect="auto", **kw)
    ax.axis("off")
    return shown


def panels(columns, error_rows, title, path, extra=None, pane=420):
    """columns: [(label, display picture, [line, ...])]; error_rows: [(column, map)] in multiples of
    the reference's mean, drawn below with one scale for all; extra: (label, display picture) below the reference."""
    gap, head, caption = 14, 30 if title else 10, 64
    heights = [round(pane * c[1].shape[0] / c[1].shape[1]) for c in columns]
    high = max(heights)
    below = (high + 34) if error_rows else 0
    size = (gap + len(columns) * (pane + gap), head + high + caption + below + 6)
    fig = figure(1, 100)
    fig.set_size_inches(size[0] / 100, size[1] / 100)
    if title:
        fig.text(gap / size[0], 1 - 20 / size[1], title, color=INK, fontsize=10.5, weight="bold")
    for k, (label, image, lines) in enumerate(columns):
        x = gap + k * (pane + gap)
        place(fig, image, x, head + (high - heights[k]) / 2, pane, heights[k], size)
        fig.text(x / size[0], 1 - (head + high + 17) / size[1], label, color=INK, fontsize=9.5, weight="bold")
        for n, line in enumerate(lines):
            fig.text(x / size[0], 1 - (head + high + 35 + 17 * n) / size[1], line, color=QUIET, fontsize=8.5)
    top = head + high + caption
    for k, image in error_rows:
        x = gap + k * (pane + gap)
        shown = place(fig, image, x, top, pane, heights[k], size, cmap="RdBu_r", vmin=-1, vmax=1)
        fig.text(x / size[0], 1 - (top + high + 17) / size[1],
                 "difference from the reference", color=QUIET, fontsize=8)
    if error_rows:
        x = gap + (error_rows[0][0] - 1) * (pane + gap)
        if extra:
            tall = min(round(pane * extra[1].shape[0] / extra[1].shape[1]), high - 90)
            place(fig, extra[1], x, top, pane, tall, size)
            fig.text(x / size[0], 1 - (top + tall + 17) / size[1], extra[0], color=QUIET, fontsize=8)
        bar = fig.add_axes([(x + pane * 0.2) / size[0], 1 - (top + high - 16) / size[1],
                            pane * 0.7 / size[0], 10 / size[1]])
        fig.colorbar(shown, cax=bar, orientation="horizontal")
        bar.set_title("too dark        difference / mean of the reference        too bright", fontsize=8, color=QUIET)
        bar.tick_params(labelsize=8, colors=QUIET)
    write_whole(path, lambda tmp: fig.savefig(tmp, format="png", facecolor=PAPER))


def as_shown(path, factor=1.0):
    image = pictures.read(path)
    if pictures.is_linear(path):
        image = display(image, exposure_of(image) * factor)
    return np.clip(image, 0, 1)


def compare(a):
    label, path = a.reference
    reference = read_finite(path)
    mask = read_finite(a.mask)
    if mask.shape != reference.shape:
        raise pictures.PictureError(f"{a.mask}: expected the size of {path}, {reference.shape[:2]}, found {mask.shape[:2]}")
    regions = regions_of(mask)
    if "all" not in regions:
        raise pictures.PictureError(f"{a.mask}: expected covered pixels, found none")
    scale = exposure_of(reference, regions["all"])
    white = 1.0 / scale
    mean = np.minimum(reference, white)[regions["all"]].mean()
    spent = cost(path)
    columns = [(label, display(reference, scale), [f"the reference · {spent['cpu_s']:.0f} CPU s" if spent else "the reference"])]
    rows, maps = [], []
    for name, file in a.picture:
        picture = read_finite(file)
        if picture.shape != reference.shape:
            raise pictures.PictureError(f"{file}: expected the size of {path}, {reference.shape[:2]}, found {picture.shape[:2]}")
        found = measures(picture, reference, regions, scale)
        spent = cost(file)
        rows += [[name, label, f"{measure} ({region})", f"{value:.6g}", spent.get("cpu_s", ""), spent.get("command", "")]
                 for region, measure, value in found]
        value = {(region, measure): v for region, measure, v in found}
        line = f"RMSE {value['all', 'rmse']:.1%} of the mean · SSIM {value['all', 'ssim']:.3f}"
        more = " · ".join(f"{r} {value[r, 'rmse']:.1%}" for r in ("objects", "table") if (r, "rmse") in value)
        columns.append((name, display(picture, scale),
                        [line, more + (f" · {spent['cpu_s']:.0f} CPU s" if spent else "")]))
        error = (np.minimum(picture, white) - np.minimum(reference, white)) @ LUMINANCE / mean
        maps.append((len(columns) - 1, np.where(regions["all"], error, 0.0)))
    write_csv(a.csv, rows)
    panels(columns, maps, a.title, a.output, a.extra and (a.extra[0], as_shown(a.extra[1])))
    if not a.quiet:
        for row in rows:
            if row[2].endswith("(all)"):
                print(f"{row[0]}: {row[2][:-6]} {float(row[3]):.4f}" + (f" ({row[4]:.1f} CPU s)" if row[4] != "" and row[2].startswith("rmse (") else ""))


def show(a):
    columns = []
    for label, path in a.show:
        path, _, factor = path.partition("@")
        image = as_shown(path, float(factor or 1))
        head, _, rest = label.partition("|")
        columns.append((head, image, [s for s in rest.split("|") if s]))
    panels(columns, [], a.title, a.output, pane=a.pane)


def main():
    ap = argparse.ArgumentParser(description="error measures and labelled figures for rendered pictures")
    ap.add_argument("--reference", type=labelled, metavar="LABEL=FILE", help="the picture taken as true")
    ap.add_argument("--picture", type=labelled, action="append", default=[], metavar="LABEL=FILE", help="a picture to judge; again for each")
    ap.add_argument("--mask", metavar="FILE", help="red = table, green = objects; the rest is not judged")
    ap.add_argument("--csv", metavar="FILE", help="where the numbers go")
    ap.add_argument("--extra", type=labelled, metavar="LABEL=FILE", help="a further picture, below the reference")
    ap.add_argument("--show", type=labelled, action="append", default=[], metavar="LABEL=FILE[@FACTOR]",
                    help="only show, FACTOR times as bright as it would be; LABEL may go on with |lines")
    ap.add_argument("--pane", type=int, default=420, help="width of each picture shown with --show, pixels (420)")
    ap.add_argument("--title", default="", help="heading of the figure")
    ap.add_argument("--quiet", action="store_true", help="print nothing")
    ap.add_argument("-o", "--output", required=True, metavar="PNG")
    a = ap.parse_args()
    if not a.show and not (a.reference and a.picture and a.mask and a.csv):
        ap.error("expected --show, or --reference, --picture, --mask and --csv")
    try:
        if a.show:
            show(a)
        else:
            compare(a)
    except (pictures.PictureError, OSError, ValueError) as err:
        print(f"compare.py: {err}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
