"""What was reached, what was not, and why."""
import json

import numpy as np
from scipy.optimize import nnls

LUMINANCE = np.array([.265, .670, .065])
MOST_NAMED = 12


def colours_of(A):
    """Distinct colours that the channels have, (n, 3), each of sum 1."""
    c = A.sum(0).T
    c = c[c.sum(1) > 1e-12 * max(c.sum(1).max(), 1e-300)]
    return np.unique(np.round(c / c.sum(1, keepdims=True), 3), axis=0)


def out_of_gamut(colours, wanted):
    """(s,): what of each wanted colour no mixture of the channels' colours has, as a part of it."""
    if len(colours) > 48:
        colours = colours[np.linspace(0, len(colours) - 1, 48).astype(int)]
    size = np.linalg.norm(wanted, axis=1)
    return np.array([nnls(colours.T, w / n)[1] if n > 0 else 0. for w, n in zip(wanted, size)])


def direction_words(n):
    """A direction in words for a reader who looks along +y, z up."""
    sides = ("left", "right"), ("front", "back"), ("below", "above")
    names = [(pair[int(x > 0)], abs(x)) for pair, x in zip(sides, n)]
    return " ".join(w for w, x in sorted(names, key=lambda p: -p[1]) if x > .38)


class Frame:
    """The errors of one frame, parts of the root mean square of what is wanted.

    bound: of the best drive values of all, below 0 too; positive: of any at or above 0; limited: within the ranges; fitted: with few lights and
    smooth; reached: as coded.
    """

    def __init__(self, place, fitter, wanted, fitted, coded, whole, best=None):
        """whole: the fitter of all lights; best: its fit, where that is known."""
        self.place, self.wanted = place, wanted
        self.got = np.einsum("sck,k->sc", fitter.A, coded) / fitter.weight
        self.bound = whole.bound(wanted)
        x, self.gap = best or whole.fit(wanted)
        self.limited = whole.error(x, wanted)
        self.at_top = (x >= whole.high - 1e-6) & (whole.high > whole.low)
        self.positive, self.needs = self.limited, 1.
        if self.at_top.any() or whole.low.any():
            free, _ = whole.fit(wanted, unlimited=True)
            self.positive = min(self.limited, whole.error(free, wanted))
            self.needs = float((free / whole.high).max())
        self.fitted, self.reached = fitter.error(fitted, wanted), fitter.error(coded, wanted)

    @property
    def missing(self):
        """(s,) luminance that is missing (above 0) or too much, as a part of the root mean square of what is wanted."""
        typical = np.sqrt(np.mean((self.wanted @ LUMINANCE) ** 2))
        return (self.wanted - self.got) @ LUMINANCE / max(typical, 1e-300)


def shares(frames):
    """Mean squared errors of all frames by their reasons; they add up to that of the last."""
    def mean(name):
        return float(np.mean([getattr(f, name) ** 2 for f in frames]))
    steps = [mean(n) for n in ("bound", "positive", "limited", "fitted", "reached")]
    names = ("directions_and_colours_without_light", "light_would_have_to_be_negative", "lights_at_their_limits", "few_lights_and_smoothness",
             "coding")
    return dict(zip(names, [steps[0], *(b - a for a, b in zip(steps, steps[1:]))]))


def rms(frames, name):
    return float(np.sqrt(np.mean([getattr(f, name) ** 2 for f in frames])))


def unreached(frames, match, fitter, colours):
    """The sensors' reasons, over all frames: which can't be bright enough with all lights full, which colours nobody can mix, where most is
    missing."""
    full = np.einsum("sck,k->sc", fitter.A, fitter.high) / fitter.weight @ LUMINANCE
    wanted = np.stack([f.wanted @ LUMINANCE for f in frames]).max(0)
    weak = np.flatnonzero(wanted > full * 1.001 + 1e-12)
    gamut = np.max([out_of_gamut(colours, f.wanted) for f in frames], axis=0)
    missing = np.sqrt(np.mean([f.missing ** 2 for f in frames], axis=0))
    worst = np.argsort(-missing)[:MOST_NAMED]

    def named(k):
        n = match.normals[k]
        return {"point_m": match.points[k].round(6).tolist(), "normal": n.round(6).tolist(), "towards": direction_words(n)}
    darkest = weak[np.argsort(full[weak] / wanted[weak])][:MOST_NAMED]
    return {
        "too_dark_with_all_lights_full": [{**named(k), "reachable_part": float(full[k] / wanted[k])} for k in darkest],
        "too_dark_with_all_lights_full_number": len(weak),
        "colours_out_of_gamut_number": int((gamut > .01).sum()), "colours_out_of_gamut_worst": float(gamut.max()),
        "largest_errors": [{**named(k), "error": float(missing[k])} for k in worst],
        "error_by_sensor": missing.round(6).tolist(),
    }


