"""The report's sections by name: what `python -m report NAME` runs."""
import importlib

NAMES = {"figures": "figures", "time": "sweep_time", "size": "sweep_size", "storage": "sweep_storage", "budget": "budget",
         "depth": "sweep_depth", "grid": "sweep_grid", "page": "page"}


def call(module):
    def main(argv):
        return importlib.import_module(f".{module}", __package__).main(argv)
    return main


COMMANDS = {name: call(module) for name, module in {**NAMES, "colordata": "colordata", "texels": "texels"}.items()}
