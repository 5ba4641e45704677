"""scenes/compare.py and its readers: measures against values worked out by hand, files against bytes written here."""
import csv
import json
import os
import subprocess
import sys

import numpy as np
import pytest

import common_util

TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
SCENES = os.path.join(TOP, "scenes")
sys.path.insert(0, SCENES)

import compare  # noqa: E402
import pictures  # noqa: E402
from process import Process, execute


def write_hdr(path, rgb, runs=False, header=""):
    common_util.write_hdr(path, common_util.rgbe_of(np.asarray(rgb, float)), line=common_util.line_new if runs else bytes, header=header)
    return str(path)


def run(*args):
    return execute([sys.executable, os.path.join(SCENES, "compare.py"), *map(str, args)],
                   capture_output=True, text=True)


# ---- measures -------------------------------------------------------------------------------------------------
def test_rmse_and_bias_by_hand():
    b = np.zeros((1, 2, 3))
    b[0, 0], b[0, 1] = 1.0, 3.0
    a = b.copy()
    a[0, 0] += [2.0, 0.0, 0.0]                       # squares 4, mean over six values 4/6, mean of b 2
    everywhere = np.ones((1, 2), bool)
    assert compare.rmse(a, b, everywhere) == pytest.approx(np.sqrt(4 / 6) / 2, rel=1e-12)
    assert compare.bias(a, b, everywhere) == pytest.approx((2 / 6) / 2, rel=1e-12)
    right = np.array([[False, True]])
    assert compare.rmse(a, b, right) == 0.0 and compare.bias(a, b, right) == 0.0


def test_rmse_scales_with_the_mean():
    rng = np.random.default_rng(5)
    b = rng.uniform(0.5, 2, (20, 30, 3))
    everywhere = np.ones((20, 30), bool)
    assert compare.rmse(1.1 * b, b, everywhere) == pytest.approx(0.1 * np.sqrt((b * b).mean()) / b.mean(), rel=1e-9)
    assert compare.rmse(7 * 1.1 * b, 7 * b, everywhere) == pytest.approx(compare.rmse(1.1 * b, b, everywhere), rel=1e-12)


def test_ssim_of_constants_by_hand():
    """Without structure SSIM is its luminance term, (2 m n + c1) / (m^2 + n^2 + c1)."""
    a, b = np.full((16, 16), 0.2), np.full((16, 16), 0.6)
    expected = (2 * 0.12 + 1e-4) / (0.04 + 0.36 + 1e-4)
    assert np.allclose(compare.ssim_map(a, b), expected, rtol=0, atol=1e-9)


def test_ssim_against_sums_written_out():
    """One pixel in the middle, the 11 x 11 window summed term by term."""
    rng = np.random.default_rng(11)
    a, b = rng.uniform(0, 1, (2, 25, 25))
    y, x = np.mgrid[-5:6, -5:6]
    w = np.exp(-(x * x + y * y) / (2 * 1.5 ** 2))
    w /= w.sum()
    pa, pb = a[7:18, 7:18], b[7:18, 7:18]
    ma, mb = (w * pa).sum(), (w * pb).sum()
    va, vb = (w * (pa - ma) ** 2).sum(), (w * (pb - mb) ** 2).sum()
    cov = (w * (pa - ma) * (pb - mb)).sum()
    c1, c2 = 0.01 ** 2, 0.03 ** 2
    expected = (2 * ma * mb + c1) * (2 * cov + c2) / ((ma ** 2 + mb ** 2 + c1) * (va + vb + c2))
    assert compare.ssim_map(a, b)[12, 12] == pytest.approx(expected, abs=1e-12)


def test_ssim_properties():
    rng = np.random.default_rng(2)
    a, b = rng.uniform(0, 1, (2, 30, 20))
    assert np.allclose(compare.ssim_map(a, a), 1.0)
    assert np.allclose(compare.ssim_map(a, b), compare.ssim_map(b, a))
    assert compare.ssim_map(a, b).max() <= 1 + 1e-12
    assert compare.ssim_map(a, 1 - a).mean() < 0           # opposite structure


