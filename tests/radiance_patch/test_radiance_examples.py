"""What README and ilf(7) show about placing a light field does what they say."""
import re

import numpy as np

from conftest import TOP, environment, run
from ilf_util import f32, random_directions, random_ilf, unit, write_ilf
from process import execute
from rad_util import FLOOR, Polygon, Sphere, Surface, clear, matrix, rtrace, scene_value
import subprocess

PLANE = (0, 0, 0), (.75, 0, 0), (0, .75, 0)


def shell(folder, line):
    p = execute(["bash", "-euc", line], cwd=folder, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert p.returncode == 0, (line, p.stderr)


def room_file(folder):
    f = random_ilf(np.random.default_rng(90), 3, 3, 12, 8, "185deg", plane=PLANE)
    write_ilf(folder / "room.ilf.exr", f)
    return f


def readme_scene():
    text = (TOP / "README.md").read_text()
    return next(b for b in re.findall(r"```\n(.*?)```", text, re.S) if "\nvoid ilf" in b)


def manual():
    """Files and commands of ilf(7), with troff's marks taken off."""
    text = (TOP / "man" / "ilf.7").read_text().replace("\\-", "-").replace("\\e", "\\")
    return re.findall(r"^\.(?:nf|EX)\n(.*?)^\.(?:fi|EE)$", text, re.S | re.M)


def check(folder, scene, surfaces, rng, M=np.eye(4)):
    o, d = f32(rng.normal(size=(4000, 3)) * .4), f32(random_directions(rng, 4000))
    o, d = f32(o @ M[:3, :3].T + M[:3, 3]), f32(unit(d @ M[:3, :3].T))
    shell(folder, f"oconv {scene} > s.oct")
    good = clear(surfaces, o, d, rng)
    expected = scene_value(surfaces, o, d)
    assert good.mean() > .9 and expected.any()
    assert np.allclose(rtrace(folder, "s.oct", o, d)[good], expected[good], rtol=1e-4, atol=1e-4)


def test_readmes_scene_as_it_stands_and_moved(tmp_path):
    f = room_file(tmp_path)
    (tmp_path / "surroundings.rad").write_text(readme_scene())
    s = Surface(Sphere((.4, .4, 0), 3), f)
    check(tmp_path, "surroundings.rad", [s], np.random.default_rng(91))
    move = "-rz 30 -t 1 2 0"
    shell(tmp_path, f"xform {move} surroundings.rad > moved.rad")
    M = matrix(move.split())
    check(tmp_path, "moved.rad", [s.moved(M)], np.random.default_rng(92), M)


def test_readmes_other_form_does_not_move(tmp_path):
    room_file(tmp_path)
    text = re.sub(r"^9  0 0 0.*$", "0", readme_scene(), flags=re.M)
    (tmp_path / "surroundings.rad").write_text(text)
    assert "ilf" in run("xform", "-t", "1", "0", "0", "surroundings.rad", cwd=tmp_path, code=1).err


def test_the_manuals_sphere_turned_and_moved(tmp_path):
    f = room_file(tmp_path)
    blocks = manual()
    (tmp_path / "surroundings.rad").write_text(next(b for b in blocks if b.startswith("# surroundings.rad")))
    line = next(b for b in blocks if b.startswith("xform"))
    shell(tmp_path, line)
    M = matrix("-rz 30 -t 1 2 0".split())
    assert "-rz 30 -t 1 2 0" in line
    check(tmp_path, "moved.rad", [Surface(Sphere((.4, .4, 0), 3), f).moved(M)], np.random.default_rng(93), M)


def test_the_manuals_room_as_auxiliary_geometry(tmp_path):
    """xform -m: a room with materials, lamps and patterns of its own; every surface of it shows the light field."""
    f = room_file(tmp_path)
    walls = [Polygon((-2, -2, 2.5), (-2, 3, 2.5), (3, 3, 2.5), (3, -2, 2.5)), Polygon((-2, -2, -1), (-2, 3, -1), (-2, 3, 2.5), (-2, -2, 2.5)),
             Polygon((3, -2, -1), (3, -2, 2.5), (3, 3, 2.5), (3, 3, -1)), Polygon((-2, -2, -1), (-2, -2, 2.5), (3, -2, 2.5), (3, -2, -1)),
             Polygon((-2, 3, -1), (3, 3, -1), (3, 3, 2.5), (-2, 3, 2.5))]
    lamp = Sphere((1, .5, 2), .2)
    (tmp_path / "room.rad").write_text("void brightfunc spots\n2 1 .\n0\n0\nspots plastic paint\n0\n0\n5 .6 .5 .4 0 0\nvoid light bulb\n0\n0\n3 9 9 9\n"
                                       + "".join(w.rad("paint", f"w{k}") for k, w in enumerate(walls)) + lamp.rad("bulb", "lamp"))
    (tmp_path / "objects.rad").write_text(FLOOR.replace("-9", "-1").replace("9 ", "1 "))
    (tmp_path / "view.vf").write_text("rvu -vtv -vp 0 0 1 -vd 0 1 -.5 -vu 0 0 1\n")
    lines = next(b for b in manual() if b.startswith("( printf")).splitlines()
    assert len(lines) == 3
    shell(tmp_path, lines[0])
    shell(tmp_path, lines[1])
    shell(tmp_path, lines[2].replace("rpict", "rpict -w -x 16 -y 16").replace("-ad 128 -as 32", "-ad 16 -as 0"))
    assert run("pvalue", "-h", "-H", "picture.hdr", cwd=tmp_path).text.strip()
    check(tmp_path, "surroundings.rad", [Surface(s, f) for s in [*walls, lamp]], np.random.default_rng(94))
