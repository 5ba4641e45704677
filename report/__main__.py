"""The report's command line: python -m report NAME [arguments], at the project's top."""
import sys

from . import measures


def measure(argv):
    """Prints how far a picture is from a reference: the last part of every row's command."""
    import argparse
    import os
    import tempfile
    ap = argparse.ArgumentParser(prog="report measure", description="error of a picture over lit pixels")
    ap.add_argument("--reference", required=True)
    ap.add_argument("--mask", required=True)
    ap.add_argument("--clipped", action="store_true", help="clipped at the figure's white, all covered pixels: compare.py's rmse")
    ap.add_argument("picture", help="- for a Radiance picture on standard input")
    a = ap.parse_args(argv)
    picture = a.picture
    if picture == "-":
        with tempfile.NamedTemporaryFile(suffix=".hdr", delete=False) as f:
            f.write(sys.stdin.buffer.read())
        picture = f.name
    try:
        found = (measures.of_files_clipped if a.clipped else measures.of_files)(picture, a.reference, a.mask)
    finally:
        if a.picture == "-":
            os.unlink(picture)
    print("  ".join(f"{k} {v:.6g}" for k, v in found.items()))
    return 0


def commands():
    from . import fields, probes, sweep_shrink
    table = {"measure": measure, "probes": probes.main, "coarser": fields.main, "shrunk": sweep_shrink.measure, "dwaa": sweep_shrink.dwaa}
    from . import sections
    table.update(sections.COMMANDS)
    return table


def main():
    if sys.argv[1:2] == ["measure"]:
        return measure(sys.argv[2:])
    table = commands()
    if len(sys.argv) < 2 or sys.argv[1] not in table:
        print(f"report: expected one of {' '.join(table)}, found {' '.join(sys.argv[1:2]) or 'nothing'}", file=sys.stderr)
        return 2
    return table[sys.argv[1]](sys.argv[2:]) or 0


if __name__ == "__main__":
    from .run import ReportError
    try:
        sys.exit(main())
    except (ReportError, measures.pictures.PictureError, OSError, ValueError) as err:
        print(f"report: {err}", file=sys.stderr)
        sys.exit(1)
