"""Which build of a program a number came from: the first digits of the SHA-256 of its bytes.

Rules of the scenes keep the same digests as files (rules.mk), and write those of a light field's programs beside it (X.ilf.programs).
"""
import functools
import hashlib
import os
import re

DIGITS = 12
# what starts a program that no command names: the virtual camera, and the report's probes by rays
STARTS = {"virtualcamera": ("rtrace",), "probes": ("rtrace",)}


@functools.lru_cache(None)
def _digest(path, _changed):
    with open(path, "rb") as f:
        return hashlib.file_digest(f, "sha256").hexdigest()[:DIGITS]


def digest(path):
    return _digest(str(path), os.stat(path).st_mtime_ns)


def programs(text, folder):
    """{name: digest} of the programs in `folder` that a shell text names, and of those that they start."""
    words = set(re.findall(r"[\w./-]+", text))
    words |= {started for w in words for started in STARTS.get(w, ())}
    there = {w: os.path.join(folder, w) for w in sorted(words) if "/" not in w}
    return {w: digest(p) for w, p in there.items() if os.path.isfile(p) and os.access(p, os.X_OK)}


def read(path):
    """{name: digest} of an X.ilf.programs."""
    with open(path) as f:
        return dict(line.split() for line in f)
