"""Text files of numbers, a row a line."""
from .errors import Bad


def rows(path, between=None):
    """(number of the line, its numbers, the line) for each line that is not blank or a "#" comment.  The numbers stand between blanks, or
    `between` too; they are [] where a word is none, for the caller to refuse.  Raises Bad where the file can't be read."""
    try:
        with open(path, encoding="utf-8") as f:
            lines = f.read().splitlines()
    except (OSError, UnicodeDecodeError) as e:
        raise Bad(f"{path}: can't be opened: {getattr(e, 'strerror', None) or 'not a text'}") from None
    for k, line in enumerate(lines, 1):
        words = line.partition("#")[0].replace(between or " ", " ").split()
        if not words:
            continue
        try:
            yield k, [float(w) for w in words], line
        except ValueError:
            yield k, [], line
