"""ilfstage's main."""
import os
import sys

from . import PROGRAM


def version():
    return os.environ.get("ILFSTAGE_VERSION", "0.1.0")


def one_thread_for_algebra():
    """Before numpy comes in: the problems are small, and threads would wait for each other.  (--threads is for lookups in light fields.)"""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def lacks(e):
    print(f"{PROGRAM}: expected Python with numpy, scipy and cffi (make build/venv/.packages, or ILF_PYTHON=...), found: {' '.join(str(e).split())}",
          file=sys.stderr)
    return 1


def main(words):
    one_thread_for_algebra()
    try:
        from . import complete, options
        from .errors import Bad, Usage
    except ImportError as e:
        return lacks(e)
    if "--help" in words or "--version" in words:
        sys.stdout.write(options.help_text() if "--help" in words else f"{PROGRAM} {version()}\n")
        return 0
    shell = words[0].removeprefix("--completion=") if len(words) == 1 and words[0].startswith("--completion=") else ""
    if shell in ("bash", "zsh"):
        sys.stdout.write(complete.script(shell, PROGRAM, os.environ.get("ILFSTAGE_CALLED", PROGRAM)))
        return 0
    try:
        if shell:
            raise Usage(f"option --completion: expected bash or zsh, found '{shell}'")
        given = options.parse(words)
        options.check(given)
    except Usage as e:
        print(f"{PROGRAM}: {e}; try '{PROGRAM} --help'", file=sys.stderr)
        return 2
    try:
        from . import job, report
        note = (lambda text: None) if given.quiet else (lambda text: print(f"{PROGRAM}: {text}", file=sys.stderr))
        tree = job.Job(given, note).run()
        print("\n".join(report.text(tree)))
        sys.stdout.flush()
    except Bad as e:
        print(f"{PROGRAM}: {e}", file=sys.stderr)
        return 1
    except ImportError as e:
        return lacks(e)
    except (MemoryError, OSError) as e:
        print(f"{PROGRAM}: {' '.join(str(e).split()) or 'not enough memory'}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
