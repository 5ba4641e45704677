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


SHAPES = ["sphere", "rectangle", "disc", "tube"]
KINDS = ["layer", "foot", "gate", "beam", "stack", "ball"]


def logistic(g):
    with np.errstate(over="ignore"):
        return 1 / (1 + np.exp(-np.asarray(g, float)))


class Mask:
    """What hides or shapes a lamp (section 1.9); grid: (ny, nx), a stack's (nz, ny, nx), as stored."""

    def __init__(self, kind, grid=None, link=0, adds=0, beta=0, plane=(), coef=(), at=(0, 0), step=(1, 1)):
        self.kind, self.link, self.adds = kind, link, adds
        self.beta, self.plane, self.coef = float(f32(beta)), f32(plane), f32(coef)
        self.x0, self.y0 = f32(at)
        self.dx, self.dy = f32(step)
        self.grid = None if grid is None else np.asarray(grid, None if np.asarray(grid).dtype == np.float16 else np.float32)

    def row(self):
        r = np.zeros(24)
        r[:4] = KINDS.index(self.kind), self.link, self.adds, self.beta
        r[4:4 + len(self.plane)], r[7:7 + len(self.coef)] = self.plane, self.coef
        if self.grid is not None:
            r[13], r[14], r[15] = self.grid.shape[-1], self.grid.shape[-2], self.grid.shape[0] if self.kind == "stack" else 0
            r[16:20] = self.x0, self.y0, self.dx, self.dy
        return r.astype(np.float32)

    def sampled(self, grid, x, y):
        ny, nx = grid.shape
        s, t = np.clip((x - self.x0) / self.dx, 0, nx - 1), np.clip((y - self.y0) / self.dy, 0, ny - 1)
        i, j = np.minimum(s.astype(int), max(nx - 2, 0)), np.minimum(t.astype(int), max(ny - 2, 0))
        i1, j1, a, b = np.minimum(i + 1, nx - 1), np.minimum(j + 1, ny - 1), s - i, t - j
        g = grid.astype(float)
        return (1 - b) * ((1 - a) * g[j, i] + a * g[j, i1]) + b * ((1 - a) * g[j1, i] + a * g[j1, i1])

    def picture(self, x, y):
        v = self.sampled(self.grid, x, y)
        return logistic(v) if self.link else v

    def passed(self, c, o, d):
        """Part of the light that comes along rays from o (n, 3) towards d, in lamp coordinates."""
        p = (o - d * (o[:, 2] / d[:, 2])[:, None])[:, :2]
        q = (o + d * ((c[2] - o[:, 2]) / d[:, 2])[:, None])[:, :2]
        foot = lambda beta: (p + beta * (q - c[:2])).T                 # noqa: E731
        return getattr(self, "_" + self.kind)(c, o, d, foot)

    def _layer(self, c, o, d, foot):
        gap = self.plane[0] + o[:, :2] @ self.plane[1:] - o[:, 2]
        rise = d[:, 2] - d[:, :2] @ self.plane[1:]
        t = np.where(rise > 0, gap / np.where(rise > 0, rise, 1), -1)
        X = o + t[:, None] * d
        return np.where((gap > 0) & (rise > 0) & (X[:, 2] < c[2]), self.picture(X[:, 0], X[:, 1]), 1.)

    def _foot(self, c, o, d, foot):
        return self.picture(*foot(self.beta))

    def _gate(self, c, o, d, foot):
        x, y = foot(self.beta)
        return logistic(self.coef @ np.stack([np.ones_like(x), x, y, x * x, x * y, y * y]))

    def _beam(self, c, o, d, foot):
        return self.coef[4] * np.maximum(0, -d @ self.coef[:3]) ** self.coef[3]

    def _stack(self, c, o, d, foot):
        most = np.zeros(len(o))
        nz = len(self.grid)
        for k in range(nz):
            tau = k / (nz - 1) if nz > 1 else 0.
            h = 1 / ((1 - tau) / self.plane[0] + tau / self.plane[1])
            if h < c[2]:
                v = self.sampled(self.grid[k], *foot(h / (c[2] - h)))
                most = np.where(o[:, 2] < h, np.maximum(most, v), most)
        return logistic((self.coef[0] - most) / self.coef[1])

    def _ball(self, c, o, d, foot):
        e = self.coef[:3] - o
        t = (e * d).sum(1)
        met = (t > 0) & (t < (c[2] - o[:, 2]) / d[:, 2]) & ((e * e).sum(1) - t * t < self.coef[3] ** 2)
        return np.where(met, 0., 1.)


