"""The paper's figures 10, 11, 12 as panels: photograph, light field, the same with its lamps taken out, single probe; error maps and numbers beneath.

Reads what `make figures` left in build/figures/figureNN: photo.hdr, with_room.hdr, with_room.lamps.hdr, with_single.hdr, mask.hdr and the costs beside them.
The measures are scenes/compare.py's: pictures clipped at the figure's white, all covered pixels.
"""
import io
import json
import os

import numpy as np

from . import measures, run

NAMES = [s for s in os.environ.get("REPORT_FIGURES", "figure10 figure11 figure12").split() if s]
FROM = os.environ.get("REPORT_FROM", f"{run.BUILD}/figures")
TITLES = {"figure10": "Figure 10: two spotlights into a mirror-sphere array", "figure11": "Figure 11: a yellow spotlight, a blue light half hidden",
          "figure12": "Figure 12: light through a branch", "demo": "The demo: two spotlights"}
PICTURES = {"with_room": "Incident light field", "with_room.lamps": "Its lamps taken out", "with_single": "Single probe"}
CLIPPED = "RMSE / mean, clipped at white, covered pixels"


def folder(name):
    return f"{FROM}/{name}" if name != "demo" else f"{run.BUILD}/demo"


def cost(name, picture):
    """What the picture cost, from the log beside it."""
    for end in (".json", ".big.json"):
        try:
            return json.loads((run.TOP / folder(name) / f"{picture}{end}").read_text())
        except OSError:
            continue
    return {}


def made_by(name, log, command):
    """The builds of all programs that a picture, its light field and its error came from."""
    here = run.TOP / folder(name)
    lit = run.builds.read(here / "room.lamps.ilf.programs") if "room.lamps" in command else {}
    return {**run.programs(command), **run.builds.read(here / "room.ilf.programs"), **lit, **log.get("programs", {})}


def repeat(name, picture, log):
    """The rendering again, halved as the figure is, measured."""
    here = folder(name)
    path = f"RAYPATH=$RAYPATH:scenes/{name}:scenes/studio:{here}:{run.BUILD}/models"
    return (f"{path} {log.get('command', '')} | pfilt -1 -x /2 -y /2 | "
            f"{run.PYTHON} -m report measure --clipped --reference {here}/photo.hdr --mask {here}/mask.hdr -")


def main(argv=()):
    rows = []
    for name in NAMES:
        for picture, label in PICTURES.items():
            here = run.TOP / folder(name)
            e = measures.of_files_clipped(here / f"{picture}.hdr", here / "photo.hdr", here / "mask.hdr")
            log = cost(name, picture)
            command = repeat(name, picture, log)
            rows.append(dict(figure=name, row=label, x="", y=e["rmse"], measure=CLIPPED, error=e["rmse"], ssim=e["ssim"],
                             reference="photograph: the full room", reference_error="", cpu_s=log.get("cpu_s", ""), peak_mb=log.get("peak_mb", ""),
                             note=picture, command=command, programs=made_by(name, log, command)))
    run.write_rows("figures", rows)
    for r in rows:
        print(f"    {r['figure']} {r['row']:22s} RMSE {r['error']:.4f}  SSIM {r['ssim']:.4f}")


# ---- the pictures of a panel --------------------------------------------------------------------------------------------

def png(image):
    """sRGB values 0..1, (rows, columns, 3), as PNG bytes."""
    from PIL import Image
    out = io.BytesIO()
    Image.fromarray((np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)).save(out, "PNG", optimize=True)
    return out.getvalue()


def signed(error):
    """A difference in -1..1 as colours: blue too dark, white right, red too bright."""
    import matplotlib
    return matplotlib.colormaps["RdBu_r"](np.clip(error, -1, 1) / 2 + 0.5)[..., :3]


def panel(name):
    """[(key, label, picture PNG, error map PNG or None)] of one figure."""
    c = measures.compare
    here = run.TOP / folder(name)
    read = {k: c.read_finite(here / f"{k}.hdr") for k in ("photo", *PICTURES, "mask")}
    where = c.regions_of(read["mask"])["all"]
    scale = c.exposure_of(read["photo"], where)
    white = 1 / scale
    mean = np.minimum(read["photo"], white)[where].mean()
    found = [("photo", "Photograph: the room itself", png(c.display(read["photo"], scale)), None)]
    for key, label in PICTURES.items():
        error = (np.minimum(read[key], white) - np.minimum(read["photo"], white)) @ c.LUMINANCE / mean
        found.append((key, label, png(c.display(read[key], scale)), png(signed(np.where(where, error, 0)))))
    return found
