"""What `make install` leaves: everything that make builds, usable from wherever it is moved; and what `make env` prints."""
import os
import re
import shutil
import stat
import sys

import numpy as np
import pytest

import fishremap_util as U
from conftest import BUILD, SHARED, TOP, environment, needed
from ilf_util import random_ilf, write_ilf
from process import execute

SCENE = """void plastic grey
0
0
5 .5 .5 .5 0 0
!genbox grey box .4 .3 .2 | xform -t -.2 -.15 0
!gensurf grey hill '.5*s' '.5*t' '.05*sin(6*s)*cos(5*t)' 4 4
!genprism grey post 4 0 0 .1 0 .1 .1 0 .1 -l 0 0 .3
void light lamp
0
0
3 100 100 100
lamp sphere bulb
0
0
4 0 0 2 .1
"""


def make(*args, env=None):
    if os.environ.get("ILF_BUILD", "build") != "build":
        args = ("SAN=1", *args)
    return execute(["make", "-s", *map(str, args)], cwd=TOP, env=env or environment(MAKEFLAGS="", MAKELEVEL=""), capture_output=True, text=True)


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """An installation with a DESTDIR that was moved afterwards, blanks in its name: (tree, what was said)."""
    folder = tmp_path_factory.mktemp("install")
    p = make("install", f"DESTDIR={folder}/stage it", "PREFIX=/opt/light field", "PROGRAM_PREFIX=ilf-")
    assert p.returncode == 0, p.stderr
    moved = folder / "moved here"
    (folder / "stage it/opt/light field").rename(moved)
    assert not list((folder / "stage it").rglob("*.*"))                 # nothing was left elsewhere
    return moved, p.stdout


def shell(tree, text, cwd, raypath=True):
    """In a shell that knows the installed tree and nothing of the build."""
    env = {"PATH": f"{tree}/bin:/usr/bin:/bin", "HOME": str(cwd)}
    if raypath:
        env["RAYPATH"] = f".:{tree}/lib/ray"
    return execute(["sh", "-euc", text], cwd=cwd, env=env, capture_output=True, text=True)


OURS = "hdrgen fishremap falloffcal ilfpack ilfinfo ilftrace stagectl virtualstage virtualcamera ilflamps ilfdepth ilfview ilfstage".split()


def test_all_that_make_builds_is_installed(installed):
    tree, said = installed
    built = {f.name for b in {BUILD, TOP / "build"} for f in (b / "bin").iterdir() if f.is_file()}
    there = {f.name for f in (tree / "bin").iterdir()}
    assert there == {f"ilf-{p}" if p in OURS else p for p in built} and len(there) > 40
    data = {str(f.relative_to(TOP / "build/lib")) for f in (TOP / "build/lib").rglob("*")
            if f.is_file() and f.suffix != ".a" and ".so" not in f.name and not f.name.startswith(".")}
    assert data == {str(f.relative_to(tree / "lib/ray")) for f in (tree / "lib/ray").rglob("*") if f.is_file()}
    assert "rayinit.cal" in data and "helvet.fnt" in data
    assert {f.stem for f in (tree / "share/man/man1").iterdir()} == {f"ilf-{p}" for p in OURS} and (tree / "share/man/man7/ilf.7").exists()
    assert {f.name for f in (tree / "share/bash-completion/completions").iterdir()} == {f"ilf-{p}" for p in OURS}
    assert "complete -F _ilf_complete_hdrgen ilf-hdrgen\n" in (tree / "share/bash-completion/completions/ilf-hdrgen").read_text()
    assert {f.name for f in (tree / "share/zsh/site-functions").iterdir()} == {f"_ilf-{p}" for p in OURS}
    for f in tree.rglob("*"):
        mode = stat.S_IMODE(f.stat().st_mode)
        assert mode == (0o755 if f.is_dir() or f.parent.name == "bin" else 0o644), f
    assert 'RAYPATH=".:/opt/light field/lib/ray' in said and "stage it" in said


