/*
 * card.c - a rectangle anywhere in space, nine numbers: fitted to what the lamp's rows measured (they place
 * the edges whose shadow falls on the probes, and their height by how soft it is) and to what the pictures
 * say about its edges (outline.h; they place all of them) at once.
 */
#include "card.h"

#include <stdlib.h>
#include <string.h>

#include "lm.h"
#include "rowfit.h"
#include "vec.h"

enum { NUMBERS = 9, PER_EDGE = 20, POINTS = 4 * PER_EDGE, ROUNDS = 4, FINE = 112 };
#define ROW_NOISE .02 /* of a probe's share */
#define EDGE      .3  /* texels: how well a point of an edge is known from all pictures */
#define DOUBTED   .5  /* texels: a picture that says so much else counts half */
#define SQUARE    .02 /* cosine of the angle between the edges, rms */
#define STEEPEST  .45 /* z of the normal, least */
#define ABOVE     .45 /* sizes of the plane beyond its edges that the mask must cover */

/* p: centre, half edges u and v */
typedef struct job {
    rowfit fit;
    double soft; /* of rows (rowfit_softness) */
    outline o;   /* points on the edges of the rectangle that the pictures were asked about */
    saying *says;
    double *trust; /* per saying: square root of its weight */
    int n;
} job;

static int normal_of(double n[3], const double *p)
{
    v_cross(n, p + 3, p + 6);
    v_unit(n);
    if (n[2] < 0)
        for (int c = 0; c < 3; c++) n[c] = -n[c];
    return n[2] > STEEPEST;
}

static double logistic(double x)
{
    return 1 / (1 + exp(-x));
}

/* What a ray passes, the edges being soft. */
static double pass(const double *p, const double n[3], const double o[3], const double d[3], double soft)
{
    double e[3], x[3];
    const double uu = v_dot(p + 3, p + 3), vv = v_dot(p + 6, p + 6), down = v_dot(d, n);

    v_sub(e, p, o);
    const double t = v_dot(e, n) / down;
    if (!(t > 0)) return 1;
    for (int c = 0; c < 3; c++) x[c] = t * d[c] - e[c];
    const double s = v_dot(x, p + 3) / uu, q = v_dot(x, p + 6) / vv;
    return 1 - logistic((1 - fabs(s)) * sqrt(uu) / soft) * logistic((1 - fabs(q)) * sqrt(vv) / soft);
}

static void of_rows(double *r, const double *p, const double n[3], const job *j)
{
    const lamp *l = j->fit.l;
    const double soft = j->soft * fmin(1, fmax(.02, p[2] / l->s.l.centre[2]));

    for (int k = 0; k < l->nrows; k++) {
        const row *w = &l->rows[k];
        double sum = 0;
        r[k] = 0;
        if (fold_of(j->fit.f, w->probe) == j->fit.fold) continue;
        for (int q = 0; q < w->n; q++)
            sum += j->fit.base[k * ROW_SAMPLES + q] * pass(p, n, j->fit.f->pos[w->probe], w->dir[q], soft);
        r[k] = sqrt(w->share) * (sum / w->n - w->value) / ROW_NOISE;
    }
}

/* Corner k of four, in turn. */
static void corner(double x[3], const double *p, int k)
{
    const double a = k == 0 || k == 3 ? 1 : -1, b = k < 2 ? 1 : -1;

    for (int c = 0; c < 3; c++) x[c] = p[c] + a * p[3 + c] + b * p[6 + c];
}

/* How far along its normal each point lies from the edge that it was on, now. */
static void moved(double *e, const double *p, const outline *o)
{
    for (int k = 0; k < POINTS; k++) {
        double a[3], b[3];
        corner(a, p, k / PER_EDGE), corner(b, p, (k / PER_EDGE + 1) % 4);
        const double nx = b[1] - a[1], ny = a[0] - b[0], along = o->normal[k][0] * nx + o->normal[k][1] * ny;
        e[k] =
            ((a[0] - o->at[k][0]) * nx + (a[1] - o->at[k][1]) * ny) / (fabs(along) > 1e-12 ? along : 1e-12);
    }
}

