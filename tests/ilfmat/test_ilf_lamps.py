"""Light fields of version 2: lamps that were taken out of the probes, in files and along rays, against ilf_util.py (numpy)."""
import struct

import numpy as np
import pytest
from conftest import driver, environment, run
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ilf_util import ILF, KINDS, SHAPES, Lamp, Mask, assert_same, random_directions, random_ilf, rays_text, unit, write_ilf
from process import execute

RNG = np.random.default_rng(1802)
C = np.array([.3, .4, 2.])
LEFT = dict(n_u=3, n_v=2, n_theta=16, n_phi=8)


def grid(*shape, rng=RNG, low=0., high=1., dtype=np.float32):
    return rng.uniform(low, high, shape).astype(dtype)


def masks_of(rng):
    """One of each kind, and some that differ in what matters."""
    area = dict(at=(-2, -1.5), step=(.25, .3))
    return {
        "layer": Mask("layer", grid(12, 17, rng=rng), plane=(1., .1, -.2), **area),
        "layer-logistic": Mask("layer", grid(12, 17, rng=rng, low=-4, high=4, dtype=np.float16), link=1, plane=(1.2, 0, 0), **area),
        "foot": Mask("foot", grid(12, 17, rng=rng), beta=0, **area),
        "foot-beam": Mask("foot", grid(12, 17, rng=rng), link=1, beta=-1, **area),
        "foot-high": Mask("foot", grid(1, 9, rng=rng), beta=1.7, **area),
        "gate": Mask("gate", beta=.4, coef=(1, .5, -.3, -2, .4, -1.5)),
        "beam": Mask("beam", coef=(*unit(np.array([.1, -.2, -1.])), 6.5, 1.8)),
        "stack": Mask("stack", grid(5, 12, 17, rng=rng), plane=(.6, 1.6), coef=(.6, .07), **area),
        "stack-single": Mask("stack", grid(1, 12, 17, rng=rng), plane=(.8, 1.), coef=(.6, .07), **area),
        "ball": Mask("ball", coef=(.3, .5, 1., .3)),
    }


def lamps_of(rng, masks):
    rgb = lambda: rng.uniform(5, 50, 3)                                # noqa: E731
    a, b = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
    return [Lamp("sphere", C, rgb(), radius=.45, masks=masks, errors=(.1, .2, .003, .01)),
            Lamp("rectangle", (-1, .2, 1.7), rgb(), a=a * .5, b=b * .35, masks=masks, seen=rng.uniform(-1, 1, (2, 3))),
            Lamp("disc", (1.4, .2, 1.9), rgb(), a=a * .5, b=b * .3, masks=masks),
            Lamp("tube", (.2, -1, 1.5), rgb(), a=(.4, .1, .2), radius=.15, masks=masks)]


def lit(rng, lamps, **how):
    f = random_ilf(rng, *LEFT.values(), plane=((0, 0, 0), (1, 0, 0), (0, .8, 0)), **how)
    f.lamps = lamps
    return f


def rays_at(rng, f, n=400):
    """Rays to and past the lamps of a field that lies in its header's plane, from below, within and above the masks; in the scene."""
    k = np.linalg.norm(f.U) / f.length_u()
    which = rng.integers(len(f.lamps), size=n)
    target = np.stack([f.lamps[i].c for i in which]) + rng.normal(size=(n, 3)) * .25
    o = np.stack([rng.uniform(-.5, 1.5, n), rng.uniform(-.5, 1.3, n), rng.choice([-.3, 0, .05, .7, 1.1, 3.], n)], 1)
    d = unit(target - o)
    h = o + d * rng.uniform(.3, 6, n)[:, None]
    world = lambda p: f.origin + p @ f.frame() * k                     # noqa: E731
    return world(o), d @ f.frame(), world(h)


def traced(path, o, d, h, *options):
    return np.array(run("ilftrace", *options, path, stdin=rays_text(o, d, h)).text.split(), float).reshape(-1, 3)


