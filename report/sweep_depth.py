"""Depth correction: the closer the auxiliary geometry is to the true room, the better.

Small bare lamps close by, whose direction changes from probe to probe while the light's amount does not.  One light field, looked up on spheres and boxes of several sizes, on the room's walls, on the walls with the lamps, and without
correction.  How far a geometry is from the truth is said by the angle at which two neighbouring probes miss each other when both look at
the point that a ray meets,

    delta |1/r - 1/r_true| ,

delta the distance of neighbours, r along a direction from the middle of the plane, weighted with the light that falls on the plane
from there: L cos(phi) over the hemisphere.  Without correction r is infinite.
"""
import subprocess

import numpy as np

from . import probes, run, scene
from .run import OUT

HERE = f"{OUT}/depth"
GRID, SIZE = 4, (192, 96)
# name, what family, geometry (shell text), or None for no correction
FAR = 1e9


def geometries(s):
    found = [("nodepth", "no correction", None)]
    found += [(f"sphere of {r:g} m", "spheres", f"echo light sphere aux 0 0 4 0 0 0 {r:g}") for r in (12, 4, 3, 2.4, 2)]
    found += [(f"room x {k:g}", "boxes", f"xform -m light -t 0 0 -.55 -s {k:g} -t 0 0 .55 {s.room}") for k in (1.5, 1.25)]
    return found + [("room, no lamps", "boxes", f"xform -m light {s.room}"), ("the true room", "true geometry", s.surfaces())]


def distances(octree, origin, directions):
    """Length of each ray to the surface that it meets; FAR where there is none."""
    rays = np.empty((len(directions), 6), "<f4")
    rays[:, :3], rays[:, 3:] = origin, directions
    p = subprocess.run(["rtrace", "-h", "-ff", "-w", "-ab", "0", "-di", "0", "-oL", octree], cwd=run.TOP, env=run.environment(), input=rays.tobytes(),
                       stdout=subprocess.PIPE, check=True)
    r = np.frombuffer(p.stdout, "<f4").astype(float)
    return np.where(r > 0, np.minimum(r, FAR), FAR)


def miss(r, r_true, light, phi, spacing):
    """Degrees by which neighbours miss each other, weighted with light (W/sr/m2, luminance) and the plane's cosine."""
    w = light * np.cos(phi) * np.sin(phi)
    return float(np.degrees((w * spacing * np.abs(1 / r - 1 / r_true)).sum() / w.sum()))


def main(argv=()):
    from .fields import read
    s = scene.lamps()
    own = s.prepare()
    field = s.field(GRID, SIZE)
    n_theta, n_phi = SIZE
    every = np.argwhere(np.ones((n_phi, n_theta), bool))
    d, _ = probes.texel_rays(every[:, 0], every[:, 1], n_theta, n_phi, 1)
    plane = [float(x) for x in scene.PLANE.split()]
    o, u, v, frame = probes.frame(plane)
    middle, spacing = o + u / 2 + v / 2, float(np.linalg.norm(u)) / (GRID - 1)
    directions = d[:, 0] @ frame
    light = read(run.TOP / field)[GRID // 2, GRID // 2].reshape(-1, 3) @ probes.LUMINANCE
    phi = np.arccos(directions @ frame[2])
    true = distances(f"{s.here}/stage.oct", middle, directions)

    def one(name, family, geometry):
        key = f"{HERE}/{name.replace(' ', '_').replace(',', '')}"
        octree = s.lit(key, field, geometry, depth=geometry is not None)
        r = np.full(len(true), FAR)
        if geometry:
            run.run(f"{{ cat {s.materials}; {geometry}; }} | sed '1i void glow light 0 0 4 1 1 1 0' | oconv -f -", f"{key}_bare.oct")
            r = distances(f"{key}_bare.oct", middle, directions)
        x = miss(r, true, light, phi, spacing)
        return s.row(f"{key}_picture", octree, scene.FINE, s.photo, own, f"depth: {name}", figure="depth", row=name, x=x, reference="photograph",
                     note=family)
    run.write_rows("depth", run.several([lambda g=g: one(*g) for g in geometries(s)]))
