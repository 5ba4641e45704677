"""The error budget of the whole chain: each stage's own error, switched on one at a time.

The ideal is a light field of 5 x 5 probes, each texel traced by rays at the true place, float, no camera.  A stage's own error is the
difference of two pictures that differ in that stage alone, drawn with the very same blind rays: importance samples would follow the
light field, and their noise would hide what is looked for:

    merge          exposures of 8 bits with photon and read noise, merged, beside the camera's radiance as it is
    remap          the camera's radiance through fishremap, beside probes by rays
    falloff        remapped with the falloff that falloffcal measured, beside the lens's true one (noise-free, 16 bits)
    position       probes by rays 1 mm off (standard deviation along u and v), beside those at the nodes
    half           half texels beside float
    directions     probes of 96 x 48 beside 192 x 96
    interpolation  5 x 5 probes beside 13 x 13
    sampling       everyday rendering options beside long ones
    the rest       13 x 13 ideal probes beside the photograph: the way of interpolating, and what a light field cannot hold

Then all of them at once beside the photograph.
"""
import os

from . import run, scene
from .run import OUT, PYTHON

HERE = f"{OUT}/budget"
N, MASTER, SIZE = 5, 13, (96, 48)
CAMERA = "--lens equidistant --fov 185"
PIXELS = "--size 128 --supersample 2 --refine 8"
NOISY = "--bits 8 --response srgb --full-scale 1 --electrons 20000 --read-noise 8"
CLEAN = "--bits 16 --response linear --full-scale 1 --no-noise"
TIMES, TIMES_CLEAN = "1/1024 1/128 1/16 1/2 4 32", "1/1024 1/32 1 32"
TRUE = "scenes/demo/lens_falloff.txt"
MEASURED = f"{HERE}/falloff/measured.txt"
QUIET = f"{scene.EXACT} -di 0 -ad 4096"
LONG = f"{scene.EXACT} -di 256 -ad 1024"
EVERYDAY = "-ab 1 -aa .12 -as 64 -ar 64 -di 16 -ad 256"
JITTER = 0.001


def places(jitter):
    """What tells the camera its place, for each node in ilfpack's order: [(name, words)]."""
    from .probes import places as nodes
    if not jitter:
        return [(f"{j:02d}_{i:02d}", f"--grid {N}x{N} --node {i},{j}") for j in range(N) for i in range(N)]
    plane = [float(x) for x in scene.PLANE.split()]
    q = nodes(plane, N, N, jitter) - plane[:3]
    return [(f"{j:02d}_{i:02d}", f"--at {q[j, i, 0]:.6f},{q[j, i, 1]:.6f}") for j in range(N) for i in range(N)]


def loop(jitter, body):
    """Shell text: `body` for every node, with $n its name and $p its place (words for the camera)."""
    lines = "\n".join(f"{n} {p}" for n, p in places(jitter))
    return f"while read n p; do {body}; done <<'NODES'\n{lines}\nNODES\n"


