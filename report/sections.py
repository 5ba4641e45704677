"""The report's sections by name: what `python -m report NAME` runs."""
import importlib

NAMES = {"time": "sweep_time"}


def call(module):
    def main(argv):
        return importlib.import_module(f".{module}", __package__).main(argv)
    return main


COMMANDS = {name: call(module) for name, module in {**NAMES, "colordata": "colordata"}.items()}
