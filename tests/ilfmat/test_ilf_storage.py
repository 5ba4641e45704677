"""Where and how a light field is stored must not change a picture.

The same texels in every compression, type of channels, order of tiles, with and without the interleaved part, in files that can
be mapped and in files that can't: the same bits from ilftrace, ilfinfo and the renderers.  What a lossy
compression holds is what OpenEXR's own library reads from it, stored again without loss.
"""
import os
import re
import subprocess

import numpy as np
import pytest

from conftest import BIN, BUILD, driver, environment, one_line_error, run
from ilf_util import ILF, random_directions, random_ilf, rays_text, read_mosaic, unit, unmosaic, write_ilf
from process import execute, Process

LOSSLESS = "none rle zips zip piz pxr24".split()     # pxr24 too: the values are halves
LOSSY = "b44 b44a dwaa dwab".split()
TYPES = ["hhh", "fff", "hff", "fhf", "hhf"]
# texels of a probe: shorter and longer than a page, no multiple of one; heights that OpenEXR's B44 is known for
SIZES = [(33, 47), (64, 33), (21, 34), (7, 5)]


def stored(path, f, types="hhh", compression="none", extra=None, parts=()):
    """As write_ilf, each channel of its own type (h: half, f: float)."""
    import OpenEXR
    tiles = OpenEXR.TileDescription()
    tiles.xSize, tiles.ySize = f.n_theta, f.n_phi
    name = "NO" if compression == "none" else compression.upper()
    header = {"type": OpenEXR.tiledimage, "tiles": tiles, "compression": getattr(OpenEXR, name + "_COMPRESSION"),
              "ilf:version": 1, "ilf:polarMax": f.polar_max, "ilf:origin": f.origin.astype(np.float32),
              "ilf:U": f.U.astype(np.float32), "ilf:V": f.V.astype(np.float32), **(extra or {})}
    image = f.mosaic()
    channels = {c: np.ascontiguousarray(image[..., k].astype({"h": np.float16, "f": np.float32}[types[k]])) for k, c in enumerate("RGB")}
    if parts:
        OpenEXR.File([OpenEXR.Part(header, channels, "probes"), *parts]).write(str(path))
    else:
        OpenEXR.File(header, channels).write(str(path))
    return path


def window(f):
    """All parts of a file share it."""
    return np.zeros(2, np.int32), np.array([f.n_u * f.n_theta - 1, f.n_v * f.n_phi - 1], np.int32)


def interleaved(path, to):
    """With the second part that ilfpack --interleave writes."""
    execute([driver("ilfcopy"), str(path), str(to), "--interleave"], check=True, env=environment())
    return to


@pytest.fixture(scope="module")
def unmappable(tmp_path_factory):
    """Environment in which no regular file can be mapped for sharing, as on some file systems."""
    if "san" in BUILD.parts:
        pytest.skip("a preloaded library and the sanitizers don't go together")
    folder = tmp_path_factory.mktemp("preload")
    (folder / "nomap.c").write_text("""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <sys/mman.h>
void *mmap(void *at, size_t n, int prot, int flags, int fd, off_t from)
{
    static void *(*real)(void *, size_t, int, int, int, off_t);
    if (fd >= 0 && (flags & MAP_SHARED)) { errno = ENODEV; return MAP_FAILED; }
    if (!real) *(void **)&real = dlsym(RTLD_NEXT, "mmap");
    return real(at, n, prot, flags, fd, from);
}
void *mmap64(void *at, size_t n, int prot, int flags, int fd, off_t from) { return mmap(at, n, prot, flags, fd, from); }
""")
    execute(["cc", "-shared", "-fPIC", "-O1", "-o", str(folder / "nomap.so"), str(folder / "nomap.c"), "-ldl"], check=True)
    return environment(LD_PRELOAD=str(folder / "nomap.so"))


