"""Which builds the numbers came from: the rows' programs, counted, and the version that they call themselves."""
import subprocess
from collections import Counter

from . import run


def words(command):
    """First line that a command prints, or nothing where there is no such program or it fails."""
    try:
        p = subprocess.run(command, cwd=run.TOP, env=run.environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    except OSError:
        return ""
    return p.stdout.partition("\n")[0].strip() if p.returncode == 0 else ""


def version():
    """A sentence: the version, and the commit of the sources when the page was made."""
    named, commit = words(["ilfpack", "--version"]), words(["git", "describe", "--always", "--dirty", "--abbrev=12"])
    return f"Version {named.split()[-1] if named else 'unknown'}" + (f", sources at commit {commit.replace('-dirty', ', with changes that are not committed')}." if commit else ".")


def table(sections):
    """[(program, digest, numbers that came from it, remark)] by name; a remark where another build is there by now."""
    count = Counter(tuple(word.split()) for rows in sections.values() for r in rows for word in r["programs"].split(", ") if word)
    now = run.programs(" ".join(name for name, _ in count))
    return [(name, digest, n, "" if now.get(name) == digest else f"another build is there by now: {now.get(name, 'none')}")
            for (name, digest), n in sorted(count.items())]
