"""What README and the man pages' EXAMPLES say is run as it stands there, in a folder with what it names.

A man page's commands stand in its section EXAMPLES between .EX and .EE (in pages of section 1 also between .nf and .fi), README's in
its blocks of code.  INPUTS says how each file that a page reads and does not make comes about.
"""
import re
import subprocess
from contextlib import nullcontext

import fishremap_util as U
import numpy as np
import pytest
from common_util import rgbe_of, write_hdr
from conftest import BUILD, TOP, environment
from hdrgen_util import f_srgb, scene
from ilf_util import random_ilf, rays_text, write_ilf
from process import execute
from stage_util import Stage, session
from test_falloffcal import paper_like, source_picture
from test_fishremap_array import SCENE, photograph
from test_hdrgen import jpeg_with_exif

PLANE = (0, 0, 0), (.75, 0, 0), (0, .75, 0)
TIMES = [1 / 32, 1 / 8, 1 / 2, 2]


# ---- what the examples read --------------------------------------------------------------------------------------------

def series(folder):
    radiance = scene(160, 160, decades=3, lowest=-1.5)
    for k, t in enumerate(TIMES):
        jpeg_with_exif(folder / f"IMG_{k}.jpg", np.round(255 * f_srgb(np.clip(radiance * t, 0, 1))).astype(np.uint8), t, 8, 100)


def probe(folder, name):
    U.write_exr(folder / name, U.probe(U.lobes(), 64, 16, 90, 2))


def lens(folder):
    """A falloff of half the light at the rim."""
    theta = np.arange(0, 94)
    table = np.stack([theta, *(paper_like(np.radians(theta), .9) for _ in range(3)), *(0 * theta for _ in range(3))], -1)
    np.savetxt(folder / "lens.txt", table, "%.6g")


def flat_field(folder):
    def falls(d):
        return np.repeat(paper_like(np.arccos(d[..., 2].clip(-1, 1)), .9)[..., None], 3, -1)
    U.write_exr(folder / "flat.exr", U.fisheye(falls, 300, 186, "equisolid", outside=0))


def panorama(folder):
    y, x = np.mgrid[0:64, 0:128]
    theta, phi = (x + .5) / 64 * np.pi, (y + .5) / 64 * np.pi
    d = np.stack([np.sin(phi) * np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi)], -1)
    write_hdr(folder / "panorama.hdr", rgbe_of(U.lobes()(d)))


def room(folder):
    """Of four walls, a floor, a ceiling and a lamp: a field's surroundings, or a scene."""
    (folder / "room.rad").write_text("void plastic paint 0 0 5 .6 .6 .6 0 0\npaint bubble wall 0 0 4 .4 .4 .5 2\n"
                                     "void light bulb 0 0 3 30 20 10\nbulb sphere lamp 0 0 4 .2 .3 1.5 .1\n")


def room_field(folder):
    write_ilf(folder / "room.ilf.exr", random_ilf(np.random.default_rng(90), 3, 3, 32, 8, "185deg", plane=PLANE))


def rays(folder):
    rng = np.random.default_rng(1)
    d = rng.normal(size=(50, 3))
    (folder / "rays.txt").write_text(rays_text(rng.uniform(0, .5, (50, 3)), d, np.abs(d) * 3))


def write(name, text):
    return lambda folder: (folder / name).write_text(text)


def grid(n):
    return lambda folder: [probe(folder, f"probe_{k:02}.exr") for k in range(n)]


def sources(folder):
    for deg in (0, 13, 26, 39, 52, 65, 78, 88):
        U.write_exr(folder / f"source_{deg:02}.exr", source_picture(deg, 0, np.random.default_rng(deg)))


