"""The report's sections by name: what `python -m report NAME` runs, and `all` of them, then the page."""
import importlib

from . import run

SECTIONS = {"figures": "figures", "time": "sweep_time", "size": "sweep_size", "storage": "sweep_storage", "budget": "budget", "depth": "sweep_depth",
            "grid": "sweep_grid", "lamps": "sweep_lamps",
            "shrink": "sweep_shrink"}
TOOLS = {"colordata": "colordata", "texels": "texels", "page": "page", "check": "check"}


def call(module):
    def main(argv=()):
        return importlib.import_module(f".{module}", __package__).main(argv)
    return main


def everything(argv):
    """The sections named (all, if none), one after the other, then the page of those and only those."""
    from . import page
    wanted = list(argv) or list(SECTIONS)
    for k, name in enumerate(wanted):
        if name not in SECTIONS:
            raise run.ReportError(f"expected sections of {' '.join(SECTIONS)}, found {name}")
        run.say(f"section {k + 1} of {len(wanted)}: {name}")
        call(SECTIONS[name])()
    page.main(wanted)


COMMANDS = {**{name: call(module) for name, module in {**SECTIONS, **TOOLS}.items()}, "all": everything}
