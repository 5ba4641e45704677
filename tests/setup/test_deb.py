"""The packages that `make deb` makes (make test-deb installs them in a clean root): names, dependencies, who owns what, the same bytes each time."""
import re
import shutil

import pytest
from conftest import BUILD, TOP, environment
from process import execute
from test_install import OURS

pytestmark = [pytest.mark.sweep, pytest.mark.skipif(not shutil.which("dpkg-shlibdeps") or BUILD.name == "san", reason="no dpkg-dev, or a build with sanitizers")]


def sh(text):
    p = execute(["bash", "-euo", "pipefail", "-c", text], cwd=TOP, env=environment(MAKEFLAGS="", MAKELEVEL=""), capture_output=True, text=True)
    assert p.returncode == 0, p.stderr
    return p.stdout


@pytest.fixture(scope="module")
def packages():
    """{name: file}, of a build that was done twice."""
    found = []
    for _ in range(2):
        sh("make -s deb")
        found.append({f.name.split("_")[0]: f.read_bytes() for f in (TOP / "build/deb").glob("*.deb")})
    assert found[0] == found[1]
    return {f.name.split("_")[0]: f for f in (TOP / "build/deb").glob("*.deb")}


def test_names(packages):
    assert set(packages) == {"ilf-tools", "libilf0", "libilf-dev", "python3-ilf"}
    for f in packages.values():
        control = sh(f"dpkg-deb -f {f}")
        for field in ("Package", "Source", "Maintainer", "Description"):
            assert "radiance" not in re.search(rf"^{field}: (.*)$", control, re.M)[1].lower()


def test_programs_do_not_take_others_names(packages):
    files = re.findall(r" \./(\S+)", sh(f"dpkg-deb -c {packages['ilf-tools']}"))
    seen = {f.removeprefix("usr/bin/") for f in files if f.startswith("usr/bin/")} - {""}
    assert seen == {"ilf-hdrgen" if p == "hdrgen" else p for p in OURS}
    apart = {f.removeprefix("usr/lib/ilf/bin/") for f in files if f.startswith("usr/lib/ilf/bin/")} - {""}
    assert set(OURS) | {"rpict", "rtrace", "oconv", "genbox"} <= apart
    assert not any(f.startswith(("usr/lib/ray", "usr/local", "etc")) for f in files)
    assert "usr/lib/ilf/Radiance-License.txt" in files and "usr/share/zsh/vendor-completions/_ilf-hdrgen" in files


def test_every_library_that_a_program_wants_is_in_a_package_that_is_named(packages):
    named = set(re.findall(r"([a-z0-9.+-]+)(?: \(|,|$)", sh(f"dpkg-deb -f {packages['ilf-tools']} Depends").strip()))
    wanted = set(sh(f"for p in {' '.join(OURS)} rpict oconv genbox; do readelf -d {BUILD}/bin/$p {TOP}/build/bin/$p 2>/dev/null || :; done | "
                    "sed -n 's/.*NEEDED.*\\[\\(.*\\)\\]/\\1/p' | sort -u").split())
    for library in wanted:
        owners = {line.split(":")[0] for line in sh(f"dpkg -S '*/{library}' || :").splitlines()}
        assert owners & named or library.startswith("ld-linux"), library
