"""Stages and light fields for the tests of ilfstage, written from its man page and docs/FORMAT.md."""
import contextlib
import csv
import json
import os
import sys

import numpy as np
import pytest

from conftest import BIN, FETCHED, TOP, environment

sys.path[:0] = [str(TOP / "tools")]

import ilf  # noqa: E402


@pytest.fixture(autouse=True)
def our_programs(monkeypatch):
    """Parts that run in the tests' own process find Radiance's programs as the program does.  (Imported by each file of tests.)"""
    monkeypatch.setenv("PATH", f"{BIN}:{FETCHED}:{os.environ['PATH']}")
    monkeypatch.setenv("RAYPATH", environment()["RAYPATH"])


PLANE = {"origin": (-.5, -.5, 0), "U": (1, 0, 0), "V": (0, 1, 0)}
RGB = {"red": (9, .3, .1), "green": (.5, 8, .4), "blue": (.2, .6, 7)}


def unit(v):
    return np.asarray(v, float) / np.linalg.norm(v, axis=-1, keepdims=True)


def spread(n, up=False):
    """n unit vectors, spread evenly; up: over the upper half."""
    z = 1 - (2 * np.arange(n) + 1) / n / (2 if up else 1)
    a = np.arange(n) * np.pi * (3 - 5 ** .5)
    return np.stack([np.sqrt(1 - z * z) * np.cos(a), np.sqrt(1 - z * z) * np.sin(a), z], -1)


def stage_text(positions, aims=None, channels=RGB, size=.05, beam="cosine 1", top='unit = "m"', extra="", each=""):
    """A stage file of lamps at those positions, aimed at the origin where nothing else is said."""
    lines = [top, "[fixture.lamp]", f"size = {size}", f'beam = "{beam}"']
    for name, rgb in channels.items():
        lines += [f"[fixture.lamp.channel.{name}]", f"rgb = {list(map(float, rgb))}", extra]
    for k, p in enumerate(positions):
        lines += ["[[light]]", f'name = "l{k}"', 'fixture = "lamp"', f"position = {list(map(float, p))}", f"aim = {[0, 0, 0] if aims is None else list(map(float, aims[k]))}", each]
    return "\n".join(lines) + "\n"


def write_field(path, radiance, n_theta=96, n_phi=48, grid=(1, 1), lamps=None):
    """A light field whose probes are radiance(directions (n_phi, n_theta, 3), node (3,)) -> (n_phi, n_theta, 3)."""
    theta = -np.pi + (np.arange(n_theta) + .5) * 2 * np.pi / n_theta
    phi = ((np.arange(n_phi) + .5) * np.pi / 2 / n_phi)[:, None]
    d = np.stack(np.broadcast_arrays(np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)), -1)
    along = [np.linspace(-.5, .5, n) if n > 1 else [0.] for n in grid]
    probes = np.array([[radiance(d, np.array([x, y, 0])) for x in along[0]] for y in along[1]])
    ilf.write(path, probes.astype(np.float32), lamps=lamps, **PLANE)
    return path.name


def lobes(seed=3, n=5, sharp=6.):
    rng = np.random.default_rng(seed)
    axes, colours = unit(rng.normal(size=(n, 3)) + [0, 0, 1]), rng.uniform(.2, 1.5, (n, 3))
    return lambda d, at: .1 + np.exp(sharp * (d @ axes.T - 1)) @ colours


def disc_lamp(position, axis, diameter, radiance, power=1.):
    """A lamp of a light field of version 2: a round face of that radiance along its axis."""
    axis = unit(axis)
    a = unit(np.cross(axis, [1, 0, 0] if abs(axis[0]) < .9 else [0, 1, 0])) * diameter / 2
    masks = () if power == 1 else (ilf.Mask("beam", coef=(*axis, power - 1, 1, 0)),)
    return ilf.Lamp("disc", np.asarray(position) - PLANE["origin"], radiance, a=a, b=np.cross(axis, a), masks=masks)


def outcome(folder):
    """(report, drive values by channel (t, k)) of r.json and drive.csv."""
    with open(folder / "drive.csv") as f:
        rows = list(csv.reader(f))
    return json.loads((folder / "r.json").read_text()), dict(zip(rows[0], np.array(rows[1:], float).T))


NOTES = []      # of the last run of inside()


def inside(folder, stage, field, *options):
    """As the program, in this process: (report, drive values, its words).  40 directions unless the options say otherwise."""
    from ilfstage import job, report
    from ilfstage import options as cli
    given = cli.parse(list(map(str, ("--quiet", "--threads", 1, "--normals", 40, "--report", "r.json", "-o", "drive.csv", *options, stage, field))))
    cli.check(given)
    with contextlib.chdir(folder):
        NOTES.clear()
        tree = job.Job(given, NOTES.append).run()
    return *outcome(folder), "\n".join(report.text(tree))
