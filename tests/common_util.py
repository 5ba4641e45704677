"""Writers of picture files for the tests of common/: plain Python from the formats' definitions, so
that what our readers are compared with is not the library they use."""
import os
import pathlib
import struct
import subprocess
import sys
import zlib

import numpy as np
import OpenEXR
from process import execute

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "scenes"))
from rgbe import values as value_of  # noqa: E402,F401

BUILD = pathlib.Path(os.environ.get("ILF_BUILD", "build")).resolve()
IMGTOOL = BUILD / "test" / "imgtool"
CLITOOL = BUILD / "test" / "clitool"
# under the sanitizer too, memory that isn't there is a NULL for us to report
os.environ["ASAN_OPTIONS"] = "allocator_may_return_null=1:" + os.environ.get("ASAN_OPTIONS", "")


def run(program, *args, **kw):
    """The finished process."""
    kw.setdefault("stdin", subprocess.DEVNULL)
    if "input" in kw:
        del kw["stdin"]
    return execute([str(program), *map(str, args)], capture_output=True, **kw)


def refused(p, code=1):
    """One line of the form prog: words on stderr, the exit code as said; gives the line."""
    err = p.stderr.decode()
    assert p.returncode == code, (p.returncode, err)
    assert err.count("\n") == 1 and err.endswith("\n") and err.split(":")[0] in ("imgtool", "clitool"), err
    return err


def load(path, tmp_path, how="dump", **kw):
    """(height, width, channels) float32 as our reader gives it."""
    out = tmp_path / "pixels.f32"
    p = run(IMGTOOL, "--quiet", how, path, out, **kw)
    assert p.returncode == 0, p.stderr.decode()
    assert p.stderr == b""
    w, h, c = np.fromfile(out, np.int32, 3)
    return np.fromfile(out, np.float32, offset=12).reshape(h, w, c)


def both(path, tmp_path):
    """The whole-picture and the row reader must agree bit for bit."""
    a, b = load(path, tmp_path), load(path, tmp_path, "rows")
    assert a.tobytes() == b.tobytes()
    return a


def probe(path):
    p = run(IMGTOOL, "probe", path)
    assert p.returncode == 0, p.stderr.decode()
    words = p.stdout.decode().split()
    info = dict(w.split("=") for w in words[2:])
    return {"format": words[0], "size": tuple(map(int, words[1].split("x"))), **{k: float(v) for k, v in info.items()}}


W, H = 37, 23  # odd, and no multiple of any tile, strip or chunk


def codes(samples, maximum, w=W, h=H, seed=1):
    rng = np.random.default_rng(seed)
    a = rng.integers(0, maximum, (h, w, samples), endpoint=True)
    a[0, 0], a[-1, -1] = 0, maximum
    return a


