/*
 * fewer.c - see fewer.h.
 *
 * A probe of the coarser grid is what the whole field shows from its place, by libilf's own lookup: between four probes,
 * each towards the point of the surroundings that a ray meets.  Then irradiance is compared at nodes that no coarse probe was made of, on the
 * plane (where the whole field is that node's own probe) and above it, up and to four sides:
 *
 *     whole grid    o . . o . . o      o  nodes beside coarse ones: what those are made of
 *     coarse grid   O     O     O      .  left out: where both are compared
 *
 * The error is that of what is left in the probes; the light that it is a share of has the lamps in it.
 */
#include "fewer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "base/outfile.h"
#include "vec.h"

enum {
    MOST_PLACES = 81,
    HEIGHTS = 3,
    SIDES = 5,
    ROWS = 40,
    COLUMNS = 160,
    RAYS = ROWS * COLUMNS,
    LAMP_RAYS = 64
};
static const double height[HEIGHTS] = {0, .1, .3}; /* of the longer edge */
static const double facing[SIDES][3] = {{0, 0, 1}, {1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}};
static const double pi = 3.14159265358979323846;

typedef double light[SIDES];

/* ---- lookups --------------------------------------------------------------------------------------- */

static void to_scene(double x[3], const ilf_frame *f, const double p[3], int point)
{
    for (int k = 0; k < 3; k++)
        x[k] = (point ? f->origin[k] : 0) + p[0] * f->u[k] + p[1] * f->v[k] + p[2] * f->n[k];
}

static ilf_status look(float rgb[3], const ilf *field, const analysis *a, const double o[3],
                       const double d[3], ilf_error *err)
{
    double so[3], sd[3], sh[3], h[3];

    to_scene(so, &a->f.frame, o, 1), to_scene(sd, &a->f.frame, d, 0);
    if (a->around.far) surroundings_meet(h, &a->around, o, d), to_scene(sh, &a->f.frame, h, 1);
    return ilf_eval(rgb, field, ilf_get_frame(field), so, sd, a->around.far ? sh : NULL, ILF_DEPTH, err);
}

/* A field as a temporary file that is open; *o is thrown away after it is closed. */
static ilf *as_file(outfile **o, const lightfield *f, ilf_type type, errmsg *e)
{
    ilf_spec spec = lf_spec(f);
    ilf_error err;
    ilf *field;

    spec.type = type, spec.compression = "none";
    if (out_begin(o, "-", e) || lf_write_as(f, out_path(*o), &spec, e)) return NULL;
    if (ilf_open(&field, out_path(*o), &err) == ILF_OK) return field;
    (void)err_set(e, "%s", err.text);
    return NULL;
}

/* ---- a coarser grid ---------------------------------------------------------------------------------- */

static int coarse_grid(lightfield *f, int **nearest, const lightfield *whole, int nu, int nv)
{
    const size_t texels = (size_t)whole->np * (size_t)whole->nt * 3, n = (size_t)nu * (size_t)nv;

    *f = *whole;
    f->nu = nu, f->nv = nv, f->n = nu * nv, f->turn = NULL;
    f->info.n_u = nu, f->info.n_v = nv;
    f->pos = malloc(n * sizeof *f->pos), f->rgb = malloc(n * texels * sizeof *f->rgb);
    *nearest = malloc(n * sizeof **nearest);
    if (!f->pos || !f->rgb || !*nearest) return -1;
    for (int k = 0; k < f->n; k++) {
        const double s = nu > 1 ? (double)(k % nu) / (nu - 1) : .5,
                     t = nv > 1 ? (double)(k / nu) / (nv - 1) : .5;
        f->pos[k][0] = s * f->len_u, f->pos[k][1] = t * f->len_v, f->pos[k][2] = 0;
        (*nearest)[k] = (int)lround(t * (whole->nv - 1)) * whole->nu + (int)lround(s * (whole->nu - 1));
    }
    return 0;
}

/* Directions below the plane are seen by nobody from above: what the nearest probe has there stays. */
static int fill_probe(lightfield *f, int k, int nearest, const ilf *whole, const analysis *a, errmsg *e)
{
    int bad = 0;

#pragma omp parallel for schedule(dynamic, 64)
    for (int t = 0; t < f->nt * f->np; t++) {
        float *to = lf_texel(f, k, t % f->nt, t / f->nt);
        double d[3];
        ilf_error err;
        lf_direction(d, f, LF_FIELD, t % f->nt + .5, t / f->nt + .5);
        if (d[2] <= 1e-6) memcpy(to, lf_texel(&a->f, nearest, t % f->nt, t / f->nt), 3 * sizeof *to);
        else if (look(to, whole, a, f->pos[k], d, &err) != ILF_OK) {
#pragma omp critical
            bad = err_set(e, "%s", err.text);
        }
    }
    return bad;
}

