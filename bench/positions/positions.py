"""Error against the number of positions, for scenes/adaptive.py: in rooms whose light is known, and of light that was measured.

    positions.py rooms TABLE.csv ROOM[/MOST]...               rooms of bench/lamps/rooms.py, a camera at nodes of 8x8, most (24) of them
    positions.py measured OUT.png TABLE.csv FILE.csv...        illuminances on a small cube at many places of a room (six faces, x, y, z)

rooms: probes at a coarse grid, ilfpack --positions, adaptive.py, and again; irradiance upwards .02, .1 and .3 m above the plane in % of its mean,
beside that of all 64 by ilflamps.  measured: places are chosen one by one by the same doubt, every face being a lamp of its own, from eight
that are far from each other; the light elsewhere is the mean of the chosen places, weighted by 1/distance^2.  Error: rms over faces, % of the mean
illuminance, at places not chosen; and by leaving out the chosen ones, one by one, which is all that a capture could know.  Random choices stand
beside it (means of 50).
"""
import csv
import json
import os
import subprocess
import sys

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
TOP = os.path.dirname(os.path.dirname(HERE))
sys.path[:0] = [os.path.join(TOP, "scenes"), os.path.join(TOP, "bench", "lamps")]
import adaptive  # noqa: E402

COARSE, FIRST, DRAWS = [(i, j) for j in (0, 2, 5, 7) for i in (0, 2, 5, 7)], 8, 50
ALL = [(i, j) for j in range(8) for i in range(8)]


# ---- rooms --------------------------------------------------------------------------------------------------

def program(*words):
    p = subprocess.run(list(map(str, words)), capture_output=True)
    if p.returncode:
        sys.exit(f"positions.py: {' '.join(map(str, words))}: {p.stderr.decode()}")
    return p.stdout


def write_probe(path, rgb):
    import OpenEXR
    with OpenEXR.File({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "ilf:polarMax": float(np.pi / 2)},
                      {"RGB": np.ascontiguousarray(rgb, np.float32)}) as f:
        f.write(str(path))


class Captured:
    """A room, its probes at all nodes, and how far a light field is from it."""

    def __init__(self, name, folder):
        import rooms
        self.room, self.folder = rooms.named(name), folder
        self.score = rooms.Score(self.room, patches=8, most=3000, rest=2000)
        os.makedirs(folder, exist_ok=True)
        with open(f"{folder}/walls.rad", "w", encoding="utf-8") as f:
            f.write(rooms.walls(self.room))
        with open(f"{folder}/walls.oct", "wb") as f:
            f.write(program("oconv", "-f", f"{folder}/walls.rad"))
        for i, j in ALL:
            write_probe(f"{folder}/{i}_{j}.exr", self.room.probe([i / 7 - .5, j / 7 - .5, 0], 256, 128))

    def pack(self, nodes, out):
        with open(f"{self.folder}/table.txt", "w", encoding="utf-8") as f:
            f.writelines(f"{self.folder}/{i}_{j}.exr {i / 7 - .5:.9g} {j / 7 - .5:.9g} 0 0\n" for i, j in nodes)
        program("ilfpack", "--quiet", "--refine", "never", "--grid", "8x8", "--plane", "-.5 -.5 0 1 0 0 0 1 0", "--geometry", f"{self.folder}/walls.oct",
                "--positions", f"{self.folder}/table.txt", "--report", f"{self.folder}/report.json", "-o", out)
        with open(f"{self.folder}/report.json", encoding="utf-8") as f:
            return json.load(f)

    def error(self, field):
        text = "\n".join(" ".join(f"{x:.9g}" for x in r) for r in self.score.rays())
        p = subprocess.run(["ilftrace", field], input=text.encode(), capture_output=True, check=True)
        found = self.score.of(np.array(p.stdout.split(), float).reshape(-1, 3))
        return [found[z]["up"] for z in self.score.heights]

    def regular(self):
        field = f"{self.folder}/all.ilf.exr"
        program("ilfpack", "--quiet", "--grid", "8x8", "--plane", "-.5 -.5 0 1 0 0 0 1 0", "--type", "float", "-o", field, *(f"{self.folder}/{i}_{j}.exr" for i, j in ALL))
        program("ilflamps", "--quiet", "--geometry", f"{self.folder}/walls.oct", "-o", f"{self.folder}/lamps.ilf.exr", field)
        return self.error(field), self.error(f"{self.folder}/lamps.ilf.exr")


def rounds(name, most, folder):
    c = Captured(name, folder)
    plain, regular = c.regular()
    yield name, "64 regular, lamps in it", 64, "", *plain
    yield name, "64 regular", 64, "", *regular
    nodes = list(COARSE)
    while True:
        report = c.pack(nodes, f"{folder}/some.ilf.exr")
        yield name, "adaptive", len(nodes), 100 * adaptive.uncertainty(report), *c.error(f"{folder}/some.ilf.exr")
        if len(nodes) >= most:
            return
        nodes += adaptive.in_order(adaptive.choose(report, nodes, (8, 8), min(8, most - len(nodes))))


