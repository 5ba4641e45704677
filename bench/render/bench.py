"""Error against CPU seconds of rendering with a light field: make bench-render

Sections (all, or those named on the command line): judged lamps cache box smooth plain colordata single mitsuba paper lookup.
Rows go to build/bench/render.csv (a section run again replaces its rows), the plot to build/bench/render.png.

CPU seconds are user + system of the renderer's process.  RMSE is over lit pixels that show an object (no lamp or lamp's
mirror image: below 20 times the median), in luminance, relative to their mean.  The reference is the mean of
-di's long runs or of the literal method's, whichever has less noise; that both agree within their noise is printed.  The
literal method's seconds for an error beyond its longest run come from RMSE^2 x rays = constant, fitted to its runs.
"""
import csv
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))
from conftest import BUILD, SHARED, TOP, environment  # noqa: E402
from ilf_util import PI, ILF, unit, write_ilf  # noqa: E402
import render_scene as rs  # noqa: E402

OUT = TOP / "build" / "bench"
STOCK = BUILD / "test" / "stock" / "bin" / "rpict"
FIELDS = "section method options cpu_s wall_s peak_mb rmse bias max_over_rmse seconds_literal ratio command".split()
EXACT = "-as 0 -lw 1e-9 -aa 0".split()
# sixteen scattered rays where a surface is glossy, in both methods: one alone sets a floor of 4 % to the error of either
MANY = "-ss 16".split()
ROWS = []


# ---- running ---------------------------------------------------------------------------------------------------------

# A child inherits its parent's peak memory across fork, so a small interpreter stands between.
MEASURE = """
import os, sys
_, status, use = os.wait4(os.posix_spawnp(sys.argv[2], sys.argv[2:], os.environ), 0)
with open(sys.argv[1], "w") as f:
    print(use.ru_utime + use.ru_stime, use.ru_maxrss / 1024, os.waitstatus_to_exitcode(status), file=f)
"""


def timed(args, cwd, out):
    """CPU seconds, wall seconds, peak MB of a process; its output goes to the file `out`."""
    begun = time.time()
    with open(out, "wb") as f, open(cwd / "stderr", "wb") as e:
        subprocess.run([sys.executable, "-ISc", MEASURE, str(cwd / "measured"), *map(str, args)], cwd=cwd, stdout=f, stderr=e,
                       stdin=subprocess.DEVNULL, env=environment())
    cpu, peak, code = (cwd / "measured").read_text().split()
    if code != "0":
        raise SystemExit(f"{' '.join(map(str, args))}: exit {code}\n" + (cwd / "stderr").read_text()[-2000:])
    return float(cpu), time.time() - begun, float(peak)


def output(*args, cwd):
    return subprocess.run(list(map(str, args)), cwd=cwd, env=environment(), stdout=subprocess.PIPE, check=True).stdout


def oconv(folder, text, name):
    (folder / f"{name}.rad").write_text(text)
    (folder / f"{name}.oct").write_bytes(output("oconv", f"{name}.rad", cwd=folder))
    return f"{name}.oct"


def luminance(folder, picture):
    head, data = output("pvalue", "-h", "-df", "-b", picture, cwd=folder).split(b"\n", 1)
    _, h, _, w = head.split()
    return np.frombuffer(data, "<f4").reshape(int(h), int(w)).astype(float)


def rpict(folder, octree, size, options, name, view=rs.VIEW, program="rpict"):
    w, h = size
    args = [program, *view, "-x", w, "-y", h, "-pa", "0", "-pj", "0", "-ps", "1", "-u+", *options, octree]
    cpu, wall, peak = timed(args, folder, folder / f"{name}.hdr")
    return dict(cpu_s=cpu, wall_s=wall, peak_mb=peak, image=luminance(folder, f"{name}.hdr"),
                command=" ".join(map(str, [program, *args[1:]])))


def objects_mask(folder, octree, size, view=rs.VIEW):
    """Pixels whose centre shows something else than the light field."""
    rays = output("vwrays", "-ff", "-pa", "0", "-x", size[0], "-y", size[1], *view, cwd=folder)
    p = subprocess.run(["rtrace", "-h", "-ffa", "-om", "-ab", "0", "-di", "0", "-u-", octree], cwd=folder, env=environment(), input=rays,
                       stdout=subprocess.PIPE, check=True)
    names = p.stdout.decode().split()
    return np.array([n not in ("env", "*", "sky", "up", "low", "tab_glow") for n in names]).reshape(size[1], size[0])