def test_licences_are_installed(installed):
    doc = installed[0] / "share/doc/ilf"
    assert (doc / "LICENSE").read_text() == (TOP / "LICENSE").read_text()
    assert "Radiance Software License, Version 2.0" in (doc / "Radiance-License.txt").read_text()
    assert "Name: pyradiance" in (doc / "pyradiance.txt").read_text()


def test_a_scene_with_generators_keeps_its_parts(installed, tmp_path):
    tree, _ = installed
    (tmp_path / "s.rad").write_text(SCENE)
    p = shell(tree, "oconv s.rad > s.oct; xform -e s.rad | grep -c polygon", tmp_path)
    assert p.returncode == 0 and p.stderr == "", p.stderr
    assert int(p.stdout) > 6 + 16 + 2                                   # box, hill, post
    demo = shell(tree, f"cd {TOP}/scenes/demo; xform -e objects.rad table.rad 2>&1 >/dev/null | grep -v statue.rtm || :", tmp_path)
    assert "not found" not in demo.stdout + demo.stderr
    case = SHARED / "cases/install_genbox"
    if case.is_dir():
        shutil.copy(case / "box.rad", tmp_path)
        p = shell(tree, "oconv box.rad > box.oct; xform -e box.rad | grep -c polygon", tmp_path)
        assert p.returncode == 0 and p.stderr == "" and int(p.stdout) >= 6


def test_path_alone_is_enough_to_render_and_to_capture(installed, tmp_path):
    """Without RAYPATH: the renderers and the virtual camera find the function files of their own tree."""
    tree, _ = installed
    (tmp_path / "s.rad").write_text(SCENE)
    p = shell(tree, """oconv s.rad > s.oct
        rpict -vp 0 -3 1 -vd 0 3 -.8 -vu 0 0 1 -x 24 -y 24 s.oct > s.hdr
        printf '0 0 2  0 0 -1\\n' | rtrace -h s.oct | rcalc -f gauss.cal -e '$1=$1' > value
        ilf-virtualcamera --octree s.oct --plane "-.1 -.1 .5 .2 0 0 0 .2 0" --grid 1x1 --node 0,0 --size 32 -o view.exr
        ilf-fishremap --lens equidistant --fov 185 --size 16x8 -o probe.exr view.exr
        ilf-ilfpack --grid 1x1 --plane "-.1 -.1 .5 .2 0 0 0 .2 0" --type float -o s.ilf.exr probe.exr
        printf 'void ilf room\\n1 s.ilf.exr\\n0\\n0\\nroom bubble all\\n0\\n0\\n4 0 0 0 5\\n' > room.rad
        sed '/^void light/,$d' s.rad > objects.rad
        oconv objects.rad room.rad > lit.oct
        rpict -ab 1 -ad 16 -vp 0 -3 1 -vd 0 3 -.8 -vu 0 0 1 -x 24 -y 24 lit.oct | pvalue -h -H -d -b > lit.txt""", tmp_path, raypath=False)
    assert p.returncode == 0, p.stderr
    assert float(np.loadtxt(tmp_path / "lit.txt").max()) > 0 and (tmp_path / "s.hdr").stat().st_size > 100


def test_programs_in_python_find_their_parts(installed, tmp_path):
    """Wherever the tree lies; another Python is named, and one without the packages is refused in one line."""
    tree, _ = installed
    (tmp_path / "s.toml").write_text('[fixture.lamp]\nsize = 0.1\n[fixture.lamp.channel.w]\nrgb = [1, 1, 1]\n[[light]]\nname = "a"\nfixture = "lamp"\nposition = [0, 0, 2]\naim = [0, 0, 0]\n')
    write_ilf(tmp_path / "f.ilf.exr", random_ilf(np.random.default_rng(1), 2, 2, 16, 8, plane=((-.5, -.5, 0), (1, 0, 0), (0, 1, 0))))
    p = shell(tree, f"ILF_PYTHON={sys.executable} ilf-ilfstage --quiet -o drive.csv --noise 0 --exposure auto s.toml f.ilf.exr", tmp_path)
    assert p.returncode == 0 and p.stderr == "" and "1 lights (1 used)" in p.stdout, p
    assert (tmp_path / "drive.csv").read_text().startswith("seconds,a.w\n0,")
    (tmp_path / "bare").write_text('#!/bin/sh\nexec /usr/bin/env python3 -S "$@"\n')
    (tmp_path / "bare").chmod(0o755)
    p = shell(tree, "ILF_PYTHON=./bare ilf-ilfstage s.toml f.ilf.exr", tmp_path)
    assert p.returncode == 1 and len(p.stderr.splitlines()) == 1 and "numpy" in p.stderr


