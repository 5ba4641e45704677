"""The Python package `ilf` against the format's own numpy (ilf_util), which shares nothing with libilf, and against the programs."""
import dataclasses
import os
import re
import shutil
import sys
import threading

import numpy as np
import pytest

from conftest import TOP, environment, run
from ilf_util import ILF, Lamp, Mask, assert_same, random_directions, random_ilf, read_mosaic, unmosaic, write_ilf
from process import execute

# the plain build's library, with sanitizers in the other one, too
os.environ.pop("ILF_LIBRARY", None)
sys.path.append(str(TOP / "python/src"))
import ilf  # noqa: E402

RNG = np.random.default_rng(22)


def rays(rng, n, field):
    """Origins above the plane, directions all round, hits further on along each."""
    o = field.origin + rng.normal(size=(n, 3)) * .3
    d = random_directions(rng, n)
    return o, d, o + d * rng.uniform(1, 5, (n, 1))


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A light field of the tests' own, and its file, uncompressed halves."""
    field = random_ilf(np.random.default_rng(1), 3, 4, 12, 7, half=True, polar_valid=1.3)
    path = tmp_path_factory.mktemp("python") / "own.ilf.exr"
    return field, write_ilf(path, field, half=True, extra={"comments": "of the tests", "owner": "nobody"})


@pytest.fixture(scope="module")
def lit(tmp_path_factory):
    """The same with lamps."""
    rng = np.random.default_rng(2)
    lamps = [Lamp("sphere", (.2, .1, 1.5), (9, 8, 7), radius=.5, errors=(.1, .2, .3, .4), seen=rng.uniform(size=(2, 3)),
                  masks=[Mask("layer", rng.uniform(size=(4, 5)), plane=(.7, .1, 0), at=(-1, -1), step=(.5, .6)),
                         Mask("gate", beta=.3, coef=(1, 2, 0, 0, 0, -1)), Mask("beam", coef=(0, 0, -1, 2, .5), adds=1)]),
             Lamp("rectangle", (-1, .3, 2), (1, 2, 30), a=(.7, 0, 0), b=(0, .6, .1),
                  masks=[Mask("stack", rng.uniform(size=(3, 4, 5)), plane=(.2, 1), coef=(.5, .1), at=(-1, -1), step=(.5, .6))]),
             Lamp("disc", (1, 1, 2), (3, 3, 3), a=(.5, 0, 0), b=(0, .8, 0), far=1, masks=[Mask("ball", coef=(.5, .5, .4, .2))]),
             Lamp("tube", (0, -1, 2), (5, 5, 5), a=(.4, .1, 0), radius=.3, masks=[Mask("foot", rng.normal(size=(3, 3)), link=1, beta=-1)])]
    field = random_ilf(rng, 3, 2, 10, 6)
    field.lamps = lamps
    return field, write_ilf(tmp_path_factory.mktemp("python") / "lit.ilf.exr", field)


# ---- what is in a file ---------------------------------------------------------------------------------------

def test_header(own):
    field, path = own
    with ilf.open(path) as f:
        i = f.info
        assert (i.version, i.n_u, i.n_v, i.n_theta, i.n_phi, i.dtype, i.compression) == (1, 3, 4, 12, 7, np.float16, "none")
        assert (i.comments, i.owner, i.cap_date, i.white_luminance, i.file_bytes) == ("of the tests", "nobody", None, None, path.stat().st_size)
        assert i.polar_max == field.polar_max and i.polar_valid == field.polar_valid
        assert (i.origin == field.origin).all() and (i.U == field.U).all() and (i.V == field.V).all() and not i.interleaved
        assert f.frame.axes == pytest.approx(field.frame(), abs=1e-12) and f.frame.U == pytest.approx(field.U)
        assert f.nodes() == pytest.approx(np.array([[field.node(np.array(i), np.array(j)) for i in range(3)] for j in range(4)]))
        assert f.directions() == pytest.approx(field.texel_directions(), abs=1e-12)
        assert f.solid_angles().sum() == pytest.approx(2 * np.pi)
        assert f.frame.to_field(f.frame.to_scene([[1, 2, 3]])) == pytest.approx(np.array([[1, 2, 3]]))
        assert f.lamps == () and "3x4 probes" in repr(f)
        assert f"{f.digest():x}" and f.usage().probes >= 0