static double height_at(const double *p, const double n[3], const double x[2])
{
    return p[2] - (n[0] * (x[0] - p[0]) + n[1] * (x[1] - p[1])) / n[2];
}

static void of_pictures(double *r, const double *p, const double n[3], const job *j)
{
    double e[POINTS], rise[POINTS];

    moved(e, p, &j->o);
    for (int k = 0; k < POINTS; k++) {
        const double *x = j->o.at[k], *w = j->o.plane;
        rise[k] = height_at(p, n, x) - (w[0] + w[1] * x[0] + w[2] * x[1]);
    }
    for (int i = 0; i < j->n; i++) {
        const saying *s = &j->says[i];
        r[i] = j->trust[i] * (e[s->point] + s->lean[0] * rise[s->point] - s->off);
    }
}

static void residuals(double *r, const double *p, void *context)
{
    const job *j = context;
    double n[3];
    const int steep = !normal_of(n, p);

    of_rows(r, p, n, j);
    r += j->fit.l->nrows;
    of_pictures(r, p, n, j);
    r += j->n;
    r[0] = v_dot(p + 3, p + 6) / (v_len(p + 3) * v_len(p + 6)) / SQUARE;
    r[1] = steep ? 1e6 : 0;
}

/* Points along the edges, where the pictures are to be asked. */
static void edges(outline *o, const double *p)
{
    double n[3];

    normal_of(n, p);
    o->plane[0] = p[2] + (n[0] * p[0] + n[1] * p[1]) / n[2];
    o->plane[1] = -n[0] / n[2], o->plane[2] = -n[1] / n[2];
    for (int k = 0; k < POINTS; k++) {
        double a[3], b[3];
        const double t = (k % PER_EDGE + .5) / PER_EDGE;
        corner(a, p, k / PER_EDGE), corner(b, p, (k / PER_EDGE + 1) % 4);
        for (int c = 0; c < 2; c++) o->at[k][c] = (1 - t) * a[c] + t * b[c];
        double x = b[1] - a[1], y = a[0] - b[0];
        const double l = hypot(x, y), away = x * (o->at[k][0] - p[0]) + y * (o->at[k][1] - p[1]);
        o->normal[k][0] = (away < 0 ? -x : x) / l, o->normal[k][1] = (away < 0 ? -y : y) / l;
    }
}

/* Ask the pictures about the rectangle as it is; all of a point's sayings together are worth EDGE. */
static int ask(job *j, const double *p)
{
    double mean[POINTS] = {0};
    int count[POINTS] = {0};

    free(j->says), free(j->trust);
    edges(&j->o, p);
    j->n = outline_listen(&j->says, &j->o, j->fit.f, j->fit.fold);
    j->trust = malloc(((size_t)(j->n < 0 ? 0 : j->n) + 1) * sizeof *j->trust);
    if (j->n < 0 || !j->trust) return -1;
    for (int i = 0; i < j->n; i++) count[j->says[i].point]++, mean[j->says[i].point] += j->says[i].off;
    for (int i = 0; i < j->n; i++) {
        const saying *s = &j->says[i];
        const double off = s->off / (DOUBTED * s->width);
        j->trust[i] = 1 / (EDGE * s->width * sqrt(count[s->point] * (1 + off * off)));
    }
    return 0;
}