def test_letters(installed, tmp_path):
    """psign and the text materials have a font; all printable characters, no two alike."""
    tree, _ = installed
    (tmp_path / "t.rad").write_text("void brighttext tx\n2 helvet.fnt t.txt\n0\n11 0 1 0  1 0 0  0 -1 0  1 .1\n"
                                    "tx glow g\n0\n0\n4 1 1 1 0\ng polygon p\n0\n0\n12 0 0 0  6 0 0  6 1 0  0 1 0\n")
    (tmp_path / "t.txt").write_text("HI. lo\n")
    p = shell(tree, "oconv t.rad > t.oct; rpict -w -vtl -vp 3 .5 1 -vd 0 0 -1 -vu 0 1 0 -vh 6 -vv 1 -ps 1 -pj 0 -x 240 -y 40 t.oct > t.hdr; pvalue -h -H -d -b t.hdr > t.val;"
                    "psign HI > sign.hdr; pvalue -h -d -b sign.hdr > sign.val", tmp_path)
    assert p.returncode == 0 and p.stderr == "", p.stderr
    cells = np.loadtxt(tmp_path / "t.val").reshape(40, 6, 40) > 0.5    # [y, letter, x]: lit where a letter is
    share = cells.mean((0, 2))
    assert share[3] == 0 and 0.01 < share[2] < 0.1 and all(0.07 < s < 0.6 for s in share[[0, 1, 4, 5]])
    h = cells[:, 0]
    assert np.abs(h.astype(int) - h[:, ::-1]).mean() < 0.15             # H is its own mirror image
    sign = np.loadtxt(tmp_path / "sign.val", skiprows=1)
    assert sign.min() == 0 and sign.max() > 0.9
    glyphs, words = {}, [w for line in (tree / "lib/ray/helvet.fnt").read_text().splitlines() for w in line.split("#")[0].split()]
    while words:
        code, n = int(words[0]), int(words[1])
        glyphs[code] = tuple(map(int, words[2:2 + 2 * n]))
        del words[:2 + 2 * n]
    assert sorted(glyphs) == list(range(32, 127)) and len(set(glyphs.values())) == 95 and glyphs[32] == ()
    assert all(0 <= v < 256 for g in glyphs.values() for v in g)


PROGRAM = """#include <ilf.h>
#include <stdio.h>
int main(void)
{
    ilf *f;
    ilf_error e;
    printf("%d\\n", (int)ilf_open(&f, "no such file", &e));
    return 0;
}
"""


@pytest.mark.parametrize("kind", ["shared", "static"])
def test_library_is_found_by_pkg_config(installed, tmp_path, kind):
    tree, _ = installed
    needed("pkg-config")
    (tmp_path / "t.c").write_text(PROGRAM)
    env = dict(os.environ, PKG_CONFIG_PATH=f"{tree}/lib/pkgconfig")
    where = ["--define-variable", f"prefix={tree}", *(["--static"] if kind == "static" else [])]
    flags = execute(["pkg-config", *where, "--cflags", "--libs", "ilf"], env=env, capture_output=True, text=True)
    assert flags.returncode == 0, flags.stderr
    flags = flags.stdout.strip()
    if kind == "static":
        flags = flags.replace("-lilf", "-l:libilf.a")
    sanitized = "-fsanitize=address,undefined" if BUILD.name == "san" else ""
    p = execute(["sh", "-c", f"eval gcc -o t t.c '{flags}' {sanitized} && LD_LIBRARY_PATH='{tree}/lib' ./t"], cwd=tmp_path,
                capture_output=True, text=True)
    assert p.returncode == 0 and p.stdout == "1\n", p.stderr


