"""The material ilf among other things: several fields, patterns, mirrors, lamps; octrees; what is wrong is said."""
import struct

import numpy as np
import pytest

from conftest import environment, run, run_measured
from ilf_util import PI, assert_same, edited, f32, random_directions, random_ilf, sparse_ilf, unit, write_ilf
from rad_util import (FLOOR, L, LITERAL, UPRIGHT, Cone, Polygon, Ring, Source, Sphere, Surface, clear, compare,
                      dome_scene, elsewhere, file_and_ilf, irradiance, material, numbers, oconv, rays_about, rtrace,
                      scene_value)


# ---- several, patterns, what is seen through other things ----------------------------------------------

def test_several_light_fields_in_one_scene(tmp_path):
    """Different files, the same file twice in different modes and places, near and at infinity."""
    rng = np.random.default_rng(53)
    f, file = file_and_ilf(tmp_path, rng, name="one", plane=UPRIGHT)
    g, other = file_and_ilf(tmp_path, rng, (2, 5), (9, 4), "sphere", True, "two", plane=UPRIGHT)
    moved = elsewhere(f, rng, 12, -1)
    surfaces = [Surface(Sphere((0, 0, 3), 1), f), Surface(Polygon((1, -2, 1), (4, -2, 1), (4, 2, 2), (1, 2, 2)), g, False),
                Surface(Cone((-3, -3, 2), (-3, 3, 2), 1, kind="cylinder"), f, False), Surface(Ring((0, 0, -4), (0, 0, 1), 0, 9), moved),
                Surface(Source((0, 0, 1), 160), g)]
    text = (material("a", file) + material("b", other, depth=False) + material("c", file, depth=False)
            + material("d", file, moved, 12) + material("e", other))
    text += "".join(s.shape.rad(m, f"s{m}") for s, m in zip(surfaces, "abcde"))
    o, d = f32(rng.normal(size=(16000, 3))), f32(random_directions(rng, 16000))
    compare(tmp_path, oconv(tmp_path, text), surfaces, o, d, rng, 0.3)


@pytest.mark.parametrize("kind", ["colorfunc", "brightfunc"])
def test_pattern_multiplies(tmp_path, kind):
    rng = np.random.default_rng(54)
    f, file = file_and_ilf(tmp_path, rng)
    (tmp_path / "p.cal").write_text("pr = 0.5 + 0.25*sin(3*Px);\npg = 1 + 0.5*cos(2*Py) + 0.1*Dz;\npb = 2 + Pz/10;\n")

    def pattern(h, d):
        r, g, b = 0.5 + 0.25 * np.sin(3 * h[:, 0]), 1 + 0.5 * np.cos(2 * h[:, 1]) + 0.1 * d[:, 2], 2 + h[:, 2] / 10
        return np.stack([r, g, b] if kind == "colorfunc" else [g, g, g], -1)
    names = "pr pg pb" if kind == "colorfunc" else "pg"
    text = f"void {kind} pat\n{len(names.split()) + 1} {names} ./p.cal\n0\n0\n" + material("room", file, mod="pat")
    s = Surface(Sphere((0, 0, 0), 5), f, True, pattern)
    compare(tmp_path, oconv(tmp_path, text + s.shape.rad("room", "dome")), [s], *rays_about(rng, f, 8000), rng, 0.4)


def test_alias(tmp_path):
    rng = np.random.default_rng(55)
    f, file = file_and_ilf(tmp_path, rng)
    s = Surface(Sphere((0, 0, 0), 5), f)
    text = material("room", file) + "\nvoid alias other room\n" + s.shape.rad("other", "dome")
    compare(tmp_path, oconv(tmp_path, text), [s], *rays_about(rng, f, 3000), rng, 0.4)


def test_alias_and_pattern_on_a_source(tmp_path):
    """A source's material is found through an alias, whose modifier takes the place of the material's own."""
    rng = np.random.default_rng(68)
    f, file = file_and_ilf(tmp_path, rng, plane=UPRIGHT)
    (tmp_path / "p.cal").write_text("br = 1 + 0.5*Dx + 0.25*Dz;\n")
    text = ("void brightfunc pat\n2 br ./p.cal\n0\n0\n" + material("room", file)
            + "\npat alias other room\n" + Source((0, 0, 1), 360).rad("other", "sky"))
    s = Surface(Source((0, 0, 1), 360), f, True, lambda h, d: (1 + 0.5 * d[:, 0] + 0.25 * d[:, 2])[:, None])
    compare(tmp_path, oconv(tmp_path, text), [s], *rays_about(rng, f, 3000), rng, 0.4)


