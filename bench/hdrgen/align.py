"""The alignment table of `make bench-hdrgen`: series that were moved by known amounts, put over each other again by each way,
merged by hdrgen, and compared with the merge of the same series before it was moved.

rms: of log2 of the ratio, after its median, over pixels well inside; light: sum of the 0.5 % of pixels that are the
brightest in the series at rest, with the same scale; CPU seconds of finding and moving (one thread; hdrgen -v says its own).
"""
import re
import subprocess
import time

import cv2
import numpy as np

REACH, TURN, BORDER = 12, .25, 48       # pixels, degrees, pixels left out all round


def motions(n, seed):
    """2x3 matrices, picture at rest to moved picture about the middle; the middle shot stays."""
    rng = np.random.default_rng(seed)
    m = np.stack([rng.uniform(-TURN, TURN, n), rng.uniform(-REACH, REACH, n), rng.uniform(-REACH, REACH, n)], -1)
    m[n // 2] = 0
    return m


def shaken(image, m):
    h, w = image.shape[:2]
    a, cx, cy = np.radians(m[0]), (w - 1) / 2, (h - 1) / 2
    c, s = np.cos(a), np.sin(a)
    matrix = np.array([[c, -s, cx - c * cx + s * cy + m[1]], [s, c, cy - s * cx - c * cy + m[2]]])
    # in light, so that lamps keep their energy; what is clipped stays so
    light = cv2.warpAffine((image.astype(np.float32) / 255) ** 2.2, matrix, (w, h), flags=cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REPLICATE)
    top = cv2.warpAffine((image == 255).astype(np.float32), matrix, (w, h), flags=cv2.INTER_LINEAR)
    codes = np.round(255 * np.clip(light, 0, 1) ** (1 / 2.2)).clip(0, 255).astype(np.uint8)
    return np.where(top > .01, 255, codes)


def apply(images, matrices):
    """What each image shows at matrix * (x, y, 1), with alpha 0 outside."""
    out = []
    for image, m in zip(images, matrices):
        h, w = image.shape[:2]
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        alpha = cv2.warpAffine(np.full((h, w), 255, np.uint8), m, (w, h), flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP)
        out.append(np.dstack([cv2.warpAffine(image, m, (w, h), flags=flags, borderMode=cv2.BORDER_REPLICATE), alpha]))
    return out


def mtb(images, times):
    """OpenCV's AlignMTB: shifts of whole pixels by median thresholds, each against the middle shot."""
    align = cv2.createAlignMTB(6, 4, True)
    grey = [cv2.cvtColor(i, cv2.COLOR_BGR2GRAY) for i in images]
    shifts = [align.calculateShift(grey[len(images) // 2], g) for g in grey]
    return [np.array([[1, 0, -s[0]], [0, 1, -s[1]]], float) for s in shifts]


def sift(images, times):
    """SIFT features of neighbours, a similarity by RANSAC (its scale dropped), chained to the middle shot."""
    finder, matcher, n = cv2.SIFT_create(), cv2.BFMatcher(), len(images)
    features = [finder.detectAndCompute(cv2.cvtColor(i, cv2.COLOR_BGR2GRAY), None) for i in images]

    def step(rest, moved):
        (ka, da), (kb, db) = features[rest], features[moved]
        if da is None or db is None or len(ka) < 8 or len(kb) < 8:
            return np.eye(3)
        pairs = [p[0] for p in matcher.knnMatch(da, db, k=2) if len(p) == 2 and p[0].distance < .75 * p[1].distance]
        if len(pairs) < 6:
            return np.eye(3)
        m, _ = cv2.estimateAffinePartial2D(np.float32([ka[p.queryIdx].pt for p in pairs]), np.float32([kb[p.trainIdx].pt for p in pairs]))
        if m is None:
            return np.eye(3)
        m[:, :2] /= np.sqrt(abs(np.linalg.det(m[:, :2])))
        return np.vstack([m, [0, 0, 1]])
    out = {n // 2: np.eye(3)}
    for k in range(n // 2 - 1, -1, -1):
        out[k] = step(k + 1, k) @ out[k + 1]
    for k in range(n // 2 + 1, n):
        out[k] = step(k - 1, k) @ out[k - 1]
    return [out[k][:2] for k in range(n)]


def figures(got, rest):
    inner = np.s_[BORDER:-BORDER, BORDER:-BORDER]
    g, r = got[inner], rest[inner]
    ok = (g > 0) & (r > 0)
    ratio = g[ok] / r[ok]
    d = np.log2(ratio) - np.median(np.log2(ratio))
    bright = r.sum(-1) >= np.quantile(r.sum(-1), .995)
    return float(np.sqrt(np.mean(d ** 2))), float(g[bright].sum() / r[bright].sum() / np.median(ratio))


def table(work, sets, hdrgen, rgb):
    """sets: name -> (files, times, extra options).  Prints the table and returns its rows."""
    print("\nseries moved by up to %d pixels and %g degrees: rms in stops, light of the brightest .5 %%, CPU s" % (REACH, TURN))
    rows = []
    for name, (files, times, extra) in sets.items():
        order = np.argsort(times)
        times = [float(times[i]) for i in order]
        images = [cv2.imread(str(files[i]))[..., :3] for i in order]
        folder = work / "align" / name
        folder.mkdir(parents=True, exist_ok=True)
        names = [f"{k:02d}.png" for k in range(len(times))]
        (folder / "times.txt").write_text("".join(f"{n} {t!r}\n" for n, t in zip(names, times)))

        def merged(pictures, *args):
            for n, p in zip(names, pictures):
                cv2.imwrite(str(folder / n), p, [cv2.IMWRITE_PNG_COMPRESSION, 1])
            p = subprocess.run([hdrgen, "-v", "--threads", "1", "-t", "times.txt", *extra, *args, "-o", "out.exr", *names], cwd=folder,
                               capture_output=True, text=True)
            if p.returncode:
                raise SystemExit(p.stderr)
            return rgb(folder / "out.exr"), float(re.search(r"aligning ([\d.]+)", p.stderr)[1])
        # one response for all, that of the series at rest: the table is of motion, not of curves
        merged(images, "--save-response", "rest.txt")
        extra = [*extra, "-r", "rest.txt"]
        rest, _ = merged(images)
        moved = [shaken(i, m) for i, m in zip(images, motions(len(images), 5))]
        line = f"{name:12}"
        for way in ("none", "hdrgen", "AlignMTB", "SIFT+RANSAC"):
            t0 = time.process_time()
            if way in ("none", "hdrgen"):
                got, seconds = merged(moved, *(["--align=auto"] if way == "hdrgen" else []))
            else:
                pictures = apply(moved, (mtb if way == "AlignMTB" else sift)(moved, times))
                seconds = time.process_time() - t0
                got, _ = merged(pictures)
            rms, light = figures(got, rest)
            rows.append(dict(name=name, way=way, rms=rms, light=light, seconds=seconds))
            line += f"  {way} {rms:.3f} {light:.3f} {seconds:.1f}s"
        print(line, flush=True)
    return rows