def errors(image, ref, mask):
    d = (image - ref)[mask]
    mean = ref[mask].mean()
    rms = np.sqrt((d ** 2).mean())
    return dict(rmse=rms / mean, bias=d.mean() / mean, max_over_rmse=np.abs(d).max() / rms if rms else 0)


def row(section, method, options, r, **more):
    ROWS.append(dict(section=section, method=method, options=" ".join(map(str, options)), **{k: v for k, v in r.items() if k != "image"}, **more))
    x = ROWS[-1]
    print(f"{section:9s} {method:9s} {x['options'][-46:]:46s} {x.get('cpu_s', 0):8.2f} s  RMSE {x.get('rmse', 0):.4f}  bias {x.get('bias', 0):+.4f}"
          f"  max/RMSE {x.get('max_over_rmse', 0):5.1f}" + (f"  literal {x['seconds_literal']:8.1f} s  x{x['ratio']:.0f}" if "ratio" in x else ""), flush=True)


def save():
    old = []
    if (OUT / "render.csv").is_file():
        done = {r["section"] for r in ROWS}
        old = [r for r in csv.DictReader(open(OUT / "render.csv")) if r["section"] not in done]
    with open(OUT / "render.csv", "w", newline="") as f:
        w = csv.DictWriter(f, FIELDS, extrasaction="ignore")
        w.writeheader()
        w.writerows(old + [{k: f"{v:.5g}" if isinstance(v, float) else v for k, v in r.items()} for r in ROWS])


# ---- the judged scene --------------------------------------------------------------------------------------------------

def place(name):
    folder = OUT / name
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "blob.rtm").is_file():
        (folder / "blob.obj").write_text(rs.obj_text(*rs.lumpy_ball()))
        output("obj2mesh", "blob.obj", "blob.rtm", cwd=folder)
    return folder


def field(folder, name, room, *size):
    if not (folder / name).is_file():
        print(f"making {name}: {size[0]}x{size[1]} probes of {size[2]}x{size[3]}", flush=True)
        write_ilf(folder / name, room().light_field(*size, dtype=np.float32), half=True)
    return name


class Literal:
    """The literal method's runs: error and time against its number of rays."""

    def __init__(self):
        self.runs = []

    def add(self, divisions, cpu, rmse):
        self.runs.append((divisions, cpu, rmse))

    def seconds(self, rmse):
        n, t, e = np.array(self.runs, float).T
        noise = np.exp(np.mean(np.log(e ** 2 * n)))
        rate = (t[-1] - t[0]) / (n[-1] - n[0])
        return t[0] + rate * (noise / rmse ** 2 - n[0])


