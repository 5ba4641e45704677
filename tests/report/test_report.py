"""The report: measures against a second way of computing them, probes against analytic light, tables and page against stored rows."""
import csv
import hashlib
import html.parser
import math
import os
import sys
import time

import numpy as np
import pytest

from conftest import TOP, environment, run
from ilf_util import ILF, write_ilf
from process import execute

sys.path.insert(0, str(TOP))

from report import budget, colordata, fields, measures, page, plots_of, probes, programs, sweep_depth  # noqa: E402
from report import run as runner  # noqa: E402

LUM = (0.265, 0.670, 0.065)


# ---- measures ---------------------------------------------------------------------------------------------------------

def ssim_by_sums(a, b):
    """Wang et al. 2004 pixel by pixel: weighted sums over 11 x 11 windows, the picture continued by reflection about its edge."""
    h, w = a.shape

    def at(v, n):
        return -1 - v if v < 0 else 2 * n - 1 - v if v >= n else v
    g = [[math.exp(-(x * x + y * y) / (2 * 1.5 ** 2)) for x in range(-5, 6)] for y in range(-5, 6)]
    total = sum(map(sum, g))
    out = np.zeros((h, w))
    for y in range(h):
        for x in range(w):
            s = [0.0] * 5
            for dy in range(-5, 6):
                for dx in range(-5, 6):
                    k = g[dy + 5][dx + 5] / total
                    p, q = a[at(y + dy, h), at(x + dx, w)], b[at(y + dy, h), at(x + dx, w)]
                    for n, v in enumerate((p, q, p * p, q * q, p * q)):
                        s[n] += k * v
            ma, mb, aa, bb, ab = s
            out[y, x] = ((2 * ma * mb + 1e-4) * (2 * (ab - ma * mb) + 9e-4)) / ((ma * ma + mb * mb + 1e-4) * (aa - ma * ma + bb - mb * mb + 9e-4))
    return out


def test_errors_against_sums():
    rng = np.random.default_rng(3)
    ref = rng.uniform(0.2, 2, (9, 13, 3))
    ref[0, :4] = 0                                 # unlit
    pic = ref * rng.uniform(0.8, 1.3, ref.shape)
    mask = np.zeros(ref.shape)
    mask[:6, :, 0], mask[6:8, :, 1], mask[8, :, 0] = 1, 1, 0.5
    found = measures.errors(pic, ref, mask)
    squares = total = diff = n = 0.0
    inside = []
    for y in range(8):                             # the last row is only half covered
        for x in range(13):
            if y == 0 and x < 4:
                continue
            inside.append((y, x))
            for c in range(3):
                squares += (pic[y, x, c] - ref[y, x, c]) ** 2
                diff += pic[y, x, c] - ref[y, x, c]
                total += ref[y, x, c]
                n += 1
    assert found["rmse"] == pytest.approx(math.sqrt(squares / n) / (total / n), rel=1e-12)
    assert found["bias"] == pytest.approx(diff / total, rel=1e-12)
    lum = sorted(sum(k * v for k, v in zip(LUM, ref[y, x])) for y, x in inside)
    place = 0.98 * (len(lum) - 1)
    p98 = lum[int(place)] + (place - int(place)) * (lum[int(place) + 1] - lum[int(place)])

    def shown(image):
        x = np.clip(image @ np.array(LUM) * 0.8 / p98, 0, 1)
        return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    similar = ssim_by_sums(shown(pic), shown(ref))
    assert found["ssim"] == pytest.approx(np.mean([similar[p] for p in inside]), abs=1e-10)


def test_equal_pictures_have_no_error():
    a = np.random.default_rng(1).uniform(0.1, 1, (12, 12, 3))
    e = measures.errors(a, a, np.ones(a.shape) * [1, 0, 0])
    assert e["rmse"] == 0 and e["bias"] == 0 and e["ssim"] == pytest.approx(1, abs=1e-12)


def test_split_error_is_that_of_the_mean():
    """Two pictures with noise sigma: their mean is wrong by sigma / sqrt 2; 27,648 values know it to 0.5 %, six deviations are 3 %."""
    rng = np.random.default_rng(5)
    true = np.full((96, 96, 3), 2.0)
    halves = [true + rng.normal(scale=0.1, size=true.shape) for _ in range(2)]
    assert measures.split_error(halves, np.ones(true.shape) * [0, 1, 0]) == pytest.approx(0.1 / math.sqrt(2) / 2, rel=0.03)


