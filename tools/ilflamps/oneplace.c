/*
 * oneplace.c - lamps of a light field of one probe: each bright spot's outline, seen from the probe, is laid on the
 * surface that its middle meets.
 *
 *        lamp ___c___  surface, normal m           a spot's directions d + g (g at right angles to d) meet the surface at
 *            \   |   /                             c + r (g - d (g.m)/(d.m)), so its second moment over directions gives
 *             \  |d /  r                           that over the surface, and this an ellipse or a rectangle:
 *              \ | /                               the mean of x^2 is a^2/4 over a disc, a^2/3 over a rectangle
 *                o probe
 */
#include "oneplace.h"

#include <stdlib.h>
#include <string.h>

#include "base/remark.h"
#include "blobs.h"
#include "vec.h"

#define SMALL   .002  /* of all spots' light: what is less stays in the field */
#define LOOKS   .5    /* misfit of a body's picture from which on the spot is left in the field */
#define GRAZING .12   /* cosine at which a surface is seen, below which a lamp faces the probe */
#define INWARDS 1e-3  /* of the distance: a lamp lies so far before its surface */
#define SAME    .9995 /* of the largest value: clipped, if there are many */
enum { MANY = 6 };

typedef struct surface {
    double at,
        normal[3]; /* distance along the spot's direction; field's coordinates, unit, towards the probe */
} surface;

static int surfaces(surface *s, const bloblist *list, const lightfield *f, const char *octree, errmsg *e)
{
    const ilf_frame *fr = &f->frame;
    double *rays = malloc(((size_t)list->n * 6 + 1) * sizeof *rays);
    float *got = malloc(((size_t)list->n * 4 + 1) * sizeof *got);
    int bad = rays && got ? 0 : err_set(e, "no memory for the surroundings");

    for (int i = 0; i < list->n && !bad; i++)
        for (int k = 0; k < 3; k++) {
            const double *o = f->pos[0], *d = list->b[i].dir;
            rays[6 * i + k] = fr->origin[k] + o[0] * fr->u[k] + o[1] * fr->v[k] + o[2] * fr->n[k];
            rays[6 * i + 3 + k] = d[0] * fr->u[k] + d[1] * fr->v[k] + d[2] * fr->n[k];
        }
    if (!bad && list->n) bad = surroundings_rtrace(got, 4, "-oLN", rays, list->n, octree, e);
    for (int i = 0; i < list->n && !bad; i++) {
        double n[3];
        for (int k = 0; k < 3; k++) n[k] = (double)got[4 * i + 1 + k];
        s[i].at = (double)got[4 * i];
        s[i].normal[0] = v_dot(n, fr->u), s[i].normal[1] = v_dot(n, fr->v), s[i].normal[2] = v_dot(n, fr->n);
        const double side = v_dot(s[i].normal, list->b[i].dir);
        for (int k = 0; k < 3; k++) s[i].normal[k] *= side > 0 ? -1 : 1;
        if (fabs(side) < GRAZING)
            for (int k = 0; k < 3; k++) s[i].normal[k] = -list->b[i].dir[k];
    }
    free(rays), free(got);
    return bad;
}

/* Second moment over the surface, along its axes x and y: xx, xy, yy. */
static void laid_out(double m[3], const blob *b, const surface *s, const double x[3], const double y[3])
{
    const double *S = b->spread, *d = b->dir, dm = v_dot(d, s->normal);
    double px[3], py[3];

    /* x . (g - d (g.m)/(d.m)) = px . g */
    for (int k = 0; k < 3; k++) {
        px[k] = x[k] - s->normal[k] * v_dot(x, d) / dm;
        py[k] = y[k] - s->normal[k] * v_dot(y, d) / dm;
    }
    const double full[3][3] = {{S[0], S[1], S[2]}, {S[1], S[3], S[4]}, {S[2], S[4], S[5]}};
    m[0] = m[1] = m[2] = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const double w = full[i][j] * s->at * s->at;
            m[0] += px[i] * w * px[j], m[1] += px[i] * w * py[j], m[2] += py[i] * w * py[j];
        }
}

/* A body of the shape with the spot's moments; no side is less than a third of a texel. */
static void lay(ilf_luminaire *l, ilf_shape kind, const blob *b, const surface *s, const lightfield *f)
{
    const double of = kind == ILF_RECTANGLE ? 3 : 4, least = s->at * patch_texel(f, b->dir) / 3;
    double x[3], y[3], m[3];

    memset(l, 0, sizeof *l);
    v_basis(x, y, s->normal);
    laid_out(m, b, s, x, y);
    const double turn = .5 * atan2(2 * m[1], m[0] - m[2]), half = hypot((m[0] - m[2]) / 2, m[1]),
                 mid = (m[0] + m[2]) / 2;
    const double a = fmax(least, sqrt(fmax(0, of * (mid + half)))),
                 c = fmax(least, sqrt(fmax(0, of * (mid - half))));
    l->shape = kind;
    for (int k = 0; k < 3; k++) {
        l->centre[k] = f->pos[0][k] + s->at * (b->dir[k] + INWARDS * s->normal[k]);
        l->a[k] = a * (cos(turn) * x[k] + sin(turn) * y[k]);
        l->b[k] = c * (cos(turn) * y[k] - sin(turn) * x[k]);
    }
}