def radiance(w=W, h=H, channels=3, decades=12, seed=2):
    """Positive values over many decades with black and constant stretches."""
    rng = np.random.default_rng(seed)
    a = (10 ** rng.uniform(-decades / 2, decades / 2, (h, w, channels))).astype(np.float32)
    a[1] = 0
    a[2, w // 4:] = a[2, 0]
    return a


# ---- Radiance ---------------------------------------------------------------------------------------

def rgbe_of(rgb):
    """Codes of non-negative radiances, cut off as Radiance does: (..., 4) bytes."""
    top = rgb.max(axis=-1)
    _, e = np.frexp(top)
    codes = np.floor(np.ldexp(rgb.astype(np.float64), (8 - e)[..., None])).astype(np.uint8)
    out = np.concatenate([codes, (e + 128)[..., None].astype(np.uint8)], axis=-1)
    out[top <= 1e-32] = 0
    return out


def line_new(codes):
    """New run lengths: runs of 2 and more, so that short ones are tried too."""
    w = len(codes)
    out = bytearray([2, 2, w >> 8, w & 255])
    for c in range(4):
        col, x = codes[:, c], 0
        while x < w:
            n = 1
            while x + n < w and n < 127 and col[x + n] == col[x]:
                n += 1
            if n >= 2:
                out += bytes([128 + n, int(col[x])])
            else:
                while x + n < w and n < 128 and (x + n + 1 >= w or col[x + n] != col[x + n + 1]):
                    n += 1
                out += bytes([n]) + col[x:x + n].tobytes()
            x += n
    return bytes(out)


def line_old(codes):
    """Old run lengths: 1 1 1 n repeats the last pixel; long runs take several counts, lowest byte first."""
    out, x = bytearray(), 0
    while x < len(codes):
        out += codes[x].tobytes()
        n = 1
        while x + n < len(codes) and (codes[x + n] == codes[x]).all():
            n += 1
        left = n - 1
        while left:
            out += bytes([1, 1, 1, left & 255])
            left >>= 8
        x += n
    return bytes(out)


def write_hdr(path, codes, order="-Y +X", line=line_new, header="", start="#?RADIANCE\n", fmt="rgbe"):
    """codes: (height, width, 4) as shown; order says how they are stored."""
    a = codes
    slow, fast = order.split()
    for axis in (slow, fast):
        if axis == "+Y":
            a = a[::-1]
        if axis == "-X":
            a = a[:, ::-1]
    if slow[1] == "X":
        a = a.transpose(1, 0, 2)
    h, w = codes.shape[:2]
    size = {"X": w, "Y": h}
    text = f"{start}{header}FORMAT=32-bit_rle_{fmt}\n\n{slow} {size[slow[1]]} {fast} {size[fast[1]]}\n"
    path.write_bytes(text.encode() + b"".join(line(np.ascontiguousarray(x)) for x in a))


# ---- PNG --------------------------------------------------------------------------------------------

def _pack(rows, bits):
    """(height, samples) codes to bytes."""
    if bits == 16:
        return [r.astype(">u2").tobytes() for r in rows]
    if bits == 8:
        return [r.astype(np.uint8).tobytes() for r in rows]
    return [np.packbits(((r[:, None] >> np.arange(bits - 1, -1, -1)) & 1).astype(np.uint8).ravel()).tobytes() for r in rows]


def write_png(path, codes, bits, colour, interlace=False, palette=None, gamma=None):
    """codes: (height, width, samples); colour: PNG's colour type."""
    h, w, s = codes.shape
    chunk = lambda tag, data: struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data))
    passes = [(0, 0, 1, 1)]
    if interlace:
        passes = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2)]
    data = b""
    for x0, y0, dx, dy in passes:
        part = codes[y0::dy, x0::dx]
        if part.size:
            data += b"".join(b"\0" + r for r in _pack(part.reshape(part.shape[0], -1), bits))
    out = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", w, h, bits, colour, 0, 0, int(interlace)))
    if gamma:
        out += chunk(b"gAMA", struct.pack(">I", int(gamma * 100000)))
    if palette is not None:
        out += chunk(b"PLTE", palette.astype(np.uint8).tobytes())
    path.write_bytes(out + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))


# ---- TIFF -------------------------------------------------------------------------------------------

def write_tiff(path, a, order="<", photometric=None, separate=False, tile=None, rows=3, deflate=False,
               orientation=None, extra=None, palette=None, more=()):
    """a: (height, width, samples) uint8, uint16 or float32, as stored.  rows: lines of a strip; tile: (w, h)."""
    h, w, s = a.shape
    a = a.astype(a.dtype.newbyteorder(order))
    planes = [a[:, :, i:i + 1] for i in range(s)] if separate else [a]
    units = []
    for p in planes:
        if tile:
            tw, th = tile
            for y in range(0, h, th):
                for x in range(0, w, tw):
                    t = np.zeros((th, tw, p.shape[2]), a.dtype)
                    part = p[y:y + th, x:x + tw]
                    t[:part.shape[0], :part.shape[1]] = part
                    units.append(t.tobytes())
        else:
            units += [p[y:y + rows].tobytes() for y in range(0, h, rows)]
    if deflate:
        units = [zlib.compress(u) for u in units]
    kind = 3 if a.dtype.kind == "f" else 1
    if photometric is None:
        photometric = 2 if s >= 3 else 1
    tags = {256: (4, [w]), 257: (4, [h]), 258: (3, [a.itemsize * 8] * s), 259: (3, [8 if deflate else 1]),
            262: (3, [photometric]), 277: (3, [s]), 284: (3, [2 if separate else 1]), 339: (3, [kind] * s)}
    if orientation:
        tags[274] = (3, [orientation])
    if extra is not None:
        tags[338] = (3, extra)
    if palette is not None:
        tags[320] = (3, palette.T.ravel().tolist())
    offset, data = 8, b""
    offsets = []
    for u in units:
        offsets.append(offset + len(data))
        data += u + b"\0" * (len(u) % 2)
    if tile:
        tags.update({322: (4, [tile[0]]), 323: (4, [tile[1]]), 324: (4, offsets), 325: (4, [len(u) for u in units])})
    else:
        tags.update({278: (4, [rows]), 273: (4, offsets), 279: (4, [len(u) for u in units])})
    tags.update(dict(more))
    path.write_bytes(_tiff_file(order, tags, data))