INPUTS = {
    "IMG_*.jpg": series,
    "times.txt": write("times.txt", "".join(f"IMG_{k}.jpg {t}\n" for k, t in enumerate(TIMES))),
    "fisheye.exr": lambda folder: U.write_exr(folder / "fisheye.exr", U.fisheye(U.lobes(), 300, 186, "equisolid", outside=0)),
    "lens.txt": lens, "flat.exr": flat_field, "source_": sources, "panorama.hdr": panorama,
    "spheres.exr": lambda folder: U.write_exr(folder / "spheres.exr", photograph(SCENE, 12, 12, radius=24.)[0]),
    "left.exr": lambda folder: probe(folder, "left.exr"), "right.exr": lambda folder: probe(folder, "right.exr"),
    "probe.exr": lambda folder: probe(folder, "probe.exr"),
    "--grid 6x6 --plane \"0 0 0  .75 0 0  0 .75 0\" -o room.ilf.exr probe_*.exr": grid(36), "--grid 3x2": grid(6),
    "room.ilf.exr": room_field, "rays.txt": rays, "room.rad": room,
    "session.conf": lambda folder: session(folder, stage={"port": folder / "port"}),
    "objects.rad": write("objects.rad", "void plastic white 0 0 5 .7 .7 .7 0 0\nwhite sphere ball 0 0 4 .4 .4 .2 .1\n"),
    "view.vf": write("view.vf", "rvu -vtv -vp .4 -.8 .6 -vd 0 1 -.3 -vu 0 0 1 -vh 40 -vv 30\n"),
    "surroundings.rad": write("surroundings.rad", "void ilf room 1 room.ilf.exr 0 9 0 0 0 .75 0 0 0 .75 0\nroom bubble b 0 0 4 .4 .4 0 3\n"),
}

# In front of the commands.  A whole capture is another test's (tests/stagectl/test_stagectl_chain.py): here its rules are read, and
# pictures are small where an example leaves their size open.
SHELL = f"""
make() {{ case "$*" in *CAPTURE=*) command make -n -C {TOP} BUILD={BUILD} "$@" >made 2>&1 || {{ cat made >&2; return 1; }};; *) command make -C {TOP} "$@";; esac; }}
rpict() {{ command rpict -x 48 -y 36 "$@"; }}
"""


def prepare(folder, text):
    """Inputs that the text reads; what it makes itself, it must not find."""
    made = set(re.findall(r"(?:-o|--plot|--overlay|--save-response|--montage|>)\s+(\S+)", text))
    (folder / "room.ilf.exr").unlink(missing_ok=True)
    for name, how in INPUTS.items():
        if name in text and (name not in made or text.index(name) < re.search(rf"(?:-o|>)\s+{re.escape(name)}", text).start()):
            how(folder)
    if "room.ilf.exr" not in made and re.search("surroundings|room.ilf", text):
        room_field(folder)
    return made


def carry_out(folder, text):
    made = prepare(folder, text)
    p = execute(["bash", "-euo", "pipefail", "-c", SHELL + text], cwd=folder, env=environment(MAKEFLAGS="", MAKELEVEL="", BASH_ENV=""),
                stdin=subprocess.DEVNULL, capture_output=True, text=True)
    assert p.returncode == 0, (text, p.stdout[-500:], p.stderr[-2000:])
    assert "usage" not in p.stderr.lower() and "warning" not in p.stderr.lower(), p.stderr
    for name in made - {"/dev/null"}:
        names = [name] if not re.search(r"[$\"*]", name) else []
        assert all((folder / n).stat().st_size > 0 for n in names), name
    return p


# ---- man pages -----------------------------------------------------------------------------------------------------------

PAGES = sorted([*(TOP / "man").glob("*.1"), TOP / "man" / "ilf.7"])


def examples(page):
    """The commands of a page's EXAMPLES, block by block, with troff's marks taken off."""
    section = re.search(r"^\.SH EXAMPLES?\n(.*?)(?=^\.SH |\Z)", page.read_text(), re.S | re.M)
    form = r"^\.EX\n(.*?)^\.EE$" if page.suffix == ".7" else r"^\.(?:EX|nf)\n(.*?)^\.(?:EE|fi)$"
    found = re.findall(form, section[1] if section else "", re.S | re.M)
    return [block.replace("\\-", "-").replace("\\e", "\\").replace("\\&", "") for block in found]


@pytest.mark.parametrize("page", [p for p in PAGES if examples(p)], ids=lambda p: p.name)
def test_man_pages_examples(tmp_path, page):
    stage = Stage(tmp_path) if page.name == "stagectl.1" else nullcontext()
    with stage:
        carry_out(tmp_path, "".join(examples(page)))


# ---- README --------------------------------------------------------------------------------------------------------------

def readme():
    return re.findall(r"^```\w*\n(.*?)^```$", (TOP / "README.md").read_text(), re.S | re.M)


def test_readmes_commands(tmp_path):
    """The first block installs, builds and tests: it is what runs this.  A block with a primitive is a scene, all others are commands."""
    first, *others = readme()
    assert re.findall(r"^make (\S+)", first, re.M) == ["demo", "test"]
    assert len(others) >= 3
    for k, block in enumerate(others):
        if "\nvoid ilf" in block:
            (tmp_path / "surroundings.rad").write_text(block)
        else:
            (tmp_path / f"{k}").mkdir()
            carry_out(tmp_path / f"{k}", block)
