"""Rooms of one kind each, many of every kind: KIND:SEED where rooms.py and table.py take a room.

Lamps and what hides them are moved, turned and sized by chance about one plan; a kind is what the lamps meet.  Version 1 is wrong by
1 to 25 % in most of them.
"""
import numpy as np
from rooms import GREY, R, Room, ball, between, card, lamp, leaves, panel, tilted, turned, twigs, unit

COLOURS = (10000, 8000, 5000), (4000, 6000, 12000), (8000, 8000, 8000)
CORNERS = (1.4, .6, 2.45), (-1.15, -1.7, 2.25), (-.4, 1.8, 2.35)


def lamps(rng, n, dim=1., **more):
    turn = np.radians(rng.uniform(0, 360))
    out = []
    for k in range(n):
        x, y, z = np.array(CORNERS[k]) + rng.uniform(-.25, .25, 3) * (1, 1, .6)
        c = (x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z)
        out.append(lamp(c, rng.uniform(.045, .06), np.array(COLOURS[k]) * dim, **{m: v(c) for m, v in more.items()}))
    return out


def box(rng, bodies, **more): return Room(bodies, lo=(-3, -3, -.001), hi=(3, 3, 3), bright=rng.uniform(.5, .9), phase=rng.uniform(0, 6), **more)
def spot_in(rng): return rng.uniform(-.25, .25, 2)


def before(rng, l, z, tilt=0., col=GREY, shadow=(.35, .95), **more):
    "a card in front of a lamp, whose shadow (half as wide as given, metres) has an edge on the plane"
    size = rng.uniform(*shadow, 2) * (1 - z / l["c"][2]); a = rng.uniform(0, 2 * np.pi)
    foot = np.array([np.cos(a), np.sin(a)]) * rng.uniform(.35, .85)
    return tilted(l["c"], foot, z, *size, tilt, rng.uniform(0, 360), rng.uniform(0, 90), col, **more)


def plaincard(rng): l = lamps(rng, 2); return box(rng, l + [before(rng, l[1], rng.uniform(1.1, 1.4))])
def tiltedcard(rng): l = lamps(rng, 2); return box(rng, l + [before(rng, l[0], rng.uniform(.9, 1.3), rng.uniform(12, 25))])


def checkcard(rng):
    l = lamps(rng, 2)
    return box(rng, l + [before(rng, l[1], rng.uniform(1.1, 1.4), rng.uniform(8, 18), amp=.5, cell=rng.uniform(.08, .15))], amp=.3, cell=.5)


def three(rng):
    l = lamps(rng, 3)
    return box(rng, l + [ball(between(l[0]["c"], spot_in(rng), rng.uniform(1, 1.3)), rng.uniform(.14, .2), (.35, .25, .2)),
                         before(rng, l[1], rng.uniform(.8, 1), shadow=(.15, .35)), before(rng, l[2], rng.uniform(1.1, 1.4), rng.uniform(0, 12))])


def twigroom(rng): return box(rng, lamps(rng, 2) + twigs(rng, 90, z=(.37, .56), wide=1.3))


def leafroom(rng):
    return box(rng, lamps(rng, 2) + leaves(rng, int(rng.integers(40, 90)), z=(rng.uniform(.35, .6), rng.uniform(.7, 1.))))


def panelroom(rng):
    c, (u, v) = np.r_[rng.uniform(-.9, .9, 2), rng.uniform(2.3, 2.7)], turned(0, 0, rng.choice([0, rng.uniform(0, 90)]))
    p = panel(c, u * rng.uniform(.15, .22), v * rng.uniform(.15, .22), rng.uniform(600, 1500) * np.array([1, .95, .9]))
    return box(rng, [p, before(rng, p, rng.uniform(1, 1.3), shadow=(.4, .9))])


def window(rng):
    y, n = rng.uniform(-.4, .4), int(rng.integers(2, 5))
    b = [panel((2.95, y, 1.6), (0, rng.uniform(.6, .75), 0), (0, 0, rng.uniform(.45, .6)), (60, 70, 90))]
    b += [card((2.8, y + q, 1.6), (0, .02, 0), (0, 0, .65), (.1, .1, .1)) for q in np.linspace(-.6, .6, n)]
    return box(rng, b + lamps(rng, 1))


def beams(rng):
    aim = lambda c: unit(np.r_[rng.uniform(-.4, .4, 2), 0] - c)
    return box(rng, lamps(rng, 2, axis=aim, k=lambda c: rng.uniform(8, 60)))


def spot(rng, focus, soft):
    c = np.r_[rng.uniform(-.9, .9, 2), 2.6]; f = rng.uniform(*focus); r = rng.uniform(.35, .5); g = between(c, rng.uniform(-.2, .2, 2), f)
    u, v = turned(0, 0, rng.choice([0, rng.uniform(0, 90)]))
    return box(rng, [panel(c, .17 * u, .17 * v, (9000, 9000, 9000), gate=1, focus=f, gx=g[0], gy=g[1], gr=r * (1 - f / 2.6), soft=rng.uniform(*soft))])


def dim(rng): l = lamps(rng, 2, dim=.004); return box(rng, l + [before(rng, l[1], rng.uniform(1.1, 1.4))])


KINDS = dict(plaincard=plaincard, tiltedcard=tiltedcard, checkcard=checkcard, three=three, twigroom=twigroom, leafroom=leafroom, panelroom=panelroom,
             windows=window, beam=beams, sharpspot=lambda r: spot(r, (0, 0), (.002, .01)), softspot=lambda r: spot(r, (-.8, -.4), (.08, .15)),
             midspot=lambda r: spot(r, (.4, .7), (.02, .06)), dimmed=dim)


def room(kind, seed): return KINDS[kind](R([seed, sorted(KINDS).index(kind)]))
