"""What ends the program: one line, and an exit status."""


class Bad(Exception):
    """An input that can't be used; the words are the line that is printed (file: what was expected, what was found).  Exit status 1."""


class Usage(Exception):
    """A command line that can't be used.  Exit status 2."""
