"""`make bench-fishremap`: fishremap beside OpenCV's remap, hugin's nona and ffmpeg's v360 on the same pictures: error, energy, CPU time.

Source: 1024 x 1024 equidistant fisheye of 185 degrees, area-sampled; target: a probe (docs/FORMAT.md, section 1.2).  Errors are
relative RMSE to exact solid-angle means.  CPU is one thread.  "apply": for OpenCV its remap with tables prebuilt, for
fishremap the same (slopes and weights' use, weights prebuilt), for v360 a further frame, for nona what grows with the number of rows.
A peer has the same array before it nine times, fishremap nine pictures that were
just loaded.  OpenCV's 3 x 3 points a texel see a twenty-second of the pixels at 64 x 64; fishremap reads all, so the time to read them is given.
"all": with tables or weights made once and thrown away; for nona and v360 the whole process, reading and writing included.
"""
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
import fishremap_peers  # noqa: E402
import fishremap_util as U  # noqa: E402

BIN = Path(os.environ.get("ILF_BUILD", "build")).resolve() / "bin" / "fishremap"
HALF = np.radians(92.5)
SIZES = [(64, 64, 90), (400, 400, 90), (1024, 512, 180)]


def ours(folder, picture, w, h, polar_max):
    """Pixels, and CPU milliseconds: apply alone (mean over repeats that share a plan), and everything once."""
    source, names = folder / "source.exr", []
    U.write_exr(source, picture)
    for k in range(9):
        names.append(folder / f"in{k}.exr")
        if not names[-1].exists():
            os.link(source, names[-1])
    args = [BIN, "--threads", "1", "--lens", "equidistant", "--fov", "185", "--size", f"{w}x{h}", "--polar-max", str(polar_max), "--report", folder / "r.json"]
    subprocess.run([*args, "-o", folder / "%.out.exr", *names], check=True)
    many = json.loads((folder / "r.json").read_text())["cpu_s"]
    subprocess.run([*args, "-o", folder / "one.exr", names[0]], check=True)
    one = json.loads((folder / "r.json").read_text())["cpu_s"]
    for n in [source, *names]:
        n.unlink()
    image = U.read_exr(folder / "one.exr")[0][..., :3]
    assert np.allclose(image, U.read_exr(folder / "in0.out.exr")[0][..., :3], rtol=1e-5)
    return image, 1e3 * (many["prepare"] + many["remap"]) / 9, 1e3 * (one["prepare"] + one["remap"])


def energy_error(image, truth, w, h, polar_max):
    return (image[..., 1] * U.probe_solid_angle(w, h, polar_max)[:, None]).sum() / truth - 1


def main():
    folder = Path(tempfile.mkdtemp())
    scenes = {"lobes": U.lobes(), "checker": U.checker}
    lamps = {f"{d} deg lamp": (U.lamp(33.3, 61.7, d), d) for d in (2, .2)}
    pictures = {k: U.fisheye(f, 1024, 185, samples=3).astype(np.float32) for k, f in scenes.items()}
    for k, (f, d) in lamps.items():
        pictures[k] = np.zeros((1024, 1024, 3), np.float32)
        c = np.array([512 - 61.7 / 92.5 * 512 * np.cos(np.radians(33.3)), 512 - 61.7 / 92.5 * 512 * np.sin(np.radians(33.3))]).astype(int)
        box = (c[0] - 20, c[1] - 20, c[0] + 20, c[1] + 20)
        pictures[k][box[1]:box[3], box[0]:box[2]] = U.disc(f, 1024, 1024, 512, 512, 512, lambda r: r * HALF, samples=40, window=box)
    peers, missing = fishremap_peers.peers()
    for line in missing:
        print(line)
    print(f"{'':22}{'size':>10}{'lobes':>10}{'checker':>10}{'2 deg':>10}{'0.2 deg':>10}{'apply ms':>10}{'all ms':>10}{'ns/px':>8}")
    for w, h, polar_max in SIZES:
        rows = U.probe_angles(w, h, polar_max)[1] < 91
        exact = {k: U.probe(f, w, h, polar_max, 24 if w == 64 else 8) for k, f in scenes.items()}
        result = {}
        for name, peer, only in [("fishremap", ours, None), *peers]:
            if only not in (None, (w, h)):
                continue
            cells, cpu = [], []
            for k, image in pictures.items():
                got, apply, everything = peer(folder, image, w, h, polar_max)
                cpu.append((apply, everything))
                cells.append(U.rel_rmse(got, exact[k], rows) if k in exact else
                             energy_error(got, 1000 * 2 * np.pi * (1 - np.cos(np.radians(lamps[k][1] / 2))), w, h, polar_max))
            apply, everything = np.median(cpu, 0)
            result[name] = cells[1]
            print(f"{name:22}{f'{w}x{h}':>10}{cells[0]:10.2e}{cells[1]:10.4f}{cells[2]:+10.2%}{cells[3]:+10.2%}{apply:10.1f}{everything:10.1f}{1e6 * apply / (w * h):8.0f}")
        if peers:
            best = min((k for k in result if k != "fishremap"), key=result.get)
            print(f"{'reading all pixels once':62}{'':20}{fishremap_peers.reading_ms(pictures['lobes']):10.1f}")
            print(f"{'':42}{result['fishremap'] / result[best] - 1:+10.0%} against the best peer here, {best}")


if __name__ == "__main__":
    main()
