"""The kept corpus of each fuzz target, once more under this compiler: seeds of every kind, and all that was ever found."""

import pytest

from conftest import BUILD, TOP, environment
from process import execute

CORPUS = TOP / "tests/fuzz/corpus"
GUARDS = {"curve": "tools/twin/curvefile.c", "exr": "common/image/image_exr.c", "falloff": "tools/fishremap/falloff.c", "grbl": "tools/stagectl/grbl_talk.c",
          "hdr": "common/image/image_hdr.c", "ilf": "ilfmat/file/ilf_file.c", "journal": "tools/stagectl/journal.c", "lens": "tools/fishremap/lensfile.c",
          "pnm": "common/image/image_pnm.c", "rays": "ilfmat/programs/ilftrace.c", "response": "tools/hdrgen/respfile.c", "session": "tools/stagectl/session.c",
          "times": "tools/hdrgen/times.c"}


def test_every_target_has_its_corpus():
    targets = {p.stem.removeprefix("fuzz_") for p in (TOP / "tests/fuzz").glob("fuzz_*.c")}
    assert targets == set(GUARDS) == {p.name for p in CORPUS.iterdir()}


@pytest.mark.parametrize("name", [pytest.param(n, id=n, marks=pytest.mark.case(f"any bytes: {n}", g, "kept corpus of libFuzzer", "accepted means usable; refused in one line"))
                                  for n, g in GUARDS.items()])
def test_replay(name, row):
    files = sorted((CORPUS / name).iterdir())
    assert sum(f.stat().st_size for f in files) < 64000, "keep it small"
    p = execute([BUILD / "test" / f"fuzz_{name}", *files], capture_output=True, text=True, env=environment())
    assert p.returncode == 0 and f"{len(files)} inputs" in p.stdout, p.stderr[-3000:]
    row(condition=f"{name}: {len(files)} inputs")