def of_rooms(table, names):
    with open(table, "w", newline="", encoding="utf-8") as f:
        w = csv.writer(f)
        w.writerow(["room", "positions", "count", "said_percent", "up_0.02", "up_0.1", "up_0.3"])
        for name in names:
            name, _, most = name.partition("/")
            for row in rounds(name, int(most or 24), os.path.join(os.path.dirname(os.path.abspath(table)), name)):
                w.writerow([f"{x:.3g}" if isinstance(x, float) else x for x in row])
                f.flush()
                print(*(f"{x:.3g}" if isinstance(x, float) else x for x in row), flush=True)


# ---- measured light -----------------------------------------------------------------------------------------

class Measured(adaptive.Doubt):
    """Places in space instead of nodes, and faces instead of lamps."""

    def __init__(self, at, light, chosen):
        self.where, self.light, self.places = at / 100, light / light.mean(), []
        self.lamps, self.reach = [(1 / 6, []) for _ in range(6)], 1.
        for k in chosen:
            self.visit(k)

    def at(self, node):
        return list(self.where[node])

    def visit(self, node):
        self.places.append(self.at(node))
        for face, (_, seen) in enumerate(self.lamps):
            seen.append(self.light[node, face])
        box = np.ptp(self.where, axis=0)
        self.reach = adaptive.REACH * (np.prod(box) / len(self.places)) ** (1 / 3)


def predicted(at, light, known, places):
    d = np.linalg.norm(at[places][:, None] - at[known][None], axis=2)
    w = 1 / np.maximum(d, 1e-6) ** 2
    return (w @ light[known]) / w.sum(1, keepdims=True)


def errors(at, light, chosen):
    "at places not chosen, and by leaving out"
    rest = [k for k in range(len(at)) if k not in chosen]
    out = [light[k] - predicted(at, light, [q for q in chosen if q != k], [k])[0] for k in chosen]
    rms = lambda e: 100 * np.sqrt(np.mean(np.square(e))) / light.mean()
    return rms(light[rest] - predicted(at, light, chosen, rest)) if rest else np.nan, rms(out)


def far_apart(at, n):
    chosen = [int(np.argmin(np.linalg.norm(at - at.mean(0), axis=1)))]
    while len(chosen) < n:
        chosen.append(int(np.argmax(np.min(np.linalg.norm(at[:, None] - at[chosen][None], axis=2), axis=1))))
    return chosen


def adaptively(at, light):
    chosen = far_apart(at, FIRST)
    doubt = Measured(at, light, chosen)
    while len(chosen) < len(at):
        best = max((k for k in range(len(at)) if k not in chosen), key=doubt.of)
        doubt.visit(best)
        chosen.append(best)
    return chosen


def curves(path):
    data = np.loadtxt(path, delimiter=",")
    light, at, rng = data[:, :6], data[:, 6:9], np.random.default_rng(1)
    numbers = range(FIRST, len(at) - 3)
    ways = {"adaptive": [adaptively(at, light)], "far apart": [far_apart(at, len(at))], "random": [list(rng.permutation(len(at))) for _ in range(DRAWS)]}
    return {way: [(n, *np.mean([errors(at, light, o[:n]) for o in orders], axis=0)) for n in numbers] for way, orders in ways.items()}


def draw(out, found):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    fig, axes = plt.subplots(1, len(found), figsize=(5 * len(found), 4), squeeze=False)
    for ax, (name, ways) in zip(axes[0], found.items()):
        for (way, rows), colour in zip(ways.items(), ("#b3312c", "#2f7d3b", "#2b5fa8")):
            n, rest, left = zip(*rows)
            ax.plot(n, rest, color=colour, label=f"{way}: places not visited")
            ax.plot(n, left, color=colour, ls=":", label=f"{way}: leave one out")
        ax.set(title=name, xlabel="positions", ylabel="rms error, % of mean illuminance", ylim=(0, None))
        ax.legend(fontsize=7)
    fig.tight_layout()
    fig.savefig(out, dpi=100)


def of_measured(out, table, files):
    found = {os.path.splitext(os.path.basename(f))[0]: curves(f) for f in files}
    draw(out, found)
    with open(table, "w", newline="", encoding="utf-8") as f:
        w = csv.writer(f)
        w.writerow(["room", "way", "positions", "not_visited_percent", "left_out_percent"])
        w.writerows([name, way, n, f"{a:.4g}", f"{b:.4g}"] for name, ways in found.items() for way, rows in ways.items() for n, a, b in rows)
    for name, ways in found.items():
        for way, rows in ways.items():
            print(f"{name:16} {way:10}", "  ".join(f"{n}: {a:.0f} ({b:.0f})" for n, a, b in rows if n % 8 == 0))


if __name__ == "__main__":
    if len(sys.argv) >= 4 and sys.argv[1] == "rooms":
        of_rooms(sys.argv[2], sys.argv[3:])
    elif len(sys.argv) >= 5 and sys.argv[1] == "measured":
        of_measured(sys.argv[2], sys.argv[3], sys.argv[4:])
    else:
        sys.exit(__doc__)
