"""Radiance's programs: run, and their words made one line."""
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np

from .errors import Bad


def environment():
    """Where our programs and their function files are; the launcher says in front of which others."""
    return dict(os.environ, LC_ALL="C")


def found(program):
    """Where a program is; raises Bad."""
    path = shutil.which(str(program), path=environment().get("PATH"))
    if not path:
        raise Bad(f"{program}: expected this program of Radiance's on PATH, found none")
    return Path(path)


def run(*words, data=b"", cwd=None):
    """What a program writes; raises Bad with its own words."""
    found(words[0])
    p = subprocess.run([str(w) for w in words], input=data, capture_output=True, cwd=cwd, env=environment())
    if p.returncode:
        said = p.stderr.decode("utf-8", "replace").strip().splitlines()
        raise Bad(f"{words[0]}: {' '.join(said[-1].split()) if said else f'ended with status {p.returncode}'}")
    return p.stdout


def oconv(folder, name, *files):
    """An octree in `folder`; its name."""
    data = run("oconv", *files, cwd=folder)
    (folder / name).unlink(missing_ok=True)     # it may stand for a file of the user's (matrix.lend)
    (folder / name).write_bytes(data)
    return name


def rays(points, directions):
    """(n, 6) float64, as bytes."""
    return np.ascontiguousarray(np.concatenate(np.broadcast_arrays(points, directions), -1).reshape(-1, 6), np.float64).tobytes()


def row(*values):
    return " ".join(f"{x:.9g}" for x in np.ravel(values))


def write_mesh(path, vertices, triangles):
    """A Wavefront OBJ."""
    with open(path, "w") as f:
        np.savetxt(f, vertices, "v %.9g %.9g %.9g")
        np.savetxt(f, triangles + 1, "f %d %d %d")
