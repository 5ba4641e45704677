"""ilflamps --export: lamps and what is left for programs that read USD, for a Radiance without our patches, and as numbers."""
import json
import os
import re
import sys

import ilf
import numpy as np
import pytest
from conftest import TOP, run
from fishremap_util import read_exr
from ilf_util import Lamp, Mask, assert_same, directional_ilf, random_ilf, rays_text, unit, write_ilf
from process import execute
from test_ilf_lamps import masks_of
from test_version2 import PLANE, exportable, stock

BLENDER = TOP / "build" / "bench" / "cycles" / "venv" / "bin" / "python"     # Blender as a module: make test-cycles


def field(lamps, n=(3, 3)):
    f = random_ilf(np.random.default_rng(8), *n, 64, 32, plane=((1, -2, .5), PLANE[0], .8 * PLANE[1]))
    f.lamps = lamps
    return f


def every_shape():
    return [Lamp("sphere", (.3, .4, 2), (90, 80, 60), radius=.2),
            Lamp("rectangle", (-1, .2, 1.7), (50, 60, 70), a=(.3, .1, 0), b=(-.05, .15, 0)),
            Lamp("disc", (1.4, .2, 1.9), (10, 20, 90), a=(.3, 0, .1), b=(0, .2, 0)),
            Lamp("tube", (.2, -1, 1.5), (30, 20, 10), a=(.4, .1, .2), radius=.15),
            Lamp("sphere", (100., 200, 900), (30, 20, 10), radius=9, far=1)]


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    here = tmp_path_factory.mktemp("exported")
    f = field(every_shape(), n=(1, 1))
    run("ilflamps", "--quiet", "--export", "a.usda", "--export", "a.json", "--metres", ".0254", write_ilf(here / "a.ilf.exr", f), cwd=here)
    return f, here


# ---- JSON ------------------------------------------------------------------------------------------------

def from_json(l):
    masks = []
    for m in l["masks"]:
        grid = np.array(m["samples"]).reshape((m["nz"],) * (m["kind"] == "stack") + (m["ny"], m["nx"])) if "samples" in m else None
        masks.append(Mask(m["kind"], grid, link=int(m.get("link") == "logistic"), adds=int(m["adds"]), beta=m.get("beta", 0), plane=m.get("plane", ()),
                          coef=m.get("coef", ()), at=(m.get("x0", 0), m.get("y0", 0)), step=(m.get("dx", 1), m.get("dy", 1))))
    b = l["field"]
    return Lamp(l["shape"], b["centre"], l["radiance"], a=b.get("a", (0, 0, 0)), b=b.get("b", (0, 0, 0)), radius=b.get("radius", 0),
                far=int(l["at_infinity"]), masks=masks)