def test_the_python_package_is_installed_by_pip(installed, tmp_path):
    tree, _ = installed
    p = execute([sys.executable, "-m", "pip", "install", "-q", "--no-index", "--no-build-isolation", "--no-deps", "--disable-pip-version-check",
                 "--target", tmp_path / "packages", tree / "share/ilf/python"], env=environment(), capture_output=True, text=True)
    assert p.returncode == 0, p.stderr
    assert (tmp_path / "packages/ilf/libilf.so.0").read_bytes() == (tree / "lib/libilf.so").read_bytes()
    assert (tmp_path / "packages/ilf/include/ilf.h").is_file() and (tmp_path / "packages/ilf/_field.py").is_file()


def test_the_shared_library_shows_what_the_header_declares(installed):
    """Nothing more: programs can't come to depend on what may change; nothing less."""
    tree, _ = installed
    so = (tree / "lib/libilf.so").resolve()
    assert re.fullmatch(r"libilf\.so\.\d+\.\d+\.\d+\.\d+", so.name)
    shown = {line.split()[2] for line in execute(["nm", "-D", "--defined-only", so], capture_output=True, text=True, check=True).stdout.splitlines()
             if line.split()[1] in "TDB"}
    header = re.sub(r"/\*.*?\*/", "", "".join((tree / f"include/{h}.h").read_text() for h in ("ilf", "ilf_luminaire")), flags=re.S)
    header = re.sub(r"^typedef [^{;]*;", "", header, flags=re.M)
    header = re.sub(r"static inline[^{]*\{.*?\n\}", "", header, flags=re.S)
    declared = set(re.findall(r"\b(ilf_\w+)\(", header))
    assert shown == declared and len(shown) > 20
    libraries = re.findall(r"NEEDED.*\[(.+?)\]", execute(["readelf", "-d", so], capture_output=True, text=True, check=True).stdout)
    # no part of OpenEXR's dependants, no image codec, no OpenCV
    assert all(re.match(r"lib(c|m|pthread|OpenEXRCore|OpenEXR|gcc_s|asan|ubsan)[-.]|ld-linux", n) for n in libraries), libraries


def test_the_chain_runs_from_an_installation(installed, tmp_path):
    """From a session to a light field and a picture in it, with PATH and the installed tree alone."""
    tree, _ = installed
    if " " in str(tree):                                    # make's names must be free of blanks
        plain = tmp_path / "tree"
        plain.symlink_to(tree)
        tree = plain
    shutil.copytree(tree / "share/ilf/example", tmp_path / "mine")
    session = tmp_path / "mine/session.conf"
    session.write_text(session.read_text().replace("nodes = 4x3", "nodes = 2x2").replace("1/4096 1/256 1/16 1", "1/256 1/8").replace("--size 256", "--size 96"))
    (tmp_path / "mine/scene.rad").write_text(f"""void ilf room
1 {tmp_path}/mine/out/room.ilf.exr
0
0
room bubble around
0
0
4 0 0 0 2
void plastic grey
0
0
5 .5 .5 .5 0 0
grey sphere ball
0
0
4 0 0 .05 .04
""")
    p = shell(tree, f"make -s -f '{tree}/share/ilf/chain/capture.mk' CAPTURE=session.conf QUIET=--quiet && ilf-ilfinfo out/room.ilf.exr &&"
              "oconv scene.rad > scene.oct && rpict -w -vp 0 -.3 .1 -vd 0 1 -.2 -x 40 -y 40 scene.oct | pvalue -h -H -d -b > values", tmp_path / "mine", raypath=False)
    assert p.returncode == 0, p.stderr
    assert "2 x 2 probes" in p.stdout, p.stdout
    values = np.loadtxt(tmp_path / "mine/values")
    assert values.size == 1600 and np.isfinite(values).all() and values.mean() > 0
    again = shell(tree, f"make -f '{tree}/share/ilf/chain/capture.mk' CAPTURE=session.conf QUIET=--quiet", tmp_path / "mine", raypath=False)
    assert again.returncode == 0 and "hdrgen" not in again.stdout + again.stderr


