"""Where a stage goes next: nodes of a grid at which what was found of the lamps is least certain.

    adaptive.py --nodes 8x8 --most 24 --error .01 [--step 8] REPORT.json LIST     after a round: choose, and put the choice on the list
    adaptive.py --table --plane "O U V" --nodes 8x8 LIST PROBE...                 the list as lines for ilfpack --positions

LIST has a line "I J" for each node that was, or shall be, visited; # comments.  REPORT.json is ilfpack's (--positions --report) of what was
captured at all of them: how much of each lamp each place sees, by how much the model of what hides it was wrong at places left out, and how
uncertain the light is at each node.

Doubt of a lamp at a node that was not visited: how much the places round it disagree about the lamp (standard deviation of the part that they
see, by nearness), and a little for the way to the nearest of them, times that way, the lamp's light and its model's error.  The
most doubtful node is taken, counts as visited from then on, and so on.  The list ends when the light's uncertainty over all nodes (rms) is
at most --error, or it has --most nodes; the same list and report give the same choice, and a list is replaced as a whole, so that
it can be gone on with after any end.
"""
import argparse
import json
import math
import os
import sys

EXPLORE = .15        # of a whole lamp: what may hide between places that agree
REACH = .8           # of the mean distance between places: how far their word counts


def fail(words):
    sys.exit(f"adaptive.py: {words}")


def read_list(path):
    try:
        lines = [line.split("#")[0].split() for line in open(path, encoding="utf-8")]
        return [(int(i), int(j)) for i, j in filter(None, lines)]
    except (OSError, ValueError) as e:
        fail(f'{path}: expected lines "I J", found {e}')


def lamps_of(report, picture):
    """[(share of all lamps' light x error, [part seen by each place of the list or None])], in the list's order."""
    plane = report["plane"]
    centre = [plane[c] + plane[3 + c] / 2 + plane[6 + c] / 2 for c in range(3)]
    normal = [plane[4] * plane[8] - plane[5] * plane[7], plane[5] * plane[6] - plane[3] * plane[8], plane[3] * plane[7] - plane[4] * plane[6]]
    found = []
    for lamp in report["lamps"]:
        if not lamp["seen"] or "candela" not in lamp:
            continue
        way = [a - b for a, b in zip(lamp["position"], centre)]
        far = math.hypot(*way)
        light = lamp["candela"] / far ** 2 * max(0, sum(a * b for a, b in zip(way, normal))) / far / math.hypot(*normal)
        seen = [None] * len(picture)
        for at, part in zip(picture, lamp["seen"]):
            seen[at] = part if part >= 0 else None
        error = lamp.get("error", 1)
        found.append((light * (error if lamp["fate"] == "taken out" else max(error, .5)), seen))
    whole = sum(w for w, _ in found) or 1
    return [(w / whole, seen) for w, seen in found]


class Doubt:
    """Of nodes, in units of all lamps' doubt; sizes: of the plane, any unit."""

    def __init__(self, nodes, size, visited, lamps):
        self.step = [s / max(1, n - 1) for s, n in zip(size, nodes)]
        self.places = [self.at(v) for v in visited]
        self.lamps = [(w, list(seen)) for w, seen in lamps] or [(1, [1] * len(visited))]
        self.reach = REACH * math.sqrt(size[0] * size[1] / max(1, len(visited)))

    def at(self, node):
        return [k * s for k, s in zip(node, self.step)]

    def look(self, node):
        "the way to the nearest place; for each lamp the mean of what places say, and by how much they disagree"
        ways = [math.dist(self.at(node), p) for p in self.places]
        near = [math.exp(-.5 * (d / self.reach) ** 2) + 1e-12 for d in ways]
        said = []
        for _, seen in self.lamps:
            both = [(n, s) for n, s in zip(near, seen) if s is not None]
            total = sum(n for n, _ in both) or 1
            mean = sum(n * s for n, s in both) / total
            said.append((mean, math.sqrt(sum(n * (s - mean) ** 2 for n, s in both) / total)))
        return min(ways), said

    def of(self, node):
        way, said = self.look(node)
        return way / self.reach * math.hypot(*(w * math.hypot(spread, EXPLORE) for (w, _), (_, spread) in zip(self.lamps, said)))

    def visit(self, node):
        _, said = self.look(node)
        self.places.append(self.at(node))
        for (_, seen), (mean, _) in zip(self.lamps, said):
            seen.append(mean)


