"""ilfpack and what probes did not see (alpha), and pictures that are no probes.

The light of a room of constant 1 is 1 wherever it is looked up: black light from a missing direction is the fault.
"""

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from common_util import write_exr
from conftest import one_line_error, run, shared_case

PLANE = ["--plane", "0 0 0 1 0 0 0 1 0"]
W, H = 32, 18


def exr(path, rgb, alpha=None, straight=True, **head):
    planes = {n: np.ascontiguousarray(rgb[..., i], dtype=np.float32) for i, n in enumerate("RGB")}
    if alpha is not None:
        planes["A"] = np.ascontiguousarray(alpha, dtype=np.float32)
        if straight:
            head["ilf:alpha"] = "unassociated"
    write_exr(path, planes, **head)


def pack(tmp_path, *probes, grid="1x1", **kw):
    """(quiet?, header, texels) of the light field."""
    args = [a for k, v in kw.items() if k != "code" for a in (f"--{k.replace('_', '-')}", v) if a is not True]
    r = run("ilfpack", "--grid", grid, *PLANE, "--type", "float", *args, "-o", tmp_path / "o.ilf.exr", *probes, code=kw.get("code", 0))
    if r.code:
        return r
    with OpenEXR.File(str(tmp_path / "o.ilf.exr"), separate_channels=True) as f:
        return r, dict(f.header()), np.stack([f.channels()[n].pixels.copy() for n in "RGB"], 2)


def weights(h, w=1, polar_max=np.pi / 2):
    edge = np.cos(np.arange(h + 1) * polar_max / h)
    return np.repeat((edge[:-1] - edge[1:])[:, None], w, 1) / w / (1 - np.cos(polar_max))


@pytest.mark.parametrize("rows", [1, 7, 12, 17])
def test_rows_unseen_all_round(tmp_path, rows):
    seen = np.zeros((H, W))
    seen[:rows] = 1
    exr(tmp_path / "p.exr", np.ones((H, W, 3)) * seen[..., None], seen)
    r, head, got = pack(tmp_path, tmp_path / "p.exr")
    assert (got == 1).all() and np.isclose(head["ilf:polarValid"], rows / H * np.pi / 2)
    share = 100 * (1 - weights(H)[:rows].sum())
    one_line_error(r, "ilfpack", "alpha 0", f"{share:.3g} %", f"{90 * rows / H:.4g}")


def test_the_last_row_counts_by_its_share(tmp_path):
    seen = np.zeros((H, W))
    seen[:10] = 1
    seen[9] = 0.25
    exr(tmp_path / "p.exr", np.ones((H, W, 3)) * (seen > 0)[..., None], seen)
    _, head, got = pack(tmp_path, tmp_path / "p.exr")
    assert (got == 1).all() and np.isclose(head["ilf:polarValid"], 9.25 / H * np.pi / 2)


def test_a_rim_a_little_off_centre(tmp_path):
    """The lens's axis is not quite the plane's normal: the rim waves by a row."""
    y, x = np.mgrid[0:H, 0:W]
    seen = (y < 12 + np.cos(2 * np.pi * x / W)).astype(float)
    exr(tmp_path / "p.exr", np.ones((H, W, 3)) * seen[..., None], seen)
    r, head, got = pack(tmp_path, tmp_path / "p.exr")
    assert (got == 1).all() and np.deg2rad(54) < head["ilf:polarValid"] <= np.deg2rad(60)
    one_line_error(r, "ilfpack", "seen all round")


def test_a_cropped_file_is_no_lens(tmp_path):
    """What a data window leaves out is black, named, and no rim."""
    data = (np.array([0, 2], np.int32), np.array([W - 1, 9], np.int32))
    display = (np.array([0, 0], np.int32), np.array([W - 1, H - 1], np.int32))
    exr(tmp_path / "p.exr", np.ones((8, W, 3)), dataWindow=data, displayWindow=display)
    r, head, got = pack(tmp_path, tmp_path / "p.exr")
    share = 100 * (1 - weights(H)[2:10].sum())
    one_line_error(r, "ilfpack", "holes", f"{share:.3g} %")
    assert "ilf:polarValid" not in head and (got[2:10] == 1).all() and (got[:2] == 0).all() and (got[10:] == 0).all()


def test_a_smaller_statement_stands(tmp_path):
    seen = np.ones((H, W))
    seen[12:] = 0
    exr(tmp_path / "p.exr", np.ones((H, W, 3)), seen, **{"ilf:polarValid": 0.5})
    assert np.isclose(pack(tmp_path, tmp_path / "p.exr")[1]["ilf:polarValid"], 0.5)
    r, head, got = pack(tmp_path, tmp_path / "p.exr", polar_valid=80)
    assert np.isclose(head["ilf:polarValid"], np.deg2rad(80)) and (got == 1).all()
    one_line_error(r, "ilfpack", "held")