def test_mixture_of_two_light_fields(tmp_path):
    rng = np.random.default_rng(69)
    f, one = file_and_ilf(tmp_path, rng, name="one", plane=UPRIGHT)
    g, two = file_and_ilf(tmp_path, rng, (2, 2), name="two", plane=UPRIGHT)
    (tmp_path / "m.cal").write_text("quarter = 0.25;\n")
    text = (material("a", one) + material("b", two, depth=False) + "void mixfunc both\n4 a b quarter ./m.cal\n0\n0\n"
            + Sphere((0, 0, 0), 5).rad("both", "dome"))
    octree = oconv(tmp_path, text)
    o, d = rays_about(rng, f, 3000)
    surfaces = [Surface(Sphere((0, 0, 0), 5), x, depth) for x, depth in ((f, True), (g, False))]
    expected = 0.25 * scene_value(surfaces[:1], o, d) + 0.75 * scene_value(surfaces[1:], o, d)
    good = clear(surfaces[:1], o, d, rng)
    assert_same(rtrace(tmp_path, octree, o, d)[good], expected[good])


def test_octree_that_is_added_to(tmp_path):
    """oconv -i: the light field in the old part, and another in the new."""
    rng = np.random.default_rng(70)
    f, one = file_and_ilf(tmp_path, rng, name="one")
    g, two = file_and_ilf(tmp_path, rng, (2, 2), name="two")
    a, b = Surface(Sphere((0, 0, 0), 5), f), Surface(Sphere((2, 1, 0), 0.5), g)
    oconv(tmp_path, material("a", one) + a.shape.rad("a", "dome"), "old")
    octree = oconv(tmp_path, material("b", str(tmp_path / two)) + b.shape.rad("b", "ball"), "scene", "-i", "old.oct")
    compare(tmp_path, octree, [a, b], *rays_about(rng, f, 6000), rng, 0.3)


def test_a_lamp_beside_the_light_field(tmp_path):
    """Direct light of an ordinary source and the light field's add up, and neither is counted twice."""
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    lamp = "void light l\n0\n0\n3 5e4 5e4 5e4\n" + Sphere((3, 0, 4), 0.02).rad("l", "lamp")
    text = (tmp_path / "scene.rad").read_text()
    oconv(tmp_path, text + lamp)
    got = irradiance(tmp_path, octree, [(0, 0, 1)], "-dj", "0")[0]
    direct = 5e4 * PI * 0.02 ** 2 / 25 * 0.8             # L A cos / d^2 of a small far sphere
    assert np.allclose(got, PI * L + direct, rtol=2e-3)
    r = run("rtrace", "-h", "-I", "-ab", "0", "-di", "0", "-dj", "0", octree, stdin="0 0 0 0 0 1\n", cwd=tmp_path)
    assert np.allclose(np.array(r.text.split(), float), direct, rtol=2e-3)


def test_a_lamp_behind_the_light_field_gives_nothing(tmp_path):
    """Auxiliary geometry is opaque, and to a lamp's shadow ray it is no lamp."""
    octree = dome_scene(tmp_path, lambda d: d * 0 + L, n_theta=16, n_phi=8)
    oconv(tmp_path, (tmp_path / "scene.rad").read_text() + "void light l\n0\n0\n3 5e4 5e4 5e4\n" + Sphere((3, 0, 30), 2).rad("l", "lamp"))
    r = run("rtrace", "-h", "-I", "-ab", "0", "-di", "0", octree, stdin="0 0 0 0 0 1\n", cwd=tmp_path)
    assert list(map(float, r.text.split())) == [0, 0, 0]
    assert np.allclose(irradiance(tmp_path, octree, [(0, 0, 1)]), PI * L, rtol=2e-3)


@pytest.mark.parametrize("far", [False, True], ids=["dome", "source"])
def test_mirror_ball_shows_the_light_field(tmp_path, far):
    rng = np.random.default_rng(56)
    f, file = file_and_ilf(tmp_path, rng, plane=UPRIGHT)
    light = Surface(Source((0, 0, 1), 360) if far else Sphere((0, 0, 0), 7), f)
    ball = Sphere((0.1, 0.2, 0.6), 0.5)
    text = material("room", file) + light.shape.rad("room", "dome") + "void metal chrome\n0\n0\n5 1 1 1 1 0\n" + ball.rad("chrome", "ball")
    octree = oconv(tmp_path, text)
    n = 8000
    d = random_directions(rng, n)
    o = f32(ball.c - 3 * d + rng.normal(size=(n, 3)) * 0.15)
    d = f32(d)
    t = ball.hit(o, d)
    seen = np.isfinite(t) & clear([Surface(ball, f)], o, d, rng)
    o, d, t = o[seen], unit(d[seen]), t[seen]
    h = o + t[:, None] * d
    normal = (h - ball.c) / ball.r
    mirrored = d - 2 * (d * normal).sum(1)[:, None] * normal
    good = clear([light], h, mirrored, rng)
    got = rtrace(tmp_path, octree, o, f32(d))
    assert_same(got[good], scene_value([light], h, mirrored)[good], rel=1e-4)     # d was rounded after the normalisation
    assert good.mean() > 0.95 and (got > 0).all(1).mean() > 0.3


