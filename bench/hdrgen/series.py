"""Synthetic exposure series with known truth, and readers and writers, for the bench and the tests of hdrgen.

The camera: electrons n = e + N(0, e + read^2) with e = radiance * t * full (clipped by the scale, not
before), code = round(max * f(n / full)).
"""
import struct
import sys
import zlib
from pathlib import Path

import numpy as np
import OpenEXR

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scenes"))
import rgbe  # noqa: E402

FULL, READ = 20000.0, 8.0


# ---- responses: f maps relative exposure to relative code, both 0..1 -------------------------------

def f_linear(e):
    return np.clip(e, 0, 1)


def f_gamma(e):
    return np.clip(e, 0, 1) ** (1 / 2.2)


def f_srgb(e):
    e = np.clip(e, 0, 1)
    return np.where(e <= 0.0031308, 12.92 * e, 1.055 * e ** (1 / 2.4) - 0.055)


def f_film(e):
    """Toe and shoulder: Naka and Rushton's curve in e^0.8, scaled to reach 1 at e = 1."""
    x = np.clip(e, 0, 1) ** 0.8
    return x / (x + 0.2) * 1.2


def f_bump(e):
    """The reference series' curve: gamma 1/2.2 with a known smooth bump."""
    g = np.clip(e, 0, 1) ** (1 / 2.2)
    return g + 0.06 * np.sin(2 * np.pi * g) * (1 - g) * g * 2


CAMERAS = {"linear": f_linear, "gamma": f_gamma, "srgb": f_srgb, "film": f_film, "bump": f_bump}


def inverse(f, codes, max_code):
    """Exposure that gives each code, by a fine table."""
    e = np.concatenate([[0], np.geomspace(1e-9, 1, 400001)])
    return np.interp(np.asarray(codes) / max_code, f(e), e)


# ---- scenes and exposures ----------------------------------------------------------------------------

def scene(h, w, decades=6.0, lowest=-2.2, seed=3, colour=True):
    """Radiance, uniform in log over the decades: smooth waves plus a checker of 2:1."""
    rng = np.random.default_rng(seed)
    yy, xx = np.mgrid[0:h, 0:w] / max(h, w)
    v = np.zeros((h, w))
    for _ in range(40):
        a = rng.normal(size=2) * 2 * np.pi * rng.uniform(.5, 6)
        v += np.cos(a[0] * xx + a[1] * yy + rng.uniform(0, 6.28)) / (1 + np.linalg.norm(a) / 6)
    v += 0.3 * np.sign(np.sin(40 * xx) * np.sin(40 * yy))
    rank = np.argsort(np.argsort(v.ravel())).reshape(h, w) / (h * w - 1.0)
    grey = 10 ** (lowest + decades * rank)
    if not colour:
        return grey[..., None]
    tint = np.stack([1 + .25 * np.sin(7 * xx), np.ones_like(xx), 1 + .25 * np.cos(9 * yy)], -1)
    return grey[..., None] * tint


def expose(radiance, t, f, max_code=255, full=FULL, read=READ, rng=None, noise=True):
    e = radiance * t * full
    n = e
    if noise:
        n = e + rng.normal(size=e.shape) * np.sqrt(np.clip(e, 0, full) + read ** 2)
    return np.round(f(n / full) * max_code).clip(0, max_code).astype(np.uint16 if max_code > 255 else np.uint8)


def make_series(folder, radiance, times, f=f_gamma, max_code=255, seed=11, noise=True, **kw):
    """PNG files exp_00.png ... and times.txt; returns their names."""
    rng = np.random.default_rng(seed)
    names = []
    for k, t in enumerate(times):
        names.append(f"exp_{k:02d}.png")
        write_png(folder / names[-1], expose(radiance, t, f, max_code, rng=rng, noise=noise, **kw))
    write_times(folder, names, times)
    return names


def write_times(folder, names, times, file="times.txt"):
    (folder / file).write_text("".join(f"{n} {float(t)!r}\n" for n, t in zip(names, times)))


# ---- files ---------------------------------------------------------------------------------------------

def write_png(path, codes):
    """8- or 16-bit grey or RGB PNG, straight from the format's definition."""
    if codes.ndim == 2:
        codes = codes[..., None]
    h, w, c = codes.shape
    depth = 16 if codes.dtype == np.uint16 else 8
    rows = codes.astype(">u2" if depth == 16 else "u1").tobytes()
    stride = w * c * depth // 8
    raw = b"".join(b"\0" + rows[y * stride:(y + 1) * stride] for y in range(h))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", w, h, depth, 0 if c == 1 else 2, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(raw, 1)) + chunk(b"IEND", b""))


def write_pgm(path, codes):
    h, w = codes.shape
    wide = codes.dtype == np.uint16
    path.write_bytes(f"P5\n{w} {h}\n{65535 if wide else 255}\n".encode() + codes.astype(">u2" if wide else "u1").tobytes())


def read_exr(path):
    """Channels by name, float32, and the header."""
    with OpenEXR.File(str(path), separate_channels=True) as f:
        header = dict(f.header())
        return {name: np.array(ch.pixels) for name, ch in f.channels().items()}, header


def radiance(path):
    ch, _ = read_exr(path)
    return np.stack([ch[c] for c in ("RGB" if "R" in ch else "Y")], -1).astype(np.float64)


def read_rgbe(picture):
    """Radiance's .hdr by its path or its bytes: values, whatever the exposure, and the header."""
    codes, header = rgbe.decode(picture, "bytes") if isinstance(picture, bytes) else rgbe.read(picture)
    return rgbe.values(codes), header


def read_response(path):
    """codes, exposures[channel]."""
    rows = np.array([[float(x) for x in line.split()] for line in path.read_text().splitlines() if line[:1].isdigit()])
    return rows[:, 0], rows[:, 1:].T


# ---- figures -----------------------------------------------------------------------------------------

def log2_errors(estimate, truth):
    """log2(estimate/truth) after one global scale (the median)."""
    d = np.log2(estimate / truth)
    return d - np.median(d)


def bias_by_decade(d, truth):
    g = truth[..., truth.shape[-1] // 2]
    out = []
    for k in range(-2, 4):
        m = (g >= 10.0 ** k) & (g < 10.0 ** (k + 1))
        if m.any():
            out.append(float(np.median(d[m])))
    return out
