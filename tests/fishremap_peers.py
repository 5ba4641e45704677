"""What else turns a fisheye picture into a probe (docs/FORMAT.md, section 1.2): OpenCV's remap, hugin's nona, ffmpeg's v360.

A peer is called with (folder, picture, w, h, polar_max in degrees) and gives the probe's pixels and CPU milliseconds,
of one thread: to apply (tables and start-up apart) and in all.  Pictures: 1024 x 1024 equidistant, 185 degrees.

nona and v360 make equirectangular pictures with their own idea of where the camera looks: their zenith is the camera's axis
here (turned by 90 degrees twice), and as the probe is the sphere seen from inside, they are given the picture mirrored.
"""
import os
import resource
import shutil
import time

import numpy as np
from process import execute

try:
    import cv2
    cv2.setNumThreads(1)
except ImportError:
    cv2 = None

SIZE, FOV = 1024, 185.


def tables(w, h, polar_max, n):
    """Where in the picture n x n points of each texel lie, as OpenCV counts (pixel centres at integers)."""
    y, x = np.mgrid[0:h * n, 0:w * n]
    theta, r = -np.pi + (x + .5) * 2 * np.pi / (w * n), (y + .5) * polar_max / (h * n) / (FOV / 2) * SIZE / 2
    return (SIZE / 2 - r * np.cos(theta) - .5).astype(np.float32), (SIZE / 2 - r * np.sin(theta) - .5).astype(np.float32)


def opencv(how, n):
    def peer(_, source, w, h, polar_max):
        t = time.process_time()
        mx, my = tables(w, h, polar_max, n)
        made = time.process_time() - t

        def go():
            big = cv2.remap(source, mx, my, how, borderMode=cv2.BORDER_CONSTANT)
            return big if n == 1 else cv2.resize(big, (w, h), interpolation=cv2.INTER_AREA)
        image = go()
        t = time.process_time()
        for _ in range(9):
            go()
        apply = (time.process_time() - t) / 9
        return image.astype(float), 1e3 * apply, 1e3 * (apply + made)
    return peer


def child_ms(*args):
    """CPU of a program, user and system; its output only if it fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = execute([str(a) for a in args], capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(f"{args[0]}: {done.stderr.strip() or done.stdout.strip()}")
    return 1e3 * (after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def nona(interpolator):
    """Its pixels are square: a probe of other proportions is made with whole multiples of its columns, and those averaged.
    Float in and out, but cut off at 1: the picture is scaled below that, and no response of a camera undone (ldr mode).
    apply: what the whole costs more than the same with a tenth of the rows."""
    def peer(folder, source, w, h, polar_max):
        rows, across = h * 180 / polar_max, 1
        while w * across < 2 * rows:
            across += 1
        if w * across != 2 * rows:
            raise ValueError(f"nona's square pixels don't make a probe of {w}x{h} down to {polar_max} degrees")
        wide, peak = w * across, float(source.max())
        cv2.imwrite(str(folder / "nona_in.tif"), np.ascontiguousarray(source[:, ::-1, ::-1]) / np.float32(peak))

        def go(last):
            (folder / "job.pto").write_text(
                f'p f2 w{wide} h{wide // 2} v360 S0,{wide},0,{last} E0 R0 T"FLOAT" n"TIFF c:NONE"\nm g1 i{interpolator}\n'
                f'i w{SIZE} h{SIZE} f2 v{FOV} r90 p90 y0 Ra0 Rb0 Rc0 Rd0 Re0 Eev0 Er1 Eb1 a0 b0 c0 d0 e0 g0 t0 '
                f'TrX0 TrY0 TrZ0 j0 Va1 Vb0 Vc0 Vd0 Vx0 Vy0 Vm5 n"{folder / "nona_in.tif"}"\n')
            return child_ms("nona", "-r", "ldr", "-m", "TIFF", "-p", "FLOAT", "-z", "NONE", "-o", folder / "nona_out", folder / "job.pto")
        part = go(max(h // 10, 4))
        whole = go(h)
        image = cv2.imread(str(folder / "nona_out.tif"), cv2.IMREAD_UNCHANGED)[..., 2::-1].astype(float) * peak
        return image.reshape(h, w, across, 3).mean(2), (whole - part) / .9, whole
    return peer


def ffmpeg(interpolator):
    """16-bit integers: the picture is scaled to stay clear of full white, which v360's bilinear wraps to black.  Its circle has a
    radius of (1024 - 1) / 2 pixels, so the field to name is that much smaller.  apply: the cost of further frames."""
    def peer(folder, source, w, h, polar_max):
        white = 60000 / float(source.max())
        cv2.imwrite(str(folder / "v360_in.png"), np.rint(source[:, ::-1, ::-1] * white).astype(np.uint16))
        tall = round(h * 180 / polar_max)
        field = FOV * (SIZE - 1) / SIZE

        def go(frames, *out):
            return child_ms("ffmpeg", "-nostdin", "-hide_banner", "-loglevel", "error", "-y", "-threads", "1", "-filter_threads", "1",
                            "-i", folder / "v360_in.png", "-vf",
                            f"format=gbrp16le,loop={frames - 1}:1:0,v360=fisheye:e:ih_fov={field}:iv_fov={field}:w={w}:h={tall}:"
                            f"interp={interpolator}:yaw=90:pitch=0:roll=-90,crop={w}:{h}:0:0", *out)
        whole = go(1, "-pix_fmt", "rgb48be", folder / "v360_out.png")
        few, many = (go(n, "-f", "null", "-") for n in (2, 22))
        image = cv2.imread(str(folder / "v360_out.png"), cv2.IMREAD_UNCHANGED)[..., ::-1].astype(float) / white
        # v360 makes the whole sphere: of that, only the part asked for is counted
        return image, (many - few) / 20 * h / tall, whole
    return peer


def reading_ms(source):
    """CPU to read the picture once and do no more than add its pixels up: what a remap cannot go below if every pixel counts."""
    t = time.process_time()
    for _ in range(20):
        cv2.sumElems(source)
    return 1e3 * (time.process_time() - t) / 20


def peers():
    """(name, peer, sizes or None for all), and a line for each program that is missing."""
    found, missing = [], []
    if not cv2:
        return [], ["OpenCV's Python module is not there: fishremap alone (pip install opencv-python-headless for the comparison)"]
    found += [("OpenCV " + name, opencv(how, n), only) for name, how, n, only in (
        ("bilinear", cv2.INTER_LINEAR, 1, None), ("bicubic", cv2.INTER_CUBIC, 1, None), ("Lanczos4", cv2.INTER_LANCZOS4, 1, None),
        ("3x3 bilinear", cv2.INTER_LINEAR, 3, None),
        # 3 x 3 points a texel of 64 x 64 see a thirtieth of the source's pixels; 16 x 16 see all of them, as an area mean must
        ("16x16 bilinear", cv2.INTER_LINEAR, 16, (64, 64)))]
    if shutil.which("nona"):
        found += [(f"nona {name}", nona(k), None) for name, k in (("bilinear", 5), ("spline36", 2), ("poly3", 0))]
    else:
        missing.append("hugin's nona is not there (apt-get install --no-install-recommends hugin-tools): no rows for it")
    if shutil.which("ffmpeg"):
        found += [(f"ffmpeg v360 {name}", ffmpeg(k), None) for name, k in (("bilinear", "line"), ("bicubic", "cubic"), ("Lanczos", "lanc"))]
    else:
        missing.append("ffmpeg is not there (apt-get install --no-install-recommends ffmpeg): no rows for v360")
    return found, missing
