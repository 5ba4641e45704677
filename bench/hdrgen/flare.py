"""Scenes with lamps seen through a lens that scatters by a known point spread function, and the flare table of
`make bench-hdrgen`: hdrgen --flare against the scene as it was.

left: what of the scattered light --flare leaves, sum of |with --flare - scene - noise of the merge| over the sum of
scattered light, outside of the lamps; taken: what was taken out, over the scene's light there (for scenes without
flare, where it should be nothing); lamps: their light over what it is, before and after.
"""
import re
import subprocess

import numpy as np

from series import f_gamma, f_linear, make_series, radiance

CAMERAS = {"gamma": (f_gamma, 255, ["-r", "gamma:2.2"]), "recovered": (f_gamma, 255, []),
           "linear": (f_linear, 65535, ["-r", "linear"])}


def grid(h, w):
    y, x = np.mgrid[0:h, 0:w] + .5
    return x, y


def psf(kind, h, w, part, core=0.):
    """2h x 2w values that add up to 1, the middle at [h, w]: a core (a Gaussian of `core` pixels) and a skirt."""
    y, x = np.mgrid[-h:h, -w:w]
    r = np.hypot(x, y)
    if kind.startswith("exp"):
        skirt = np.exp(-r / float(kind[3:]))
    elif kind.startswith("pow"):
        skirt = (1 + (r / 3) ** 2) ** (-float(kind[3:]) / 2)
    elif kind == "both":
        skirt = np.exp(-r / 12) / (2 * np.pi * 144)
        far = (1 + (r / 4) ** 2) ** -1.2
        skirt = skirt / skirt.sum() + far / far.sum()
    else:
        skirt = np.ones_like(r, float)
    middle = np.exp(-r ** 2 / (2 * max(core, .01) ** 2))
    return (1 - part) * middle / middle.sum() + part * skirt / skirt.sum()


def through(scene, k):
    """The scene through the lens; what lies outside the picture is dark."""
    h, w = scene.shape[:2]
    spectrum = np.fft.rfft2(np.fft.ifftshift(k))
    out = [np.fft.irfft2(np.fft.rfft2(scene[..., c], s=k.shape) * spectrum, s=k.shape)[:h, :w] for c in range(scene.shape[2])]
    return np.maximum(np.stack(out, -1), 0)


def waves(h, w, rng, decades, lowest):
    """Even in the logarithm over the decades: waves and a checker."""
    x, y = grid(h, w)
    x, y, v = x / max(h, w), y / max(h, w), 0
    for _ in range(40):
        a = rng.normal(size=2) * 2 * np.pi * rng.uniform(.5, 6)
        v = v + np.cos(a[0] * x + a[1] * y + rng.uniform(0, 6.28)) / (1 + np.linalg.norm(a) / 6)
    v = v + .3 * np.sign(np.sin(40 * x) * np.sin(40 * y))
    return 10 ** (lowest + decades * np.argsort(np.argsort(v.ravel())).reshape(h, w) / (h * w - 1))


def room(h, w, rng):
    """Boxes of reflectances from .03 to .9 in light that varies."""
    x, y = grid(h, w)
    rho = np.full((h, w), .4)
    for _ in range(80):
        bx, by, sx, sy = rng.uniform(0, w), rng.uniform(0, h), rng.uniform(4, .15 * w), rng.uniform(4, .15 * h)
        rho[(abs(x - bx) < sx) & (abs(y - by) < sy)] = np.exp(rng.uniform(np.log(.03), np.log(.9)))
    return .1 * (.5 + x / w + .5 * y / h) * rho


SCENES = {"waves": lambda h, w, rng: waves(h, w, rng, 4, -3), "murk": lambda h, w, rng: waves(h, w, rng, 2, -2), "room": room,
          "grey": lambda h, w, rng: np.full((h, w), .02), "night": lambda h, w, rng: np.full((h, w), 1e-6)}


def lit(name, h=240, w=320, seed=1, lamps=4, glow=0):
    """Scene, where its lamps are, and the image circle (all of it but for "fisheye").  glow: so many of the lamps light a wall
    around them."""
    rng = np.random.default_rng(seed)
    x, y = grid(h, w)
    scene, spots, circle = SCENES["waves" if name == "fisheye" else name](h, w, rng), np.zeros((h, w), bool), np.ones((h, w), bool)
    dark, wall = scene.copy(), np.zeros((h, w))
    for k in range(lamps):
        lx, ly, r, value = rng.uniform(.1 * w, .9 * w), rng.uniform(.1 * h, .9 * h), rng.uniform(2, 12), 3e3 * np.exp(rng.uniform(-1, 1))
        d = np.hypot(x - lx, y - ly)
        scene[d < r] = value
        spots |= d < r
        if k < glow:
            wall += 3e-3 * value * (1 + (d / 30) ** 2) ** -1.5 * dark / dark.max()
    scene[~spots] += wall[~spots]
    if name == "fisheye":
        circle = np.hypot(x - w / 2, y - h / 2) < .49 * min(w, h)
        scene[~circle] = 0
        spots &= circle
    return scene[..., None] * np.array([1.1, 1, .8]), spots, circle