def test_measures_clip_at_white_and_keep_regions_apart():
    reference = np.full((12, 12, 3), 0.4)
    picture = reference.copy()
    picture[:6] = 1000.0                                   # a lamp in the mirror: white is 1/exposure = 1
    where = {"all": np.ones((12, 12), bool), "table": np.arange(144).reshape(12, 12) >= 72}
    found = {(r, m): v for r, m, v in compare.measures(picture, reference, where, 1.0)}
    assert found["all", "rmse"] == pytest.approx(np.sqrt(0.5 * 0.6 ** 2) / 0.4)
    assert found["all", "rmse_unclipped"] == pytest.approx(np.sqrt(0.5 * 999.6 ** 2) / 0.4)
    assert found["table", "rmse"] == 0.0


def test_display_is_srgb():
    assert compare.display(np.array([0.0, 0.001, 0.5, 1.0, 7.0]), 1.0) == pytest.approx(
        [0.0, 0.01292, 0.735357, 1.0, 1.0], abs=1e-5)


# ---- files ----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("runs", [False, True])
def test_radiance_picture_reads_back(tmp_path, runs):
    rng = np.random.default_rng(1)
    rgb = 10 ** rng.uniform(-6, 6, (5, 300, 1)) * rng.uniform(0.1, 1, (5, 300, 3))
    rgb[2, 10:200] = [1.0, 0.5, 0.25]
    rgb[3, 5] = 0
    read = pictures.read(write_hdr(tmp_path / "a.hdr", rgb, runs))
    assert read.shape == rgb.shape and (read[3, 5] == 0).all()
    assert (np.abs(read - rgb) <= rgb.max(-1, keepdims=True) / 256 + 1e-30).all()


def test_exposure_in_the_header_is_undone(tmp_path):
    rgb = np.full((2, 9, 3), 3.0)
    plain = pictures.read(write_hdr(tmp_path / "a.hdr", rgb))
    assert pictures.read(write_hdr(tmp_path / "b.hdr", rgb, header="EXPOSURE=4\nEXPOSURE=0.5\n")) == pytest.approx(plain / 2)


def test_broken_pictures_are_refused_in_one_line(tmp_path):
    whole = open(write_hdr(tmp_path / "a.hdr", np.ones((4, 20, 3)), True), "rb").read()
    for name, data in (("short.hdr", whole[:-5]), ("none.hdr", b"hello"), ("xyze.hdr", whole.replace(b"rgbe", b"xyze"))):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(pictures.PictureError, match=name + ": expected"):
            pictures.read(tmp_path / name)


# ---- the command ------------------------------------------------------------------------------------------------
def series(tmp_path):
    rng = np.random.default_rng(3)
    b = rng.uniform(0.5, 1.0, (40, 60, 3))
    a = b * 1.2
    mask = np.zeros((40, 60, 3))
    mask[:, :40, 0] = 1.0
    mask[10:20, 5:30] = [0, 1, 0]
    write_hdr(tmp_path / "b.hdr", b, True)
    write_hdr(tmp_path / "a.hdr", a, True)
    write_hdr(tmp_path / "mask.hdr", mask, True)
    (tmp_path / "a.json").write_text(json.dumps({"cpu_s": 12.5, "command": "rpict a.oct"}))
    return [f"--reference=Truth={tmp_path}/b.hdr", f"--picture=Guess={tmp_path}/a.hdr", f"--mask={tmp_path}/mask.hdr",
            f"--csv={tmp_path}/e.csv", "-o", tmp_path / "out.png"]


def test_table_and_figure(tmp_path):
    done = run(*series(tmp_path))
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "e.csv", newline="") as f:
        rows = list(csv.DictReader(f))
    assert list(rows[0]) == ["picture", "reference", "measure", "value", "cpu_s", "command"]
    by = {r["measure"]: float(r["value"]) for r in rows}
    assert {f"{m} ({r})" for m in ("rmse", "bias", "ssim", "rmse_unclipped") for r in ("all", "objects", "table")} == set(by)
    a, b = pictures.read(tmp_path / "a.hdr"), pictures.read(tmp_path / "b.hdr")
    part = a[:, :40], b[:, :40]
    assert by["rmse_unclipped (all)"] == pytest.approx(np.sqrt(((part[0] - part[1]) ** 2).mean()) / part[1].mean(), rel=1e-5)
    assert rows[0]["cpu_s"] == "12.5" and rows[0]["command"] == "rpict a.oct" and rows[0]["reference"] == "Truth"
    shown = pictures.read(tmp_path / "out.png")
    assert shown.shape[1] > 800 and shown.std() > 0.05