@pytest.mark.parametrize("kind", masks_of(RNG))
def test_every_shape_behind_every_mask(tmp_path, kind):
    rng = np.random.default_rng(7)
    f = lit(rng, lamps_of(rng, [masks_of(rng)[kind]]))
    path = write_ilf(tmp_path / "l.ilf.exr", f)
    o, d, h = rays_at(rng, f)
    dark = ILF(f.probes, f.origin, f.U, f.V)
    for depth in (True, False):
        expected = f.eval(o, d, h, depth)
        assert (np.abs(expected - dark.eval(o, d, h, depth)).max(1) > 1e-3).mean() > .1    # there is something to see
        assert_same(traced(path, o, d, h, *([] if depth else ["--nodepth"])), expected)
    assert_same(traced(path, o, d, np.full_like(h, np.inf)), f.eval(o, d))


def test_masks_multiply_and_add(tmp_path):
    rng = np.random.default_rng(8)
    m = masks_of(rng)
    rest = Mask("foot", grid(5, 7, rng=rng, low=-.3, high=.3), adds=1, beta=0, at=(-1, -1), step=(.5, .5))
    f = lit(rng, lamps_of(rng, [m["layer"], m["beam"], rest, m["ball"], m["stack"]]))
    path = write_ilf(tmp_path / "l.ilf.exr", f)
    o, d, h = rays_at(rng, f, 1500)
    assert_same(traced(path, o, d, h), f.eval(o, d, h))


PLANES = {"moved": np.diag([1., 1, 1]), "turned": np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0],
          "mirrored": np.diag([1., 1, -1]), "scaled": 2.5 * np.eye(3)}


@pytest.mark.parametrize("how", PLANES)
def test_in_other_planes(tmp_path, how):
    rng = np.random.default_rng(9)
    f = lit(rng, lamps_of(rng, list(masks_of(rng).values())[:1] + [masks_of(rng)["beam"]]))
    path = write_ilf(tmp_path / "l.ilf.exr", f)
    M = np.eye(4)
    M[:3, :3], M[:3, 3] = PLANES[how], (3, -2, 1)
    g = f.moved(M)
    o, d, h = rays_at(rng, g)
    plane = " ".join(f"{x:.17g}" for v in (g.origin, g.U, g.V, g.N) for x in v)
    assert_same(traced(path, o, d, h, "--plane", plane), g.eval(o, d, h))
    # the same light, carried along
    back = np.linalg.inv(M)
    at = lambda p: p @ back[:3, :3].T + back[:3, 3]                    # noqa: E731
    assert_same(g.eval(o, d, h), f.eval(at(o), d @ back[:3, :3].T, at(h)))


def test_planes_out_of_proportion_are_refused(tmp_path):
    f = lit(RNG, lamps_of(RNG, []))
    path = write_ilf(tmp_path / "l.ilf.exr", f)
    r = run("ilftrace", "--plane", "0 0 0 2 0 0 0 .8 0", path, stdin="0 0 0 0 0 1 0 0 3\n", code=2)
    assert "in the file's proportion" in r.err and not r.text


def test_a_lamp_behind_the_hit_is_not_seen(tmp_path):
    lamp = Lamp("sphere", (.5, .4, 2), (40, 50, 60), radius=.1)
    f = lit(RNG, [lamp])
    path = write_ilf(tmp_path / "l.ilf.exr", f)
    o, d = np.tile([.5, .4, 0], (4, 1)), np.tile([0, 0, 1.], (4, 1))
    h = o + d * np.array([1.5, 1.9 / 1.011, 1.9 / 1.009, 5])[:, None]  # it is entered at 1.9, and 1 % is flush
    assert list(np.abs(traced(path, o, d, h) - lamp.rgb).max(1) < 1e-4) == [False, False, True, True]
    f.lamps = [Lamp("sphere", (.5, .4, 2), (40, 50, 60), radius=.1, far=1)]
    assert np.allclose(traced(write_ilf(tmp_path / "f.ilf.exr", f), o, d, h), lamp.rgb)