/* ---- what it is worth -------------------------------------------------------------------------------- */

static void add_lamps(light E, const analysis *a, const double o[3])
{
    for (int i = 0; i < a->n; i++) {
        const ilf_luminaire *l = &a->lamps[i].l.s.l;
        if (a->lamps[i].fate != TAKEN) continue;
        for (int k = 0; k < LAMP_RAYS; k++) {
            double d[3];
            const double pdf = ilf_luminaire_sample(d, l, o, (k % 8 + .5) / 8, (k / 8 + .5) / 8);
            if (pdf <= 0 || d[2] <= 0) continue;
            const double v = ilf_luminaire_pass(l, o, d) * ilf_luminance(l->rgb) / (pdf * LAMP_RAYS);
            for (int s = 0; s < SIDES; s++) E[s] += v * fmax(0, v_dot(d, facing[s]));
        }
    }
}

static ilf_status gather(light E, const ilf *field, const analysis *a, const double o[3], ilf_error *err)
{
    memset(E, 0, sizeof(light));
    for (int k = 0; k < RAYS; k++) {
        const double p = (k / COLUMNS + .5) / ROWS * pi / 2, t = (k % COLUMNS + .5) / COLUMNS * 2 * pi;
        const double d[3] = {sin(p) * cos(t), sin(p) * sin(t), cos(p)},
                     sr = sin(p) * pi / 2 / ROWS * 2 * pi / COLUMNS;
        float rgb[3];
        const ilf_status st = look(rgb, field, a, o, d, err);
        if (st != ILF_OK) return st;
        for (int s = 0; s < SIDES; s++) E[s] += ilf_luminance(rgb) * sr * fmax(0, v_dot(d, facing[s]));
    }
    return ILF_OK;
}

/* Is node i of n beside one of the coarse grid's m? */
static int beside(int i, int n, int m)
{
    for (int c = 0; c < m; c++)
        if (fabs(i - (m > 1 ? (double)c / (m - 1) : .5) * (n - 1)) < 1 - 1e-9) return 1;
    return 0;
}

static int divisor(int a, int b)
{
    return b ? divisor(b, a % b) : a;
}

/* Nodes that no coarse probe is made of, MOST_PLACES of them at most, spread over the grid: all of them stand in `all`, in order.  Returns
 * their number. */
static int left_out(int node[MOST_PLACES], int *all, const lightfield *whole, int nu, int nv)
{
    int n = 0;

    for (int q = 0; q < whole->n; q++)
        if (!beside(q % whole->nu, whole->nu, nu) || !beside(q / whole->nu, whole->nv, nv)) all[n++] = q;
    /* steps of the golden section are spread evenly, however many are taken; without a common divisor none comes twice */
    int step = (int)(.6180339887498949 * n) + 1;
    while (n > 1 && divisor(n, step) != 1) step++;
    const int some = n < MOST_PLACES ? n : MOST_PLACES;
    for (int k = 0; k < some; k++) node[k] = all[(int)((long)k * step % n)];
    return some;
}

static void judge(fewer *w, light (*by)[2], const light *lamps, int n)
{
    double mean[2] = {0, 0}, sum = 0;

    for (int k = 0; k < n; k++)
        for (int s = 0; s < SIDES; s++)
            mean[s > 0] += (by[k][0][s] + lamps[k][s]) / (n * (s > 0 ? SIDES - 1 : 1));
    w->worst = 0;
    for (int k = 0; k < n; k++)
        for (int s = 0; s < SIDES; s++) {
            const double off = mean[s > 0] > 0 ? fabs(by[k][1][s] - by[k][0][s]) / mean[s > 0] : 0;
            sum += off * off, w->worst = fmax(w->worst, off);
        }
    w->rms = n ? sqrt(sum / (n * SIDES)) : 0;
}

static int compare(fewer *w, const ilf *whole, const ilf *coarse, const analysis *a, errmsg *e)
{
    int node[MOST_PLACES], bad = 0, *all = malloc((size_t)a->f.n * sizeof *all);
    light by[MOST_PLACES * HEIGHTS][2], lamps[MOST_PLACES * HEIGHTS];

    if (!all) return err_set(e, "no memory for %d nodes", a->f.n);
    w->places = left_out(node, all, &a->f, w->f.nu, w->f.nv);
    free(all);
#pragma omp parallel for schedule(dynamic, 1)
    for (int k = 0; k < w->places * HEIGHTS; k++) {
        const double *q = a->f.pos[node[k / HEIGHTS]], o[3] = {q[0], q[1], height[k % HEIGHTS] * a->f.size};
        ilf_error err;
        memset(lamps[k], 0, sizeof lamps[k]);
        add_lamps(lamps[k], a, o);
        if (gather(by[k][0], whole, a, o, &err) != ILF_OK || gather(by[k][1], coarse, a, o, &err) != ILF_OK) {
#pragma omp critical
            bad = err_set(e, "%s", err.text);
        }
    }
    if (!bad) judge(w, by, lamps, w->places * HEIGHTS);
    return bad;
}

