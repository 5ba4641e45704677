"""One Mitsuba render, in the benchmark's own virtual environment: mitsuba.py VARIANT SPP SEED OUT.npy

Runs in the folder that holds mitsuba_scene.py (and the files it makes).  Prints the CPU seconds of the second render
of two, when the compiled kernels are there already, or of the only one for scalar variants.
"""
import resource
import sys

import numpy as np

variant, spp, seed, out = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
sys.path.insert(0, ".")
import mitsuba as mi  # noqa: E402

mi.set_variant(variant)
import mitsuba_scene  # noqa: E402


def cpu():
    r = resource.getrusage(resource.RUSAGE_SELF)
    return r.ru_utime + r.ru_stime


scene = mi.load_dict(mitsuba_scene.scene_dict(mi, 2, spp))
per_pass = 64 if "llvm" in variant else spp


def render(first_seed):
    passes = max(1, spp // per_pass)
    return sum(np.array(mi.render(scene, spp=min(spp, per_pass), seed=first_seed * 1009 + k)) for k in range(passes)) / passes


if "llvm" in variant:
    render(seed + 5000)
begun = cpu()
image = render(seed)
print(cpu() - begun)
np.save(out, image.astype(np.float32))
