"""How often fishremap --centre auto is right, refuses, or is silently wrong, over photographs whose circles are known.

    python bench/circles/evaluate.py LIST.json [--build build] [--only NAME] [--quick] [--jobs 2] [--verbose] [--keep FOLDER]

LIST.json names photographs (none are kept here), relative to itself:

    [{"file": "room.jpg", "view": "ball", "circle": [2042, 2052.5, 1981], "set": "tune"},
     {"file": "street.jpg", "view": "ball", "circle": null, "set": "held"}, ...]

view: ball or fisheye.  circle: X, Y, R in pixels of the file, null where there is none (then only a refusal is right).
slack: what the stated circle may itself be off by, as a share of the radius (default 0).  Each photograph is tried at several
scales, cropped, blurred and at several JPEG qualities.  Right: the centre and the radius within 2 % of the radius (and the slack).
"""
import argparse
import json
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from PIL import Image, ImageFilter, ImageOps

TOP = Path(__file__).resolve().parents[2]


def variants(im, circle):
    """(name, picture, circle, JPEG quality or None)."""
    longest = max(im.size)

    def scaled(side):
        k = side / longest
        w, h = round(im.width * k), round(im.height * k)
        c = circle and [circle[0] * w / im.width, circle[1] * h / im.height, circle[2] * (w / im.width + h / im.height) / 2]
        return im.resize((w, h), Image.LANCZOS if k < 1 else Image.BICUBIC), c

    for side in (400, 500, 600, 700, 800, 1000, 1200, 1600, 2000):
        if side <= longest:
            yield f"{side}", *scaled(side), 92
    base, c = scaled(min(longest, 800))
    w, h = base.size
    for name, box in (("crop_l", (.06, .02, 1, .99)), ("crop_r", (0, .04, .93, 1)), ("crop_b", (.01, 0, .98, .92))):
        x0, y0, x1, y1 = (round(v * s) for v, s in zip(box, (w, h, w, h)))
        if c and (c[0] - c[2] < x0 - .3 * c[2] or c[1] - c[2] < y0 - .3 * c[2] or c[0] + c[2] > x1 + .3 * c[2] or c[1] + c[2] > y1 + .3 * c[2]):
            continue
        yield name, base.crop((x0, y0, x1, y1)), c and [c[0] - x0, c[1] - y0, c[2]], 92
    if c:   # cut to twice the ball, off the middle
        x0, y0, x1, y1 = (round(v) for v in (max(0, c[0] - 1.7 * c[2]), max(0, c[1] - 1.4 * c[2]), min(w, c[0] + 1.3 * c[2]), min(h, c[1] + 1.6 * c[2])))
        if (x1 - x0) * (y1 - y0) < .8 * w * h:
            yield "around", base.crop((x0, y0, x1, y1)), [c[0] - x0, c[1] - y0, c[2]], 92
    for sd in (1, 2):
        yield f"blur{sd}", base.filter(ImageFilter.GaussianBlur(sd)), c, 92
    for quality in (60, 75, 95):
        yield f"jpeg{quality}", base, c, quality
    soft, c2 = scaled(min(longest, 900))   # cut off the middle, softened, and coded coarsely
    w2, h2 = soft.size
    x0, y0, x1, y1 = round(.05 * w2), round(.02 * h2), w2, round(.97 * h2)
    if c2:
        x0, y0, y1 = max(0, min(x0, int(c2[0] - .9 * c2[2]))), max(0, min(y0, int(c2[1] - .9 * c2[2]))), min(h2, max(y1, int(c2[1] + .9 * c2[2] + 1)))
    yield "cut", soft.crop((x0, y0, x1, y1)).filter(ImageFilter.GaussianBlur(1.3)), c2 and [c2[0] - x0, c2[1] - y0, c2[2]], 80
    yield "mirror", ImageOps.mirror(base), c and [w - c[0], c[1], c[2]], None
    yield "dim", base.point(lambda v: v * .5), c, None


