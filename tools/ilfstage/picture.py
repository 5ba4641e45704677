"""Wanted and reproduced light, as Radiance draws it: a ball, and a mesh, at some of the places.

Wanted: the thing in the light field itself, where the subject stands in it.  Reproduced: the thing on the stage, its lamps at the coded outputs.
Both are drawn by rpict from one view, with one exposure, and compared where the thing is.
"""
import tempfile
from pathlib import Path

import numpy as np

from . import lamps, radiance
from .outputs import whole

SIZE, MOST = 96, 4
GREY = "void plastic thing 0 0 5 .6 .6 .6 0 0\n"
VIEW = np.array([.25, -1., .35])        # from where the thing is looked at
WANTED = "-ab 1 -ad 256 -as 64 -aa .15 -ar 32 -st 0 -di 32".split()
STAGED = "-ab 0 -dt 0 -dc 1 -dj 0 -ds .05 -st 0 -di 0".split()


def ball(radius):
    return f"thing sphere ball 0 0 4 0 0 0 {radius:.9g}\n", np.zeros(3), radius


def mesh(folder, vertices, triangles):
    radiance.write_mesh(folder / "thing.obj", vertices, triangles)
    radiance.run("obj2mesh", "thing.obj", "thing.rtm", cwd=folder)
    low, high = vertices.min(0), vertices.max(0)
    return "thing mesh body 1 thing.rtm 0 0\n", (low + high) / 2, np.linalg.norm(high - low) / 2


def decoded(data):
    """(rows, columns, 3) of `pvalue -h -df` with resolution line."""
    line, _, rest = data.partition(b"\n")
    words = line.split()
    return np.frombuffer(rest, np.float32).reshape(int(words[1]), int(words[3]), 3)


def drawn(folder, octree, middle, radius, options):
    """A picture, linear RGB, at twice its size and halved."""
    d = VIEW / np.linalg.norm(VIEW)
    view = ["-vtl", "-vp", *(middle + 2 * radius * d), "-vd", *(-d), "-vu", 0, 0, 1, "-vh", 2.1 * radius, "-vv", 2.1 * radius, "-va", 4 * radius]
    big = "-x", 2 * SIZE, "-y", 2 * SIZE, "-ps", 1, "-pj", 0
    (folder / "big.hdr").write_bytes(radiance.run("rpict", "-us", 1, "-w", *view, *big, *options, octree, cwd=folder))
    (folder / "small.hdr").write_bytes(radiance.run("pfilt", "-1", "-x", "/2", "-y", "/2", "big.hdr", cwd=folder))
    return decoded(radiance.run("pvalue", "-h", "-df", "small.hdr", cwd=folder))


def wanted(folder, thing, middle, radius, place, field_path, unit, exposure):
    """The thing in the light field: the field is moved about the subject, whose axes stay."""
    frame = place.frame
    corner = (frame.origin - place.at) @ place.turn.T * unit
    edges = [e @ place.turn.T * unit for e in (frame.U, frame.V, frame.n)]
    (folder / "field.ilf.exr").unlink(missing_ok=True)
    (folder / "field.ilf.exr").symlink_to(Path(field_path).resolve())
    (folder / "wanted.rad").write_text(f"{GREY}{thing}void brightfunc brighter 2 arg(1) . 0 1 {exposure:.9g}\n"
                                       f"brighter ilf room 1 field.ilf.exr 0 12 {radiance.row(corner, *edges)}\nroom source far 0 0 4 0 0 1 360\n")
    return drawn(folder, radiance.oconv(folder, "wanted.oct", "wanted.rad"), middle, radius, WANTED)


def staged(folder, thing, middle, radius, stage, output):
    """The thing on the stage.  output: (k,) of its channels."""
    intensity, k, lights = [], 0, [light for light in stage.lights if light.fixture is not None]
    for light in stage.lights:
        n = len(light.channels)
        if light.fixture is not None:
            intensity.append(sum(c.rgb * x for c, x in zip(light.channels, output[k:k + n])))
        k += n
    lamps.write(folder, lights, intensity)
    (folder / "thing.rad").write_text(GREY + thing)
    return drawn(folder, radiance.oconv(folder, "staged.oct", "thing.rad", "lights.rad"), middle, radius, STAGED)


def mask(folder, thing, middle, radius):
    (folder / "mask.rad").write_text("void glow thing 0 0 4 1 1 1 0\n" + thing)
    return drawn(folder, radiance.oconv(folder, "mask.oct", "mask.rad"), middle, radius, ["-ab", 0])[..., 0] > .99


def error(a, b, where):
    """Root mean square of a - b, as a part of that of b."""
    return float(np.sqrt(((a - b)[where] ** 2).mean() / max((b[where] ** 2).mean(), 1e-300)))


def figure(path, rows, title):
    """rows: (name, [(seconds, wanted, reproduced, error)])."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt
    n = len(rows[0][1])
    fig, axes = plt.subplots(2 * len(rows), n, figsize=(1.75 * n + .4, 3.75 * len(rows) + .5), squeeze=False, layout="constrained")
    for r, (name, panes) in enumerate(rows):
        for c, (seconds, a, b, e) in enumerate(panes):
            white = max(np.percentile(a[a > 0], 98) if (a > 0).any() else 0, 1e-12)
            for k, (image, word) in enumerate(((a, "wanted"), (b, "reproduced"))):
                ax = axes[2 * r + k, c]
                ax.imshow(np.clip(image / white, 0, 1) ** (1 / 2.2))
                ax.set(xticks=[], yticks=[])
                if c == 0:
                    ax.set_ylabel(f"{name}, {word}", fontsize=8)
                ax.set_xlabel((f"{seconds:g} s" if n > 1 else "") if k == 0 else f"RMSE {100 * e:.3g} %", fontsize=8)
    fig.suptitle(title, fontsize=9)
    with whole(path, "wb") as f:
        fig.savefig(f, format="png", dpi=110)
    plt.close(fig)


def draw(path, stage, places, outputs, field, unit, exposure, shown=None, title=""):
    """Writes the picture; returns {thing: [error of each frame drawn]}.  outputs: (t, k); shown: (vertices, triangles), metres."""
    at = np.unique(np.linspace(0, len(places) - 1, min(MOST, len(places))).round().astype(int))
    rows, errors = [], {}
    with tempfile.TemporaryDirectory(prefix="ilfstage") as name:
        folder = Path(name)
        things = [("ball", *ball(.005))] + ([("mesh", *mesh(folder, *shown))] if shown is not None else [])
        for kind, thing, middle, radius in things:
            where, panes = mask(folder, thing, middle, radius), []
            for t in at:
                a = wanted(folder, thing, middle, radius, Seen(places[t], field.frame), field.path, unit, exposure)
                b = staged(folder, thing, middle, radius, stage, outputs[t])
                panes.append((places[t].seconds, a * where[..., None], b * where[..., None], error(b, a, where)))
            rows.append((kind, panes))
            errors[kind] = [p[3] for p in panes]
    figure(path, rows, title)
    return errors


class Seen:
    """A place, and the plane that it lies on."""

    def __init__(self, place, frame):
        self.at, self.turn, self.frame = place.at, place.turn, frame
