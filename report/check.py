"""Runs the rows' commands again, as a reader would, and compares what they print with the table.

usage: python -m report check [SECTION...] [--most CPU_SECONDS]
Rows that took longer than that (default 5) are left out and counted.  A row agrees when the error that its command prints is the row's to 0.1 %
of it, or to 1e-6 where it is nothing: the pictures are drawn with the same random numbers.
"""
import argparse
import re
import subprocess

from . import run


def printed(command):
    """The error that a row's command prints last."""
    p = subprocess.run(["bash", "-euo", "pipefail", "-c", command], cwd=run.TOP, env=run.environment(), stdin=subprocess.DEVNULL,
                       stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    found = re.findall(r"^rmse (\S+)", p.stdout, re.M)
    if p.returncode or not found:
        raise run.ReportError(f"expected an error from {command[:200]}, found exit {p.returncode}: {p.stderr.strip()[-300:]}")
    return float(found[-1])


def agrees(a, b):
    return abs(a - b) <= max(1e-3 * abs(b), 1e-6)


def main(argv):
    ap = argparse.ArgumentParser(prog="report check", description="the rows' commands again")
    ap.add_argument("--most", type=float, default=5, metavar="CPU_SECONDS")
    ap.add_argument("section", nargs="*")
    a = ap.parse_args(argv)
    rows = [r for r in run.read_rows(run.TOP / run.OUT / "report.csv") if not a.section or r["section"] in a.section]
    short = [r for r in rows if float(r["cpu_s"] or 0) <= a.most]
    wrong = 0
    for r in short:
        again = printed(r["command"])
        good = agrees(again, float(r["error"]))
        wrong += not good
        run.say(f"{r['section']}, {r['row']}: {float(r['error']):.6g}, again {again:.6g}{'' if good else '  DIFFERS'}")
    print(f"{len(short)} rows repeated, {wrong} differ, {len(rows) - len(short)} left out (more than {a.most:g} CPU s)")
    return 1 if wrong else 0