class Chain:
    """Shell texts of the chain's steps, in a folder of their own."""

    def __init__(self, s, name, jitter=0):
        self.s, self.folder, self.jitter = s, f"{HERE}/{name}", jitter
        self.cache = f"{HERE}/seen{'_off' if jitter else ''}"     # what the camera sees, rendered once for all exposures
        self.amb = f"{self.cache}.amb"

    def camera(self, more):
        return (f"virtualcamera --quiet --octree {self.s.here}/stage.oct --plane '{scene.PLANE}' $p {CAMERA} {PIXELS} {more} --cache {self.cache} "
                f"--render-options '{scene.ROOM_LIGHT} -af {self.amb}'")

    def begun(self):
        """The folder, with the indirect light that the probes by rays start from, too."""
        return f"mkdir -p {self.folder} {self.cache}; [ -e {self.amb} ] || cp {self.s.here}/stage.amb {self.amb}; "

    def radiance(self):
        """The camera's radiance as it is."""
        return self.begun() + loop(self.jitter, f"{self.camera('')} -o {self.folder}/$n.exr </dev/null")

    def exposures(self, more, times, response):
        """A series of exposures at each node, merged."""
        series = (f"d={self.folder}/$n; mkdir -p $d; k=0; for t in {times}; do {self.camera(more + ' --seconds $t')} -o $d/e$k.png </dev/null; "
                  f"echo e$k.png $t; k=$((k + 1)); done > $d/times.txt; "
                  f"hdrgen --quiet --threads 1 --response {response} --times $d/times.txt -o {self.folder}/$n.exr $d/e?.png </dev/null")
        return self.begun() + loop(self.jitter, series)

    def remap(self, falloff="", name=None, kind="float"):
        """Probes and the light field NAME.ilf.exr."""
        name = name or self.folder
        words = f" --falloff {falloff}" if falloff else ""
        return (f"mkdir -p {name}_probes; fishremap --quiet --threads 1 {CAMERA} --size {SIZE[0]}x{SIZE[1]} --polar-max 90{words} -o {name}_probes/p_%.exr "
                f"{self.folder}/??_??.exr && {scene.packed(name + '_probes', N, name + '.ilf.exr', '--type ' + kind)}")


def calibration():
    """The lens's falloff, measured as the paper does: a disc of constant radiance at twenty-one angles."""
    here = f"{HERE}/falloff"
    return (f"mkdir -p {here}; for a in $(seq 0 4.5 90); do "
            f"{{ printf 'void glow lamp\\n0\\n0\\n4 .8 .8 .8 0\\n'; echo 'lamp ring disc 0 0 8 0 0 1 0 0 -1 0 .035' | xform -ry $a; }} | oconv - > {here}/$a.oct; "
            f"virtualcamera --quiet --octree {here}/$a.oct --plane '-.5 -.5 0  1 0 0  0 1 0' --grid 1x1 --node 0,0 --seconds 1 {CAMERA} --size 512 "
            f"{NOISY} --falloff {TRUE} --render-options '-ab 0' -o {here}/$a.png; done; "
            f"falloffcal --quiet {CAMERA} -o {MEASURED} $(for a in $(seq 0 4.5 90); do echo {here}/$a.png@$a; done)")