def test_many_processes_give_the_same(tmp_path):
    rng = np.random.default_rng(57)
    f, file = file_and_ilf(tmp_path, rng)
    octree = oconv(tmp_path, material("room", file) + Sphere((0, 0, 0), 5).rad("room", "dome"))
    o, d = rays_about(rng, f, 2000)
    assert np.array_equal(rtrace(tmp_path, octree, o, d), rtrace(tmp_path, octree, o, d, "-n", "2"))


def test_file_is_found_along_raypath(tmp_path):
    rng = np.random.default_rng(58)
    (tmp_path / "lib").mkdir()
    (tmp_path / "work").mkdir()
    f, file = file_and_ilf(tmp_path / "lib", rng)
    octree = oconv(tmp_path / "work", material("room", file) + Sphere((0, 0, 0), 5).rad("room", "dome"))
    ray = "0 0 0 " + numbers(f.frame()[2]) + "\n"
    env = environment()
    r = run("rtrace", "-h", "-ab", "0", "-di", "0", octree, stdin=ray, cwd=tmp_path / "work", code=1, env=env)
    assert "room" in r.err and file in r.err
    env["RAYPATH"] += f":{tmp_path / 'lib'}"
    r = run("rtrace", "-h", "-ab", "0", "-di", "0", octree, stdin=ray, cwd=tmp_path / "work", env=env)
    assert min(map(float, r.text.split())) > 0


# ---- octrees that are older or frozen ------------------------------------------------------------------

LAMP = "void light l\n0\n0\n3 10 20 30\n" + Polygon((-1, -1, 4), (-1, 1, 4), (1, 1, 4), (1, -1, 4)).rad("l", "lamp") + FLOOR


def test_frozen_octree_stands_alone(tmp_path):
    rng = np.random.default_rng(63)
    f, file = file_and_ilf(tmp_path, rng)
    g = elsewhere(f, rng, 12, -1)
    s = Surface(Sphere((0, 0, 0), 5), g, False)
    octree = oconv(tmp_path, material("room", file, g, 12, False) + s.shape.rad("room", "dome"), "scene", "-f")
    (tmp_path / "scene.rad").unlink()
    compare(tmp_path, octree, [s], *rays_about(rng, g, 3000), rng, 0.4)


def test_octree_that_does_not_know_the_material(tmp_path):
    """A frozen octree lists the object types that its maker knew; here the newest is taken out again."""
    oconv(tmp_path, LAMP, "scene", "-f")
    data = (tmp_path / "scene.oct").read_bytes()
    assert data.count(b"\0ilf\0\0") == 1, "the new type must be the last in the list"
    (tmp_path / "old.oct").write_bytes(data.replace(b"\0ilf\0\0", b"\0\0"))
    rng = np.random.default_rng(64)
    o = f32(np.stack([*rng.uniform(-3, 3, (2, 500)), np.full(500, 2.0)], -1))
    d = f32(random_directions(rng, 500))
    a, b = rtrace(tmp_path, "scene.oct", o, d), rtrace(tmp_path, "old.oct", o, d)
    assert np.array_equal(a, b) and a.max() > 9


# ---- what is wrong is said -----------------------------------------------------------------------------

HIT = "0.1 0.2 0 0.1 0.2 1\n"


