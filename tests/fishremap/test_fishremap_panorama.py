"""Panoramas in: how the camera stood, what part of the sphere a picture shows, what is left out of it.

Colours are directions, (1 + d) / 2 with d in (u, v, n) = (x, y, z): what comes out tells for each texel where fishremap believes it to look.  The
oracle is numpy's and knows a camera as (forward, left, up), turned by heading about z, then pitch (nose up), then roll (right side down).
"""
import struct
import zlib

import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

import fishremap_util as U
from conftest import one_line_error, run, shared_data


def pose(heading=0, pitch=0, roll=0):
    """Columns: forward, left, up of the camera in (x, y, z)."""
    h, p, r = np.radians([heading, pitch, roll])
    about_z = np.array([[np.cos(h), -np.sin(h), 0], [np.sin(h), np.cos(h), 0], [0, 0, 1]])
    nose_up = np.array([[np.cos(p), 0, -np.sin(p)], [0, 1, 0], [np.sin(p), 0, np.cos(p)]])
    right_down = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    return about_z @ nose_up @ right_down


def panorama(w, h, matrix=np.eye(3), left=-180, right=180, top=90, bottom=-90):
    """Directions (x, y, z) of a panorama's pixels, or of a part of one."""
    lon = np.radians(left + (np.arange(w) + .5) * (right - left) / w)[None]
    lat = np.radians(top - (np.arange(h) + .5) * (top - bottom) / h)[:, None]
    return np.stack([np.cos(lat) * np.cos(lon), -np.cos(lat) * np.sin(lon), np.sin(lat) + 0 * lon], -1) @ matrix.T


def coded(d):
    """sRGB codes, 8 bits, of the colours that stand for directions."""
    v = (1 + d) / 2
    return np.round(255 * np.where(v <= .0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - .055)).astype(np.uint8)


def probe_of(path, polar=180, size=(64, 32)):
    got = U.read_exr(path)[0]
    want = U.probe(lambda q: q, *size, polar, 3)
    seen = got[..., 3] if got.shape[2] == 4 else np.ones(got.shape[:2])
    return 2 * got[..., :3] - 1, want, seen


TO_PROBE = ("--to", "probe", "--polar-max", 180, "--size", "64x32")
POSES = [(0, 0, 0), (90, 0, 0), (-35, 0, 0), (20, 12, 0), (200, 0, -9), (-130, -30, 25), (77, 60, 110)]


# ---- how the camera stood -----------------------------------------------------------------------------------

