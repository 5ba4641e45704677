"""Storage forms of one light field: bytes, CPU seconds to read it, error of its texels and of a picture.

The reference of both errors is float without compression.  Read means ilfinfo, which looks at every probe; the picture is the same
scene with the same random numbers, so that its error is that of the storage alone.
"""
import os

import numpy as np

from . import fields, run, scene
from .run import OUT, PYTHON

HERE = f"{OUT}/storage"
GRID, PROBE = 7, (96, 48)
FORMS = [(t, c) for t in ("float", "half") for c in ("none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a")]
BASE = f"{HERE}/float_none"
QUICK = f"{scene.EXACT} -di 0 -ad 1024"     # the very same blind rays for all


def one(s, probes, kind, squeeze, exact):
    form = f"{HERE}/{kind}_{squeeze}"
    file = f"{form}.ilf.exr"
    text = scene.packed(probes, GRID, file, f"--type {kind} --compression {squeeze}")
    run.run(text, f"{form}.log")
    load = run.run(f"ilfinfo --quiet --threads 1 {file}", f"{form}.txt")
    found = fields.read(run.TOP / file).astype(float)
    error = float(np.sqrt(((found - exact) ** 2).mean()) / exact.mean()) if exact is not None else 0.0
    size = os.path.getsize(run.TOP / file)
    octree = s.lit(f"{form}_lit", file)
    picture = f"{BASE}_picture.hdr"
    r = s.row(f"{form}_picture", octree, QUICK, picture, "", f"storage: {kind}, {squeeze}")
    r["command"] = (f"{text} && ls -l {file} && time ilfinfo --quiet --threads 1 {file} && "
                    f"{PYTHON} -m report texels {BASE}.ilf.exr {file} && {r['command']}")
    # the table's seconds and memory are those of reading it
    return found, {**r, "cpu_s": load["cpu_s"], "peak_mb": load["peak_mb"], "figure": "storage", "row": f"{kind}, {squeeze}", "x": size / 1e6,
                   "y": error, "reference": "picture from float, none", "note": f"{size / 1e6:.2f} MB; texels wrong by {100 * error:.3g} %"}


def main(argv=()):
    s = scene.studio()
    s.prepare()
    master = s.field(GRID, PROBE)
    probes = master.removesuffix(".ilf.exr")
    exact, first = one(s, probes, *FORMS[0], None)
    rows = [first, *run.several([lambda f=f: one(s, probes, *f, exact)[1] for f in FORMS[1:]])]
    run.write_rows("storage", rows)