def test_sizes_must_agree():
    with pytest.raises(measures.pictures.PictureError, match="one size"):
        measures.errors(np.ones((4, 4, 3)), np.ones((4, 5, 3)), np.ones((4, 4, 3)))


# ---- probes and light fields --------------------------------------------------------------------------------------------

def test_texel_weights_are_solid_angles():
    """Sums of sin(phi) over a texel's parts approach its solid angle as the midpoint rule does."""
    rows, cols = (x.ravel() for x in np.mgrid[0:8, 0:16])
    d, w = probes.texel_rays(rows, cols, 16, 8, 8)
    assert np.allclose(np.linalg.norm(d, axis=-1), 1)
    solid = w.mean(1) * (np.pi / 2 / 8) * (2 * np.pi / 16)
    edge = np.cos(np.linspace(0, np.pi / 2, 9))
    assert np.allclose(solid, ((edge[:-1] - edge[1:]) * 2 * np.pi / 16)[rows], rtol=1e-3)


def test_probe_of_a_disc_lamp(tmp_path, monkeypatch):
    """A sky of radiance 1 with a lamp of 10 degrees and radiance 40: its energy in the probe is 40 x its solid angle."""
    (tmp_path / "sky.rad").write_text("void glow lamp 0 0 4 40 20 10 0\nlamp source disc 0 0 4 .3 .2 .8 10\n"
                                      "void glow sky 0 0 4 1 1 1 0\nsky source dome 0 0 4 0 0 1 360\n")
    (tmp_path / "sky.oct").write_bytes(run("oconv", "sky.rad", cwd=tmp_path).out)
    for k, v in environment().items():
        monkeypatch.setenv(k, v)
    monkeypatch.chdir(tmp_path)
    image = probes.probes("sky.oct", "-ab 0", [0, 0, 0, 1, 0, 0, 0, 1, 0], np.zeros((1, 3)), (48, 24), refine=16)[0]
    edge = np.cos(np.linspace(0, np.pi / 2, 25))
    solid = ((edge[:-1] - edge[1:]) * 2 * np.pi / 48)[:, None, None]
    disc = 2 * np.pi * (1 - math.cos(math.radians(5)))
    excess = (image * solid).sum((0, 1)) - 2 * np.pi
    # 16 x 16 rays in each of some thirty texels: the rim's rounding is far below 1 %; Radiance gives single sources one colour
    assert excess == pytest.approx(disc * np.array([39, 19, 9]), rel=0.01)
    away = probes.frame([0, 0, 0, 1, 0, 0, 0, 1, 0])[3]
    d, _ = probes.texel_rays(*(x.ravel() for x in np.mgrid[0:24, 0:48]), 48, 24, 1)
    far = (d[:, 0] @ away) @ (np.array([.3, .2, .8]) / np.linalg.norm([.3, .2, .8])) < math.cos(math.radians(15))
    assert np.allclose(image.reshape(-1, 3)[far], 1, rtol=1e-5)


def test_places_and_jitter():
    plane = [1, 2, 3, 2, 0, 0, 0, 4, 0]
    q = probes.places(plane, 3, 2)
    assert np.allclose(q[1, 2], [3, 6, 3]) and np.allclose(q[0, 1], [2, 2, 3])
    assert np.allclose(probes.places(plane, 1, 1)[0, 0], [2, 4, 3])
    e = probes.places(plane, 40, 40, 0.01, 7) - probes.places(plane, 40, 40)
    assert np.all(e[..., 2] == 0) and e[..., :2].std() == pytest.approx(0.01, rel=0.1)      # 3200 values: 1.3 % is one deviation
    assert np.array_equal(probes.places(plane, 5, 5, 0.01, 7), probes.places(plane, 5, 5, 0.01, 7))


def test_camera_and_rays_stand_at_the_same_wrong_places():
    q = probes.places([float(x) for x in budget.scene.PLANE.split()], budget.N, budget.N, budget.JITTER)
    for (name, words), place in zip(budget.places(budget.JITTER), q.reshape(-1, 3)):
        x, y = map(float, words.removeprefix("--at ").split(","))
        assert (x - 0.381, y - 0.381) == pytest.approx(place[:2], abs=1e-6), name


