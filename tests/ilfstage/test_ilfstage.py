"""ilfstage as a program: fields that the stage itself has made, properties that must hold, what it writes and what it refuses."""
import json

import numpy as np
import pytest
from ilfstage_util import NOTES, RGB, disc_lamp, inside, lobes, our_programs, outcome, spread, stage_text, unit, write_field  # noqa: F401

import fishremap_util as U
import ilf
from conftest import one_line_error, run
from ilfstage.errors import Bad

LIGHTS = 1.5 * spread(18)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ilfstage")
    (folder / "s.toml").write_text(stage_text(LIGHTS))
    write_field(folder / "f.ilf.exr", lobes(), grid=(3, 3))
    return folder


def self_made(folder, levels, power=2., size=.02):
    """A light field of version 2 that holds the lamps of a stage at those levels: (n lamps, R, G, B), and the stage."""
    p = 1.5 * unit(spread(len(levels), up=True) + [0, 0, .25])          # above all points of the subject: a field knows no light from below its plane
    (folder / "own.toml").write_text(stage_text(p, size=size, beam=f"cosine {power}"))
    colours = np.array(list(RGB.values()))
    lamps = [disc_lamp(x, -x, size, level @ colours / (np.pi / 4 * size ** 2), power) for x, level in zip(p, levels) if level.any()]
    write_field(folder / "own.ilf.exr", lambda d, at: np.zeros_like(d), 16, 8, lamps=lamps)


def test_a_field_that_the_stage_made_comes_back(tmp_path):
    """Its lamps are in it as bodies, and libilf evaluates them: another way than the matrix's."""
    rng = np.random.default_rng(4)
    levels = rng.uniform(.1, .9, (12, 3)) * (rng.uniform(size=(12, 3)) < .7)
    self_made(tmp_path, levels)
    for options in ((), ("--noise", 0)):
        report, drives, _ = inside(tmp_path, "own.toml", "own.ilf.exr", "--at", "0 0 0", *options)
        found = np.array([[drives[f"l{k}.{c}"][0] for c in RGB] for k in range(12)])
        assert report["error"] < 1e-3 and report["rise_by_noise"] <= .03
        assert np.sqrt(((found - levels) ** 2).mean() / (levels ** 2).mean()) < 1e-3 and np.abs(found - levels).max() < 2e-3
    report = inside(tmp_path, "own.toml", "own.ilf.exr", "--at", "0 0 0", "--normals", 20, "--volume", "0.3 0.3 0.3 2x2x2")[0]     # where lamps are near, and differ from point to point
    assert report["error"] < 2e-3


def test_even_light_from_above_by_lamps_all_round(tmp_path):
    """Half a furnace: many lamps on a sphere come near it, those above the plane alike, those below it out."""
    p = 3 * spread(80)
    (tmp_path / "s.toml").write_text(stage_text(p, channels={"w": (30, 30, 30)}))
    write_field(tmp_path / "f.ilf.exr", lambda d, at: np.ones_like(d), 48, 24)
    report, drives, _ = inside(tmp_path, "s.toml", "f.ilf.exr", "--normals", 80, "--errors", "e.csv", "--ridge", "4e-2", "--noise", 0)
    x = np.array([drives[f"l{k}.w"][0] for k in range(80)])
    up = p[:, 2] / 3
    assert report["error"] < .03 and x[up < -.3].max() < .15 * x[up > .3].mean() and x[up > .3].std() < .35 * x[up > .3].mean()
    e = np.loadtxt(tmp_path / "e.csv", delimiter=",", skiprows=1)
    assert np.allclose(e[:, 7], np.pi * (1 + e[:, 6]) / 2, atol=.01) and abs(30 / 9 * (x * np.maximum(up, 0)).sum() / np.pi - 1) < .03


def test_errors_stand_beside_their_bounds(folder):
    report, drives, said = inside(folder, "s.toml", "f.ilf.exr", "--exposure", "auto")
    assert report["bound_unconstrained"] <= report["bound_not_negative"] <= report["error_within_ranges"] <= report["error"] + 1e-6 < .12
    assert abs(sum(report["squared_error_by_reason"].values()) - report["error"] ** 2) < 1e-9
    assert f"{100 * report['error']:.3g} %" in said and "unconstrained" in said
    assert all((v >= 0).all() and (v <= 1).all() for v in drives.values())


