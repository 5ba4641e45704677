"""Virtual stages, as files for ilfstage.

    generate.py sphere156 -o sphere156.toml      156 lights on a sphere (Debevec and others 2002: those of a geodesic dome without the lowest)
    generate.py sphere29 -o sphere29.toml        29 lights on a sphere (as many as Jones and others 2006 had)
    generate.py wall -o wall.toml                an LED wall of 64 x 32 patches, 4 x 2 m, 1.5 m from the subject, and a ceiling of 8 x 8 panels

Lengths in metres, the subject at the origin.  Lamps are R, G, B; `--white` adds a fourth primary.  How bright they are: --irradiance E, W/m2 of R, G
and B each at the subject from a lamp of the spheres at full drive; the wall's patches have a radiance (--radiance L, W/(sr m2)).
"""
import argparse
import math
import sys

PHI = (1 + math.sqrt(5)) / 2
PRIMARIES = {"red": (1, .03, .01), "green": (.08, 1, .06), "blue": (.02, .07, 1)}
WHITE = (.8, .8, .7)


def unit(p):
    r = math.sqrt(sum(x * x for x in p))
    return tuple(x / r for x in p)


def geodesic(times):
    """Points of an icosahedron whose triangles are cut into times x times, on the sphere."""
    corners = [p for s in (1, -1) for t in (PHI, -PHI) for p in ((0, s, t), (s, t, 0), (t, 0, s))]
    near = lambda a, b: abs(math.dist(a, b) - 2) < 1e-6                   # noqa: E731
    faces = [(a, b, c) for i, a in enumerate(corners) for j, b in enumerate(corners[:i]) for c in corners[:j]
             if near(a, b) and near(a, c) and near(b, c)]
    found = {}
    for a, b, c in faces:
        for i in range(times + 1):
            for j in range(times + 1 - i):
                p = unit([(i * x + j * y + (times - i - j) * z) / times for x, y, z in zip(a, b, c)])
                found[tuple(round(x, 6) for x in p)] = p
    return sorted(found.values(), key=lambda p: (-p[2], math.atan2(p[1], p[0])))


def spiral(n):
    """n points spread evenly over the sphere."""
    turn = math.pi * (3 - math.sqrt(5))
    for k in range(n):
        z = 1 - (2 * k + 1) / n
        yield math.sqrt(1 - z * z) * math.cos(k * turn), math.sqrt(1 - z * z) * math.sin(k * turn), z


def fixture(name, size, beam, full, white):
    primaries = {**PRIMARIES, "white": WHITE} if white else PRIMARIES
    lines = [f"[fixture.{name}]", f"size = {size}", f'beam = "{beam}"']
    for colour, rgb in primaries.items():
        lines += [f"[fixture.{name}.channel.{colour}]", f"rgb = [{', '.join(f'{full * x:.6g}' for x in rgb)}]"]
    return lines


def place(p):
    return "[" + ", ".join(f"{x:.6g}" for x in p) + "]"


def light(name, kind, position, towards):
    return ["[[light]]", f'name = "{name}"', f'fixture = "{kind}"', f"position = {place(position)}", f"{towards[0]} = {place(towards[1])}"]


def sphere(points, a):
    """Lamps at those points of a sphere, aimed at its centre."""
    lines = fixture("lamp", a.size, "cosine 4", a.irradiance * a.radius ** 2, a.white)
    for k, p in enumerate(points, 1):
        lines += light(f"l{k:03}", "lamp", [a.radius * x for x in p], ("aim", (0, 0, 0)))
    return lines


def wall(a, columns=64, rows=32, width=4., height=2., away=1.5, panels=8):
    patch, top = (width / columns, height / rows), 3. / panels
    lines = fixture("patch", f"[{patch[0]:.6g}, {patch[1]:.6g}]", "cosine 1", a.radiance * patch[0] * patch[1], a.white)
    lines += fixture("panel", f"[{top:.6g}, {top:.6g}]", "cosine 1", a.radiance * top * top, a.white)
    for j in range(rows):
        for i in range(columns):
            p = ((i + .5) * patch[0] - width / 2, away, (rows - 1 - j + .5) * patch[1] - .4 * height)
            lines += light(f"w{j:02}_{i:02}", "patch", p, ("direction", (0, -1, 0)))
    for j in range(panels):
        for i in range(panels):
            lines += light(f"c{j}_{i}", "panel", ((i + .5) * top - 1.5, (j + .5) * top - 1.5, 2.), ("direction", (0, 0, -1)))
    return lines


def main():
    ap = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    ap.add_argument("kind", choices=["sphere156", "sphere29", "wall"])
    ap.add_argument("-o", "--output", required=True)
    ap.add_argument("--lights", type=int, help="of a sphere: this many, spread evenly")
    ap.add_argument("--radius", type=float, default=1.5)
    ap.add_argument("--size", type=float, default=.06)
    ap.add_argument("--irradiance", type=float, default=2.)
    ap.add_argument("--radiance", type=float, default=30.)
    ap.add_argument("--white", action="store_true")
    a = ap.parse_args()
    if a.kind == "wall":
        lines = wall(a)
    else:
        # 162 points of a geodesic sphere, but for six about its foot, where the floor was
        points = list(spiral(a.lights or 29)) if a.lights or a.kind == "sphere29" else geodesic(4)[:156]
        lines = sphere(points, a)
    with open(a.output, "w") as f:
        f.write("\n".join(['unit = "m"', *lines]) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
