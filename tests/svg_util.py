"""Plots that our programs write, read back in their axes' numbers."""
import re
import xml.etree.ElementTree as ET

import numpy as np

SVG = "{http://www.w3.org/2000/svg}"


def places(path):
    return np.array([[float(v) for v in p.split()] for p in re.findall(r"[ML](-?[\d.]+ -?[\d.]+)", path)])


class Plot:
    def __init__(self, path):
        self.root = ET.parse(path).getroot()
        texts = self.root.findall(f"{SVG}text")
        under, beside = [t for t in texts if t.get("text-anchor") == "middle" and "transform" not in t.attrib], [t for t in texts if t.get("text-anchor") == "end"]
        *ticks, label = under
        self.xlabel, self.ylabel = label.text, next(t.text for t in texts if "transform" in t.attrib)
        self.xticks = {float(t.text): float(t.get("x")) for t in ticks}
        self.yticks = {float(t.text): float(t.get("y")) - 4 for t in beside}

    def numbers(self, at):
        """Places in the picture as the axes' numbers."""
        fits = [np.polyfit(list(t.values()), list(t), 1) for t in (self.xticks, self.yticks)]
        return np.column_stack([np.polyval(f, v) for f, v in zip(fits, np.asarray(at).T)])

    def _paths(self, **wish):
        return [p.get("d") for p in self.root.findall(f"{SVG}path") if all(p.get(k.replace("_", "-")) == v for k, v in wish.items())]

    def lines(self):
        return [self.numbers(places(d)) for d in self._paths(stroke_width="1.6")]

    def bands(self):
        """(low, high) of each."""
        both = [self.numbers(places(d)) for d in self._paths(fill_opacity="0.12")]
        return [(b[len(b) // 2:][::-1], b[:len(b) // 2]) for b in both]

    def small_dots(self):
        return [self.numbers(places(d) + [0.5, 0]) for d in self._paths(stroke_opacity="0.5")]

    def dots(self, full=True):
        found = [(float(c.get("cx")), float(c.get("cy"))) for c in self.root.findall(f"{SVG}circle") if (c.get("fill") != "none") == full]
        return self.numbers(found) if found else np.zeros((0, 2))