def test_shrink_keeps_energy():
    p = np.random.default_rng(2).uniform(0, 5, (2, 3, 12, 24, 3))
    small = fields.shrink(p, 3)
    assert small.shape == (2, 3, 4, 8, 3)

    def energy(a):
        n_phi, n_theta = a.shape[-3:-1]
        edge = np.cos(np.linspace(0, np.pi / 2, n_phi + 1))
        return (a * ((edge[:-1] - edge[1:]) / n_theta)[:, None, None]).sum((-3, -2))
    assert np.allclose(energy(small), energy(p), rtol=1e-12)
    assert np.allclose(fields.shrink(np.full((8, 8, 3), 3.0), 4), 3)
    with pytest.raises(ValueError, match="divides"):
        fields.shrink(p, 5)


def test_coarser_takes_the_nodes():
    p = np.random.default_rng(2).uniform(0, 5, (7, 7, 2, 4, 3))
    assert np.allclose(fields.coarser(p, 3, 1), p[::3, ::3], rtol=1e-12)
    with pytest.raises(ValueError, match="divides"):
        fields.coarser(p, 4, 1)


def test_light_field_is_read_as_packed(tmp_path):
    f = ILF(np.random.default_rng(4).uniform(0, 3, (2, 3, 4, 6, 3)).astype(np.float32))
    write_ilf(tmp_path / "a.ilf.exr", f)
    assert np.array_equal(fields.read(tmp_path / "a.ilf.exr"), f.probes.astype(np.float32))


def test_colordata_is_the_light_field(tmp_path):
    """The tables that stock Radiance reads and our material without depth correction, ray by ray."""
    rng = np.random.default_rng(6)
    f = ILF(rng.uniform(0.5, 4, (3, 4, 8, 12, 3)).astype(np.float32), (-1, -.5, 0), (2, 0, 0), (0, 1, 0))
    write_ilf(tmp_path / "f.ilf.exr", f)
    colordata.tables(tmp_path / "f.ilf.exr", str(tmp_path / "t"), (-1, 1, -.5, .5))
    text = (tmp_path / "t.rad").read_text().replace(f"{tmp_path}/", "")
    ball = "\nlight bubble far 0 0 4 0 0 0 9\n"     # a glow shines on its front only
    for name, head in (("theirs", text), ("ours", "void ilf light 2 f.ilf.exr nodepth 0 0\n")):
        (tmp_path / f"{name}.rad").write_text(head + ball)
        (tmp_path / f"{name}.oct").write_bytes(run("oconv", f"{name}.rad", cwd=tmp_path).out)
    n = 400
    phi, theta = rng.uniform(np.pi / 30, np.pi / 2 * 0.93, n), rng.uniform(-np.pi, np.pi, n)
    d = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], -1)
    o = np.concatenate([rng.uniform(-1.2, 1.2, (n, 1)), rng.uniform(-.6, .6, (n, 1)), np.zeros((n, 1))], 1)
    rays = "".join(" ".join(f"{v:.9g}" for v in (*a, *b)) + "\n" for a, b in zip(o, d))
    values = [np.array(run("rtrace", "-h", "-ab", "0", f"{k}.oct", stdin=rays, cwd=tmp_path).text.split(), float).reshape(-1, 3) for k in ("theirs", "ours")]
    # between the first and the last row's centres both interpolate linearly; the tables have five digits
    between = (phi > np.pi / 32) & (phi < np.pi / 2 * 15 / 16)
    assert between.sum() > 300
    assert np.allclose(*(v[between] for v in values), rtol=5e-4)


def test_neighbours_miss_by_the_parallax():
    phi = np.linspace(0.1, 1.4, 30)
    r = np.full(30, 2.0)
    assert sweep_depth.miss(r, np.full(30, 4.0), phi + 1, phi, 0.1) == pytest.approx(math.degrees(0.1 * 0.25), rel=1e-12)
    assert sweep_depth.miss(r, r, phi + 1, phi, 0.1) == 0
    # all light from one direction: that one alone counts
    light = (np.arange(30) == 7) * 1.0
    r[7] = 1.0
    assert sweep_depth.miss(r, np.full(30, 2.0), light, phi, 0.1) == pytest.approx(math.degrees(0.05), rel=1e-12)


# ---- running ------------------------------------------------------------------------------------------------------------

