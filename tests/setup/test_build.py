"""What the Makefile does, asked with make -n: what is built again, and when."""
import os
import re

import pytest
from conftest import BUILD, TOP, environment
from process import execute

OBJECT = "obj/common/base/cli.o"


def would_run(*args):
    """The commands that make would run (make -n)."""
    if BUILD.name == "san":
        args = ("SAN=1", *args)
    p = execute(["make", "-n", *args], cwd=TOP, env=environment(MAKEFLAGS="", MAKELEVEL="", CI=""), capture_output=True, text=True)
    assert p.returncode == 0, p.stderr
    return re.findall(r"^(?:gcc|cc|clang|g\+\+)\b.*", p.stdout, re.M)


def made(*args):
    """Objects and programs that make would make."""
    return re.findall(r" -o (\S+)", "\n".join(would_run(*args)))


@pytest.fixture(scope="module")
def built():
    path = f"{BUILD.relative_to(TOP)}/{OBJECT}"
    assert (TOP / path).is_file() and not made(path), "build/ is not up to date: run make first"
    return path


@pytest.mark.parametrize("change", ["OPT=-O1", "CC=cc", "CPPFLAGS=-DMORE"])
def test_another_compiler_or_flag_builds_again(built, change):
    assert built in made(built, change)


def test_warnings_as_errors_are_no_other_program(built):
    assert not made(built, "CI=1")


def test_other_linker_flags_link_again_and_compile_nothing(built):
    objects = made(f"{BUILD.relative_to(TOP)}/bin/ilftrace", "LDFLAGS=-Wl,-O1")
    assert objects == [f"{BUILD.relative_to(TOP)}/bin/ilftrace"]


def test_help_names_the_three_main_targets_first():
    p = execute(["make", "-s", "help"], cwd=TOP, env=environment(MAKEFLAGS="", MAKELEVEL=""), capture_output=True, text=True)
    targets = re.findall(r"^  (\S+)", p.stdout, re.M)
    assert targets[:3] == ["demo", "test", "install"] and {"figures", "report", "stability", "bench", "SAN=1"} <= set(targets)
    phony = set(re.findall(r"^\.PHONY:(.*)$", (TOP / "Makefile").read_text(), re.M)[0].split())
    assert {"all", "radiance", "tools", "env", "deps", "clean"} <= set(targets) & (phony | {"env"})
    assert not os.path.exists(TOP / "help")
