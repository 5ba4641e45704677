"""Radiance's pictures (32-bit_rle_rgbe) as numpy arrays: the one place of our Python that knows their bytes.

    #?RADIANCE \n  further lines of the header  \n \n  -Y rows +X columns \n  scan lines

A scan line is run-length coded byte by byte (2 2, its width in two bytes of which the first is below 128, then all R, all G, all B,
all E: n > 128 is one byte n - 128 times, else n bytes follow), or pixel by pixel, where 1 1 1 n repeats the pixel before n times
(several such in a row: n << 8, n << 16 times).
"""
import numpy as np


class RgbeError(Exception):
    """One line: the file, what was expected and what was found."""


def _coded_line(line, data, p):
    """Fill line (columns, 4) from the run lengths at p; where they end."""
    cols = len(line)
    for c in range(4):
        x = 0
        while x < cols:
            n = data[p]
            if n > 128:
                n -= 128
                line[x:x + n, c] = data[p + 1]
                p += 2
            else:
                line[x:x + n, c] = np.frombuffer(data, np.uint8, min(n, cols - x), p + 1)
                p += 1 + n
            x += n
            if n == 0 or x > cols:
                raise ValueError("a run of no length or beyond the line's end")
    return p


def _plain_line(line, data, p):
    """The same for pixels one by one."""
    cols = len(line)
    flat = np.frombuffer(data, np.uint8, min(4 * cols, len(data) - p), p)
    flat = flat[:len(flat) // 4 * 4].reshape(-1, 4)
    if len(flat) == cols and not (flat[:, :3] == 1).all(1).any():
        line[:] = flat
        return p + 4 * cols
    x = shift = 0
    while x < cols:
        pixel = data[p:p + 4]
        if len(pixel) < 4:
            raise IndexError
        p += 4
        if pixel[:3] == b"\1\1\1":
            n = pixel[3] << shift
            if x == 0 or x + n > cols:
                raise ValueError("a run before the first pixel or beyond the line's end")
            line[x:x + n] = line[x - 1]
            x, shift = x + n, shift + 8
        else:
            line[x] = np.frombuffer(pixel, np.uint8)
            x, shift = x + 1, 0
    return p


def decode(data, path):
    """(codes, header) of a file's bytes: codes (rows, columns, 4), top row first, and the header's text.  RgbeError, which
    names the path, where it is no such picture."""
    end = data.find(b"\n\n")
    header = data[:max(end, 0)].decode("latin-1")
    # programs put lines of their own in front of "#?RADIANCE"; Radiance itself asks for the format alone
    if not header.startswith("#?") and "\nFORMAT=32-bit_rle_" not in header:
        raise RgbeError(f"{path}: expected a Radiance picture, found no #? header")
    if "32-bit_rle_xyze" in header:
        raise RgbeError(f"{path}: expected 32-bit_rle_rgbe, found XYZE")
    eol = data.find(b"\n", end + 2)
    size = data[end + 2:eol].split()
    if eol < 0 or len(size) != 4 or size[0] != b"-Y" or size[2] != b"+X" or not (size[1].isdigit() and size[3].isdigit()):
        raise RgbeError(f"{path}: expected a size line -Y rows +X columns, found {data[end + 2:eol]!r}")
    rows, cols = int(size[1]), int(size[3])
    codes = np.zeros((rows, cols, 4), np.uint8)
    p, y = eol + 1, 0
    try:
        for y in range(rows):
            if 8 <= cols < 32768 and data[p] == 2 and data[p + 1] == 2 and data[p + 2] < 128:
                p = _coded_line(codes[y], data, p + 4)
            else:
                p = _plain_line(codes[y], data, p)
    except IndexError as err:
        raise RgbeError(f"{path}: expected {rows} whole rows, found the end in row {y}") from err
    except ValueError as err:
        raise RgbeError(f"{path}: row {y}: expected {cols} pixels, found {err}") from err
    return codes, header


def read(path):
    with open(path, "rb") as f:
        return decode(f.read(), path)


def values(codes):
    """What codes (..., 4) mean: (c + 1/2) 2^(e - 136), and 0 where e is 0."""
    e = codes[..., 3:].astype(int)
    return np.where(e > 0, np.ldexp(codes[..., :3] + 0.5, e - 136), 0.0)


def exposure(header):
    """The product of the header's exposures: values are radiances times it."""
    found = 1.0
    for line in header.split("\n"):
        if line.startswith("EXPOSURE="):
            found *= float(line[9:])
    return found


def radiance(path):
    """Linear radiances (rows, columns, 3), before any exposure."""
    codes, header = read(path)
    return values(codes) / exposure(header)