def test_masks_below_the_origin_do_not_count(tmp_path):
    shut = Mask("layer", np.zeros((1, 1)), plane=(1, 0, 0))
    f = lit(RNG, [Lamp("sphere", (.5, .4, 2), (40, 50, 60), radius=.1, masks=[shut])])
    path = write_ilf(tmp_path / "l.ilf.exr", f)
    o = np.array([[.5, .4, 0], [.5, .4, 1.1]])
    d, h = np.tile([0, 0, 1.], (2, 1)), np.tile([.5, .4, 3.], (2, 1))
    hidden, seen = traced(path, o, d, h)
    assert np.allclose(seen, (40, 50, 60)) and hidden.max() < 20
    # without depth correction nobody knows where the ray begins: on the plane, behind the mask
    assert np.allclose(traced(path, o, d, h, "--nodepth")[1], traced(path, o, d, h, "--nodepth")[0])


def test_a_lamp_put_out_is_not_there(tmp_path):
    near, far = Lamp("disc", (.5, .4, 1), (0, 0, 0), a=(.3, 0, 0), b=(0, .3, 0)), Lamp("sphere", (.5, .4, 2), (40, 50, 60), radius=.1)
    path = write_ilf(tmp_path / "l.ilf.exr", lit(RNG, [near, far]))
    assert np.allclose(traced(path, *np.array([[[.5, .4, 0]], [[0, 0, 1]], [[.5, .4, 3]]])), (40, 50, 60))


def test_rays_from_below_see_nothing(tmp_path):
    f = lit(RNG, lamps_of(RNG, []))
    path = write_ilf(tmp_path / "l.ilf.exr", f)
    d = random_directions(RNG, 50) * [1, 1, -1]
    d[:, 2] = -np.abs(d[:, 2])
    assert not traced(path, np.tile([.5, .4, 3.], (50, 1)), d, np.tile([.5, .4, 0.], (50, 1))).any()


def test_no_ray_gives_anything_but_numbers(tmp_path):
    rng = np.random.default_rng(3)
    f = lit(rng, lamps_of(rng, list(masks_of(rng).values())[:8]))
    path = write_ilf(tmp_path / "l.ilf.exr", f)
    huge = 10. ** rng.uniform(-300, 300, (300, 9)) * rng.choice([-1, 1], (300, 9))
    huge[:, 5] = np.abs(huge[:, 5])
    assert np.isfinite(traced(path, *np.split(huge, 3, axis=1))).all()


# ---- files ---------------------------------------------------------------------------------------------

def copied(path, to, *options):
    execute([driver("ilfcopy"), str(path), str(to), *options], check=True, env=environment())
    return to


def contents(path):
    """Attributes of lamps and all pixels of all parts, as numbers."""
    import OpenEXR
    parts = OpenEXR.File(str(path), separate_channels=True).parts
    head = {k: list(v) if "ilf:" in k and "version" not in k and "polar" not in k else v
            for k, v in parts[0].header.items() if k.startswith("ilf:") and k != "ilf:polarValid"}
    return head, {(p.name(), c): np.asarray(p.channels[c].pixels, float) for p in parts for c in p.channels}


def full(rng, half=False):
    m = masks_of(rng)
    f = lit(rng, lamps_of(rng, [m["layer"], m["gate"]]) * 3, half=half)
    for k, l in enumerate(f.lamps):
        l.seen = rng.uniform(-1, 2, (2, 3)) if k != 5 else None
    f.lamps[0].masks = [m[k] for k in ("stack", "ball", "foot")]
    return f


@pytest.mark.parametrize("options", [(), ("--interleave",), ("-c", "zip"), ("-c", "rle"), ("-c", "zips"), ("-c", "piz"), ("-c", "pxr24")])
def test_written_it_is_the_same(tmp_path, options):
    path = write_ilf(tmp_path / "a.ilf.exr", full(np.random.default_rng(2), half=True))
    new = copied(path, tmp_path / "b.ilf.exr", *options)
    (head, pixels), (head2, pixels2) = contents(path), contents(new)
    assert head == head2
    for key, v in pixels.items():
        if key[0] == "probes" and "pxr24" in options:
            continue                                                   # which loses bits of floats
        assert np.array_equal(pixels2.pop(key), v), key
    assert {k[0] for k in pixels2} <= {"interleaved", "probes"}
    assert copied(new, tmp_path / "c.ilf.exr", *options).read_bytes() == new.read_bytes()
    assert "interleaved   yes" in run("ilfinfo", "--header", new).text or "--interleave" not in options
    if "pxr24" not in options:
        rays = rays_at(RNG, full(np.random.default_rng(2)))
        assert np.array_equal(traced(new, *rays), traced(path, *rays))


