"""Puts pictures that rpict -yr made of some rows each together, byte by byte: the picture that one rpict would have made.

usage: rows.py [--log FILE.json [--before FILE.json]] -o OUT PART...

PARTs are the rows of one picture, from its top to its bottom, none missing: the line "ROWS= FIRST COUNT of ALL" in each one's
header says which.  The header is the first part's, without what -yr put in there.  A row's code does not depend on the row above, so
nothing is decoded.  OUT is written whole or not at all.

--log FILE.json: a command for the whole, and what all parts cost together, from what timed.py wrote beside each of them (PART with .json for .hdr): sums of seconds, the
largest of the memories.  --before: what had to be done once before them.
"""
import argparse
import json
import os
import re
import sys

ROWS = re.compile(rb"^ROWS= (\d+) (\d+) of (\d+)\n", re.M)
OPTION = re.compile(rb" -yr \d+ \d+")
SIZE = re.compile(rb"-Y +(\d+) +\+X +(\d+)\n")


class Refused(Exception):
    pass


def part(path):
    """Header, rows (first, count, all), width, and the rows' bytes of one part."""
    with open(path, "rb") as f:
        data = f.read()
    head, mark, rest = data.partition(b"\n\n")
    head += b"\n"
    rows, size = ROWS.search(head), SIZE.match(rest)
    if not (mark and head.startswith(b"#?RADIANCE") and rows and size):
        raise Refused(f"{path}: expected a picture of rpict -yr, found " + ("a picture of all rows" if size and not rows else "another file"))
    rows = tuple(int(n) for n in rows.groups())
    if int(size[1]) != rows[1]:
        raise Refused(f"{path}: expected {rows[1]} rows, as its header says, found {int(size[1])}")
    return head, rows, int(size[2]), rest[size.end():]


def joined(paths):
    """The whole picture's bytes."""
    wanted, whole, body = 0, None, []
    for path in paths:
        head, (first, count, rows), width, data = part(path)
        if whole is None:
            whole, header = (rows, width), head
        if (rows, width) != whole:
            raise Refused(f"{path}: expected rows of a picture of {whole[1]} x {whole[0]}, found {width} x {rows}")
        if first != wanted:
            raise Refused(f"{path}: expected row {wanted} first, found row {first}")
        wanted += count
        body.append(data)
    if wanted != whole[0]:
        raise Refused(f"{paths[-1]}: expected rows up to {whole[0]}, found an end after {wanted}")
    return ROWS.sub(b"", OPTION.sub(b"", header)) + b"\n-Y %8d +X %8d\n" % whole + b"".join(body)


def cost(parts, before):
    """What the parts and what came before them cost together."""
    logs = []
    for path in [*before, *(os.path.splitext(p)[0] + ".json" for p in parts)]:
        with open(path) as f:
            logs.append(json.load(f))
    # one command that does the same without parts, with a cache of its own
    whole = re.sub(r" -af \S+ -yr \d+ \d+| -yr \d+ \d+", " -yr 0 1", logs[-1]["command"])
    return {"command": whole, "cpu_s": round(sum(x["cpu_s"] for x in logs), 2), "wall_s": round(sum(x["wall_s"] for x in logs), 2),
            "peak_mb": max(x["peak_mb"] for x in logs), "programs": logs[-1]["programs"]}


def write(path, data):
    """The file, whole or not at all."""
    tmp = f"{path}.{os.getpid()}.tmp"
    try:
        with open(tmp, "wb") as out:
            out.write(data)
        os.replace(tmp, path)
    finally:
        if os.path.exists(tmp):
            os.unlink(tmp)


def main():
    ap = argparse.ArgumentParser(description="put rows of rpict -yr together")
    ap.add_argument("-o", "--output", required=True, help="the whole picture")
    ap.add_argument("--log", metavar="FILE.json", help="what the parts cost together")
    ap.add_argument("--before", action="append", default=[], metavar="FILE.json", help="what came before them cost")
    ap.add_argument("part", nargs="+", help="pictures of rpict -yr, from top to bottom")
    a = ap.parse_args()
    try:
        data = joined(a.part)
        log = json.dumps(cost(a.part, a.before), indent=1) if a.log else None
        write(a.output, data)
        if a.log:
            write(a.log, log.encode() + b"\n")
    except Refused as err:
        print(f"rows.py: {err}", file=sys.stderr)
        return 1
    except OSError as err:
        print(f"rows.py: {err.filename}: {err.strerror}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
