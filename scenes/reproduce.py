"""Errors of reproduced light against the number of lights and of bits, and a table of all runs of `make reproduce`.

    reproduce.py --folder build/reproduce --field figure11=build/figures/figure11/room.ilf.exr ... -o build/reproduce/reproduce.png

Lights: spheres of fewer and more lamps, spread evenly; and the best N of the 156.  Bits: of 156 lights, 8 to 16.
"""
import argparse
import csv
import json
import subprocess
import sys
from pathlib import Path

LIGHTS = (8, 15, 29, 60, 156)
FEW = (4, 16, 64)
BITS = (8, 10, 12, 16)


def ilfstage(folder, stage, field, name, *options):
    """Its report, computed once."""
    out = folder / f"{name}.json"
    if not out.exists():
        usual = ["--quiet", "--path", folder / "path.txt", "--fps", "1", "--exposure", "auto", "--noise", "0"]
        subprocess.run(["ilfstage", *usual, "--report", out, *map(str, options), stage, field], check=True, stdout=subprocess.DEVNULL)
    return json.loads(out.read_text())


def sphere(folder, n):
    path = folder / f"even{n}.toml"
    if not path.exists():
        subprocess.run([sys.executable, Path(__file__).parent / "stages" / "generate.py", "sphere29", "--lights", str(n), "-o", path], check=True)
    return path


def curves(folder, fields):
    """{field: {curve: [(x, error, bound)]}}."""
    found, of = {}, lambda r: (r["error"], r["bound_unconstrained"])        # noqa: E731
    for name, field in fields.items():
        found[name] = {
            "lights": [(n, *of(ilfstage(folder, sphere(folder, n), field, f"even{n}-{name}"))) for n in LIGHTS],
            "few": [(n, *of(ilfstage(folder, folder / "sphere156.toml", field, f"few{n}-{name}", "--few", n))) for n in FEW],
            "bits": [(n, *of(ilfstage(folder, folder / "sphere156.toml", field, f"bits{n}-{name}", "--bits", n))) for n in BITS],
        }
    return found


def draw(path, found):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    fig, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained", sharey=True)
    for k, (name, c) in enumerate(found.items()):
        for key, style, word in (("lights", "o-", "a sphere of so many"), ("few", "s:", "the best of 156")):
            x, y, _ = zip(*c[key])
            left.loglog(x, [100 * v for v in y], style, color=f"C{k}", ms=4, label=f"{name}: {word}")
        x, _, b = zip(*c["lights"])
        left.loglog(x, [100 * v for v in b], "--", color=f"C{k}", lw=.8, label=f"{name}: bound, unconstrained")
        x, y, _ = zip(*c["bits"])
        right.semilogy(x, [100 * v for v in y], "o-", color=f"C{k}", ms=4, label=name)
    left.set(xlabel="lights", ylabel="error of irradiance along the path (%)")
    right.set(xlabel="bits of a drive value, 156 lights")
    for ax in (left, right):
        ax.grid(alpha=.3, which="both")
        ax.legend(fontsize=7)
    fig.savefig(path, dpi=110)


def table(folder, path, found):
    with open(path, "w", newline="") as f:
        w = csv.writer(f)
        w.writerow("run lights_used channels error bound_not_negative bound_unconstrained rise_by_noise ball_rmse mesh_rmse cpu_matrix cpu_frame "
                   "exposure".split())
        for p in sorted(folder.glob("*-*.json")):
            r = json.loads(p.read_text())
            mean = lambda k: sum(r["picture"][k]) / len(r["picture"][k]) if k in r.get("picture", {}) else ""        # noqa: E731
            errors = [r[k] for k in ("error", "bound_not_negative", "bound_unconstrained", "rise_by_noise")]
            cpu = [r["cpu_seconds"][k] for k in ("matrix", "frame")]
            w.writerow([p.stem, r["lights_used"], r["channels"], *errors, mean("ball"), mean("mesh"), *cpu, r["exposure"]])


def main():
    ap = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ap.add_argument("--folder", type=Path, required=True)
    ap.add_argument("--field", action="append", required=True, metavar="NAME=FILE")
    ap.add_argument("-o", "--output", required=True)
    a = ap.parse_args()
    found = curves(a.folder, dict(f.split("=", 1) for f in a.field))
    table(a.folder, a.folder / "reproduce.csv", found)
    draw(a.output, found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
