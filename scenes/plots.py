"""Draws two of the paper's figures: the exposure series as a strip (figure 5), the lens's falloff as measured (figure 6).

usage: plots.py strip --times times.txt --title TEXT -o OUT.png        (the pictures lie beside times.txt)
       plots.py falloff --measured FILE --true FILE --title TEXT -o OUT.png
"""
import argparse
import os
import sys
from fractions import Fraction

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import compare  # noqa: E402
import pictures  # noqa: E402

COLOURS = {"red": "#b3312c", "green": "#2f7d3b", "blue": "#2b5fa8"}


def exposures(path):
    """[(seconds, file)] of a times file, from the shortest on."""
    found = []
    with open(path) as f:
        for line in f:
            words = line.split("#")[0].split()
            if len(words) >= 2:
                found.append((float(Fraction(words[1])), os.path.join(os.path.dirname(path), words[0])))
    if not found:
        raise pictures.PictureError(f"{path}: expected lines of an image and its seconds, found none")
    return sorted(found)


def time_label(t):
    return f"{t:g} s" if t >= 1 else f"1/{round(1 / t)} s"


def strip(a):
    series = exposures(a.times)
    pane, gap, head, foot = 104, 4, 34, 30
    size = (gap + len(series) * (pane + gap), head + pane + foot)
    fig = compare.figure(1, 100)
    fig.set_size_inches(size[0] / 100, size[1] / 100)
    fig.text(gap * 2 / size[0], 1 - 21 / size[1], a.title, color=compare.INK, fontsize=10.5, weight="bold")
    for k, (t, file) in enumerate(series):
        x = gap + k * (pane + gap)
        compare.place(fig, pictures.read(file), x, head, pane, pane, size)
        fig.text((x + pane / 2) / size[0], 1 - (head + pane + 18) / size[1], time_label(t), color=compare.QUIET, fontsize=8, ha="center")
    compare.write_whole(a.output, lambda tmp: fig.savefig(tmp, format="png", facecolor=compare.PAPER))


def curve(path):
    """angles (n) and values (n, 3) of a falloff file, relative to the first."""
    try:
        rows = [[float(x) for x in line.split("#")[0].split()[:4]] for line in open(path) if line.split("#")[0].strip()]
        table = np.array(rows)
        assert table.shape[1:] == (4,) and len(table) > 1 and np.isfinite(table).all() and (table[:, 1:] > 0).all()
    except (ValueError, AssertionError) as err:
        raise pictures.PictureError(f"{path}: expected lines of degrees and three positive values") from err
    return table[:, 0], table[:, 1:] / table[0, 1:]


def readings(path):
    """angles and values of the "# reading ANGLE deg R G B" lines that falloffcal leaves in its file."""
    rows = [line.split() for line in open(path) if line.startswith("# reading ")]
    table = np.array([[float(w[2]), *map(float, w[4:7])] for w in rows]).reshape(-1, 4)
    return table[:, 0], table[:, 1:]


def falloff(a):
    angle, measured = curve(a.measured)
    at, read = readings(a.measured)
    true_angle, true = curve(a.true)
    fig = compare.figure(1, 100)
    fig.set_size_inches(8.4, 5.4)
    fig.text(0.03, 0.955, a.title, color=compare.INK, fontsize=10.5, weight="bold")
    top = fig.add_axes([0.09, 0.40, 0.88, 0.51])
    low = fig.add_axes([0.09, 0.10, 0.88, 0.21])
    worst = 0.0
    for c, (name, colour) in enumerate(COLOURS.items()):
        top.plot(angle, measured[:, c], color=colour, lw=1.6, label=f"{name}, measured")
        top.plot(at, read[:, c], "o", ms=3.2, mfc="white", mec=colour, mew=1)
        top.plot(true_angle, true[:, c], color=compare.INK, lw=1, ls=(0, (4, 3)), label="the virtual lens itself" if c == 2 else None)
        off = 100 * (measured[:, c] / np.interp(angle, true_angle, true[:, c]) - 1)
        worst = max(worst, np.abs(off).max())
        low.plot(angle, off, color=colour, lw=1.4)
    top.set_ylabel("brightness relative to the axis")
    top.set_ylim(0.45, 1.04)
    top.legend(frameon=False, loc="lower left")
    low.axhline(0, color=compare.INK, lw=0.8, ls=(0, (4, 3)))
    low.set_ylabel("error, %")
    low.set_xlabel(f"angle from the axis, degrees (rings: readings of the source; worst error of the curves {worst:.2f} %)")
    for ax in (top, low):
        ax.set_xlim(0, max(angle.max(), true_angle.max()))
        ax.grid(color="#e3e5e8", lw=0.7)
        ax.tick_params(colors=compare.QUIET)
        for side in ("top", "right"):
            ax.spines[side].set_visible(False)
    compare.write_whole(a.output, lambda tmp: fig.savefig(tmp, format="png", facecolor=compare.PAPER))


def main():
    ap = argparse.ArgumentParser(description="figures 5 and 6")
    ways = ap.add_subparsers(dest="what", required=True)
    for name, files in (("strip", ["--times"]), ("falloff", ["--measured", "--true"])):
        p = ways.add_parser(name)
        for f in files:
            p.add_argument(f, required=True, metavar="FILE")
        p.add_argument("--title", default="")
        p.add_argument("-o", "--output", required=True, metavar="PNG")
    a = ap.parse_args()
    try:
        {"strip": strip, "falloff": falloff}[a.what](a)
    except (pictures.PictureError, OSError, ValueError) as err:
        print(f"plots.py: {err}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
