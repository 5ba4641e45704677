"""Error against the size of the light field: fewer probes, smaller probes.

Fewer: every n-th of the finest grid.  Smaller: box filter over its texels, weighted with solid angle.  The reference is the
photograph.
"""
from . import run, scene
from .run import OUT, PYTHON

HERE = f"{OUT}/size"
GRID, PROBE = 13, (96, 48)
EVERY, SHRINK = (1, 2, 3, 4, 6, 12), (2, 4, 8)


def coarser(master, every, factor):
    """Name of a coarser light field, the text that makes it, its grid."""
    n = (GRID - 1) // every + 1
    name = f"{HERE}/every{every}_shrink{factor}"
    return name, f"{PYTHON} -m report coarser --every {every} --shrink {factor} -o {name} {master} && {scene.packed(name, n, f'{name}.ilf.exr')}", n


def one(s, master, own, figure, every, factor):
    name, text, n = coarser(master, every, factor)
    run.run(text, f"{name}.log")
    octree = s.lit(f"{name}_lit", f"{name}.ilf.exr")
    size = f"{PROBE[0] // factor}x{PROBE[1] // factor}"
    return s.row(f"{name}_picture", octree, scene.FINE, s.photo, own, f"size: {n}x{n} of {size}", text, figure=figure, row=f"{n}x{n} probes of {size}",
                 x=n if figure == "positions" else PROBE[0] // factor, reference="photograph", note="light field")


def main(argv=()):
    s = scene.studio()
    own = s.prepare()
    master = s.field(GRID, PROBE)
    jobs = [("positions", e, 1) for e in EVERY] + [("directions", 1, k) for k in SHRINK]
    run.write_rows("size", run.several([lambda j=j: one(s, master, own, *j) for j in jobs]))
