"""Frames as packets that a sender passes on as they are: Art-Net (ArtDmx, 530 bytes) or sACN (ANSI E1.31, 638 bytes); man/ilfstage.1 has their bytes.

A file is frames one after another; a frame is one packet for each universe, in rising order.  Slots that no channel has are 0.
"""
import struct
import uuid

import numpy as np

from .errors import Bad

SLOTS = 512


def universes(channels):
    return sorted({c.slot[0] for c in channels})


def slots_of(channels, codes, tops):
    """{universe: bytes of 512 slots} of one frame.  codes, tops: (k,).  Above 8 bits a code is stretched to 16, coarse byte first."""
    out = {u: np.zeros(SLOTS, np.uint8) for u in universes(channels)}
    for c, code, top in zip(channels, codes, tops):
        data, at = out[c.slot[0]], c.slot[1] - 1
        if c.slots == 1:
            data[at] = code
        else:
            data[at:at + 2] = divmod(int(round(code * 65535 / top)), 256)
    return {u: d.tobytes() for u, d in out.items()}


def artnet(universe, number, data):
    """An ArtDmx packet.  Universes count from 1 here and from 0 there: net (7 bits), sub-net and universe (4 and 4)."""
    port = universe - 1
    return struct.pack("<8sH", b"Art-Net\0", 0x5000) + bytes([0, 14, 1 + number % 255, 0, port & 0xff, port >> 8]) + struct.pack(">H", SLOTS) + data


def sacn(universe, number, data):
    """An E1.31 data packet of priority 100."""
    root = struct.pack(">HH12sHI16s", 0x10, 0, b"ASC-E1.17\0\0\0", 0x7000 | 622, 4, uuid.uuid5(uuid.NAMESPACE_URL, "ilfstage").bytes)
    framing = struct.pack(">HI64sBHBBH", 0x7000 | 600, 2, b"ilfstage", 100, 0, number % 256, 0, universe)
    return root + framing + struct.pack(">HBBHHHB", 0x7000 | 523, 2, 0xa1, 0, 1, SLOTS + 1, 0) + data


def check(channels, protocol, path):
    most = {"artnet": 32768, "sacn": 63999}[protocol]
    if universes(channels)[-1] > most:
        raise Bad(f"{path}: expected universes up to {most}, found {universes(channels)[-1]}")


def write(f, channels, codes, tops, protocol):
    """All frames, codes (t, k), to an open file."""
    packet = {"artnet": artnet, "sacn": sacn}[protocol]
    for number, row in enumerate(codes):
        for universe, data in slots_of(channels, row, tops).items():
            f.write(packet(universe, number, data))