@pytest.mark.parametrize("heading, pitch, roll", POSES)
def test_a_pose_is_heading_then_pitch_then_roll(tmp_path, heading, pitch, roll):
    U.write_exr(tmp_path / "p.exr", (1 + panorama(240, 120, pose(heading, pitch, roll))) / 2)
    run("fishremap", "--from", "latlong", "--pose", f"{heading},{pitch},{roll}", *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.exr")
    got, want, _ = probe_of(tmp_path / "o.exr")
    assert np.abs(got - want).max() < .012
    # in words of the other options
    run("fishremap", "--from", "latlong", "--heading", heading, "--tilt", pitch, "--rotate", -roll, *TO_PROBE, "-o", tmp_path / "q.exr", tmp_path / "p.exr")
    assert np.allclose(U.read_exr(tmp_path / "q.exr")[0], U.read_exr(tmp_path / "o.exr")[0], atol=1e-6)


def xmp(**facts):
    """An XMP packet as cameras write it: attributes under a prefix of their own choosing."""
    prefix = facts.pop("prefix", "GPano")
    facts = {"ProjectionType": "equirectangular", **facts}
    if facts.pop("elements", False):
        body = "><" + "><".join(f"{prefix}:{k}>{v}</{prefix}:{k}" for k, v in facts.items()) + "></rdf:Description>"
    else:
        body = " " + "\n ".join(f'{prefix}:{k}="{v}"' for k, v in facts.items()) + "/>"
    return (f'<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
            f'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" '
            f'xmlns:{prefix}="http://ns.google.com/photos/1.0/panorama/"{body}</rdf:RDF></x:xmpmeta><?xpacket end="w"?>').encode()


def save(path, d, packet):
    """A picture of directions d with the packet, in the format of the name's ending."""
    image = Image.fromarray(coded(d))
    if path.suffix == ".png":
        info = PngInfo()
        info.add_itxt("XML:com.adobe.xmp", packet.decode())
        image.save(path, pnginfo=info)
    elif path.suffix == ".jpg":
        image.save(path, quality=98, subsampling=0, xmp=packet)
    else:
        image.save(path, tiffinfo={700: packet})


def crop(left, top, w, h, full_w, full_h):
    return {"FullPanoWidthPixels": full_w, "FullPanoHeightPixels": full_h, "CroppedAreaLeftPixels": left, "CroppedAreaTopPixels": top,
            "CroppedAreaImageWidthPixels": w, "CroppedAreaImageHeightPixels": h}


@pytest.mark.parametrize("ending", [".png", ".jpg", ".tif"])
@pytest.mark.parametrize("how", [{}, {"elements": True}, {"prefix": "ps"}])
def test_a_stated_pose_is_used_where_asked_for_and_else_said(tmp_path, ending, how):
    picture = tmp_path / f"p{ending}"
    save(picture, panorama(240, 120, pose(90 - 30, 8, -14)), xmp(PoseHeadingDegrees="30.0", PosePitchDegrees=8, PoseRollDegrees="-14", **how))
    r = run("fishremap", "--from", "latlong", "--pose", "stated", *TO_PROBE, "-o", tmp_path / "o.exr", picture)
    got, want, _ = probe_of(tmp_path / "o.exr")
    assert np.abs(got - want).max() < .05 and np.abs(got - want).mean() < .006
    assert "heading 30" in r.err and "pitch 8" in r.err and "roll -14" in r.err
    r = run("fishremap", "--from", "latlong", *TO_PROBE, "-o", tmp_path / "o.exr", picture)
    assert "not used" in r.err and "roll -14" in r.err
    r = run("fishremap", "--from", "latlong", "--heading", 10, *TO_PROBE, "-o", tmp_path / "o.exr", picture)
    assert r.err == ""


def test_a_series_keeps_what_its_pictures_state(tmp_path):
    """By way of hdrgen: the part that they show, and how the camera leaned."""
    facts = crop(0, 90, 720, 180, 720, 360)
    for k in range(2):
        save(tmp_path / f"{k}.png", panorama(240, 60, pose(90, 0, 6), top=45, bottom=-45), xmp(PoseRollDegrees=6, **facts))
    (tmp_path / "times.txt").write_text("0.png 1\n1.png .5\n")
    run("hdrgen", "--response", "srgb", "--times", tmp_path / "times.txt", "-o", tmp_path / "m.exr", tmp_path / "0.png", tmp_path / "1.png")
    r = run("fishremap", "--from", "latlong", *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "m.exr")
    assert "45 to -45" in r.err and "roll 6" in r.err and "--pose stated" in r.err
    r = run("fishremap", "--from", "latlong", "--to", "latlong", "--size", "64x32", "-o", tmp_path / "o.exr", tmp_path / "m.exr")
    assert "--tilt 0 --rotate -6" in r.err


def test_a_pose_that_is_not_stated_is_missed(tmp_path):
    save(tmp_path / "p.png", panorama(64, 32), xmp())
    r = run("fishremap", "--from", "latlong", "--pose", "stated", *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.png", code=1)
    one_line_error(r, "fishremap", "pose", "p.png")
    save(tmp_path / "p.png", panorama(240, 120, pose(90, 0, 5)), xmp(PoseRollDegrees=5))
    r = run("fishremap", "--from", "latlong", "--pose", "stated", *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.png")
    assert "heading taken as 0" in r.err
    got, want, _ = probe_of(tmp_path / "o.exr")
    assert np.abs(got - want).max() < .05
    for more in (("--heading", 3), ("--tilt", 3), ("--rotate", 3)):
        one_line_error(run("fishremap", "--from", "latlong", "--pose", "1,2,3", *more, *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.png", code=2), "fishremap", more[0])
    for bad in ("1,2,3,4", "north", "nan", ""):
        one_line_error(run("fishremap", "--from", "latlong", "--pose", bad, *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.png", code=2), "fishremap", "--pose")
    one_line_error(run("fishremap", "--from", "latlong", "--to", "angular", "--pose", "stated", "--size", "8x8", "-o", tmp_path / "o.exr", tmp_path / "p.png", code=2),
                   "fishremap", "--pose")


# ---- what part it shows ---------------------------------------------------------------------------------------

PARTS = [(-180, 180, 90, 0), (-180, 180, 60, -45), (-180, 180, 0, -90), (-120, 100, 90, -90), (-90, 90, 40, -80), (10, 170, 80, -20)]


def check_part(tmp_path, left, right, top, bottom, tolerance=.012):
    """The probe shows what the part does, and its alpha is the share of each texel that lies in it."""
    got, want, seen = probe_of(tmp_path / "o.exr")
    lon, lat = -np.degrees(np.arctan2(want[..., 1], want[..., 0])), np.degrees(np.arcsin(np.clip(want[..., 2] / np.linalg.norm(want, axis=-1), -1, 1)))
    margin = 9
    inside = (lat < top - margin if top < 90 else True) & (lat > bottom + margin if bottom > -90 else True)
    # longitudes: a texel is wide near the poles
    wide = margin / np.maximum(np.cos(np.radians(lat)), .05)
    if right - left < 360:
        inside = inside & (lon > left + wide) & (lon < right - wide)
        outside = (lon < left - wide) & (lon > right - 360 + wide) | (lon > right + wide) & (lon < left + 360 - wide)
    else:
        outside = np.zeros(lon.shape, bool)
    outside |= (lat > top + margin) | (lat < bottom - margin)
    assert inside.sum() > 100 and outside.sum() > 30
    assert (seen[inside] == 1).all() and (seen[outside] == 0).all()
    assert np.abs(got - want)[inside].max() < tolerance
    # the light of the part: its own solid angle
    omega = U.probe_solid_angle(64, 32, 180)[:, None]
    part = np.radians(right - left) * (np.sin(np.radians(top)) - np.sin(np.radians(bottom)))
    assert (seen * omega).sum() == pytest.approx(part, rel=2e-3)


@pytest.mark.parametrize("left, right, top, bottom", [p for p in PARTS if p[0] == -p[1]])
def test_a_part_that_the_options_name(tmp_path, left, right, top, bottom):
    """Parts about the panorama's middle: --span has no other; those beside it have a header (below)."""
    U.write_exr(tmp_path / "p.exr", (1 + panorama(200, 120, pose(0), left, right, top, bottom)) / 2)
    args = ("--span", right - left) if right - left < 360 else ()
    r = run("fishremap", "--from", "latlong", *args, "--latitudes", f"{top},{bottom}", "--heading", 0, *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.exr")
    assert r.err == ""
    check_part(tmp_path, left, right, top, bottom)


@pytest.mark.parametrize("left, right, top, bottom", PARTS)
@pytest.mark.parametrize("ending, shrunk", [(".png", 1), (".jpg", 1), (".tif", .5)])
def test_a_part_that_the_picture_states(tmp_path, left, right, top, bottom, ending, shrunk):
    """In pixels of the whole panorama, which a picture that was made smaller since still has."""
    full = 1440
    facts = crop(*(round(v * full / 360) for v in (left + 180, 90 - top, right - left, top - bottom)), full, full // 2)
    w, h = (round(v * shrunk * full / 2 / 360) for v in (right - left, top - bottom))
    save(tmp_path / f"p{ending}", panorama(w, h, pose(0), left, right, top, bottom), xmp(**facts))
    r = run("fishremap", "--from", "latlong", "--heading", 0, *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / f"p{ending}")
    assert "by its header" in r.err and f"{top} to {bottom}" in r.err
    check_part(tmp_path, left, right, top, bottom, .05)


@pytest.mark.parametrize("name", ["part.exr", "part.hdr"])
def test_what_fishremap_writes_of_a_part_it_reads_again(tmp_path, name):
    U.write_exr(tmp_path / "p.exr", (1 + panorama(240, 120)) / 2)
    run("fishremap", "--from", "latlong", "--to", "latlong", "--latitudes", "90,-90", "--size", "240x120", "-o", tmp_path / "same.exr", tmp_path / "p.exr")
    assert "ilf:latlong" not in U.read_exr(tmp_path / "same.exr")[1]
    run("fishremap", "--to", "latlong", "--lens", "equidistant", "--fov", 300, "--span", 200, "--latitudes", "60,-40", "--size", "120x60", "-o", tmp_path / name,
        fisheye_of_directions(tmp_path))
    r = run("fishremap", "--from", "latlong", "--heading", 0, *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / name)
    assert "-100 to 100" in r.err and "60 to -40" in r.err
    check_part(tmp_path, -100, 100, 60, -40, .02)


def fisheye_of_directions(tmp_path, n=300):
    """What an equidistant lens of 300 degrees sees that looks along x, upright."""
    y, x = (np.mgrid[0:n, 0:n] + .5) / (n / 2) - 1
    r, psi = np.hypot(x, y), np.arctan2(-y, x)
    t = r * np.radians(150)
    U.write_exr(tmp_path / "fish.exr", (1 + np.stack([np.cos(t), -np.sin(t) * np.cos(psi), np.sin(t) * np.sin(psi)], -1)) / 2)
    return tmp_path / "fish.exr"


def test_a_height_that_is_assumed_is_said_where_pixels_are_odd(tmp_path):
    for w, h, odd in ((64, 32, False), (65, 32, False), (64, 16, True), (64, 64, True)):
        U.write_exr(tmp_path / "p.exr", np.ones((h, w, 3)))
        r = run("fishremap", "--from", "latlong", *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.exr")
        assert ("--latitudes" in r.err) == odd
        if odd:
            assert f"{360 / w:.3g} degrees wide" in r.err and f"{180 / h:.3g} high" in r.err


@pytest.mark.parametrize("facts, words", [
    (crop(0, 0, 400, 100, 360, 180), ("longitudes", "220")), (crop(0, 100, 360, 100, 360, 180), ("latitudes", "-110")), (crop(-9, 0, 360, 90, 360, 180), ("-189",)),
    (crop(0, 0, 0, 90, 360, 180), ("-180",)), (crop(0, 0, 360, 60, 360, 180), ("6 times", "64 x 16"))])
def test_headers_that_cannot_be_true_are_refused(tmp_path, facts, words):
    save(tmp_path / "p.png", panorama(64, 16), xmp(**facts))
    r = run("fishremap", "--from", "latlong", *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.png", code=1)
    one_line_error(r, "fishremap", "p.png", "header", "--latitudes", *words)
    assert not (tmp_path / "o.exr").exists()
    # options that say it are believed
    run("fishremap", "--from", "latlong", "--span", 360, "--latitudes", "90,0", *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.png")


@pytest.mark.parametrize("packet", [b"", b"GPano:ProjectionType", b'GPano:ProjectionType="cylindrical"', b'GPano:ProjectionType="equirectangular" GPano:FullPanoWidthPixels="',
                                    b'GPano:ProjectionType="equirectangular" GPano:FullPanoWidthPixels="1e999" GPano:PosePitchDegrees="nan"',
                                    b'xmlns:="http://ns.google.com/photos/1.0/panorama/" GPano:ProjectionType="equirectangular"',
                                    b"http://ns.google.com/photos/1.0/panorama/", b"\xff" * 300])
def test_packets_that_say_nothing(tmp_path, packet):
    data = zlib.compress(b"".join(b"\0" + bytes(coded(row)) for row in panorama(16, 8)))
    text = b"XML:com.adobe.xmp\0\0\0\0\0" + packet
    chunks = [(b"IHDR", struct.pack(">IIBBBBB", 16, 8, 8, 2, 0, 0, 0)), (b"iTXt", text), (b"IDAT", data), (b"IEND", b"")]
    (tmp_path / "p.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks))
    r = run("fishremap", "--from", "latlong", *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.png")
    assert r.err == ""


@pytest.mark.parametrize("value", ["90", "0,10", "91,0", "90,-91", "x,0", "90,90"])
def test_latitudes_are_two_falling_numbers(tmp_path, value):
    U.write_exr(tmp_path / "p.exr", np.ones((8, 16, 3)))
    one_line_error(run("fishremap", "--from", "latlong", "--latitudes", value, *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.exr", code=2), "fishremap", "--latitudes")


def test_a_gaussian_over_a_part(tmp_path):
    """Beyond a part's edge there is nothing: a constant stays one, and the alpha falls."""
    U.write_exr(tmp_path / "p.exr", np.full((40, 90, 3), 2.))
    run("fishremap", "--from", "latlong", "--latitudes", "70,-60", "--filter", "gaussian:1", "--heading", 0, *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.exr")
    got = U.read_exr(tmp_path / "o.exr")[0]
    assert np.allclose(got[..., :3][got[..., 3] > 0], 2, rtol=1e-4) and (got[0, :, 3] < .05).all() and (got[16, :, 3] == 1).all()
    run("fishremap", "--from", "latlong", "--to", "latlong", "--latitudes", "70,-60", "--filter", "gaussian:1", "--size", "90x40", "-o", tmp_path / "q.exr", tmp_path / "p.exr")
    assert np.allclose(U.read_exr(tmp_path / "q.exr")[0][..., :3], 2, rtol=1e-4)


# ---- what is left out --------------------------------------------------------------------------------------------

@pytest.mark.parametrize("turn", [("--heading", 0), ("--pose", "40,10,-5")])
def test_below_the_camera_is_a_hole_with_alpha(tmp_path, turn):
    """The camera's own foot: the hole leans with it, and has the solid angle of a cap."""
    at = pose(0) if turn[0] == "--heading" else pose(40, 10, -5)
    U.write_exr(tmp_path / "p.exr", (1 + panorama(360, 180, at)) / 2)
    run("fishremap", "--from", "latlong", *turn, "--nadir", 30, *TO_PROBE, "-o", tmp_path / "o.exr", tmp_path / "p.exr")
    got, want, seen = probe_of(tmp_path / "o.exr")
    angle = np.degrees(np.arccos(np.clip(want @ -at[:, 2] / np.linalg.norm(want, axis=-1), -1, 1)))
    assert (seen[angle < 24] == 0).all() and (seen[angle > 36] == 1).all()
    assert np.abs(got - want)[seen > .3].max() < .1 and np.abs(got - want)[seen == 1].max() < .012
    omega = U.probe_solid_angle(64, 32, 180)[:, None]
    assert ((1 - seen) * omega).sum() == pytest.approx(2 * np.pi * (1 - np.cos(np.radians(30))), rel=.01)


def test_a_mask_smaller_than_the_picture(tmp_path):
    d = panorama(360, 180)
    U.write_exr(tmp_path / "p.exr", (1 + d) / 2)
    mask = np.full((45, 90, 3), 255, np.uint8)
    mask[20:25, 30:50] = 0
    Image.fromarray(mask).save(tmp_path / "m.png")
    Image.fromarray(np.kron(mask, np.ones((4, 4, 1), np.uint8))).save(tmp_path / "big.png")
    for name in ("m", "big"):
        run("fishremap", "--from", "latlong", "--heading", 0, "--mask", tmp_path / f"{name}.png", *TO_PROBE, "-o", tmp_path / f"{name}.exr", tmp_path / "p.exr")
    a, b = U.read_exr(tmp_path / "m.exr")[0], U.read_exr(tmp_path / "big.exr")[0]
    assert a.shape[2] == 4 and (a[..., 3] == 0).any() and np.array_equal(a, b)
    omega = U.probe_solid_angle(64, 32, 180)[:, None]
    assert ((1 - a[..., 3]) * omega).sum() == pytest.approx(np.radians(80) * 2 * np.sin(np.radians(10)), rel=.02)
    for shape in ((45, 91), (360, 720), (46, 90)):
        Image.fromarray(np.full((*shape, 3), 255, np.uint8)).save(tmp_path / "x.png")
        r = run("fishremap", "--from", "latlong", "--mask", tmp_path / "x.png", *TO_PROBE, "-o", tmp_path / "x.exr", tmp_path / "p.exr", code=1)
        one_line_error(r, "fishremap", "mask", "360 x 180")


# ---- panoramas that others made -------------------------------------------------------------------------------------

@pytest.mark.parametrize("name", ["uffizi_256x128.hdr", "vestibule_1k.hdr"])
def test_panoramas_of_others_keep_their_light_however_turned(tmp_path, name):
    """Irradiance on six faces, by numpy on the panorama as it is and on what comes out of it."""
    picture = shared_data("probes_latlong_hdr") / name
    run("fishremap", "--from", "latlong", "--to", "latlong", "--size", "256x128", "-o", tmp_path / "same.exr", picture)
    image = U.read_exr(tmp_path / "same.exr")[0]
    d = panorama(256, 128, pose(70, 15, -20))
    w = np.cos(np.radians(90 - (np.arange(128) + .5) * 180 / 128))[:, None]
    run("fishremap", "--from", "latlong", "--pose", "70,15,-20", "--polar-max", 180, "--size", "256x128", "-o", tmp_path / "o.exr", picture)
    got, q = U.read_exr(tmp_path / "o.exr")[0], U.probe(lambda a: a, 256, 128, 180, 2)
    omega = U.probe_solid_angle(256, 128, 180)[:, None]
    for face in (*np.eye(3), *-np.eye(3)):
        want = (image * (w * np.maximum(d @ face, 0) * 2 * np.pi / 256 * np.pi / 128)[..., None]).sum((0, 1))
        have = (got * (omega * np.maximum(q @ face, 0))[..., None]).sum((0, 1))
        assert np.allclose(have, want, rtol=4e-3), face
