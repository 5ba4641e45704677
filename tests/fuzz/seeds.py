"""The seeds of the fuzz corpus: one small good file of each kind and shape, and some that were bad.

    python tests/fuzz/seeds.py        writes tests/fuzz/corpus/TARGET/seed-*; inputs that a run found stay beside them
"""
import struct
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import ilf_util as iu  # noqa: E402


def ilf_files():
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as d:
        path = Path(d) / "a.exr"
        for k, (comp, half, shape, polar) in enumerate([
                ("none", True, (2, 2, 4, 3), "hemisphere"), ("none", False, (1, 2, 3, 2), "185deg"), ("zip", True, (2, 2, 4, 3), "sphere"),
                ("zips", False, (1, 1, 1, 1), "hemisphere"), ("rle", True, (2, 1, 8, 4), "hemisphere"), ("piz", True, (2, 2, 4, 3), "hemisphere"),
                ("pxr24", False, (2, 2, 4, 3), "hemisphere"), ("b44", True, (2, 1, 4, 4), "hemisphere"), ("dwaa", True, (1, 1, 8, 8), "hemisphere")]):
            f = iu.random_ilf(rng, *shape, kind=polar, half=half, polar_valid=1.2 if k == 1 else None,
                              plane=((0, 0, 0), (1, 0, 0), (0, 2, 0)))
            iu.write_ilf(path, f, half=half, compression=comp)
            yield f"{comp}-{k}", path.read_bytes()
        for k, half in ((9, True), (10, False)):
            f = iu.random_ilf(rng, 2, 2, 4, 3, half=half, plane=((0, 0, 0), (1, 0, 0), (0, 2, 0)))
            iu.write_ilf(path, f, half=half, parts=[interleaved(f, half)])
            yield f"interleaved-{k}", path.read_bytes()
        for k, f in enumerate(lit_fields(rng)):
            iu.write_ilf(path, f, half=k == 1, compression="zip" if k == 2 else "none")
            yield f"lamps-{k + 11}", path.read_bytes()


def lit_fields(rng):
    """Every shape, every kind of mask."""
    small = dict(at=(-1, -1), step=(1, 1.5))
    grid = rng.uniform(0, 1, (2, 2, 3)).astype(np.float16)
    masks = [iu.Mask("layer", grid[0], link=1, plane=(1, .1, -.1), **small), iu.Mask("foot", grid[1].astype(np.float32), beta=.5, adds=1, **small),
             iu.Mask("gate", beta=.3, coef=(1, 0, .2, -1, 0, -1)), iu.Mask("beam", coef=(0, 0, -1, 4, 1)),
             iu.Mask("stack", grid, plane=(.5, 1.5), coef=(.5, .1), **small), iu.Mask("ball", coef=(0, .5, 1, .2))]
    bodies = [dict(shape="sphere", radius=.2), dict(shape="rectangle", a=(.2, 0, 0), b=(0, .3, 0)), dict(shape="disc", a=(.2, 0, 0), b=(0, .1, .1)),
              dict(shape="tube", a=(.3, .1, 0), radius=.1, far=1)]
    for chosen, seen in (((0, 1, 2), None), ((3, 4, 5), np.ones((1, 2))), ((), np.ones((1, 2)))):
        f = iu.random_ilf(rng, 2, 1, 2, 2, half=True, plane=((0, 0, 0), (1, 0, 0), (0, 2, 0)))
        f.lamps = [iu.Lamp(c=(k - 1, .5, 2), rgb=(9, 8, 7), masks=[masks[m] for m in chosen] if k == 1 else [], seen=seen, **b) for k, b in enumerate(bodies)]
        yield f


def interleaved(f, half):
    import OpenEXR
    tiles = OpenEXR.TileDescription()
    tiles.xSize, tiles.ySize = 3 * f.n_theta, f.n_phi
    image = f.mosaic().astype(np.float16 if half else np.float32)
    window = np.zeros(2, np.int32), np.array([image.shape[1] - 1, image.shape[0] - 1], np.int32)
    header = {"type": OpenEXR.tiledimage, "tiles": tiles, "compression": OpenEXR.NO_COMPRESSION, "displayWindow": window, "ilf:interleaved": 1}
    return OpenEXR.Part(header, {"RGB": image.reshape(image.shape[0], -1).copy()}, "interleaved")


def exr_pictures():
    import OpenEXR
    rng = np.random.default_rng(2)
    with tempfile.TemporaryDirectory() as d:
        path = Path(d) / "a.exr"
        for k, (comp, kind, names) in enumerate([("NO", np.float16, "RGB"), ("ZIP", np.float32, "RGBA"), ("PIZ", np.float16, "Y"),
                                                 ("RLE", np.float32, "YA"), ("ZIPS", np.uint32, "RGB")]):
            channels = {c: rng.uniform(0, 9, (5, 7)).astype(kind) for c in names}
            OpenEXR.File({"compression": getattr(OpenEXR, comp + "_COMPRESSION"), "type": OpenEXR.scanlineimage}, channels).write(str(path))
            yield f"{comp.lower()}-{k}", path.read_bytes()