def test_noise_in_the_matrix_costs_little(folder):
    """Each lamp 2 % off at every direction: solved by the file's matrix, lit by another."""
    report, drives, _ = inside(folder, "s.toml", "f.ilf.exr", "--matrix", "m.npz", "--errors", "e.csv")
    A = np.load(folder / "m.npz")["A"]
    wanted = np.loadtxt(folder / "e.csv", delimiter=",", skiprows=1)[:, 7:10]
    x = np.array([v[0] for k, v in drives.items() if k != "seconds"])
    error = lambda M: np.linalg.norm(M @ x - wanted) / np.linalg.norm(wanted)       # noqa: E731
    assert abs(error(A) - report["error"]) < 1e-4
    rng = np.random.default_rng(11)
    assert max(error(A * (1 + .02 * rng.normal(size=A.shape))) for _ in range(5)) < report["error"] + .03


def test_a_kept_matrix_is_used_until_something_changes(folder):
    options = ("--matrix", "kept.npz", "--noise", 0)
    first = inside(folder, "s.toml", "f.ilf.exr", *options)[1]
    assert not any("from kept.npz" in n for n in NOTES)
    again = inside(folder, "s.toml", "f.ilf.exr", *options)[1]
    assert any("from kept.npz" in n for n in NOTES) and all(np.array_equal(first[k], again[k]) for k in first)
    (folder / "moved.toml").write_text((folder / "s.toml").read_text().replace("size = 0.05", "size = 0.06"))
    for stage, more in (("moved.toml", ()), ("s.toml", ("--normals", 41))):
        inside(folder, stage, "f.ilf.exr", *options, *more)
        assert not any("from kept.npz" in n for n in NOTES)
    (folder / "kept.npz").write_bytes(b"no matrix")
    with pytest.raises(Bad, match="kept.npz"):
        inside(folder, "s.toml", "f.ilf.exr", *options)


def test_order_and_brightness_do_not_matter(folder):
    """The lamps in another order, twice as strong each; and half the light: the same outputs."""
    _, drives, _ = inside(folder, "s.toml", "f.ilf.exr", "--ridge", "1e-4")
    order = np.random.default_rng(2).permutation(len(LIGHTS))
    (folder / "other.toml").write_text(stage_text(LIGHTS[order], channels={k: np.multiply(v, 2) for k, v in RGB.items()}))
    _, other, _ = inside(folder, "other.toml", "f.ilf.exr", "--ridge", "1e-4", "--exposure", 2)
    for k, was in enumerate(order):
        for c in RGB:
            assert abs(other[f"l{k}.{c}"][0] - drives[f"l{was}.{c}"][0]) < 2e-4


def test_a_path_its_frames_and_their_packets(folder):
    (folder / "walk.txt").write_text("# there\n0 -.4 -.3 0 0\n1 .4 .3 .1 90\n")
    report, drives, _ = inside(folder, "s.toml", "f.ilf.exr", "--path", "walk.txt", "--fps", 4, "--dmx", "a.dmx", "--bits", 16, "--exposure", "auto")
    assert np.allclose(drives["seconds"], [0, .25, .5, .75, 1]) and len(report["frames"]) == 5
    assert np.allclose(report["frames"][2]["at"], [0, 0, .05]) and report["frames"][2]["heading"] == 45
    packets = np.frombuffer((folder / "a.dmx").read_bytes(), np.uint8).reshape(5, 530)
    assert bytes(packets[0, :8]) == b"Art-Net\0" and packets[:, 12].tolist() == [1, 2, 3, 4, 5]
    values = np.stack([v for k, v in drives.items() if k != "seconds"], 1)
    sent = packets[:, 18:18 + 2 * values.shape[1]].astype(int)
    assert np.allclose((256 * sent[:, ::2] + sent[:, 1::2]) / 65535, values, atol=1e-6)
    smooth, slow, _ = inside(folder, "s.toml", "f.ilf.exr", "--path", "walk.txt", "--fps", 4, "--smooth", .5, "--exposure", "auto")
    jump = lambda d: max(np.abs(np.diff(v)).max() for k, v in d.items() if k != "seconds")      # noqa: E731
    assert jump(slow) < jump(drives) and smooth["error"] >= report["error"] and smooth["error_within_ranges"] == report["error_within_ranges"]


def test_few_lights(folder):
    errors = [inside(folder, "s.toml", "f.ilf.exr", "--few", n)[0] for n in (3, 8)]
    full = inside(folder, "s.toml", "f.ilf.exr")[0]
    assert errors[0]["lights_used"] <= 3 and errors[1]["lights_used"] <= 8
    assert errors[0]["error"] > errors[1]["error"] >= full["error"] and errors[0]["squared_error_by_reason"]["few_lights_and_smoothness"] > 0


