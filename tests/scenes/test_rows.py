"""Pictures in parts of their rows (rpict -yr, scenes/rows.py, rows.mk, picture.mk) are the pictures of one run."""
import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import BUILD, TOP, environment, run
from ilf_util import random_ilf, write_ilf
from process import execute

ROOM = ("void light l\n0\n0\n3 300 200 100\nl sphere lamp\n0\n0\n4 .2 .1 1.5 .2\nvoid plastic m\n0\n0\n5 .6 .5 .4 .1 .1\n"
        "m sphere ball\n0\n0\n4 .3 .6 .5 .3\nm polygon floor\n0\n0\n12 -2 -2 0 2 -2 0 2 2 0 -2 2 0\n")
VIEW = "-vtv -vp 0 -2 1 -vd 0 1 -.2 -vu 0 0 1 -vh 60 -vv 45".split()
SIZE = "-x 48 -y 37 -ps 1".split()          # 48 x 34, as the view wants it


@pytest.fixture
def room(tmp_path):
    (tmp_path / "room.rad").write_text(ROOM)
    (tmp_path / "room.oct").write_bytes(run("oconv", "-f", "room.rad", cwd=tmp_path).out)
    (tmp_path / "view.vf").write_text("rvu " + " ".join(VIEW) + "\n")
    return tmp_path


def body(data):
    """A picture's bytes without the lines that say when and how it was made."""
    return re.sub(rb"(?m)^(CAPDATE|GMT|ROWS|[^ \n]*rpict ).*\n", b"", data)


def rpict(room, options, part, octree="room.oct"):
    path = room / f"{part[0]}of{part[1]}.hdr"
    path.write_bytes(run("rpict", *VIEW, *SIZE, *options.split(), "-yr", *part, octree, cwd=room).out)
    return path


def rows(*args, code=0):
    p = execute([sys.executable, TOP / "scenes/rows.py", *args], capture_output=True, text=True)
    assert p.returncode == code, p.stderr
    return p.stderr


def joined(room, options, n, octree="room.oct"):
    parts = [rpict(room, options, (k, n), octree) for k in range(n)]
    rows("-o", room / "joined.hdr", *parts)
    return (room / "joined.hdr").read_bytes()


@pytest.mark.parametrize("options", ["-ab 0 -pj .9 -dj .8 -ds .1 -dt 0 -st 0", "-ab 2 -aa 0 -ad 24 -as 8 -dt 0 -lw 0", "-us 3 -ab 1 -aa 0 -ad 24 -dt 0"])
def test_parts_are_the_picture_of_one_run(room, options):
    """Jittered rays, soft shadows, scattered rays, ambient rays: all take their random numbers by the pixel's place."""
    whole = rpict(room, options, (0, 1)).read_bytes()
    for n in (2, 5):
        data = joined(room, options, n)
        assert body(data) == body(whole)
    assert b"ROWS" not in data and b"-yr" not in data and b"\nVIEW= " in data


def test_parts_of_a_light_field(room):
    """By the paper's literal method nothing is learnt on the way, so that there, too, parts are one run's."""
    write_ilf(room / "a.ilf.exr", random_ilf(np.random.default_rng(3), 3, 2, 16, 8, "185deg", plane=((-1, -1, 0), (2, 0, 0), (0, 2, 0))))
    (room / "f.rad").write_text("void ilf far\n1 a.ilf.exr\n0\n0\nfar bubble sky\n0\n0\n4 0 0 0 5\n" + ROOM[ROOM.index("void plastic"):])
    (room / "f.oct").write_bytes(run("oconv", "-f", "f.rad", cwd=room).out)
    options = "-ab 1 -aa 0 -ad 24 -di 0 -st 0"
    assert body(joined(room, options, 3, "f.oct")) == body(rpict(room, options, (0, 1), "f.oct").read_bytes())


def test_noise_is_that_of_radiance(room):
    """Noise of a floor in the light of one lamp that is sampled by one jittered ray: as much as without -yr, and of neighbours as alike."""
    view = "-vtl -vp 0 -1.5 2 -vd 0 0 -1 -vu 0 1 0 -vh .2 -vv .2 -x 64 -y 64 -ps 1 -pj 0 -ab 0 -dj 1 -ds 0 -dt 0 -w".split()
    noise = []
    for more in ([], ["-yr", 0, 1]):
        (room / "n.hdr").write_bytes(run("rpict", *view, *more, "room.oct", cwd=room).out)
        text = run("pvalue", "-h", "-H", "-d", "-o", "-b", "n.hdr", cwd=room).text
        v = np.array(text.split(), float).reshape(64, 64)
        v -= np.add.outer(v.mean(1), v.mean(0)) - v.mean()
        noise.append(v)
    a, b = noise
    assert b.std() == pytest.approx(a.std(), rel=.15) and b.std() > 0
    # (neighbours along Radiance's own curve take other strata, so that there is some correlation, below 0, in both)
    for pair in (lambda x: x[1:] * x[:-1], lambda x: x[:, 1:] * x[:, :-1]):
        assert pair(b).mean() / b.var() == pytest.approx(pair(a).mean() / a.var(), abs=0.1)          # 5 sigma of 64 * 63 pairs, twice