def test_pictures_are_halves_where_halves_hold_them(tmp_path):
    import OpenEXR
    f = lit(RNG, [Lamp("sphere", C, (1, 1, 1), radius=.1, masks=[
        Mask("foot", np.full((2, 2), v, np.float32), link=1) for v in (.1, 7e4)])])
    new = copied(write_ilf(tmp_path / "a.ilf.exr", f), tmp_path / "b.ilf.exr", "--type", "half")
    pixels = {p.name(): p.channels.get("Y") for p in OpenEXR.File(str(new), separate_channels=True).parts}
    assert pixels["mask.1"].pixels.dtype == np.float16 and pixels["mask.2"].pixels.dtype == np.float32
    assert pixels["mask.2"].pixels[0, 0] == np.float32(7e4)


def test_other_programs_compress_them_in_other_ways(tmp_path):
    import OpenEXR
    f = full(np.random.default_rng(4))
    path = write_ilf(tmp_path / "a.ilf.exr", f)
    rays = rays_at(RNG, f)
    for name in ("NO", "RLE", "ZIPS", "PIZ"):
        parts = OpenEXR.File(str(path), separate_channels=True).parts
        for p in parts[1:]:
            p.header["compression"] = getattr(OpenEXR, name + "_COMPRESSION")
        OpenEXR.File([parts[0], *reversed(parts[1:])]).write(str(tmp_path / "b.ilf.exr"))   # found by name, not by place
        assert np.array_equal(traced(tmp_path / "b.ilf.exr", *rays), traced(path, *rays)), name


def digest(path):
    return execute([driver("ilfcopy"), "--digest", str(path)], check=True, env=environment(), text=True, capture_output=True).stdout


def test_the_digest_counts_lamps(tmp_path):
    def of(change=lambda f: None, *options):
        f = full(np.random.default_rng(6), half=True)
        for l in f.lamps:
            for m in l.masks:
                m.grid = None if m.grid is None else m.grid.astype(np.float16)
        change(f)
        path = write_ilf(tmp_path / "a.ilf.exr", f, half=True)
        return digest(copied(path, tmp_path / "b.ilf.exr", *options) if options else path)

    def nudge(f):
        g = f.lamps[0].masks[0].grid.copy()
        g[2, 3, 4] += .01
        f.lamps[0].masks[0].grid = g

    same = of()
    assert same == of(lambda f: None, "-c", "zip") == of(lambda f: None, "--interleave") == of(lambda f: None, "--type", "float")

    def unsure(f):
        f.lamps[1].errors, f.lamps[1].seen = np.array([.5, 0, 0, 0]), None
    assert same == of(unsure)
    changes = [nudge, lambda f: f.lamps.pop(), lambda f: f.lamps[2].masks.pop(), lambda f: setattr(f.lamps[3], "far", 1)]
    changes += [lambda f, k=k: f.lamps[1].rgb.__setitem__(k, f.lamps[1].rgb[k] * 1.001) for k in range(3)]
    changes += [lambda f: f.lamps[0].c.__setitem__(2, 2.001), lambda f: setattr(f.lamps[1].masks[1], "beta", .401),
                lambda f: setattr(f.lamps[1].masks[0], "adds", 1), lambda f: setattr(f.lamps[1].masks[0], "x0", -2.01)]
    others = [of(c) for c in changes]
    assert same not in others and len(set(others)) == len(others)


def test_ilfinfo_lists_them(tmp_path):
    f = full(np.random.default_rng(2))
    f.lamps[0].masks.append(masks_of(RNG)["beam"])
    text = run("ilfinfo", "--header", write_ilf(tmp_path / "a.ilf.exr", f)).text
    assert "incident light field, version 2" in text and "lamps         12" in text
    assert "sphere of radius 0.45 at 0.3 0.4 2\n" in text and "rectangle of 1 x 0.7 at -1 0.2 1.7\n" in text
    for words in ("a sheet ", "outline of a profile spotlight", "as of twigs", "a beam, half as strong", "a ball of radius 0.3 at 0.3 0.5 1"):
        assert words in text, words
    L = 179 * f.lamps[0].rgb @ [.265, .67, .065]
    line = next(x for x in text.splitlines() if "cd/m^2" in x)
    assert f"{L:.4g} cd/m^2" in line
    cd = float(line.split("cd/m^2, ")[1].split(" cd")[0])
    eye = np.array([.5, .4, 0])
    d = unit(C - eye)[None]
    assert cd == pytest.approx(L * np.pi * .45 ** 2 * f.lamps[0].masks[-1].passed(C, eye[None], d)[0], rel=.03)


