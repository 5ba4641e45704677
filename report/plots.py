"""Plots of the sweeps, as PNG bytes.

One look for all: a series keeps its colour and marker (colours that differ for colour-blind eyes too), log axes unless said.
"""
import io

import matplotlib
matplotlib.use("Agg")
from matplotlib.figure import Figure  # noqa: E402
from matplotlib.ticker import FuncFormatter  # noqa: E402

COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a6d00", "#56b4e9", "#444444", "#e69f00", "#7a4fb5"]
MARKERS = "osD^vPX*<"
INK, QUIET = "#1d1f21", "#5b6066"
matplotlib.rcParams.update({"font.family": "DejaVu Sans", "font.size": 10, "axes.edgecolor": QUIET, "axes.labelcolor": INK, "text.color": INK,
                            "xtick.color": QUIET, "ytick.color": QUIET})


def png(fig):
    out = io.BytesIO()
    fig.savefig(out, format="png", facecolor="white")
    return out.getvalue()


def plain(x, _):
    return f"{x:g}"


def percent(x, _):
    return f"{100 * x:g} %"


def axes(title, xlabel, ylabel, size=(7.2, 4.8)):
    fig = Figure(figsize=size, dpi=130, constrained_layout=True)
    ax = fig.add_subplot()
    ax.set_title(title, fontsize=11, loc="left", weight="bold")
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    ax.grid(True, which="major", color="#d9dcdf", linewidth=0.8)
    ax.grid(True, which="minor", color="#eef0f1", linewidth=0.5)
    ax.set_axisbelow(True)
    return fig, ax


def ticks(ax, which):
    """1-2-5 numbers on a log axis instead of powers of ten."""
    from matplotlib.ticker import LogLocator, NullFormatter
    axis = {"x": ax.xaxis, "y": ax.yaxis}[which]
    axis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=20))
    axis.set_minor_formatter(NullFormatter())
    axis.set_major_formatter(FuncFormatter(percent if which == "y" else plain))


def curves(series, title, xlabel, ylabel, floor=None, log=(True, True), labels=(), size=(7.6, 4.6)):
    """series: {name: [(x, y), ...]}; floor: (name, y), a level of dashes; labels: [(x, y, text)] beside points."""
    fig, ax = axes(title, xlabel, ylabel, size)
    for k, (name, points) in enumerate(series.items()):
        points = sorted(points)
        ax.plot([p[0] for p in points], [p[1] for p in points], marker=MARKERS[k % len(MARKERS)], color=COLOURS[k % len(COLOURS)],
                label=name, linewidth=1.6, markersize=5.5)
    if floor:
        ax.axhline(floor[1], color=QUIET, linestyle="--", linewidth=1)
        ax.annotate(floor[0], (0.99, floor[1]), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8.5, color=QUIET)
    for x, y, text in labels:
        ax.annotate(text, (x, y), textcoords="offset points", xytext=(5, 5), fontsize=8.5, color=QUIET)
    if log[0]:
        ax.set_xscale("log")
        ticks(ax, "x")
    if log[1]:
        ax.set_yscale("log")
        ticks(ax, "y")
    else:
        ax.yaxis.set_major_formatter(FuncFormatter(percent))
        ax.set_ylim(bottom=0)
    if len(series) > 1:
        # below the plot where it is narrow, so that it hides nothing
        narrow = size[0] < 5
        fig.legend(loc="outside lower left", fontsize=8.5, frameon=False, ncols=1 if narrow else 2)
    return png(fig)


def bars(items, title, xlabel, width=7.6):
    """items: [(name, value)], largest first as given; log axis."""
    fig, ax = axes(title, xlabel, "", size=(width, 1.0 + 0.42 * len(items)))
    names = [n for n, _ in items][::-1]
    values = [v for _, v in items][::-1]
    ax.barh(range(len(names)), values, color=COLOURS[0], height=0.62)
    ax.set_yticks(range(len(names)), names)
    ax.set_xscale("log")
    low, high = min(v for v in values if v > 0), max(values)
    ax.set_xlim(low / 2, high * 3)
    from matplotlib.ticker import LogLocator, NullFormatter
    ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high / low < 200 else (1,), numticks=20))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.xaxis.set_major_formatter(FuncFormatter(percent))
    for k, v in enumerate(values):
        ax.annotate(f"{100 * v:.2g} %", (v, k), textcoords="offset points", xytext=(4, 0), va="center", fontsize=8.5)
    return png(fig)
