"""An incident light field in numpy, written from docs/FORMAT.md (sections 1 and 2) alone.

It shares nothing with libilf, so that each can find the other's mistakes.  All arithmetic is
float64; the values of a file are taken as they are stored (half or float32).

    probes[j, i, y, x, c]   probe at grid node (i along u, j along v); row y is polar angle, column x azimuth
    frame                   rows u^, v^, n^ in world coordinates
"""
import struct

import numpy as np

PI = np.pi
SPHERE_TOL = 1e-6   # polarMax this close to pi is the full sphere (float32(pi) is 8.7e-8 above pi)
POLAR_MAX = {"hemisphere": PI / 2, "185deg": np.deg2rad(92.5), "sphere": PI}
MIRROR_ARRAY_VALID = np.deg2rad(79.64)


def unit(a):
    a = np.asarray(a, float)
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


def f32(a):
    """Rounded to float32, as a header or a ray on a pipe holds it, but float64 from here on."""
    return np.asarray(a, np.float32).astype(float)


class ILF:
    def __init__(self, probes, origin=(0, 0, 0), U=(1, 0, 0), V=(0, 1, 0), polar_max=PI / 2, polar_valid=None, N=None):
        self.probes = np.asarray(probes, float)
        assert self.probes.ndim == 5 and self.probes.shape[-1] == 3
        self.origin, self.U, self.V = f32(origin), f32(U), f32(V)
        self.polar_max = float(f32(polar_max))
        self.polar_valid = None if polar_valid is None else float(f32(polar_valid))
        self.N = None if N is None else np.asarray(N, float)

    # ---- shape and frame ----
    @property
    def n_u(self):
        return self.probes.shape[1]

    @property
    def n_v(self):
        return self.probes.shape[0]

    @property
    def n_phi(self):
        return self.probes.shape[2]

    @property
    def n_theta(self):
        return self.probes.shape[3]

    def frame(self):
        u, v = unit(self.U), unit(self.V)
        n = unit(np.cross(u, v))
        if self.N is not None and np.dot(self.N, n) < 0:
            n = -n
        return np.stack([u, v, n])

    def node(self, i, j):
        a = np.where(self.n_u == 1, 0.5, i / max(self.n_u - 1, 1))
        b = np.where(self.n_v == 1, 0.5, j / max(self.n_v - 1, 1))
        return self.origin + a[..., None] * self.U + b[..., None] * self.V

    def placed(self, origin, U, V, N=None):
        """The same light with its plane somewhere else: the material's 9 or 12 reals."""
        other = ILF(self.probes, polar_max=self.polar_max, polar_valid=self.polar_valid, N=N)
        other.origin, other.U, other.V = (np.asarray(a, float) for a in (origin, U, V))
        return other

    def moved(self, M):
        """Carried along by the 4x4 matrix M (column vectors), the normal as a vector of its own."""
        lin = M[:3, :3]
        return self.placed(lin @ self.origin + M[:3, 3], lin @ self.U, lin @ self.V, lin @ self.frame()[2])

    # ---- one probe ----
    def lookup(self, i, j, d):
        """Radiance of probe (i, j) from direction d in plane coordinates, d of any length > 0."""
        theta = np.arctan2(d[..., 1], d[..., 0])
        phi = np.arctan2(np.hypot(d[..., 0], d[..., 1]), d[..., 2])
        limit = self.polar_max if self.polar_valid is None else min(self.polar_max, self.polar_valid)
        phi = np.minimum(phi, limit)
        n = self.n_theta
        x = (theta + PI) * n / (2 * PI) - 0.5
        x0 = np.floor(x)
        fx = (x - x0)[..., None]
        xa = x0.astype(int) % n
        xb = (xa + 1) % n

        def row(y):
            return (1 - fx) * self.probes[j, i, y, xa] + fx * self.probes[j, i, y, xb]

        def row_mean(y):
            return self.probes[j, i, y].mean(axis=-2)

        last = self.n_phi - 1
        y = phi * self.n_phi / self.polar_max - 0.5
        yc = np.clip(y, 0, last)
        y0 = np.minimum(np.floor(yc).astype(int), max(last - 1, 0))
        y1 = np.minimum(y0 + 1, last)
        fy = (yc - y0)[..., None]
        value = (1 - fy) * row(y0) + fy * row(y1)
        top = np.clip(-2 * y, 0, 1)[..., None]           # 0 at the first row's centre, 1 at the pole
        value = (1 - top) * value + top * row_mean(np.zeros_like(y0))
        if abs(self.polar_max - PI) < SPHERE_TOL:
            low = np.clip(2 * (y - last), 0, 1)[..., None]
            value = (1 - low) * value + low * row_mean(np.full_like(y0, last))
        return value

    # ---- the light field ----
    def eval(self, o, d, h=None, depth=True):
        """Radiance along rays that start at o, go in direction d and meet auxiliary geometry at h.

        h = None, or a row of it infinite: geometry at infinity.
        """
        o, d = np.atleast_2d(np.asarray(o, float)), unit(np.atleast_2d(d))
        h = np.full_like(o, np.inf) if h is None else np.atleast_2d(np.asarray(h, float))
        far = ~np.isfinite(h).all(axis=1)
        h = np.where(far[:, None], o, h)
        F = self.frame()
        dl = d @ F.T
        up = dl[:, 2] > 0
        dn = np.where(up, dl[:, 2], 1.0)
        rel = h - self.origin
        height = rel @ F[2]
        p = rel - d * (height / dn)[:, None]
        s = np.clip(p @ F[0] / np.linalg.norm(self.U) * (self.n_u - 1), 0, self.n_u - 1)
        t = np.clip(p @ F[1] / np.linalg.norm(self.V) * (self.n_v - 1), 0, self.n_v - 1)
        i0 = np.clip(np.floor(s).astype(int), 0, max(self.n_u - 2, 0))
        j0 = np.clip(np.floor(t).astype(int), 0, max(self.n_v - 2, 0))
        out = np.zeros((len(o), 3))
        for dj in (0, 1):
            for di in (0, 1):
                w = np.abs(1 - di - (s - i0)) * np.abs(1 - dj - (t - j0))
                i, j = np.minimum(i0 + di, self.n_u - 1), np.minimum(j0 + dj, self.n_v - 1)
                look = dl
                if depth:
                    g = (h - self.node(i, j)) @ F.T
                    look = np.where((far | ~g.any(axis=1))[:, None], dl, g)
                out += w[:, None] * self.lookup(i, j, look)
        out[~up] = 0
        return out

    # ---- as an image ----
    def mosaic(self):
        """One picture: tile (i, j) is probe (i, j)."""
        v, u, y, x, c = self.probes.shape
        return self.probes.transpose(0, 2, 1, 3, 4).reshape(v * y, u * x, c)

    def texel_directions(self):
        """World directions of texel centres, (n_phi, n_theta, 3)."""
        th = -PI + (np.arange(self.n_theta) + 0.5) * 2 * PI / self.n_theta
        ph = (np.arange(self.n_phi) + 0.5) * self.polar_max / self.n_phi
        P, T = np.meshgrid(ph, th, indexing="ij")
        return np.stack([np.sin(P) * np.cos(T), np.sin(P) * np.sin(T), np.cos(P)], -1) @ self.frame()


