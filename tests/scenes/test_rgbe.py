"""scenes/rgbe.py, the reader of Radiance's pictures, against pvalue; what pvalue refuses is refused in one line."""
import sys

import numpy as np
import pytest

from common_util import line_new, line_old, write_hdr
from conftest import TOP, run

sys.path.insert(0, str(TOP / "scenes"))
import rgbe  # noqa: E402

LINES = {"runs": line_new, "flat": bytes, "old runs": line_old}


def pvalue(path, *options):
    """(rows, columns, 3) as Radiance has it."""
    head, data = run("pvalue", "-h", "-df", *options, path).out.split(b"\n", 1)
    _, h, _, w = head.split()
    return np.frombuffer(data, "<f4").reshape(int(h), int(w), 3)


def codes_of(rng, h, w):
    """Any codes with short runs and long ones in them; none that the old run lengths take for a repeat, nor its lines for new ones."""
    a = rng.integers(0, 256, (h, w, 4)).astype(np.uint8)
    for y in range(h):
        x = 0
        while x < w:
            n = int(rng.choice([1, 1, 2, 5, 130, 700]))
            a[y, x:x + n] = a[y, x]
            x += n
    a[rng.random((h, w)) < 0.05, 3] = 0
    a[(a[..., :3] == 1).all(-1), 0] = 7
    a[:, 0, 2] |= 128
    return a


@pytest.mark.parametrize("lines", LINES)
@pytest.mark.parametrize("h, w", [(1, 1), (3, 7), (4, 8), (5, 129), (2, 700), (1, 33000)])
def test_values_are_pvalues(tmp_path, h, w, lines):
    if lines == "runs" and not 8 <= w < 32768:
        lines = "flat"
    codes = codes_of(np.random.default_rng(100 * w + h), h, w)
    write_hdr(tmp_path / "a.hdr", codes, line=LINES[lines])
    got, header = rgbe.read(tmp_path / "a.hdr")
    assert np.array_equal(got, codes) and rgbe.exposure(header) == 1
    assert np.array_equal(rgbe.values(got).astype("f4"), pvalue(tmp_path / "a.hdr"))


def test_exposures_are_undone_as_pvalue_undoes_them(tmp_path):
    codes = codes_of(np.random.default_rng(3), 4, 20)
    write_hdr(tmp_path / "a.hdr", codes, header="EXPOSURE=4\nnot EXPOSURE=9\nEXPOSURE=0.3\n")
    assert rgbe.radiance(tmp_path / "a.hdr") == pytest.approx(pvalue(tmp_path / "a.hdr", "-o"), rel=1e-6)


@pytest.mark.parametrize("lines", LINES)
def test_any_cut_is_seen(tmp_path, lines):
    codes = codes_of(np.random.default_rng(4), 3, 40)
    write_hdr(tmp_path / "a.hdr", codes, line=LINES[lines])
    whole = (tmp_path / "a.hdr").read_bytes()
    for n in range(len(whole)):
        with pytest.raises(rgbe.RgbeError, match="^a.hdr: (row .: )?expected") as why:
            rgbe.decode(whole[:n], "a.hdr")
        assert "\n" not in str(why.value)


@pytest.mark.parametrize("body", [b"\2\2\0\x08\x89\1", b"\2\2\0\x08\x00", b"\2\2\0\x08\x09" + bytes(9), b"\1\1\1\5", b"\3\3\3\3\1\1\1\x08"])
def test_runs_beyond_the_line_are_refused(body):
    with pytest.raises(rgbe.RgbeError, match="row 0: expected 8 pixels"):
        rgbe.decode(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 8\n" + body + bytes(50), "a.hdr")
