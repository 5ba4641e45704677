"""stagectl's pure parts against Python's: digests (hashlib), session files' form (configparser), command lines (shlex)."""
import configparser
import hashlib
import re
import shlex

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from conftest import BUILD
from process import execute

PARTS = BUILD / "test/stagectlparts"


def parts(*args, stdin=b"", code=0):
    p = execute([PARTS, *map(str, args)], input=stdin, capture_output=True)
    assert p.returncode == code, p.stderr
    return p.stdout.decode() if code == 0 else p.stderr.decode()


# ---- digests ------------------------------------------------------------------------------------------

def test_digests_are_hashlibs(tmp_path):
    """Empty, about a block's padding (55, 56) and end (64), about the buffer that files are read by, and large."""
    rng = np.random.default_rng(256)
    sizes = [*range(0, 130), *(65536 * k + d for k in (1, 2) for d in (-1, 0, 1)), 3_000_001]
    names = [tmp_path / f"f{n}" for n in sizes]
    for name, n in zip(names, sizes):
        name.write_bytes(rng.bytes(n))
    lines = parts("digest", *names).splitlines()
    assert lines == [f"{hashlib.sha256(f.read_bytes()).hexdigest()} {n} {f}" for f, n in zip(names, sizes)]


def test_a_file_that_is_not_there_is_named(tmp_path):
    assert parts("digest", tmp_path / "none", code=1).startswith(f"{tmp_path}/none: ")
    assert str(tmp_path) in parts("digest", tmp_path, code=1)      # a folder can be opened, not read


# ---- sections, keys, values -----------------------------------------------------------------------------

def ours(text):
    found = {}
    for line in parts("ini", stdin=text.encode()).splitlines():
        n, section, key, value = re.fullmatch(r"(\d+) \[(.*?)\] \[(.*?)\] \[(.*)\]", line).groups()
        found[section, key] = value
        assert text.splitlines()[int(n) - 1].lstrip().startswith(key)
    return found


def pythons(text):
    c = configparser.ConfigParser(interpolation=None, delimiters=("=",))
    c.optionxform = str
    c.read_string(text)
    return {(s, k): v.replace("\n", " ").strip() for s in c.sections() for k, v in c[s].items()}


WORD = st.text("abcXYZ019_", min_size=1, max_size=9)
VALUE = st.text("abc =;#[]'\"{}%:,.\\$-019é", max_size=24).map(str.strip)
BLANK = st.sampled_from(["", " ", "\t", "   "])
MORE = st.tuples(st.sampled_from([" ", "\t", "    "]), VALUE.filter(bool))
KEY = st.tuples(BLANK, BLANK, VALUE, BLANK, st.lists(MORE, max_size=2), st.sampled_from(["", "\n", "# words = none\n", "; words\n"]))


@given(st.dictionaries(WORD, st.dictionaries(WORD, KEY, max_size=3), min_size=1, max_size=3), st.sampled_from(["\n", "\r\n"]))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_session_files_read_as_configparser_reads_them(sections, end):
    text = ""
    for name, keys in sections.items():
        text += f"[{name}]\n"
        for key, (before, after, value, tail, more, between) in keys.items():
            text += f"{key}{before}={after}{value}{tail}\n" + "".join(f"{indent}{v}\n" for indent, v in more) + between
    assert ours(text.replace("\n", end)) == pythons(text)


@pytest.mark.parametrize("text, line, words", [
    ("[a]\nb = 1\nc\n", 3, "expected 'key = value'"), ("[a\n", 1, "[section]"), (" a = 1\n", 1, "indented"),
    ("[a]\n\n  b = 1\n", 3, "indented"), ("[a]\nb c = 1\n", 2, "letters, digits"), ("[a]\nb = 1\n  2\n  3\n= 4\n", 5, "letters, digits")])
def test_what_is_no_session_file_is_refused_with_its_line(text, line, words):
    said = parts("ini", stdin=text.encode(), code=1)
    assert said.startswith(f"stdin:{line}: ") and words in said


# ---- command lines ---------------------------------------------------------------------------------------

@given(st.text("ab '\"\\\t$*;é", max_size=20))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_command_lines_are_split_as_shlex_splits_them(text):
    try:
        want = shlex.split(text)
    except ValueError as err:                 # a backslash at the end is a word's last character to us, an error to shlex
        if "quotation" in str(err):
            parts("words", stdin=text.encode(), code=1)
        return
    assert parts("words", stdin=text.encode()).splitlines() == want
