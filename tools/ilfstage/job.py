"""One run: from files to files."""
import tempfile
import time
from itertools import repeat
from pathlib import Path

import numpy as np

import ilf

from . import dmx, drive, match, matrix, picture, place, radiance, report, stagefile
from .errors import Bad
from .outputs import whole
from .target import Target

NOISE_FRAMES, FEW_FRAMES = 3, 8
EXPOSED = .005


def opened(path):
    try:
        return ilf.open(path)
    except ilf.Error as e:
        raise Bad(str(e)) from None


def measured_field(channel, folder):
    """The light field of a measured channel; a probe becomes one."""
    source = channel.source
    if source.name.endswith(".ilf.exr"):
        return opened(source)
    out = Path(folder) / "probe.ilf.exr"
    radiance.run("ilfpack", "--quiet", "--grid", "1x1", "--plane", "-.5 -.5 0 1 0 0 0 1 0", "-o", out, source)
    return opened(out)


def measured_light(channel, m, seen, unit, threads):
    """Irradiance (s, 3) of a measured channel about its place: its field's middle where none is given."""
    with tempfile.TemporaryDirectory(prefix="ilfstage") as folder, measured_field(channel, folder) as field:
        at = channel.place if channel.place is not None else field.frame.at(.5, .5)
        there = place.Place(0., np.asarray(at, float))
        place.check([there], field, channel.source)
        plain = match.Match(m.kind, m.points, m.normals, np.ones(3), m.weight, m.mesh)
        return Target(field, plain, unit, seen, threads=threads).irradiance(there)


