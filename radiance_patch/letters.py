"""A font in Radiance's format, for psign and the text materials: letters.py OUT.fnt

The name that scenes and psign ask for is helvet.fnt, which no package that we build from carries; these letters are our own:
strokes of a round pen, upright and without serifs.  A font file has one polygon a character (number, count of vertices, then
x y of each, 0..255 across the character's cell, x to the right, y up), filled by the even-odd rule; a polygon of several
outlines runs from one to the next and back on the same line.  The cell is as high as a line and 0.6 times as wide, which is
psign's default; capitals stand on y = 66 and reach 226.
"""
import math
import sys

PEN = 0.7                       # radius of the pen, in units of which a capital is 10 high
LINE = 16                       # font units to one of ours, up
CELL = LINE / 0.6               # and across
BASE, MIDDLE = 66, 127.5        # y of the base line, x of a letter's middle

# x y pairs of polylines, parted by /; @ cx cy rx ry from to is an arc in degrees, counter-clockwise when rising
DOT = "@0 .3 .3 .3 0 360"
RING = "@2.5 3.5 2.5 3.5 0 360"
LETTERS = {
    "A": "0 0 3.5 10 7 0 / 1.2 3.4 5.8 3.4",
    "B": "0 0 0 10 3.4 10 @3.4 7.6 2.4 2.4 90 -90 0 5.2 / 3.4 5.2 @3.6 2.6 2.7 2.6 90 -90 0 0",
    "C": "@3.6 5 3.6 5 50 310", "D": "0 0 0 10 2.6 10 @2.6 5 4 5 90 -90 0 0",
    "E": "6 10 0 10 0 0 6 0 / 0 5.2 5.2 5.2", "F": "6 10 0 10 0 0 / 0 5.2 5 5.2",
    "G": "@3.6 5 3.6 5 50 340 7 4.8 4 4.8", "H": "0 0 0 10 / 6.6 0 6.6 10 / 0 5.2 6.6 5.2", "I": "0 0 0 10",
    "J": "4 10 4 2.2 @2 2.2 2 2.2 0 -180", "K": "0 0 0 10 / 6.4 10 0 3.8 / 2.4 6 6.6 0", "L": "0 10 0 0 5.6 0",
    "M": "0 0 0 10 3.6 1 7.2 10 7.2 0", "N": "0 0 0 10 6.6 0 6.6 10", "O": "@3.7 5 3.7 5 0 360",
    "P": "0 0 0 10 3.6 10 @3.6 7.2 2.8 2.8 90 -90 0 4.4", "Q": "@3.7 5 3.7 5 0 360 / 4.4 2.6 7.2 -.6",
    "R": "0 0 0 10 3.6 10 @3.6 7.2 2.8 2.8 90 -90 0 4.4 / 3.4 4.4 6.6 0",
    "S": "@3.2 7.5 3 2.5 30 270 @3.2 2.5 3.2 2.5 90 -150", "T": "0 10 6.8 10 / 3.4 10 3.4 0",
    "U": "0 10 0 3.2 @3.3 3.2 3.3 3.2 180 360 6.6 10", "V": "0 10 3.5 0 7 10", "W": "0 10 1.9 0 3.8 8.6 5.7 0 7.6 10",
    "X": "0 0 6.6 10 / 0 10 6.6 0", "Y": "0 10 3.4 4.6 6.8 10 / 3.4 4.6 3.4 0", "Z": "0 10 6.4 10 0 0 6.6 0",
    "a": f"5 0 5 7 / {RING}", "b": f"0 10 0 0 / {RING}", "c": "@2.6 3.5 2.6 3.5 45 315", "d": f"5 10 5 0 / {RING}",
    "e": "0 3.6 5.1 3.6 @2.55 3.5 2.55 3.5 2 315", "f": "@3.5 8.2 1.8 1.8 80 180 1.7 0 / 0 6.8 3.8 6.8",
    "g": f"5 7 5 -.6 @2.5 -.6 2.5 2.4 0 -160 / {RING}", "h": "0 0 0 10 / 0 4.4 @2.5 4.5 2.5 2.5 180 0 5 0",
    "i": "0 0 0 7 / @0 9.6 .3 .3 0 360", "j": "1.8 7 1.8 -1 @.2 -1 1.6 2 0 -100 / @1.8 9.6 .3 .3 0 360",
    "k": "0 0 0 10 / 4.8 7 0 2.8 / 1.8 4.2 5 0", "l": "0 10 0 1.4 @1.4 1.4 1.4 1.4 180 280",
    "m": "0 0 0 7 / 0 4.8 @1.9 4.9 1.9 2.1 180 0 3.8 0 / 3.8 4.8 @5.7 4.9 1.9 2.1 180 0 7.6 0",
    "n": "0 0 0 7 / 0 4.4 @2.5 4.5 2.5 2.5 180 0 5 0", "o": "@2.7 3.5 2.7 3.5 0 360", "p": f"0 7 0 -3 / {RING}",
    "q": f"5 7 5 -3 / {RING}", "r": "0 0 0 7 / 0 4 @2.6 4 2.6 3 180 75",
    "s": "@2.4 5.25 2.2 1.75 30 270 @2.4 1.75 2.4 1.75 90 -150", "t": "1.6 9.4 1.6 1.8 @3.4 1.8 1.8 1.8 180 280 / 0 7 3.8 7",
    "u": "0 7 0 2.5 @2.5 2.5 2.5 2.5 180 360 / 5 7 5 0", "v": "0 7 2.6 0 5.2 7", "w": "0 7 1.7 0 3.4 6.2 5.1 0 6.8 7",
    "x": "0 0 5 7 / 0 7 5 0", "y": "0 7 2.6 0 / 5.2 7 1.6 -3 .4 -3", "z": "0 7 4.8 7 0 0 5 0",
    "0": "@2.9 5 2.9 5 0 360", "1": "0 7.6 2.4 10 2.4 0", "2": "@2.9 7.1 2.8 2.9 175 -30 0 0 5.8 0",
    "3": "@2.8 7.5 2.6 2.5 150 -90 / 2.2 5 2.8 5 @2.8 2.5 2.9 2.5 90 -150", "4": "4.4 0 4.4 10 0 3 6 3",
    "5": "5.2 10 .8 10 .4 5 @2.8 3.1 3 3.1 140 -150", "6": "@2.9 3.1 2.9 3.1 0 360 / 0 3.1 @3.4 3.1 3.4 6.9 180 75",
    "7": "0 10 5.8 10 1.8 0", "8": "@2.8 7.6 2.4 2.4 0 360 / @2.8 2.6 2.8 2.6 0 360",
    "9": "@2.9 6.9 2.9 3.1 0 360 / 5.8 6.9 @2.4 6.9 3.4 6.9 0 -105",
    "!": f"0 10 0 3 / {DOT}", '"': "0 10 0 7.4 / 2.2 10 2.2 7.4",
    "#": "1.6 0 2.6 10 / 4.4 0 5.4 10 / 0 3.2 6.6 3.2 / .6 6.8 7 6.8",
    "$": "@2.9 7 2.7 2 30 270 @2.9 3 2.9 2 90 -150 / 2.9 -.8 2.9 10.8",
    "%": "0 0 7 10 / @1.5 8 1.5 2 0 360 / @5.6 2 1.5 2 0 360",
    "&": "6.8 0 1.5 7 @2.8 8.2 1.6 1.7 205 -50 1 4.1 @2.6 2.3 2.6 2.3 140 320 6.4 4.6", "'": "0 10 0 7.4",
    "(": "@3 4.2 3 7 120 240", ")": "@0 4.2 3 7 60 -60", "*": "2 10 2 5.6 / 0 8.9 4 6.7 / 0 6.7 4 8.9",
    "+": "0 4 6 4 / 3 1 3 7", ",": ".4 .2 .4 0 -.2 -1.8", "-": "0 4 3.4 4", ".": DOT, "/": "0 -.6 3.6 10.4",
    ":": f"{DOT} / @0 5.6 .3 .3 0 360", ";": "@0 5.6 .3 .3 0 360 / .3 .2 .3 0 -.3 -1.8", "<": "5.6 7.4 0 4 5.6 .6",
    "=": "0 2.6 6 2.6 / 0 5.4 6 5.4", ">": "0 7.4 5.6 4 0 .6",
    "?": "@2.5 7.5 2.5 2.5 170 -45 2.5 4.2 2.5 3 / @2.5 .3 .3 .3 0 360",
    "@": "@3.6 4.2 1.7 2 0 360 / 5.3 6.2 5.3 3.4 @6.4 3.4 1.1 1.3 180 360 @3.75 4.6 3.75 5 0 300",
    "[": "2 11 0 11 0 -2.4 2 -2.4", "\\": "0 10.4 3.6 -.6", "]": "0 11 2 11 2 -2.4 0 -2.4", "^": "0 6 2.4 10 4.8 6",
    "_": "0 -2 6.4 -2", "`": "0 10 1.2 8", "{": "2.6 11 1.4 10 1.4 5.6 0 4.3 1.4 3 1.4 -1.4 2.6 -2.4", "|": "0 11 0 -2.4",
    "}": "0 11 1.2 10 1.2 5.6 2.6 4.3 1.2 3 1.2 -1.4 0 -2.4", "~": "0 3.4 1.2 4.6 2.2 4.6 3.8 3.4 4.8 3.4 6 4.6",
}