def complaint(folder, text, *words):
    """rtrace and rpict name the primitive and the reason, and exit 1."""
    (folder / "scene.rad").write_text(text + Sphere((0, 0, 0), 5).rad("kitchen", "dome"))
    r = run("oconv", "scene.rad", cwd=folder, code=None)
    if r.code:                                           # what can be seen without the file, oconv may say
        assert r.code == 1 and 'ilf "kitchen"' in r.err and "argument" in r.err, r
        return
    octree = "scene.oct"
    (folder / octree).write_bytes(r.out)
    for program, args, stdin in (("rtrace", ["-h", "-ab", "0", "-di", "0"], HIT),
                                 ("rpict", ["-x", "4", "-y", "4", "-vd", "0", "0", "1", "-vu", "0", "1", "0", "-ab", "0", "-di", "0"], "")):
        r = run(program, *args, octree, stdin=stdin, cwd=folder, code=1)
        said = [x for x in r.err.splitlines() if "kitchen" in x]
        assert len(said) == 1, r
        low = said[0].lower()
        for word in words:
            assert any(w.lower() in low for w in (word if isinstance(word, tuple) else (word,))), (word, said[0])


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    f = random_ilf(np.random.default_rng(66), 2, 2, 8, 4, plane=((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    return write_ilf(tmp_path_factory.mktemp("sound") / "room.ilf.exr", f).read_bytes()


@pytest.mark.parametrize("arguments, words", [
    ("0\n0\n0", [("file", "argument")]),
    ("3 room.ilf.exr depth depth\n0\n0", [("argument", "depth")]),
    ("2 room.ilf.exr deep\n0\n0", ["nodepth"]),
    ("1 room.ilf.exr\n1 1\n0", [("integer", "argument")]),
    ("1 room.ilf.exr\n0\n3 0 0 0", [("9", "real", "argument")]),
    ("1 room.ilf.exr\n0\n8 0 0 0 1 0 0 0 1", [("9", "real", "argument")]),
    ("1 room.ilf.exr\n0\n10 0 0 0 1 0 0 0 1 0 0", [("9", "real", "argument")]),
    ("1 room.ilf.exr\n0\n13 0 0 0 1 0 0 0 1 0 0 0 1 0", [("9", "real", "argument")]),
    ("1 room.ilf.exr\n0\n9 0 0 0 0 0 0 0 1 0", ["U"]),
    ("1 room.ilf.exr\n0\n9 0 0 0 1 0 0 0 0 0", ["V"]),
    ("1 room.ilf.exr\n0\n9 0 0 0 1 0 0 1 1 0", ["perpendicular"]),
    ("1 room.ilf.exr\n0\n12 0 0 0 1 0 0 0 1 0 0 0 0", ["N"]),
    ("1 room.ilf.exr\n0\n12 0 0 0 1 0 0 0 1 0 1 0 0", ["N"]),
    ("1 room.ilf.exr\n0\n12 0 0 0 1 0 0 0 1 0 0 1 1", ["N"]),
    ("1 gone.ilf.exr\n0\n0", ["gone.ilf.exr", ("not found", "cannot find", "no such file")]),
])
def test_bad_arguments_name_the_primitive(tmp_path, sound, arguments, words):
    (tmp_path / "room.ilf.exr").write_bytes(sound)
    complaint(tmp_path, f"void ilf kitchen\n{arguments}\n", *words)


@pytest.mark.parametrize("how, words", [
    ("empty", []), ("text", []), ("cut in the header", []), ("cut in the table", []), ("cut in the data", []),
    ("no polarMax", ["ilf:polarMax"]), ("zero U", ["ilf:U"]), ("NaN in the origin", ["ilf:origin"]), ("NaN texel", ["probe", "pixel"])])
def test_bad_file_names_the_primitive(tmp_path, sound, how, words):
    import struct
    data = {"empty": b"", "text": b"no picture\n", "cut in the header": sound[:300], "cut in the table": sound[:len(sound) - 1800],
            "cut in the data": sound[:-700]}.get(how)
    if how == "no polarMax":
        data = edited(sound, "ilf:polarMax", remove=True)
    elif how == "zero U":
        data = edited(sound, "ilf:U", value=b"\0" * 12)
    elif how == "NaN in the origin":
        data = edited(sound, "ilf:origin", value=struct.pack("<3f", 0, float("nan"), 0))
    elif how == "NaN texel":
        data = sound[:-384] + struct.pack("<f", float("nan")) * 96
    (tmp_path / "room.ilf.exr").write_bytes(data)
    complaint(tmp_path, "void ilf kitchen\n1 room.ilf.exr\n0\n0\n", "room.ilf.exr", *words)


def test_scene_tools_do_not_need_the_file(tmp_path):
    """oconv, xform and getinfo know the primitive; only a renderer opens what it names."""
    oconv(tmp_path, material("kitchen", "gone.ilf.exr") + Sphere((0, 0, 0), 5).rad("kitchen", "dome"))
    assert "gone.ilf.exr" in run("xform", "scene.rad", cwd=tmp_path).text
    assert "oconv" in run("getinfo", "scene.oct", cwd=tmp_path).text


# ---- start-up and memory -------------------------------------------------------------------------------

def test_rtrace_with_the_paper_s_full_size_touches_little(tmp_path):
    """30 x 30 x 400 x 400 half (864 MB): peak memory after a few rays."""
    probe = np.full((400, 400, 3), 2.0)
    sparse_ilf(tmp_path / "big.ilf.exr", 30, 30, 400, 400, {(15, 15): probe})
    octree = oconv(tmp_path, material("room", "big.ilf.exr") + Sphere((0, 0, 0), 5).rad("room", "dome"))
    x = 15 / 29
    r, peak = run_measured("rtrace", *LITERAL, octree, stdin=f"{x} {x} 0 0.1 0.1 1\n0.1 0.1 0 0.1 0.1 1\n", cwd=tmp_path)
    rows = np.array([x.split() for x in r.text.splitlines()], float)
    assert rows[0].min() > 1.9 and abs(rows[1]).max() < 1e-6
    assert peak < 60e6, f"{peak / 1e6:.0f} MB"