# ---- broken ones ---------------------------------------------------------------------------------------

def refused(path, *words):
    r = run("ilfinfo", "--header", path, code=1)
    assert len(r.err.splitlines()) == 1 and not r.text, r.err
    assert str(path) in r.err and "found" in r.err and all(w in r.err for w in words), r.err


def row_of(kind):
    if kind in SHAPES:
        l = next(l for l in lamps_of(np.random.default_rng(1), []) if l.shape == kind)
        return l.row()
    return masks_of(np.random.default_rng(1))[kind].row()


def resized(data, name, kind, old, new):
    head = name + b"\0" + kind + b"\0"
    before = head + struct.pack("<i", len(old)) + old
    assert data.count(before) == 1
    return data.replace(before, head + struct.pack("<i", len(new)) + new)


def broken(path, good, rows):
    """The file with other rows of lamps or masks, in their places; what is longer or shorter, the comments make up for."""
    import ilf_util
    room = 30000
    write_ilf(path, good, extra={"comments": "x" * room})
    kept, data, less = ilf_util.lamp_attributes(good.lamps), path.read_bytes(), 0
    for name, row in rows.items():
        old, new = kept[name].tobytes(), np.asarray(row, np.float32).tobytes()
        data = resized(data, name.encode(), b"floatvector", old, new)
        less += len(new) - len(old)
    path.write_bytes(resized(data, b"comments", b"string", b"x" * room, b"x" * (room - less)))


@pytest.mark.parametrize("kind", SHAPES + KINDS)
def test_every_number_is_checked(tmp_path, kind):
    rng = np.random.default_rng(1)
    if kind in SHAPES:
        f = lit(rng, [l for l in lamps_of(rng, []) if l.shape == kind])
        which, good, whole = "ilf:lamps", f.lamps[0].row(), {0, 1, 15}
    else:
        f = lit(rng, [Lamp("sphere", C, (1, 1, 1), radius=.1, masks=[masks_of(rng)[kind]])])
        which, good, whole = "ilf:masks", f.lamps[0].masks[0].row(), {0, 1, 2, 13, 14, 15}
    path = write_ilf(tmp_path / "l.ilf.exr", f)
    run("ilfinfo", "--header", path)
    data = path.read_bytes()
    assert data.count(good.tobytes()) == 1
    for k in range(24):
        for bad in ((np.nan, 1e31, -1e31, np.inf)[k % 4], *((.5, 7777) if k in whole else ()), *(() if used(kind, k) else (.25,))):
            row = good.copy()
            row[k] = bad
            path.write_bytes(data.replace(good.tobytes(), row.tobytes()))
            refused(path, which + ": ", *(() if used(kind, k) else ("not used",)))


def used(kind, k):
    """Does section 1.8 or 1.9 give this number a meaning here?"""
    if kind in SHAPES:
        return k < 5 or 12 <= k < 20 or (5 <= k < 8 and kind != "sphere") or (8 <= k < 11 and kind in ("rectangle", "disc")) \
            or (k == 11 and kind in ("sphere", "tube"))
    coefs = {"gate": 6, "beam": 5, "stack": 2, "ball": 4}
    planes = {"layer": 3, "stack": 2}
    picture = kind in ("layer", "foot", "stack")
    return k in (0, 2) or (k == 1 and kind in ("layer", "foot")) or (k == 3 and kind in ("foot", "gate")) \
        or 4 <= k < 4 + planes.get(kind, 0) or 7 <= k < 7 + coefs.get(kind, 0) or (k in (13, 14, 16, 17, 18, 19) and picture) \
        or (k == 15 and kind == "stack")