class Lamp:
    """A lamp that was taken out (section 1.8), in lamp coordinates."""

    def __init__(self, shape, c, rgb, a=(0, 0, 0), b=(0, 0, 0), radius=0, far=0, masks=(), errors=(0, 0, 0, 0), seen=None):
        self.shape, self.far, self.masks, self.seen = shape, far, list(masks), seen
        self.c, self.rgb, self.a, self.b, self.radius, self.errors = f32(c), f32(rgb), f32(a), f32(b), float(f32(radius)), f32(errors)

    def row(self):
        r = np.zeros(24)
        r[:2], r[2:5], r[5:8], r[8:11], r[11] = (SHAPES.index(self.shape), self.far), self.c, self.a, self.b, self.radius
        r[12:15], r[15], r[16:20] = self.rgb, len(self.masks), self.errors
        return r.astype(np.float32)

    def met(self, o, d):
        """Distance along each ray, inf where it is not met."""
        with np.errstate(all="ignore"):
            if self.shape == "sphere":
                return entered_ball(self.c, self.radius, o, d)
            t = entered_tube(self, o, d) if self.shape == "tube" else self.met_flat(o, d)
        return t

    def met_flat(self, o, d):
        m = np.cross(self.a, self.b)
        t = (self.c - o) @ m / (d @ m)
        q = o + t[:, None] * d - self.c
        s, r = q @ self.a / (self.a @ self.a), q @ self.b / (self.b @ self.b)
        inside = (np.abs(s) <= 1) & (np.abs(r) <= 1) if self.shape == "rectangle" else s * s + r * r <= 1
        return np.where(inside & (t > 0), t, np.inf)

    def passed(self, o, d):
        product, total = np.ones(len(o)), np.zeros(len(o))
        for m in self.masks:
            v = m.passed(self.c, o, d)
            product, total = (product, total + v) if m.adds else (product * v, total)
        return np.maximum(0, product + total)


def entered_ball(c, r, o, d):
    e = c - o
    m = (e * d).sum(1)
    q = r * r - (e * e).sum(1) + m * m
    t = m - np.sqrt(np.maximum(q, 0))
    return np.where((q > 0) & (t > 0), t, np.inf)


def entered_tube(l, o, d):
    """The first of the cylinder's side and the two balls, none of which holds the ray's origin."""
    half = np.linalg.norm(l.a)
    axis = l.a / half
    across = lambda v: v - (v @ axis)[:, None] * axis                  # noqa: E731
    w, g = across(o - l.c), across(d)
    A, B, C = (g * g).sum(1), (g * w).sum(1), (w * w).sum(1) - l.radius ** 2
    t = (-B - np.sqrt(np.maximum(B * B - A * C, 0))) / A
    on = np.abs((o + t[:, None] * d - l.c) @ axis) <= half
    side = np.where((A > 0) & (B * B > A * C) & on & (t > 0), t, np.inf)
    return np.minimum(side, np.minimum(entered_ball(l.c - l.a, l.radius, o, d), entered_ball(l.c + l.a, l.radius, o, d)))