/* ---- the choice -------------------------------------------------------------------------------------- */

static int try_grid(fewer *w, const ilf *whole, const analysis *a, int nu, int nv, ilf_type type, errmsg *e)
{
    outfile *o = NULL;
    ilf *coarse = NULL;
    int bad = 0;

    fewer_free(w);
    if (coarse_grid(&w->f, &w->nearest, &a->f, nu, nv)) return err_set(e, "no memory for a coarser grid");
    for (int k = 0; k < w->f.n && !bad; k++) bad = fill_probe(&w->f, k, w->nearest[k], whole, a, e);
    if (!bad && !(coarse = as_file(&o, &w->f, type, e))) bad = -1;
    if (!bad) bad = compare(w, whole, coarse, a, e);
    ilf_close(coarse);
    if (o) out_abort(o);
    return bad;
}

/* Sides of the grid whose longer one has m probes, in the whole one's proportion. */
static int side(int n, int longer, int m)
{
    if (n == 1) return 1;
    const int k = 1 + (int)lround((double)(n - 1) * (m - 1) / (longer - 1));
    return k < 2 ? 2 : k;
}

/* The grid that was tried last was too coarse. */
static void keep_last(fewer *w)
{
    if (!w->places) return;
    w->less_u = w->f.nu, w->less_v = w->f.nv, w->less_worst = w->worst;
}

static int search(fewer *w, const ilf *whole, const analysis *a, const fewplan *p, ilf_type type, errmsg *e)
{
    const int nu = a->f.nu, nv = a->f.nv, longer = nu > nv ? nu : nv;

    for (int m = 2; m < longer - 1; m += 1 + m / 8) {
        const int ku = side(nu, longer, m), kv = side(nv, longer, m);
        keep_last(w);
        if (try_grid(w, whole, a, ku, kv, type, e)) return -1;
        if (w->places == 0) break;
        if (w->worst <= p->error) return 0;
    }
    keep_last(w);
    fewer_free(w);
    w->same = 1;
    return 0;
}

int fewer_find(fewer *w, const analysis *a, const fewplan *p, errmsg *e)
{
    const size_t n = (size_t)a->f.n * (size_t)a->f.np * (size_t)a->f.nt * 3;
    ilf_type type = ILF_HALF;
    outfile *o = NULL;

    memset(w, 0, sizeof *w);
    for (size_t k = 0; k < n && type == ILF_HALF; k++)
        if (fabsf(a->f.rgb[k]) > 65504.f) type = ILF_FLOAT;
    ilf *whole = as_file(&o, &a->f, type, e);
    int bad = whole ? 0 : -1;
    if (!bad) bad = p->nu ? try_grid(w, whole, a, p->nu, p->nv, type, e) : search(w, whole, a, p, type, e);
    ilf_close(whole);
    if (o) out_abort(o);
    return bad;
}

void fewer_say(const fewer *w, const fewplan *p, const lightfield *whole, const char *path)
{
    const double up[2] = {height[1] * whole->size, height[2] * whole->size};

    if (w->same && w->less_u)
        cli_note(
            "%s: all %dx%d probes stay: by %dx%d irradiance would be off by up to %.2g %%, more than %.2g %%",
            path, whole->nu, whole->nv, w->less_u, w->less_v, 100 * w->less_worst, 100 * p->error);
    else if (w->same)
        cli_note("%s: all %dx%d probes stay: too few to leave some out", path, whole->nu, whole->nv);
    else if (w->places == 0)
        cli_note("%s: %dx%d of %dx%d probes; none was left out to tell how far off they are", path, w->f.nu,
                 w->f.nv, whole->nu, whole->nv);
    else {
        cli_note("%s: %dx%d probes for %dx%d: irradiance off by %.2g %% (rms), at worst %.2g %%, at %d nodes "
                 "that were left out, "
                 "0, %.3g and %.3g above them, upwards and to four sides",
                 path, w->f.nu, w->f.nv, whole->nu, whole->nv, 100 * w->rms, 100 * w->worst, w->places, up[0],
                 up[1]);
        if (w->less_u)
            cli_note("%s: %dx%d would be off by up to %.2g %%", path, w->less_u, w->less_v,
                     100 * w->less_worst);
    }
}

void fewer_free(fewer *w)
{
    free(w->f.pos), free(w->f.rgb), free(w->nearest);
    memset(&w->f, 0, sizeof w->f);
    w->nearest = NULL;
}