def strokes(text):
    """The polylines of a letter, arcs as chords."""
    lines, words = [[]], iter(text.replace("@", "@ ").split())
    for w in words:
        if w == "/":
            lines.append([])
        elif w == "@":
            cx, cy, rx, ry, a, b = (float(next(words)) for _ in range(6))
            n = max(2, math.ceil(abs(b - a) / 10))
            for k in range(n + 1):
                t = math.radians(a + (b - a) * k / n)
                lines[-1].append((cx + rx * math.cos(t), cy + ry * math.sin(t)))
        else:
            lines[-1].append((float(w), float(next(words))))
    return lines


def inked(lines):
    """The font's unit squares (x, y) whose middle the pen covers."""
    xs = [x for line in lines for x, _ in line]
    shift = MIDDLE - CELL * (min(xs) + max(xs)) / 2
    ink = set()
    for line in lines:
        for (ax, ay), (bx, by) in zip(line, line[1:]):
            dx, dy = bx - ax, by - ay
            long2 = dx * dx + dy * dy or 1
            for row in range(math.floor(BASE + LINE * (min(ay, by) - PEN)), math.ceil(BASE + LINE * (max(ay, by) + PEN)) + 1):
                y = (row + 0.5 - BASE) / LINE
                near = [min(max((h - ay) / dy, 0), 1) for h in (y - PEN, y + PEN)] if dy else (0, 1)    # within the pen's reach
                ends = sorted(ax + t * dx for t in near)
                for col in range(math.floor(shift + CELL * (ends[0] - PEN)), math.ceil(shift + CELL * (ends[1] + PEN)) + 1):
                    if (col, row) in ink:
                        continue
                    x = (col + 0.5 - shift) / CELL
                    t = min(max(((x - ax) * dx + (y - ay) * dy) / long2, 0), 1)
                    if (x - ax - t * dx) ** 2 + (y - ay - t * dy) ** 2 < PEN * PEN:
                        ink.add((col, row))
    assert all(0 <= x < 255 and 0 <= y < 255 for x, y in ink)
    return ink


