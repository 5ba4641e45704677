/*
 * sheet.c - one sheet (a card) that hides a lamp.  Heights are tried from low to high: at each, the mask that
 * follows the pictures' mean and the rows of three quarters of the probes is judged by the rows of the
 * fourth.  From the best heights an outline is drawn sharp, which also sets height and slopes.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ball.h"
#include "card.h"
#include "layers.h"
#include "outline.h"
#include "sheetgrid.h"

enum { HEIGHTS = 16, COARSE = 40, FINE = 112, STARTS = 2 };
#define ABOVE   .45 /* sizes of the plane beyond its edges that a sheet must cover */
#define STIFF   3
#define OBLIQUE .93

typedef struct job {
    const model *m;
    const lamp *l;
    const lightfield *f;
} job;

static double *ones(int n)
{
    double *v = malloc((size_t)n * sizeof *v);

    for (int k = 0; v && k < n; k++) v[k] = 1;
    return v;
}

/* Left-out rows' mean square error of a level sheet at height h; -1 without memory. */
static double height_error(const job *j, double h)
{
    const double plane[3] = {h, 0, 0};
    sheetgrid g;
    backview b;
    double sum = 0, all = 0;

    sheetgrid_make(&g, plane, j->l->s.l.centre, j->f, ABOVE, COARSE);
    if (backview_make(&b, &g, j->f)) return -1;
    double *M = ones(g.nx * g.ny), *B = malloc((size_t)(g.nx * g.ny) * sizeof *B);
    cellrow *rows = malloc((size_t)(j->l->nrows + 1) * sizeof *rows);
    int bad = !M || !B || !rows;
    for (int fold = 0; fold < FOLDS && !bad; fold++) {
        cellrows_make(rows, &g, j->l, j->f, j->m->m[fold], j->m->n);
        backview_mean(B, &b, &g, fold);
        bad = walker(M, B, &g, rows, j->l->nrows, j->f, fold, STIFF);
        for (int k = 0; k < j->l->nrows; k++) {
            if (fold_of(j->f, rows[k].probe) != fold) continue;
            const double e = cellrow_value(&rows[k], M) - rows[k].value;
            sum += rows[k].share * e * e, all += rows[k].share;
        }
    }
    free(M), free(B), free(rows);
    backview_free(&b);
    return bad ? -1 : sum / all;
}

/* The sheet that starts at a plane, without the probes of a fold. */
static int sheet_once(ilf_mask *mask, outline *keep, const job *j, int fold, const sheetgrid *from,
                      const backview *b, int moves)
{
    sheetgrid g = *from;
    outline o = {0};

    double *M = ones(g.nx * g.ny), *B = malloc((size_t)(g.nx * g.ny) * sizeof *B);
    cellrow *rows = malloc((size_t)(j->l->nrows + 1) * sizeof *rows);
    int bad = M && B && rows ? 0 : -1;
    if (!bad) {
        cellrows_make(rows, &g, j->l, j->f, j->m->m[fold], j->m->n);
        backview_mean(B, b, &g, fold);
        bad = walker(M, B, &g, rows, j->l->nrows, j->f, fold, STIFF);
    }
    if (!bad) bad = outline_trace(&o, M, &g);
    for (int round = 0; round < 4 && !bad; round++)
        bad = outline_settle(&o, j->f, fold, round < 1 ? 1 : moves);
    if (!bad) {
        sheetgrid_make(&g, o.plane, j->l->s.l.centre, j->f, ABOVE, FINE);
        bad = outline_mask(mask, &o, &g);
    }
    free(M), free(B), free(rows);
    if (keep && !bad) *keep = o;
    else outline_free(&o);
    return bad;
}

/* Height of the sheet where its outline's middle is. */
static double middle_height(const outline *o)
{
    double h = o->plane[0];

    for (int k = 0; k < o->n; k++) h += (o->plane[1] * o->at[k][0] + o->plane[2] * o->at[k][1]) / o->n;
    return h;
}