def lamp_field(rng, size, n=(4, 3)):
    """Light over two decades and two lamps, every value a half."""
    f = random_ilf(rng, *n, *size, decades=2, half=True, plane=((-1, -1, 0), (2, 0, 0), (0, 2, 0)))
    f.probes[:, :, size[1] // 4, size[0] // 3:size[0] // 3 + 2] = (300, 250, 200)
    f.probes[1, 2, size[1] // 2, 1] = (90, 1000, 50)
    return f


SCENE = """void ilf room
1 {file}
0
0

room bubble b
0
0
4 0 0 0 8

void plastic w
0
0
5 .6 .5 .4 0 0

w polygon floor
0
0
12 -3 -3 0 3 -3 0 3 3 0 -3 3 0

w sphere ball
0
0
4 .3 .1 .6 .4
"""


class Reading:
    """What all programs make of one file, as bytes."""

    def __init__(self, folder, rng):
        self.folder = folder
        n = 200
        o = rng.uniform(-1, 1, (n, 3))
        self.rays = rays_text(o, random_directions(rng, n), rng.uniform(-3, 3, (n, 3)))
        o = np.tile([0.2, -3, 2.5], (30, 1))
        to = np.repeat([[0.13, -0.21, 0], [-0.71, 0.4, 0], [0.3, 0.1, 1.0]], 10, 0)     # few places: each needs a map of its own
        self.views = np.concatenate([o, unit(to - o)], 1).astype("<f4").tobytes()
        up = np.concatenate([np.tile([0.1, 0.2, 0.1], (60, 1)), random_directions(rng, 60)], 1)
        self.ups = up.astype("<f4").tobytes()

    def __call__(self, path, env=None, more=()):
        (self.folder / "s.rad").write_text(SCENE.format(file=path.name))
        octree = run("oconv", "s.rad", cwd=self.folder).out
        (self.folder / "s.oct").write_bytes(octree)
        info = run("ilfinfo", path, env=env).text
        out = {"ilftrace": run("ilftrace", path, stdin=self.rays, env=env).out,
               "ilfinfo": "\n".join(x for x in info.splitlines() if x.startswith(("radiance", "brightest", "grid", "polar", "pitch")))}
        common = dict(cwd=self.folder, env=env)
        out["-di 0"] = run("rtrace", "-h", "-ff", "-di", "0", "s.oct", stdin=self.ups, **common).out
        out["-di 16"] = run("rtrace", "-h", "-ff", "-u-", "-ab", "1", "-aa", "0", "-ad", "16", "s.oct", stdin=self.views, **common).out
        for program in more:
            if program == "-n 2":
                out[program] = run("rtrace", "-h", "-ff", "-di", "0", "-n", "2", "s.oct", stdin=self.ups, **common).out
            else:
                picture = run("rpict", "-x", "12", "-y", "12", "-vh", "4", "-vv", "4", "-vp", ".2", "-3", "2.5", "-vd", "0", ".8", "-.6", "-ab", "1", "s.oct", **common).out
                out[program] = picture[picture.index(b"\n\n"):]
        assert "nan" not in str(out).lower()
        return out


def assert_identical(found, expected, what):
    for key, value in found.items():
        assert value == expected[key], f"{what}: {key} differs"


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_lossless(tmp_path, size):
    """Every compression and type of channels, and the interleaved part."""
    rng = np.random.default_rng(41)
    f, look = lamp_field(rng, size), Reading(tmp_path, rng)
    first = look(stored(tmp_path / "first.ilf.exr", f))
    assert np.frombuffer(first["-di 16"], "<f4").max() > 0 and np.frombuffer(first["-di 0"], "<f4").max() > 0
    full = size == SIZES[0]
    for types in TYPES if full else TYPES[:2]:
        for compression in LOSSLESS if full and types in ("hhh", "fff", "hff") else ["none", "zip"]:
            path = stored(tmp_path / f"{types}_{compression}.ilf.exr", f, types, compression)
            assert_identical(look(path), first, path.name)
        if types in ("hhh", "fff"):
            path = interleaved(tmp_path / f"{types}_none.ilf.exr", tmp_path / f"{types}_both.ilf.exr")
            assert_identical(look(path), first, path.name)


@pytest.mark.parametrize("size", SIZES[:2], ids=str)
def test_mapped_or_not(tmp_path, size, unmappable):
    rng = np.random.default_rng(42)
    f, look = lamp_field(rng, size), Reading(tmp_path, rng)
    first = look(stored(tmp_path / "first.ilf.exr", f))
    for types in ("hhh", "fff", "hff"):
        for compression in ("none", "zip"):
            path = stored(tmp_path / f"{types}_{compression}.ilf.exr", f, types, compression)
            assert_identical(look(path, unmappable), first, f"{path.name} unmappable")
    assert " 0.0 MB in place" in run("ilfinfo", tmp_path / "hhh_none.ilf.exr", env=unmappable).text
    both = interleaved(tmp_path / "hhh_none.ilf.exr", tmp_path / "both.ilf.exr")
    assert_identical(look(both, unmappable), first, "interleaved, unmappable")


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_lossy(tmp_path, size):
    """What OpenEXR's library reads of a lossy file, stored without loss, gives the bits of the lossy file itself."""
    rng = np.random.default_rng(43)
    f, look = lamp_field(rng, size), Reading(tmp_path, rng)
    f.probes[:, 0] = 0.5                                 # some probes that compress well, some that don't
    f.probes[:, 1] = np.round(f.probes[:, 1, :, :1] * 4) / 4
    for types in TYPES[:3] if size == SIZES[0] else ["hhh"]:
        for compression in LOSSY:
            lossy = stored(tmp_path / "lossy.ilf.exr", f, types, compression)
            g = ILF(unmosaic(read_mosaic(lossy)[1], f.n_u, f.n_v), f.origin, f.U, f.V, f.polar_max)
            again = stored(tmp_path / "again.ilf.exr", g, types)
            assert_identical(look(lossy), look(again), f"{types} {compression}")


@pytest.mark.parametrize("compression", ["pxr24", "dwaa", "b44"])
def test_floats_of_a_lossy_file(tmp_path, compression):
    """Floats that are no halves, probes of noise that no compression makes smaller, and values beyond what a half holds."""
    rng = np.random.default_rng(44)
    f = random_ilf(rng, 3, 2, 33, 33, decades=3, plane=((-1, -1, 0), (2, 0, 0), (0, 2, 0)))
    f.probes[:, 0] = 0.25
    if compression != "dwaa":                            # which makes it infinite
        f.probes[1, 1, :, ::2] *= 1e6
    look = Reading(tmp_path, rng)
    for types in ("fff", "hff" if compression == "dwaa" else "fff"):
        lossy = stored(tmp_path / "lossy.ilf.exr", f, types, compression)
        g = ILF(unmosaic(read_mosaic(lossy)[1], f.n_u, f.n_v), f.origin, f.U, f.V, f.polar_max)
        assert_identical(look(lossy), look(stored(tmp_path / "again.ilf.exr", g, types)), f"{types} {compression}")


def test_infinite_halves_stay_infinite(tmp_path):
    """DWA makes floats beyond a half's range infinite: refused, not taken for 65536."""
    f = random_ilf(np.random.default_rng(45), 2, 1, 32, 32, half=True)
    f.probes[0, 1, 3:9] = 1e7
    for types in ("fff", "fhf"):
        path = stored(tmp_path / "f.ilf.exr", ILF(np.where(f.probes > 60000, 1e7 if types == "fff" else 65504, f.probes)), types, "dwaa")
        if np.isfinite(read_mosaic(path)[1]).all():
            continue
        one_line_error(run("ilfinfo", path, code=1), "ilfinfo", "probe (1,0)", "finite")


def test_tile_order_and_further_parts(tmp_path):
    import OpenEXR
    rng = np.random.default_rng(46)
    f, look = lamp_field(rng, (33, 17)), Reading(tmp_path, rng)
    first = look(stored(tmp_path / "first.ilf.exr", f))
    for order in (OpenEXR.DECREASING_Y, OpenEXR.RANDOM_Y):
        for compression in ("none", "zip", "dwaa"):
            path = stored(tmp_path / "order.ilf.exr", f, compression=compression, extra={"lineOrder": order})
            if compression == "dwaa":
                assert_identical(look(path), look(stored(tmp_path / "up.ilf.exr", f, compression=compression)), f"dwaa, {order}")
            else:
                assert_identical(look(path), first, f"{compression}, {order}")
    note = OpenEXR.Part({"type": OpenEXR.scanlineimage, "displayWindow": window(f)}, {"Y": np.ones((9, 5), np.float32)}, "note")
    for compression in ("none", "zip"):
        assert_identical(look(stored(tmp_path / "parts.ilf.exr", f, compression=compression, parts=[note])), first, f"{compression}, two parts")


def test_several_processes_and_pictures(tmp_path):
    """rtrace's children share the field; rpict's default -di."""
    rng = np.random.default_rng(47)
    f, look = lamp_field(rng, (33, 47)), Reading(tmp_path, rng)
    more = ("-n 2", "rpict")
    first = look(stored(tmp_path / "first.ilf.exr", f), more=more)
    for types, compression in (("fff", "zip"), ("hff", "piz"), ("hhh", "zip")):
        path = stored(tmp_path / "other.ilf.exr", f, types, compression)
        assert_identical(look(path, more=more), first, f"{types} {compression}")
        many = [Process([str(BIN / "ilftrace"), str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment()) for _ in range(3)]
        for p in many:
            assert p.communicate(look.rays.encode())[0] == first["ilftrace"]


def test_probes_looked_up_before_the_sampler_opens(tmp_path):
    """Rays straight at the light have used the field when the sampler, which the floor needs, looks through all of it."""
    rng = np.random.default_rng(48)
    f = lamp_field(rng, (64, 32), (6, 6))
    n = 150
    up = np.concatenate([rng.uniform(-1, 1, (n, 2)), np.full((n, 1), 1.5), np.abs(random_directions(rng, n))], 1)      # over the ball
    to = np.concatenate([rng.uniform(-0.74, -0.69, (n, 2)), np.zeros((n, 1))], 1)
    o = np.tile([0, -3, 2.0], (n, 1))
    # first straight at the light, for which no sampler is needed, then at what it lights, then straight again
    down = np.concatenate([o, unit(to - o)], 1)
    rays = np.concatenate([up, down, up]).astype("<f4").tobytes()
    (tmp_path / "s.rad").write_text(SCENE.format(file="f.ilf.exr"))
    values = {}
    for types, compression in (("fff", "none"), ("fff", "zip"), ("hhh", "rle"), ("hhh", "piz")):
        stored(tmp_path / "f.ilf.exr", f, types, compression)
        (tmp_path / "s.oct").write_bytes(run("oconv", "s.rad", cwd=tmp_path).out)
        values[types, compression] = np.frombuffer(run("rtrace", "-h", "-ff", "-u-", "s.oct", stdin=rays, cwd=tmp_path).out, "<f4").reshape(3, n, 3)
    first = values["fff", "none"]
    assert np.array_equal(first[0], first[2]) and (first[1] > 0).any()
    for key, value in values.items():
        assert np.array_equal(value, first), key


# ---- compressions of other versions of OpenEXR -------------------------------------------------------------

@pytest.mark.parametrize("name, needs", [("htj2k256", "3.4"), ("htj2k32", "3.4"), ("lj2k", "3.5"), ("zstd", "3.5")])
def test_newer_compression_is_named(tmp_path, name, needs):
    f = random_ilf(np.random.default_rng(49), 2, 2, 32, 32, half=True)
    path = stored(tmp_path / "new.ilf.exr", f, compression=name)
    for args in (["ilfinfo"], ["ilfinfo", "--header"], ["ilftrace"]):
        r = run(*args, path, stdin="0 0 0 0 0 1 0 0 1\n", code=None)
        if r.code == 0:                                  # this machine's OpenEXR is that new
            assert args == ["ilftrace"] or re.search(rf"compression {name}\n", r.text)
            continue
        one_line_error(r, args[0], "new.ilf.exr", "compression", name, f"OpenEXR {needs}")
        assert r.out == b""


def test_unknown_compression_is_numbered(tmp_path):
    from ilf_util import edited
    data = stored(tmp_path / "new.ilf.exr", random_ilf(np.random.default_rng(50), 2, 1, 8, 4)).read_bytes()
    (tmp_path / "new.ilf.exr").write_bytes(edited(data, "compression", value=b"\x63"))
    one_line_error(run("ilfinfo", tmp_path / "new.ilf.exr", code=1), "ilfinfo", "compression", "99")


def test_newer_compression_of_a_further_part_does_not_matter(tmp_path):
    """Further parts are derived data: what this OpenEXR can't read of them is not needed."""
    import OpenEXR
    f = random_ilf(np.random.default_rng(51), 2, 2, 16, 8, half=True)
    note = OpenEXR.Part({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZSTD_COMPRESSION, "displayWindow": window(f)},
                        {"Y": np.ones((9, 5), np.float32)}, "note")
    path = stored(tmp_path / "new.ilf.exr", f, parts=[note])
    assert run("ilftrace", path, stdin="0 0 0 0 0 1 0 0 1\n").out == \
        run("ilftrace", stored(tmp_path / "old.ilf.exr", f), stdin="0 0 0 0 0 1 0 0 1\n").out


def test_picture_of_b44_is_read_right(tmp_path):
    """The known heights, tile by tile: libilf's reader against OpenEXR's."""
    rng = np.random.default_rng(52)
    for size in ((109, 65), (8, 33), (9, 34), (1, 1), (3, 2), (5, 97)):
        f = random_ilf(rng, 2, 2, *size, decades=3, half=True)
        for types in ("hhh", "fff", "hff"):
            for compression in ("b44", "b44a"):
                path = stored(tmp_path / "b.ilf.exr", f, types, compression)
                execute([driver("ilfcopy"), str(path), str(tmp_path / "c.ilf.exr")], check=True, env=environment())
                assert np.array_equal(read_mosaic(path)[1], read_mosaic(tmp_path / "c.ilf.exr")[1]), (size, types, compression)
