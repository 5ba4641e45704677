"""Error against CPU time: the ways of rendering one light field, one scene, one picture size.

The light field is used without depth correction, because stock Radiance's colordata tables know none: so all ways have one limit
and their error is the renderer's own.  The reference is the mean of two long, independent pictures, and its error half of their
difference.  The single probe has another limit; what it lacks is what the light field brings.
"""
from . import run, scene
from .run import OUT, PYTHON

HERE = f"{OUT}/time"
GRID, PROBE = 7, (96, 48)
CACHE = "-as 64 -ar 64 -lw 1e-9 -ab 1 -aa .15"
LITERAL = (64, 256, 1024, 4096, 10000)
# importance samples, and the blind rays that carry the smooth rest
AIMED = ((1, 16), (4, 32), (16, 64), (64, 256), (256, 512))
AIMED_CACHED = ((1, 128), (4, 128), (16, 256), (64, 512), (256, 1024))
WAYS = {"literal": "the paper's way: blind rays (-di 0)", "literal, cache": "blind rays, irradiance cache",
        "-di": "importance samples (-di)", "-di, cache": "importance samples, irradiance cache",
        "single probe": "one probe for the whole scene", "colordata": "stock Radiance: colordata on a glow"}


def octrees(s):
    field = s.field(GRID, PROBE)
    one, table = f"{HERE}/single.ilf.exr", f"{HERE}/table"
    run.run(f"{PYTHON} -m report coarser --only {GRID // 2},{GRID // 2} -o {HERE}/single {field} && {scene.packed(f'{HERE}/single', 1, one)}", f"{HERE}/single.log")
    run.run(f"{PYTHON} -m report colordata -o {table} {field}", f"{HERE}/tables.log", "colordata tables")
    glow = f"{HERE}/glow.oct"
    run.run(f"{{ cat {s.materials} {table}.rad; {s.surfaces()}; cat {s.table} {s.objects}; }} | oconv -f -", glow)
    return {"field": s.lit(f"{HERE}/field", field, depth=False), "single": s.lit(f"{HERE}/one", one, depth=False), "glow": glow}


def plan(octree):
    """[(way, n, options, octree)]."""
    jobs = [("literal", n, f"{scene.EXACT} -di 0 -ad {n}", octree["field"]) for n in LITERAL]
    jobs += [("literal, cache", n, f"{CACHE} -di 0 -ad {n}", octree["field"]) for n in (256, 1024, 4096)]
    jobs += [("-di", n, f"{scene.EXACT} -di {n} -ad {ad}", octree["field"]) for n, ad in AIMED]
    jobs += [("-di, cache", n, f"{CACHE} -di {n} -ad {ad}", octree["field"]) for n, ad in AIMED_CACHED]
    jobs += [("single probe", n, f"{scene.EXACT} -di {n} -ad {ad}", octree["single"]) for n, ad in AIMED[1:4]]
    jobs += [("colordata", n, f"{scene.EXACT} -ad {n}", octree["glow"]) for n in (64, 256, 1024, 4096)]
    return jobs


def one(s, way, n, options, octree, reference, own):
    name = f"{HERE}/{way.replace(', ', '_').replace(' ', '_').replace('-', '')}_{n}"
    r = s.row(name, octree, options, reference, own, f"time: {way} {n}", figure="time", row=f"{way} {n}", reference="mean of two long -di", note=WAYS[way])
    return {**r, "x": r["cpu_s"]}


def main(argv=()):
    s = scene.studio()
    s.prepare()
    octree = octrees(s)
    reference, halves = scene.both(f"{HERE}/reference", f"rpict {s.view} {scene.EXACT} -di 512 -ad 4096 -u+ {octree['field']}", "time: reference")
    own = s.split(halves)
    run.say(f"time: the reference's own error {own:.4f}")
    run.write_rows("time", run.several([lambda j=j: one(s, *j, reference, own) for j in plan(octree)]))
