"""Run docs/TUTORIAL.md's commands, and make its pictures: tutorial.py --build BUILD --pictures FOLDER

Blocks of commands (```sh) run in one shell, from the top of the source tree, in the document's order; the block after a line `NAME`: is the file of that name.
The photographs and calibration pictures of the chapter on real cameras are those of tests/docs/example_inputs.py.
"""
import argparse
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

TOP = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(TOP / "scenes"), str(TOP / "tests"), *(str(f) for f in sorted((TOP / "tests").iterdir()) if f.is_dir())]
OWN = "## 5. With your own camera"


def steps(text):
    """("file", name, words) and ("sh", None, words) in the document's order, each with the place where it stands."""
    for m in re.finditer(r"(?:^`([\w./]+)`:\n\n)?^```(\w*)\n(.*?)^```$", text, re.S | re.M):
        name, language, words = m.groups()
        if name:
            yield "file", name, words, m.start()
        elif language == "sh":
            yield "sh", None, words, m.start()


def script(text):
    """All of it as one shell script; what chapter 5 needs is copied in where that begins."""
    own, lines, copied = text.index(OWN), ["set -eu"], False
    for kind, name, words, at in steps(text):
        if at > own and not copied:
            copied = True
            lines.append('rm -f IMG_* times.txt; cp "$OWN"/IMG_*.jpg "$OWN"/source_*.exr .')
        if kind == "file":
            lines.append(f"cat > {name} <<'END OF FILE'\n{words}END OF FILE")
        else:
            lines += [f"echo {chr(39)}{words.splitlines()[0]}{chr(39)} >&2", words]
    return "\n".join(lines) + "\n"


# ---- pictures ------------------------------------------------------------------------------------------------

def exr(path):
    import OpenEXR
    part = OpenEXR.File(str(path), separate_channels=True).parts[0]
    return np.stack([part.channels[c].pixels.astype(float) for c in "RGB"], -1)


def shown(light, white=None):
    """Radiance as sRGB codes; white: the radiance that is shown white (default: 98 % of the picture are darker)."""
    e = np.clip(light / (white or np.percentile(light.max(-1), 98)), 0, 1)
    return np.round(255 * np.where(e <= .0031308, 12.92 * e, 1.055 * e ** (1 / 2.4) - .055)).astype(np.uint8)


def save(path, *parts, width=900, gap=8):
    """Pictures beside each other, of one height, as a JPEG of that width."""
    height = max(p.shape[0] for p in parts)
    same = [np.asarray(Image.fromarray(p).resize((round(p.shape[1] * height / p.shape[0]), height))) for p in parts]
    row = [same[0]]
    for p in same[1:]:
        row += [np.full((height, gap, 3), 255, np.uint8), p]
    whole = Image.fromarray(np.concatenate(row, 1))
    whole.resize((width, round(whole.height * width / whole.width)), Image.LANCZOS).save(path, quality=85, optimize=True)
    size = path.stat().st_size
    print(f"  {path}: {size / 1000:.0f} kB")
    assert size <= 150_000


def tall(image, times):
    return np.repeat(np.repeat(image, times, 0), times, 1)


def draw(work, folder, first):
    import composite
    import pictures
    folder.mkdir(parents=True, exist_ok=True)
    save(folder / "exposures.jpg", *(first[f"IMG_{k}.png"] for k in (1, 2, 3, 4, 5)))
    save(folder / "probe.jpg", tall(shown(first["probe.exr"], .6), 6), width=768)
    save(folder / "mosaic.jpg", np.asarray(Image.open(work / "mosaic.png").convert("RGB")))
    photo, lit, one = (pictures.read(work / f"{n}.hdr") for n in ("photo", "lit", "one"))
    white = np.percentile(photo.max(-1), 97)
    save(folder / "pictures.jpg", *(shown(p, white) for p in (photo, lit, one)))
    plate, made = pictures.read(work / "plate.hdr"), exr(work / "composite/composite.difference.exr")
    rendered = [pictures.read(work / f"composite/{n}.big.hdr") for n in ("with_room", "without_room", "mask")]
    save(folder / "composite.jpg", *(shown(p, white) for p in (plate, made, *(composite.composite(plate, *rendered, kind) for kind in ("ratio", "none")))))
    circle = np.asarray(Image.open(work / "circle.png").convert("RGB"))
    save(folder / "own.jpg", circle, tall(shown(exr(work / "probe.exr")), 4), shown(pictures.read(work / "own.hdr")))


def main():
    a = argparse.ArgumentParser(description=__doc__)
    a.add_argument("--build", required=True, type=Path)
    a.add_argument("--pictures", required=True, type=Path)
    a = a.parse_args()
    import example_inputs
    text = (TOP / "docs" / "TUTORIAL.md").read_text()
    work = TOP / "build" / "tutorial"
    subprocess.run(["rm", "-rf", work], check=True)
    own = work.with_name("tutorial-own")
    own.mkdir(parents=True, exist_ok=True)
    example_inputs.write_series(own)
    example_inputs.write_lens(own)
    env = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    env["OWN"] = str(own)
    whole = script(text)
    # the virtual camera's pictures are drawn before those of chapter 5 take their names
    cut = whole.index("rm -f IMG_*")
    subprocess.run(["bash", "-c", whole[:cut]], cwd=TOP, env=env, check=True)
    first = {f"IMG_{k}.png": np.asarray(Image.open(work / f"IMG_{k}.png").convert("RGB")) for k in (1, 2, 3, 4, 5)}
    first["probe.exr"] = exr(work / "probe.exr")
    subprocess.run(["bash", "-c", 'set -eu; eval "$(make -s env)"; cd build/tutorial\n' + whole[cut:]], cwd=TOP, env=env, check=True)
    draw(work, a.pictures.resolve(), first)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"  the commands took {used.ru_utime + used.ru_stime:.0f} s of the CPU")


if __name__ == "__main__":
    main()
