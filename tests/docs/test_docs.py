"""What the documents say is there: links, cited sections, places of files, examples that run as they stand."""
import re
import sys

import numpy as np
import pytest

import example_inputs
import fishremap_util as U
from conftest import BUILD, TOP, environment, run
from ilf_util import random_ilf
from process import execute

sys.path.append(str(TOP / "docs"))
import tutorial  # noqa: E402  (docs/tutorial.py)

DOCS = [TOP / "README.md", *sorted(TOP.glob("docs/*.md")), *sorted(TOP.glob("*/README.md")),
        *(f for name in ("CONTRIBUTING.md", "CHANGELOG.md") if (f := TOP / name).is_file())]
# where comments are; radiance_patch/*.patch holds lines of Radiance's
SOURCES = [f for f in execute(["git", "ls-files"], cwd=TOP, capture_output=True, text=True, check=True).stdout.split()
           if f.endswith((".c", ".h", ".cpp", ".hpp", ".py", ".mk", ".sh", "Makefile", ".conf", ".rad", ".md", ".1", ".7"))]


def text_of(name):
    return (TOP / name).read_text()


def anchor(heading):
    """A heading's anchor, as forges make it."""
    words = re.sub(r"[`*]|\[([^]]*)\]\([^)]*\)", r"\1", heading.strip().lower())
    return re.sub(r"[^\w\- ]", "", words).replace(" ", "-")


def headings(path):
    """Anchors of a document's headings; what stands in a fence is no heading."""
    text = re.sub(r"^```.*?^```", "", path.read_text(), flags=re.S | re.M)
    return {anchor(h) for h in re.findall(r"^#+ (.*)$", text, re.M)}


def fences(path, language):
    """The blocks of that language ("": of none)."""
    return [body for name, body in re.findall(r"^```(\w*)\n(.*?)^```$", path.read_text(), re.S | re.M) if name == language]


# ---- links and citations ----------------------------------------------------------------------------------

@pytest.mark.parametrize("path", DOCS, ids=lambda p: str(p.relative_to(TOP)))
def test_links_lead_somewhere(path):
    text = re.sub(r"^```.*?^```", "", path.read_text(), flags=re.S | re.M)
    dead = []
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"\w+://|mailto:", target):
            continue
        name, _, part = target.partition("#")
        there = (path.parent / name).resolve() if name else path
        if not there.exists() or (part and part not in headings(there)):
            dead.append(target)
    assert not dead


def test_sections_that_are_cited_are_there():
    there = set(re.findall(r"^#+ ([\d.]+?)\.? ", text_of("docs/FORMAT.md"), re.M))
    cited = [(f, number) for f in SOURCES for words in re.findall(r"FORMAT\.md(?:\]\([^)]*\))?,\s+(?:[*#/]\s+)?sections? ([\d., and]+)",
             text_of(f)) for number in re.findall(r"\d+(?:\.\d+)?", words)]
    assert len(cited) > 15
    assert [c for c in cited if c[1] not in there] == []


def test_documents_that_are_cited_are_there():
    lost = [(f, name) for f in SOURCES if not f.startswith("tests/docs/") for name in re.findall(r"\b(?:docs/)?[A-Z]{3,}\.md\b", text_of(f))
            if not (TOP / name).is_file() and not (TOP / "docs" / name).is_file() and not ((TOP / f).parent / name).is_file()]
    assert not lost


# ---- ARCHITECTURE.md ----------------------------------------------------------------------------------------

