"""What libilf refuses, as exceptions.  Each one's text is libilf's own one line: the file, what was expected, what was found."""
import os

from ._library import ffi, lib


class Error(Exception):
    """The base of all; ``str(e)`` is one line."""


class FileError(Error, OSError):
    """The system refused to open, read or write."""


class FormatError(Error, ValueError):
    """The file breaks the format; the words name attribute or probe."""


class TexelError(Error, ValueError):
    """A texel is NaN or infinite; the words name probe and pixel."""


class ArgumentError(Error, ValueError):
    """An argument is out of its range."""


class OutOfMemory(Error, MemoryError):
    """There was not enough memory."""


class ChangedError(Error, OSError):
    """The file was changed in place while it was open.  (To replace one in use, rename a new one to its name.)"""


KINDS = {lib.ILF_ERR_IO: FileError, lib.ILF_ERR_FORMAT: FormatError, lib.ILF_ERR_VALUE: TexelError, lib.ILF_ERR_ARG: ArgumentError,
         lib.ILF_ERR_MEMORY: OutOfMemory, lib.ILF_ERR_CHANGED: ChangedError}


def call(function, *args):
    """Call a function of libilf whose last argument is its ilf_error."""
    err = ffi.new("ilf_error *")
    status = function(*args, err)
    if status != lib.ILF_OK:
        raise KINDS.get(status, Error)(os.fsdecode(ffi.string(err.text)))
