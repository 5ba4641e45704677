"""ilfstage's parts: lamps against closed forms, what is wanted, the solver against scipy's, IES files, spectra, codes and packets."""
import numpy as np
import pytest
from ilfstage_util import RGB, lobes, our_programs, spread, stage_text, unit, write_field  # noqa: F401
from scipy.optimize import lsq_linear

import ilf
from conftest import run
from ilfstage import dmx, drive, ies, match, matrix, place, solve, spectrum, stagefile, target


def matrix_of(folder, text, m):
    (folder / "s.toml").write_text(text)
    return matrix.of(stagefile.read(folder / "s.toml"), m, None).A


# ---- lamps ----------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("unit_name, metre", [("m", 1), ("cm", 100), ("ft", 1 / .3048)])
def test_a_small_lamp_follows_cosine_and_inverse_square(tmp_path, unit_name, metre):
    rng = np.random.default_rng(1)
    p = unit(rng.normal(size=(6, 3))) * rng.uniform(1, 4, (6, 1))
    aims = rng.normal(size=(6, 3)) * .3
    for power in (1, 3.5):
        m = match.sphere(40)
        A = matrix_of(tmp_path, stage_text(p * metre, aims * metre, size=.01 * metre, beam=f"cosine {power}", top=f'unit = "{unit_name}"'), m).reshape(40, 3, 6, 3)
        r = np.linalg.norm(p, axis=1)
        expected = np.maximum(m.normals @ (p / r[:, None]).T, 0) * np.maximum((unit(aims - p) * -p / r[:, None]).sum(1), 0) ** power / r ** 2
        assert np.allclose(A, np.einsum("sl,kc->sclk", expected, np.array(list(RGB.values()))), rtol=2e-3, atol=2e-5 * A.max())


def test_a_wide_face_near_by(tmp_path):
    """Irradiance below the middle of a square face, by its closed form."""
    h, w = .6, .8
    A = matrix_of(tmp_path, stage_text([(0, 0, h)], channels={"one": (1, 1, 1)}, size=f"[{w}, {w}]"),
                  match.Match("sphere", np.zeros((1, 3)), np.array([[0, 0, 1.]]), np.ones(3), np.ones(1)))
    a = w / 2 / h
    factor = 4 * 2 / (2 * np.pi) * a / np.sqrt(1 + a * a) * np.arctan(a / np.sqrt(1 + a * a))
    assert abs(A[0, 0, 0] / (np.pi * factor / w ** 2) - 1) < 5e-3


def test_a_rectangles_edges_lie_as_its_up_says(tmp_path):
    text = stage_text([(0, 2, 0)], channels={"one": (1, 1, 1)}, size="[1.2, 0.02]", each="up = [0, 0, 1]")
    n = np.array([[1., 0, 0], [-1, 0, 0], [0, 0, 1.], [0, 0, -1]])
    E = matrix_of(tmp_path, text, match.Match("sphere", np.zeros((4, 3)), n, np.ones(3), np.full(4, .25)))[:, 0, 0]
    assert E[0] > 20 * E[2] and np.isclose(E[0], E[1], rtol=1e-4) and np.isclose(E[2], E[3], atol=1e-3 * E[0])


def test_what_is_hidden_and_what_turns_away_gives_nothing(tmp_path):
    """A card before one of three lamps, the second turned away; a grey wall behind the subject gives light with a bounce."""
    p = np.array([(1.5, 0, 0), (-1.5, 0, 0), (0, 1.5, 0)])
    (tmp_path / "card.rad").write_text("void plastic black 0 0 5 0 0 0 0 0\nblack mesh card 1 card.rtm 0 0\n"
                                       "void plastic grey 0 0 5 .5 .5 .5 0 0\ngrey polygon wall 0 0 12  -300 -60 -300  300 -60 -300  300 -60 300  -300 -60 300\n")
    (tmp_path / "card.obj").write_text("v 100 -50 -50\nv 100 50 -50\nv 100 50 50\nv 100 -50 50\nf 1 2 3 4\n")
    run("obj2mesh", "card.obj", "card.rtm", cwd=tmp_path)
    (tmp_path / "stage.oct").write_text("mine")                        # a user's file with a name that we use, too, stays
    m = match.sphere(30)
    for bounces in (0, 1):
        text = stage_text(p * 100, [(0, 0, 0), (-300, 0, 0), (0, 0, 0)], channels={"one": (1, 1, 1)}, size=3, top=f'unit = "cm"\nscene = "card.rad"\nbounces = {bounces}')
        A = matrix_of(tmp_path, text, m)[:, 0]
        front = m.normals[:, 1] < -.5
        assert (bounces or A[:, 1].max() == 0) and A[:, 2].max() > .4
        assert sorted(f.name for f in tmp_path.iterdir()) == ["card.obj", "card.rad", "card.rtm", "s.toml", "stage.oct"] and (tmp_path / "stage.oct").read_text() == "mine"
        assert A[:, 0].max() == 0 if not bounces else A[:, 0].max() < .2
        assert (A[front, 2] > .02).all() if bounces else (A[front, 2] == 0).all()


