"""What a lookup costs through the Python package, beside the same lookups by a loop in C (build/test/ilfspeed).

usage: speed.py FILE.ilf.exr [N...]    (N rays at a time, others each time; default 4096, and 400000)

CPU nanoseconds per lookup (all of the process's threads, so that a busy machine counts little), the least of ROUNDS in which C and Python
take turns, random rays; ratio: C's time over Python's, 1 is as fast.  Beside it the clock's: how much sooner two threads are done than one.
"""
import os
import subprocess
import sys
import time

import numpy as np

import ilf

LOOKUPS, ROUNDS = 400_000, 12


def in_c(path):
    """CPU ns per lookup, {"nodepth": ..., "depth": ...}."""
    program = os.path.join(os.environ.get("ILF_BUILD", "build"), "test/ilfspeed")
    out = subprocess.run([program, "--lookups", str(LOOKUPS), path], capture_output=True, text=True, check=True).stdout
    return {line.split()[0]: float(line.split()[2]) for line in out.splitlines() if line.split()[1] == "random"}


def rays(field, n, seed):
    """As ilfspeed makes them: from anywhere on the plane to a sphere about it."""
    rng, f = np.random.default_rng(seed), field.frame
    z, theta = .02 + .98 * rng.uniform(size=n), rng.uniform(0, 2 * np.pi, n)
    s = np.sqrt(1 - z * z)
    o = f.at(rng.uniform(size=n), rng.uniform(size=n))
    d = np.stack([s * np.cos(theta), s * np.sin(theta), z], -1) @ f.axes
    return o, d, o + 4 * (f.len_u + f.len_v) * d


def in_python(field, given, depth, threads):
    """[CPU ns, clock's ns] per lookup, of some batches of rays."""
    a, b = time.process_time(), time.perf_counter()
    for batch in given:
        field.eval(*batch, depth=depth, threads=threads)
    done = sum(len(batch[0]) for batch in given)
    return [(time.process_time() - a) / done * 1e9, (time.perf_counter() - b) / done * 1e9]


def main(path, *sizes):
    sizes, kinds = [int(x) for x in sizes] or [4096, LOOKUPS], ("nodepth", "depth")
    c, found = [], {(n, kind, k): [] for n in sizes for kind in kinds for k in (1, 2)}
    with ilf.open(path) as field:
        field.probes()
        given = {n: [rays(field, n, seed) for seed in range(max(1, LOOKUPS // n))] for n in sizes}
        for _ in range(ROUNDS):
            c.append(in_c(path))
            for n, kind, k in found:
                found[n, kind, k].append(in_python(field, given[n], kind == "depth", k))
    for n in sizes:
        for kind in kinds:
            loop = min(x[kind] for x in c)
            one, two = (np.min(found[n, kind, k], 0) for k in (1, 2))
            print(f"{n:8d} rays, {kind:7s}: C {loop:6.1f} ns; Python {one[0]:6.1f} ns, ratio {loop / one[0]:.2f}; 2 threads {two[0]:6.1f} ns, "
                  f"ratio {loop / two[0]:.2f}, done {one[1] / two[1]:.2f} times as soon")


if __name__ == "__main__":
    main(*sys.argv[1:])
