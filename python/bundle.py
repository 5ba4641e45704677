"""For hatchling, while a wheel is made: what the package takes from the tree that it stands in.

libilf's headers always (the declarations that Python calls by); libilf.so.0 where it was built or installed, and then the wheel is for this
kind of machine alone.  Without it the package looks for an installed one when it is imported.
"""
import os
import sysconfig
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

HERE = Path(__file__).resolve().parent
LIBRARY = "libilf.so.0"
# in the source tree, and as installed (PREFIX/share/ilf/python)
HEADERS = [HERE.parent / "ilfmat", HERE.parents[2] / "include"]
LIBRARIES = [HERE.parent / "build/lib" / LIBRARY, HERE.parents[2] / "lib" / LIBRARY]


class Bundle(BuildHookInterface):
    def initialize(self, version, build_data):
        if version == "editable":
            return
        folder = next((f for f in HEADERS if (f / "ilf.h").is_file()), None)
        if folder is None:
            raise FileNotFoundError("expected ilf.h beside the package (ilfmat/ilf.h), found none: install from the source tree")
        take = {str(folder / name): f"ilf/include/{name}" for name in ("ilf.h", "ilf_luminaire.h")}
        own = os.environ.get("ILF_LIBRARY")
        library = next((f for f in ([Path(own)] if own else LIBRARIES) if f.is_file()), None)
        if library is not None:
            take[str(library.resolve())] = f"ilf/{LIBRARY}"
            build_data["pure_python"] = False
            build_data["tag"] = "py3-none-" + sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["force_include"].update(take)