def contents(frames, stage, match, fitter, colours, codes, coding, info):
    """The report as a tree for JSON."""
    channels, at_top = stage.channels, np.mean([f.at_top for f in frames], axis=0)
    full = (codes >= coding.high) & (coding.high > coding.low)
    used = [light.name for light in stage.lights if any(codes[:, k].max() > coding.low[k] for k, c in enumerate(channels) if c.light == light.name)]
    return {
        **info,
        "lights": len(stage.lights), "channels": len(channels), "lights_used": len(used), "sensors": len(match.points), "match": match.kind,
        "error": rms(frames, "reached"), "error_before_coding": rms(frames, "fitted"), "error_within_ranges": rms(frames, "limited"),
        "bound_not_negative": rms(frames, "positive"), "bound_unconstrained": rms(frames, "bound"),
        "duality_gap": max(f.gap for f in frames), "squared_error_by_reason": shares(frames),
        "would_need_times_the_light": max(f.needs for f in frames),
        "channels_at_their_upper_limit": {c.title: float(full[:, k].mean()) for k, c in enumerate(channels) if full[:, k].any() and at_top[k] > 0},
        "channels_without_effect": [channels[k].title for k in np.flatnonzero((np.abs(fitter.flat).max(0) == 0))],
        "unreached": unreached(frames, match, fitter, colours),
        "frames": [{"seconds": f.place.seconds, "at": f.place.at.tolist(), "heading": f.place.heading, "error": f.reached,
                    "error_before_coding": f.fitted, "bound_not_negative": f.positive, "bound_unconstrained": f.bound} for f in frames],
    }


def percent(x):
    return f"{100 * x:.3g} %"


def line(name, words):
    return f"{name:<16} {words}"


def text_of_limits(r):
    """Lines about what can't be reached."""
    limited, u = r["channels_at_their_upper_limit"], r["unreached"]
    if limited:
        names = sorted(limited, key=lambda n: -limited[n])
        yield line("at their limits", f"{len(limited)} channels: {', '.join(names[:4])}{' ...' if len(names) > 4 else ''}; "
                   f"{r['would_need_times_the_light']:.3g} times the light would do")
    if u["too_dark_with_all_lights_full_number"]:
        first = u["too_dark_with_all_lights_full"][0]
        yield line("too dark", f"{u['too_dark_with_all_lights_full_number']} directions with all lights full; {first['towards']}: "
                   f"{percent(first['reachable_part'])} of what is wanted")
    if u["colours_out_of_gamut_number"]:
        yield line("out of gamut", f"{u['colours_out_of_gamut_number']} directions have colours that no mixture has, by "
                   f"{percent(u['colours_out_of_gamut_worst'])} at most")
    total = sum(r["squared_error_by_reason"].values())
    if total > 1e-8:
        shares = [f"{n.replace('_', ' ')} {100 * v / total:.0f} %" for n, v in r["squared_error_by_reason"].items() if v / total > .005]
        yield line("of its square", ", ".join(shares))
    first = u["largest_errors"][0]
    yield line("most is missing", f"{first['towards']}: {percent(first['error'])}")
    if r["channels_without_effect"]:
        yield line("without effect", f"{len(r['channels_without_effect'])} channels")


def text(r):
    """The report in words, lines."""
    of, n = "directions" if r["match"] == "sphere" else "points and directions", len(r["frames"])
    yield (f"{r['lights']} lights ({r['lights_used']} used), {r['channels']} channels; {r['sensors']} {of} ({r['match']}), "
           f"{n} frame{'s' if n > 1 else ''}")
    yield line("error", f"{percent(r['error'])} of what is wanted, as coded ({percent(r['error_before_coding'])} before)")
    yield line("at best", f"{percent(r['error_within_ranges'])} within ranges, {percent(r['bound_not_negative'])} not below 0, "
               f"{percent(r['bound_unconstrained'])} unconstrained")
    rise = f": {100 * r['noise']:g} % in the matrix raises the error by {100 * r['rise_by_noise']:.2g} points at most" if r["noise"] else ""
    yield line("ridge", f"{r['ridge']:g}{rise}")
    if n > 1:
        worst = max(r["frames"], key=lambda f: f["error"])
        yield line("worst frame", f"{percent(worst['error'])} at {worst['seconds']:g} s, bound {percent(worst['bound_unconstrained'])}")
    yield from text_of_limits(r)


def write_json(f, tree):
    json.dump(tree, f, indent=1)
    f.write("\n")


def write_errors(f, frames, match):
    f.write("seconds,point_x,point_y,point_z,normal_x,normal_y,normal_z,wanted_r,wanted_g,wanted_b,reached_r,reached_g,reached_b\n")
    for frame in frames:
        for p, n, w, g in zip(match.points, match.normals, frame.wanted, frame.got):
            f.write(",".join(f"{x:.7g}" for x in (frame.place.seconds, *p, *n, *w, *g)) + "\n")