class Job:
    """What a command line asks for."""

    def __init__(self, given, note):
        self.given, self.note = given, note
        self.threads = given.threads or None
        self.stage = stagefile.read(given.files[0], given.bits)
        self.field = opened(given.files[1])
        self.places = self.where()
        self.match = self.what()
        self.note_what_is_outside()
        self.spent = {}

    # ---- inputs ----

    def where(self):
        g = self.given
        if g.path is not None:
            places, name = place.frames(place.read_path(g.path), g.fps), g.path
        else:
            at = np.array(g.at if g.at is not None else [*self.field.frame.at(.5, .5), 0.])
            places, name = [place.Place(0., at[:3], float(at[3]) if len(at) > 3 else 0.)], "--at"
        place.check(places, self.field, name)
        return places

    def what(self):
        g, unit = self.given, self.stage.unit
        self.shown = None
        if g.mesh is not None:
            v, t = match.read_obj(Path(g.mesh))
            self.shown = v * unit, t
            m = match.mesh(v, t, g.samples, g.reflectance, unit, g.mesh)
        elif g.volume is not None:
            m = match.volume(*g.volume, g.normals, unit)
        else:
            m = match.sphere(g.normals)
        if g.show is not None:
            v, t = match.read_obj(Path(g.show))
            self.shown = v * unit, t
        return match.towards(m, g.camera) if g.camera is not None else m

    def note_what_is_outside(self):
        """The subject's place is in the field, but it has an extent."""
        frame = self.field.frame
        p = np.concatenate([frame.to_field(q.at + self.match.points @ q.turn / self.stage.unit) for q in self.places])
        beside = (p[:, :2] < -1e-6).any(1) | (p[:, 0] > frame.len_u + 1e-6) | (p[:, 1] > frame.len_v + 1e-6)
        if beside.any() or (p[:, 2] < -1e-6).any():
            self.note(f"{100 * beside.mean():.0f} % of the points lie beside the sampled rectangle (the nearest probes' light goes on), "
                      f"{100 * (p[:, 2] < -1e-6).mean():.0f} % below its plane")

    def timed(self, name, work):
        begun = time.process_time() + sum(self.children())
        result = work()
        self.spent[name] = time.process_time() + sum(self.children()) - begun
        return result

    @staticmethod
    def children():
        import resource
        u = resource.getrusage(resource.RUSAGE_CHILDREN)
        return u.ru_utime, u.ru_stime

    # ---- the work ----

    def run(self):
        g, channels = self.given, self.stage.channels
        self.matrix = self.timed("matrix", lambda: matrix.of(self.stage, self.match, self.measured, g.matrix))
        came = f"{self.spent['matrix']:.1f} CPU seconds" if self.matrix.fresh else f"from {g.matrix}"
        self.note(f"matrix of {len(self.match.points)} x 3 to {len(channels)}: {came}")
        if not self.matrix.A.any():
            raise Bad(f"{g.files[0]}: expected lights that reach the subject, found none that does")
        wanted = self.timed("wanted", self.wanted_light)
        self.owner = np.array([k for k, light in enumerate(self.stage.lights) for _ in light.channels])
        whole_fitter = self.fitter(wanted)
        fitter = self.chosen(whole_fitter, wanted)
        best, outputs, codes = self.timed("drive", lambda: self.driven(fitter, wanted))
        coded = self.coding.output(codes)
        alone = best if fitter is whole_fitter else [None] * len(best)
        each = zip(self.places, repeat(fitter), wanted, outputs, coded, repeat(whole_fitter), alone)
        frames = self.timed("bounds", lambda: [report.Frame(*f) for f in each])
        return self.told(frames, whole_fitter, codes, coded)

    def measured(self, channel, seen):
        return measured_light(channel, self.match, seen, self.stage.unit, self.threads)

    def wanted_light(self):
        g = self.given
        factor = 1. if g.exposure == "auto" else g.exposure
        target = Target(self.field, self.match, self.stage.unit, self.matrix.seen, g.geometry, factor, self.threads)
        wanted = [target.irradiance(p) for p in self.places]
        if not any(np.any(w > 0) for w in wanted):
            raise Bad(f"{g.files[1]}: expected light at the subject's place, found none")
        return wanted

    def ranges(self):
        channels = self.stage.channels
        return np.array([c.low for c in channels]), np.array([c.high for c in channels])

    def fitter(self, wanted):
        """The fitter of all lights, with its ridge; the exposure is settled before."""
        g, (low, high) = self.given, self.ranges()
        A, weight = self.matrix.A, self.match.weight
        self.exposure = g.exposure
        if g.exposure == "auto":
            brightest = sorted(wanted, key=lambda w: -np.abs(w).max())[:NOISE_FRAMES]
            self.exposure = self.timed("exposure", lambda: self.just_possible(drive.Fitter(A, weight, low, high, 1e-4), brightest))
            for w in wanted:
                w *= self.exposure
            self.note(f"exposure {self.exposure:.6g}: the field's light times this")
        some = [wanted[k] for k in drive.spread(len(wanted), NOISE_FRAMES)]
        noise = g.noise / 100
        if g.ridge == "auto":
            self.ridge, self.rise = self.timed("ridge", lambda: drive.ridge_for(A, weight, low, high, some, noise))
        else:
            self.ridge, self.rise = g.ridge, drive.rise_by_noise(A, weight, low, high, g.ridge, some, noise) if noise else 0.
        return drive.Fitter(A, weight, low, high, self.ridge)

    @staticmethod
    def just_possible(fitter, wanted):
        """The greatest exposure, of steps of 1.25, at which the lights' limits raise no error by more than half a point."""
        free = [fitter.fit(w, unlimited=True)[0] for w in wanted]
        exposure = 1 / max(max(float((x / fitter.high).max()) for x in free), 1e-300)

        def costs(e):
            return max(fitter.error(fitter.fit(e * w)[0], e * w) - fitter.error(x, w) for x, w in zip(free, wanted))
        while costs(1.25 * exposure) <= EXPOSED:
            exposure *= 1.25
        return exposure

    def chosen(self, fitter, wanted):
        """The fitter of few lights, where that is asked for."""
        g = self.given
        if g.few is None or g.few >= len(self.stage.lights):
            return fitter
        some = [wanted[k] for k in drive.spread(len(wanted), FEW_FRAMES)]
        only = self.timed("few", lambda: drive.few_lights(fitter, some, self.owner, g.few))
        return drive.Fitter(self.matrix.A, self.match.weight, fitter.low, fitter.high, self.ridge, only)

    def driven(self, fitter, wanted):
        """(fits of the frames by themselves with their gaps, outputs (t, k), codes (t, k))."""
        best = [fitter.fit(w) for w in wanted]
        x = drive.smoothed(np.stack([b[0] for b in best]), self.given.smooth * self.given.fps)
        self.coding = drive.Coding.of(self.stage.channels)
        return best, x, drive.coded(self.coding, fitter, x, wanted)

    # ---- outputs ----

    def told(self, frames, fitter, codes, coded):
        g = self.given
        n, cpu = len(frames), self.spent
        cpu["frame"] = (cpu["wanted"] + cpu["drive"]) / n
        cpu["frame_with_bounds"] = cpu["frame"] + cpu["bounds"] / n
        info = {"stage": str(g.files[0]), "field": str(g.files[1]), "ridge": self.ridge, "noise": g.noise / 100, "rise_by_noise": self.rise,
                "exposure": self.exposure, "cpu_seconds": cpu}
        tree = report.contents(frames, self.stage, self.match, fitter, report.colours_of(self.matrix.A), codes, self.coding, info)
        channels = self.stage.channels
        if g.dmx is not None:
            dmx.check(channels, g.protocol, g.dmx)
        if g.picture is not None:
            tree["picture"] = self.drawn(coded, tree)
        if g.output is not None:
            with whole(g.output) as f:
                f.write(",".join(["seconds", *(c.title for c in channels)]) + "\n")
                for p, row in zip(self.places, codes / self.coding.top):
                    f.write(",".join(f"{v:.7g}" for v in (p.seconds, *row)) + "\n")
        if g.dmx is not None:
            with whole(g.dmx, "wb") as f:
                dmx.write(f, channels, codes, self.coding.top, g.protocol)
        if g.errors is not None:
            with whole(g.errors) as f:
                report.write_errors(f, frames, self.match)
        if g.report is not None:
            with whole(g.report) as f:
                report.write_json(f, tree)
        return tree

    def drawn(self, coded, tree):
        measured = [light.name for light in self.stage.lights if light.fixture is None]
        if measured:
            self.note(f"picture: {len(measured)} measured lights are not drawn")
        title = f"{len(self.stage.lights)} lights, irradiance error {100 * tree['error']:.3g} % (bound {100 * tree['bound_unconstrained']:.3g} %)"
        return picture.draw(self.given.picture, self.stage, self.places, coded, self.field, self.stage.unit, self.exposure, self.shown, title)
