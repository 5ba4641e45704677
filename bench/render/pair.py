"""What -di costs in another build of the renderers, against this one: bench/render/pair.py OTHER_BUILD [judged|box|single|paper ...]

The same picture by each build's rpict in turn, PAIRS times, so that a machine that is busy with other things is busy for both.  Printed for each
scene: CPU seconds (median), the other's divided by this one's (median of the pairs, and their quartiles), and by how much the mean
pictures differ beside their own noise.  The other build's octrees are its own: an octree names what wrote it.
"""
import sys
from pathlib import Path

import numpy as np

import bench
from bench import EXACT, MANY, PEER_VIEW, field, objects_mask, oconv, paper_field, peer_folder, peer_scene, place, rpict, rs

PAIRS = 9
ONCE = ["-ab", "1", *EXACT, *MANY, "-di", "16", "-ad", "64"]


def judged():
    folder = place("judged")
    file = field(folder, "room.ilf.exr", rs.judged_room, 30, 30, 128, 64)
    return folder, oconv(folder, rs.judged_objects() + rs.far_dome(file), "pair"), (96, 96), ONCE, rs.VIEW


def box():
    folder = place("judged")
    file = field(folder, "room.ilf.exr", rs.judged_room, 30, 30, 128, 64)
    return folder, oconv(folder, rs.judged_objects() + rs.true_box(file), "pairbox"), (96, 96), ONCE, rs.VIEW


def single():
    folder = peer_folder()
    if folder is None:
        raise SystemExit("single: skipped: ../shared/peers/mitsuba_scene.py is not there (set ILF_SHARED)")
    return folder, peer_scene(folder), (256, 256), ["-ab", "1", "-lr", "1", *EXACT, "-di", "8", "-ad", "32"], PEER_VIEW


def paper():
    folder = paper_field()
    octree = oconv(folder, rs.judged_objects() + rs.far_dome("room.ilf.exr"), "pair")
    return folder, octree, (160, 120), ONCE, rs.VIEW


SCENES = {"judged": judged, "box": box, "single": single, "paper": paper}


def compare(name, other):
    folder, octree, size, options, view = SCENES[name]()
    theirs = f"other_{octree}"
    (folder / theirs).write_bytes(bench.output(other / "bin" / "oconv", octree.replace(".oct", ".rad"), cwd=folder))
    mask = objects_mask(folder, octree, size, view)
    cpu, mean = {}, {}
    runs = {"this": ("rpict", octree), "other": (str(other / "bin" / "rpict"), theirs)}
    for k in range(PAIRS):
        for who in (("this", "other") if k % 2 else ("other", "this")):
            program, oct_ = runs[who]
            r = rpict(folder, oct_, size, options, "x", view, program)
            cpu.setdefault(who, []).append(r["cpu_s"])
            mean.setdefault(who, []).append(r["image"][mask].mean())
    ratio = np.array(cpu["other"]) / np.array(cpu["this"])
    low, middle, high = np.percentile(ratio, (25, 50, 75))
    light = np.mean(mean["other"]) / np.mean(mean["this"])
    noise = np.hypot(*(np.std(mean[w], ddof=1) / np.mean(mean[w]) / np.sqrt(PAIRS) for w in runs))
    print(f"{name:8s} this {np.median(cpu['this']):.3f} s, other {np.median(cpu['other']):.3f} s: other/this {middle:.3f} ({low:.3f} to {high:.3f}); "
          f"light {light:.4f} +- {noise:.4f}", flush=True)


def main():
    if len(sys.argv) < 2 or not (Path(sys.argv[1]) / "bin" / "rpict").is_file():
        raise SystemExit("pair: expected the folder of another build (with bin/rpict)" + (f", found {sys.argv[1]}" if len(sys.argv) > 1 else ""))
    unknown = [s for s in sys.argv[2:] if s not in SCENES]
    if unknown:
        raise SystemExit(f"pair: {unknown[0]}: expected one of {' '.join(SCENES)}")
    bench.os.environ["PATH"] = bench.environment()["PATH"]
    bench.OUT.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[2:] or SCENES:
        compare(name, Path(sys.argv[1]).resolve())


if __name__ == "__main__":
    main()