def test_parts_refuse(room):
    def refused(*options):
        p = run("rpict", *VIEW, *options, "room.oct", cwd=room, code=None)
        assert p.code != 0
        return p.err
    assert "-yr: expected K N" in refused(*SIZE, "-yr", 3, 3) and "-yr: expected K N" in refused(*SIZE, "-yr", -1, 3)
    assert "at most 34 parts" in refused(*SIZE, "-yr", 0, 40)
    assert "-yr: expected -ps 1" in refused("-x", 20, "-y", 20, "-yr", 0, 2)
    a, b = rpict(room, "", (0, 2)), rpict(room, "", (1, 2))
    for words, said in (([b, a], "expected row 0 first, found row 17"), ([a], "expected rows up to 34, found an end after 17"),
                        ([a, room / "room.oct"], "expected a picture of rpict -yr"), ([a, room / "none.hdr"], "No such file")):
        err = rows("-o", room / "no.hdr", *words, code=1)
        assert err.startswith("rows.py: ") and err.count("\n") == 1 and said in err and not (room / "no.hdr").exists()


def make(*words, code=0):
    p = execute(["make", "-C", TOP / "scenes", f"BUILD={BUILD}", *words], env=environment(MAKEFLAGS="", MAKELEVEL=""), stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT, text=True)
    assert (p.returncode == 0) == (code == 0), p.stdout
    return p.stdout


def test_picture_depends_neither_on_jobs_nor_on_order(room):
    words = [f"OCTREE={room}/room.oct", f"VIEW={room}/view.vf", "OPTIONS=-x 48 -y 36 -ab 1 -aa .2 -ad 32", "ROWS=3"]
    make(f"PICTURE={room}/a.hdr", *words, "-j3")
    make(f"PICTURE={room}/b.hdr", *words, "--shuffle=reverse" if "--shuffle" in execute(["make", "--help"], capture_output=True, text=True).stdout else "-j1")
    assert body((room / "a.hdr").read_bytes()) == body((room / "b.hdr").read_bytes())
    cost = json.loads((room / "a.json").read_text())
    assert cost["cpu_s"] > 0 and " -yr 0 1 " in cost["command"] and "-af" not in cost["command"] and set(cost["programs"]) == {"rpict"}
    assert "Nothing to be done" in make(f"PICTURE={room}/a.hdr", *words)
    # what is lost is made again, and nothing else
    (room / "a.rows/1.hdr").unlink()
    (room / "a.hdr").unlink()
    stamps = {f.name: f.stat().st_mtime_ns for f in (room / "a.rows").iterdir()}
    make(f"PICTURE={room}/a.hdr", *words)
    assert {f.name for f in (room / "a.rows").iterdir() if stamps.get(f.name) != f.stat().st_mtime_ns} == {"1.hdr", "1.json"}
    assert body((room / "a.hdr").read_bytes()) == body((room / "b.hdr").read_bytes())


def test_frames_of_a_path(room):
    """Each line of the path is a picture, from one cache; a line that is changed draws its own frame anew."""
    line = "VIEW= -vtv -vp {} -2 1 -vd 0 1 -.2 -vu 0 0 1 -vh 60 -vv 45\n"
    (room / "path.vf").write_text("# a remark\n" + "".join(line.format(x) for x in (0, .1, .2)))
    words = [f"PICTURE={room}/f%.hdr", f"OCTREE={room}/room.oct", f"VIEW={room}/path.vf", "OPTIONS=-x 24 -y 18 -ab 1 -aa .2 -ad 16"]
    make(*words, "-j2")
    frames = [(room / f"f000{k}.hdr").read_bytes() for k in (1, 2, 3)]
    assert len({body(f) for f in frames}) == 3 and all(b"\nVIEW= -vtv -vp %s -2 1 " % x in f for x, f in zip((b"0", b"0.1", b"0.2"), frames))
    assert "Nothing to be done" in make(*words)
    assert (room / "f.amb").stat().st_size > 0


def test_words_that_are_refused(room):
    words = [f"OCTREE={room}/room.oct", f"VIEW={room}/view.vf"]
    for more, said in (([f"PICTURE={room}/a.png"], "ends with .hdr"), ([f"PICTURE={room}/a.hdr", "OPTIONS=-af x.amb"], "OPTIONS: expected none of -af"),
                       ([f"PICTURE={room}/a.hdr", "ON=cloud"], "ON=cloud: expected slurm, or nothing")):
        assert said in make(*words, *more, code=2)
    assert sorted(os.listdir(room)) == ["room.oct", "room.rad", "view.vf"]