def shoot(folder, seen, camera, stops=2, seed=1):
    """A series that resolves the brightest in its shortest exposure and the darkest hundredth in its longest; names, arguments."""
    f, top, args = CAMERAS[camera]
    times, darkest = [.7 / seen.max()], max(np.quantile(seen[..., 1], .02), 1e-7 * seen.max())
    while times[-1] * 2 ** stops < .5 / darkest and len(times) < 16:
        times.append(times[-1] * 2 ** stops)
    folder.mkdir(parents=True, exist_ok=True)
    return make_series(folder, seen, times, f, top, seed=seed), args


def wide(spots, by):
    """A mask and all within `by` pixels of it."""
    h, w = spots.shape
    y, x = np.mgrid[-h:h, -w:w]
    disc = (np.hypot(x, y) <= by).astype(float)
    return through(spots[..., None].astype(float), disc)[..., 0] > .5


def compare(with_flare, without, scene, seen, spots, circle):
    """left, taken, lamps before and after; the scale is the one at which the merge without --flare is what was seen."""
    around = ~wide(spots, 6) & circle
    scale = np.median((without / seen)[around], axis=0)
    before, after = without / scale, with_flare / scale
    veil = np.maximum(seen - scene, 0)[around].sum()
    noise = (before - seen)[around]
    left = np.abs((after - scene)[around] - noise).sum() / veil if veil > 1e-6 * scene.sum() else float("nan")
    taken = np.abs(after - before)[around].sum() / scene[around].sum()
    return left, taken, before[spots].sum() / scene[spots].sum(), after[spots].sum() / scene[spots].sum()


ROWS = [("waves", "exp30", .001, "gamma"), ("waves", "exp30", .01, "gamma"), ("waves", "exp30", .05, "gamma"), ("waves", "exp100", .01, "gamma"),
        ("waves", "pow2", .001, "gamma"), ("waves", "pow2", .01, "recovered"), ("waves", "pow2", .05, "linear"), ("waves", "pow3", .05, "gamma"),
        ("room", "exp30", .01, "linear"), ("room", "exp100", .05, "gamma"), ("room", "pow2", .001, "gamma"), ("room", "pow2", .01, "gamma"),
        ("room", "pow3", .05, "linear"), ("room", "both", .01, "gamma"), ("night", "pow2", .01, "gamma"), ("fisheye", "even", .01, "gamma"),
        ("fisheye", "pow2", .01, "linear"), ("waves", "even", .01, "gamma"), ("waves", "none", 0, "gamma"), ("murk", "none", 0, "gamma"),
        ("room", "none", 0, "recovered"), ("grey", "none", 0, "gamma"), ("room", "glow 1 of 1", 0, "gamma"), ("room", "glow 2 of 4", 0, "gamma"),
        ("room", "glow 4 of 4", 0, "gamma")]


def table(work, hdrgen):
    print("\nflare of a known point spread function (part of the light): left of it, taken over the scene's light, lamps' light before and after")
    rows = []
    for name, kind, part, camera in ROWS:
        lamps, glow = (int(kind[-1]), int(kind[5])) if kind.startswith("glow") else (4, 0)
        scene, spots, circle = lit(name, lamps=lamps, glow=glow)
        seen = through(scene, psf(kind, *spots.shape, part)) if part else scene
        folder = work / "flare"
        names, args = shoot(folder, seen, camera)
        if name == "fisheye":
            args = [*args, "--circle", "0.98"]
        got = []
        for more in ([], ["--flare"]):
            p = subprocess.run([hdrgen, "-v", "--threads", "1", "-t", "times.txt", *args, *more, "-o", "out.exr", *names], cwd=folder,
                               capture_output=True, text=True)
            if p.returncode:
                raise SystemExit(p.stderr)
            got.append(radiance(folder / "out.exr"))
        left, taken, before, after = compare(got[1], got[0], scene, seen, spots, circle)
        seconds = float(re.search(r"flare ([\d.]+)", p.stderr)[1])
        said = re.search(r"hdrgen: flare: (.{40})", p.stderr)[1]
        rows.append(dict(scene=name, kind=kind, part=part, camera=camera, left=left, taken=taken, before=before, after=after, seconds=seconds))
        print(f"{name:8}{kind:12}{100 * part:6.1f} %  {camera:10}  left {left:6.3f}  taken {taken:7.4f}  lamps {before:.4f} -> {after:.4f}  "
              f"{seconds:.2f} s  {said}", flush=True)
    return rows