static int settle(double *p, job *j)
{
    const double h = 1e-4 * j->fit.f->size, step[NUMBERS] = {h, h, h, h, h, h, h, h, h};
    double n[3];

    for (int round = 0; round < ROUNDS; round++) {
        if (ask(j, p)) return -1;
        if (lm_fit(p, NUMBERS, j->fit.l->nrows + j->n + 2, residuals, j, step, 12) < 0) return -1;
        if (!normal_of(n, p) || p[2] < .02 * j->fit.f->size || p[2] > .97 * j->fit.l->s.l.centre[2]) return 1;
    }
    return 0;
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* Half the length between the 3 % and 97 % quantiles of the outline's points along a direction, and its middle. */
static double reach(double *mid, double *v, const outline *o, double x, double y)
{
    for (int k = 0; k < o->n; k++) v[k] = x * o->at[k][0] + y * o->at[k][1];
    qsort(v, (size_t)o->n, sizeof *v, by_value);
    const double lo = v[(int)(.03 * o->n)], hi = v[(int)(.97 * (o->n - 1))];
    *mid = .5 * (lo + hi);
    return .5 * (hi - lo);
}

/* The least rectangle about an outline, on its plane. */
static int begin(double *p, const outline *o)
{
    double *v = malloc((size_t)(o->n + 1) * sizeof *v), least = 1e300;

    if (!v) return -1;
    for (int a = 0; a < 90; a += 2) {
        const double c = cos(a * .0174533), s = sin(a * .0174533);
        double m[2];
        const double u = reach(&m[0], v, o, c, s), w = reach(&m[1], v, o, -s, c);
        if (u * w >= least) continue;
        least = u * w;
        const double q[NUMBERS] = {
            m[0] * c - m[1] * s, m[0] * s + m[1] * c, 0, u * c, u * s, 0, -w * s, w * c, 0};
        memcpy(p, q, sizeof q);
    }
    free(v);
    p[2] = o->plane[0] + o->plane[1] * p[0] + o->plane[2] * p[1];
    for (int k = 3; k < NUMBERS; k += 3) p[k + 2] = o->plane[1] * p[k] + o->plane[2] * p[k + 1];
    return v_len(p + 3) > 0 && v_len(p + 6) > 0 ? 0 : 1;
}

/* The rectangle as a sheet's picture. */
static int picture(ilf_mask *m, job *j, const double *p)
{
    sheetgrid g;
    outline *o = &j->o;

    edges(o, p);
    for (int k = 0; k < POINTS; k++) { /* the line goes through the corners */
        double a[3], b[3];
        corner(a, p, k / PER_EDGE), corner(b, p, (k / PER_EDGE + 1) % 4);
        const double t = (double)(k % PER_EDGE) / PER_EDGE;
        for (int c = 0; c < 2; c++) o->at[k][c] = (1 - t) * a[c] + t * b[c];
        o->beside[k][0] = (k + POINTS - 1) % POINTS, o->beside[k][1] = (k + 1) % POINTS;
    }
    sheetgrid_make(&g, o->plane, j->fit.l->s.l.centre, j->fit.f, ABOVE, FINE);
    return outline_mask(m, o, &g);
}

static int versions(model *m, job *j, const double *from)
{
    int heard = 0;

    for (int turn = 0; turn <= FOLDS; turn++) { /* all probes first: a fold begins where that ends */
        const int fold = turn ? turn - 1 : ALL;
        double p[NUMBERS];
        memcpy(p, from, sizeof p);
        rowfit_fold(&j->fit, fold);
        int r = settle(p, j);
        if (r) return r;
        if (!turn) {
            int last = -1;
            for (int i = 0; i < j->n; i++) heard += j->says[i].point != last, last = j->says[i].point;
            m->height = p[2];
        }
        if (picture(&m->m[fold][m->n], j, p)) return -1;
    }
    m->n++, m->saw = heard > POINTS / 2;
    return 0;
}

int card_fit(model *m, const lamp *l, const lightfield *f, const outline *from)
{
    double at[POINTS][2], normal[POINTS][2], weight[POINTS], p[NUMBERS];
    int beside[POINTS][2];
    job j = {.o = {.n = POINTS, .at = at, .normal = normal, .beside = beside, .weight = weight}};
    int bad = begin(p, from);

    if (!bad) bad = rowfit_make(&j.fit, m, l, f);
    j.soft = rowfit_softness(l, f);
    if (!bad) bad = versions(m, &j, p);
    rowfit_free(&j.fit), free(j.says), free(j.trust);
    if (!bad) model_judge(m, l, f);
    return bad;
}
