"""The table of `make bench-hdrgen`: hdrgen beside OpenCV on one synthetic series of known truth and on real ones.

Errors are |log2(estimate/truth)| after one global scale; CPU seconds are user+system of one thread without reading the
images (hdrgen -v says them; OpenCV's are measured around its calls).  Leave-one-out: the series is merged without exposure k,
response included, and k is predicted; |log2| between prediction and picture over its codes 10..245 where another
exposure saw the pixel (codes 5..250).
"""
import argparse
import json
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import OpenEXR

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "bench" / "hdrgen"))
import align  # noqa: E402
import flare  # noqa: E402
from series import expose, f_bump, f_srgb, make_series, scene, write_png, write_times  # noqa: E402

HDRGEN = (TOP / os.environ.get("ILF_BUILD", "build") / "bin" / "hdrgen").resolve()
cv2.setNumThreads(1)


def cpu():
    r = resource.getrusage(resource.RUSAGE_SELF)
    return r.ru_utime + r.ru_stime


def rgb(path):
    ch = OpenEXR.File(str(path), separate_channels=True).channels()
    return np.stack([np.array(ch[c].pixels) for c in "RGB"], -1).astype(np.float64)


def ours(folder, names, *args, out="out.exr"):
    p = subprocess.run([HDRGEN, "-v", "--threads", "1", *args, "-o", out, *names], cwd=folder, capture_output=True, text=True)
    if p.returncode:
        raise SystemExit(p.stderr)
    m = re.search(r"recovering ([\d.]+), merging ([\d.]+)", p.stderr)
    return rgb(Path(folder) / out), float(m[1]), float(m[2])


def opencv(images, times, kind):
    times = np.asarray(times, np.float32)
    c0 = cpu()
    cal = cv2.createCalibrateDebevec() if kind == "debevec" else cv2.createCalibrateRobertson()
    response = cal.process(images, times)
    c1 = cpu()
    merge = cv2.createMergeDebevec() if kind == "debevec" else cv2.createMergeRobertson()
    out = merge.process(images, times, response)
    return out[..., ::-1].astype(np.float64), response[:, 0, ::-1], c1 - c0, cpu() - c1


def figures(estimate, truth):
    d = np.log2(np.maximum(estimate, 1e-30) / truth)
    d -= np.median(d)
    a, g, bias = np.abs(d), truth[..., 1], []
    for k in range(-2, 4):
        m = (g >= 10.0 ** k) & (g < 10.0 ** (k + 1))
        bias.append(float(np.median(d[m])))
    return np.median(a), np.percentile(a, 99), max(bias, key=abs)


def synthetic(work):
    folder = work / "series"
    folder.mkdir(exist_ok=True)
    truth, times = scene(1024, 1024).astype(np.float32).astype(float), 2.0 ** np.arange(-14, 2)
    names = make_series(folder, truth, times, f_bump)
    print("\n16 exposures 2^-14..2 s, 1024x1024, six decades (errors in log2; photon limit 0.0079 / 0.094)")
    print(f"{'':34}{'median':>9}{'p99':>8}{'bias':>9}{'recover':>9}{'merge':>8}  CPU s")
    rows = []

    def row(name, result, recover, merge):
        med, p99, bias = figures(result, truth)
        rows.append(dict(name=name, median=med, p99=p99, bias=bias, recover=recover, merge=merge))
        print(f"{name:34}{med:9.4f}{p99:8.4f}{bias:+9.4f}{recover:9.3f}{merge:8.3f}", flush=True)
    for name, args in (("hdrgen", ["--sigma"]), ("hdrgen --weight debevec", ["-w", "debevec"]),
                       ("hdrgen --response mitsunaga", ["-r", "mitsunaga"])):
        row(name, *ours(folder, names, "-t", "times.txt", *args, out=f"{len(rows)}.exr"))
        if "--sigma" in args:
            ch = OpenEXR.File(str(folder / "0.exr"), separate_channels=True).channels()
            sigma = np.stack([np.array(ch["sigma." + c].pixels) for c in "RGB"], -1)
            got = rgb(folder / "0.exr")
            scale = np.exp(np.median(np.log(got / truth)))
            print(f"{'':34}within 1 sigma: {100 * (np.abs(got - scale * truth) < sigma).mean():.1f} %")
    images = [cv2.imread(str(folder / n)) for n in names]
    for kind in ("debevec", "robertson"):
        result, _, recover, merge = opencv(images, times, kind)
        row(f"OpenCV {cv2.__version__} {kind}", result, recover, merge)
    print("measured elsewhere on a series from the same equations, recover and merge together, other noise:")
    for name, med, p99, seconds in (("pfstools 2.2.0 robertson", 0.0357, 0.153, 2.79), ("pfstools 2.2.0 mitsunaga", 1.07, 2.10, 2.44),
                                    ("colour-hdri 0.2.6 Debevec", 0.031, 4.42, 24.5)):
        print(f"{name:34}{med:9.4f}{p99:8.4f}{'':9}{seconds:9.2f}")
    return rows


