"""Lamps taken out: a light field as it was captured (version 1) beside what ilflamps makes of it (version 2), in rooms whose light is known.

Perfect captures of bench/lamps/rooms.py, without a camera: how many probes, how many rows each, and what is left of the gain when probes are
noisy, unequal, displaced or turned.  The error is that of irradiance upwards at 36 places .02, .1 and .3 m above the plane; seconds are those
of ilflamps.  Then rooms by chance, with what is rare among them (table.py --odd): how the gain is distributed, and how often the gate was wrong.
"""
import csv

import numpy as np

from . import run
from .run import OUT

HERE = f"{OUT}/lamps"
ROOMS = f"{run.PYTHON} bench/lamps/rooms.py"
HEIGHTS = (.02, .1, .3)
NUMBERS, ROWS = (2, 3, 4, 6, 8, 12, 30), (64, 100, 200, 400)
FAULTS = (("perfect", ""), ("noise of 1 %", "noise=.01"), ("gains differ by 1 %", "gain=.01"), ("displaced by 1 mm", "move=.001"), ("turned by .2 degrees", "turn=.2"),
          ("all four", "noise=.01 gain=.01 move=.001 turn=.2"))
CHANCE, FIRST, RARE = 100, 20261201, "6x6 128x64"


def errors(text):
    """{version: errors at the three heights, of the mean} and CPU seconds, from what rooms.py score prints."""
    words = {line.split()[0]: line.split()[1:] for line in text.splitlines() if line.strip()}
    one, two = ([float(x) / 100 for x in words["up"][k].split("/")] for k in (0, 2))
    return {1: one, 2: two}, float(words["CPU"][0])


def score(room, n, rows, more=""):
    """What rooms.py score prints of a field that is captured where it is not there; the command that a reader types."""
    name = f"{HERE}/{room}_{n}_{rows}{''.join(c if c.isalnum() else '_' for c in more)}"
    run.run(f"{ROOMS} make {room} {n}x{n} {2 * rows}x{rows} {name}.ilf.exr {more}".strip(), f"{name}.made", reads=[f"{name}.ilf.exr"])
    run.run(f"{ROOMS} walls {room} {name}.rad && oconv {name}.rad", f"{name}.oct")
    command = f"{ROOMS} score {room} {name}.ilf.exr --geometry {name}.oct"
    run.run(command, f"{name}.score", label=f"lamps: {room}, {n}x{n} probes of {rows} rows{', ' + more if more else ''}")
    found, cpu = errors((run.TOP / f"{name}.score").read_text())
    return found, cpu, command


def rows_of(figure, label, x, room, n, rows, more=""):
    found, cpu, command = score(room, n, rows, more)
    out = []
    for version in (1, 2):
        for k, z in enumerate(HEIGHTS):
            word = {1: 2, 2: 4}[version]
            out.append(dict(figure=figure, row=f"{label}, version {version}, {z:g} m up", x=x, y=found[version][k], error=found[version][k], reference="the room itself",
                            measure="irradiance upwards, rms / mean", note=f"{room}: version {version}, {z:g} m up", cpu_s=cpu if version == 2 else "",
                            command=f"{command} | awk '$1 == \"up\" {{split(${word}, e, \"/\"); print \"rmse\", e[{k + 1}] / 100}}'"))
    return out


def by_chance():
    """Deciles of the gain over rooms by chance, the worst of them, and how many are worse than version 1."""
    grid, texels = RARE.split()
    table = f"{HERE}/chance.csv"
    command = f"{run.PYTHON} bench/lamps/table.py --odd {FIRST}:{CHANCE} --grid {grid} --texels {texels} {table}"
    cost = run.run(command, f"{HERE}/chance.txt", label=f"lamps: {CHANCE} rooms by chance")
    with open(run.TOP / table, newline="") as f:
        found = [r for r in csv.DictReader(f) if int(r["lamps"])]
    gains, excess = np.array([float(r["gain"]) for r in found]), np.array([float(r["excess"]) for r in found])
    shared = dict(figure="chance", reference="the room itself", command=command, measure="gain: version 1's error / version 2's, mean over heights")
    out = [dict(shared, row=f"decile {k}", x=k, y=float(q), note="gain") for k, q in enumerate(np.quantile(gains, np.linspace(0, 1, 11)))]
    out.append(dict(shared, row="geometric mean", y=float(np.exp(np.log(gains).mean())), note=f"{len(found)} rooms with lamps", cpu_s=cost["cpu_s"]))
    out += [dict(shared, row=f"room {found[k]['room']}", y=float(gains[k]), error=float(excess[k]) / 100, measure="worse than version 1 by, upwards or sideways",
                 note=found[k]["verdicts"]) for k in np.argsort(-excess)[:5]]
    return out


def main(argv=()):
    jobs = [lambda n=n, room=room: rows_of("number", f"{room}, {n}x{n}", n, room, n, 64) for room in ("card", "twigs") for n in NUMBERS]
    jobs += [lambda r=r: rows_of("rows", f"card, {r} rows", r, "card", 6, r) for r in ROWS]
    jobs += [lambda k=k, f=f: rows_of("faults", f[0], k + 1, "card", 6, 128, f[1]) for k, f in enumerate(FAULTS)]
    run.write_rows("lamps", [r for part in run.several(jobs) for r in part] + by_chance())