@pytest.mark.parametrize("compression, half, in_file", [("none", True, True), ("none", False, True), ("zip", True, False), ("piz", False, False)])
def test_probes_are_the_texels_and_views_where_it_says_so(tmp_path, compression, half, in_file):
    field = random_ilf(RNG, 3, 2, 9, 5, half=half)
    path = write_ilf(tmp_path / "f.ilf.exr", field, half=half, compression=compression)
    with ilf.open(path) as f:
        one, every = f.probe(2, 1), f.probes()
        assert one.dtype == every.dtype == (np.float16 if half else np.float32)
        assert (one == field.probes[1, 2]).all() and (every == field.probes).all() and (f.probes(copy=True) == field.probes).all()
        assert not one.flags.owndata and not one.flags.writeable and every.flags.owndata is not in_file and every.flags.writeable is not in_file
        assert f.probes(copy=True).flags.writeable
        u = f.usage()
        assert u.probes == 6 and (u.decoded_bytes == 0) is in_file and (u.mapped_bytes > 0) is in_file
        if not in_file:
            with pytest.raises(ilf.ArgumentError, match="need a copy"):
                f.probes(copy=False)
    assert (one == field.probes[1, 2]).all() and (every == field.probes).all()     # closed, and still there
    with pytest.raises(ilf.Error, match="found it closed"):
        f.probe(0, 0)


def test_tiles_in_any_order_are_one_copy(tmp_path):
    import OpenEXR
    field = random_ilf(RNG, 3, 3, 8, 4)
    path = write_ilf(tmp_path / "f.ilf.exr", field, line_order=OpenEXR.DECREASING_Y)
    with ilf.open(path) as f:
        assert (f.probes() == field.probes).all() and (f.probe(1, 2) == field.probes[2, 1]).all()


def test_lamps(lit):
    field, path = lit
    with ilf.open(path) as f:
        lamps = f.lamps
        assert f.info.version == 2 and [x.shape for x in lamps] == ["sphere", "rectangle", "disc", "tube"]
        assert [x.far for x in lamps] == [False, False, True, False]
        for got, want in zip(lamps, field.lamps, strict=True):
            assert got.centre == pytest.approx(want.c) and got.rgb == pytest.approx(want.rgb) and got.radius == pytest.approx(want.radius)
            assert got.a == pytest.approx(want.a) and got.b == pytest.approx(want.b)
            assert [getattr(got, f"error_{k}") for k in ("masks", "interpolation", "position", "radiance")] == pytest.approx(list(want.errors))
            assert (got.seen is None) is (want.seen is None) and (got.seen is None or (got.seen == want.seen.astype(np.float32)).all())
            for m, w in zip(got.masks, want.masks, strict=True):
                assert (m.kind, m.adds, m.link) == (w.kind, bool(w.adds), ["value", "logistic"][w.link]) and m.beta == pytest.approx(w.beta)
                assert m.plane[:len(w.plane)] == pytest.approx(w.plane) and m.coef[:len(w.coef)] == pytest.approx(w.coef)
                assert (m.picture is None) is (w.grid is None)
                if w.grid is not None:
                    assert (m.picture == w.grid).all() and m.start == pytest.approx([w.x0, w.y0]) and m.step == pytest.approx([w.dx, w.dy])


# ---- lookups -------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("depth", [True, False])
@pytest.mark.parametrize("threads", [1, 3])
def test_eval_is_the_formats(own, lit, depth, threads):
    for field, path in (own, lit):
        o, d, h = rays(np.random.default_rng(5), 5000, field)
        h[::7] = np.inf
        with ilf.open(path) as f:
            assert_same(f.eval(o, d, h, depth=depth, threads=threads), field.eval(o, d, h, depth=depth))
            assert_same(f.eval(o, d, threads=threads), field.eval(o, d))


