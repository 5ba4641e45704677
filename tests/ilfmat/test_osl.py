"""ilf.osl in Blender's Cycles: a camera's rays into walls with the shader see what ilftrace says.

Blender as a Python module is 1 GB: `make test-cycles` installs it and runs this.
"""
import json
import os

import numpy as np
import OpenEXR
import pytest
from conftest import TOP, run
from ilf_util import directional_ilf, random_ilf, rays_text, write_ilf
from process import execute

BLENDER = TOP / "build" / "bench" / "cycles" / "venv" / "bin" / "python"
ROOM = np.array([[-2., -1.5, -.4], [2.2, 1.6, 2.4]])
SIZE = 40

LOOK = """
import json, sys
c = json.load(open("c.json"))
sys.path.insert(0, c["tools"])
import bpy, ilf_blender
bpy.ops.wm.read_factory_settings(use_empty=True)
s = bpy.context.scene
how = dict(box=c["room"]) if c["hull"] != 1 else {}
if c.get("sphere"):
    how = dict(sphere=c["sphere"])
bpy.ops.mesh.primitive_cube_add(size=1, location=[(a + b) / 2 for a, b in zip(*c["room"])])
o = bpy.context.object
o.scale = [c["hull"] * (b - a) for a, b in zip(*c["room"])]
o.data.materials.append(ilf_blender.material(c["field"], depth=c["depth"], **how))
cam = bpy.data.cameras.new("c")
it = bpy.data.objects.new("c", cam)
s.collection.objects.link(it)
it.location, it.rotation_euler, cam.angle = c["eye"], c["turn"], 1.5
s.camera = it
r, y = s.render, s.cycles
r.resolution_x = r.resolution_y = c["size"]
y.samples, y.use_denoising, y.use_adaptive_sampling, y.pixel_filter_type, y.filter_width = 1, False, False, "BOX", .01
s.world = bpy.data.worlds.new("w")
s.view_settings.view_transform = "Raw"
r.image_settings.file_format, r.image_settings.color_depth, r.filepath = "OPEN_EXR", "32", "osl.exr"
bpy.ops.render.render(write_still=True)
json.dump([list(v) for v in it.matrix_world], open("camera.json", "w"))
"""


def seen(folder, field, eye, turn=(2.6, .2, .3), hull=1, depth=True, sphere=None):
    (folder / "c.json").write_text(json.dumps(dict(tools=str(TOP / "ilfmat" / "osl"), room=ROOM.tolist(), field=str(field), eye=eye, turn=turn, hull=hull,
                                                   depth=depth, size=SIZE, sphere=sphere)))
    execute([BLENDER, "-c", LOOK], cwd=folder, capture_output=True, check=True)
    image = OpenEXR.File(str(folder / "osl.exr")).channels()["RGBA"].pixels[..., :3].astype(float).reshape(-1, 3)
    M = np.array(json.loads((folder / "camera.json").read_text()))
    x = ((np.arange(SIZE) + .5) / SIZE * 2 - 1) * np.tan(.75)
    X, Y = np.meshgrid(x, -x)
    d = np.stack([X, Y, -np.ones_like(X)], -1).reshape(-1, 3) @ M[:3, :3].T
    return image, np.tile(M[:3, 3], (len(d), 1)), d / np.linalg.norm(d, axis=1)[:, None]


def walls(o, d):
    return o + np.min((np.where(d > 0, ROOM[1], ROOM[0]) - o) / d, axis=1)[:, None] * d


@pytest.mark.skipif(not os.environ.get("ILF_CYCLES"), reason="in Blender: make test-cycles runs it")
@pytest.mark.parametrize("how", ["walls", "hull", "sphere", "nodepth", "below", "one"])
def test_cycles_sees_what_ilftrace_says(tmp_path, how):
    if how in ("below", "one"):                                        # the whole sphere, rays that fall; one probe
        f = directional_ilf(lambda d: 1 + .5 * d * [1, -.4, .7], 48, 24, polar_max=np.pi, origin=(-.5, -.4, 0), U=(1, 0, 0), V=(0, .8, 0))
    else:
        f = random_ilf(np.random.default_rng(4), 3, 2, 48, 24, plane=((-.4, -.5, .1), (.8, .1, 0), (-.1, .8, 0)))
    path = write_ilf(tmp_path / "a.ilf.exr", f)
    ball = ((.1, 0, .3), 5.)
    image, o, d = seen(tmp_path, path, (.3, -.2, -.1), turn=(1.4, .2, .3) if how == "below" else (2.6, .2, .3), hull=3 if how in ("hull", "sphere") else 1,
                       depth=how != "nodepth", sphere=ball if how == "sphere" else None)
    h = walls(o, d)
    if how == "sphere":
        e = o - ball[0]
        b = (e * d).sum(1)
        h = o + (-b + np.sqrt(b * b - (e * e).sum(1) + 25))[:, None] * d
    text = run("ilftrace", *(["--nodepth"] if how == "nodepth" else []), path, stdin=rays_text(o, d, h)).text
    expected = np.array(text.split(), float).reshape(-1, 3)
    off = np.abs(image - expected).max(1) / np.abs(expected).max()
    # the camera's rays are off their pixels' middles by up to a two hundredth of a pixel
    assert np.quantile(off, .9) < 1e-3 and np.quantile(off, .99) < .01
    if how == "below":
        assert (d[:, 2] < 0).mean() > .2 and (image[d[:, 2] < -1e-3] == 0).all()
