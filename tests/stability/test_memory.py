"""Memory that runs out at any allocation of ours: the job is done all the same, or refused with one line that says so."""

import pytest
from conftest import BUILD, command, driver, environment
from process import execute
from stability.conftest import WIDE
from stability.test_faults import Job, all_or_nothing, inputs, place, reference  # noqa: F401  (inputs is a fixture)

SHIM = BUILD / "test/memoryshim.so"

# allocations of each job that fail in turn: a spread of all of them
MOST = 200 if WIDE else 24
MORE = {
    "hdrgen-debevec": Job("hdrgen", "-q -t times --response debevec --save-response r.txt --plot p.svg --sigma --deghost -o out.exr e0.png e1.png e2.png",
                          ["out.exr", "r.txt", "p.svg"]),
    "hdrgen-mitsunaga": Job("hdrgen", "-q -t times --response mitsunaga --refine-times -o out.exr e0.png e1.png e2.png", ["out.exr"]),
    "fishremap-gaussian": Job("fishremap", "-q --lens equidistant --fov 180 --size 32x16 --filter gaussian -o out.exr fish.exr", ["out.exr"]),
}
for j in MORE.values():
    j.words = j.words.split()
NAMES = ["hdrgen", "fishremap", "falloffcal", "ilfpack", "ilfpack-zip", "ilfinfo", "ilftrace", *MORE]


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.case(f"out of memory: {n}", "common/base/errmsg.c", "the n-th allocation fails",
                                                                         "done, or exit 1 and one line")) for n in NAMES])
def test_any_allocation_may_fail(inputs, tmp_path, name, row):     # noqa: F811
    driver("memoryshim.so")
    if "san" in BUILD.parts:
        pytest.skip("the sanitizers have an allocator of their own")
    folder0, jobs = inputs
    job = MORE.get(name) or jobs[name]
    good = reference(folder0, job, tmp_path)

    def attempt(wish):
        env = environment(OMP_NUM_THREADS="1")
        argv = ["env", f"MEMORY={wish}", f"MEMORY_LOG={tmp_path}/count", f"LD_PRELOAD={SHIM}", *command(job.program, job.words)]
        folder, before = place(folder0, job, tmp_path)
        return folder, before, execute(argv, cwd=folder, input=job.stdin, capture_output=True, env=env)
    folder, before, p = attempt(0)
    assert all_or_nothing(job, folder, before, p, good, "no fault")
    total = int((tmp_path / "count").read_text())
    assert total > 3
    refused = named = 0
    for k in range(min(total, MOST)):
        n = 1 + k * total // min(total, MOST)
        folder, before, p = attempt(n)
        if not all_or_nothing(job, folder, before, p, good, f"allocation {n} of {total}"):
            refused += 1
            named += b"memory" in p.stderr.lower()
    row(result=f"{refused} of {total} allocations refused, {named} by name")
    assert named == refused or name in ("falloffcal", "ilfinfo", "ilftrace"), "a lack of memory was taken for something else"
    assert refused >= 3