def outlines(ink):
    """Closed walks along the squares' edges, ink on the left."""
    follow = {}
    for x, y in ink:
        for out, a, b in (((x, y - 1), (x, y), (x + 1, y)), ((x + 1, y), (x + 1, y), (x + 1, y + 1)),
                          ((x, y + 1), (x + 1, y + 1), (x, y + 1)), ((x - 1, y), (x, y + 1), (x, y))):
            if out not in ink:
                follow.setdefault(a, []).append(b)
    loops = []
    while follow:
        start = at = min(follow)
        loop, came = [], None
        while True:
            ways = follow[at]
            # where two squares touch by a corner, turn left: their outlines stay apart
            if came and len(ways) > 1:
                ways.sort(key=lambda b: came[0] * (b[1] - at[1]) - came[1] * (b[0] - at[0]))
            to = ways.pop()
            if not ways:
                del follow[at]
            loop.append(at)
            came, at = (to[0] - at[0], to[1] - at[1]), to
            if at == start:
                break
        loops.append(loop)
    return loops


def thinned(points, within=0.9):
    """Douglas and Peucker: the fewest vertices that stay so near, in font units."""
    keep, todo = {0, len(points) - 1}, [(0, len(points) - 1)]
    while todo:
        a, b = todo.pop()
        (ax, ay), (bx, by) = points[a], points[b]
        far, at = within, None
        for k in range(a + 1, b):
            px, py = points[k]
            chord = math.hypot(bx - ax, by - ay)
            d = abs((bx - ax) * (py - ay) - (by - ay) * (px - ax)) / chord if chord else math.hypot(px - ax, py - ay)
            if d > far:
                far, at = d, k
        if at:
            keep.add(at)
            todo += [(a, at), (at, b)]
    return [points[k] for k in sorted(keep)]


def polygon(loops):
    """One polygon of all outlines, joined by lines that run there and back."""
    loops = sorted((thinned(loop + loop[:1])[:-1] for loop in loops), key=len, reverse=True)
    one = loops.pop(0)
    while loops:
        _, k, a, b = min((math.dist(one[a], loop[b]), k, a, b) for k, loop in enumerate(loops)
                         for a in range(len(one)) for b in range(len(loop)))
        other = loops.pop(k)
        one = one[:a + 1] + other[b:] + other[:b + 1] + one[a:]
    return one


def main():
    rows = ["# letters of strokes for Radiance's text, in the format of its font files (made by letters.py)", "32 0"]
    for c in sorted(LETTERS):
        p = polygon(outlines(inked(strokes(LETTERS[c]))))
        rows += [f"# {c}" if c != "#" else "# number sign", f"{ord(c)} {len(p)}"]
        rows += ["  ".join(f"{x} {y}" for x, y in p[k:k + 8]) for k in range(0, len(p), 8)]
    with open(sys.argv[1], "w", encoding="ascii") as f:
        f.write("\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
