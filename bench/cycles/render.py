"""One render of the bench's scene by Blender's Cycles, in a Python of its own that has bpy: render.py CONFIG.json OUT.exr

CONFIG: field (path), tools (folder of ilf_blender.py), room ((x0, y0, z0), (x1, y1, z1)), boxes ([lower, upper, albedo]), eye, look (a point), angle (radians), size
(pixels), samples, guiding (bool), bounces, seed.  Prints the CPU seconds of the render alone, all threads: shaders are compiled and the field's first texels
read by a render of one sample before.
"""
import json
import resource
import sys

import bpy
from mathutils import Vector

with open(sys.argv[1]) as f:
    c = json.load(f)
sys.path.insert(0, c["tools"])
import ilf_blender  # noqa: E402


def box(name, low, high, material):
    bpy.ops.mesh.primitive_cube_add(size=1, location=[(a + b) / 2 for a, b in zip(low, high)])
    it = bpy.context.object
    it.name, it.scale = name, [b - a for a, b in zip(low, high)]
    it.data.materials.append(material)
    return it


def matt(albedo):
    m = bpy.data.materials.new("matt")
    m.use_nodes = True
    tree = m.node_tree
    tree.nodes.clear()
    diffuse, out = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (albedo, albedo, albedo, 1)
    tree.links.new(diffuse.outputs[0], out.inputs["Surface"])
    return m


def camera(scene):
    lens = bpy.data.cameras.new("camera")
    lens.angle = c["angle"]
    it = bpy.data.objects.new("camera", lens)
    scene.collection.objects.link(it)
    it.location = c["eye"]
    it.rotation_euler = (Vector(c["look"]) - Vector(c["eye"])).to_track_quat("-Z", "Y").to_euler()
    scene.camera = it


def settings(scene):
    r, y = scene.render, scene.cycles
    r.resolution_x = r.resolution_y = c["size"]
    r.threads_mode, r.threads = "FIXED", 1
    r.image_settings.file_format, r.image_settings.color_depth = "OPEN_EXR", "32"
    scene.view_settings.view_transform = "Raw"
    y.use_denoising, y.use_adaptive_sampling, y.sample_clamp_indirect = False, False, 0
    y.pixel_filter_type, y.filter_width = "BOX", 1
    y.max_bounces = y.diffuse_bounces = c["bounces"]
    y.use_guiding = y.use_surface_guiding = c["guiding"]
    y.caustics_reflective = y.caustics_refractive = True
    y.seed = c["seed"]
    scene.world = bpy.data.worlds.new("dark")


def render(scene, samples, path):
    scene.cycles.samples = samples
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)


def cpu():
    r = resource.getrusage(resource.RUSAGE_SELF)
    return r.ru_utime + r.ru_stime


bpy.ops.wm.read_factory_settings(use_empty=True)
stage = bpy.context.scene
box("room", *c["room"], ilf_blender.material(c["field"]))
for k, (low, high, albedo) in enumerate(c["boxes"]):
    box(f"box_{k}", low, high, matt(albedo))
camera(stage)
settings(stage)
render(stage, 1, sys.argv[2])
begun = cpu()
render(stage, c["samples"], sys.argv[2])
print("cpu_s", cpu() - begun)