def test_eval_does_not_hang_on_threads_or_on_how_rays_are_given(own):
    field, path = own
    o, d, h = rays(np.random.default_rng(6), 30000, field)
    with ilf.open(path) as f:
        one = f.eval(o, d, h, threads=1)
        assert one.dtype == np.float32 and all((f.eval(o, d, h, threads=n) == one).all() for n in (None, 2, 5))
        cube = f.eval(*(a.reshape(100, 300, 3)[:, ::-1] for a in (o, d, h)))
        assert (cube[:, ::-1].reshape(-1, 3) == one).all()
        out = np.empty_like(one)
        assert f.eval(o, d, h, out=out) is out and (out == one).all()
        fan = f.eval(o[0], d)                                        # one origin for all
        assert (fan == f.eval(np.broadcast_to(o[0], d.shape), d)).all()
        grid = f.eval(o[:4, None], d[None, :50], threads=2)
        assert grid.shape == (4, 50, 3) and (grid[3] == f.eval(o[3], d[:50])).all()
        assert f.eval(o[0], d[0]).shape == (3,) and f.eval(o[:0], d[:0]).shape == (0, 3)
        assert (f.eval(o[:50].astype(np.float32), d[:50].tolist()) == f.eval(o[:50].astype(np.float32).astype(float), d[:50])).all()


def test_eval_in_another_frame(own, lit):
    for field, path in (own, lit):
        turned = ilf.Frame.of((1, 2, 3), np.array([0, 2., 0]) * field.length_u(), np.array([0, 0, 2.]) * np.linalg.norm(field.V), normal=(-1, 0, 0))
        assert (turned.n == [-1, 0, 0]).all()
        placed = field.placed(turned.origin, turned.U, turned.V, N=(-1, 0, 0))
        o, d, h = rays(np.random.default_rng(7), 2000, placed)
        with ilf.open(path) as f:
            assert_same(f.eval(o, d, h, frame=turned), placed.eval(o, d, h))
            if f.lamps:
                with pytest.raises(ilf.ArgumentError):
                    f.eval(o, d, h, frame=ilf.Frame.of((0, 0, 0), turned.U, turned.V * 1.5))


def test_eval_is_what_ilftrace_prints(own):
    field, path = own
    o, d, h = rays(np.random.default_rng(8), 50, field)
    text = "".join(" ".join(f"{x:.17g}" for x in r) + "\n" for r in np.concatenate([o, d, h], 1))
    told = np.array([line.split() for line in run("ilftrace", path, stdin=text).text.splitlines()], float)
    with ilf.open(path) as f:
        assert f.eval(o, d, h) == pytest.approx(told, rel=1e-5)


def test_other_python_threads_run_meanwhile(own):
    field, path = own
    o, d, h = rays(np.random.default_rng(9), 1 << 19, field)
    turns, done = [0], threading.Event()

    def count():
        while not done.is_set():
            turns[0] += 1
    with ilf.open(path) as f:
        f.eval(o[:1], d[:1])
        other = threading.Thread(target=count)
        other.start()
        before = turns[0]
        f.eval(o, d, h, threads=1)
        during = turns[0] - before
        done.set()
        other.join()
    assert during > 1000                    # with the interpreter locked, some at the edges


# ---- what is refused -------------------------------------------------------------------------------------------

def test_refusals_are_exceptions_of_one_line(own, tmp_path):
    field, path = own
    (tmp_path / "junk.exr").write_bytes(b"no light field")
    for kind, base, where in ((ilf.FileError, OSError, tmp_path / "none.exr"), (ilf.FormatError, ValueError, tmp_path / "junk.exr")):
        with pytest.raises(kind) as e:
            ilf.open(where)
        assert isinstance(e.value, base) and isinstance(e.value, ilf.Error) and str(where) in str(e.value) and "\n" not in str(e.value)
    up = field.frame()[2]
    with ilf.open(path) as f:
        d = np.tile(up, (9000, 1))
        d[[5000, 8000]] = 0
        for threads in (1, 4):
            with pytest.raises(ilf.ArgumentError, match="^ray 5000: expected a direction"):
                f.eval(field.origin, d, threads=threads)
        for bad in (((0, 0), up), (field.origin, (np.nan, 0, 1)), (np.zeros((3, 3)), np.ones((2, 3))), (field.origin, up, (0, 0, np.nan))):
            with pytest.raises(ilf.ArgumentError):
                f.eval(*bad)
        with pytest.raises(ilf.ArgumentError, match="out: expected"):
            f.eval(field.origin, up, out=np.empty(3))
        with pytest.raises(ilf.ArgumentError, match=r"probe \(3,0\): expected one of 3x4"):
            f.probe(3, 0)
        with pytest.raises(ilf.ArgumentError):
            f.eval(field.origin, up, threads=-1)
    bad = ILF(np.ones((1, 2, 3, 4, 3)))
    bad.probes[0, 1, 2, 3, 0] = np.nan
    with ilf.open(write_ilf(tmp_path / "bad.ilf.exr", bad)) as f, pytest.raises(ilf.TexelError, match=r"probe \(1,0\), pixel \(3,2\)"):
        f.eval((1, .5, 0), (0, 0, 1))