def test_holes_are_named_and_filled_on_request(tmp_path):
    rng = np.random.default_rng(3)
    seen = np.ones((H, W))
    seen[4:9, 28:] = seen[4:9, :3] = 0  # across the seam
    seen[0] = 0  # the pole
    seen[rng.random((H, W)) < 0.05] = 0
    seen[-1] = 1
    exr(tmp_path / "p.exr", np.full((H, W, 3), 2) * seen[..., None], seen)
    share = 100 * weights(H, W)[seen == 0].sum()
    r, head, got = pack(tmp_path, tmp_path / "p.exr")
    one_line_error(r, "ilfpack", "holes", f"{share:.3g} %", "black")
    assert "ilf:polarValid" not in head and (got == 2 * seen[..., None]).all()
    r, head, got = pack(tmp_path, tmp_path / "p.exr", fill_holes=True)
    one_line_error(r, "ilfpack", "holes", "filled")
    assert np.allclose(got, 2, rtol=1e-6)


def test_filling_continues_a_gradient(tmp_path):
    y, x = np.mgrid[0:H, 0:W]
    light = (3 + np.sin(2 * np.pi * (x + 0.5) / W) + y / H)[..., None] * np.array([1, 2, 3])
    seen = np.ones((H, W))
    seen[6:10, 10:14] = 0
    exr(tmp_path / "p.exr", light * seen[..., None], seen)
    got = pack(tmp_path, tmp_path / "p.exr", fill_holes=True)[2]
    assert np.array_equal(got[seen > 0], light[seen > 0].astype(np.float32))
    assert (np.abs(got / light - 1) < 0.15).all()


def test_partial_alpha_does_not_dim(tmp_path):
    """What is seen of a texel is its light, whatever the share; quiet."""
    seen = np.linspace(0.01, 1, H * W).reshape(H, W)
    light = np.full((H, W, 3), 3.0)
    exr(tmp_path / "straight.exr", light, seen)
    exr(tmp_path / "multiplied.exr", light * seen[..., None], seen, straight=False)
    for name in ("straight", "multiplied"):
        r, _, got = pack(tmp_path, tmp_path / f"{name}.exr")
        assert r.err == "" and np.allclose(got, 3, rtol=1e-6)


def test_alpha_of_one_costs_nothing(tmp_path):
    light = np.random.default_rng(1).random((H, W, 3))
    exr(tmp_path / "a.exr", light)
    exr(tmp_path / "b.exr", light, np.ones((H, W)))
    a, b = pack(tmp_path, tmp_path / "a.exr"), pack(tmp_path, tmp_path / "b.exr")
    assert a[0].err == b[0].err == "" and np.array_equal(a[2], b[2]) and a[1].keys() == b[1].keys()


def test_light_without_cover_is_light(tmp_path):
    """OpenEXR's alpha 0 with light (a glow, or a channel that nobody filled)."""
    light = np.random.default_rng(1).random((H, W, 3)).astype(np.float32) + 1
    exr(tmp_path / "p.exr", light, np.zeros((H, W)), straight=False)
    r, _, got = pack(tmp_path, tmp_path / "p.exr")
    assert r.err == "" and np.array_equal(got, light)


def test_nothing_seen_is_refused(tmp_path):
    exr(tmp_path / "p.exr", np.ones((H, W, 3)), np.zeros((H, W)))
    one_line_error(pack(tmp_path, tmp_path / "p.exr", code=1), "ilfpack", "alpha 0 everywhere", "p.exr")
    assert not (tmp_path / "o.ilf.exr").exists()
    r, _, got = pack(tmp_path, tmp_path / "p.exr", ignore_alpha=True)
    assert r.err == "" and (got == 1).all()


def test_probes_of_different_masks(tmp_path):
    """The promise holds for all: the smallest angle; what others saw beyond it stays in the file."""
    light = np.ones((H, W, 3))
    for k, rows in enumerate((12, 18)):
        seen = np.zeros((H, W))
        seen[:rows] = 1
        exr(tmp_path / f"{k}.exr", light * (1 + k) * seen[..., None], seen)
    for order in ((0, 1), (1, 0)):
        r, head, got = pack(tmp_path, *(tmp_path / f"{k}.exr" for k in order), grid="2x1")
        one_line_error(r, "ilfpack", "0.exr sees least", "60 degrees")
        assert np.isclose(head["ilf:polarValid"], np.pi / 3)
        for place, k in enumerate(order):
            assert (got[:, place * W:(place + 1) * W] == 1 + k).all()


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_transparent_codes(tmp_path, suffix):
    """What lies under alpha 0 in a coded picture is no light."""
    a = np.full((H, W, 4), 255, np.uint8)
    a[12:, :, 3] = 0
    a[12:, :, :3] = 77
    Image.fromarray(a, "RGBA").save(tmp_path / f"p{suffix}")
    r, head, got = pack(tmp_path, tmp_path / f"p{suffix}")
    assert (got == 1).all() and np.isclose(head["ilf:polarValid"], np.pi / 3)
    one_line_error(r, "ilfpack", "60 degrees")


def test_the_chain_from_a_lens_of_120_degrees(tmp_path):
    folder = shared_case("alpha_dropped_by_ilfpack")
    run("fishremap", "--lens", "equidistant", "--fov", "120", "--size", f"{W}x{H}", "-o", tmp_path / "h.exr", folder / "lens120.exr")
    r, head, got = pack(tmp_path, tmp_path / "h.exr")
    assert np.allclose(got, 1, atol=1e-5) and np.isclose(head["ilf:polarValid"], np.pi / 3)