def test_the_numbers_are_enough_to_evaluate_the_lamps(tmp_path):
    rng = np.random.default_rng(2)
    m = masks_of(rng)
    f = field([Lamp("sphere", (.3, .4, 2), (90, 80, 60), radius=.3, masks=list(m.values())[k:k + 2]) for k in (0, 2, 4, 6)]
              + [Lamp("tube", (.2, -1, 1.5), (30, 20, 10), a=(.4, .1, .2), radius=.15, masks=[m["ball"], m["stack"], Mask("foot", np.ones((2, 2)) * .1, adds=1)])])
    for k, lamp in enumerate(f.lamps[:4]):
        lamp.c = np.array([k % 2, k // 2, 2.])
    run("ilflamps", "--quiet", "--export", "a.json", write_ilf(tmp_path / "a.ilf.exr", f), cwd=tmp_path)
    told = json.loads((tmp_path / "a.json").read_text())
    g = field([from_json(l) for l in told["lamps"]])
    which = rng.integers(len(g.lamps), size=300)
    target = np.array([l.c for l in g.lamps])[which] + rng.normal(size=(300, 3)) * .1
    o = rng.uniform(0, .8, (300, 3))
    d = unit(target - o)
    o, d, h = f.origin + o @ f.frame(), d @ f.frame(), f.origin + (o + 4 * d) @ f.frame()
    found = np.array(run("ilftrace", tmp_path / "a.ilf.exr", stdin=rays_text(o, d, h)).text.split(), float).reshape(-1, 3)
    assert_same(found, g.eval(o, d, h), rel=1e-4)


def test_units_and_places(exported):
    f, here = exported
    told = json.loads((here / "a.json").read_text())
    sphere = told["lamps"][0]
    assert told["units"]["metres_in_scene_unit"] == .0254
    assert np.allclose(sphere["scene"]["centre"], f.origin + f.lamps[0].c @ f.frame(), atol=1e-5)
    assert np.allclose(told["from"], f.origin + f.U / 2 + f.V / 2, atol=1e-5)
    lum = 179 * np.dot([90, 80, 60], [.265, .67, .065])
    away = np.linalg.norm(np.array(told["from"]) - sphere["scene"]["centre"])
    omega = 2 * np.pi * (1 - np.sqrt(1 - (.2 / away)**2))
    assert sphere["luminance"] == pytest.approx(lum, rel=1e-5) and sphere["solid_angle"] == pytest.approx(omega, rel=1e-5)
    assert sphere["flux"] == pytest.approx(lum * 4 * np.pi**2 * .2**2 * .0254**2, rel=1e-5)
    assert sphere["intensity"] == pytest.approx(sphere["illuminance"] * away**2 * .0254**2, rel=1e-5)
    assert told["lamps"][4]["at_infinity"] and "flux" not in told["lamps"][4]


# ---- USD ---------------------------------------------------------------------------------------------------

def test_the_dome_shows_what_is_left_the_way_usd_looks_at_it(exported):
    f, here = exported
    image, _ = read_exr(here / "a.dome.exr")
    rows, columns = image.shape[:2]
    # OpenEXR's latlong map, its y up and middle along z, then turned about x by 90 degrees
    lat = np.pi / 2 - (np.arange(rows) + .5) * np.pi / rows
    lon = np.pi - (np.arange(columns) + .5) * 2 * np.pi / columns
    lat, lon = np.meshgrid(lat, lon, indexing="ij")
    own = np.stack([np.cos(lat) * np.sin(lon), np.sin(lat), np.cos(lat) * np.cos(lon)], -1)
    d = np.stack([own[..., 0], -own[..., 2], own[..., 1]], -1).reshape(-1, 3)
    f = field([], n=(1, 1))
    expected = f.eval(np.tile(f.origin + f.U / 2 + f.V / 2, (len(d), 1)), d).reshape(image.shape)
    assert_same(image, expected, rel=1e-4)
    text = (here / "a.usda").read_text()
    assert 'upAxis = "Z"' in text and "metersPerUnit = 0.0254" in text and "xformOp:rotateX = 90" in text


def test_lights_of_usd_have_the_lamps_radiance(exported):
    f, here = exported
    text = (here / "a.usda").read_text()
    kinds = re.findall(r'def (\w+Light) "(\w+)"', text)
    assert kinds == [("SphereLight", "lamp_1"), ("RectLight", "lamp_2"), ("DiskLight", "lamp_3"), ("CylinderLight", "lamp_4"),
                     ("DistantLight", "lamp_5"), ("DomeLight", "residual")]
    colours = np.array([[float(x) for x in c.split(",")] for c in re.findall(r"inputs:color = \((.*)\)", text)])
    gains = np.array([float(x) for x in re.findall(r"inputs:intensity = (\S+)", text)])
    assert np.allclose((colours * gains[:, None])[:5], [l.rgb for l in f.lamps], rtol=1e-5)


LOOK = """
import json, sys
from pxr import Gf, Usd, UsdGeom, UsdLux
stage = Usd.Stage.Open(sys.argv[1])
lights = {}
for p in stage.Traverse():
    if not p.HasAPI(UsdLux.LightAPI):
        continue
    light = UsdLux.LightAPI(p)
    m = UsdGeom.Xformable(p).ComputeLocalToWorldTransform(0)
    lights[p.GetName()] = dict(kind=p.GetTypeName(), matrix=[list(r) for r in m], normalize=light.GetNormalizeAttr().Get(),
                               exposure=light.GetExposureAttr().Get(), size={a.GetBaseName(): a.Get() for a in p.GetAttributes()
                               if a.GetBaseName() in ("radius", "width", "height", "length", "angle")})
    if p.IsA(UsdLux.DomeLight):
        lights[p.GetName()]["there"] = bool(UsdLux.DomeLight(p).GetTextureFileAttr().Get().resolvedPath)
mesh = stage.GetPrimAtPath("/light_field/surroundings")
words = UsdGeom.Mesh.ValidateTopology(*[UsdGeom.Mesh(mesh).GetPrim().GetAttribute(n).Get() for n in ("faceVertexIndices", "faceVertexCounts")],
                                      len(UsdGeom.Mesh(mesh).GetPointsAttr().Get())) if mesh else None
wrong = []
try:
    from pxr import UsdValidation                                       # of usd-core since 24.11
    every = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    wrong = [e.GetMessage() for e in UsdValidation.ValidationContext(every).Validate(stage)]
except ImportError:
    pass
print(json.dumps(dict(wrong=wrong, lights=lights, up=UsdGeom.GetStageUpAxis(stage), metres=UsdGeom.GetStageMetersPerUnit(stage), mesh=words)))
"""


def look(path):
    return json.loads(execute([sys.executable, "-c", LOOK, path], capture_output=True, check=True).stdout)


def test_usd_core_reads_it(exported):
    f, here = exported
    told = look(here / "a.usda")
    assert not told["wrong"]
    assert told["up"] == "Z" and told["metres"] == pytest.approx(.0254) and told["lights"]["residual"]["there"]
    where = {k: np.array(v["matrix"]) for k, v in told["lights"].items()}
    assert all(l["exposure"] == 0 and not l["normalize"] for l in told["lights"].values())
    assert [sorted(told["lights"][f"lamp_{k}"]["size"]) for k in range(1, 6)] == [["radius"], ["height", "width"], ["radius"], ["length", "radius"], ["angle"]]
    middle = f.origin + f.U / 2 + f.V / 2
    for k, lamp in enumerate(f.lamps[:4]):
        M, c = where[f"lamp_{k + 1}"], f.origin + lamp.c @ f.frame()
        assert np.allclose(M[3, :3], c, atol=1e-4) and np.linalg.det(M[:3, :3]) > 0
    for k in (1, 2):                                                   # they shine along -z, towards the plane's middle
        M = where[f"lamp_{k + 1}"]
        assert np.dot(-M[2, :3], middle - M[3, :3]) > 0
        a, b = f.lamps[k].a @ f.frame(), f.lamps[k].b @ f.frame()
        assert np.abs(np.dot(M[2, :3], a)) < 1e-4 and np.abs(np.dot(M[2, :3], b)) < 1e-4
    corner = where["lamp_2"][:2, :3] * np.array([[told["lights"]["lamp_2"]["size"]["width"]], [told["lights"]["lamp_2"]["size"]["height"]]]) / 2
    assert np.allclose(np.abs(corner), np.abs([f.lamps[1].a @ f.frame(), f.lamps[1].b @ f.frame()]), atol=1e-4)
    sun = unit(f.origin + f.lamps[4].c @ f.frame() - middle)
    assert np.allclose(where["lamp_5"][2, :3], sun, atol=1e-5)
    assert told["lights"]["lamp_5"]["size"]["angle"] == pytest.approx(2 * np.degrees(np.arcsin(9 / np.linalg.norm(f.lamps[4].c - [.5, .4, 0]))), rel=1e-4)


IN_BLENDER = """
import json
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
s = bpy.context.scene
s.world = bpy.data.worlds.new("w")
bpy.ops.wm.usd_import(filepath="a.usda", import_meshes=False)
cam = bpy.data.cameras.new("c")
it = bpy.data.objects.new("c", cam)
s.collection.objects.link(it)
it.rotation_euler, cam.angle, s.camera = (2.5, .2, .3), 1.5, it
r, y = s.render, s.cycles
r.engine, r.resolution_x, r.resolution_y = "CYCLES", 40, 40
y.samples, y.use_denoising, y.use_adaptive_sampling, y.pixel_filter_type, y.filter_width = 1, False, False, "BOX", .01
s.view_settings.view_transform = "Raw"
r.image_settings.file_format, r.image_settings.color_depth, r.filepath = "OPEN_EXR", "32", "seen.exr"
bpy.ops.render.render(write_still=True)
json.dump([list(v) for v in it.matrix_world], open("camera.json", "w"))
"""


@pytest.mark.skipif(not os.environ.get("ILF_CYCLES"), reason="in Blender: make test-cycles runs it")
def test_blender_sees_the_dome_the_right_way_round(tmp_path):
    f = directional_ilf(lambda d: 1.2 + d * [1, .6, 0] + .4 * np.sin(5 * d[..., :1]), 256, 128, origin=(-.5, -.4, 0), U=(1, 0, 0), V=(0, .8, 0))
    run("ilflamps", "--quiet", "--export", "a.usda", write_ilf(tmp_path / "a.ilf.exr", f), cwd=tmp_path)
    execute([BLENDER, "-c", IN_BLENDER], cwd=tmp_path, capture_output=True, check=True)
    image = read_exr(tmp_path / "seen.exr")[0][..., :3].reshape(-1, 3)
    M = np.array(json.loads((tmp_path / "camera.json").read_text()))
    x = ((np.arange(40) + .5) / 40 * 2 - 1) * np.tan(.75)
    X, Y = np.meshgrid(x, -x)
    d = unit(np.stack([X, Y, -np.ones_like(X)], -1).reshape(-1, 3) @ M[:3, :3].T)
    up = d[:, 2] > .05
    assert up.mean() > .5 and np.allclose(image[up], f.eval(np.zeros_like(d), d)[up], rtol=.005)


def test_what_is_left_out_is_said(tmp_path):
    f = field(every_shape()[:2])
    f.lamps[1].masks = [masks_of(np.random.default_rng(1))["layer"]]
    r = run("ilflamps", "--export", "a.usda", write_ilf(tmp_path / "a.ilf.exr", f), cwd=tmp_path)
    assert "lamp 2: a sheet" in r.err and "lamp 1" not in r.err and "taken for a metre" in r.err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.dome.exr", "a.ilf.exr", "a.usda"]
    assert 'def Mesh "surroundings"' in (tmp_path / "a.usda").read_text()


@pytest.mark.parametrize("args, words", [
    (("--export", "a.gltf"), "expected FILE.usda, FILE.rad or FILE.json"), (("--export", ".rad"), "expected FILE.usda"),
    (("--at", "1,2,3", "-o", "x.ilf.exr"), "expected --export"), (("--export", "a.json", "--metres", "0"), "more than 0"),
    (("--export", "a.json", "--at", "1,2"), "expected")])
def test_refusals(exported, tmp_path, args, words):
    r = run("ilflamps", *args, exported[1] / "a.ilf.exr", cwd=tmp_path, code=2)
    assert words in r.err and len(r.err.splitlines()) == 1 and not list(tmp_path.iterdir())


# ---- a Radiance without our patches ------------------------------------------------------------------------

def test_stock_radiance_has_the_same_irradiance(tmp_path):
    """At points of the plane, what hides the lamps included, against a sum over libilf's own rays."""
    rng = np.random.default_rng(12)
    lamps, m = exportable(rng)
    for lamp, masks in lamps[:3]:
        lamp.masks = [m[k] for k in masks]
    f = field([l for l, _ in lamps[:3]], n=(1, 1))
    f.probes[:] = f.probes.mean()
    run("ilflamps", "--quiet", "--export", "sub.rad", write_ilf(tmp_path / "a.ilf.exr", f), cwd=tmp_path)
    (tmp_path / "o.oct").write_bytes(stock("oconv", "sub.rad", cwd=tmp_path))
    places = np.array([[.5, .4, .01], [.1, .7, .01], [.9, .1, .2]])
    n = 700                                                            # directions by cosine
    r, t = np.sqrt((np.arange(n) + .5) / n)[:, None], 2 * np.pi * (np.arange(n) + .5) / n
    d = np.stack([r * np.cos(t), r * np.sin(t), np.sqrt(1 - r**2) * np.ones(n)], -1).reshape(-1, 3) @ f.frame()
    with ilf.open(tmp_path / "a.ilf.exr") as g:
        expected = [np.pi * g.eval(f.origin + p @ f.frame(), d).mean(0) for p in places]
    n_hat = f.frame()[2]
    points = "".join(" ".join(map(str, (*(f.origin + p @ f.frame()), *n_hat))) + "\n" for p in places)
    text = stock("rtrace", "-h", "-I", "-ab", "1", "-ad", "4096", "-as", "0", "-aa", "0", "-ds", ".02", "-dj", "0", "-dt", "0", "-dc", "1", "o.oct",
                 cwd=tmp_path, stdin=points.encode())
    found = np.array(text.split(), float).reshape(-1, 3)
    assert np.abs(found / expected - 1).max() < .03