class ILF:
    lamps = ()

    def __init__(self, probes, origin=(0, 0, 0), U=(1, 0, 0), V=(0, 1, 0), polar_max=PI / 2, polar_valid=None, N=None, lamps=()):
        self.lamps = list(lamps)
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

    def length_u(self):
        """The header's |U|, in whatever plane the field lies now: what lamps are measured by."""
        return getattr(self, "len_u", np.linalg.norm(self.U))

    def node(self, i, j):
        a = np.where(self.n_u == 1, 0.5, i / max(self.n_u - 1, 1))
        b = np.where(self.n_v == 1, 0.5, j / max(self.n_v - 1, 1))
        return self.origin + a[..., None] * self.U + b[..., None] * self.V

    def placed(self, origin, U, V, N=None):
        """The same light with its plane somewhere else: the material's 9 or 12 reals."""
        other = ILF(self.probes, polar_max=self.polar_max, polar_valid=self.polar_valid, N=N, lamps=self.lamps)
        other.len_u = self.length_u()
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
        return self.with_lamps(out, o, d, h, far, depth, up) if self.lamps else out

    def with_lamps(self, out, o, d, h, far, depth, up):
        """Lamps in front of what is left (section 2.7); h: the ray's own origin where the geometry is infinitely far away."""
        F, k = self.frame(), self.length_u() / np.linalg.norm(self.U)
        out, dl = out.copy(), d[up] @ F.T
        e, own = (h[up] - self.origin) @ F.T * k, (o[up] - self.origin) @ F.T * k
        at_plane = e - dl * (e[:, 2] / dl[:, 2])[:, None]
        start = np.where((far[up] | (not depth))[:, None], at_plane, own)
        reach = np.where(far[up], np.inf, ((e - start) * dl).sum(1))
        t = np.stack([np.where(l.met(start, dl) <= (np.inf if l.far else 1.01 * reach), l.met(start, dl), np.inf)
                      if l.rgb.any() else np.full(len(dl), np.inf) for l in self.lamps])
        first = t.argmin(0)
        for n, lamp in enumerate(self.lamps):
            sees = (first == n) & np.isfinite(t[n])
            v = lamp.passed(start[sees], dl[sees])[:, None]
            rays = np.flatnonzero(up)[sees]
            out[rays] = v * lamp.rgb + (1 - np.minimum(v, 1)) * out[rays]
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
    if ilf.lamps:
        header.update(lamp_attributes(ilf.lamps))
        window = (np.array([0, 0], np.int32), np.array([ilf.n_u * ilf.n_theta - 1, ilf.n_v * ilf.n_phi - 1], np.int32))
        parts = [*parts, *lamp_parts(ilf.lamps, window)]
    image = ilf.mosaic().astype(np.float16 if half else np.float32)
    channels = {c: np.ascontiguousarray(image[..., k]) for k, c in enumerate("RGB")}
    if parts:
        OpenEXR.File([OpenEXR.Part(header, channels, "probes"), *parts]).write(str(path))
    else:
        OpenEXR.File(header, channels).write(str(path))
    return path


def lamp_attributes(lamps):
    masks = [m.row() for l in lamps for m in l.masks]
    return {"ilf:version": 2, "ilf:lamps": np.concatenate([l.row() for l in lamps])} | ({"ilf:masks": np.concatenate(masks)} if masks else {})


def lamp_parts(lamps, display):
    """Pictures of masks, as the type that they have, and shares as measured."""
    import OpenEXR

    def lines(name, channels):
        h, w = next(iter(channels.values())).shape
        window = (np.array([0, 0], np.int32), np.array([w - 1, h - 1], np.int32))
        return OpenEXR.Part({"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "displayWindow": display,
                             "dataWindow": window}, channels, name)

    masks = [m for l in lamps for m in l.masks]
    parts = [lines(f"mask.{k + 1}", {"Y": np.ascontiguousarray(m.grid.reshape(-1, m.grid.shape[-1]))})
             for k, m in enumerate(masks) if m.grid is not None]
    seen = {f"lamp.{k + 1}": np.asarray(l.seen, np.float32) for k, l in enumerate(lamps) if l.seen is not None}
    return parts + ([lines("measured", seen)] if seen else [])


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
