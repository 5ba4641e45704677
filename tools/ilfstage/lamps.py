"""A stage's lamps as Radiance has them, in metres: each with a radiant intensity of 1 W/sr in its brightest direction, in R, G and B.

A lamp with a cosine's power is a flat face (ring, or rectangle) of radiance cos(t)^(power-1) / area: intensity cos(t)^power.  One with an IES file
is a ball as wide as its face, of radiance I(direction) / projected area, so that it may shine to all sides.
"""
import numpy as np

from .radiance import row

CAL = """{ A1..A3: the lamp's axis, A4..A6: its up; theta and phi as IES files have them, degrees }
st_z = -(Dx*A1+Dy*A2+Dz*A3);
st_x = -(Dx*A4+Dy*A5+Dz*A6);
st_y = Dx*(A2*A6-A3*A5)+Dy*(A3*A4-A1*A6)+Dz*(A1*A5-A2*A4);
st_theta = acos(if(st_z-1, 1, if(-1-st_z, -1, st_z)))*180/PI;
st_phi_raw = atan2(st_y, st_x)*180/PI;
st_phi = if(st_phi_raw, st_phi_raw, if(-st_phi_raw, st_phi_raw+360, 0));
st_value(v) = v;
st_cosine = if(Rdot-.01, Rdot, .01)^A1;
"""


def rectangle(light):
    """Corners (4, 3), counter-clockwise as seen from where the light goes."""
    w, h = light.fixture.size
    across = np.cross(light.up, light.axis) * w / 2
    up = light.up * h / 2
    return np.array([light.position + s * across + t * up for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))])


def face(light, k):
    """(material's radiance, primitive) of light number k."""
    f, p = light.fixture, light.position
    if f.beam is not None:
        radius = np.sqrt(f.area / np.pi)
        return 1 / f.area, f"L{k} sphere f{k} 0 0 4 {row(p)} {radius:.9g}\n"
    if len(f.size) == 1:
        return 1 / f.area, f"L{k} ring f{k} 0 0 8 {row(p, light.axis)} 0 {f.size[0] / 2:.9g}\n"
    return 1 / f.area, f"L{k} polygon f{k} 0 0 12 {row(rectangle(light))}\n"


def pattern(light, k, data):
    """(modifier's name, its text): what the radiance of light number k is multiplied with."""
    f = light.fixture
    if f.beam is not None:
        return f"P{k}", f"void brightdata P{k} 5 st_value {data[id(f.beam)]} stage.cal st_theta st_phi 0 6 {row(light.axis, light.up)}\n"
    if f.power == 1:
        return "void", ""
    return f"P{k}", f"void brightfunc P{k} 2 st_cosine stage.cal 0 1 {f.power - 1:.9g}\n"


def data_text(beam):
    """A beam relative to its brightest direction, as a Radiance data file: theta, phi."""
    lines = ["2", f"0 0 {len(beam.theta)} " + row(beam.theta), f"0 0 {len(beam.phi)} " + row(beam.phi)]
    return "\n".join(lines + [row(column) for column in (beam.candela / beam.greatest).T]) + "\n"


def write(folder, lights, intensity=None, name="lights.rad"):
    """lights.rad with what it reads, materials L0, L1 ... in the order of `lights`.  intensity: (n, 3) W/sr, 1 if not given; lamps of 0 are left
    out."""
    (folder / "stage.cal").write_text(CAL)
    data = {}
    for light in lights:
        beam = light.fixture.beam
        if beam is not None and id(beam) not in data:
            data[id(beam)] = f"beam{len(data)}.dat"
            (folder / data[id(beam)]).write_text(data_text(beam))
    text = []
    for k, light in enumerate(lights):
        rgb = np.ones(3) if intensity is None else np.maximum(intensity[k], 0)
        if rgb.max() > 0:
            radiance, primitive = face(light, k)
            modifier, before = pattern(light, k, data)
            text.append(f"{before}{modifier} light L{k} 0 0 3 {row(rgb * radiance)}\n{primitive}")
    (folder / name).write_text("".join(text))