def test_panoramas_from_an_installation(installed, tmp_path):
    """scenes/panoramas.mk beside it: a list and a picture of radiance, up to the panorama that ilfpack would get."""
    tree, _ = installed
    if " " in str(tree):
        (tmp_path / "tree").symlink_to(tree)
        tree = tmp_path / "tree"
    U.write_exr(tmp_path / "p.exr", np.ones((32, 64, 3)))
    (tmp_path / "positions.txt").write_text("#: fishremap --size 32x16 --nadir 20\np.exr 0 0 0 90\n")
    p = shell(tree, f"make -s -f '{tree}/share/ilf/chain/panoramas.mk' PANORAMAS=positions.txt QUIET=--quiet panoramas", tmp_path, raypath=False)
    assert p.returncode == 0, p.stderr
    got = U.read_exr(tmp_path / "field/p.exr")[0]
    assert got.shape == (16, 32, 4) and np.allclose(got[..., :3][got[..., 3] == 1], 1) and (got[-1, :, 3] == 0).all()


def test_one_panorama_from_an_installation(installed, tmp_path):
    """scenes/hdri.mk beside it, and the shader of other renderers."""
    tree, _ = installed
    if " " in str(tree):
        (tmp_path / "tree").symlink_to(tree)
        tree = tmp_path / "tree"
    assert "shader ilf(" in (tree / "share/ilf/ilf.osl").read_text() and (tree / "share/ilf/ilf_blender.py").exists()
    U.write_exr(tmp_path / "p.exr", np.ones((32, 64, 3)))
    p = shell(tree, f"make -s -f '{tree}/share/ilf/chain/hdri.mk' HDRI=p.exr ROOM='4 3 2' AT='2 1 1' SIZE=32x16 QUIET=--quiet && oconv p.field/room.rad > o.oct &&"
              " echo 1 1 .5 .3 .2 -.4 | rtrace -h -w -ab 0 -di 0 o.oct", tmp_path, raypath=False)
    assert p.returncode == 0, p.stderr
    assert np.allclose(np.array(p.stdout.split()[-3:], float), 1, rtol=.01)


def test_prefix_may_be_relative_and_installing_twice_is_the_same(tmp_path):
    for _ in range(2):
        p = make("install", f"PREFIX={tmp_path}/x")
        assert p.returncode == 0 and re.search(rf"installed under {tmp_path}/x", p.stdout), p.stderr
    names = sorted(str(f.relative_to(tmp_path)) for f in tmp_path.rglob("*"))
    assert "x/bin/hdrgen" in names and "x/bin/genbox" in names and not [n for n in names if n.endswith(".part")]


# ---- make env ------------------------------------------------------------------------------------------

@pytest.mark.parametrize("before", [None, "", ".:/opt/my lib:/usr/local/lib/ray", "/one"])
def test_env_keeps_what_the_shell_had(before):
    """PATH, RAYPATH, MANPATH: ours in front, the user's behind; what Radiance has by default where there was none."""
    env = environment(MAKEFLAGS="", MAKELEVEL="", PATH="/opt/a b:/usr/bin:/bin")
    for name in ("RAYPATH", "MANPATH"):
        env.pop(name, None)
        if before is not None:
            env[name] = before
    line = make("env", env=env).stdout
    assert line.count("\n") == 1
    for sh in ("sh", "bash"):
        p = execute([sh, "-euc", 'eval "$LINE"; printf "%s\\n" "$PATH" "$RAYPATH" "$MANPATH"'], env=dict(env, LINE=line), capture_output=True, text=True)
        assert p.returncode == 0, p.stderr
        path, ray, man = p.stdout.splitlines()
        assert path.startswith(f"{BUILD}/bin:") and path.endswith(":/opt/a b:/usr/bin:/bin")
        beside = "" if BUILD == TOP / "build" else f"{BUILD}/lib:"
        assert ray == f".:{beside}{TOP}/build/lib:{before or '/usr/local/lib/ray'}"
        assert man == f"{TOP}/build/man:{before or ''}"                 # an empty part is the system's default