# ---- what is no probe ----------------------------------------------------------------------------------------

def test_plain_pictures_of_any_shape_are_probes(tmp_path):
    for w, h in ((128, 64), (64, 64), (64, 16)):
        exr(tmp_path / "p.exr", np.ones((h, w, 3)))
        r, head, _ = pack(tmp_path, tmp_path / "p.exr")
        assert np.isclose(head["ilf:polarMax"], np.pi / 2)
        if w == 2 * h:      # it might be a panorama: what is assumed is said
            one_line_error(r, "ilfpack", "taken for a probe", "90 degrees", "panorama")
        else:
            assert r.err == ""


def test_panoramas_by_their_headers(tmp_path):
    light = np.ones((32, 64, 3))
    exr(tmp_path / "a.exr", light, envmap=OpenEXR.ENVMAP_LATLONG)
    xmp = b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:Description GPano:ProjectionType="equirectangular"/></x:xmpmeta>'
    Image.new("RGB", (64, 32)).save(tmp_path / "b.jpg", xmp=xmp)
    element = xmp.replace(b' GPano:ProjectionType="equirectangular"/>', b"><GPano:ProjectionType>equirectangular</GPano:ProjectionType>")
    Image.new("RGB", (64, 32)).save(tmp_path / "c.jpg", xmp=element)
    for name in ("a.exr", "b.jpg", "c.jpg"):
        one_line_error(pack(tmp_path, tmp_path / name, code=1), "ilfpack", "panorama", "--from latlong", name)
        r, head, _ = pack(tmp_path, tmp_path / name, polar_max=180)
        assert np.isclose(head["ilf:polarMax"], np.pi)
        one_line_error(r, "ilfpack", "panorama")
    exr(tmp_path / "cube.exr", np.ones((96, 16, 3)), envmap=OpenEXR.ENVMAP_CUBE)
    one_line_error(pack(tmp_path, tmp_path / "cube.exr", code=1), "ilfpack", "cube map")


@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
def test_fishremap_says_what_it_wrote(tmp_path, suffix):
    """A sphere stays one and a hemisphere one, without --polar-max; other charts are no probes."""
    exr(tmp_path / "world.exr", np.ones((32, 64, 3)))
    for degrees in (90, 120, 180):
        run("fishremap", "--from", "latlong", "--polar-max", degrees, "--size", "64x32", "-o", tmp_path / f"p{suffix}", tmp_path / "world.exr")
        r, head, _ = pack(tmp_path, tmp_path / f"p{suffix}")
        assert r.err == "" and np.isclose(head["ilf:polarMax"], np.deg2rad(degrees))
    run("fishremap", "--from", "latlong", "--to", "latlong", "--size", "64x32", "-o", tmp_path / f"l{suffix}", tmp_path / "world.exr")
    one_line_error(pack(tmp_path, tmp_path / f"l{suffix}", code=1), "ilfpack", "latlong", "fishremap")


def test_probes_that_contradict_each_other(tmp_path):
    exr(tmp_path / "a.exr", np.ones((H, W, 3)), **{"ilf:polarMax": float(np.pi)})
    exr(tmp_path / "b.exr", np.ones((H, W, 3)), **{"ilf:polarMax": float(np.pi / 2)})
    exr(tmp_path / "plain.exr", np.ones((H, W, 3)))
    one_line_error(pack(tmp_path, tmp_path / "a.exr", tmp_path / "b.exr", grid="2x1", code=1), "ilfpack", "ilf:polarMax", "b.exr")
    one_line_error(pack(tmp_path, tmp_path / "plain.exr", tmp_path / "a.exr", grid="2x1", code=1), "ilfpack", "ilf:polarMax")
    assert pack(tmp_path, tmp_path / "b.exr", tmp_path / "plain.exr", grid="2x1")[0].err == ""


def test_a_light_field_is_no_probe(tmp_path):
    exr(tmp_path / "p.exr", np.ones((H, W, 3)))
    pack(tmp_path, tmp_path / "p.exr", tmp_path / "p.exr", grid="2x1")
    (tmp_path / "o.ilf.exr").rename(tmp_path / "field.exr")
    one_line_error(pack(tmp_path, tmp_path / "field.exr", code=1), "ilfpack", "light field", "field.exr")


def test_a_probe_from_a_pipe(tmp_path):
    seen = np.ones((H, W))
    seen[12:] = 0
    exr(tmp_path / "p.exr", np.ones((H, W, 3)), seen)
    want = pack(tmp_path, tmp_path / "p.exr")[2]
    data = (tmp_path / "p.exr").read_bytes()
    run("ilfpack", "--grid", "1x1", *PLANE, "--type", "float", "-o", tmp_path / "s.ilf.exr", "-", stdin=data)
    with OpenEXR.File(str(tmp_path / "s.ilf.exr"), separate_channels=True) as f:
        assert np.array_equal(f.channels()["R"].pixels, want[..., 0])
