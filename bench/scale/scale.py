"""Work done against nodes, and what a step costs beyond its work, on a cluster of this machine's own (tests/slurm/cluster.sh).

usage: scale.py [--keep]        (make bench-scale)

Four kinds of numbers, printed as lines and written to build/scale.csv:

  make       seconds of make a step that has nothing to do, by numbers of steps
  step       seconds of one step that does nothing: on the spot, as a job, as a step of an allocation; as many at a time as nodes
  nodes      steps that sleep, a picture in parts and a small capture: on the spot, on 1 node, on 2 nodes; wall seconds and CPU seconds of the work
  capture    seconds a picture of stagectl, merge, remap and ilfpack a place, from which docs/CLUSTER.md makes its table

Wall seconds are those of the machine as it is: with other work on it, believe the CPU seconds.
"""
import csv
import os
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent.parent
sys.path += [str(TOP / "tests"), str(TOP / "tests" / "slurm"), str(TOP / "tests" / "ilfmat")]
BUILD = (TOP / os.environ.get("ILF_BUILD", "build")).resolve()
OUT = BUILD / "scale"
os.environ.setdefault("ILF_SLURM", "1")

import test_slurm as T      # noqa: E402  (the cluster, the room)

rows = []


def say(kind, what, **figures):
    rows.append({"kind": kind, "what": what, **figures})
    print(f"{kind:8} {what:44} " + "  ".join(f"{k} {v:.3g}" for k, v in figures.items()), flush=True)


def timed(command, env, **more):
    """Wall seconds, and CPU seconds of it and its children here (what a cluster's daemons run is not among them)."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run([str(c) for c in command], env=env, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, **more)
    wall, after = time.monotonic() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def empty_steps(folder, n, step, work=":"):
    """A makefile of n steps, each of which works and writes an empty file."""
    (folder / "Makefile").write_text(f"SHELL := /bin/bash\nall: $(patsubst %,{folder}/%.out,$(shell seq {n}))\n{folder}/%.out:\n"
                                     f"\t@{step} sh -c '{work}; : > $@'\nclean:\n\t@rm -f {folder}/*.out\n")
    return ["make", "-f", folder / "Makefile"]


def overheads(cluster, folder):
    env = cluster.environment()
    for n in (1000, 4000):
        command = [*empty_steps(folder, n, ""), "-j2"]
        wall, cpu = timed(command, env)
        again, _ = timed(command, env)
        say("make", f"{n} empty steps", ms_a_step=1000 * wall / n, cpu_ms_a_step=1000 * cpu / n, ms_a_step_again=1000 * again / n)
        timed([*command, "clean"], env)
    on = f"bash {TOP}/scenes/slurm.sh nothing $@"
    for jobs in (1, 2):
        wall, cpu = timed([*empty_steps(folder, 60, on), f"-j{jobs}"], env)
        say("step", f"a job, {jobs} at a time", s_a_step=wall / 60, here_cpu_s_a_step=cpu / 60)
        timed([*empty_steps(folder, 60, on), "clean"], env)
    wall, cpu = timed([*empty_steps(folder, 60, on), "-j6"], env)
    say("step", "a job, 6 at a time (4 wait)", s_a_step=wall / 60, here_cpu_s_a_step=cpu / 60)
    timed([*empty_steps(folder, 60, on), "clean"], env)
    wall, cpu = timed(["salloc", "-Q", "-N2", "-n2", *empty_steps(folder, 60, on), "-j2"], env)
    say("step", "a step of an allocation, 2 at a time", s_a_step=wall / 60, here_cpu_s_a_step=cpu / 60)


def scene(folder):
    folder.mkdir()
    (folder / "room.rad").write_text(T.ROOM)
    (folder / "view.vf").write_text(T.VIEW)
    (folder / "s.conf").write_text(T.SESSION.replace("nodes = 2x2", "nodes = 4x3").replace("--size 48", "--size 160").replace("--supersample 1", "--supersample 2"))
    (folder / "room.oct").write_bytes(T.run("oconv", "-f", "room.rad", cwd=folder).out)
    return folder


def work(folder):
    """CPU seconds of a picture's parts."""
    import json
    return json.loads((folder / "a.json").read_text())["cpu_s"]


def nodes(cluster, folder):
    env = cluster.environment()
    command = ["make", "-s", "-C", TOP / "scenes", f"BUILD={BUILD}", "QUIET=--quiet"]
    # steps that wait need no processor: what is lost on the way is seen, whatever else the machine does
    on = f"bash {TOP}/scenes/slurm.sh nothing $@"
    for name, how, more in (("on the spot, -j1", "", ["-j1"]), ("on the spot, -j2", "", ["-j2"]), ("one node, -j1", f"SLURM='-w n1' {on}", ["-j1"]),
                            ("two nodes, -j2", on, ["-j2"]), ("two nodes, -j8 (6 wait)", on, ["-j8"])):
        shutil.rmtree(folder / "empty")
        (folder / "empty").mkdir()
        wall, _ = timed([*empty_steps(folder / "empty", 20, how, "sleep 1"), *more], env)
        say("nodes", f"20 steps of 1 s, {name}", wall_s=wall, steps_per_s=20 / wall)
    options = "-x 400 -y 300 -ab 2 -aa 0 -ad 128 -lw 0"
    for name, more in (("on the spot, -j1", ["-j1"]), ("on the spot, -j2", ["-j2"]), ("one node", ["-j8", "ON=slurm", "SLURM=-w n1"]), ("two nodes", ["-j8", "ON=slurm"])):
        where = scene(folder / name.replace(" ", "").replace(",", ""))
        wall, _ = timed([*command, *T.picture(where, options, 16), *more], env)
        say("nodes", f"a picture in 16 parts, {name}", wall_s=wall, work_cpu_s=work(where), work_per_wall=work(where) / wall)
        wall, cpu = timed([*command, f"CAPTURE={where}/s.conf", *more], env)
        say("nodes", f"a capture of 4 x 3 places, {name}", wall_s=wall, here_cpu_s=cpu)


def main():
    if T.MISSING:
        print(f"bench-scale: left out: not found: {' '.join(T.MISSING)} (packages slurmctld slurmd slurm-client munge)")
        return 0
    shutil.rmtree(OUT, ignore_errors=True)
    (OUT / "empty").mkdir(parents=True)
    cluster = T.Cluster()
    try:
        overheads(cluster, OUT / "empty")
        nodes(cluster, OUT)
    finally:
        cluster.close()
    with open(BUILD / "scale.csv", "w", newline="") as f:
        w = csv.DictWriter(f, list(dict.fromkeys(k for r in rows for k in r)))
        w.writeheader()
        w.writerows(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