def test_a_command_runs_once(monkeypatch, tmp_path):
    (tmp_path / "scenes").mkdir()
    for name in ("timed.py", "builds.py"):
        (tmp_path / "scenes" / name).write_text((TOP / "scenes" / name).read_text())
    monkeypatch.setattr(runner, "TOP", tmp_path)
    text = "echo x >> count.txt; cat build/report/in.txt"
    (tmp_path / "build/report").mkdir(parents=True)
    given = tmp_path / "build/report/in.txt"
    given.write_text("1\n")

    def times():
        return len((tmp_path / "count.txt").read_text().split())
    monkeypatch.setattr(runner, "BUILD", "build")
    cost = runner.run(text, "build/report/out.txt")
    assert cost["cpu_s"] >= 0 and cost["peak_mb"] > 0 and (tmp_path / "build/report/out.txt").read_text() == "1\n"
    runner.run(text, "build/report/out.txt")
    assert times() == 1
    later = (tmp_path / "build/report/out.txt.json").stat().st_mtime + 10
    os.utime(given, (later, later))                # an input that is younger
    runner.run(text, "build/report/out.txt")
    assert times() == 2
    os.utime(given, (1, 1))
    runner.run(text + " ", "build/report/out.txt")     # another text
    assert times() == 3
    # a program that the command names: another build is another result, the same bytes written again are not
    text += "; painter >> count.txt"
    painter = tmp_path / "build/bin/painter"
    painter.parent.mkdir()

    def painted(word):
        painter.write_text(f"#!/bin/sh\necho {word}\n")
        painter.chmod(0o755)
        os.utime(painter, ns=(time.time_ns(),) * 2)
        return runner.run(text, "build/report/out.txt")["programs"]
    first, again, other = painted("a"), painted("a"), painted("b")
    assert first == again == {"painter": hashlib.sha256(b"#!/bin/sh\necho a\n").hexdigest()[:12]} and other == runner.programs(text) != first
    assert (tmp_path / "count.txt").read_text().split()[3:] == ["x", "a", "x", "b"]
    with pytest.raises(runner.ReportError, match="exit status"):
        runner.run("exit 3", "build/report/bad.txt")
    assert not (tmp_path / "build/report/bad.txt").exists()


# ---- the page -------------------------------------------------------------------------------------------------------------

def rows():
    base = {k: "" for k in runner.FIELDS}
    out = {}
    for section, n in (("figures", 2), ("time", 3), ("size", 2), ("storage", 2), ("budget", 3), ("depth", 2), ("grid", 2)):
        out[section] = [{**base, "section": section, "figure": {"figures": "figure11", "size": "positions"}.get(section, section), "row": f"{section} <{k}>", "x": f"{k + 1}",
                         "y": f"{0.1 / (k + 1):.6g}", "measure": "RMSE & more", "error": f"{0.1234567 / (k + 1):.6g}", "ssim": f"{0.9 + k / 100:.6g}",
                         "reference": "truth", "reference_error": "0.001", "cpu_s": f"{1.5 * (k + 1):g}", "peak_mb": "12", "note": ["with_room", "with_single", "c"][k],
                         "command": f"rpict -x {k} < a.oct > '{section}' && echo \"done\"",
                         "programs": f"pfilt {'0' * 12}, rpict {k:012x}"} for k in range(n)]
    return out


class Reader(html.parser.HTMLParser):
    """Everything that refers elsewhere; table rows; commands."""

    def __init__(self):
        super().__init__()
        self.sources, self.rows, self.pre, self.tags = [], [], None, []

    def handle_starttag(self, tag, attrs):
        a = dict(attrs)
        self.tags.append(tag)
        self.sources += [(tag, k, a[k]) for k in ("src", "srcset", "data", "href") if k in a]
        if tag == "tr" and "data-row" in a:
            self.rows.append({"section": a["data-section"], "row": a["data-row"], "command": None, "cells": {}})
        if tag == "td" and "data-key" in a:
            self.rows[-1]["cells"][a["data-key"]] = a["data-value"]
        self.pre = "" if tag == "pre" else self.pre

    def handle_data(self, data):
        if self.pre is not None:
            self.pre += data

    def handle_endtag(self, tag):
        if tag == "pre":
            self.rows[-1]["command"], self.pre = self.pre, None


@pytest.fixture(scope="module")
def built():
    given = rows()
    tiny = page_png()
    panel = [("photo", "Photograph", tiny, None), ("with_room", "Light field", tiny, tiny), ("with_single", "Single probe", tiny, tiny)]
    drawn = {n: plots_of.OF[n](r) for n, r in given.items() if n in plots_of.OF}
    return given, page.build(given, [("Figure 11", panel, given["figures"])], drawn, page.findings(given))


