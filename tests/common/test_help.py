"""--help of every program of ours: filled lines, one offer of help in a refusal, a man page."""
import re

import pytest
from conftest import TOP, run

OURS = "hdrgen fishremap falloffcal ilfpack ilfinfo ilftrace stagectl virtualstage virtualcamera ilflamps ilfdepth ilfview ilfstage".split()
WIDTH = 80


def paragraphs(text):
    """Lists of lines that belong together: an option's text, a paragraph, the usage."""
    block = []
    for line in text.splitlines() + [""]:
        option = re.match(r"  (?:-\w, |    )--", line)
        row = re.match(r"  \w", line)                                   # a table's row stands alone
        if not line.strip() or option or row or line.startswith("Usage:") or line == "Options:":
            if block:
                yield block
            block = []
        if not line.strip() or line == "Options:":
            continue
        if row:
            yield [line]
            continue
        if not line.startswith(("Usage:", " ")) and block and block[0].startswith("Usage:"):
            yield block                                                 # the summary follows the usage at once
            block = []
        block.append(line)


@pytest.mark.parametrize("program", OURS)
def test_lines_are_full_and_no_longer_than_a_terminal(program):
    """No line is longer than 80 columns, and none ends before the next word would not have fitted."""
    text = run(program, "--help").text
    assert max(map(len, text.splitlines())) <= WIDTH
    seen = 0
    for block in paragraphs(text):
        for line, following in zip(block, block[1:]):
            if re.match(r"  +(-\w, )?--\S+( \S+)?$", line):            # a long option has its text below it
                continue
            word = following.split()[0]
            assert len(line) + 1 + len(word) > WIDTH, f"{program}: ends early: {line!r} before {following!r}"
            seen += 1
    assert seen >= 1


@pytest.mark.parametrize("program", OURS)
def test_a_usage_error_offers_help_once(program):
    for args in (("--no-such-option",), ("a", "b", "--threads=x"), *([()] if program != "virtualstage" else [])):
        r = run(program, *args, code=None)
        assert r.code == 2 and len(r.err.splitlines()) == 1 and r.err.count("try '") == 1, r


@pytest.mark.parametrize("program", OURS)
def test_every_option_stands_in_the_man_page(program):
    page = (TOP / "man" / f"{program}.1").read_text().replace("\\-", "-")
    for name in re.findall(r"^ +(?:-\w, )?--([a-z-]+)", run(program, "--help").text, re.M):
        assert f"--{name}" in page or name in ("help", "version", "quiet", "threads"), name