/* All five versions of the sheet from a start; *o: the outline of all probes. */
static int sheet_from(model *m, outline *o, const job *j, const double start[3], int moves)
{
    sheetgrid g;
    backview b;

    sheetgrid_make(&g, start, j->l->s.l.centre, j->f, ABOVE, FINE);
    if (backview_make(&b, &g, j->f)) return -1;
    int bad = sheet_once(&m->m[ALL][m->n], o, j, ALL, &g, &b, moves);
    for (int fold = 0; fold < FOLDS && !bad; fold++)
        bad = sheet_once(&m->m[fold][m->n], NULL, j, fold, &g, &b, moves);
    backview_free(&b);
    if (bad) return bad;
    m->height = middle_height(o);
    m->n++;
    m->saw = o->sure > .5;
    model_judge(m, j->l, j->f);
    return 0;
}

typedef struct best {
    model m;
    outline o;
    int any;
} best;

static void best_take(best *b, model *m, outline *o)
{
    model_free(&b->m), outline_free(&b->o);
    b->m = *m, b->o = *o, b->any = 1;
}

/* A sheet from a start becomes the best if its error is below `part` of the best's so far. */
static int attempt(best *b, const job *j, const double start[3], int moves, double part)
{
    model t;
    outline o = {0};

    if (model_copy(&t, j->m)) return -1;
    const int r = sheet_from(&t, &o, j, start, moves);
    if (!r && (!b->any || t.error < part * b->m.error)) best_take(b, &t, &o);
    else model_free(&t), outline_free(&o);
    return r < 0 ? -1 : 0;
}

/* A body about the best outline, where it explains as much. */
static int attempt_body(best *b, const job *j,
                        int fit(model *, const lamp *, const lightfield *, const outline *))
{
    model t;
    outline o = {0};

    if (!b->o.n) return 0;
    if (model_copy(&t, j->m)) return -1;
    const int r = fit(&t, j->l, j->f, &b->o);
    if (!r && model_doubt(&t) < model_doubt(&b->m)) {
        o = b->o, memset(&b->o, 0, sizeof b->o); /* further bodies begin there, too */
        best_take(b, &t, &o);
    } else model_free(&t);
    return r < 0 ? -1 : 0;
}

int layers_sheet(model *m, const lamp *l, const lightfield *f, const pictures *pics)
{
    const job j = {m, l, f};
    double h[HEIGHTS], e[HEIGHTS], lowest = 0;
    best b = {0};
    int tried[HEIGHTS] = {0};

    (void)pics;
    for (int k = 0; k < HEIGHTS; k++) {
        h[k] = lamp_ceiling(l, f) * (.08 + .87 * k / (HEIGHTS - 1)), e[k] = height_error(&j, h[k]);
        if (e[k] < 0) return -1;
    }
    for (int s = 0; s < STARTS; s++) {
        int k = -1;
        for (int q = 0; q < HEIGHTS; q++)
            if (!tried[q] && (q == 0 || e[q] <= e[q - 1] || tried[q - 1]) &&
                (q + 1 == HEIGHTS || e[q] <= e[q + 1] || tried[q + 1]) && (k < 0 || e[q] < e[k]))
                k = q;
        if (k < 0 || (s && e[k] > 2.5 * lowest)) break;
        if (!s) lowest = e[k];
        tried[k] = 1;
        const double start[3] = {h[k], 0, 0};
        if (attempt(&b, &j, start, 1, 1)) return -1;
    }
    if (b.any) { /* oblique only where that clearly helps: a short edge says little about slopes */
        double start[3];
        memcpy(start, b.m.m[ALL][m->n].plane, sizeof start);
        if (attempt(&b, &j, start, 3, OBLIQUE)) return -1;
        if (attempt_body(&b, &j, card_fit) || attempt_body(&b, &j, ball_fit)) return -1;
    }
    outline_free(&b.o);
    if (!b.any) return 1;
    model_free(m);
    *m = b.m;
    return 0;
}