IES = """IESNA:LM-63-1995
[TEST] a lamp with four sides
TILT=NONE
1 1000 1.5 7 5 1 2 .05 .05 0
1 1 60
0 15 30 45 60 75 90
0 22.5 45 67.5 90
900 800 600 400 200 100 0
900 820 640 420 220 110 0
900 840 660 460 240 120 0
900 860 680 480 260 130 0
900 880 700 500 280 140 0
"""


def test_a_beam_from_an_ies_file_is_that_of_ies2rad(tmp_path):
    (tmp_path / "a.ies").write_text(IES)
    (tmp_path / "s.toml").write_text(stage_text([(0, 0, 0)], aims=[(0, 0, -1)], channels={"one": (1, 1, 1)}, beam="ies a.ies", each="up = [1, 0, 0]").replace("rgb = [1.0, 1.0, 1.0]", 'rgb = "ies"'))
    stage = stagefile.read(tmp_path / "s.toml")
    d = unit(np.random.default_rng(2).normal(size=(60, 3)) - [0, 0, 1.5])
    d = d[np.degrees(np.arccos(-d[:, 2])) < 85]
    m = match.Match("sphere", 5 * d, -d, np.ones(3), np.full(len(d), 1 / len(d)))
    A = matrix.of(stage, m, None).A[:, 1, 0]
    run("ies2rad", "-t", "default", "-i", .02, "-o", "peer", "a.ies", cwd=tmp_path)
    (tmp_path / "p.oct").write_bytes(run("oconv", "peer.rad", cwd=tmp_path).out)
    text = "".join(f"{' '.join(map(repr, [*map(float, 5 * x), *map(float, -x)]))}\n" for x in d)
    out = run("rtrace", "-h", "-I", "-ab", 0, "-dj", 0, "-ds", 0, "-dt", 0, "p.oct", stdin=text, cwd=tmp_path).text
    peer = np.array([line.split() for line in out.splitlines()], float)[:, 1]
    assert peer.min() > 0 and np.allclose(A, peer, rtol=.01)


@pytest.mark.parametrize("change, word", [
    (("TILT=NONE", "TILT=lamp.tlt"), "TILT"), (("TILT=NONE\n", ""), "TILT"), (("7 5 1 2", "7 5 2 2"), "type C"), (("900 880 700", "900 x 700"), "'x'"),
    (("0 22.5 45 67.5 90\n", "0 22.5 45 67.5 80\n"), "horizontal"), (("0 15 30", "0 30 15"), "rise"), (("900 820 640", "900 -5 640"), "candela"), (("280 140 0\n", "\n"), "35"),
    (("7 5 1 2", "7.5 5 1 2"), "vertical"), (("900 820 640", "900 nan 640"), "candela")])
def test_a_bad_ies_file_is_refused(tmp_path, change, word):
    (tmp_path / "a.ies").write_text(IES.replace(*change))
    with pytest.raises(ies.Bad, match=word):
        ies.read(tmp_path / "a.ies")


def test_spectra():
    nm = np.arange(380., 781)
    flat = spectrum.rgb(nm, np.ones(len(nm)))
    assert np.ptp(flat) / flat.mean() < .03                                   # equal energy is white
    assert abs(flat.mean() * 179 / (683 * 106.9) - 1) < .01                   # the integral of V
    narrow = spectrum.rgb(np.array([549., 550, 551]), np.array([0, 1., 0]))
    assert abs(narrow @ [.265, .670, .065] * 179 / (683 * .995) - 1) < .03 and narrow.argmax() == 1
    assert spectrum.rgb(np.array([620., 640]), np.ones(2))[0] > 0


