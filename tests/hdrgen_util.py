"""What the tests of hdrgen share: the bench's series, and how the command is run on one."""
import sys

from conftest import TOP, run

sys.path.insert(0, str(TOP / "bench" / "hdrgen"))
from series import *  # noqa: E402,F401,F403


def hdrgen(folder, names, *args, out="out.exr", code=0, times="times.txt", **kw):
    more = ["--times", times] if times else []
    return run("hdrgen", *more, *args, "-o", out, *names, cwd=folder, code=code, **kw)
