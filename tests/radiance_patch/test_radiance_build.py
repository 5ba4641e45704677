"""The source tree that Radiance is built from: what is refused, in what words; and what stricter compilers say of what we patch."""
import os
import re
import shutil
import subprocess
import tarfile

import pytest

from conftest import BUILD, SHARED, TOP
from process import execute

UNPACK = TOP / "radiance_patch" / "unpack.sh"
SOURCE = BUILD / "radiance" / "src"
VERSION = (SOURCE / "rt/VERSION").read_text() if SOURCE.is_dir() else "5.4a"
SERIES = "6.1" if "6.1" in VERSION else "5.4a"
SIX = SHARED / "peers/radiance-6.1a/radiance-6.1a-src.tar.xz"
FOLDERS = "common rt ot gen px util cal".split() + ["cv"] * (SERIES == "6.1")


def patches(series):
    folder = TOP / "radiance_patch" / series
    return [folder / p for p in (folder / "series").read_text().split()]


PATCHES = patches(SERIES)
TOUCHED = sorted({m for p in PATCHES for m in re.findall(r"^--- a/(\S+)", p.read_text(), re.M)})
OURS = sorted((TOP / "radiance_patch").glob("*.c"))


def unpack(source, out, code=0):
    p = execute(["sh", UNPACK, source, out], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert p.returncode == code, p
    assert code or p.stdout.split() == ["6.1" if "6.1" in (out / "rt/VERSION").read_text() else "5.4a"], p
    if code:
        assert not p.stdout and len(p.stderr.splitlines()) == 1 and p.stderr.startswith("unpack: ") and str(source) in p.stderr, p
        assert not out.exists() and not out.with_name(out.name + ".new").exists(), "something was left behind"
    return p.stderr


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    """Radiance's tree as it was before the patches: they are taken back."""
    folder = tmp_path_factory.mktemp("pristine") / "src"
    folder.mkdir()
    for d in FOLDERS:
        shutil.copytree(SOURCE / d, folder / d)
    for p in reversed(PATCHES):
        execute(["patch", "-s", "-R", "-p1", "-d", folder], stdin=p.open(), check=True)
    return folder


def test_a_folder_of_any_of_both_forms(pristine, tmp_path):
    for k, source in enumerate((pristine, pristine.parent)):
        unpack(source, tmp_path / f"out{k}")
        for f in TOUCHED:
            assert (tmp_path / f"out{k}" / f).read_bytes() == (SOURCE / f).read_bytes()


def test_read_only_trees_are_copied(pristine, tmp_path):
    execute(["cp", "-R", pristine, tmp_path / "src"], check=True)
    execute(["chmod", "-R", "a-w", tmp_path / "src"], check=True)
    unpack(tmp_path / "src", tmp_path / "out")
    execute(["chmod", "-R", "u+w", tmp_path / "src"], check=True)


def test_what_comes_out_the_same_keeps_its_date(pristine, tmp_path):
    """So that make builds again only what a changed patch changes."""
    tree, out = tmp_path / "src", tmp_path / "out"
    shutil.copytree(pristine, tree)
    unpack(tree, out)
    for f in out.rglob("*"):
        os.utime(f, (1e9, 1e9))
    (out / "rt/stray.c").write_text("")
    with (tree / "rt/rpict.c").open("a") as f:
        f.write("/* more */\n")
    unpack(tree, out)
    changed = {str(f.relative_to(out)) for f in out.rglob("*") if f.is_file() and f.stat().st_mtime != 1e9}
    assert changed == {"rt/rpict.c"} and not (out / "rt/stray.c").exists()


def edit(path, old, new):
    data = path.read_bytes()
    assert old in data
    path.write_bytes(data.replace(old, new))


def test_an_archive_of_any_form(pristine, tmp_path):
    for k, (name, mode, inside, quick) in enumerate((("rad.tar.gz", "w:gz", "ray/src", {"compresslevel": 1}),
                                                     ("rad.tar.xz", "w:xz", "src", {"preset": 0}), ("rad.tar", "w", "./a/b/c", {}))):
        with tarfile.open(tmp_path / name, mode, **quick) as tar:
            for d in FOLDERS:
                tar.add(pristine / d, f"{inside}/{d}")
        unpack(tmp_path / name, tmp_path / f"out{k}")
        for f in TOUCHED:
            assert (tmp_path / f"out{k}" / f).read_bytes() == (SOURCE / f).read_bytes()


def test_both_series_touch_the_same_things():
    """What one Radiance's patch does and another's lacks is a hook forgotten."""
    def added(series):
        text = "".join(p.read_text() for p in patches(series))
        return {w for line in re.findall(r"^\+(?!\+\+)(.*)", text, re.M) for w in re.findall(r"\b(\w*ilf\w*|DIR[A-Z]+|S?ILF\w*|reflup|[rt]*trials)\b", line)}
    assert added("5.4a") == added("6.1")


@pytest.mark.skipif(not SIX.is_file(), reason="Radiance 6.1a's source is not there (set ILF_SHARED)")
def test_radiance_6_from_its_archive(tmp_path):
    unpack(SIX, tmp_path / "out")
    assert b"MAT_ILF" in (tmp_path / "out/common/otypes.h").read_bytes()
    assert not list((tmp_path / "out").rglob("*.rej")) and not list((tmp_path / "out").rglob("*.orig"))
    words = unpack(tmp_path / "out", tmp_path / "again", 1)
    assert "6.1/01-types.patch" in words


@pytest.mark.skipif(SERIES != "5.4a", reason="a matter of 5.4a")
def test_the_tree_of_december_2021(pristine, tmp_path):
    """rt/source.c 2.77 counted otherwise in marksources() and direct(): the same patches must fit, and what they make must compile."""
    tree = tmp_path / "src"
    shutil.copytree(pristine, tree)
    edit(tree / "rt/source.c", b"int  indirect = 0;", b"int  foundsource = 0;")
    edit(tree / "rt/source.c", b"indirect += (ambounce > 0)", b"foundsource += (ambounce > 0)")
    edit(tree / "rt/source.c", b"maxcntr += !(source[ns].sflags & SSKIP);", b"foundsource += !(source[ns].sflags & SSKIP);")
    edit(tree / "rt/source.c", b'	if (!maxcntr) {\n		if (!indirect)\n			error(WARNING, "no light sources found");\n		return;		/* no direct calculation, it seems */\n',
         b'	if (!foundsource) {\n		error(WARNING, "no light sources found");\n		return;\n')
    edit(tree / "rt/source.c", b"maxcntr += MAXSPART;", b"maxcntr = nsources + MAXSPART;")
    edit(tree / "rt/source.c", b"	if (maxcntr <= 0)\n		return;		/* no direct?! */\n\n	initsrcindex(&si);			/* potential contributions */\n",
         b"	if (nsources <= 0)\n		return;		/* no sources?! */\n						/* potential contributions */\n	initsrcindex(&si);\n")
    unpack(tree, tmp_path / "out")
    compiles("gcc", tmp_path / "out", tmp_path / "out" / "rt/source.c")


def test_what_is_refused(pristine, tmp_path):
    out = tmp_path / "out"
    assert "found nothing" in unpack(tmp_path / "nowhere", out, 1)
    (tmp_path / "empty").mkdir()
    assert "rt/raytrace.c" in unpack(tmp_path / "empty", out, 1)
    (tmp_path / "text.tar.gz").write_text("no archive")
    assert "another file" in unpack(tmp_path / "text.tar.gz", out, 1)
    with tarfile.open(tmp_path / "rad.tar.gz", "w:gz") as tar:      # a part of it
        tar.add(pristine / "rt", "ray/src/rt")
    assert "common/" in unpack(tmp_path / "rad.tar.gz", out, 1)
    part = tmp_path / "part"
    shutil.copytree(pristine, part)
    shutil.rmtree(part / "gen")
    assert "gen/" in unpack(part, out, 1)


@pytest.mark.parametrize("what", ["another version", "patched already"])
def test_trees_that_the_patches_do_not_fit(pristine, tmp_path, what):
    tree = tmp_path / "src"
    shutil.copytree(pristine if what == "another version" else SOURCE, tree)
    if what == "another version":
        (tree / "rt/VERSION").write_text("RADIANCE 6.0a\n")
    words = unpack(tree, tmp_path / "out", 1)
    assert "5.4a" in words and "6.1a" in words
    assert ("RADIANCE 6.0a" if what == "another version" else "01-types.patch") in words


# ---- compilers: what gcc 14 and clang 16 took for errors, gcc 12 does on request -------------------------------------------

STRICT = ["-Werror=implicit-function-declaration", "-Werror=implicit-int", "-Werror=int-conversion", "-Werror=incompatible-pointer-types",
          "-Werror=return-type"]


def compiles(compiler, tree, *files):
    p = execute([compiler, "-fsyntax-only", "-w", "-fcommon", "-std=gnu99", "-DALIGNT=double", f"-I{tree}/common", f"-I{tree}/rt",
                        f"-I{TOP}/radiance_patch", f"-I{TOP}/ilfmat", *STRICT, *map(str, files)], stdout=subprocess.PIPE,
                       stderr=subprocess.PIPE, text=True)
    assert p.returncode == 0, p.stderr[-3000:]


# those that this machine has, at least the one that builds
@pytest.mark.parametrize("compiler", ["gcc", *filter(shutil.which, ("clang", "clang-14", "clang-16", "clang-19", "clang-22"))])
def test_strict_compilers_take_what_we_patch(compiler):
    compiles(compiler, SOURCE, *(SOURCE / f for f in TOUCHED if f.endswith(".c")), *OURS)
