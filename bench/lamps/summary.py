"""What table.py's rooms say together, as Markdown: gains by kind of room, their distribution, verdicts, the worst cases.

    summary.py TABLE.csv...

A verdict is wrong where lamps were taken out and up or side at some height is more than .2 points worse than version 1.  Left: no lamp
of the room was taken out (gain 1).
"""
import csv, sys
import numpy as np

MARGIN = .2
HEIGHTS = "0.02", "0.1", "0.3"


def rows_of(paths):
    out = []
    for path in paths:
        with open(path, newline="") as f:
            out += [r for r in csv.DictReader(f) if int(r["lamps"])]
    return out


def gain(r): return float(r["gain"])
def mean(rows): return float(np.exp(np.mean([np.log(gain(r)) for r in rows])))
def figures(r, key): return " / ".join(f"{float(r[f'{key}_{z}']):.2f}" for z in HEIGHTS)
def wrong(r): return int(r["taken"]) and float(r["excess"]) > MARGIN


def by_kind(rows):
    kinds = {}
    for r in rows: kinds.setdefault(r["room"].split(":")[0], []).append(r)
    print("| rooms | number | gain | least | *up* of version 1 | of version 2 | CPU s |\n|---|---|---|---|---|---|---|")
    for k, v in kinds.items():
        med = sorted(v, key=gain)[len(v) // 2]
        print(f"| {k} | {len(v)} | {mean(v):.1f} | {min(map(gain, v)):.1f} | {figures(med, 'up_1')} | {figures(med, 'up_2')} | "
              f"{np.mean([float(r['cpu_s']) for r in v]):.0f} |")


def all_together(rows):
    g = np.array([gain(r) for r in rows])
    left = sum(not int(r["taken"]) for r in rows)
    bad = [r for r in rows if wrong(r)]
    print(f"\n{len(rows)} rooms: geometric mean gain {mean(rows):.2f}; tenths of the rooms gain at most "
          f"{', '.join(f'{q:.1f}' for q in np.quantile(g, np.linspace(.1, 1, 10)))}.")
    print(f"No lamp taken out in {left}; worse than version 1 by more than {MARGIN} in {len(bad)}.")
    print(f"CPU seconds: {np.mean([float(r['cpu_s']) for r in rows]):.0f} on the average, {max(float(r['cpu_s']) for r in rows):.0f} at most.")
    if bad: print("\n| worst | by | up | side | what was thought |\n|---|---|---|---|---|")
    for r in sorted(bad, key=lambda r: -float(r["excess"]))[:8]:
        print(f"| {r['room']} | {float(r['excess']):.2f} | {figures(r, 'up_1')} > {figures(r, 'up_2')} | {figures(r, 'side_1')} > "
              f"{figures(r, 'side_2')} | {r['verdicts'].replace('|', ';')} |")


if __name__ == "__main__":
    rows = rows_of(sys.argv[1:])
    if not rows: raise SystemExit(__doc__)
    by_kind(rows), all_together(rows)
