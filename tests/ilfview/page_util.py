"""What a page of ilfview holds, decoded a second time: from the words in tools/ilfview/page.c and content.h, not by the page's script."""
import base64
import json
import re

import numpy as np
from ilf_util import ILF, KINDS, SHAPES, Lamp, Mask

PARTS = [("lamp_rows", lambda f: f["lamps"] * 24), ("mask_rows", lambda f: f["masks"] * 24), ("pictures", lambda f: f["pictures"]),
         ("irradiance", lambda f: 3 * np.prod(f["grid"])), ("lamp_light", lambda f: 3 * np.prod(f["light"]))]


def decode(path):
    """The light fields of a page: their facts, with arrays in their places."""
    text = path.read_text()
    facts = [json.loads(x) for x in re.findall(r'<script type="application/json" class="facts">(.*?)</script>', text, re.S)]
    numbers = re.findall(r'<script type="text/plain" class="numbers">(.*?)</script>', text, re.S)
    assert len(facts) == len(numbers)
    for f, code in zip(facts, numbers):
        data, at = base64.b64decode(code, validate=True), 0
        for name, count in PARTS:
            f[name] = np.frombuffer(data, "<f4", int(count(f)), at)
            at += 4 * len(f[name])
        (nu, nv), (nt, np_) = f["grid"], f["texels"]
        halves = np.frombuffer(data, "<f2", offset=at).astype(float) * 2.0 ** f["scale"]
        each = halves.reshape(nv, nu, nt * np_ + 2, 3)
        f["probes"], f["poles"] = each[:, :, :-2].reshape(nv, nu, np_, nt, 3), each[:, :, -2:]
        f["irradiance"] = f["irradiance"].reshape(nv, nu, 3)
        f["lamp_light"] = f["lamp_light"].reshape(*f["light"][::-1], 3)
    return facts


def mask_of(row, pictures):
    kind, n = KINDS[int(row[0])], [int(x) for x in (row[15], row[14], row[13])]
    grid = None
    if n[1]:
        shape = n if kind == "stack" else n[1:]
        grid = pictures[int(row[20]):][:np.prod(shape)].reshape(shape)
    return Mask(kind, grid, int(row[1]), int(row[2]), row[3], row[4:7], row[7:13], row[16:18], row[18:20] if n[1] else (1, 1))


def lamp_of(f, k):
    r = f["lamp_rows"].reshape(-1, 24)[k]
    masks = f["mask_rows"].reshape(-1, 24)[int(r[20]):][:int(r[15])]
    return Lamp(SHAPES[int(r[0])], r[2:5], r[12:15], r[5:8], r[8:11], r[11], r[1], [mask_of(m, f["pictures"]) for m in masks])


def as_ilf(f):
    """The light field as the page has it."""
    (lu, lv), u, v = f["size"], np.array(f["u"]), np.array(f["v"])
    return ILF(f["probes"], f["origin"], lu * u, lv * v, *f["polar"], lamps=[lamp_of(f, k) for k in range(f["lamps"])])
