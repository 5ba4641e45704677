"""Files that are whole or not there."""
import os
import secrets
from contextlib import contextmanager
from pathlib import Path

from .errors import Bad


@contextmanager
def whole(path, mode="w"):
    """A file to write, which has its name only when all of it is written."""
    path = Path(path)
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with open(part, mode, **({} if "b" in mode else {"encoding": "utf-8"})) as f:
            yield f
        os.replace(part, path)
    except OSError as e:
        raise Bad(f"{path}: can't be written: {e.strerror}") from None
    finally:
        part.unlink(missing_ok=True)