def page_png():
    from report.figures import png
    return png(np.zeros((2, 2, 3)))


def test_page_needs_nothing_else(built):
    reader = Reader()
    reader.feed(built[1])
    images = [s for s in reader.sources if s[1] in ("src", "srcset", "data")]
    assert len(images) >= 5 + 2 * 6
    assert all(s[2].startswith("data:image/png;base64,") for s in images)
    assert all(s[2].startswith("#") for s in reader.sources if s[1] == "href")
    assert not {"script", "link", "iframe", "object"} & set(reader.tags)
    assert "url(" not in built[1] and "@import" not in built[1] and 'name="viewport"' in built[1]


def test_each_row_has_its_command_and_its_numbers(built):
    given, text = built
    reader = Reader()
    reader.feed(text)
    every = [r for part in given.values() for r in part]
    assert len(reader.rows) == len(every)
    found = {(r["section"], r["row"]): r for r in reader.rows}
    for r in every:
        shown = found[r["section"], r["row"]]
        assert shown["command"] == r["command"]
        for key in ("error", "ssim", "cpu_s", "peak_mb", "reference", "measure"):
            assert shown["cells"][key] == r[key], key


def test_csv_holds_the_page_numbers(monkeypatch, tmp_path):
    monkeypatch.setattr(runner, "TOP", tmp_path)
    monkeypatch.setattr(runner, "OUT", "build/report")
    given = rows()
    given.pop("figures")
    for section, part in given.items():
        runner.write_rows(section, [{**{k: v for k, v in r.items() if k != "section"}, "programs": dict(w.split() for w in r["programs"].split(", "))} for r in part])
    page.main()
    folder = tmp_path / "build" / "report"
    with open(folder / "report.csv", newline="") as f:
        table = list(csv.DictReader(f))
    reader = Reader()
    text = (folder / "index.html").read_text()
    reader.feed(text)
    assert len(table) == len(reader.rows) == sum(map(len, given.values()))
    for r, shown in zip(table, reader.rows):
        assert r["command"] == shown["command"] and r["row"] == shown["row"]
        assert all(r[k] == v for k, v in shown["cells"].items())
        assert r["programs"] and f"by {r['programs']}<" in text
        assert 0 < float(r["error"]) < 1


def test_programs_of_all_rows_are_counted(monkeypatch, tmp_path):
    """By name and build; one that is not there any more, or is another by now, is said."""
    monkeypatch.setattr(runner, "TOP", tmp_path)
    monkeypatch.setattr(runner, "BUILD", "build")
    (tmp_path / "build/bin").mkdir(parents=True)
    (tmp_path / "build/bin/rpict").write_bytes(b"a program")
    (tmp_path / "build/bin/rpict").chmod(0o755)
    here = hashlib.sha256(b"a program").hexdigest()[:12]
    rows_of = {"time": [{"programs": f"pfilt {'0' * 12}, rpict {here}"}, {"programs": f"rpict {'1' * 12}"}], "grid": [{"programs": f"rpict {here}"}, {"programs": ""}]}
    found = {(name, digest): (n, remark) for name, digest, n, remark in programs.table(rows_of)}
    assert found["rpict", here] == (2, "") and found["rpict", "1" * 12][0] == 1 and len(found) == 3
    assert here in found["rpict", "1" * 12][1] and "none" in found["pfilt", "0" * 12][1]
    shown = page.build(rows(), [], {}, built=(programs.table(rows_of), "Version 9."))
    assert f"<code>{here}</code>" in shown and "Version 9." in shown and 'href="#programs"' in shown


def test_findings_come_from_the_rows():
    given = rows()
    given["figures"][0]["error"], given["figures"][1]["error"] = "0.05", "0.2"
    said = " ".join(page.findings(given))
    assert "4.0 times" in said and "Figure 11" in said
    assert page.findings({}) == []


def test_help_and_bad_words():
    p = execute([sys.executable, "-m", "report", "nonsense"], cwd=TOP, capture_output=True, text=True)
    assert p.returncode == 2 and p.stderr.startswith("report: expected one of") and len(p.stderr.splitlines()) == 1
    p = execute([sys.executable, "-m", "report", "measure", "--reference", "none.hdr", "--mask", "none.hdr", "none.hdr"], cwd=TOP,
                capture_output=True, text=True)
    assert p.returncode == 1 and "none.hdr" in p.stderr and len(p.stderr.splitlines()) == 1
