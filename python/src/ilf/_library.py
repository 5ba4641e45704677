"""libilf's shared library, found and opened by cffi.

The declarations are libilf's own headers, so that there is one place where they stand.  No compiler is needed, and cffi lets other Python threads
run (releases the GIL) while a function of libilf does its work.

Where the library is looked for, in this order:

1. ``ILF_LIBRARY``, a file: that one or none;
2. in the package itself, where it was put when the package was built with libilf built before;
3. ``build/lib`` of the source tree, where the package is used from there;
4. the folder that ``pkg-config --variable=libdir ilf`` names;
5. where the system's loader looks.
"""
import os
import re
import shutil
import subprocess
from pathlib import Path

from cffi import FFI  # type: ignore[import-untyped]

NAME = "libilf.so.0"
HERE = Path(__file__).resolve().parent
TREE = HERE.parents[2]          # the source tree, where the package lies in python/src/ilf of it
NEEDED = "ilf_open ilf_eval_many ilf_view_probe ilf_get_luminaires ilf_writer_open".split()


def declarations(text):
    """What cffi takes of a header: no comments, no preprocessor, no bodies."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    text = re.sub(r"^#ifdef __cplusplus\n.*?^#endif\n", "", text, flags=re.S | re.M)
    text = re.sub(r"^\s*#.*$", "", text, flags=re.M)
    return re.sub(r"^static inline[^{]*\{.*?^\}\n", "", text, flags=re.S | re.M)


def _headers():
    for folder in (HERE / "include", TREE / "ilfmat"):
        if (folder / "ilf.h").is_file():
            return "".join(declarations((folder / name).read_text()) for name in ("ilf_luminaire.h", "ilf.h"))
    raise ImportError(f"ilf: expected ilf.h in {HERE / 'include'}, found none: install the package again")


def _by_pkg_config():
    if not shutil.which("pkg-config"):
        return None
    p = subprocess.run(["pkg-config", "--variable=libdir", "ilf"], capture_output=True, text=True)
    return Path(p.stdout.strip()) / NAME if p.returncode == 0 and p.stdout.strip() else None


def _find():
    own = os.environ.get("ILF_LIBRARY")
    if own:
        return own
    for place in (lambda: HERE / NAME, lambda: TREE / "build/lib" / NAME, _by_pkg_config):
        found = place()
        if found is not None and found.is_file():
            return str(found)
    return NAME


def _load():
    path = _find()
    try:
        opened = ffi.dlopen(path)
    except OSError as e:
        words = str(e).removeprefix(f"cannot load library '{path}': ").partition(".  Additionally")[0]
        hint = "" if path != NAME else " (`make tools` makes it, then install this package again; or name it in ILF_LIBRARY)"
        raise ImportError(f"ilf: expected {NAME}, found: {' '.join(words.split())}{hint}") from None
    missing = [name for name in NEEDED if not hasattr(opened, name)]
    if missing:
        raise ImportError(f"ilf: {path}: expected the function {missing[0]}, found none: an older libilf?")
    return opened, path


ffi = FFI()
ffi.cdef(_headers())
lib, path = _load()
