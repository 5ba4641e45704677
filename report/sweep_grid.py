"""Spatial resolution: figure 12's light through a branch, at grids from one probe to the paper's 30 x 30.

Probes by rays, without a camera, of a moderate 64 x 32 directions: so that 30 x 30 of them take minutes, not hours.  What is
seen is the error of the grid alone.
"""
from . import run, scene
from .run import OUT

HERE = f"{OUT}/grid"
SIZE = (64, 32)
GRIDS = (1, 4, 6, 8, 12, 30)
# 4 x 4 rays a texel, 1.4 x 0.7 degrees apart at most: the lamp, 1.7 degrees wide, cannot slip through between them
RAYS = "--supersample 4"


def main(argv=()):
    s = scene.dapples()
    own = s.prepare()

    def one(n):
        name = f"{HERE}/n{n}"
        field = s.field(n, SIZE, RAYS, name)
        octree = s.lit(f"{name}_lit", field)
        return s.row(f"{name}_picture", octree, scene.FINE, s.photo, own, f"grid: {n}x{n}", s.field_text(n, SIZE, name, RAYS), figure="grid", row=f"{n}x{n} probes",
                     x=n, reference="photograph", note="light field")
    # the first light field fills the file of indirect light that the others start from
    rows = [one(GRIDS[0])] + run.several([lambda n=n: one(n) for n in reversed(GRIDS[1:])])[::-1]
    run.write_rows("grid", rows)
