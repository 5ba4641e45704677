"""The table of make stability: each test with @case is a row; each test of the other suites that guards a case of
its own is one too (elsewhere.py).

    case        what is extreme          expected   what must come out: a value, or a refusal that says why
    condition   number and range         result     what came out
    error       measured, with its bound verdict    holds, FAILS, or skipped with the reason
    guards      the source file whose mistakes the row would show

A test adds to its row by the fixture `row`: row(condition=..., result=..., error=...); without it the result is that the
expectation held.  ILF_STABILITY=long: hypothesis tries more and other examples, and 1e7 rays go through ilftrace.
"""
import csv
import json
import os

import pytest
from hypothesis import HealthCheck, settings

from stability.elsewhere import ELSEWHERE

LONG = os.environ.get("ILF_STABILITY") == "long"
WIDE = bool(os.environ.get("ILF_STABILITY"))     # make stability: all rays
quiet = dict(deadline=None, database=None, suppress_health_check=list(HealthCheck))
settings.register_profile("ci", max_examples=25, derandomize=True, **quiet)
settings.register_profile("long", max_examples=600, **quiet)
settings.load_profile("long" if LONG else "ci")

COLUMNS = ["case", "condition", "expected", "result", "error", "verdict", "guards", "test"]


def pytest_configure(config):
    config.addinivalue_line("markers", "case(title, guards, condition, expected): a row of the stability table")
    config.stability_rows = {}


def pytest_runtest_setup(item):
    mark = item.get_closest_marker("case")
    if mark:
        title, guards, condition, expected = mark.args
        params = getattr(getattr(item, "callspec", None), "id", None)
        item.user_properties.append(("row", json.dumps({
            "case": title, "guards": guards, "condition": condition if params is None else f"{condition} [{params}]",
            "expected": expected})))


@pytest.fixture
def row(request):
    """Add to the row: condition, result, error as text."""
    def add(**columns):
        request.node.user_properties.append(("row", json.dumps({k: str(v) for k, v in columns.items()})))
    return add


@pytest.fixture
def worst(row):
    """worst(error, bound, condition): the example that came nearest to its bound is the row's."""
    nearest = [-1.0]

    def see(error, bound, condition=""):
        if error / bound > nearest[0]:
            nearest[0] = error / bound
            row(error=f"{error:.2g} <= {bound:.2g}" + (f" at {condition}" if condition else ""))
        assert error <= bound, condition
    return see


def examples(ci, long=600):
    """How many a property takes whose examples are dear."""
    return settings(max_examples=long if LONG else ci)


def verdict(report):
    if report.outcome == "skipped":
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        return "skipped: " + reason.removeprefix("Skipped: ")
    return "holds" if report.outcome == "passed" else "FAILS"


# Only the process that collects the reports fills this.
ROWS = {}


def pytest_runtest_logreport(report):
    if report.when == "teardown" or (report.when == "setup" and report.outcome == "passed"):
        return
    base = report.nodeid.split("[")[0]
    mine = [json.loads(v) for k, v in report.user_properties if k == "row"]
    if mine:
        columns = {}
        for add in mine:
            columns.update(add)
        ROWS[report.nodeid] = {**columns, "verdict": verdict(report), "test": report.nodeid}
    elif base in ELSEWHERE:
        case, guards, condition, expected = ELSEWHERE[base]
        old = ROWS.setdefault(base, {"case": case, "guards": guards, "condition": condition, "expected": expected, "test": base,
                                     "outcomes": []})
        old["outcomes"].append(verdict(report))


def finished(columns):
    out = {k: columns.get(k, "") for k in COLUMNS}
    if "outcomes" in columns:
        done = columns["outcomes"]
        bad = [v for v in done if v == "FAILS"]
        held = [v for v in done if v == "holds"]
        out["verdict"] = "FAILS" if bad else "holds" if held else done[0]
        out["result"] = f"{len(held)} of {len(done)} variants as expected"
    elif not out["result"]:
        out["result"] = "as expected" if out["verdict"] == "holds" else ""
    return out


def pytest_terminal_summary(terminalreporter):
    path = os.environ.get("ILF_STABILITY_TABLE")
    if not path:
        return
    rows = [finished(r) for r in ROWS.values()]
    rows.sort(key=lambda r: (r["guards"], r["case"], r["condition"]))
    with open(path, "w", newline="") as f:
        w = csv.DictWriter(f, COLUMNS, lineterminator="\n")
        w.writeheader()
        w.writerows(rows)
    show = COLUMNS[:-1]
    most = {"case": 44, "condition": 40, "expected": 34, "result": 46, "error": 40, "verdict": 8, "guards": 40}
    width = {c: min(most[c], max([len(c), *(len(r[c]) for r in rows)])) for c in show}
    line = terminalreporter.write_line
    line("")
    line("  ".join(c.ljust(width[c]) for c in show))
    for r in rows:
        line("  ".join(r[c][:width[c]].ljust(width[c]) for c in show))
    bad = [r for r in rows if r["verdict"] != "holds"]
    line(f"{len(rows)} cases, {len(rows) - len(bad)} hold, {len(bad)} do not or were skipped; all columns in {path}")
