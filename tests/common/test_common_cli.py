"""common/cli and common/outfile: what every command line promises, and outputs that are whole or not there."""
import os
import pathlib
import resource
import signal
import stat
import subprocess

import pytest
from common_util import CLITOOL, refused, run
from process import execute, Process


def default_signals():
    """A program started in the background inherits ignored signals; these tests send them."""
    for s in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT, signal.SIGTERM):
        signal.signal(s, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def out(*args):
    p = run(CLITOOL, *args)
    assert p.returncode == 0, p.stderr
    return p.stdout.decode()


def facts(*args):
    lines = out(*args).splitlines()
    return dict(w.split("=") for w in lines[1].split()), [x[1:-1] for x in lines[2:]]


# ---- options -----------------------------------------------------------------------------------------

def test_help_goes_to_stdout_and_names_every_option():
    p = run(CLITOOL, "--help")
    text = p.stdout.decode()
    assert p.returncode == 0 and p.stderr == b""
    assert text.startswith("Usage: clitool [OPTION]... [OPERAND...]\nPrints what it was given.\n")
    for name in "output mode flag whole real size three quiet threads help version".split():
        assert f"--{name}" in text
    assert max(map(len, text.splitlines())) <= 80
    columns = {line.index(word) for line in text.splitlines() for word in ("write standard", "a flag", "three numbers")
               if word in line}
    assert len(columns) == 1


def test_version():
    name, version = out("--version").split()
    assert name == "clitool" and version[0].isdigit()


def test_forms_of_an_option():
    for args in (["--whole", "-3"], ["--whole=-3"], ["-w", "-3"], ["-w-3"], ["--wh=-3"], ["-fw-3"]):
        assert facts(*args)[0]["whole"] == "-3"
    assert facts("-fq")[0] == facts("--flag", "--quiet")[0]
    assert facts("--real", "1/4")[0]["real"] == "0.25"
    assert facts("--size=640x480")[0]["size"] == "640x480"
    assert facts("--three", "1,2.5,-3e2")[0]["three"] == "1,2.5,-300"
    assert facts("--three", "1, 2.5, -3e2")[0]["three"] == "1,2.5,-300"
    assert facts("--threads=3")[0]["threads"] == "3"


def test_operands_keep_their_order():
    _, operands = facts("a", "-5", "--flag", "-", "-.5", "b c", "--", "--flag", "-x")
    assert operands == ["a", "-5", "-", "-.5", "b c", "--flag", "-x"]


def test_command_line_as_text():
    first = out("-f", "it's", "", "a b", "x=1", "n\nl").splitlines()[0]
    assert first == r"""clitool -f 'it'\''s' '' 'a b' x=1 'n?l'"""


@pytest.mark.parametrize("args, words", [
    (["--nonsense"], "unknown option --nonsense"),
    (["-Z"], "unknown option -Z"),
    (["--s", "1"], "ambiguous"),
    (["--step", "x"], "--steps"),
    (["--flag=1"], "takes no value"),
    (["--whole"], "found none"),
    (["-w"], "found none"),
    (["--whole", "3.5"], "expected a whole number, found '3.5'"),
    (["--whole", "99999999999"], "whole number"),
    (["--whole", ""], "whole number"),
    (["--real", "nan"], "finite number"),
    (["--real", "1e999"], "finite number"),
    (["--real", "1/0"], "finite number"),
    (["--real", "2x"], "finite number"),
    (["--size", "0x5"], "WxH"),
    (["--size", "5"], "WxH"),
    (["--size", "5x5x5"], "WxH"),
    (["--size", "-5x5"], "WxH"),
    (["--three", "1,2"], "expected 3 numbers"),
    (["--three", "1,2,3,4"], "expected 3 numbers"),
    (["--three", "1,2,3,"], "expected 3 numbers"),
    (["--three", "1,,3"], "expected 3 numbers"),
    (["--threads", "-1"], "--threads"),
])
def test_usage_errors(args, words):
    line = refused(run(CLITOOL, *args), 2)
    assert words in line and line.endswith("; try 'clitool --help'\n")


def test_quiet_silences_remarks_only():
    assert run(CLITOOL).stderr == b"clitool: a remark\n"
    assert run(CLITOOL, "-q").stderr == b""


def on_a_terminal(*args):
    ours, theirs = os.openpty()
    p = Process([CLITOOL, *args], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=theirs)
    os.close(theirs)
    text = b""
    try:
        while data := os.read(ours, 4096):
            text += data
    except OSError:  # how a terminal says that the other end is gone
        pass
    os.close(ours)
    assert p.wait() == 0
    return text.decode()


def test_progress_bar_on_a_terminal_only():
    text = on_a_terminal("--steps", "100000")
    bars = text.split("\r")
    assert len(bars) < 120 and text.count("stepping") >= 100  # drawn when the percentage changes, not at every step
    assert "[" + "#" * 40 + "] 100%" in text
    assert "\r\x1b[Kclitool: half way\r\n" in text  # a remark takes the bar's line
    assert on_a_terminal("--steps", "1000", "--quiet") == ""
    assert run(CLITOOL, "--steps", "1000").stderr == b"clitool: half way\nclitool: a remark\n"


def test_full_standard_output_is_a_failure():
    with open("/dev/full", "w") as full:
        p = execute([CLITOOL, "x"], stdout=full, stderr=subprocess.PIPE)
    assert p.returncode == 1 and b"standard output" in p.stderr


def test_closed_pipe_is_a_failure_not_a_signal():
    r, w = os.pipe()
    os.close(r)
    p = execute([CLITOOL, "-q"], stdout=w, stderr=subprocess.PIPE)
    os.close(w)
    assert p.returncode == 1 and p.stderr.count(b"\n") == 1


def test_control_characters_in_a_name_keep_the_message_one_line(tmp_path):
    name = str(tmp_path / "no\nsuch\x1b[2Jfolder" / "f")
    line = refused(run(CLITOOL, "-o", name))
    assert "\x1b" not in line and "no?such?[2Jfolder" in line


def test_names_that_are_not_ascii(tmp_path):
    for name, shown in ((b"n\xc3\xa4h/f", "n\u00e4h/f"), (b"a\xe4\xff/f", "a??/f"), (b"a\xc2\x9b2J/f", "a??2J/f")):
        p = run(CLITOOL, "-o", os.fsdecode(os.fsencode(tmp_path) + b"/" + name))
        assert shown in refused(p)


# ---- outputs -----------------------------------------------------------------------------------------

def write(path, data=b"new", *more, **kw):
    return run(CLITOOL, "-o", path, *more, input=data, **kw)


def leftovers(folder):
    return sorted(x.name for x in folder.iterdir())


def test_output_is_written_with_the_umask(tmp_path):
    old = os.umask(0o027)
    try:
        assert write(tmp_path / "f", b"x" * 100000).returncode == 0
    finally:
        os.umask(old)
    assert (tmp_path / "f").read_bytes() == b"x" * 100000
    assert stat.S_IMODE((tmp_path / "f").stat().st_mode) == 0o640
    assert leftovers(tmp_path) == ["f"]


def test_replaced_file_keeps_its_mode_and_a_link_stays(tmp_path):
    (tmp_path / "real").write_bytes(b"old")
    (tmp_path / "real").chmod(0o600)
    (tmp_path / "link").symlink_to("real")
    assert write(tmp_path / "link").returncode == 0
    assert (tmp_path / "link").is_symlink() and (tmp_path / "real").read_bytes() == b"new"
    assert stat.S_IMODE((tmp_path / "real").stat().st_mode) == 0o600
    assert leftovers(tmp_path) == ["link", "real"]


def test_relative_and_long_names(tmp_path):
    assert write("f", cwd=tmp_path).returncode == 0
    assert write("n" * 255, cwd=tmp_path).returncode == 0
    assert leftovers(tmp_path) == ["f", "n" * 255]


@pytest.mark.parametrize("how", ["abort", "fail"])
def test_given_up_output_leaves_the_old_file(tmp_path, how):
    (tmp_path / "f").write_bytes(b"old")
    p = write(tmp_path / "f", b"new", "--mode", how)
    assert p.returncode == (how == "fail")
    if how == "fail":
        refused(p)
    assert (tmp_path / "f").read_bytes() == b"old" and leftovers(tmp_path) == ["f"]


@pytest.mark.parametrize("sig", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGKILL])
def test_killed_run_leaves_the_old_file(tmp_path, sig):
    (tmp_path / "f").write_bytes(b"old")
    p = Process([CLITOOL, "-o", tmp_path / "f", "--mode", "wait"], stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, preexec_fn=default_signals)
    assert p.stdout.readline() == b"waiting\n"
    assert len(leftovers(tmp_path)) == 2
    p.send_signal(sig)
    assert p.wait() == -sig
    assert (tmp_path / "f").read_bytes() == b"old"
    if sig != signal.SIGKILL:  # nothing can tidy up after that one
        assert leftovers(tmp_path) == ["f"]


