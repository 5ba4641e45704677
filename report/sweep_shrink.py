"""Light fields that shrink: error of irradiance against bytes, and what reading costs.

A perfect capture of a room of bench/lamps in which a card hides a lamp from some places, in all forms: compressed as it is (none,
zip, piz), by DWA (from outside: ilfpack does not write it), rounded within .1 to 5 %; then with its lamps taken out, beside that form
with all probes unrounded.  Irradiance is compared up and to four sides at places on the plane and above it, of its mean; the seconds
are ilfinfo's, which looks at every probe.
"""
import os

import numpy as np

from . import run
from .run import OUT, PYTHON

HERE = f"{OUT}/shrink"
ROOM, GRID, TEXELS = "card", "12x12", "256x128"
NORMALS = np.array([(0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)], float)
LUM = np.array([.265, .67, .065])
PLACES, HEIGHTS, ROWS = 5, (0, .1, .3), 96
LO, HI = np.array([-3.2, -2.9, -.001]), np.array([2.9, 3.1, 2.9])      # its walls, as bench/lamps/rooms.py has them


def walls(o, d):
    """Where rays from o towards d meet them."""
    with np.errstate(divide="ignore"):
        return o + d * np.where(d > 0, (HI - o) / d, np.where(d < 0, (LO - o) / d, np.inf)).min(-1, keepdims=True)


def irradiance(path):
    """Up and to four sides, at PLACES x PLACES places of the middle at each height: (places, 5)."""
    import ilf
    p, t = (np.arange(ROWS) + .5) * np.pi / 2 / ROWS, (np.arange(4 * ROWS) + .5) * np.pi / 2 / ROWS
    d = np.stack([np.outer(np.sin(p), np.cos(t)), np.outer(np.sin(p), np.sin(t)), np.outer(np.cos(p), np.ones_like(t))], -1).reshape(-1, 3)
    w = np.repeat(np.sin(p), 4 * ROWS) * (np.pi / 2 / ROWS) ** 2
    cosine = np.maximum(d @ NORMALS.T, 0) * w[:, None]
    with ilf.open(path) as f:
        u, v, o = (np.array(getattr(f.info, k), float) for k in ("U", "V", "origin"))
        n = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
        axes = np.stack([u / np.linalg.norm(u), v / np.linalg.norm(v), n])
        x = [o + (i + .5) / PLACES * u + (j + .5) / PLACES * v + h * np.linalg.norm(u) * n for h in HEIGHTS for j in range(PLACES) for i in range(PLACES)]
        return np.array([cosine.T @ (f.eval(np.broadcast_to(a, d.shape), d @ axes, walls(a, d @ axes)) @ LUM) for a in x])


def measure(argv):
    """usage: python -m report shrunk REFERENCE.ilf.exr FILE.ilf.exr"""
    if len(argv) != 2:
        raise ValueError(f"expected two light fields, found {len(argv)}")
    a, b = map(irradiance, argv)
    mean = np.r_[a[:, 0].mean(), [a[:, 1:].mean()] * 4]
    off = abs(b - a) / mean
    print(f"rmse {np.sqrt((off ** 2).mean()):.6g}  worst {off.max():.6g}")
    return 0


def dwaa(argv):
    """usage: python -m report dwaa IN.ilf.exr OUT.ilf.exr"""
    import OpenEXR
    f = OpenEXR.File(argv[0], separate_channels=True)
    head = {**f.header(), "compression": OpenEXR.DWAA_COMPRESSION}
    OpenEXR.File(head, {c: f.channels()[c].pixels for c in "RGB"}).write(argv[1])
    return 0


def one(reference, figure, row, command, file):
    """A form of the field: made by command, which names `file`, and compared with reference."""
    run.run(command, f"{file}.made", f"shrink: {row}", reads=[file])
    load = run.run(f"ilfinfo --quiet --threads 1 {file}", f"{file}.txt")
    compare = f"{PYTHON} -m report shrunk {reference} {file}"
    run.run(compare, f"{file}.error")
    rms, worst = (float(x) for x in (run.TOP / f"{file}.error").read_text().split()[1::2])
    size = os.path.getsize(run.TOP / file)
    return dict(figure="shrink", row=row, x=size / 1e6, y=rms, error=rms, measure="irradiance, rms / mean", reference=os.path.basename(reference), cpu_s=load["cpu_s"],
                peak_mb=load["peak_mb"], note=f"{figure}: {size / 1e6:.2f} MB; worst {100 * worst:.2g} %", command=f"{command} && ls -l {file} && {compare}")


def main(argv=()):
    field, lit = f"{HERE}/field.ilf.exr", f"{HERE}/lit.ilf.exr"
    made = f"{PYTHON} bench/lamps/rooms.py make {ROOM} {GRID} {TEXELS} {HERE}/float.ilf.exr && ilfpack --quiet -t half -c none -o {field} {HERE}/float.ilf.exr"
    run.run(made, f"{HERE}/field.made", "shrink: the field")
    run.run(f"ilflamps --quiet -t half -o {lit} {field}", f"{HERE}/lit.made", "shrink: its lamps taken out")

    def pack(source, name, options, row, figure, reference):
        file = f"{HERE}/{name}.ilf.exr"
        return one(reference, figure, row, f"ilfpack --quiet {options} -o {file} {source}", file)
    rows = [pack(field, c, f"-c {c}", c, "as it is", field) for c in ("none", "zip", "piz")]
    rows.append(one(field, "DWA", "dwaa", f"{PYTHON} -m report dwaa {field} {HERE}/dwaa.ilf.exr", f"{HERE}/dwaa.ilf.exr"))
    for t in (".1", ".5", "1", "2", "5"):
        rows.append(pack(field, f"t{t.replace('.', '_')}", f"--tolerance {t}%", f"tolerance {t} %", "rounded", field))
    rows.append(one(lit, "lamps taken out", "lamps, all probes, zip", f"ilfpack --quiet -c zip -o {HERE}/lit_zip.ilf.exr {lit}", f"{HERE}/lit_zip.ilf.exr"))
    for e in (".05", ".2", "1"):
        file = f"{HERE}/few{e.replace('.', '_')}.ilf.exr"
        rows.append(one(lit, "lamps taken out, fewer probes", f"lamps, --probes auto --error {e} %, tolerance 1 %",
                        f"ilflamps --quiet --probes auto --error {e}% --tolerance 1% -o {file} {lit}", file))
    run.write_rows("shrink", rows)
