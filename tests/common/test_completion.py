"""Shell completion, made by the programs of their own option tables: what bash and zsh offer is what --help names and the program takes."""
import os
import pty
import re
import select
import time

import pytest
from conftest import BIN, environment, needed, run
from process import execute
from test_help import OURS

ASKED = re.compile(r"^ +(?:-(\w), )?--([a-z-]+)", re.M)


def options(program):
    """(letters, long names) as --help has them."""
    found = ASKED.findall(run(program, "--help").text.split("\nOptions:\n")[1])
    return {f"-{s}" for s, _ in found if s}, {f"--{n}" for _, n in found}


@pytest.fixture(scope="module")
def scripts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("completion")
    for p in OURS:
        (folder / f"{p}.bash").write_text(run(p, "--completion=bash").text)
        (folder / f"_{p}").write_text(run(p, "--completion=zsh").text)
    return folder


def offered(scripts, program, *lines, cwd=None):
    """What bash's function has in COMPREPLY for each line (a list of words, the last being typed)."""
    asks = "\n".join("ask " + " ".join(f"'{w}'" for w in (program, *line)) for line in lines)
    text = f"""source '{scripts}/{program}.bash'
        complete -p {program} >&2
        ask() {{ COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _ilf_complete_{program}; local IFS=' '; echo "${{COMPREPLY[*]}}"; }}
        {asks}"""
    p = execute(["bash", "--norc", "--noprofile", "-uc", text], capture_output=True, text=True, cwd=cwd)
    assert p.returncode == 0 and p.stderr == f"complete -F _ilf_complete_{program} {program}\n", p.stderr
    return [line.split() for line in p.stdout.split("\n")[:len(lines)]]


@pytest.mark.parametrize("program", OURS)
def test_all_options_are_offered_and_no_others(scripts, program):
    letters, names = options(program)
    dash, = offered(scripts, program, ["-"])
    assert set(dash) == letters | names and len(dash) == len(set(dash))
    zsh = (scripts / f"_{program}").read_text()
    assert zsh.startswith(f"#compdef {program}\n")
    assert set(re.findall(r"^ +(?:'[^']*')?(?:\{-\w\+?,|')(--[a-z-]+)", zsh, re.M)) == names
    assert set(re.findall(r"\{(-\w)\+?,", zsh)) == letters


@pytest.mark.parametrize("program", OURS)
def test_words_that_are_offered_are_taken(scripts, tmp_path, program):
    """Each offered word passes, each nonsense in its place is refused: nothing is offered in the wrong place, or forgotten by a change."""
    names = sorted(options(program)[1])
    asked = offered(scripts, program, *[[n, "=", ""] for n in names], cwd=tmp_path)
    zsh = (scripts / f"_{program}").read_text()
    for name, words in zip(names, asked):
        for word in words:
            p = execute([BIN / program, f"{name}={word}", "--no-such-option"], env=environment(), capture_output=True, text=True)
            assert p.returncode == 2 and "no-such-option" in p.stderr, p.stderr      # refused for that, not for the word
            assert re.search(rf"{name}=.*[(\" ]{re.escape(word)}[)\" ]", zsh), (name, word)


def test_values(scripts, tmp_path):
    for f in ("curve.svg", "curve.txt", "my plot.svg"):
        (tmp_path / f).touch()
    (tmp_path / "plots").mkdir()
    got = offered(scripts, "hdrgen", ["--type", ""], ["--type", "=", "h"], ["--type", "="], ["-w", "n"], ["--align", ""], ["--align", "=", "a"],
                  ["--plot", ""], ["--lambda", ""], ["--", "--al"], ["--al"], ["a.jpg", "--refine-t"], cwd=tmp_path)
    got[6].sort()
    assert got == [["float", "half"], ["half"], ["float", "half"], ["noise"], [], ["always", "auto"],
                   ["curve.svg", "my", "plot.svg", "plots"], [], [], ["--align"], ["--refine-times"]]
    assert offered(scripts, "stagectl", ["ca"], ["capture", "ca"]) == [["capture"], []]


def test_what_no_shell_has_is_refused():
    r = run("ilfinfo", "--completion=fish", code=2)
    assert r.err == "ilfinfo: option --completion: expected bash or zsh, found 'fish'; try 'ilfinfo --help'\n"


def test_it_is_for_the_name_that_the_program_has(tmp_path):
    (tmp_path / "ilf-hdrgen").symlink_to(BIN / "hdrgen")
    for shell, line in (("bash", "complete -F _ilf_complete_hdrgen ilf-hdrgen"), ("zsh", "#compdef ilf-hdrgen")):
        p = execute([tmp_path / "ilf-hdrgen", f"--completion={shell}"], env=environment(), capture_output=True, text=True)
        assert line in p.stdout.splitlines()


def typed(argv, env, cwd, steps):
    """A shell on a terminal of its own: types each text, waits for what is expected; what the terminal showed."""
    pid, fd = pty.fork()
    if pid == 0:
        os.chdir(cwd)
        os.execvpe(argv[0], argv, env)
    shown, ends = "", time.monotonic() + 30
    try:
        for text, awaited in steps:
            os.write(fd, text.encode())
            seen = len(shown)
            while not re.search(awaited, shown[seen:]):
                assert time.monotonic() < ends and select.select([fd], [], [], 30)[0], shown
                shown += os.read(fd, 4096).decode(errors="replace")
    finally:
        os.kill(pid, 9)
        os.waitpid(pid, 0)
        os.close(fd)
    return shown


PLAIN = {"PATH": "/usr/bin:/bin", "TERM": "dumb", "LC_ALL": "C.UTF-8", "COLUMNS": "200"}


def test_at_a_prompt_of_bash(scripts, tmp_path):
    (tmp_path / "a picture.png").touch()
    (tmp_path / "exposure one.jpg").touch()
    typed(["bash", "--norc", "--noprofile", "-i"], {**PLAIN, "PS1": "$ "}, tmp_path, [
        (f"hdrgen() {{ echo \"<$*>\"; }}; source {scripts}/hdrgen.bash; source {scripts}/ilfinfo.bash; echo so'me'thing\n", "something"),
        ("hdrgen --refi\t --ty\tha\t -t exp\t\n", r"<--refine-times --type half -t exposure one\.jpg>"),
        ("hdrgen --type=ha\t exp\t\n", r"<--type=half exposure one\.jpg>"),
        ("ilfinfo() { hdrgen \"$@\"; }; ilfinfo --mon\ta\t\n", r"<--montage a picture\.png>")])


def test_at_a_prompt_of_zsh(scripts, tmp_path):
    needed("zsh")
    (tmp_path / "a picture.png").touch()
    (tmp_path / "exposure one.jpg").touch()
    typed(["zsh", "-f", "-i"], {**PLAIN, "PS1": "$ ", "HOME": str(tmp_path)}, tmp_path, [
        (f"fpath=({scripts} $fpath); autoload -U compinit; compinit -u -D; hdrgen() {{ print \"<$*>\"; }}; print so'me'thing\n", "something"),
        ("hdrgen --refi\t --ty\tha\t -t exp\t\n", r"<--refine-times --type=half -t exposure one\.jpg>"),
        ("ilfinfo() { hdrgen \"$@\"; }; ilfinfo --mon\ta\t\n", r"<--montage=a picture\.png>"),
        ("fishremap() { hdrgen \"$@\"; }; fishremap --lens equis\t -o exp\t\n", r"<--lens equisolid -o exposure one\.jpg>")])