def unmosaic(image, n_u, n_v):
    h, w, c = image.shape
    return image.reshape(n_v, h // n_v, n_u, w // n_u, c).transpose(0, 2, 1, 3, 4)


def random_ilf(rng, n_u, n_v, n_theta, n_phi, kind="hemisphere", half=False, polar_valid=None, decades=1.0, plane=None):
    """Random light over the given decades, on a rectangle of random place and orientation."""
    probes = 10 ** rng.uniform(-decades / 2, decades / 2, (n_v, n_u, n_phi, n_theta, 3))
    probes = probes.astype(np.float16 if half else np.float32).astype(float)
    if plane is None:
        q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        plane = rng.normal(size=3) * 0.3, q[0] * rng.uniform(0.7, 1.6), q[1] * rng.uniform(0.7, 1.6)
    return ILF(probes, *plane, polar_max=POLAR_MAX[kind] if isinstance(kind, str) else kind, polar_valid=polar_valid)


def directional_ilf(radiance, n_theta, n_phi, polar_max=PI / 2, **plane):
    """One probe whose texels hold radiance(direction (..., 3)) -> (..., 3)."""
    f = ILF(np.zeros((1, 1, n_phi, n_theta, 3)), polar_max=polar_max, **plane)
    f.probes[0, 0] = f32(radiance(f.texel_directions()))
    return f


# ---- files -------------------------------------------------------------------------------------------

def write_ilf(path, ilf, half=False, compression="none", extra=None, parts=(), line_order=None, tile=None):
    """Write a file after section 1 with OpenEXR's own Python module (C++ library, not libilf)."""
    import OpenEXR
    tiles = OpenEXR.TileDescription()
    tiles.xSize, tiles.ySize = tile or (ilf.n_theta, ilf.n_phi)
    name = "NO" if compression == "none" else compression.upper()
    header = {"type": OpenEXR.tiledimage, "tiles": tiles, "compression": getattr(OpenEXR, name + "_COMPRESSION"),
              "ilf:version": 1, "ilf:polarMax": ilf.polar_max,
              "ilf:origin": ilf.origin.astype(np.float32), "ilf:U": ilf.U.astype(np.float32),
              "ilf:V": ilf.V.astype(np.float32)}
    if ilf.polar_valid is not None:
        header["ilf:polarValid"] = ilf.polar_valid
    if line_order is not None:
        header["lineOrder"] = line_order
    header.update(extra or {})
    image = ilf.mosaic().astype(np.float16 if half else np.float32)
    channels = {c: np.ascontiguousarray(image[..., k]) for k, c in enumerate("RGB")}
    if parts:
        OpenEXR.File([OpenEXR.Part(header, channels, "probes"), *parts]).write(str(path))
    else:
        OpenEXR.File(header, channels).write(str(path))
    return path


def read_mosaic(path):
    """Header and (h, w, 3) float64 pixels of the first part, by OpenEXR's Python module."""
    import OpenEXR
    f = OpenEXR.File(str(path), separate_channels=True)
    channels = f.channels()
    return f.header(), np.stack([np.asarray(channels[c].pixels, float) for c in "RGB"], -1)


def pixel_type(path):
    import OpenEXR
    return OpenEXR.File(str(path), separate_channels=True).channels()["R"].pixels.dtype


# ---- the bytes of a single-part EXR file: taken apart to be broken ---------------------------------------

def header_attributes(data):
    """[(name, type, value bytes)...] and the offset of the byte after the header."""
    assert data[:4] == b"v/1\x01"
    at, found = 8, []
    while data[at] != 0:
        end = data.index(b"\0", at)
        name = data[at:end].decode()
        at = end + 1
        end = data.index(b"\0", at)
        kind = data[at:end].decode()
        size, = struct.unpack_from("<i", data, end + 1)
        at = end + 5
        found.append((name, kind, data[at:at + size]))
        at += size
    return found, at + 1


def rebuilt(data, attributes, version=None):
    """The same tiles behind another header: the offsets in the table move along."""
    old, end = header_attributes(data)
    del old
    head = data[:4] + (data[4:8] if version is None else struct.pack("<I", version))
    for name, kind, value in attributes:
        head += name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
    head += b"\0"
    first, = struct.unpack_from("<Q", data, end)
    count = (first - end) // 8
    shift = len(head) - end
    table = struct.unpack_from(f"<{count}Q", data, end)
    return head + struct.pack(f"<{count}Q", *(o + shift for o in table)) + data[first:]


def edited(data, name, kind=None, value=None, remove=False, version=None):
    """One attribute changed, added or removed."""
    attributes, _ = header_attributes(data)
    out = [(n, kind or k, v if value is None else value) if n == name else (n, k, v)
           for n, k, v in attributes if not (remove and n == name)]
    if not remove and all(n != name for n, _, _ in out):
        out = sorted([*out, (name, kind, value)])
    return rebuilt(data, out, version)


def tile_offsets(data):
    """File offset of each tile's chunk, row by row."""
    _, end = header_attributes(data)
    first, = struct.unpack_from("<Q", data, end)
    return end, list(struct.unpack_from(f"<{(first - end) // 8}Q", data, end))


def sparse_ilf(path, n_u, n_v, n_theta, n_phi, probes=None):
    """An uncompressed half file of any size whose tiles are holes (zeros) but for a few probes.

    probes: {(i, j): (n_phi, n_theta, 3) array}.  Written tile by tile from the format's description,
    for no library makes a file without holding its pixels.
    """
    def attr(name, kind, value):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value

    chlist = b"".join(c + b"\0" + struct.pack("<iB3xii", 1, 0, 1, 1) for c in (b"B", b"G", b"R")) + b"\0"
    window = struct.pack("<4i", 0, 0, n_u * n_theta - 1, n_v * n_phi - 1)
    head = b"v/1\x01" + struct.pack("<I", 2 | 0x200)
    head += attr("channels", "chlist", chlist) + attr("compression", "compression", b"\0")
    head += attr("dataWindow", "box2i", window) + attr("displayWindow", "box2i", window)
    head += attr("ilf:U", "v3f", struct.pack("<3f", 1, 0, 0)) + attr("ilf:V", "v3f", struct.pack("<3f", 0, 1, 0))
    head += attr("ilf:origin", "v3f", struct.pack("<3f", 0, 0, 0))
    head += attr("ilf:polarMax", "float", struct.pack("<f", PI / 2)) + attr("ilf:version", "int", struct.pack("<i", 1))
    head += attr("lineOrder", "lineOrder", b"\0") + attr("pixelAspectRatio", "float", struct.pack("<f", 1))
    head += attr("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0))
    head += attr("screenWindowWidth", "float", struct.pack("<f", 1))
    head += attr("tiles", "tiledesc", struct.pack("<IIB", n_theta, n_phi, 0)) + b"\0"
    size = n_theta * n_phi * 3 * 2
    chunk = 20 + size
    start = len(head) + 8 * n_u * n_v
    with open(path, "wb") as f:
        f.write(head + struct.pack(f"<{n_u * n_v}Q", *(start + k * chunk for k in range(n_u * n_v))))
        for k in range(n_u * n_v):
            f.seek(start + k * chunk)
            i, j = k % n_u, k // n_u
            f.write(struct.pack("<5i", i, j, 0, 0, size))
            if probes and (i, j) in probes:
                lines = np.asarray(probes[i, j]).astype("<f2")[..., ::-1].transpose(0, 2, 1)  # y, (B, G, R), x
                f.write(np.ascontiguousarray(lines).tobytes())
        f.truncate(start + n_u * n_v * chunk)
    return path


# ---- rays and comparison -----------------------------------------------------------------------------

def random_directions(rng, n):
    return unit(rng.normal(size=(n, 3)))


def rays_text(o, d, h):
    rows = np.concatenate([o, d, h], axis=1)
    return "".join(" ".join(f"{x:.17g}" for x in r) + "\n" for r in rows)


def assert_same(found, expected, rel=1e-5, floor=1e-4):
    """Relative error at most rel where the value is not near zero (floor times the mean), and an
    absolute error of rel * floor * mean below that."""
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    assert found.shape == expected.shape
    assert np.isfinite(found).all(), "not finite"
    scale = np.abs(expected).mean()
    error = np.abs(found - expected)
    allowed = rel * np.maximum(np.abs(expected), floor * scale)
    bad = np.argwhere(error > allowed)
    if len(bad):
        k = tuple(max(bad, key=lambda b: error[tuple(b)] / max(allowed[tuple(b)], 1e-300)))
        raise AssertionError(f"{len(bad)} of {found.size} values differ; worst at {k}: found {found[k]:.9g}, "
                             f"expected {expected[k]:.9g}")