# ---- what is wanted ----------------------------------------------------------------------------------------------

def test_uniform_light_from_above_has_the_hemispheres_irradiance(tmp_path):
    write_field(tmp_path / "f.ilf.exr", lambda d, at: np.ones_like(d) * [1, 2, 3], 24, 12)
    m = match.sphere(80)
    with ilf.open(tmp_path / "f.ilf.exr") as f:
        E = target.Target(f, m).irradiance(place.Place(0, np.zeros(3)))
    assert np.allclose(E, np.pi * (1 + m.normals[:, 2:]) / 2 * [1, 2, 3], rtol=1e-3, atol=2e-3)


def test_turning_the_subject_turns_what_it_sees(tmp_path):
    """A heading of a texel's whole multiples: the same as turned probes."""
    light = lobes()
    turn = np.radians(90)
    R = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    write_field(tmp_path / "a.ilf.exr", light)
    write_field(tmp_path / "b.ilf.exr", lambda d, at: light(d @ R, at))
    m = match.sphere(50)
    with ilf.open(tmp_path / "a.ilf.exr") as a, ilf.open(tmp_path / "b.ilf.exr") as b:
        assert np.allclose(target.Target(a, m).irradiance(place.Place(0, np.zeros(3), 90.)), target.Target(b, m).irradiance(place.Place(0, np.zeros(3))), rtol=1e-4)


def test_a_meshes_points_see_past_the_mesh(tmp_path, monkeypatch):
    """A convex mesh hides nothing of itself: its points have the irradiance of their normals; in a corner half is hidden."""
    v = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], float) * .1
    t = np.array([(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)])
    light = lobes(sharp=2.)
    write_field(tmp_path / "f.ilf.exr", light)
    m = match.mesh(v, t, 40, [.5, .4, .3], 1.)
    subject = matrix.write_subject(tmp_path, m)
    seen = matrix.sight(tmp_path, m, subject)
    with ilf.open(tmp_path / "f.ilf.exr") as f:
        E = target.Target(f, m, seen=seen).irradiance(place.Place(0, np.zeros(3)))
        bare = target.Target(f, match.Match("sphere", m.points * 0, m.normals, m.factor, m.weight)).irradiance(place.Place(0, np.zeros(3)))
    assert np.allclose(E, bare, rtol=.03, atol=.01 * bare.max())
    corner = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (0, 1, 1)], float)
    m = match.mesh(corner, np.array([(0, 1, 2), (0, 2, 3), (0, 3, 5), (0, 5, 4)]), 60, [.5] * 3, 1.)
    share = matrix.sight(tmp_path, m, matrix.write_subject(tmp_path, m)).mean(1)
    assert share.max() < .51 and share.min() < .35


# ---- the solver ------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("lights, ridge", [(29, 1e-6), (40, 1e-3)])
def test_fits_are_those_of_scipy(lights, ridge):
    rng = np.random.default_rng(7)
    m = match.sphere(100)
    A = np.einsum("sl,ck->sclk", np.maximum(m.normals @ spread(lights).T, 0), np.array([[1, .1, .05], [.1, 1, .1], [.02, .1, 1]])).reshape(100, 3, -1)
    b = np.einsum("sl,lc->sc", np.maximum(m.normals @ unit(rng.normal(size=(6, 3))).T, 0), rng.uniform(0, 3, (6, 3)))
    n = A.shape[2]
    low, high = np.where(np.arange(n) % 7 == 0, .05, 0.), np.where(np.arange(n) % 5 == 0, .3, 2.)
    x, gap = drive.Fitter(A, m.weight, low, high, ridge).fit(b)
    flat, effect = A.reshape(-1, n) / 10, ((A.reshape(-1, n) / 10) ** 2).sum(0)
    peer = lsq_linear(np.vstack([flat, np.diag(np.sqrt(ridge * effect))]), np.r_[b.ravel() / 10, np.sqrt(ridge * effect) * low], (low, high), tol=1e-12)
    cost = ((flat @ x - b.ravel() / 10) ** 2).sum() / 2 + ridge * (effect * (x - low) ** 2).sum() / 2
    assert (x >= low).all() and (x <= high).all() and gap < 1e-9
    assert cost <= peer.cost * (1 + 1e-7) + 1e-12 and np.allclose(flat @ x, flat @ peer.x, atol=1e-4 * np.linalg.norm(b) / 10)