def hdr_pictures():
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2.5\n\n"
    flat = bytes(range(1, 49))
    yield "flat", head + b"-Y 3 +X 4\n" + flat
    yield "order", head + b"+X 3 +Y 4\n" + flat
    yield "old", head + b"-Y 1 +X 9\n" + bytes([9, 8, 7, 130, 1, 1, 1, 8])
    yield "old-long", head + b"-Y 1 +X 9\n" + bytes([9, 8, 7, 130, 1, 1, 1, 255, 1, 1, 1, 255, 1, 1, 1, 255])
    yield "xyze", b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\nCOLORCORR=1 2 3\n\n-Y 1 +X 3\n" + bytes(range(2, 14))
    line = bytes([2, 2, 0, 9]) + bytes([128 + 9, 5]) + bytes([4, 1, 2, 3, 4, 128 + 5, 6]) + bytes([9, *range(9)]) + bytes([128 + 9, 129])
    yield "new", head + b"-Y 2 +X 9\n" + line + line
    yield "huge", head + b"-Y 99999999 +X 99999999\n"
    yield "cut", head + b"-Y 2 +X 9\n" + line[:9]


def pnm_pictures():
    yield "p2", b"P2\n# a comment\n2 2\n255\n0 1 2 255\n"
    yield "p3", b"P3 2 1 1023 0 1 2 3 4 1023\n"
    yield "p5", b"P5\n3 2\n255\n" + bytes(range(6))
    yield "p6", b"P6\n2 1\n65535\n" + bytes(range(12))
    yield "pf", b"Pf\n2 2\n-1.0\n" + struct.pack("<4f", 1, 2, 3, 4)
    yield "PF", b"PF\n1 1\n1.0\n" + struct.pack(">3f", 1, 2, 3)
    yield "huge", b"P6\n999999999 999999999\n255\n"


RESPONSES = {
    "own": "hdrgen-response 1\n# a comment\nchannels 3\nmax_code 255\n0 0 0 0\n1 .001 .002 .001\n128 .3 .3 .31\n255 1 1 1\n",
    "grey": "hdrgen-response 1\nchannels 1\nmax_code 4095\n1 1e-6\n4095 1\n",
    "poly": "3 .5 .3 .2 0\n", "poly3": "2 .5 .5 0\n2 .4 .6 0\n1 1 0\n", "flat": "1 0 0\n", "falls": "2 -1 1 0\n", "steep": "3 1e308 1e308 1e308 1\n",
    "near": "hdrgen-response 1\nchannels 1\nmax_code 255\n1 1\n1.0000000000000002 1.0000000000000002\n",
}
FALLOFFS = {
    "text": "# falloff\n0 1 1 1\n30 .95 .94 .93\n60 .8 .8 .79\n92.5 .5 .5 .49\n", "poly": "polynomial rn 1 0 -.2 0 -.1\n",
    "poly3": "polynomial deg 1 0 -1e-5\npolynomial deg 1 0 -2e-5\npolynomial rad 1 -.1\n",
    "json": '{"about": "text", "f5.6": {"2": -0.1755, "4": -0.0286}, "f4": {"0": 1, "2": -0.1}}', "zero": "0 1 1 1\n90 0 0 0\n",
    "rise": "0 1 1 1\n45 1.5 1.5 1.5\n90 .5 .5 .5\n", "nest": '{"f4": {"2": {"4": 1}}}', "column": "0 1\n45 .8\n90 .5\n",
}
LENSES = {
    "model": "model equisolid\nfov 185\n", "poly": "polynomial 1 0 -.05\nfov 180\n", "kb": "kannala-brandt -.01 .002 0 0\ncamera 500 500 320 240\nfov 170\n",
    "table": "table\n0 0\n30 .35\n60 .68\n92.5 1\nfov 185\n", "ortho": "model orthographic\nfov 200\n", "turns": "polynomial 1 -1\nfov 180\n",
    "tiny": "table\n1e-9 1e-300\n90 1e300\nfov 180\n",
}
TIMES = {"plain": "a.png 1/60\nb\\ c.png 0.5\nc.png 2\n", "quoted": '# times\na.png 0.25 remark\n"in/b c.png" 1/8\nc.png 1e-3\n',
         "twice": "a.png 1\na.png 2\n", "odd": "a.png 1/0\nc.png nan\n", "tiny": 'a.png 1e-320\n"b c.png" 1e300\nc.png 1\n'}