def test_measured_lights_and_a_fourth_primary(folder):
    """A lamp measured as a light field: .37 of it is found to be .37; white beside R, G, B is used."""
    a, b = lobes(5, 2), lobes(6, 3)
    write_field(folder / "a.ilf.exr", a)
    write_field(folder / "b.ilf.exr", b)
    write_field(folder / "mix.ilf.exr", lambda d, at: .37 * a(d, at) + .8 * b(d, at))
    (folder / "measured.toml").write_text('[[measured]]\nname = "a"\nfield = "a.ilf.exr"\n[[measured]]\nname = "b"\nfield = "b.ilf.exr"\nplace = [0, 0, 0]\ndmx = "3.17"\n')
    report, drives, _ = inside(folder, "measured.toml", "mix.ilf.exr")
    assert abs(drives["a.level"][0] - .37) < 1e-3 and abs(drives["b.level"][0] - .8) < 1e-3 and report["error"] < 1e-3
    with ilf.open(folder / "b.ilf.exr") as f:
        U.write_exr(folder / "b.exr", np.asarray(f.probe(0, 0)))                # as a probe, too
    (folder / "probe.toml").write_text((folder / "measured.toml").read_text().replace("b.ilf.exr", "b.exr"))
    _, again, _ = inside(folder, "probe.toml", "mix.ilf.exr")
    assert all(abs(again[k] - drives[k]).max() < 1e-3 for k in drives)
    (folder / "white.csv").write_text("# nm W/(sr nm)\n380 .02\n780 .02\n")
    (folder / "rgbw.toml").write_text(stage_text(LIGHTS) + '[fixture.lamp.channel.white]\nspectrum = "white.csv"\n')
    assert inside(folder, "rgbw.toml", "f.ilf.exr", "--exposure", .3)[0]["channels"] == 4 * len(LIGHTS)


def test_the_program_says_what_the_parts_say(folder):
    r = run("ilfstage", "--quiet", "--threads", 2, "--normals", 40, "--report", "r.json", "-o", "drive.csv", "s.toml", "f.ilf.exr", cwd=folder)
    report, drives = outcome(folder)
    again, same, said = inside(folder, "s.toml", "f.ilf.exr")
    assert r.text == said + "\n" and r.err == "" and all(np.array_equal(drives[k], same[k]) for k in drives) and report["error"] == again["error"]


def test_volume_and_camera(folder):
    one, box = (inside(folder, "s.toml", "f.ilf.exr", "--normals", 20, *o)[0] for o in ((), ("--volume", ".2 .2 .2 2x2x2")))
    assert box["sensors"] == 160 and box["error"] >= one["error"] * .99
    assert inside(folder, "s.toml", "f.ilf.exr", "--camera", "0 -1 0")[0]["error"] > 0


def test_what_cannot_be_reached_is_said(tmp_path):
    """Lamps that are too weak, a side without any, a colour that no mixture has."""
    (tmp_path / "s.toml").write_text(stage_text([(0, 0, 1.5), (.8, 0, 1.2)], channels={"amber": (.6, .3, .01), "white": (.5, .5, .4)}))
    write_field(tmp_path / "f.ilf.exr", lambda d, at: np.maximum(d @ unit([-1, 0, .3]), 0)[..., None] ** 20 * [.1, .2, 6.])
    report, _, said = inside(tmp_path, "s.toml", "f.ilf.exr")
    u = report["unreached"]
    assert u["too_dark_with_all_lights_full_number"] > 5 and u["too_dark_with_all_lights_full"][0]["normal"][0] < 0
    assert u["colours_out_of_gamut_number"] > 5 and report["channels_at_their_upper_limit"] and report["would_need_times_the_light"] > 1
    assert all(word in said for word in ("too dark", "out of gamut", "at their limits"))


# ---- what is refused -----------------------------------------------------------------------------------------------------

