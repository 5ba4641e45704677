"""Where the subject is: one place, or a path through the field's plane, cut into frames."""
from dataclasses import dataclass

import numpy as np

from . import textfile
from .errors import Bad


@dataclass(frozen=True, eq=False)
class Place:
    """seconds; at: (3,) in the field's coordinates; heading: degrees by which the subject's axes are turned against the field's, about z."""
    seconds: float
    at: np.ndarray
    heading: float = 0.

    @property
    def turn(self):
        """(3, 3): rows are the subject's axes in the field's."""
        c, s = np.cos(np.radians(self.heading)), np.sin(np.radians(self.heading))
        return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.]])


def read_path(path):
    """Its lines as an array (n, 5): seconds x y z heading; raises Bad."""
    rows = []
    for k, row, line in textfile.rows(path):
        if len(row) not in (4, 5) or not np.isfinite(row).all():
            raise Bad(f'{path}: line {k}: expected "seconds x y z [heading]", found \'{line.strip()[:40]}\'')
        if rows and row[0] <= rows[-1][0]:
            raise Bad(f"{path}: line {k}: expected a time after {rows[-1][0]:g}, found {row[0]:g}")
        rows.append([*row, 0.][:5])
    if len(rows) < 2:
        raise Bad(f"{path}: expected a path of two places or more, found {len(rows)}")
    return np.array(rows)


def frames(rows, fps):
    """Places at even times along a path."""
    n = int(np.floor((rows[-1, 0] - rows[0, 0]) * fps + 1e-6)) + 1
    if n > 100_000:
        raise Bad(f"path: expected 100000 frames at most, found {n}")
    times = rows[0, 0] + np.arange(n) / fps
    columns = [np.interp(times, rows[:, 0], rows[:, k]) for k in (1, 2, 3)]
    heading = np.degrees(np.interp(times, rows[:, 0], np.unwrap(np.radians(rows[:, 4]))))
    return [Place(float(t), np.array(p), float(h)) for t, *p, h in zip(times, *columns, heading)]


def check(places, field, name):
    """Raises Bad where the subject is outside of the field: beside its rectangle, or below its plane."""
    frame, slack = field.frame, 1e-4 * max(field.frame.len_u, field.frame.len_v)
    for p in places:
        u, v, h = frame.to_field(p.at)
        if not (-slack <= u <= frame.len_u + slack and -slack <= v <= frame.len_v + slack and h >= -slack):
            raise Bad(f"{name}: expected the subject above the rectangle of {frame.len_u:g} x {frame.len_v:g} that was sampled, found it at "
                      f"{u:g} {v:g}, {h:g} high (along u, v, n)")