def ask(program, view, path, folder):
    report = folder / f"{path.stem}_{view}.json"
    args = ["--from", "ball"] if view == "ball" else ["--lens", "equidistant", "--fov", "180"]
    p = subprocess.run([program, *args, "--centre", "auto", "--size", "8x4", "--report", report, "-o", report.with_suffix(".exr"), path],
                       capture_output=True, text=True)
    if p.returncode == 1:
        return None, p.stderr.strip()
    if p.returncode:
        raise SystemExit(f"{path}: exit {p.returncode}: {p.stderr}")
    found = json.loads(report.read_text())
    return found, p.stderr.strip()


def main():
    a = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    a.add_argument("list")
    a.add_argument("--build", default=str(TOP / "build"))
    a.add_argument("--only", default="")
    a.add_argument("--variants", help="only these, separated by commas (600, crop_l, blur2, jpeg60, ...)")
    a.add_argument("--quick", action="store_true", help="four variants: 500, 800, 1200 pixels, and cut and softened")
    a.add_argument("--jobs", type=int, default=2)
    a.add_argument("--verbose", action="store_true")
    a.add_argument("--keep", help="where the variants are, or are put, to be used again")
    a = a.parse_args()
    if a.quick:
        a.variants = "500,800,1200,cut"
    program = str(Path(a.build) / "bin" / "fishremap")
    entries = [e for e in json.loads(Path(a.list).read_text()) if a.only in e["file"]]
    scratch = tempfile.TemporaryDirectory()
    keep = Path(a.keep or scratch.name)
    keep.mkdir(parents=True, exist_ok=True)

    def one(e):
        done = keep / (Path(e["file"]).name + ".list")
        if not done.exists():
            im = ImageOps.exif_transpose(Image.open(Path(a.list).parent / e["file"]))
            if im.mode.startswith("I"):
                im = im.point(lambda v: v / 256)
            made = []
            for name, picture, circle, quality in variants(im.convert("RGB"), e["circle"]):
                path = keep / f"{Path(e['file']).stem}_{name}.{'jpg' if quality else 'png'}"
                picture.save(path, **({"quality": quality} if quality else {"compress_level": 1}))
                made.append((name, path.name, circle))
            done.write_text(json.dumps(made))
        rows = []
        for name, file, circle in json.loads(done.read_text()):
            if a.variants and name not in a.variants.split(","):
                continue
            found, words = ask(program, e["view"], keep / file, Path(scratch.name))
            if found is None:
                verdict = "refused"
            elif circle is None:
                verdict = "wrong"
            else:
                off = max(np.hypot(found["centre"][0] - circle[0], found["centre"][1] - circle[1]), abs(found["radius"] - circle[2])) / circle[2]
                verdict = "right" if off <= .02 + e.get("slack", 0) else "wrong"
            rows.append((name, verdict, circle, found, words))
        return e, rows

    totals = {}
    with ThreadPoolExecutor(a.jobs) as pool:
        for e, rows in pool.map(one, entries):
            count = {k: sum(r[1] == k for r in rows) for k in ("right", "refused", "wrong")}
            for key in ((e["set"], "circle" if e["circle"] else "none"), ("all", "circle" if e["circle"] else "none")):
                t = totals.setdefault(key, dict(runs=0, right=0, refused=0, wrong=0))
                t["runs"] += len(rows)
                for k, v in count.items():
                    t[k] += v
            print(f"{e['set']:5} {Path(e['file']).name:28} {count['right']:3} right {count['refused']:3} refused {count['wrong']:3} wrong")
            for name, verdict, circle, found, words in rows:
                if a.verbose and (verdict != "right" and circle or verdict == "wrong"):
                    f = found and "%.1f,%.1f r %.1f %s" % (*found["centre"], found["radius"], {k: v for k, v in found.items() if k == "circle"})
                    print(f"        {name:8} {verdict:8} {circle and '%.1f,%.1f r %.1f' % tuple(circle)}  {f or words[:230]}")
            sys.stdout.flush()
    for (group, kind), t in sorted(totals.items()):
        print(f"{group:5} {'with a circle' if kind == 'circle' else 'without any'}: {t['runs']} runs, {t['right']} within 2 %, {t['refused']} refused, {t['wrong']} silently wrong")


if __name__ == "__main__":
    main()
