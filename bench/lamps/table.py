"""Version 1 against lamps and residual, room by room: errors of irradiance and radiance at three heights, CPU seconds, verdicts.

    table.py [OPTION...] OUT.csv [ROOM...]        ROOM as rooms.py has it (default: all its fixed rooms)
    --grid 8x8  --texels 256x128                  probes and their texels
    --walls                                       give ilflamps the walls (--geometry); else it estimates a box
    --any FIRST:N, --odd FIRST:N                  N rooms by chance, from seed FIRST on (instead of ROOM...); odd: with what is rare, too
    --kinds FIRST:N                               N rooms of each kind (kinds.py), from seed FIRST on

Captures are kept beside OUT.csv and used again.  Prints a line a room, worst cases and the distribution of gains (summary.py
makes tables of OUT.csv).  A room is *worse* where up or side at any height is more than .2 points above version 1.  Needs ilflamps
and oconv on PATH.
"""
import argparse, csv, os, subprocess, sys
import numpy as np
import kinds
import rooms

MARGIN = .2                                                # points; the law: never worse than version 1 by more


def arguments():
    p = argparse.ArgumentParser(usage=__doc__)
    p.add_argument("out"), p.add_argument("room", nargs="*")
    p.add_argument("--grid", default="8x8"), p.add_argument("--texels", default="256x128"), p.add_argument("--any"), p.add_argument("--odd"), p.add_argument("--kinds")
    p.add_argument("--walls", action="store_true")
    a = p.parse_args()
    for kind in ("any", "odd"):
        if getattr(a, kind): first, n = map(int, getattr(a, kind).split(":")); a.room = [f"{kind}:{first + k}" for k in range(n)]
    if a.kinds: first, n = map(int, a.kinds.split(":")); a.room = [f"{kind}:{first + k}" for k in range(n) for kind in kinds.KINDS]
    return a


def captured(name, a):
    path = os.path.join(os.path.dirname(os.path.abspath(a.out)), f"{name.replace(':', '-')}-{a.grid}-{a.texels}.ilf.exr")
    if not os.path.exists(path):
        rooms.make(rooms.named(name), *map(int, a.grid.split("x")), *map(int, a.texels.split("x")), path + ".new")
        os.replace(path + ".new", path)
    return path


def octree(name, a):
    path = os.path.join(os.path.dirname(os.path.abspath(a.out)), f"{name.replace(':', '-')}.oct")
    with open(path, "wb") as f: subprocess.run(["oconv", "-"], input=rooms.walls(rooms.named(name)).encode(), stdout=f, check=True)
    return path


def row(name, a):
    room = rooms.named(name)
    one, two, report = rooms.run(room, captured(name, a), ["--geometry", octree(name, a)] if a.walls else [], rooms.Score(room, patches=6, most=3000, rest=2000))
    out = dict(room=name, lamps=int((room.bodies["lamp"] == 1).sum()) if len(room.bodies) else 0,
               taken=sum(l["fate"] == "taken out" for l in report["lamps"]), cpu_s=round(report["cpu_s"], 2))
    for k in ("up", "side", "rad", "worst"):
        for z in one: out[f"{k}_1_{z}"], out[f"{k}_2_{z}"] = round(one[z][k], 3), round(two[z][k], 3)
    out["excess"] = round(max(two[z][k] - one[z][k] for z in one for k in ("up", "side")), 3)
    out["gain"] = round(float(np.exp(np.mean([np.log(max(one[z]["up"], .02) / max(two[z]["up"], .02)) for z in one]))), 3)
    out["verdicts"] = " | ".join(f"{l['shape'] if l['fate'] == 'taken out' else l['fate'][19:]}: {l.get('model') or 'alone'} "
                                 f"{l.get('error', 0):.3f}/{l.get('error_of_interpolation', 0):.3f}" for l in report["lamps"])
    return out


def say(r):
    of = lambda k: "/".join(f"{r[c]:.2f}" for c in r if c.startswith(f"{k}_1")) + " > " + "/".join(f"{r[c]:.2f}" for c in r if c.startswith(f"{k}_2"))
    print(f"{r['room']:10s} {'WORSE' if r['excess'] > MARGIN else '     '} x{r['gain']:5.2f} up {of('up')}  side {of('side')}  "
          f"rad {of('rad')}  {r['cpu_s']:.0f} s  {r['taken']}/{r['lamps']}  {r['verdicts']}", flush=True)


def summary(rows):
    lit = [r for r in rows if r["lamps"]]
    if not lit: return
    g = np.array([r["gain"] for r in lit]); worse = [r for r in lit if r["excess"] > MARGIN]
    print(f"{len(lit)} rooms with lamps: geometric mean gain {np.exp(np.log(g).mean()):.2f}, deciles " +
          " ".join(f"{q:.2f}" for q in np.quantile(g, np.linspace(0, 1, 11))))
    print(f"worse by more than {MARGIN}: {len(worse)}: " + ", ".join(f"{r['room']} +{r['excess']:.2f}" for r in sorted(worse, key=lambda r: -r["excess"])))
    print(f"CPU {sum(r['cpu_s'] for r in rows):.0f} s, most {max(r['cpu_s'] for r in rows):.0f} s")


def main():
    a, rows = arguments(), []
    os.makedirs(os.path.dirname(os.path.abspath(a.out)), exist_ok=True)
    for name in a.room or list(rooms.FIXED):
        rows.append(row(name, a)), say(rows[-1])
        with open(a.out, "w", newline="") as f: w = csv.DictWriter(f, rows[0].keys()); w.writeheader(), w.writerows(rows)
    summary(rows)


if __name__ == "__main__": main()