def rows(text):
    """A table's rows as lists of cells."""
    return [[c.strip() for c in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|") and not set(line) <= set("|- ")]


def chapter(path, heading):
    """What stands below a heading, down to the next of its level."""
    return re.search(rf"^## {re.escape(heading)}\n(.*?)(?=^## |\Z)", path.read_text(), re.S | re.M)[1]


ARCHITECTURE = TOP / "docs" / "ARCHITECTURE.md"


def test_what_is_to_be_changed_has_a_file():
    table = [r for r in rows(chapter(ARCHITECTURE, "I want to change ..."))[1:] if r[1]]
    assert len(table) >= 30
    lost = [name for _, places in table for name in re.findall(r"`([^`]+)`", places)
            if ("/" in name or name == "Makefile") and not (TOP / name).is_file()]
    assert not lost
    for _, places in table:
        assert re.search(r"`[\w./]+`", places), places


def test_rooms_are_those_that_the_form_asserts():
    from test_form import BELOW
    table = rows(chapter(ARCHITECTURE, "The rooms"))
    said = {r[0].strip("`"): re.findall(r"`([^`]+)`", r[2]) for r in table if len(r) == 3 and r[0] != "room"}
    assert said == BELOW


# ---- FORMAT.md ---------------------------------------------------------------------------------------------

@pytest.fixture(scope="module")
def looked_at(tmp_path_factory):
    """The folder in which the commands of FORMAT.md's last section have run, and what they printed, by command."""
    import OpenEXR
    folder = tmp_path_factory.mktemp("format")
    f = random_ilf(np.random.default_rng(120), 3, 2, 8, 4)
    for k in range(6):
        image = np.ascontiguousarray(f.probes[k // 3, k % 3].astype(np.float32))
        OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": image}).write(str(folder / f"probe_{k}.exr"))
    block, = fences(TOP / "docs" / "FORMAT.md", "")[-1:]
    assert block.startswith("$ ")
    said = {}
    for part in block.split("$ ")[1:]:
        line, _, expected = part.partition("\n")
        p = execute(["bash", "-euc", line], cwd=folder, env=environment(), capture_output=True, text=True)
        assert p.returncode == 0, p
        said[line.split()[0]] = expected, p.stdout
    return folder, said


def test_the_formats_file_is_described_as_it_is(looked_at):
    _, said = looked_at
    for expected, found in said.values():
        assert found == expected


def test_the_formats_python_finds_what_ilfinfo_finds(looked_at):
    folder, _ = looked_at
    code, = fences(TOP / "docs" / "FORMAT.md", "python")
    p = execute([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True)
    probe, theta, phi, value = re.search(r"brightest +probe (\(\d+,\d+\)), theta (\S+), phi (\S+) degrees: (\S+) cd",
                                         run("ilfinfo", "room.ilf.exr", cwd=folder).text).groups()
    found = re.search(r"probe (\(\d+,\d+\)) at .*: (\S+) cd/m\^2 from \[(.*)\]", p.stdout)
    assert found[1] == probe and abs(float(found[2]) / float(value) - 1) < 1e-5
    t, f = np.deg2rad(float(theta)), np.deg2rad(float(phi))
    assert np.allclose([float(x) for x in found[3].split()], [np.sin(f) * np.cos(t), np.sin(f) * np.sin(t), np.cos(f)], atol=1e-4)


def test_the_formats_c_compiles(tmp_path):
    code, = fences(TOP / "docs" / "FORMAT.md", "c")
    (tmp_path / "a.c").write_text("#include <stdio.h>\n#include <stdlib.h>\n#include \"ilf.h\"\nint main(void)\n{\n" + code
                                  + "    printf(\"%g %g %g\\n\", (double)rgb[0], (double)rgb[1], (double)rgb[2]);\n    return 0;\n}\n")
    execute(["cc", "-std=c11", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-I", str(TOP / "ilfmat"), "a.c"], cwd=tmp_path, check=True)


# ---- TUTORIAL.md -------------------------------------------------------------------------------------------
# make tutorial runs all of it; here, with few pixels, what is neither the capture nor needs it.

TUTORIAL = TOP / "docs" / "TUTORIAL.md"
SMALLER = [("--size 160", "--size 48"), ("-x 320 -y 240", "-x 24 -y 18"), ("-ad 128", "-ad 16"), ("-x 512 -y 512", "-x 64 -y 64"),
           ("-x 1024 -y 512 front.hdr 0 0 back.hdr 512 0", "-x 128 -y 64 front.hdr 0 0 back.hdr 64 0")]


def few_pixels(words):
    for usual, less in SMALLER:
        words = words.replace(usual, less)
    return words


def chapter_steps(first, last, folder):
    """Files and commands of some chapters, in a folder of the test's own."""
    text = TUTORIAL.read_text()
    start = text.index(f"\n## {first}.")
    end = text.find(f"\n## {last + 1}.", start)
    for kind, name, words, at in tutorial.steps(text):
        if kind == "file":
            (folder / name).write_text(words)
        elif start < at and (end < 0 or at < end):
            yield words


def shell(folder, words):
    p = execute(["bash", "-euc", few_pixels(words)], cwd=folder, env=environment(), capture_output=True, text=True)
    assert p.returncode == 0, (words, p.stderr)
    return p.stdout


def test_the_tutorials_pictures_are_there_and_small():
    names = re.findall(r"!\[[^]]*\]\(([^)]*)\)", TUTORIAL.read_text())
    assert len(names) >= 5
    for name in names:
        assert 1_000 < (TUTORIAL.parent / name).stat().st_size <= 150_000, name


def test_the_tutorials_first_place(tmp_path):
    for words in chapter_steps(1, 2, tmp_path):
        shell(tmp_path, words)
    assert run("fishremap", "--from", "probe", "--to", "fisheye", "--lens", "equidistant", "--fov", 180, "--size", "16x16", "-o", "back.exr", "probe.exr",
               cwd=tmp_path)


def test_the_tutorials_sessions_have_a_plan(tmp_path):
    for words in chapter_steps(1, 1, tmp_path):
        shell(tmp_path, words)
    said = run("stagectl", "plan", "session.conf", cwd=tmp_path).text
    assert "16 (4 x 4)" in said and "options of hdrgen, fishremap and ilfpack are right" in said


def test_the_tutorials_scene_with_any_light_field(tmp_path):
    """Chapter 4 with a light field that is at hand."""
    (tmp_path / "capture" / "001_002").mkdir(parents=True)
    example_inputs.write_probes(tmp_path)
    (tmp_path / "room.ilf.exr").rename(tmp_path / "capture" / "room.ilf.exr")
    (tmp_path / "probe.exr").rename(tmp_path / "capture" / "001_002" / "probe.exr")
    for words in chapter_steps(4, 4, tmp_path):
        shell(tmp_path, words.replace("make -s -C ../..", f"make -s -C {TOP} AD=16 DI=4{' SAN=1' if BUILD.name == 'san' else ''}"))
    for name in ("lit", "photo", "one"):
        assert run("pvalue", "-h", "-H", "-b", f"{name}.hdr", cwd=tmp_path).text.split(), name
    assert U.read_exr(tmp_path / "composite/composite.difference.exr")[0].shape[:2] == (18, 24)


def test_the_tutorials_own_camera(tmp_path):
    example_inputs.write_series(tmp_path)
    example_inputs.write_lens(tmp_path)
    (tmp_path / "lens.txt").unlink()
    for words in chapter_steps(5, 5, tmp_path):
        shell(tmp_path, words)
    assert "36 (6 x 6)" in run("stagectl", "plan", "own.conf", cwd=tmp_path).text


def test_the_tutorials_ten_minutes(tmp_path):
    """Chapter 6 up to its panoramas (of a few pixels, which ilfpack would rightly call contradicting), and chapter 7 with one of them."""
    for words in [*chapter_steps(1, 1, tmp_path), *chapter_steps(6, 6, tmp_path)]:
        words = words.replace("make -C ../../scenes", f"make -s -C {TOP}/scenes BUILD={BUILD} QUIET=--quiet")
        shell(tmp_path, f"{words.rstrip()} panoramas\n" if words.rstrip().endswith("positions.txt") else words)
    made = sorted(p.name for p in (tmp_path / "field").glob("p*.exr"))
    assert made == [f"p{k:02}.exr" for k in range(1, 17)]
    # the heading is that of the picture's middle: the cool bulb is where it hangs
    run("fishremap", "--from", "latlong", "--heading", 42, "--size", "64x16", "-o", "x.exr", "field/p05.exr", cwd=tmp_path)
    light, towards = U.read_exr(tmp_path / "x.exr")[0], np.array([1.3 - .099, .1 - .334, 1.5 - .026])
    bluest = U.probe(lambda d: d, 64, 16, 90, 2).reshape(-1, 3)[(light[..., 2] - light[..., 0]).argmax()]
    assert bluest @ towards / np.linalg.norm(towards) > np.cos(np.radians(10)), bluest
    for words in chapter_steps(7, 7, tmp_path):
        shell(tmp_path, words.replace("make -C ../../scenes", f"make -s -C {TOP}/scenes BUILD={BUILD} SIZE=128x64"))
    assert np.array(run("pvalue", "-h", "-H", "-d", "finite.hdr", cwd=tmp_path).text.split(), float).max() > 0


# ---- the manual and the API ----------------------------------------------------------------------------------

@pytest.mark.parametrize("page", sorted((TOP / "man").glob("*.[17]")), ids=lambda p: p.name)
def test_every_page_of_the_manual_has_examples(page):
    text = page.read_text()
    part = re.search(r'^\.SH EXAMPLES\n(.*?)(?=^\.SH )', text, re.S | re.M)
    assert part and re.search(r"^\.EX\n.+?^\.EE$", part[1], re.S | re.M)
    assert text.count("\n.EX\n") == text.count("\n.EE\n")


def test_every_public_function_has_a_comment():
    """Above it, without a blank line between, or behind it: doxygen then has no complaint."""
    text = text_of("ilfmat/ilf.h") + text_of("ilfmat/ilf_luminaire.h")
    bare = []
    for m in re.finditer(r"^(?!typedef|static|#|\s|/|\}|extern)[\w *]+?\b(ilf_\w+)\([^;{]*\);(.*)$", text, re.M):
        if not text[:m.start()].endswith("*/\n") and "/*" not in m[2]:
            bare.append(m[1])
    assert re.search(r"^ilf_status ilf_open\(", text, re.M)
    assert not bare