def test_a_file_that_changes_in_place_is_noticed(tmp_path):
    path = write_ilf(tmp_path / "f.ilf.exr", random_ilf(RNG, 2, 2, 8, 4))
    with ilf.open(path) as f:
        f.eval(f.frame.at(.5, .5), f.frame.n)
        os.utime(path, ns=(1, 1))
        with pytest.raises(ilf.ChangedError, match="found it changed"):
            f.eval(f.frame.at(.5, .5), f.frame.n)


# ---- written ---------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("dtype, compression, interleave", [("float32", "none", False), ("float16", "none", True), ("float16", "zip", False)])
def test_written_files_are_read_by_others(tmp_path, dtype, compression, interleave):
    field = random_ilf(RNG, 3, 2, 8, 6, kind="185deg", half=True)
    path = tmp_path / "w.ilf.exr"
    ilf.write(path, field.probes, origin=field.origin, U=field.U, V=field.V, polar_max=field.polar_max, polar_valid=1.25, dtype=dtype,
              compression=compression, interleave=interleave, comments="made here", cap_date="2026:01:02 03:04:05", white_luminance=179)
    header, pixels = read_mosaic(path)
    assert (unmosaic(pixels, 3, 2) == field.probes).all() and header["ilf:version"] == 1 and header["comments"] == "made here"
    assert header["ilf:polarValid"] == 1.25 and header["whiteLuminance"] == 179 and header["capDate"] == "2026:01:02 03:04:05"
    assert run("ilfinfo", path).code == 0 and list(tmp_path.iterdir()) == [path]
    with ilf.open(path) as f:
        assert f.info.interleaved is interleave and (f.probes() == field.probes).all()
        assert f.probes().flags.owndata is (compression != "none")


def test_a_copy_of_a_field_with_lamps_has_its_digest(lit, tmp_path):
    field, path = lit
    with ilf.open(path) as f:
        ilf.write(tmp_path / "copy.ilf.exr", f.probes(), like=f)
        ilf.write(tmp_path / "bare.ilf.exr", f.probes(), like=f, lamps=[])
        brighter = [dataclasses.replace(x, rgb=2 * np.asarray(x.rgb)) for x in f.lamps]
        ilf.write(tmp_path / "twice.ilf.exr", f.probes(), like=f, lamps=brighter, compression="zip")
        o, d, h = rays(np.random.default_rng(10), 3000, field)
        with ilf.open(tmp_path / "copy.ilf.exr") as g, ilf.open(tmp_path / "twice.ilf.exr") as twice, ilf.open(tmp_path / "bare.ilf.exr") as bare:
            assert g.digest() == f.digest() != twice.digest() and (g.eval(o, d, h) == f.eval(o, d, h)).all() and bare.info.version == 1
            more = ILF(field.probes, field.origin, field.U, field.V, lamps=field.lamps)
            for lamp in more.lamps:
                lamp.rgb = 2 * lamp.rgb
            assert_same(twice.eval(o, d, h), more.eval(o, d, h))
            for lamp in more.lamps:
                lamp.rgb = lamp.rgb / 2


def test_nothing_is_used_that_was_given_back(lit, tmp_path):
    """Memory that Python frees is overwritten at once: lamps that a writer is given must still be there when they are written."""
    words = "import sys, ilf; f = ilf.open(sys.argv[1]); ilf.write(sys.argv[2], f.probes(), like=f); print(ilf.open(sys.argv[2]).digest() == f.digest())"
    p = execute([sys.executable, "-c", words, str(lit[1]), str(tmp_path / "copy.ilf.exr")], env=environment(PYTHONMALLOC="debug"), capture_output=True, text=True)
    assert p.stdout.split() == ["True"], p.stderr