def light_fields(s):
    """{name: (file, text that makes it)}.  Two at a time; what one needs of another (the camera's cache, the measured curve) is made before."""
    master = s.field(MASTER, SIZE)
    found = {}

    def made(key, name, text, label, before=""):
        """A light field NAME.ilf.exr by its text; `before` makes what it needs and is part of the row's command only."""
        run.run(text, f"{name}.log", f"budget: {label}")
        found[key] = (f"{name}.ilf.exr", f"{before}{text}")

    def coarse(key, every):
        n, name = (MASTER - 1) // every + 1, f"{HERE}/{key}"
        made(key, name, f"{PYTHON} -m report coarser --every {every} -o {name} {master} && {scene.packed(name, n, f'{name}.ilf.exr')}", key)

    def rays(key, size, options, label):
        made(key, f"{HERE}/{key}", s.field_text(N, size, f"{HERE}/{key}", options), label)
    camera, merged, clean, whole = Chain(s, "camera"), Chain(s, "merged"), Chain(s, "clean"), Chain(s, "whole", JITTER)
    curve = calibration()
    run.run(curve, f"{HERE}/falloff.log", "budget: falloff, measured at 21 angles")
    coarse("ideal", (MASTER - 1) // (N - 1))
    coarse("fine_grid", 1)
    made("half", f"{HERE}/half", scene.packed(f"{HERE}/ideal", N, f"{HERE}/half.ilf.exr", "--type half"), "half texels")
    run.several([
        lambda: made("whole", whole.folder, f"{whole.exposures(f'{NOISY} --falloff {TRUE}', TIMES, 'srgb')}{whole.remap(MEASURED, kind='half')}",
                     "the whole chain", f"{curve}; "),
        lambda: made("remap", camera.folder, camera.radiance() + camera.remap(), "camera's radiance, remapped"),
        lambda: rays("fine_directions", (192, 96), "", "probes of 192x96"),
        lambda: rays("position", SIZE, f"--jitter {JITTER} --seed 1", "probes 1 mm off")])
    series = clean.exposures(f"{CLEAN} --falloff {TRUE}", TIMES_CLEAN, "linear")
    run.several([
        lambda: made("merge", merged.folder, merged.exposures(NOISY, TIMES, "srgb") + merged.remap(), "six noisy exposures, merged, remapped"),
        lambda: made("true_falloff", f"{HERE}/clean_true", series + clean.remap(TRUE, f"{HERE}/clean_true"), "clean exposures, the lens's true falloff")])
    made("falloff", f"{HERE}/clean_measured", clean.remap(MEASURED, f"{HERE}/clean_measured"), "the measured falloff", f"{curve}; {series}")
    made("no_falloff", f"{HERE}/clean_none", clean.remap("", f"{HERE}/clean_none"), "no correction of the falloff", series)
    return found


# stage, light field, the one it differs from, what is switched on
STAGES = (("merge", "merge", "remap", "6 exposures, 8 bits, photon and read noise, hdrgen"),
          ("remap", "remap", "ideal", "fisheye of 128 pixels through fishremap to 96x48"),
          ("falloff", "falloff", "true_falloff", "falloff as measured by falloffcal"),
          ("falloff not corrected", "no_falloff", "true_falloff", "what leaving the calibration out would cost"),
          ("position, 1 mm", "position", "ideal", "probes 1 mm off along u and v"),
          ("half texels", "half", "ideal", "half in place of float"),
          ("directions", "ideal", "fine_directions", "96x48 directions beside 192x96"),
          ("interpolation", "ideal", "fine_grid", "5x5 probes, 19 cm apart, beside 13x13"))


def main(argv=()):
    s = scene.studio()
    own = s.prepare()
    f = light_fields(s)
    octree = {k: s.lit(f"{HERE}/{os.path.basename(file)[:-8]}_lit", file) for k, (file, _) in f.items()}
    run.several([lambda k=k: run.run(f"rpict {s.view} {QUIET} {octree[k]}", f"{HERE}/quiet_{k}.hdr", f"budget: picture {k}") for k in octree])

    def stage(name, a, b, words):
        return s.row(f"{HERE}/quiet_{a}", octree[a], QUIET, f"{HERE}/quiet_{b}.hdr", "", None, f[a][1], figure="budget", row=name, x="",
                     reference=f"picture from light field {b}", note=words)
    rows = [stage(*x) for x in STAGES]
    reference, halves = scene.both(f"{HERE}/long", f"rpict {s.view} {LONG} -u+ {octree['ideal']}", "budget: long rendering")
    rows.append(s.row(f"{HERE}/everyday", octree["ideal"], EVERYDAY, reference, s.split(halves), "budget: everyday rendering", f["ideal"][1], figure="budget",
                      row="sampling", x="", reference="mean of two long renderings", note=EVERYDAY))
    whole = "-ab 2 " + EVERYDAY.removeprefix("-ab 1 ")
    for name, k, options, figure, words in (("the rest", "fine_grid", scene.FINE, "budget", "13x13 ideal probes, fine rendering, beside the photograph"),
                                            ("ideal 5x5", "ideal", scene.FINE, "whole chain", "ideal probes, fine rendering"),
                                            ("whole chain", "whole", whole, "whole chain", "all stages real, everyday rendering")):
        rows.append(s.row(f"{HERE}/photo_{k}", octree[k], options, s.photo, own, f"budget: {name}", f[k][1], figure=figure, row=name, x="",
                          reference="photograph", note=words))
    run.write_rows("budget", rows)