LAMP = '[fixture.lamp]\nsize = 0.1\n[fixture.lamp.channel.w]\nrgb = [1, 1, 1]\n'
ONE = '[[light]]\nname = "a"\nfixture = "lamp"\nposition = [0, 0, 2]\naim = [0, 0, 0]\n'
BAD_STAGES = [
    ("", ("empty stage",)), (LAMP, ("empty stage",)), ('unit = "yard"\n' + LAMP + ONE, ("unit", "yard")), (LAMP + ONE + ONE, ("two 'a'",)),
    (LAMP + ONE.replace("2]", "nan]"), ("position", "finite")), (LAMP + ONE.replace("aim", "direction"), ("direction", "0 0 0")),
    (LAMP + "range = [-0.1, 1]\n" + ONE, ("range",)), (LAMP + "range = [0.5, 0.2]\n" + ONE, ("range",)), (LAMP + "bits = 7\n" + ONE, ("bits",)),
    (LAMP.replace("[1, 1, 1]", "[1, -1, 1]") + ONE, ("rgb",)), (LAMP.replace("0.1", "-0.1") + ONE, ("size",)), (LAMP + ONE.replace("aim", "aims"), ("aim or direction",)),
    (LAMP + ONE + "colour = 3\n", ("colour",)), (LAMP + ONE + 'dmx = "1.513"\n', ("dmx",)), (LAMP + ONE.replace('"lamp"', '"spot"'), ("spot",)), ("[fixture", ("TOML",)),
    (LAMP.replace("rgb = [1, 1, 1]", 'spectrum = "none.csv"') + ONE, ("none.csv",)), (LAMP.replace("size", 'beam = "ies none.ies"\nsize') + ONE, ("none.ies",)),
    (LAMP.replace("size", 'beam = "cone 3"\nsize') + ONE, ("beam",)), (LAMP + ONE + 'dmx = "1.1"\n' + ONE.replace('"a"', '"b"') + 'dmx = "1.1"\n', ("1.1", "a.w")),
    ('bounces = 9\n' + LAMP + ONE, ("bounces",)), (LAMP + ONE.replace("name = \"a\"", "name = \"a b\""), ("name",)), (LAMP + ONE + "up = [0, 0, 1]\n", ("up",)),
    (LAMP.replace("[fixture.lamp.channel.w]\nrgb = [1, 1, 1]\n", "") + ONE, ("channel",)), (LAMP + '[[measured]]\nname = "m"\nfield = "none.ilf.exr"\n', ("none.ilf.exr",)),
]


def test_bad_stages_are_refused_in_one_line(folder):
    from ilfstage import stagefile
    for k, (text, words) in enumerate(BAD_STAGES):
        (folder / "bad.toml").write_text(text)
        with pytest.raises(stagefile.Bad) as e:
            stagefile.read(folder / "bad.toml")
        assert "bad.toml" in str(e.value) and "\n" not in str(e.value) and all(w in str(e.value) for w in words), (k, str(e.value))


REFUSED = [
    (("--at", "3 0 0"), 1, ("outside",)), (("--at", "0 0 -1"), 1, ("subject",)), (("--at", "0 nan 0"), 2, ("--at",)), (("--path", "none.txt"), 1, ("none.txt",)),
    (("--few", "0"), 2, ("--few",)), (("--bits", "4"), 2, ("--bits",)), (("--volume", "1 1 1 2x2"), 2, ("--volume",)), (("--path", "none.txt", "--at", "0 0 0"), 2, ("--at",)),
    (("--mesh", "none.obj"), 1, ("none.obj",)), (("-o", "no/such/folder.csv"), 1, ("folder.csv",)),
]


@pytest.mark.parametrize("options, code, words", REFUSED[:3])
def test_what_is_refused(folder, options, code, words):
    if words == ("outside",):
        words = ("expected the subject", "3.5")
    before = sorted(p.name for p in folder.iterdir())
    one_line_error(run("ilfstage", "--quiet", *options, "s.toml", "f.ilf.exr", cwd=folder, code=code), "ilfstage", *words)
    assert sorted(p.name for p in folder.iterdir()) == before


def test_command_lines_that_are_refused():
    from ilfstage import options
    for words, code, named in REFUSED:
        if code == 2:
            with pytest.raises(options.Usage) as e:
                options.check(options.parse([*words, "s.toml", "f.ilf.exr"]))
            assert named[0] in str(e.value)


@pytest.mark.sweep
def test_a_picture_is_drawn(folder):
    report, _, _ = inside(folder, "s.toml", "f.ilf.exr", "--exposure", "auto", "--picture", "p.png")
    assert (folder / "p.png").stat().st_size > 5000 and report["picture"]["ball"][0] < .2
    assert json.loads((folder / "r.json").read_text())["picture"] == report["picture"]
