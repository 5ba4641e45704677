"""Runs one command and keeps what it cost beside its output.

usage: timed.py --log FILE.json -o OUT -- COMMAND ARG...

COMMAND's standard output becomes OUT (written to a temporary file and renamed, so that a run that was
stopped leaves no OUT).  FILE.json then holds the command, its CPU seconds (user + system, of it and
its children), wall-clock seconds, peak memory in MB, and which builds of the programs in PATH's first folder it named
(builds.py).
"""
import argparse
import json
import os
import resource
import shlex
import signal
import subprocess
import sys
import time

import builds


ENDED = []


def carry_out(command, out):
    """Its exit status; or the signal that make or Slurm ends a step by, which is passed on to it (ENDED)."""
    child = None

    def end(number, _frame):
        ENDED.append(number)
        if child:
            child.terminate()
    signal.signal(signal.SIGTERM, end)
    child = subprocess.Popen(command, stdout=out)
    if ENDED:           # while it was being started
        child.terminate()
    status = child.wait()
    return ENDED[0] if ENDED else status


def main():
    ap = argparse.ArgumentParser(description="run a command, keep its output and what it cost")
    ap.add_argument("--log", required=True, metavar="FILE.json", help="what it cost")
    ap.add_argument("-o", "--output", required=True, help="the command's standard output")
    ap.add_argument("command", nargs="+", help="after --: the command and its arguments")
    a = ap.parse_args()
    tmp = f"{a.output}.{os.getpid()}.tmp"
    made_by = builds.programs(" ".join(a.command), os.environ.get("PATH", "").split(":")[0])
    start = time.monotonic()
    try:
        with open(tmp, "wb") as out:
            status = carry_out(a.command, out)
        if status in ENDED:
            return 128 + status
        if status:
            print(f"timed.py: {a.command[0]}: expected exit status 0, found {status}", file=sys.stderr)
            return 1
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        os.replace(tmp, a.output)
    except OSError as err:
        print(f"timed.py: {err.filename}: {err.strerror}", file=sys.stderr)
        return 1
    finally:
        if os.path.exists(tmp):
            os.unlink(tmp)
    log = {"command": shlex.join(a.command), "cpu_s": round(used.ru_utime + used.ru_stime, 2),
           "wall_s": round(time.monotonic() - start, 2), "peak_mb": round(used.ru_maxrss / 1024, 1), "programs": made_by}
    tmp = f"{a.log}.{os.getpid()}.tmp"
    with open(tmp, "w") as out:
        json.dump(log, out, indent=1)
        out.write("\n")
    os.replace(tmp, a.log)
    return 0


if __name__ == "__main__":
    sys.exit(main())