RANGES = [("sphere", {11: 0}), ("sphere", {11: -1}), ("rectangle", {5: 0, 6: 0, 7: 0}), ("disc", {8: 0, 9: 0, 10: 0}),
          ("tube", {5: 0, 6: 0, 7: 0}), ("rectangle", {5: 1, 6: 0, 7: 0, 8: 1, 9: 1, 10: 0}), ("sphere", {16: -1}),
          ("beam", {7: 0, 8: 0, 9: -1.001}), ("beam", {10: -1}), ("beam", {11: -.1}), ("beam", {11: 1.1e6}), ("beam", {10: 2e5}),
          ("stack", {4: 0}), ("stack", {5: -1}), ("stack", {8: 0}), ("ball", {10: 0}), ("layer", {18: 0}), ("layer", {19: -1}),
          ("foot", {13: 0}), ("foot", {14: 4097}), ("stack", {15: 257})]


@pytest.mark.parametrize("kind, numbers", RANGES)
def test_ranges(tmp_path, kind, numbers):
    rng = np.random.default_rng(1)
    lamp = kind in SHAPES
    f = lit(rng, [l for l in lamps_of(rng, []) if l.shape == kind] if lamp
            else [Lamp("sphere", C, (1, 1, 1), radius=.1, masks=[masks_of(rng)[kind]])])
    row = (f.lamps[0] if lamp else f.lamps[0].masks[0]).row()
    for k, v in numbers.items():
        row[k] = v
    broken(tmp_path / "l.ilf.exr", f, {"ilf:lamps" if lamp else "ilf:masks": row})
    refused(tmp_path / "l.ilf.exr", "ilf:lamps: lamp 1" if lamp else "ilf:masks: mask 1")


def one_picture(rng=RNG, **how):
    return lit(rng, [Lamp("sphere", C, (1, 1, 1), radius=.1, masks=[Mask("foot", grid(4, 5), **how)], seen=np.ones((2, 3)))])


@pytest.mark.parametrize("what, words", [
    ({"ilf:lamps": np.zeros(0)}, "found 0 numbers"), ({"ilf:lamps": np.zeros(23)}, "found 23 numbers"),
    ({"ilf:lamps": np.zeros(257 * 24)}, "1 to 256 rows"), ({"ilf:masks": np.zeros(48)}, "expected 1 to 1 rows"),
    ({"ilf:masks": np.zeros(0)}, "found 0 numbers"), ({"ilf:lamps": np.zeros(24), "ilf:masks": np.zeros(24)}, "radius: expected")])
def test_rows_that_are_too_many_or_too_few(tmp_path, what, words):
    broken(tmp_path / "l.ilf.exr", one_picture(), what)
    refused(tmp_path / "l.ilf.exr", words)


def with_parts(path, f, change):
    """A file whose further parts a function of the list of them changed."""
    import OpenEXR
    write_ilf(path, f)
    parts = list(OpenEXR.File(str(path), separate_channels=True).parts)
    OpenEXR.File(change(parts)).write(str(path))
    return path


def replaced(number, channels, name=None, **header):
    import OpenEXR

    def change(parts):
        old = parts[number]
        h, w = next(iter(channels.values())).shape
        head = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "displayWindow": old.header["displayWindow"],
                "dataWindow": (np.array([0, 0], np.int32), np.array([w - 1, h - 1], np.int32))} | header
        parts[number] = OpenEXR.Part(head, channels, name or old.name())
        return parts
    return change


def tiled():
    import OpenEXR
    t = OpenEXR.TileDescription()
    t.xSize, t.ySize = 5, 4
    return {"type": OpenEXR.tiledimage, "tiles": t}


def nan_at(shape):
    g = np.ones(shape, np.float32)
    g[1, 2] = np.nan
    return g


def lossy():
    import OpenEXR
    return {"compression": OpenEXR.B44_COMPRESSION}