def test_same_input_same_output(tmp_path):
    args = series(tmp_path)
    run(*args)
    first = (tmp_path / "out.png").read_bytes(), (tmp_path / "e.csv").read_bytes()
    run(*args)
    assert first == ((tmp_path / "out.png").read_bytes(), (tmp_path / "e.csv").read_bytes())


def test_bad_input_leaves_nothing(tmp_path):
    args = series(tmp_path)
    write_hdr(tmp_path / "mask.hdr", np.ones((3, 9, 3)))
    done = run(*args)
    assert done.returncode == 1 and done.stderr.count("\n") == 1 and "mask.hdr: expected the size" in done.stderr
    os.unlink(tmp_path / "mask.hdr")
    done = run(*args)
    assert done.returncode == 1 and done.stderr.startswith("compare.py: ") and done.stderr.count("\n") == 1
    assert not (tmp_path / "out.png").exists() and not (tmp_path / "e.csv").exists()
    assert run("-o", tmp_path / "x.png").returncode == 2


# ---- what else the scenes run -----------------------------------------------------------------------------------
def test_timed_keeps_cost_and_whole_outputs(tmp_path):
    out, log = tmp_path / "out", tmp_path / "log.json"
    timed = [sys.executable, os.path.join(SCENES, "timed.py"), "--log", str(log), "-o", str(out), "--"]
    spin = "import time\nwhile time.process_time() < 0.3: pass\nprint('done')"
    assert execute([*timed, sys.executable, "-c", spin]).returncode == 0
    cost = json.loads(log.read_text())
    assert out.read_text() == "done\n" and 0.3 <= cost["cpu_s"] < 30 and sys.executable in cost["command"]
    out.unlink()
    failed = execute([*timed, sys.executable, "-c", "print(1); raise SystemExit(3)"], capture_output=True, text=True)
    assert failed.returncode == 1 and "exit status 0, found 3" in failed.stderr
    assert not out.exists() and sorted(os.listdir(tmp_path)) == ["log.json"]
    # ended from outside: its command is ended, and nothing is left
    p = Process([*timed, "sh", "-c", "echo $$ >&2; exec sleep 100"], stderr=subprocess.PIPE, text=True)
    child = int(p.stderr.readline())
    p.terminate()
    assert p.wait() == 143 and not os.path.exists(f"/proc/{child}") and sorted(os.listdir(tmp_path)) == ["log.json"]
    p.stderr.close()


def test_statue_is_a_closed_mesh_that_faces_outward(tmp_path):
    obj = tmp_path / "statue.obj"
    execute([sys.executable, os.path.join(SCENES, "models", "statue.py"), "--height", "0.3", "--cells", "110",
                    "-o", str(obj)], check=True)
    v, n, t = [], [], []
    for line in obj.read_text().splitlines():
        word = line.split()
        if word[0] == "v":
            v.append([float(x) for x in word[1:]])
        elif word[0] == "vn":
            n.append([float(x) for x in word[1:]])
        elif word[0] == "f":
            t.append([int(x.split("/")[0]) - 1 for x in word[1:]])
    v, n, t = np.array(v), np.array(n), np.array(t)
    assert len(t) >= 5000 and np.isfinite(v).all() and v[:, 2].min() == pytest.approx(0, abs=1e-6)
    assert v[:, 2].max() == pytest.approx(0.3, abs=1e-6)
    assert np.abs(np.linalg.norm(n, axis=1) - 1).max() < 1e-3
    face = np.cross(v[t[:, 1]] - v[t[:, 0]], v[t[:, 2]] - v[t[:, 0]])
    # divergence theorem: the surface encloses volume, counted positive when the faces look outward
    volume = (v[t[:, 0]] * face).sum() / 6
    assert 0.3e-3 < volume < 3e-3
    # and its vector area vanishes, but for the slivers that are left out
    assert np.linalg.norm(face.sum(0)) < 1e-3 * np.linalg.norm(face, axis=1).sum()
    # the normals agree with the faces but on a few slivers along creases: 99 % of the area
    area = np.linalg.norm(face, axis=1)
    outward = (face * n[t].mean(1)).sum(1) > 0
    assert area[outward].sum() > 0.99 * area.sum()