def _tiff_file(order, tags, data):
    code = {1: "B", 2: "B", 3: "H", 4: "I", 5: "I", 7: "B", 10: "i"}
    entries, tail = b"", b""
    at = 8 + len(data)
    tail_at = at + 2 + 12 * len(tags) + 4
    for tag in sorted(tags):
        kind, values = tags[tag]
        raw = struct.pack(order + code[kind] * len(values), *values)
        count = len(values) // 2 if kind in (5, 10) else len(values)
        if len(raw) > 4:
            where = struct.pack(order + "I", tail_at + len(tail))
            tail += raw + b"\0" * (len(raw) % 2)
        else:
            where = raw + b"\0" * (4 - len(raw))
        entries += struct.pack(order + "HHI", tag, kind, count) + where
    magic = b"II" if order == "<" else b"MM"
    return magic + struct.pack(order + "HI", 42, at) + data + struct.pack(order + "H", len(tags)) + entries \
        + struct.pack(order + "I", 0) + tail


def write_dng(path, cfa, white=4095, seconds=(1, 8), f_number=(28, 10), iso=200, orientation=None):
    """A minimal raw file: 16 bit Bayer RGGB, camera primaries = sRGB's, neutral white balance."""
    h, w = cfa.shape
    xyz_to_srgb = [32405, -15371, -4985, -9693, 18760, 416, 556, -2040, 10572]
    matrix = [v for x in xyz_to_srgb for v in (x, 10000)]
    make = list(b"Test\0")
    more = {254: (4, [0]), 271: (2, make), 272: (2, make), 33421: (3, [2, 2]), 33422: (1, [0, 1, 1, 2]),
            34665: (4, [0]), 50706: (1, [1, 4, 0, 0]),
            50707: (1, [1, 1, 0, 0]), 50708: (2, make), 50714: (3, [0]), 50717: (3, [white]), 50721: (10, matrix),
            50728: (5, [1, 1, 1, 1, 1, 1]), 50778: (3, [21])}
    exif = {33434: (5, list(seconds)), 33437: (5, list(f_number)), 34855: (3, [iso])}
    for _ in range(2):  # the second time with the place of the EXIF directory
        write_tiff(path, cfa[:, :, None].astype(np.uint16), photometric=32803, rows=h, more=more, orientation=orientation)
        end = path.stat().st_size
        more[34665] = (4, [end])
    entries = b"".join(struct.pack("<HHII", t, k, 1, v[0]) if k == 3 else struct.pack("<HHII", t, k, 1, end + 42 + 8 * i)
                       for i, (t, (k, v)) in enumerate(sorted(exif.items())))
    values = b"".join(struct.pack("<II", *v) for _, (k, v) in sorted(exif.items()) if k == 5)
    path.write_bytes(path.read_bytes() + struct.pack("<H", 3) + entries + struct.pack("<I", 0) + values)


# ---- PNM, PFM ---------------------------------------------------------------------------------------

def write_pnm(path, codes, maximum, text=False, header_comment=True):
    h, w, s = codes.shape
    kind = {(1, True): "P2", (3, True): "P3", (1, False): "P5", (3, False): "P6"}[s, text]
    head = f"{kind}\n" + ("# a comment 1 2\n" if header_comment else "") + f"{w} {h}\n{maximum}\n"
    if text:
        body = "\n".join(" ".join(map(str, r)) for r in codes.reshape(h, -1).tolist()).encode() + b"\n"
    else:
        body = codes.astype(">u2" if maximum > 255 else np.uint8).tobytes()
    path.write_bytes(head.encode() + body)


def write_pfm(path, a, order="<", scale=1.0):
    h, w, s = a.shape
    kind = "PF" if s == 3 else "Pf"
    sign = -1 if order == "<" else 1
    path.write_bytes(f"{kind}\n{w} {h}\n{sign * scale}\n".encode() + a[::-1].astype(order + "f4").tobytes())


# ---- OpenEXR ----------------------------------------------------------------------------------------

def write_exr(path, channels, **header):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File(header, channels).write(str(path))