CURVES = {"fall": FALLOFFS["text"], "two": FALLOFFS["column"], "resp": RESPONSES["own"], "grey": RESPONSES["grey"]}
SESSION = """[grid]
nodes = 3x2
plane = 0 0 0  0.2 0 0  0 0.1 0
order = raster
[stage]
driver = c4
port = /dev/null
unit_mm = 1000
origin = -500 -400
axes = -x y
feed = 6000
settle = 0.05
backlash = 1 -1
travel = -900 0 -900 0
steps_per_mm = 80 80
[camera]
command = "my camera" --time {seconds} {x} {y} {i:02} {label}
  {file}
shell = no
labels = 'a b' c
exposures = 0.25 1
timeout = 10
[output]
folder = out
file = {i:03}_{j:03}/{k:02}.ppm
times = {i}_{j}.txt
"""
SESSIONS = {"full": SESSION, "range": SESSION.replace("0.25 1", "from 1/1024 to 2 step 1").replace("labels = 'a b' c\n", "").replace("{label}", ""),
            "auto": SESSION.replace("exposures = 0.25 1", "exposures = 1/60 1/30\nadaptive = yes"), "dots": SESSION.replace("{i:03}_", "../{i}")}
BANNER = "\r\nGrbl 1.1f ['$' for help]\r\n"
STATUS = "<Idle|MPos:-30.500,-40.250,0.000|Bf:15,128|FS:0,0|WCO:0.000,0.000,0.000>\r\n"
ANSWERS = "[VER:1.1f.20170801:]\r\n[OPT:V,15,128]\r\nok\r\n$10=1\r\n$13=0\r\n$20=1\r\n$22=1\r\n$100=250\r\n$101=250\r\n$130=200\r\n$131=200\r\nok\r\n"
TALKS = {"good": b"\x7e" + (BANNER + ANSWERS + STATUS + "ok\r\nok\r\nok\r\n" + 4 * STATUS + BANNER + STATUS).encode(),
         "home": b"\xfe" + (BANNER + ANSWERS + STATUS + "ok\r\nok\r\n" + STATUS + "ok\r\nok\r\nok\r\n" + 4 * STATUS).encode(),
         "asleep": b"\x04" + b"\xff" + (STATUS + BANNER + ANSWERS.replace("$13=0", "$13=1") + STATUS + "error:9\r\nALARM:1\r\n").encode(),
         "old": b"\x7e\r\nGrbl 0.9j ['$' for help]\r\n", "hal": b"\x7e" + ("GrblHAL 1.1f ['$' or '$HELP' for help]\r\n" + ANSWERS + STATUS).encode(),
         "c4": b"\xffC4 rev 1" + 8 * b"\xffao", "noise": b"\x00\x80\x01<Idle|MPos:1,nan>\r\n<Hold:0|WPos:1e999,2>\r\n>G21:ok\r\nerror:-1\r\n$100=inf\r\n"}
DIGEST = "0123456789abcdef" * 4
RECORDS = (f"run 1700000000\nsteps 250 250\nbegin 0 0\narrived 0 0 -500.000000 -400.000000\nshot 0 0 0 123 456 {DIGEST} 0.5 0.25 .tmp.Ab12 0_0_0.ppm\n"
           f"shot 0 0 1 123 456 {DIGEST} 0 0 .tmp.Cd34 0_0_1.ppm\ndone 0 0\nbegin 2 1\n")
JOURNALS = {"good": b"1" + RECORDS.encode(), "torn": b"1" + RECORDS[:-20].encode(), "raw": b"0stagectl-journal 1\n", "far": b"1begin 9 9\n",
            "nan": b"1steps nan inf\narrived 0 0 nan 1\n", "other": b"1plan grid.nodes 4x4\n", "minus": f"1shot 0 0 -1 -5 0 {DIGEST} nan 0 ../x y\n".encode()}
RAYS = {"plain": "0 0 1 0 0 1 .5 .5 1\n0 0 0 1 0 1e-12 inf inf inf\n", "few": "1 2 3\n\n", "odd": "nan 0 0 0 0 1 0 0 0\n1e308 -1e308 0 1e-320 0 1e308 1e308 0 -1e308\n",
        "hex": "0x1p-1074 0 0 0x1p1023 0 1 0 0 0\n", "below": "0 0 0 0 0 -1 0 0 0\n1 1 0 1 1 1e-300 1 1 0\n"}


def main():
    sets = {"ilf": dict(ilf_files()), "exr": {**dict(exr_pictures()), "light-field": next(ilf_files())[1]}, "hdr": dict(hdr_pictures()),
            "pnm": dict(pnm_pictures()), "response": RESPONSES, "falloff": FALLOFFS, "lens": LENSES, "times": TIMES, "curve": CURVES,
            "session": SESSIONS, "grbl": TALKS, "journal": JOURNALS, "rays": RAYS}
    for target, files in sets.items():
        folder = HERE / "corpus" / target
        folder.mkdir(parents=True, exist_ok=True)
        for name, data in files.items():
            (folder / f"seed-{name}").write_bytes(data if isinstance(data, bytes) else data.encode())


main()