def untouched(result, rest, free):
    d = np.log2(np.maximum(result, 1e-30)[free] / np.maximum(rest, 1e-30)[free])
    d -= np.median(d)
    return float((np.abs(d) > .25).mean()), float(np.sqrt(np.mean(np.clip(d, -4, 4) ** 2)))


def moving_person(work):
    """Three shots of four times the exposure each; someone dark stands elsewhere in each, on 5 % of the picture.  Each program
    against itself without the person, where nobody ever stood."""
    truth, times, pictures, free = scene(340, 500, decades=3, lowest=-1.7, seed=9), [.05, .2, .8], {}, np.ones((340, 500), bool)
    names = ["w0.png", "w1.png", "w2.png"]
    for who in ("rest", "walk"):
        folder, rng = work / who, np.random.default_rng(4)
        folder.mkdir(exist_ok=True)
        for k, t in enumerate(times):
            now, at = truth.copy(), np.s_[120:300, 40 + 140 * k:88 + 140 * k]
            free[at] = False
            if who == "walk":
                now[at] = .04
            write_png(folder / names[k], expose(now, t, f_srgb, rng=rng))
        write_times(folder, names, times)
        pictures[who] = [cv2.imread(str(folder / n)) for n in names]
    out = {}
    for name, args in (("hdrgen", ()), ("hdrgen --deghost", ("--deghost",)), ("hdrgen --response mitsunaga", ("-r", "mitsunaga"))):
        out[name] = untouched(*(ours(work / who, names, "-t", "times.txt", *args)[0] for who in ("walk", "rest")), free)
    for kind in ("debevec", "robertson"):
        out["OpenCV " + kind] = untouched(*(opencv(pictures[who], times, kind)[0] for who in ("walk", "rest")), free)
    print("\na moving person: pixels that were never touched and are > 1/4 stop off, and their rms in stops")
    for name, (part, rms) in out.items():
        print(f"{name:34}{100 * part:8.2f} %{rms:9.4f}", flush=True)
    return out


def coloured_lamps(work):
    """Linear, clipped at 254, 8 exposures of 2 stops; lamps of saturated colours that the shortest alone resolves.  Light of the
    lamps over what it is, per colour of the lamp: green and red of a green LED, and so on, all channels summed."""
    rng, times = np.random.default_rng(2), 4.0 ** np.arange(-7, 1)
    truth = scene(240, 320, decades=3, lowest=-3, seed=2) * .75
    lamps = {"green LED": (.02, 1, .05), "red LED": (1, .03, .02), "blue LED": (.03, .08, 1), "tungsten": (1, .6, .25)}
    where = {}
    for i, (name, colour) in enumerate(lamps.items()):
        where[name] = np.s_[40:60, 40 + 70 * i:58 + 70 * i]
        truth[where[name]] = np.array(colour) * .93 / times[0]
    folder = work / "lamps"
    folder.mkdir(exist_ok=True)
    names = [f"l{k}.png" for k in range(len(times))]
    for n, t in zip(names, times):
        write_png(folder / n, np.minimum(expose(truth, t, lambda e: np.clip(e, 0, 1), rng=rng), 254))
    write_times(folder, names, times)
    images = [cv2.imread(str(folder / n)) for n in names]
    results = {"hdrgen": ours(folder, names, "-t", "times.txt", "-r", "linear")[0],
               "hdrgen, recovered": ours(folder, names, "-t", "times.txt")[0],
               "OpenCV debevec": opencv(images, times, "debevec")[0], "OpenCV robertson": opencv(images, times, "robertson")[0]}
    print("\ncoloured lamps: light over what it is, R G B")
    out = {}
    for program, got in results.items():
        bright = (truth.min(axis=-1) > .02) & (truth.max(axis=-1) < 1)
        scale = np.exp(np.median(np.log(got[bright] / truth[bright]), axis=0))
        out[program] = {n: [float(v) for v in got[at].mean(axis=(0, 1)) / scale / truth[at].mean(axis=(0, 1))] for n, at in where.items()}
        print(f"{program:24}" + "  ".join(f"{n} " + " ".join(f"{v:.3f}" for v in row) for n, row in out[program].items()), flush=True)
    return out