def test_what_can_not_be_written_leaves_nothing(tmp_path):
    probes, plane = np.ones((1, 2, 3, 4, 3)), {"origin": (0, 0, 0), "U": (1, 0, 0), "V": (0, 1, 0)}
    old = tmp_path / "w.ilf.exr"
    old.write_bytes(b"before")
    bad = probes.copy()
    bad[0, 1, 0, 2, 1] = np.inf
    cube, point = (ilf.Lamp(kind, (0, 0, 1), (1, 1, 1)) for kind in ("cube", "sphere"))
    for kind, words, args, more in [(ilf.TexelError, r"probe \(1,0\), pixel \(2,0\)", bad, {}),
                                    (ilf.TexelError, "65504", probes * 1e5, {"dtype": "float16"}),
                                    (ilf.FormatError, "ilf:U: expected a finite vector", probes, {"U": (0, 0, 0)}),
                                    (ilf.ArgumentError, "probes: expected shape", probes[0], {}),
                                    (ilf.ArgumentError, "dtype", probes, {"dtype": float}),
                                    (ilf.ArgumentError, "origin: expected 3", probes, {"origin": None}),
                                    (ilf.ArgumentError, "lamp: expected one of", probes, {"lamps": [cube]}),
                                    (ilf.ArgumentError, "radius", probes, {"lamps": [point]})]:
        with pytest.raises(kind, match=words) as e:
            ilf.write(old, args, **{**plane, **more})
        assert "\n" not in str(e.value) and ".part" not in str(e.value)
    assert old.read_bytes() == b"before" and list(tmp_path.iterdir()) == [old]
    with pytest.raises(ilf.FileError, match="none/w"):
        ilf.write(tmp_path / "none/w.ilf.exr", probes, **plane)


# ---- the package -----------------------------------------------------------------------------------------------

def python(code, **env):
    more = {k: v for k, v in environment(PYTHONPATH=str(TOP / "python/src"), **env).items() if v is not None}
    return execute([sys.executable, "-c", code], env=more, capture_output=True, text=True)


def test_it_finds_the_library():
    tell = "import ilf; print(ilf.library_path(), ilf.__version__)"
    version, = re.findall(r"^VERSION\s*:= (\S+)", (TOP / "Makefile").read_text(), re.M)
    p = python(tell, ILF_LIBRARY=None)
    assert p.stdout.split() == [str(TOP / "build/lib/libilf.so.0"), version], p.stderr
    assert f'version = "{version}"' in (TOP / "python/pyproject.toml").read_text()
    assert "ILF_ABI    := 0" in (TOP / "Makefile").read_text()           # libilf.so.0
    p = python(tell, ILF_LIBRARY="/none/libilf.so.0")
    assert p.returncode == 1 and p.stderr.splitlines()[-1].startswith("ImportError: ilf: expected libilf.so.0, found: /none/libilf.so.0: ")
    p = python(tell, ILF_LIBRARY="libm.so.6")
    assert p.returncode == 1 and "libm.so.6: expected the function ilf_open, found none" in p.stderr.splitlines()[-1]


def installed(source, folder):
    """The package as pip makes it of a folder, without asking a registry, in a Python that knows nothing else of ours."""
    p = execute([sys.executable, "-m", "pip", "install", "-q", "--no-index", "--no-build-isolation", "--no-deps", "--disable-pip-version-check",
                 "--target", folder / "packages", source], env=environment(), capture_output=True, text=True)
    assert p.returncode == 0, p.stderr
    first = f"import sys; sys.path.insert(0, {str(folder / 'packages')!r})\n"
    return lambda code: execute([sys.executable, "-I", "-c", first + code],
                                cwd=folder, env=environment(), capture_output=True, text=True)


def test_pip_packs_the_library_and_its_headers(own, tmp_path):
    before = sorted((TOP / "python").rglob("*"))
    tell = installed(TOP / "python", tmp_path)(f"import ilf; print(ilf.library_path(), float(ilf.open({str(own[1])!r}).probes()[3, 2, 1, 0, 0]))")
    where, value = tell.stdout.split()
    assert where == str(tmp_path / "packages/ilf/libilf.so.0") and float(value) == own[0].probes[3, 2, 1, 0, 0], tell.stderr
    assert [p for p in sorted((TOP / "python").rglob("*")) if p not in before and "__pycache__" not in p.parts] == []
    assert (tmp_path / "packages/ilf/include/ilf.h").read_bytes() == (TOP / "ilfmat/ilf.h").read_bytes()