def test_an_ignored_hangup_stays_ignored(tmp_path):
    p = Process([CLITOOL, "-o", tmp_path / "f", "--mode", "wait"], stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    p.stdout.readline()
    p.send_signal(signal.SIGHUP)
    with pytest.raises(subprocess.TimeoutExpired):
        p.wait(0.3)
    p.terminate()
    assert p.wait() == -signal.SIGTERM and leftovers(tmp_path) == []


def test_no_space(tmp_path):
    assert "No space left" in refused(write("/dev/full"))

    def small_files():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
    (tmp_path / "f").write_bytes(b"old")
    assert "too large" in refused(write(tmp_path / "f", b"x" * 5000, preexec_fn=small_files))
    assert (tmp_path / "f").read_bytes() == b"old" and leftovers(tmp_path) == ["f"]


def test_standard_output_and_pipes(tmp_path):
    p = write("-", b"abc" * 50000)
    assert p.returncode == 0 and p.stdout == b"abc" * 50000
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    reader = Process(["cat", fifo], stdout=subprocess.PIPE)
    assert write(fifo, b"abc").returncode == 0
    assert reader.communicate()[0] == b"abc" and stat.S_ISFIFO(fifo.stat().st_mode)
    assert write("/dev/null").returncode == 0


@pytest.mark.parametrize("name, words", [("no/such/folder", "No such file"), ("", "empty"), (".", "folder"),
                                         ("new/", "folder"), ("file/x", "Not a directory")])
def test_places_that_cannot_be_written(tmp_path, name, words):
    (tmp_path / "file").write_bytes(b"")
    assert words in refused(write(name, cwd=tmp_path))
    assert leftovers(tmp_path) == ["file"]


def test_unwritable_folder(tmp_path):
    if os.geteuid() == 0:
        where = pathlib.Path("/proc/f")  # root may write everywhere else
    else:
        tmp_path.chmod(0o500)
        where = tmp_path / "f"
    assert "can't" in refused(write(where))
    tmp_path.chmod(0o700)
    assert leftovers(tmp_path) == []