def leave_one_out(work, name, files, times, chosen):
    images = [cv2.imread(str(f)) for f in files]
    (work / "loo.txt").write_text("".join(f'"{f}" {t!r}\n' for f, t in zip(files, times)))
    result = {}
    for kind in ("hdrgen", "debevec", "robertson"):
        per = []
        for k in chosen:
            rest = [i for i in range(len(files)) if i != k]
            z = images[k][..., ::-1]
            seen = np.zeros(z.shape, bool)
            for i in rest:
                seen |= (images[i][..., ::-1] >= 5) & (images[i][..., ::-1] <= 250)
            if kind == "hdrgen":
                got, *_ = ours(work, [files[i] for i in rest], "-t", "loo.txt", "--save-response", "r.txt", out="loo.exr")
                table = np.array([[float(v) for v in line.split()[1:]] for line in (work / "r.txt").read_text().splitlines()
                                  if line[:1].isdigit()])
            else:
                got, table, *_ = opencv([images[i] for i in rest], [times[i] for i in rest], kind)
            for c in range(3):
                m = seen[..., c] & (z[..., c] >= 10) & (z[..., c] <= 245) & (got[..., c] > 0)
                per.append(np.abs(np.log2(got[..., c][m] * times[k] / table[z[..., c][m], c])))
        result[kind] = float(np.median(np.concatenate(per)))
    print(f"{name:36}" + "".join(f"{kind} {value:.4f}   " for kind, value in result.items()), flush=True)
    return result


def memorial(work, data):
    sys.path.insert(0, str(TOP / "bench" / "hdrgen"))
    from series import read_rgbe
    files = sorted(data.glob("memorial00*.png"))
    ref, _ = read_rgbe(data / "memorial.hdr")
    inner = np.s_[40:-40, 40:-40]
    out = {}

    def error(got):
        errors = []
        for c in range(3):
            r, g = ref[inner][..., c], got[inner][..., c]
            d = np.log2(np.maximum(g[r > 0], 1e-30) / r[r > 0])
            errors.append(np.abs(d - np.median(d)))
        return float(np.median(np.concatenate(errors)))
    got, *_ = ours(work, files, "-t", data / "exposures.txt", "--fill", "0,0,255")
    out["hdrgen"] = error(got)
    times = [float(line.split()[1]) for line in (data / "exposures.txt").read_text().splitlines() if line[:1] == "m"]
    images = [cv2.imread(str(f)) for f in files]
    for kind in ("debevec", "robertson"):
        out[kind] = error(opencv(images, times, kind)[0])
    print("memorial church, median |log2| against memorial.hdr, one scale per channel")
    print(f"{'':34}" + "".join(f"{kind} {value:.4f}   " for kind, value in out.items()), flush=True)
    return out


def real(work, shared):
    result = {}
    series = {"bracket_window_nikon_e995": (3, 9), "fisheye_bracket_office_canon5d2_8mm": (5, 12),
              "mirrorball_bracket_desk_sony": range(3)}
    if (shared / "data" / "bracket_memorial_church").is_dir():
        result["memorial"] = memorial(work, shared / "data" / "bracket_memorial_church")
    print("leave-one-out, median |log2| of the prediction")
    for name, chosen in series.items():
        data = shared / "data" / name
        if not data.is_dir():
            print(f"{name}: not found, left out")
            continue
        lines = [line.split() for line in (data / "exposures.txt").read_text().splitlines() if line.strip() and line[0] != "#"]
        lines = [x for x in lines if x[0].lower().endswith(".jpg")]
        result[name] = leave_one_out(work, name, [data / x[0] for x in lines], [float(x[1]) for x in lines], chosen)
    office = shared / "data" / "fisheye_bracket_office_canon5d2_8mm"
    if office.is_dir():
        files = sorted(office.glob("IMG_*.jpg"))
        ours(work, files, "--refine-times")
        t = np.array(OpenEXR.File(str(work / "out.exr")).header()["hdrgen:times"], float)
        print("office, --refine-times: steps in stops, longest first (labels 1.12 0.91 1.00):",
              " ".join(f"{s:.3f}" for s in np.diff(np.log2(t))[::-1][:3]))
    return result


def moved(work, shared):
    """The alignment table over the real series that are there."""
    sets = {}
    for name, folder, extra in (("memorial", "bracket_memorial_church", ["--fill", "0,0,255"]), ("window", "bracket_window_nikon_e995", []),
                                ("office", "fisheye_bracket_office_canon5d2_8mm", [])):
        data = shared / "data" / folder
        if not data.is_dir():
            print(f"{folder}: not found, left out")
            continue
        lines = [line.split() for line in (data / "exposures.txt").read_text().splitlines() if line.strip() and line[0] != "#"]
        lines = [x for x in lines if (data / x[0]).is_file()]
        sets[name] = ([data / x[0] for x in lines], [float(x[1]) for x in lines], extra)
    return align.table(work, sets, HDRGEN, rgb)


def main():
    a = argparse.ArgumentParser()
    a.add_argument("--work", type=Path, required=True)
    a.add_argument("--shared", type=Path, default=TOP / ".." / "shared")
    args = a.parse_args()
    work = args.work.resolve()
    rows = synthetic(work)
    person, lamps = moving_person(work), coloured_lamps(work)
    result = real(work, args.shared.resolve())
    motion = moved(work, args.shared.resolve())
    veil = flare.table(work, HDRGEN)
    (work / "bench.json").write_text(json.dumps(dict(synthetic=rows, person=person, lamps=lamps, real=result, moved=motion, flare=veil), indent=1, default=float))


if __name__ == "__main__":
    main()
