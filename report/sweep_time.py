"""Error against CPU time: the ways of rendering one light field, one scene, one picture size.

The light field is used without depth correction, because stock Radiance's colordata tables know none: so all ways have one limit
and their error is the renderer's own.  The reference is the mean of two long, independent pictures, and its error half of their
difference.  The single probe has another limit; what it lacks is what the light field brings.
"""
from . import measures, run, scene
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


def octrees(p):
    field, _, _ = scene.field(GRID, PROBE)
    middle = GRID // 2
    one = f"{HERE}/single.ilf.exr"
    run.run(f"{PYTHON} -m report coarser --only {middle},{middle} -o {HERE}/single {field} && "
            f"ilfpack --quiet --grid 1x1 --plane '{scene.PLANE}' --type float -o {one} {HERE}/single/p_*.exr", f"{HERE}/single.log")
    table = f"{HERE}/table"
    cost = run.run(f"{PYTHON} -m report colordata -o {table} {field}", f"{HERE}/tables.log", "colordata tables")
    del cost
    glow = f"{HERE}/glow.oct"
    run.run(f"{{ cat {p['materials']} {table}.rad; {scene.surfaces(p)}; cat {p['table']} {p['objects']}; }} | oconv -f -", glow)
    return {"field": scene.lit(p, f"{HERE}/field", field, depth=False), "single": scene.lit(p, f"{HERE}/one", one, depth=False), "glow": glow}


def plan(octree):
    """[(way, x, options, octree)]."""
    jobs = [("literal", n, f"{scene.EXACT} -di 0 -ad {n}", octree["field"]) for n in LITERAL]
    jobs += [("literal, cache", n, f"{CACHE} -di 0 -ad {n}", octree["field"]) for n in (256, 1024, 4096)]
    jobs += [("-di", n, f"{scene.EXACT} -di {n} -ad {ad}", octree["field"]) for n, ad in AIMED]
    jobs += [("-di, cache", n, f"{CACHE} -di {n} -ad {ad}", octree["field"]) for n, ad in AIMED_CACHED]
    jobs += [("single probe", n, f"{scene.EXACT} -di {n} -ad {ad}", octree["single"]) for n, ad in AIMED[1:4]]
    jobs += [("colordata", n, f"{scene.EXACT} -ad {n}", octree["glow"]) for n in (64, 256, 1024, 4096)]
    return jobs


def one(way, n, options, octree, reference, own):
    command = f"rpict {scene.VIEW} {options} {octree}"
    name = f"{HERE}/{way.replace(', ', '_').replace(' ', '_').replace('-', '')}_{n}"
    cost = run.run(command, f"{name}.hdr", f"time: {way} {n}")
    e = measures.of_files(run.TOP / f"{name}.hdr", run.TOP / reference, run.TOP / scene.MASK)
    return dict(figure="time", row=f"{way} {n}", x=cost["cpu_s"], y=e["rmse"], measure=measures.RMSE, error=e["rmse"], ssim=e["ssim"],
                reference="long -di, mean of two", reference_error=own, cpu_s=cost["cpu_s"], peak_mb=cost["peak_mb"], note=WAYS[way],
                command=scene.measured(command, reference))


def main(argv=()):
    p = scene.prepare()
    octree = octrees(p)
    long = f"rpict {scene.VIEW} {scene.EXACT} -di 256 -ad 2048 -u+ {octree['field']}"
    reference, halves = scene.both(f"{HERE}/reference", long)
    read = [measures.compare.read_finite(run.TOP / h) for h in (*halves, scene.MASK)]
    own = measures.split_error(read[:2], read[2])
    run.say(f"time: the reference's own error {own:.4f}")
    rows = run.several([lambda j=j: one(*j, reference, own) for j in plan(octree)])
    run.write_rows("time", rows)
    for r in rows:
        print(f"    {r['row']:22s} {r['cpu_s']:8.2f} CPU s  RMSE {r['error']:.4f}")