/* Its radiance by the spot's light, and how little its picture looks like the spot: rms over the spot's rms. */
static int light_up(shape *s, const lightfield *f, double limit)
{
    double colour[3] = {0, 0, 0}, covered = 0, off = 0, all = 0;
    patch p;

    s->misfit = 1;
    if (patch_make(&p, f, 0, s->l.centre, ilf_luminaire_cone(&s->l, f->pos[0]), 1.5, limit)) return -1;
    patch_cover(&p, f, &s->l, 6);
    for (int i = 0; i < p.n; i++) {
        const float *t = lf_texel(f, 0, p.at[i] % f->nt, p.at[i] / f->nt);
        for (int c = 0; c < 3; c++) colour[c] += p.sr[i] * ((double)t[c] - p.ring[c]);
        covered += p.sr[i] * p.cover[i];
    }
    for (int c = 0; c < 3 && covered > 0; c++) s->l.rgb[c] = (float)fmax(0, p.ring[c] + colour[c] / covered);
    s->radiance = ilf_luminance(s->l.rgb);
    for (int i = 0; i < p.n; i++) {
        const double miss = p.lum[i] - p.cover[i] * (s->radiance - p.ring_lum);
        off += p.sr[i] * miss * miss, all += p.sr[i] * p.lum[i] * p.lum[i];
    }
    if (all > 0) s->misfit = sqrt(off / all);
    s->full = 1;
    patch_free(&p);
    return 0;
}

static int better_shape(shape *s, const blob *b, const surface *at, const lightfield *f, double limit)
{
    shape disc = {0};

    memset(s, 0, sizeof *s);
    lay(&s->l, ILF_RECTANGLE, b, at, f), lay(&disc.l, ILF_DISC, b, at, f);
    if (light_up(s, f, limit) || light_up(&disc, f, limit)) return -1;
    if (disc.misfit < s->misfit) *s = disc;
    return 0;
}

/* One spot: a lamp where it looks like one; where not, only whole spots are worth a word. */
static int one(analysis *a, const blob *b, const surface *at, const plan *p, double limit, int whole,
               errmsg *e)
{
    found *it = &a->lamps[a->n];

    memset(it, 0, sizeof *it);
    if (better_shape(&it->l.s, b, at, &a->f, limit)) return err_set(e, "no memory for a lamp's shape");
    memcpy(it->l.c.at, it->l.s.l.centre, sizeof it->l.c.at);
    it->l.c.seen = 1;
    it->fate = 2 * b->reach > 1.2 * p->max_width ? TOO_WIDE : it->l.s.misfit > LOOKS ? SHAPELESS : TAKEN;
    if (it->fate != TAKEN && !whole) return 0;
    if (lamp_measure(&it->l, &a->f, limit, e)) return -1;
    if (it->fate == TAKEN && it->l.width > p->max_width) it->fate = TOO_WIDE;
    a->n++;
    return it->fate == TAKEN ? lamp_take_out(&it->l, &a->f, limit, e) : 0;
}

static int brightest(const bloblist *l)
{
    int best = -1;

    for (int i = 0; i < l->n; i++)
        if (l->b[i].lamp == -1 && (best < 0 || l->b[i].flux > l->b[best].flux)) best = i;
    return best;
}

/* Texels of the largest value of a channel: of a lamp there are few, of a clipped one many. */
static void say_clipped(const lightfield *f)
{
    static const char *const NAMES[] = {"red", "green", "blue"};
    const int all = f->np * f->nt;

    for (int c = 0; c < 3; c++) {
        float most = 0;
        int n = 0;
        for (int k = 0; k < all; k++) most = fmaxf(most, f->rgb[3 * k + c]);
        for (int k = 0; k < all; k++) n += f->rgb[3 * k + c] >= (float)SAME * most;
        if (n >= MANY && n < all / 20)
            remark("the probe",
                   "%d texels share the largest value of %s (%.4g): if it is a photograph, it is clipped "
                   "there, and those "
                   "lamps are brighter than they look",
                   n, NAMES[c], (double)most);
    }
}

/* All spots of more than `over` times the median; those of less than `least` light are left. */
static int one_level(analysis *a, const plan *p, double over, double *least, errmsg *e)
{
    const int whole = *least <= 0;
    const double limit = over * blobs_typical(&a->f);
    bloblist list;
    double light = 0;

    if (blobs_find(&list, &a->f, over, e)) return -1;
    surface *s = malloc(((size_t)list.n + 1) * sizeof *s);
    int bad = s ? surfaces(s, &list, &a->f, p->octree, e) : err_set(e, "no memory for the surroundings");
    for (int i = 0; i < list.n; i++) light += list.b[i].flux;
    if (whole) *least = SMALL * light, a->spots = list.n;
    for (int k; !bad && a->n < p->most && (k = brightest(&list)) >= 0;) {
        list.b[k].lamp = -2;
        if (list.b[k].flux < *least) break;
        if (s[k].at > 0 && s[k].at < 1e6 * a->f.size) bad = one(a, &list.b[k], &s[k], p, limit, whole, e);
    }
    free(s), free(list.b);
    return bad;
}

int oneplace_lamps(analysis *a, const plan *p, errmsg *e)
{
    static const double LEVELS[] = {15, 60, 240};
    double least = 0;
    int taken = 0;

    say_clipped(&a->f);
    for (int k = 0; k < 3; k++)
        if (one_level(a, p, LEVELS[k], &least, e)) return -1;
    for (int i = 0; i < a->n; i++) taken += a->lamps[i].fate == TAKEN;
    a->stray = a->spots > taken ? a->spots - taken : 0;
    if (taken)
        remark("the probe",
               "one place can't tell how far away lamps are: %d lie on the surroundings, where their "
               "directions meet "
               "them",
               taken);
    return 0;
}
