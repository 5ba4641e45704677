"""A floor and a box in the demo's light field: by Blender's Cycles with ilf.osl, with and without path guiding, and by our rpict.

usage: bench.py FIELD.ilf.exr PYTHON-WITH-BPY OUT-FOLDER

Error: root mean square of R G B against a long render of ours over the mean, on the floor and the box (pixels beside an edge left out).  CPU seconds of one thread, without
what is done once for a light field.  Writes cycles.csv and cycles.png; says how far a long render of Cycles is from ours.
"""
import csv
import json
import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "scenes"))
import rgbe  # noqa: E402

SIZE, ALBEDO, BOUNCES = 128, .6, 1
ROOM = ((-2., -2.2, -.8), (2., 2.2, 2.2))
BOXES = [[(-.37, -.37, -.03), (.37, .37, -.005), ALBEDO], [(-.12, -.08, -.005), (.1, .14, .2), ALBEDO]]
EYE, LOOK, DEGREES = (.75, -1.1, .95), (0, 0, .02), 40


def box_text(name, material, low, high):
    """Six polygons, each of its own name."""
    corner = lambda k: tuple((low, high)[k >> a & 1][a] for a in range(3))        # noqa: E731
    faces = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    return "".join(f"{material} polygon {name}_{i}\n0\n0\n12 " + " ".join("%g %g %g" % corner(k) for k in f) + "\n" for i, f in enumerate(faces))


def child_seconds():
    r = resource.getrusage(resource.RUSAGE_CHILDREN)
    return r.ru_utime + r.ru_stime


def program(*args, cwd, env, stdin=None):
    begun = child_seconds()
    p = subprocess.run([str(a) for a in args], cwd=cwd, env=env, input=stdin, capture_output=True)
    if p.returncode:
        raise SystemExit(f"{args[0]}: {p.stderr.decode()[-2000:]}")
    return p.stdout, child_seconds() - begun


def scene(folder, env, field):
    text = f"void ilf light\n1 {field}\n0\n0\nvoid plastic matt\n0\n0\n5 {ALBEDO} {ALBEDO} {ALBEDO} 0 0\n"
    text += box_text("room", "light", *ROOM) + "".join(box_text(f"box{k}", "matt", *b[:2]) for k, b in enumerate(BOXES))
    (folder / "scene.rad").write_text(text)
    (folder / "scene.oct").write_bytes(program("oconv", "scene.rad", cwd=folder, env=env)[0])


def view():
    d = np.subtract(LOOK, EYE)
    return ["-vtv", "-vp", *map(str, EYE), "-vd", *map(str, d), "-vu", "0", "0", "1", "-vh", str(DEGREES), "-vv", str(DEGREES)]


def mask(folder, env):
    """Pixels of the boxes whose neighbours show the same face."""
    rays = program("vwrays", "-ff", "-x", SIZE, "-y", SIZE, *view(), cwd=folder, env=env)[0]
    names = program("rtrace", "-h", "-ff", "-w", "-os", "scene.oct", cwd=folder, env=env, stdin=rays)[0].decode(errors="replace").split()
    ids = np.unique(np.array(names), return_inverse=True)[1].reshape(SIZE, SIZE)
    ours = np.array([n.startswith("box") for n in names]).reshape(SIZE, SIZE)
    for axis in (0, 1):
        for step in (-1, 1):
            ours = ours & (np.roll(ids, step, axis) == ids)
    return ours


def by_us(folder, env, options, seed=1):
    out, cpu = program("rpict", *view(), "-x", SIZE, "-y", SIZE, "-ps", "1", "-pj", ".9", "-us", seed, *options, "scene.oct", cwd=folder, env=env)
    (folder / "ours.hdr").write_bytes(out)
    return rgbe.radiance(folder / "ours.hdr"), cpu


def by_cycles(folder, python, field, samples, guiding, seed=1):
    config = dict(field=str(field), tools=str(TOP / "ilfmat" / "osl"), room=ROOM, boxes=BOXES, eye=EYE, look=LOOK, angle=np.radians(DEGREES), size=SIZE,
                  samples=samples, guiding=guiding, bounces=BOUNCES, seed=seed)
    (folder / "config.json").write_text(json.dumps(config))
    out, _ = program(python, TOP / "bench" / "cycles" / "render.py", "config.json", folder / "cycles.exr", cwd=folder, env=os.environ)
    seconds = [float(line.split()[1]) for line in out.decode().splitlines() if line.startswith("cpu_s ")]
    return OpenEXR.File(str(folder / "cycles.exr")).channels()["RGBA"].pixels[..., :3].astype(float), seconds[0]


def error(image, reference, where):
    return float(np.sqrt(np.mean((image - reference)[where]**2)) / reference[where].mean())


def plot(rows, path):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    fig, ax = plt.subplots(figsize=(7, 4.6))
    for method, mark in (("ours", "o-"), ("Cycles, guided", "s-"), ("Cycles", "^-")):
        found = [(r["cpu_s"], 100 * r["error"]) for r in rows if r["method"] == method]
        ax.loglog(*zip(*found), mark, label=method)
    ax.set(xlabel="CPU seconds", ylabel="error, % of the mean", title=f"A floor and a box in a light field, {SIZE} × {SIZE} pixels, one bounce between them")
    ax.grid(True, which="both", alpha=.3)
    ax.legend()
    fig.tight_layout()
    fig.savefig(path, dpi=110)


def main():
    field, python, out = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).absolute(), Path(sys.argv[3]).resolve()
    out.mkdir(parents=True, exist_ok=True)
    # one thread; our programs, and function files beside them
    env = dict(os.environ, OMP_NUM_THREADS="1")
    scene(out, env, field)
    where, rows = mask(out, env), []
    exact = ["-ab", str(BOUNCES + 1), "-aa", "0", "-as", "0", "-lw", "1e-5", "-st", "0"]
    reference = sum(by_us(out, env, exact + ["-ad", "4096", "-di", "256"], seed)[0] for seed in (11, 12)) / 2
    far, _ = by_cycles(out, python, field, 1024, True)
    print(f"a long render of Cycles and ours: means {far[where].mean():.5g} and {reference[where].mean():.5g}, {100 * error(far, reference, where):.2f} % apart (rms)")

    def add(method, setting, image, cpu):
        rows.append(dict(method=method, setting=setting, cpu_s=round(cpu, 3), error=round(error(image, reference, where), 5)))
        print(f"{method:16} {setting:24} {cpu:8.2f} CPU s  {100 * rows[-1]['error']:6.2f} %", flush=True)

    for ad, di in ((32, 4), (64, 16), (256, 32), (1024, 64)):
        add("ours", f"-ad {ad} -di {di}", *by_us(out, env, ["-ab", str(BOUNCES + 1), "-aa", ".15", "-ar", "128", "-as", "0", "-st", "0", "-ad", str(ad), "-di", str(di)]))
    for guiding, method in ((True, "Cycles, guided"), (False, "Cycles")):
        for samples in (4, 16, 64, 256):
            add(method, f"{samples} samples", *by_cycles(out, python, field, samples, guiding))
    with open(out / "cycles.csv", "w", newline="") as f:
        w = csv.DictWriter(f, rows[0].keys())
        w.writeheader()
        w.writerows(rows)
    plot(rows, out / "cycles.png")
    print(f"written: {out / 'cycles.csv'}, {out / 'cycles.png'}")


if __name__ == "__main__":
    main()
