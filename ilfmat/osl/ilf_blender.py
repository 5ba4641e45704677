"""An incident light field as a material of Blender's Cycles, by ilf.osl, which lies beside this file.

In Blender's Python console (or a script, or with the module bpy):

    import sys; sys.path.append("PREFIX/share/ilf")
    import ilf_blender
    walls.data.materials.append(ilf_blender.material("room.ilf.exr"))

The object stands where the room's walls were (any mesh; coordinates as the light field's, z up).  A rough hull will do where the walls are a box or a ball:
material(path, box=((x0, y0, z0), (x1, y1, z1))) or sphere=((x, y, z), radius).  The scene is set to Cycles on the processor with OSL.
"""
import glob
import importlib.util
import math
import os
import struct
import sys

HERE = os.path.dirname(os.path.abspath(__file__))


def header(path):
    """What ilf.osl asks of a light field's header: a dict of its parameters.  ValueError where the file is none."""
    with open(path, "rb") as f:
        data = f.read(1 << 20)
    if data[:4] != b"\x76\x2f\x31\x01":
        raise ValueError(f"{path}: expected an OpenEXR file")
    at, found = 8, {}
    while at < len(data) and data[at]:
        name_end = data.index(0, at)
        kind_end = data.index(0, name_end + 1)
        size = struct.unpack_from("<i", data, kind_end + 1)[0]
        found[data[at:name_end].decode()] = data[kind_end + 5:kind_end + 5 + size]
        at = kind_end + 5 + size
    if "ilf:version" not in found:
        raise ValueError(f"{path}: expected an incident light field, found no ilf:version")
    nt, np = struct.unpack_from("<2I", found["tiles"])
    x0, y0, x1, y1 = struct.unpack("<4i", found["dataWindow"])
    polar = struct.unpack("<f", found["ilf:polarMax"])[0]
    valid = struct.unpack("<f", found["ilf:polarValid"])[0] if "ilf:polarValid" in found else polar
    vec = lambda name: struct.unpack("<3f", found[name])                 # noqa: E731
    return {"columns": (x1 - x0 + 1) // nt, "rows": (y1 - y0 + 1) // np, "texels_around": nt, "texels_down": np,
            "origin": vec("ilf:origin"), "U": vec("ilf:U"), "V": vec("ilf:V"), "polar_max": min(polar, math.pi), "polar_valid": min(valid, polar),
            "version": struct.unpack("<i", found["ilf:version"])[0]}


def find_oslquery():
    """The module bpy of PyPI has the one that reads compiled shaders in a folder that Python is not told of."""
    import bpy
    if importlib.util.find_spec("oslquery") is None:
        sys.path += glob.glob(os.path.join(bpy.utils.resource_path("LOCAL"), "python", "lib", "python*", "site-packages"))


def material(path, *, box=None, sphere=None, depth=True, strength=1.0, name=None):
    """A material that shows the light field; the scene is set to what it needs.  Returns bpy's material."""
    import bpy
    what = header(path)
    if what.pop("version") != 1:
        print(f"{path}: lamps were taken out of it; ilf.osl shows what is left (ilflamps --compose puts them back, --export FILE.usda makes lights)")
    find_oslquery()
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.shading_system = "CPU", True
    m = bpy.data.materials.new(name or os.path.basename(path))
    m.use_nodes = True
    tree = m.node_tree
    tree.nodes.clear()
    script, out = tree.nodes.new("ShaderNodeScript"), tree.nodes.new("ShaderNodeOutputMaterial")
    script.mode, script.filepath = "EXTERNAL", os.path.join(HERE, "ilf.osl")
    bpy.context.view_layer.update()
    if "file" not in script.inputs:
        raise RuntimeError("ilf.osl was not compiled: expected a Blender with OSL, or see the lines above")
    what.update(file=os.path.abspath(path), depth=int(depth), to_viewer=1, strength=strength)
    if box:
        what.update(surface=2, centre=[(a + b) / 2 for a, b in zip(*box)], half_size=[(b - a) / 2 for a, b in zip(*box)])
    if sphere:
        what.update(surface=1, centre=sphere[0], half_size=(sphere[1],) * 3)
    for key, value in what.items():
        script.inputs[key].default_value = value
    tree.links.new(script.outputs["emitted"], out.inputs["Surface"])
    return m