def choose(report, visited, nodes, count):
    """Up to count nodes, the most doubtful first."""
    plane = report["plane"]
    picture = [p["line"] - 1 for p in report["pictures"]]
    doubt = Doubt(nodes, [math.hypot(*plane[3:6]), math.hypot(*plane[6:9])], visited, lamps_of(report, picture))
    left = [(i, j) for j in range(nodes[1]) for i in range(nodes[0]) if (i, j) not in set(visited)]
    chosen = []
    while left and len(chosen) < count:
        best = max(left, key=lambda n: (round(doubt.of(n), 9), -n[1], -n[0]))
        doubt.visit(best)
        left.remove(best)
        chosen.append(best)
    return chosen


def uncertainty(report):
    errors = [n["error"] for n in report["nodes"]]
    return math.sqrt(sum(e * e for e in errors) / len(errors))


def in_order(chosen):
    "row by row, each second one backwards: short ways for the stage"
    rows = sorted({j for _, j in chosen})
    return [n for k, j in enumerate(rows) for n in sorted((n for n in chosen if n[1] == j), reverse=k % 2 == 1)]


def replace(path, text):
    with open(f"{path}.part", "w", encoding="utf-8") as f:
        f.write(text)
        f.flush()
        os.fsync(f.fileno())
    os.replace(f"{path}.part", path)


def next_round(o):
    visited, report = read_list(o.list), json.load(open(o.report, encoding="utf-8"))
    if sorted(p["line"] for p in report["pictures"]) != list(range(1, len(visited) + 1)):
        fail(f"{o.report}: expected a report of the {len(visited)} places of {o.list}, found {len(report['pictures'])} pictures")
    now = uncertainty(report)
    words = f"{len(visited)} places: light from above is uncertain by {100 * now:.2g} %"
    if now <= o.error or len(visited) >= o.most:
        print(f"{words}: done ({f'at most {100 * o.error:g} % were asked for' if now <= o.error else f'{o.most} places at most'})")
        return
    chosen = in_order(choose(report, visited, o.nodes, min(o.step, o.most - len(visited))))
    text = open(o.list, encoding="utf-8").read()
    replace(o.list, text + f"# after {words}\n" + "".join(f"{i} {j}\n" for i, j in chosen))
    print(f"{words}; {len(chosen)} more: " + " ".join(f"{i},{j}" for i, j in chosen))


def table(o):
    """Probes stand as the plane does: their axis is U, so that U's azimuth is their heading."""
    plane = [float(x) for x in o.plane.split()]
    if any(abs(x) > 1e-9 * max(map(abs, plane[3:9])) for x in (plane[5], plane[8])) or plane[3] * plane[7] <= plane[4] * plane[6]:
        fail(f"--plane: expected a level plane that looks up (U x V along +z) for positions of its own choice, found {o.plane}")
    visited, heading = read_list(o.list), math.degrees(math.atan2(plane[4], plane[3]))
    if len(o.probes) != len(visited):
        fail(f"{o.list}: expected {len(o.probes)} nodes, as many as probes, found {len(visited)}")
    for (i, j), probe in zip(visited, o.probes):
        a, b = (k / (n - 1) if n > 1 else .5 for k, n in zip((i, j), o.nodes))
        print(probe, *(f"{plane[c] + a * plane[3 + c] + b * plane[6 + c]:.9g}" for c in range(3)), f"{heading:.9g}")


def main():
    def size(text):
        n, m = map(int, text.split("x"))
        return n, m
    p = argparse.ArgumentParser()
    p.add_argument("--nodes", type=size, required=True)
    p.add_argument("--most", type=int, default=0)
    p.add_argument("--error", type=float, default=0)
    p.add_argument("--step", type=int, default=8)
    p.add_argument("--plane")
    p.add_argument("--table", action="store_true")
    p.add_argument("files", nargs="+")
    o = p.parse_args()
    if o.table:
        o.list, o.probes = o.files[0], o.files[1:]
        table(o)
    else:
        if len(o.files) != 2:
            fail("expected REPORT.json and LIST")
        o.report, o.list = o.files
        next_round(o)


if __name__ == "__main__":
    main()