def agreement(lit, aim, mask, size=8):
    """Two sets of pictures by 8 x 8 blocks against their own noise (pixels' variances, two or more pictures of each)."""
    h, w = (k // size * size for k in mask.shape)

    def blocks(x):
        return np.where(mask, x, 0)[:h, :w].reshape(h // size, size, w // size, size).sum((1, 3))
    full = blocks(np.ones(mask.shape)) > size * size // 2
    a, b = np.mean(lit, 0), np.mean(aim, 0)
    var = blocks(np.var(lit, 0, ddof=1) / len(lit) + np.var(aim, 0, ddof=1) / len(aim))[full]
    z = blocks(b - a)[full] / np.sqrt(var)
    total = np.sqrt((np.var(lit, 0, ddof=1) / len(lit) + np.var(aim, 0, ddof=1) / len(aim))[mask].sum()) / a[mask].sum()
    return (f"{full.sum()} blocks, chi-square {(z ** 2).sum():.0f}, beyond 3 sigma {(np.abs(z) > 3).sum()}, "
            f"mean ratio {b[mask].mean() / a[mask].mean():.5f} +- {total:.5f}")


def sweep(section, folder, octree, size, base, literal, aimed, long_literal, long_aimed):
    """Literal and aimed runs against a reference by both; base: options of all runs."""
    mask = objects_mask(folder, octree, size)
    lit = [rpict(folder, octree, size, [*base, *long_literal, "-di", "0"], "ref_lit") for _ in range(2)]
    aim = [rpict(folder, octree, size, [*base, *long_aimed], "ref_aim") for _ in range(4)]
    a, b = (np.mean([r["image"] for r in s], 0) for s in (lit, aim))
    mask &= (b > 0) & (b < 20 * np.median(b[mask]))
    own = [np.sqrt(np.var([r["image"] for r in x], 0, ddof=1)[mask].mean() / len(x)) / b[mask].mean() for x in (lit, aim)]
    print(f"{section}: references: literal {sum(r['cpu_s'] for r in lit):.0f} s (own error {own[0]:.4f}), aimed {sum(r['cpu_s'] for r in aim):.0f} s "
          f"(own error {own[1]:.4f}); {agreement([r['image'] for r in lit], [r['image'] for r in aim], mask)}", flush=True)
    ref = a if own[0] < own[1] else b       # they agree; the surer one is taken
    fit = Literal()
    for options in literal:
        r = rpict(folder, octree, size, [*base, *options, "-di", "0"], "x")
        e = errors(r["image"], ref, mask)
        fit.add(int(options[options.index("-ad") + 1]), r["cpu_s"], e["rmse"])
        row(section, "literal", [*base, *options], r, **e)
    for options in aimed:
        r = rpict(folder, octree, size, [*base, *options], "x")
        e = errors(r["image"], ref, mask)
        t = fit.seconds(e["rmse"])
        row(section, "-di", [*base, *options], r, **e, seconds_literal=t, ratio=t / r["cpu_s"])
    save()
    return fit


def di_ad(*pairs):
    return [f"-di {n} -ad {a}".split() for n, a in pairs]


def judged(box=False, room=rs.judged_room, section="judged", size=(96, 96)):
    folder = place("judged")
    file = field(folder, "room.ilf.exr" if room is rs.judged_room else "smooth.ilf.exr", room, 30, 30, 128, 64)
    octree = oconv(folder, rs.judged_objects() + (rs.true_box(file) if box else rs.far_dome(file)), section)
    most = 4096 if box else 10000
    smooth = room is rs.smooth_room
    sweep(section, folder, octree, size, ["-ab", "1", *EXACT, *MANY], [["-ad", n] for n in ((64, 256, 1024) if smooth else (64, 256, 1024, most))],
          di_ad((16, 64), (16, 256), (16, 1024)) if smooth else
          di_ad((1, 16), (2, 16), (4, 16), (8, 16), (16, 16), (8, 64), (16, 64), (32, 64), (64, 64), (64, 256), (256, 256)),
          ["-ad", 2048 if smooth else most], ["-di", 256, "-ad", 1024])


def cache():
    """-ab 2: the literal method without the cache against -di with it."""
    folder = place("judged")
    file = field(folder, "room.ilf.exr", rs.judged_room, 30, 30, 128, 64)
    octree = oconv(folder, rs.judged_objects() + rs.far_dome(file), "cache")
    quick = "-aa .15 -ar 64 -as 64 -ad".split()
    sweep("cache", folder, octree, (96, 96), ["-ab", "2", *EXACT, *MANY], [["-ad", n] for n in (64, 256, 1024)],
          [[*quick, "128", "-di", n] for n in (4, 16, 64)] + [[*quick, "512", "-di", n] for n in (16, 64, 256)] + di_ad((16, 64), (64, 256)),
          ["-ad", 2048], ["-di", 128, "-ad", 512])


def lit_field(folder, file):
    """The field with its lamps taken out, and how long that took."""
    lit = file.replace(".ilf.exr", ".lamps.ilf.exr")
    if not (folder / lit).is_file():
        cpu, _, peak = timed(["ilflamps", "--quiet", "--report", "lamps.json", "-o", lit, file], folder, folder / "ilflamps.txt")
        print(f"ilflamps {file}: {cpu:.0f} s, {peak:.0f} MB")
    print("".join(f"  {k['shape']}, {k['fate']}, {k.get('model')}\n" for k in json.loads((folder / "lamps.json").read_text())["lamps"]), end="")
    return lit


def noise_against_time(section, folder, file, method, options):
    """(seconds, RMSE) of pictures in a light field against the mean of its own long runs."""
    octree = oconv(folder, rs.judged_objects() + rs.far_dome(file), f"{section}_{method.replace(' ', '')}")
    base, mask = ["-ab", "1", *EXACT, *MANY], objects_mask(folder, octree, (96, 96))
    ref = np.mean([rpict(folder, octree, (96, 96), [*base, "-di", "256", "-ad", "1024"], "ref")["image"] for _ in range(4)], 0)
    mask &= (ref > 0) & (ref < 20 * np.median(ref[mask]))
    out = []
    for o in options:
        r = rpict(folder, octree, (96, 96), [*base, *o], "x")
        e = errors(r["image"], ref, mask)
        row(section, method, [*base, *o], r, **e)
        out.append((r["cpu_s"], e["rmse"]))
    return out, ref, mask


def lamps():
    """The judged scene's light field as captured, and with its lamps taken out: each against itself, so that noise is compared with noise."""
    folder = place("judged")
    file = field(folder, "room.ilf.exr", rs.judged_room, 30, 30, 128, 64)
    options = di_ad((1, 16), (2, 16), (4, 16), (8, 16), (16, 16), (8, 64), (16, 64), (32, 64), (64, 64), (64, 256))
    one, a, mask = noise_against_time("lamps", folder, file, "version 1", options)
    two, b, _ = noise_against_time("lamps", folder, lit_field(folder, file), "version 2", options)
    print(f"lamps: the two converge to pictures {errors(b, a, mask)['rmse']:.4f} apart, mean ratio {b[mask].mean() / a[mask].mean():.4f}")
    t, e = np.log(np.array(sorted(one), float)).T
    for seconds, rmse in two:
        print(f"lamps: {100 * rmse:.2f} % in {seconds:.2f} s; version 1 needs {np.exp(np.interp(-np.log(rmse), -e, t)):.2f} s"
              + (" or more" if rmse < np.exp(e.min()) else ""))
    save()


# ---- other light -----------------------------------------------------------------------------------------------------

def plain():
    """No light field in the scene: the same picture and time as unpatched Radiance."""
    folder = place("judged")
    lamp = "\nvoid light bulb 0 0 3 300 200 100\n" + rs.sphere("bulb", "lamp", (1.2, 0.5, 2.6), 0.05)
    # no glossy ball: Radiance seeds rough specular sampling with a pointer, so that its pictures depend on malloc()
    octree = oconv(folder, rs.judged_objects(balls=False) + rs.MIRROR_BALL + lamp, "plain")
    options = "-ab 2 -ad 256 -as 64 -u-".split()
    times = {"rpict": [], str(STOCK): []}
    bodies = {}
    for _ in range(5):
        for program in times:
            r = rpict(folder, octree, (256, 256), options, "plain", program=program)
            times[program].append(r["cpu_s"])
            bodies[program] = (folder / "plain.hdr").read_bytes().split(b"\n\n", 1)[1]
    same = len(set(bodies.values())) == 1
    best = [min(t) for t in times.values()]
    print(f"plain: patched {best[0]:.2f} s, unpatched {best[1]:.2f} s (least of 5), pictures {'bit-identical' if same else 'DIFFERENT'}")
    for name, t in zip(("patched", "stock"), best):
        row("plain", name, options, dict(cpu_s=t), rmse=0.0 if same else float("nan"))
    save()


CAL = """{ the four coordinates of a light field's table: where the ray crosses the plane z = 0, and its direction }
s = Px - Dx*Pz/Dz;
t = Py - Dy*Pz/Dz;
th = atan2(Dy, Dx);
ph = acos(Dz);
same(x) = if(Dz - 1e-6, x, 0);
same3(r, g, b) = same(r);
"""


def colordata():
    """Stock Radiance's own way: a table of four dimensions as the pattern of a glow; blind rays."""
    folder = place("colordata")
    n = (12, 12, 64, 32)
    file = field(folder, "room.ilf.exr", rs.judged_room, *n)
    f = rs.judged_room().light_field(*n)
    step_t, step_p = 2 * PI / n[2], PI / 2 / n[3]
    probes = np.concatenate([f.probes[..., -1:, :], f.probes, f.probes[..., :1, :]], -2)     # theta wraps
    begun = time.time()
    for c, name in enumerate("rgb"):
        a = probes[..., c].transpose(1, 0, 3, 2)         # s, t, theta, phi
        head = f"4\n-0.75 0.75 {n[0]}\n-0.75 0.75 {n[1]}\n{-PI - step_t / 2:.9g} {PI + step_t / 2:.9g} {n[2] + 2}\n{step_p / 2:.9g} {PI / 2 - step_p / 2:.9g} {n[3]}\n"
        with open(folder / f"{name}.dat", "w") as out:
            out.write(head)
            np.savetxt(out, a.reshape(-1, n[3]), "%.5g")
    (folder / "field.cal").write_text(CAL)
    print(f"colordata: tables of {probes[..., 0].size * 3} values written in {time.time() - begun:.0f} s")
    glow = ("\nvoid colordata tab 11 same3 same3 same3 r.dat g.dat b.dat field.cal s t th ph 0 0\n"
            "\ntab glow tab_glow 0 0 4 1 1 1 0\n" + rs.sphere("tab_glow", "dome", (0, 0, 0), 12, "bubble"))
    ours = oconv(folder, rs.judged_objects() + rs.far_dome(file), "ours")
    theirs = oconv(folder, rs.judged_objects() + glow.replace("same3 same3 same3", "same same same"), "theirs")
    size, base = (64, 64), ["-ab", "1", *EXACT]
    mask = objects_mask(folder, ours, size)
    ref = np.mean([rpict(folder, ours, size, [*base, "-di", 256, "-ad", 1024], "ref")["image"] for _ in range(2)], 0)
    mask &= (ref > 0) & (ref < 20 * np.median(ref[mask]))
    fit = Literal()
    for ad in (64, 256, 1024, 4096):
        r = rpict(folder, theirs, size, [*base, "-ad", ad], "x", program=str(STOCK))
        e = errors(r["image"], ref, mask)
        fit.add(ad, r["cpu_s"], e["rmse"])
        row("colordata", "colordata", [*base, "-ad", ad], r, **e)
    start = rpict(folder, theirs, size, ["-ab", "0"], "x", program=str(STOCK))
    row("colordata", "load only", ["-ab", "0"], start)
    for ad in (64, 1024):
        r = rpict(folder, ours, size, [*base, "-di", 0, "-ad", ad], "x")
        row("colordata", "literal", [*base, "-di", 0, "-ad", ad], r, **errors(r["image"], ref, mask))
    for options in di_ad((4, 16), (16, 64), (64, 64)):
        r = rpict(folder, ours, size, [*base, *options], "x")
        e = errors(r["image"], ref, mask)
        t = fit.seconds(e["rmse"])
        row("colordata", "-di", [*base, *options], r, **e, seconds_literal=t, ratio=t / r["cpu_s"])
    save()


# ---- one environment map: the peers' scene ---------------------------------------------------------------------------------

def mitsuba_python():
    """The benchmark's own environment with Mitsuba in it, or a reason why not."""
    venv = OUT / "venv"
    if not (venv / "bin" / "python").is_file():
        subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
    python = venv / "bin" / "python"
    if subprocess.run([str(python), "-c", "import mitsuba"], capture_output=True).returncode != 0:
        if subprocess.run([str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check", "numpy", "OpenEXR", "mitsuba"]).returncode != 0:
            return None, "Mitsuba cannot be installed"
    if subprocess.run([str(python), "-c", "import OpenEXR"], capture_output=True).returncode != 0:
        subprocess.run([str(python), "-m", "pip", "install", "-q", "--disable-pip-version-check", "OpenEXR"])
    return python, ""


def peer_folder():
    source = SHARED / "peers" / "mitsuba_scene.py"
    if not source.is_file():
        return None
    folder = OUT / "mitsuba"
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(source, folder / "mitsuba_scene.py")
    os.chmod(folder / "mitsuba_scene.py", 0o644)
    return folder


def rotated_box(mod, name, centre, degrees, half):
    w = np.deg2rad(degrees)
    turn = np.array([[np.cos(w), 0, np.sin(w)], [0, 1, 0], [-np.sin(w), 0, np.cos(w)]])
    c = np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * half @ turn.T + centre
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return "".join(rs.polygon(mod, f"{name}{k}", *c[list(f)]) for k, f in enumerate(faces))


def peer_scene(folder):
    """The peers' scene for Radiance: its environment map as two light fields of one probe, for above and below."""
    sys.path.insert(0, str(folder))
    import mitsuba_scene as m
    m.ensure()
    env = np.load(folder / "env.npy").astype(float)
    n_phi, n = env.shape[0] // 2, env.shape[1]
    x = np.arange(n)
    up, low = env[:n_phi][:, (n // 2 - x - 1) % n], env[::-1][:n_phi][:, (x - n // 2) % n]
    for name, texels, V in (("up", up, (-1, 0, 0)), ("low", low, (1, 0, 0))):
        f = ILF(texels[None, None], (0, 0, 0), (0, 0, -1), V)
        write_ilf(folder / f"{name}.ilf.exr", f, half=True)
    vertices, faces = m.blob_mesh()
    vertices = vertices.astype(float)
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, faces[:, k], np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]))
    normals = unit(normals)
    text = "".join(f"v {a:.7g} {b:.7g} {c:.7g}\n" for a, b, c in vertices + (-0.15, 0, 0.7)) + "".join(f"vn {a:.6f} {b:.6f} {c:.6f}\n" for a, b, c in normals)
    (folder / "blob.obj").write_text(text + "".join(f"f {a}//{a} {b}//{b} {c}//{c}\n" for a, b, c in faces + 1))
    output("obj2mesh", "blob.obj", "blob.rtm", cwd=folder)
    scene = "".join(f"void plastic {name} 0 0 5 {c} 0 0\n" for name, c in (
        ("grey", ".5 .5 .5"), ("red", ".7 .25 .2"), ("green", ".25 .6 .3"), ("clay", ".75 .7 .65")))
    scene += "void metal chrome 0 0 5 1 1 1 1 0\n"
    scene += rs.polygon("grey", "ground", (-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3))
    scene += rotated_box("red", "box1_", (-1.5, 0.5, -0.6), 25, (0.4, 0.5, 0.4)) + rotated_box("green", "box2_", (0.3, 0.8, -1.5), -15, (0.45, 0.8, 0.35))
    scene += rs.sphere("chrome", "mirror_ball", (1.4, 0.6, 0.3), 0.6) + "\nclay mesh blob 1 blob.rtm 0 0\n"
    scene += "\nvoid ilf up 2 up.ilf.exr nodepth 0 0\nup source upper 0 0 4 0 1 0 180\nvoid ilf low 2 low.ilf.exr nodepth 0 0\nlow source lower 0 0 4 0 -1 0 180\n"
    return oconv(folder, scene, "peer")


PEER_VIEW = "-vtv -vp 0 2.6 6.5 -vd 0 -2.15 -6.5 -vu 0 1 0 -vh 38 -vv 38".split()


def diffuse_mask(folder, octree, size, shrink=2):
    rays = output("vwrays", "-ff", "-pa", "0", "-x", size, "-y", size, *PEER_VIEW, cwd=folder)
    p = subprocess.run(["rtrace", "-h", "-ffa", "-om", "-ab", "0", "-di", "0", "-u-", octree], cwd=folder, env=environment(), input=rays,
                       stdout=subprocess.PIPE, check=True)
    names = np.array(p.stdout.decode().split()).reshape(size, size)
    mask = np.ones((size, size), bool)
    for dy in range(-shrink, shrink + 1):
        for dx in range(-shrink, shrink + 1):
            mask &= np.roll(names, (dy, dx), (0, 1)) == names
    return mask & np.isin(names, ["grey", "red", "green", "clay"])


def pair_error(a, b, mask):
    """Relative RMSE of independent, unbiased pictures from their difference (no reference needed)."""
    m = (a[mask].mean() + b[mask].mean()) / 2
    return np.sqrt(((a - b)[mask] ** 2).mean() / 2) / m


def single():
    """The peers' scene by us; what Mitsuba needs for the same error comes from section mitsuba."""
    folder = peer_folder()
    if folder is None:
        print("single: skipped: ../shared/peers/mitsuba_scene.py is not there (set ILF_SHARED)")
        return
    if not (folder / "peer.oct").is_file():
        peer_scene(folder)
    octree, size = "peer.oct", 512
    mask = diffuse_mask(folder, octree, size)
    direct = ["-ab", "1", "-lr", "1"]       # direct light only, as the peer's depth 2: no lamps by way of the mirror
    ref = rpict(folder, octree, (size, size), [*direct, *EXACT, "-di", "16", "-ad", "512"], "ref", PEER_VIEW)["image"]
    np.save(folder / "ours.npy", ref)
    runs = [["-di", n, "-ad", a] for n, a in ((1, 2), (1, 4), (2, 8), (4, 16), (8, 32), (16, 32), (32, 64), (64, 128))]
    runs += [["-di", n, "-aa", aa, "-ad", a, "-as", "0", "-ar", "128"] for n, aa, a in ((1, ".2", 256), (2, ".1", 512), (8, ".1", 1024))]
    for options in runs:
        cached = "-aa" in options
        base = [*direct, *EXACT] if not cached else [*direct, "-lw", "1e-9"]
        r = rpict(folder, octree, (size, size), [*base, *options], "x", PEER_VIEW)
        again = rpict(folder, octree, (size, size), [*base, *options], "y", PEER_VIEW)
        e = errors(r["image"], ref, mask)
        pair = pair_error(r["image"], again["image"], mask)
        if not cached:
            e["rmse"] = pair        # unbiased: as Mitsuba's is measured
        r["cpu_s"] = (r["cpu_s"] + again["cpu_s"]) / 2
        row("single", "-di cache" if cached else "-di", [*base, *options], r, **e)
    save()


def mitsuba():
    """Mitsuba 3 on its own scene, errors from pairs of pictures, then the comparison at equal error."""
    folder = peer_folder()
    python, why = mitsuba_python() if folder else (None, "../shared/peers/mitsuba_scene.py is not there (set ILF_SHARED)")
    llvm = sorted(Path("/usr/lib/x86_64-linux-gnu").glob("libLLVM-1[7-9].so*")) + sorted(Path("/usr/lib/x86_64-linux-gnu").glob("libLLVM-2*.so*"))
    if python is None:
        print(f"mitsuba: skipped: {why}")
        return
    env = environment(**({"DRJIT_LIBLLVM_PATH": str(llvm[0])} if llvm else {}))
    if not (folder / "peer.oct").is_file():
        peer_scene(folder)
    mask = diffuse_mask(folder, "peer.oct", 512)
    for variant, counts in (("llvm_ad_rgb", (16, 64, 256)), ("scalar_rgb", (16, 64))):
        if variant.startswith("llvm") and not llvm:
            print("mitsuba: llvm_ad_rgb skipped: libLLVM 17 or later not found (apt-get install libllvm19)")
            continue
        for spp in counts:
            images, cpu = [], []
            for seed in (1, 2):
                p = subprocess.run([str(python), str(TOP / "bench" / "render" / "mitsuba.py"), variant, str(spp), str(seed), "m.npy"], cwd=folder, env=env,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE)
                if p.returncode:
                    print(f"mitsuba: {variant} skipped: {p.stderr.decode()[-300:]}")
                    return
                images.append(np.load(folder / "m.npy").astype(float) @ rs.LUMINANCE)
                cpu.append(float(p.stdout.split()[-1]))
            row("mitsuba", variant, ["spp", spp], dict(cpu_s=sum(cpu) / 2), rmse=pair_error(*images, mask))
            if (folder / "ours.npy").is_file():
                ours = np.load(folder / "ours.npy")
                m = np.mean(images, 0)
                print(f"          mean of its diffuse pixels / ours: {m[mask].mean() / ours[mask].mean():.4f}, correlation {np.corrcoef(m[mask], ours[mask])[0, 1]:.4f}")
    save()
    equal_error()


def equal_error():
    rows = list(csv.DictReader(open(OUT / "render.csv")))
    ours = [(float(r["rmse"]), float(r["cpu_s"]), r["options"]) for r in rows if r["section"] == "single"]
    for variant in ("llvm_ad_rgb", "scalar_rgb"):
        theirs = [(float(r["rmse"]), float(r["cpu_s"])) for r in rows if r["section"] == "mitsuba" and r["method"] == variant]
        if not ours or not theirs:
            continue
        # plain Monte Carlo: seconds x error^2 is constant; of the longest run, where fixed costs matter least
        e, t = min(theirs)
        for target in (0.09, 0.045, 0.02):
            good = [x for x in ours if x[0] <= target]
            need = t * (e / target) ** 2
            measured = [b for a, b in theirs if abs(a / target - 1) < 0.05]
            if measured:
                need = measured[0]
            if good:
                mine = min(good, key=lambda x: x[1])
                print(f"single: error {100 * target:g} %: {variant} {need:.2f} s, ours {mine[1]:.2f} s (error {100 * mine[0]:.2f} %, {mine[2]}): x{need / mine[1]:.2f}")


# ---- the paper's own size ---------------------------------------------------------------------------------------------------

def paper_field():
    folder = place("paper")
    field(folder, "room.ilf.exr", rs.judged_room, 30, 30, 400, 400)
    return folder


def paper():
    """30x30x400x400, 640x480: CPU seconds and peak memory at RMSE <= 3 %."""
    folder = paper_field()
    octree = oconv(folder, rs.judged_objects() + rs.far_dome("room.ilf.exr"), "paper")
    mask = objects_mask(folder, octree, (640, 480))
    touched = (folder / "room.ilf.exr").stat().st_size / 1e6
    for options in (*di_ad((16, 32), (32, 32), (32, 64)), "-aa .1 -ar 128 -as 64 -ad 512 -di 16".split()):
        base = ["-ab", "1", *(EXACT if "-aa" not in options else ["-lw", "1e-9"]), *MANY, "-t", "1000"]
        r = rpict(folder, octree, (640, 480), [*base, *options], "a")
        words = (folder / "stderr").read_text().splitlines()[-2:]
        s = rpict(folder, octree, (640, 480), [*base, *options], "b")
        lit = mask & (r["image"] > 0) & (r["image"] < 20 * np.median(r["image"][mask]))
        r["cpu_s"] = (r["cpu_s"] + s["cpu_s"]) / 2
        a, b = r["image"], s["image"]
        row("paper", "-di", [*base, *options], r, rmse=pair_error(a, b, lit), max_over_rmse=np.abs(a - b)[lit].max() / np.sqrt(((a - b)[lit] ** 2).mean()))
        print(f"          peak {max(r['peak_mb'], s['peak_mb']):.0f} MB of {touched:.0f} MB x 1.25 + 100; {' | '.join(words)}")
    save()


LOOKUPS = {"planar": ("room.ilf.exr", None), "interleaved": ("interleaved.ilf.exr", ["--interleave"]), "compressed": ("zip.ilf.exr", ["-c", "zip"])}


def lookup():
    """One lookup in the paper-size field by the order of its texels; the same light in all.  Three runs of each, one after the
    other in turn: the least counts, for the machine's other work slows memory down."""
    folder, rounds, found = paper_field(), 3, {}
    for name, (file, options) in LOOKUPS.items():
        if options and not (folder / file).is_file():
            print(f"making {file}", flush=True)
            subprocess.run([str(BUILD / "test" / "ilfcopy"), "room.ilf.exr", "new.exr", *options], cwd=folder, check=True)
            (folder / "new.exr").rename(folder / file)
    for _ in range(rounds):
        for name, (file, _) in LOOKUPS.items():
            p = subprocess.run([str(BUILD / "test" / "ilfspeed"), file], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True)
            for line in p.stdout.decode().splitlines():
                mode, kind, ns = line.split()
                found[name, mode, kind] = min(found.get((name, mode, kind), np.inf), float(ns))
    kinds = ("random", "point", "coherent")
    print(f"lookup    {'ns':12s}" + "".join(f"{mode + ' ' + kind:>18s}" for mode in ("nodepth", "depth") for kind in kinds))
    for name, (file, _) in LOOKUPS.items():
        print(f"lookup    {name:12s}" + "".join(f"{found[name, mode, kind]:18.1f}" for mode in ("nodepth", "depth") for kind in kinds), flush=True)
    for (name, mode, kind), ns in found.items():
        ROWS.append(dict(section="lookup", method=name, options=f"{mode} {kind}", cpu_s=ns * 1e-9, command=f"build/test/ilfspeed build/bench/paper/{LOOKUPS[name][0]}"))
    save()


# ---- the plot -----------------------------------------------------------------------------------------------------------------

def plot():
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    rows = [r for r in csv.DictReader(open(OUT / "render.csv")) if r["rmse"] and r["cpu_s"]]
    panels = [("judged", "two 2-degree lamps, one bounce"), ("cache", "the same, -ab 2"), ("box", "depth-corrected box"), ("smooth", "smooth light"),
              ("colordata", "stock colordata table (12x12x64x32)"), ("single", "one environment map, diffuse pixels")]
    fig, axes = plt.subplots(2, 3, figsize=(15, 9), constrained_layout=True)
    for ax, (section, title) in zip(axes.flat, panels):
        names = [section] + (["mitsuba"] if section == "single" else [])
        found = [r for r in rows if r["section"] in names]
        for method in dict.fromkeys(r["method"] for r in found):
            p = sorted((float(r["cpu_s"]), float(r["rmse"])) for r in found if r["method"] == method and float(r["rmse"]) > 0)
            if p:
                ax.loglog(*zip(*p), "o-" if method not in ("-di", "-di cache") else "s--", label=method, markersize=4)
        ax.set(title=title, xlabel="CPU seconds", ylabel="relative RMSE")
        ax.grid(True, which="both", alpha=0.3)
        if found:
            ax.legend(fontsize=8)
    fig.savefig(OUT / "render.png", dpi=90)


SECTIONS = {"judged": judged, "cache": cache, "box": lambda: judged(True, section="box"), "smooth": lambda: judged(room=rs.smooth_room, section="smooth"), "lamps": lamps,
            "plain": plain, "colordata": colordata, "single": single, "mitsuba": mitsuba, "paper": paper, "lookup": lookup}


def main():
    wanted = sys.argv[1:] or list(SECTIONS)
    unknown = [s for s in wanted if s not in SECTIONS]
    if unknown:
        raise SystemExit(f"bench/render: {unknown[0]}: expected one of {' '.join(SECTIONS)}")
    os.environ["PATH"] = environment()["PATH"]
    OUT.mkdir(parents=True, exist_ok=True)
    for s in wanted:
        SECTIONS[s]()
    plot()
    print(json.dumps({"csv": str(OUT / "render.csv"), "plot": str(OUT / "render.png")}))


if __name__ == "__main__":
    main()