Y, SIX = np.ones((4, 5), np.float32), np.ones((2, 3), np.float32)
PARTS = {
    "missing": (lambda p: [p[0], p[2]], "mask.1: expected a part of this name, found none"),
    "another name": (lambda p: replaced(1, {"Y": Y}, "mask.2")(p), "mask.1: expected a part"),
    "too wide": (lambda p: replaced(1, {"Y": np.ones((4, 6), np.float32)})(p), "mask.1: dataWindow"),
    "too high": (lambda p: replaced(1, {"Y": np.ones((5, 5), np.float32)})(p), "mask.1: dataWindow"),
    "tiles": (lambda p: replaced(1, {"Y": Y}, **tiled())(p), "mask.1: expected scan lines"),
    "another channel": (lambda p: replaced(1, {"Z": Y})(p), "mask.1: channels: expected Y alone, found Z"),
    "two channels": (lambda p: replaced(1, {"Y": Y, "Z": Y})(p), "found Y and others"),
    "whole numbers": (lambda p: replaced(1, {"Y": Y.astype(np.uint32)})(p), "mask.1: channels: expected HALF or FLOAT"),
    "lossy": (lambda p: replaced(1, {"Y": Y.astype(np.float16)}, **lossy())(p), "mask.1: compression"),
    "not finite": (lambda p: replaced(1, {"Y": nan_at((4, 5))})(p), "mask.1: sample (2,1): expected a finite value, found nan"),
    "too bright": (lambda p: replaced(1, {"Y": Y * 5e6})(p), "let through at most"),
    "measured elsewhere": (lambda p: replaced(2, {"lamp.1": np.ones((3, 2), np.float32)})(p), "measured: dataWindow"),
    "measured of none": (lambda p: replaced(2, {"lamp.2": SIX})(p), "expected lamp.1 to lamp.1, found lamp.2"),
    "measured twice": (lambda p: replaced(2, {"lamp.1": SIX, "lamp.2": SIX})(p), "measured: expected channels of at most 1 lamps"),
    "measured nan": (lambda p: replaced(2, {"lamp.1": nan_at((2, 3))})(p), "measured: lamp.1: probe number 5: expected a finite"),
}


@pytest.mark.parametrize("how", PARTS)
def test_parts_that_are_not_what_they_should_be(tmp_path, how):
    change, words = PARTS[how]
    refused(with_parts(tmp_path / "l.ilf.exr", one_picture(), change), words)


def test_pictures_have_a_bound_before_memory_is_taken(tmp_path):
    f = lit(RNG, [Lamp("sphere", C, (1, 1, 1), radius=.1, masks=[Mask("stack", np.zeros((1, 1, 1)), plane=(1, 1.5), coef=(1, 1))])])
    row = f.lamps[0].masks[0].row()
    row[13:16] = 4096, 4096, 256
    broken(tmp_path / "l.ilf.exr", f, {"ilf:masks": row})
    refused(tmp_path / "l.ilf.exr", "at most 67108864 samples")


def test_files_cut_off(tmp_path):
    data = write_ilf(tmp_path / "a.ilf.exr", full(np.random.default_rng(2))).read_bytes()
    for n in np.linspace(len(data) * .3, len(data) - 1, 25).astype(int):
        (tmp_path / "b.ilf.exr").write_bytes(data[:n])
        refused(tmp_path / "b.ilf.exr")


def test_lamps_in_version_1_are_not_looked_at(tmp_path):
    f = one_picture()
    path = write_ilf(tmp_path / "l.ilf.exr", f)
    data = path.read_bytes()
    at = data.index(b"ilf:version\0int\0") + 16 + 4
    path.write_bytes(data[:at] + struct.pack("<i", 1) + data[at + 4:])
    text = run("ilfinfo", "--header", path).text
    assert "version 1\n" in text and "taken out" not in text


SMALL = {}


def small(tmp):
    if not SMALL:
        SMALL["data"] = write_ilf(tmp / "small.ilf.exr", one_picture()).read_bytes()
    return SMALL["data"]


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(changes=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=4))
def test_any_changed_byte_is_refused_in_one_line_or_read(tmp_path_factory, changes):
    tmp = tmp_path_factory.getbasetemp()
    data = bytearray(small(tmp))
    for where, value in changes:
        data[int(where * (len(data) - 1))] = value
    path = tmp / "changed.ilf.exr"
    path.write_bytes(data)
    r = execute([driver("ilfcopy"), "--digest", str(path)], env=environment(), capture_output=True, text=True)
    assert r.returncode in (0, 1) and len(r.stderr.splitlines()) == r.returncode
