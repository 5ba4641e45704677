"""Our conversions of OpenEXR's HALF are numpy's float16, bit by bit."""

import numpy as np
import pytest

from conftest import BUILD
from process import execute

ALL = np.arange(65536, dtype=np.uint32).astype(np.uint16).view(np.float16)
LARGEST = np.float32(65504)


def tool(what, stdin=b""):
    return execute([BUILD / "test/halftool", what], input=stdin, capture_output=True, check=True).stdout


def test_all_halves_to_floats():
    got, want = np.frombuffer(tool("any"), np.float32), ALL.astype(np.float32)
    nan = np.isnan(want)
    assert np.array_equal(got[~nan].view(np.uint32), want[~nan].view(np.uint32)) and np.isnan(got[nan]).all()
    finite = np.frombuffer(tool("finite"), np.float32)
    assert np.array_equal(finite[np.isfinite(want)].view(np.uint32), want[np.isfinite(want)].view(np.uint32))
    assert np.isfinite(finite).all()


@pytest.mark.parametrize("kind", ["exact", "ties", "beside ties", "any bits", "denormal"])
def test_floats_to_halves(kind):
    rng = np.random.default_rng(16)
    halves = np.sort(ALL[np.isfinite(ALL)]).astype(np.float32)
    ties = (0.5 * (halves[:-1].astype(np.float64) + halves[1:])).astype(np.float32)      # exact: one bit more
    v = {"exact": halves, "ties": ties,
         "beside ties": np.concatenate([np.nextafter(ties, np.float32(-np.inf)), np.nextafter(ties, np.float32(np.inf))]),
         "any bits": rng.integers(0, 1 << 32, 400_000, dtype=np.uint64).astype(np.uint32).view(np.float32),
         "denormal": (rng.uniform(-2, 2, 100_000) * 2.0 ** -14).astype(np.float32)}[kind]
    v = v[np.abs(v) <= LARGEST]
    assert len(v) > 60_000
    got = np.frombuffer(tool("from", v.tobytes()), np.uint16)
    assert np.array_equal(got, v.astype(np.float16).view(np.uint16))
