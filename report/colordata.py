"""A light field as stock Radiance can hold it: colordata tables of four dimensions that colour a glow.

The table is the light field without depth correction (docs/FORMAT.md, section 2.3): where the ray's line crosses the plane z = 0,
clamped to the sampled rectangle, and its direction.  It has no importance sampling, is read as text at start-up, and has one column
more on each side so that the azimuth wraps.

usage: python -m report colordata -o PREFIX FILE.ilf.exr     (plane z = 0, U along x, V along y)
Writes PREFIX_r.dat, _g.dat, _b.dat, PREFIX.cal and PREFIX.rad, which defines the modifier `light`.
"""
import argparse
import os

import ilf
import numpy as np

from . import fields

CAL = """{{ the four coordinates of a light field's table }}
s = max({s0:.9g}, min({s1:.9g}, Px - Dx*Pz/Dz));
t = max({t0:.9g}, min({t1:.9g}, Py - Dy*Pz/Dz));
th = atan2(Dy, Dx);
ph = min({last:.9g}, acos(Dz));
up(r, g, b) = if(Dz - 1e-6, r, 0);
up2(r, g, b) = if(Dz - 1e-6, g, 0);
up3(r, g, b) = if(Dz - 1e-6, b, 0);
"""


def write(path, text):
    with open(path + ".part", "w") as f:
        f.write(text)
    os.replace(path + ".part", path)


def tables(path, prefix, plane):
    """plane: s0, s1, t0, t1."""
    s0, s1, t0, t1 = plane
    probes = fields.read(path).astype(float)
    n_v, n_u, n_phi, n_theta = probes.shape[:4]
    step_t, step_p = 2 * np.pi / n_theta, np.pi / 2 / n_phi
    probes = np.concatenate([probes[..., -1:, :], probes, probes[..., :1, :]], -2)
    head = (f"4\n{s0:.9g} {s1:.9g} {n_u}\n{t0:.9g} {t1:.9g} {n_v}\n{-np.pi - step_t / 2:.9g} {np.pi + step_t / 2:.9g} {n_theta + 2}\n"
            f"{step_p / 2:.9g} {np.pi / 2 - step_p / 2:.9g} {n_phi}\n")
    for c, name in enumerate("rgb"):
        a = probes[..., c].transpose(1, 0, 3, 2).reshape(-1, n_phi)
        write(f"{prefix}_{name}.dat", head + "\n".join(" ".join(f"{x:.5g}" for x in row) for row in a) + "\n")
    write(f"{prefix}.cal", CAL.format(s0=s0, s1=s1, t0=t0, t1=t1, last=np.pi / 2 - step_p / 2))
    write(f"{prefix}.rad", f"void colordata table\n11 up up2 up3 {prefix}_r.dat {prefix}_g.dat {prefix}_b.dat {prefix}.cal s t th ph\n0\n0\n\n"
                           "table glow light\n0\n0\n4 1 1 1 0\n")


def main(argv):
    ap = argparse.ArgumentParser(prog="report colordata", description="a light field as tables for stock Radiance")
    ap.add_argument("-o", "--output", required=True, metavar="PREFIX")
    ap.add_argument("file")
    a = ap.parse_args(argv)
    with ilf.open(a.file) as f:
        info = f.info
    if info.version != 1:
        raise ValueError(f"{a.file}: ilf:version: expected 1, found {info.version}")
    o, u, v = info.origin, info.U, info.V
    if o[2] or u[1] or u[2] or v[0] or v[2]:
        raise ValueError(f"{a.file}: expected the plane z = 0 with U along x and V along y, found {o} {u} {v}")
    tables(a.file, a.output, (o[0], o[0] + u[0], o[1], o[1] + v[1]))
    return 0