def test_colours_that_no_channel_shares_are_solved_by_themselves():
    A = np.zeros((4, 3, 3))
    A[:, 0, 0], A[:, 1:, 1], A[:, 2, 2] = 1, 1, 1
    assert drive.colour_groups(A) == [[0], [1, 2]]
    assert drive.colour_groups(np.ones((4, 3, 2))) == [[0, 1, 2]]


def test_settled_codes_are_never_worse_than_rounded_ones():
    rng = np.random.default_rng(3)
    m = match.sphere(60)
    A = np.einsum("sl,ck->sclk", np.maximum(m.normals @ spread(60).T, 0), np.eye(3)).reshape(60, 3, -1)
    f = drive.Fitter(A, m.weight, np.zeros(180), np.ones(180), 1e-4)
    for bits, gamma in ((8, 1.), (8, 2.2), (10, 1.)):
        c = drive.Coding.of([stagefile.Channel("l", "c", None, 0., 1., gamma, bits)] * 180)
        b = np.einsum("sck,k->sc", A, rng.uniform(0, .02, 180))
        x = f.fit(b)[0]
        plain, settled = f.error(c.output(c.codes(x)), b), f.error(c.output(drive.coded(c, f, x[None], [b])[0]), b)
        assert settled <= plain and (gamma != 1 or settled < .5 * plain)


def test_smoothing_keeps_what_is_constant_and_the_ranges():
    x = np.random.default_rng(1).uniform(size=(30, 4))
    s = drive.smoothed(x, 3.)
    assert np.allclose(drive.smoothed(np.ones((9, 2)), 4), 1) and s.min() >= x.min() and s.max() <= x.max()
    assert np.abs(np.diff(s, axis=0)).max() < .3 * np.abs(np.diff(x, axis=0)).max()


# ---- on the wire -----------------------------------------------------------------------------------------------------

def test_packets_byte_by_byte():
    def channel(slot, bits):
        return stagefile.Channel("l", "c", None, 0., 1., 1., bits, slot)
    cs, tops = [channel((1, 1), 8), channel((1, 2), 16), channel((300, 511), 12)], np.array([255, 65535, 4095])
    data = dmx.slots_of(cs, [200, 0x1234, 4095], tops)
    assert data[1][:4] == bytes([200, 0x12, 0x34, 0]) and data[300][-2:] == b"\xff\xff" and {len(d) for d in data.values()} == {512}
    a = dmx.artnet(300, 0, data[300])
    assert a[:18] == b"Art-Net\0" + bytes([0, 0x50, 0, 14, 1, 0, 299 & 255, 299 >> 8, 2, 0]) and len(a) == 530 and a[18:] == data[300]
    assert dmx.artnet(1, 254, data[1])[12] == 255 and dmx.artnet(1, 255, data[1])[12] == 1      # never 0, which switches order off
    s = dmx.sacn(300, 5, data[300])
    assert len(s) == 638 and s[:16] == b"\0\x10\0\0ASC-E1.17\0\0\0" and s[126:] == data[300]
    assert (s[16:18], s[38:40], s[115:117]) == (b"\x72\x6e", b"\x72\x58", b"\x72\x0b")            # lengths of the three layers
    assert s[18:22] == b"\0\0\0\4" and s[40:44] == b"\0\0\0\2" and s[117:126] == b"\2\xa1\0\0\0\1\2\1\0"
    assert s[44:52] == b"ilfstage" and s[108] == 100 and s[111] == 5 and s[113:115] == bytes([1, 44])


def test_ranges_hold_in_codes():
    cs = [stagefile.Channel("l", "c", None, .101, .502, g, 8) for g in (1., 2.2)]
    c = drive.Coding.of(cs)
    for x in (0., .3, 1.):
        out = c.output(c.codes(np.full(2, x)))
        assert (out >= .101).all() and (out <= .502).all()


def test_a_kept_problem_has_the_same_answer_from_any_start():
    rng = np.random.default_rng(9)
    A = rng.uniform(size=(20, 50))
    p = solve.Problem(A, np.ones(50), 1e-4 * (A * A).sum(0), 1e-4)
    b = A @ rng.uniform(0, 1, 50) + rng.normal(size=20)
    x, y, _ = solve.solve(p, b)
    for start in (None, y, rng.normal(size=20) * 10):
        assert np.allclose(solve.solve(p, b, y=start)[0], x, atol=1e-6)
