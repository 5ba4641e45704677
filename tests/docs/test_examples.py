"""What README and the man pages' EXAMPLES say is run as it stands there, in a folder with the files that it names (example_inputs.py).

A man page's commands stand in its section EXAMPLES between .EX and .EE, README's in its blocks of code.
"""
import re
import shutil
import subprocess
import sys
from contextlib import nullcontext

import example_inputs
import pytest
from conftest import BUILD, TOP, environment
from process import execute

PAGES = sorted([*(TOP / "man").glob("*.1"), TOP / "man" / "ilf.7"])

# In front of the commands.  A whole capture is another test's (tests/stagectl/test_stagectl_chain.py): here its rules are read, and
# pictures are small and coarse.
SHELL = f"""
make() {{ case "$*" in *CAPTURE=*) command make -n -C {TOP} BUILD={BUILD} "$@" >made 2>&1 || {{ cat made >&2; return 1; }};; *) command make -C {TOP} "$@";; esac; }}
python() {{ {sys.executable} "$@"; }}
rpict() {{ command rpict "${{@:1:$#-1}}" -x 24 -y 18 -ad 32 -as 8 "${{@: -1}}"; }}
"""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("inputs")
    example_inputs.make(folder)
    return folder


@pytest.fixture
def folder(inputs, tmp_path):
    return shutil.copytree(inputs, tmp_path / "here")


def carry_out(folder, text):
    """Each command ends well and without a complaint, and writes what it is to write."""
    bare = re.sub(r"(?m)(^|\s)#.*", "", text)
    made = set(re.findall(r"(?:-o|--plot|--overlay|--save-response|--montage|>)\s+([\w.]+)", bare))
    before = {name: (folder / name).stat().st_mtime_ns for name in made if (folder / name).exists()}
    p = execute(["bash", "-euo", "pipefail", "-c", SHELL + text], cwd=folder, env=environment(MAKEFLAGS="", MAKELEVEL=""), stdin=subprocess.DEVNULL,
                capture_output=True, text=True)
    assert p.returncode == 0, (text, p.stdout[-500:], p.stderr[-2000:])
    assert not re.search("usage|warning|fatal", p.stderr, re.I), p.stderr
    for name in made:
        assert (folder / name).stat().st_size > 0 and (folder / name).stat().st_mtime_ns != before.get(name), f"{name} was not written"


# ---- man pages -----------------------------------------------------------------------------------------------------------

def examples(page):
    """The commands of a page's EXAMPLES, block by block, with troff's marks taken off."""
    section = re.search(r"^\.SH EXAMPLES\n(.*?)(?=^\.SH |\Z)", page.read_text(), re.S | re.M)
    found = re.findall(r"^\.EX\n(.*?)^\.EE$", section[1] if section else "", re.S | re.M)
    return [block.replace("\\-", "-").replace("\\e", "\\").replace("\\&", "") for block in found]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_man_pages_examples(folder, page):
    assert examples(page), "a page has EXAMPLES"
    with example_inputs.stage(folder) if page.name == "stagectl.1" else nullcontext():
        carry_out(folder, "".join(examples(page)))


# ---- README --------------------------------------------------------------------------------------------------------------

def test_readmes_commands(folder):
    """The first block installs, builds and tests: it is what runs this.  A block with a primitive is a scene, all others are commands."""
    first, *others = re.findall(r"^```\w*\n(.*?)^```$", (TOP / "README.md").read_text(), re.S | re.M)
    assert re.findall(r"^make (\S+)", first, re.M) == ["demo", "test"]
    assert len(others) >= 3
    for k in range(6, 36):
        shutil.copy(folder / "probe_0.exr", folder / f"probe_{k}.exr")
    for block in others:
        if "\nvoid ilf" in block:
            (folder / "surroundings.rad").write_text(block)
        else:
            carry_out(folder, block)
