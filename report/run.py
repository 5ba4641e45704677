"""Runs commands once, keeps what each cost, and collects the rows of a section's table.

A command is shell text, written for a shell at the project's top folder in the environment of `make env`: what is run
is what the page shows.  Its standard output becomes a file; beside it lies a .json of scenes/timed.py (CPU seconds, user +
system, of the command and its children; peak memory of the largest of them).  A command whose output is there, and
was made by the same text and the same builds of the programs that it names, from inputs no younger, is not run again: a report that was
stopped goes on where it was, and shows no number of another program than the one that is there.
"""
import csv
import json
import os
import re
import shlex
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(TOP / "scenes"))
import builds  # noqa: E402

BUILD = os.environ.get("ILF_BUILD", "build")
OUT = f"{BUILD}/report"
PYTHON = "build/venv/bin/python"
FIELDS = "section figure row x y measure error ssim reference reference_error cpu_s peak_mb note command programs".split()
BEGUN = time.monotonic()
LOCK = threading.Lock()


class ReportError(Exception):
    """One line that says what failed."""


def environment():
    env = dict(os.environ, LC_ALL="C")
    env["PATH"] = f"{TOP}/{BUILD}/bin:{TOP}/build/bin:{env.get('PATH', '')}"
    env["RAYPATH"] = f".:{TOP}/{BUILD}/lib:{TOP}/build/lib"
    env["OMP_NUM_THREADS"] = "1"
    return env


def say(text):
    with LOCK:
        print(f"  report {time.monotonic() - BEGUN:5.0f} s  {text}", flush=True)


def inputs_of(command, reads=()):
    """The files of the build that a command names and that exist, and those of `reads`: a younger one makes the result stale."""
    words = set(re.findall(rf"{re.escape(BUILD)}/(?:report|figures|demo)/[\w./-]+", command))
    # a capture's own copy of the indirect light grows while it is used
    return [TOP / w for w in {*words, *reads} if (TOP / w).is_file() and (not w.endswith(".amb") or w.endswith("/stage.amb"))]


def programs(command):
    """{name: digest} of our programs that a command names, as they are."""
    return builds.programs(command, str(TOP / BUILD / "bin"))


def fresh(command, out, log, reads):
    try:
        known = json.loads(log.read_text())
        if known["text"] != command or known["programs"] != programs(command):
            return False
        if not out.is_file():
            return False
        made = log.stat().st_mtime     # written after the command has ended, so after all that it wrote
    except (OSError, ValueError, KeyError):
        return False
    return all(f.stat().st_mtime <= made for f in inputs_of(command, reads))


def run(command, out, label=None, reads=()):
    """Runs `command` with its standard output to `out` (path from the top) unless that is done; returns its cost.

    reads: files that it depends on without naming them.
    """
    path, log = TOP / out, TOP / f"{out}.json"
    if not fresh(command, path, log, reads):
        path.parent.mkdir(parents=True, exist_ok=True)
        simple = not re.search(r"[|;&<>$\n*()]", command)
        argv = shlex.split(command) if simple else ["bash", "-euo", "pipefail", "-c", command]
        timed = [sys.executable, str(TOP / "scenes" / "timed.py"), "--log", str(log), "-o", str(path), "--", *argv]
        p = subprocess.run(timed, cwd=TOP, env=environment(), stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if p.returncode:
            raise ReportError(f"{label or out}: expected exit status 0 of {command[:300]}, found: {p.stderr.strip()[-400:]}")
        cost = json.loads(log.read_text())
        cost["text"] = command
        log.write_text(json.dumps(cost, indent=1) + "\n")
        if label:
            say(f"{label}: {cost['cpu_s']:.1f} CPU s")
    return json.loads(log.read_text())


def several(jobs):
    """Calls each of `jobs` (functions without arguments), two at a time; results in their order."""
    with ThreadPoolExecutor(int(os.environ.get("REPORT_JOBS", "2"))) as pool:
        futures = [pool.submit(job) for job in jobs]
        try:
            return [f.result() for f in futures]
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def number(x):
    return f"{x:.6g}" if isinstance(x, float) else x


def in_words(found):
    return ", ".join(f"{name} {digest}" for name, digest in sorted(found.items()))


def write_rows(section, rows):
    """The section's rows to a file of their own, whole or not at all."""
    path = TOP / OUT / f"{section}.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".csv.part")
    with open(part, "w", newline="") as f:
        w = csv.DictWriter(f, FIELDS)
        w.writeheader()
        for r in rows:
            missing = set(r) - set(FIELDS)
            assert not missing, missing
            made_by = r.get("programs", programs(r["command"]))
            w.writerow({"section": section, **{k: number(v) for k, v in r.items()}, "programs": in_words(made_by)})
    os.replace(part, path)


def read_rows(path):
    with open(path, newline="") as f:
        rows = list(csv.DictReader(f))
    if rows and list(rows[0]) != FIELDS:
        raise ReportError(f"{path}: expected the columns {' '.join(FIELDS)}, found {' '.join(map(str, rows[0]))}")
    return rows
