"""Analytic scenes for the remap: exact pictures of them by numpy, independent of the programs under test.

Directions are (u, v, n) in the plane frame.  A camera that looks along n with v up has u to the left of its
picture; a mirror sphere seen from above has it to the right (docs/FORMAT.md, section 1.4).
"""
import numpy as np
import OpenEXR


def write_exr(path, rgb):
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(rgb, np.float32)}).write(str(path))
    return path


def read_exr(path):
    """Pixels (float64) with three or four channels, and the header."""
    f = OpenEXR.File(str(path))
    c = f.channels()
    return c["RGBA" if "RGBA" in c else "RGB"].pixels.astype(float), f.header()


def remap(tmp_path, image, *args, name="in.exr", code=0):
    """Write the picture, remap it; pixels of the result (or the failed run)."""
    from conftest import run          # the bench, which has no pytest, needs the scenes alone
    write_exr(tmp_path / name, image)
    r = run("fishremap", *args, "-o", tmp_path / "out.exr", tmp_path / name, code=code)
    return r if code else read_exr(tmp_path / "out.exr")[0]


# ---- what there is to see ------------------------------------------------------------------------

def lobes(count=30, seed=5, sharpest=3):
    """Sum of smooth lobes on a grey sky: exp(k (d.a - 1)), k up to 10^sharpest (3: 1.8 degrees wide)."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        a = rng.normal(size=3)
        made.append((a / np.linalg.norm(a), 10 ** rng.uniform(.5, sharpest), rng.uniform(.1, 1, 3) * 10 ** rng.uniform(-1, 1)))
    axes, k, colours = (np.array(x) for x in zip(*made))

    def scene(d):
        flat, some = d.reshape(-1, 3), 4096      # as many as the processor's cache holds
        out = [np.exp(k * (flat[n:n + some] @ axes.T - 1)) @ colours for n in range(0, len(flat), some)]
        return .05 + np.concatenate(out).reshape(d.shape)
    return scene


def checker(d, deg=5.0):
    lon = np.degrees(np.arctan2(d[..., 0], d[..., 2]))
    lat = np.degrees(np.arcsin(np.clip(d[..., 1], -1, 1)))
    s = (np.floor(lon / deg) + np.floor(lat / deg)) % 2
    return np.stack([.1 + .9 * s, .1 + .9 * s, .2 + .6 * s], -1)


def direction(theta_deg, phi_deg):
    t, p = np.radians(theta_deg), np.radians(phi_deg)
    return np.array([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)])


def lamp(theta_deg, phi_deg, diameter_deg, radiance=1000.):
    """A disc of one radiance, black around it."""
    a, c = direction(theta_deg, phi_deg), np.cos(np.radians(diameter_deg / 2))

    def scene(d):
        return np.repeat(((d @ a) > c)[..., None] * radiance, 3, -1)
    return scene


# ---- pictures of it ------------------------------------------------------------------------------

MODELS = {  # angle from radius, r = 1 at half
    "equidistant": lambda r, half: r * half,
    "equisolid": lambda r, half: 2 * np.arcsin(np.clip(r * np.sin(half / 2), -1, 1)),
    "stereographic": lambda r, half: 2 * np.arctan(r * np.tan(half / 2)),
    "orthographic": lambda r, half: np.arcsin(np.clip(r * np.sin(half), -1, 1)),
}


def inside_pixels(samples, smooth):
    """(x, y, weight) of points in a unit square: midpoints, or where nothing has an edge Gauss and Legendre's, of which two do for many."""
    x, w = np.polynomial.legendre.leggauss(samples) if smooth else (2 * (np.arange(samples) + .5) / samples - 1, np.full(samples, 2 / samples))
    return [((x[i] + 1) / 2, (x[j] + 1) / 2, w[i] * w[j] / 4) for i in range(samples) for j in range(samples)]


def disc(scene, w, h, cx, cy, radius, angle, *, mirror=False, rotate=0, samples=1, smooth=False, outside=None, window=None):
    """Picture of the scene on a disc; angle: radius (0..1) -> field angle.  rotate (degrees) is what the
    picture must be turned by, counter-clockwise, to be upright.  outside: value beyond the circle (None: the
    model goes on).  window: (x0, y0, x1, y1), the part to fill."""
    x0, y0, x1, y1 = window or (0, 0, w, h)
    total = np.zeros((y1 - y0, x1 - x0, 3))
    turn = np.radians(rotate)
    for dx, dy, weight in inside_pixels(samples, smooth):
        px, py = (np.arange(x0, x1) + dx - cx)[None] / radius, (cy - np.arange(y0, y1) - dy)[:, None] / radius
        r = np.hypot(px, py)
        px, py = (px * np.cos(turn) - py * np.sin(turn)), (px * np.sin(turn) + py * np.cos(turn))
        seen = np.full(r.shape, True) if outside is None else r <= 1
        r, t = r[seen], angle(r[seen])
        s = np.sin(t) / np.maximum(r, 1e-300)
        total[seen] += weight * scene(np.stack([(1 if mirror else -1) * s * px[seen], s * py[seen], np.cos(t)], -1))
        total[~seen] += 0 if outside is None else weight * outside
    return total


def fisheye(scene, n, fov_deg, model="equidistant", **kw):
    half = np.radians(fov_deg / 2)
    return disc(scene, n, n, n / 2, n / 2, n / 2, lambda r: MODELS[model](r, half), **kw)


def ball_angle(r):
    return 2 * np.arcsin(np.clip(r, 0, 1))


def probe(scene, w, h, polar_max_deg, samples, smooth=False):
    """Exact solid-angle means over the texels of a probe (docs/FORMAT.md, section 1.2), by samples^2 points a texel."""
    total, weight = 0, 0
    for dx, dy, share in inside_pixels(samples, smooth):
        y, x = np.mgrid[0:h, 0:w]
        theta, phi = -np.pi + (x + dx) * 2 * np.pi / w, (y + dy) * np.radians(polar_max_deg) / h
        d = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)], -1)
        s = share * np.sin(phi)[..., None]
        total, weight = total + s * scene(d), weight + s
    return total / weight


def probe_solid_angle(w, h, polar_max_deg):
    """Solid angle of each texel, per row."""
    edge = np.cos(np.radians(polar_max_deg) * np.arange(h + 1) / h)
    return (edge[:-1] - edge[1:]) * 2 * np.pi / w


def probe_angles(w, h, polar_max_deg):
    """theta of the columns and phi of the rows, degrees, at the centres."""
    return -180 + (np.arange(w) + .5) * 360 / w, (np.arange(h) + .5) * polar_max_deg / h


def rel_rmse(image, exact, rows=slice(None)):
    d = image[rows] - exact[rows]
    return np.sqrt((d ** 2).mean()) / exact[rows].mean()


def brightest(image, polar_max_deg):
    """(theta, phi) in degrees of the centroid of what is bright, by solid angle."""
    h, w = image.shape[:2]
    theta, phi = np.radians(probe_angles(w, h, polar_max_deg)[0]), np.radians(probe_angles(w, h, polar_max_deg)[1])
    weight = image[..., 1] * probe_solid_angle(w, h, polar_max_deg)[:, None]
    d = [(weight * f).sum() for f in (np.sin(phi)[:, None] * np.cos(theta), np.sin(phi)[:, None] * np.sin(theta),
                                      np.cos(phi)[:, None] * np.ones(w))]
    return np.degrees(np.arctan2(d[1], d[0])), np.degrees(np.arctan2(np.hypot(d[0], d[1]), d[2]))
