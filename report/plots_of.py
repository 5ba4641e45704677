"""Which plots each section gets, from its rows: [(file name, caption, wide PNG, narrow PNG)].

Rows are dicts as in the CSV; x and y are what a plot shows, `note` names the series.
"""
from . import plots

WIDE, NARROW = (7.6, 4.6), (4.2, 4.6)


def value(row, key):
    return float(row[key])


def series(rows, key="note"):
    found = {}
    for r in rows:
        if r["x"] and r["y"]:
            found.setdefault(r[key], []).append((value(r, "x"), value(r, "y")))
    return found


def two(draw):
    return draw(WIDE), draw(NARROW)


def own_error(rows):
    known = [float(r["reference_error"]) for r in rows if r["reference_error"]]
    return ("the reference's own error", max(known)) if known else None


def time(rows):
    return [("time", "Error against CPU seconds of the renderer; both axes logarithmic. Down and left is better.",
             *two(lambda size: plots.curves(series(rows), "Error against run time", "CPU seconds", "RMSE / mean", own_error(rows), size=size)))]


def size(rows):
    out = []
    for name, caption, label in (("positions", "Fewer probes: every n-th of the finest grid. The error is against the room itself.", "probes along each edge"),
                                 ("directions", "Smaller probes: box filter, the finest grid. The error is against the room itself.", "texels around, n_theta")):
        part = [r for r in rows if r["figure"] == name]
        if part:
            out.append((name, caption, *two(lambda s, p=part, w=label: plots.curves(series(p), "Error against the number of " + ("probes" if w[0] == "p" else "directions"),
                                                                                    w, "RMSE / mean", own_error(p), size=s))))
    return out


def storage(rows):
    points = {r["row"]: [(value(r, "x"), value(r, "y"))] for r in rows if r["y"] and float(r["y"]) > 0}
    return [("storage", "Error of the texels against bytes of the file. Lossless forms of float texels are exact and not shown.",
             *two(lambda s: plots.curves(points, "Storage forms", "megabytes", "RMS error of texels / mean", size=s)))] if points else []


def budget(rows):
    items = sorted(((r["row"], value(r, "y")) for r in rows if r["figure"] == "budget" and r["y"] and float(r["y"]) > 0), key=lambda x: -x[1])
    return [("budget", "What each stage adds when it alone is real and all others are ideal; the longest bar is what to improve first.",
             *two(lambda s: plots.bars(items, "Error budget of the chain", "RMSE / mean", width=s[0])))] if items else []


def ends(rows):
    """The first and the last point of each family, to be named in the plot; those between follow."""
    found = []
    for name in dict.fromkeys(r["note"] for r in rows):
        part = sorted((value(r, "x"), value(r, "y"), r["row"]) for r in rows if r["note"] == name)
        found += [part[0], part[-1]] if len(part) > 1 else part
    return found


def depth(rows):
    return [("depth", "The closer the auxiliary geometry is to the true room, the better. Across: by how much two neighbouring probes, looking at one and "
             "the same point of the light, miss each other, weighted with the light.",
             *two(lambda s: plots.curves(series(rows), "Depth correction", "neighbours disagree by, degrees", "RMSE / mean", own_error(rows), size=s,
                                         log=(False, True), labels=ends(rows))))] if rows else []


def grid(rows):
    return [("grid", "Finer grids of probes follow sharper light.",
             *two(lambda s: plots.curves(series(rows), "Spatial resolution", "probes along each edge", "RMSE / mean", own_error(rows), size=s)))] if rows else []


def lamps(rows):
    out = []
    for name, caption, label, log in (
            ("number", "Few probes are enough once lamps are taken out: how high above the plane the light is asked for costs more than how many probes there were.",
             "probes along each edge", (True, True)),
            ("rows", "Finer probes: what they gain, in one room at 6 × 6 places.", "rows of a probe", (True, True)),
            ("faults", "Faults of the capture, one at a time and together (1: none, then noise, gain, place, turn, all; the table names them).", "fault", (False, True))):
        for room in dict.fromkeys(r["note"].split(":")[0] for r in rows if r["figure"] == name):
            part = [dict(r, note=r["note"].split(": ")[1]) for r in rows if r["figure"] == name and r["note"].startswith(room + ":")]
            out.append((f"lamps_{name}_{room}", f"Room \u201c{room}\u201d. {caption}",
                        *two(lambda s, p=part, w=label, g=log: plots.curves(series(p), "Lamps taken out", w, "irradiance, rms / mean", size=s, log=g))))
    return out


def shrink(rows):
    kinds = {}
    for r in rows:
        if float(r["y"]) > 1e-9:
            kinds.setdefault(r["note"].split(":")[0], []).append((value(r, "x"), value(r, "y")))
    return [("shrink", "Error of irradiance against bytes of the file. Lossless forms are exact and not shown.",
             *two(lambda s: plots.curves(kinds, "Light fields that shrink", "megabytes", "irradiance, rms / mean", size=s)))] if kinds else []


OF = {"time": time, "size": size, "storage": storage, "budget": budget, "depth": depth, "grid": grid, "lamps": lamps, "shrink": shrink}