def test_the_page_s_code_runs(lit, tmp_path):
    shutil.copy(lit[1], tmp_path / "room.ilf.exr")
    code, = re.findall(r"^```python\n(.*?)^```$", (TOP / "python/README.md").read_text(), re.S | re.M)
    (tmp_path / "a.py").write_text(code)
    p = execute([sys.executable, "a.py"], cwd=tmp_path, env=environment(PYTHONPATH=str(TOP / "python/src")), capture_output=True, text=True)
    assert p.returncode == 0, p.stderr
    assert p.stdout.startswith("3 x 2 probes of 10 x 6 texels, float32, none; None") and "sphere at [" in p.stdout
    half = read_mosaic(tmp_path / "half.ilf.exr")
    assert half[0]["ilf:version"] == 1 and (half[1] == lit[0].mosaic() * .5).all()


def example(*args):
    return execute([sys.executable, TOP / "python/examples/irradiance.py", *args], env=environment(PYTHONPATH=str(TOP / "python/src")),
                   capture_output=True, text=True)


def drawn(path, folder, *args):
    """What the example computes: columns height, s, t, lux."""
    p = example(path, "-o", folder / "e.png", "--csv", folder / "e.csv", *args)
    assert p.returncode == 0, p.stderr
    assert (folder / "e.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    return np.loadtxt(folder / "e.csv", delimiter=",", skiprows=1).T


def test_the_example_draws_irradiance(own, tmp_path):
    h, _, _, lux = drawn(own[1], tmp_path, "--samples", 64, "--cells", 12)
    assert len(np.unique(h)) == 3 and len(h) == 3 * 12 * 12 and (lux > 0).all()
    p = example(tmp_path / "none", "-o", tmp_path / "n.png")
    assert p.returncode == 1 and p.stderr.startswith("irradiance.py: ") and len(p.stderr.splitlines()) == 1 and not (tmp_path / "n.png").exists()


PLANE = {"origin": (0, 0, 0), "U": (1, 0, 0), "V": (0, 1, 0)}


def test_the_example_s_irradiance_under_even_light_is_pi(tmp_path):
    ilf.write(tmp_path / "even.ilf.exr", np.ones((2, 2, 6, 12, 3)), **PLANE)
    lux = drawn(tmp_path / "even.ilf.exr", tmp_path, "--samples", 64, "--cells", 3, "--ball", "0.5 0.5 0 3")[3]
    assert lux == pytest.approx(179 * np.pi, rel=1e-5)


def test_the_example_s_irradiance_under_a_ball_is_the_balls(tmp_path):
    """pi L (r/d)^2 cos: a lamp that few of the even directions would meet; one that was put out does not count."""
    lamps = [ilf.Lamp("sphere", (.5, .5, 2), (3, 3, 3), radius=.05), ilf.Lamp("disc", (.2, .1, 3), (0, 0, 0), a=(.1, 0, 0), b=(0, .1, 0))]
    ilf.write(tmp_path / "ball.ilf.exr", np.zeros((2, 2, 6, 12, 3)), lamps=lamps, **PLANE)
    h, s, t, lux = drawn(tmp_path / "ball.ilf.exr", tmp_path, "--samples", 256, "--cells", 4, "--ball", "0.5 0.5 0 5")
    up = 2 - h
    square = (s - .5) ** 2 + (t - .5) ** 2 + up ** 2
    assert lux == pytest.approx(179 * np.pi * 3 * .05 ** 2 / square * up / np.sqrt(square), rel=2e-3)


FLAT = {"a": (.3, 0, 0), "b": (0, .4, 0)}


@pytest.mark.parametrize("kind, more, extent", [("sphere", {"radius": .3}, .3), ("rectangle", FLAT, .5), ("disc", FLAT, .4),
                                                ("tube", {"a": (0, .3, 0), "radius": .1}, .4)])
def test_extent(kind, more, extent):
    assert ilf.Lamp(kind, (0, 0, 1), (1, 1, 1), **more).extent == pytest.approx(extent)
    with pytest.raises(ilf.ArgumentError, match="lamp's centre: expected 3 numbers"):
        ilf.Lamp(kind, (0, 0), (1, 1, 1), **more)
