/*
 * outline.c - the edge of what stands on a sheet, drawn sharp from the pictures.
 */
#include "outline.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "vec.h"

void outline_free(outline *o)
{
    free(o->at), free(o->normal), free(o->beside), free(o->weight);
    memset(o, 0, sizeof *o);
}

/* The point where M passes 1/2 between cells a and b; made once. */
static int point(outline *o, int *id, int a, int b, const double *M, const sheetgrid *g)
{
    int *mine = &id[2 * a + (b != a + 1)];

    if (*mine >= 0) return *mine;
    const double t = (M[a] - .5) / (M[a] - M[b]);
    o->at[o->n][0] = g->x0 + g->cell * (a % g->nx + t * (b % g->nx - a % g->nx));
    o->at[o->n][1] = g->y0 + g->cell * (a / g->nx + t * (b / g->nx - a / g->nx));
    o->beside[o->n][0] = o->beside[o->n][1] = -1;
    return *mine = o->n++;
}

static void join(outline *o, int a, int b)
{
    const int i = o->beside[a][0] >= 0, j = o->beside[b][0] >= 0;

    if (o->beside[a][i] >= 0 || o->beside[b][j] >= 0) return;
    o->beside[a][i] = b, o->beside[b][j] = a;
}

static double slope(const double *M, const sheetgrid *g, double x, double y, int axis)
{
    const int i = (int)fmax(1, fmin(g->nx - 2, floor((x - g->x0) / g->cell + .5)));
    const int j = (int)fmax(1, fmin(g->ny - 2, floor((y - g->y0) / g->cell + .5)));
    const double *m = M + j * g->nx + i;

    return axis ? m[g->nx] - m[-g->nx] : m[1] - m[-1];
}

/* Across the line through the neighbours; which side is clear stays as it was. */
static void set_normals(outline *o)
{
    for (int k = 0; k < o->n; k++) {
        const int a = o->beside[k][0] >= 0 ? o->beside[k][0] : k,
                  b = o->beside[k][1] >= 0 ? o->beside[k][1] : k;
        const int a2 = a != k ? o->beside[a][0] != k && o->beside[a][0] >= 0   ? o->beside[a][0]
                                : o->beside[a][1] != k && o->beside[a][1] >= 0 ? o->beside[a][1]
                                                                               : a
                              : a;
        const int b2 = b != k ? o->beside[b][0] != k && o->beside[b][0] >= 0   ? o->beside[b][0]
                                : o->beside[b][1] != k && o->beside[b][1] >= 0 ? o->beside[b][1]
                                                                               : b
                              : b;
        double x = o->at[b2][1] - o->at[a2][1], y = o->at[a2][0] - o->at[b2][0];
        const double l = hypot(x, y);
        if (l <= 0) continue;
        const double s = (x * o->normal[k][0] + y * o->normal[k][1] < 0 ? -1 : 1) / l;
        o->normal[k][0] = s * x, o->normal[k][1] = s * y;
    }
}

/* Islands of a few cells are the fit's, not the room's. */
static void drop_small(outline *o, int least)
{
    int *stack = malloc((size_t)(o->n + 1) * sizeof *stack), *group = calloc((size_t)o->n + 1, sizeof *group),
        n = 0;

    for (int k = 0; stack && group && k < o->n; k++) {
        int size = 0, head = 0;
        if (group[k]) continue;
        stack[size++] = k, group[k] = 1;
        while (head < size) {
            const int *b = o->beside[stack[head++]];
            for (int q = 0; q < 2; q++)
                if (b[q] >= 0 && !group[b[q]]) stack[size++] = b[q], group[b[q]] = 1;
        }
        for (int q = 0; q < size; q++) group[stack[q]] = size < least ? 1 : 2;
    }
    for (int k = 0; stack && group && k < o->n; k++) stack[k] = group[k] == 2 ? n++ : -1; /* new numbers */
    for (int k = 0; stack && group && k < o->n; k++) {
        const int to = stack[k];
        if (to < 0) continue;
        for (int q = 0; q < 2; q++) {
            o->at[to][q] = o->at[k][q], o->normal[to][q] = o->normal[k][q];
            o->beside[to][q] = o->beside[k][q] < 0 ? -1 : stack[o->beside[k][q]];
        }
    }
    if (stack && group) o->n = n;
    free(stack), free(group);
}

/* Blurred a little: what is finer than a cell is the pictures' to say. */
static void blur(double *to, const double *M, const sheetgrid *g)
{
    for (int j = 0; j < g->ny; j++)
        for (int i = 0; i < g->nx; i++) {
            double sum = 0, all = 0;
            for (int b = -2; b <= 2; b++)
                for (int a = -2; a <= 2; a++) {
                    if (i + a < 0 || i + a >= g->nx || j + b < 0 || j + b >= g->ny) continue;
                    const double w = (3 - abs(a)) * (3 - abs(b));
                    sum += w * M[(j + b) * g->nx + i + a], all += w;
                }
            to[j * g->nx + i] = sum / all;
        }
}

int outline_trace(outline *o, const double *sharp, const sheetgrid *g)
{
    const int cells = g->nx * g->ny;
    int *id = malloc(2 * (size_t)cells * sizeof *id);
    double *M = malloc((size_t)cells * sizeof *M);

    memset(o, 0, sizeof *o);
    memcpy(o->plane, g->plane, sizeof o->plane);
    o->at = malloc(2 * (size_t)cells * sizeof *o->at),
    o->normal = malloc(2 * (size_t)cells * sizeof *o->normal);
    o->beside = malloc(2 * (size_t)cells * sizeof *o->beside),
    o->weight = calloc(2 * (size_t)cells, sizeof *o->weight);
    if (!id || !M || !o->at || !o->normal || !o->beside || !o->weight)
        return free(id), free(M), outline_free(o), -1;
    blur(M, sharp, g);
    for (int k = 0; k < 2 * cells; k++) id[k] = -1;
    for (int j = 0; j + 1 < g->ny; j++)
        for (int i = 0; i + 1 < g->nx; i++) {
            const int c = j * g->nx + i, corner[5] = {c, c + 1, c + 1 + g->nx, c + g->nx, c};
            int p[4], n = 0;
            for (int k = 0; k < 4; k++) {
                const int a = corner[k] < corner[k + 1] ? corner[k] : corner[k + 1],
                          b = corner[k] + corner[k + 1] - a;
                if ((M[a] > .5) != (M[b] > .5)) p[n++] = point(o, id, a, b, M, g);
            }
            if (n >= 2) join(o, p[0], p[1]);
            if (n == 4) join(o, p[2], p[3]);
        }
    drop_small(o, 14);
    for (int k = 0; k < o->n; k++)
        for (int a = 0; a < 2; a++) o->normal[k][a] = slope(M, g, o->at[k][0], o->at[k][1], a);
    free(id), free(M);
    set_normals(o);
    return o->n < 8;
}

enum { STEPS = 15 };

static double height_at(const outline *o, double x, double y)
{
    return o->plane[0] + o->plane[1] * x + o->plane[2] * y;
}

static int listen(saying *s, const outline *o, int k, const lightfield *f, int probe)
{
    const double *x = o->at[k], *n = o->normal[k], *p = f->pos[probe], eps = 1e-3 * f->size;
    double px[2], py[2], v[STEPS], in = 0, out = 0, sum = 0, travel = 0;

    for (int e = 0; e < 2; e++) {
        const double a = x[0] + (2 * e - 1) * eps * n[0], b = x[1] + (2 * e - 1) * eps * n[1];
        const double d[3] = {a - p[0], b - p[1], height_at(o, a, b) - p[2]};
        if (d[2] < .08 * v_len(d)) return 0;
        lf_place(&px[e], &py[e], f, probe, d);
    }
    double dx = px[1] - px[0];
    if (dx > f->nt / 2) dx -= f->nt;
    if (dx < -f->nt / 2) dx += f->nt;
    const double st = sin(.5 * (py[0] + py[1]) * f->dp), ax = dx * f->dt * st / (2 * eps),
                 ay = (py[1] - py[0]) * f->dp / (2 * eps);
    const double g = hypot(ax, ay);
    if (!(g > 0)) return 0;
    const double width = (fabs(ax) * f->dt * st + fabs(ay) * f->dp) / (g * g), reach = 2.2 * width;
    for (int q = 0; q < STEPS; q++) {
        const double t = reach * (2. * q / (STEPS - 1) - 1), a = x[0] + t * n[0], b = x[1] + t * n[1];
        const double d[3] = {a - p[0], b - p[1], height_at(o, a, b) - p[2]};
        double u, w;
        if (d[2] <= 0) return 0;
        lf_place(&u, &w, f, probe, d);
        v[q] = lf_look(f, probe, u, w);
    }
    in = (v[0] + v[1]) / 2, out = (v[STEPS - 1] + v[STEPS - 2]) / 2;
    const double contrast = fabs(out - in) / (fabs(out) + fabs(in) + 1e-30);
    if (contrast < .06) return 0;
    for (int q = 0; q < STEPS; q++) {
        const double m = (v[q] - in) / (out - in);
        if (m < -.35 || m > 1.35) return 0;
        sum += m * (q == 0 || q == STEPS - 1 ? .5 : 1);
        if (q) travel += fabs(v[q] - v[q - 1]);
    }
    if (travel > 1.5 * fabs(out - in)) return 0;
    s->off = reach - sum * 2 * reach / (STEPS - 1);
    if (fabs(s->off) > .7 * reach) return 0;
    const double h = height_at(o, x[0], x[1]) - p[2],
                 along = -((x[0] - p[0]) * n[0] + (x[1] - p[1]) * n[1]) / h;
    s->point = k, s->probe = probe, s->width = width, s->w = contrast * contrast / (width * width);
    s->lean[0] = along, s->lean[1] = along * x[0], s->lean[2] = along * x[1];
    return 1;
}

enum { MOST_PICTURES = 64 };

int outline_listen(saying **all, const outline *o, const lightfield *f, int fold)
{
    const int step = (f->n + MOST_PICTURES - 1) / MOST_PICTURES, probes = (f->n + step - 1) / step;
    saying *s = malloc(((size_t)o->n * (size_t)probes + 1) * sizeof *s);
    int n = 0;

    *all = s;
    if (!s) return -1;
#pragma omp parallel for schedule(dynamic, 8)
    for (int k = 0; k < o->n; k++)
        for (int q = 0; q < probes; q++) {
            saying *mine = &s[(size_t)k * (size_t)probes + (size_t)q];
            if (fold_of(f, q * step) == fold || !listen(mine, o, k, f, q * step)) mine->w = 0;
        }
    for (size_t k = 0; k < (size_t)o->n * (size_t)probes; k++)
        if (s[k].w > 0) s[n++] = s[k];
    return n;
}

static void solve3(double x[3], double a[3][3], double y[3], int n)
{
    for (int k = 0; k < n; k++)
        for (int r = k + 1; r < n; r++) {
            const double q = a[r][k] / a[k][k];
            for (int c = k; c < n; c++) a[r][c] -= q * a[k][c];
            y[r] -= q * y[k];
        }
    for (int k = n; k-- > 0;) {
        x[k] = y[k];
        for (int c = k + 1; c < n; c++) x[k] -= a[k][c] * x[c];
        x[k] /= a[k][k];
    }
}

/* Least squares, doubtful sayings weighing less each round: the sheet's change d and each point's e. */
static void agree(double d[3], double *e, outline *o, saying *s, int n, int moves, double size)
{
    double *top = calloc((size_t)o->n * 5, sizeof *top), scale = 1e30;

    memset(d, 0, 3 * sizeof *d);
    for (int round = 0; round < 6 && top; round++) {
        double N[3][3] = {{0}}, y[3] = {0};
        memset(top, 0, (size_t)o->n * 5 * sizeof *top);
        for (int i = 0; i < n; i++) { /* sums per point: w, w off, w lean */
            double r = s[i].off - e[s[i].point];
            for (int c = 0; c < moves; c++) r -= s[i].lean[c] * d[c];
            const double w = round ? s[i].w / (1 + r * r / (scale * scale)) : s[i].w;
            double *t = top + 5 * s[i].point;
            t[0] += w, t[1] += w * s[i].off;
            for (int c = 0; c < moves; c++) t[2 + c] += w * s[i].lean[c];
        }
        for (int i = 0; i < n; i++) {
            double r = s[i].off - e[s[i].point];
            for (int c = 0; c < moves; c++) r -= s[i].lean[c] * d[c];
            const double *t = top + 5 * s[i].point,
                         w = round ? s[i].w / (1 + r * r / (scale * scale)) : s[i].w;
            for (int c = 0; c < moves; c++) {
                const double lc = s[i].lean[c] - t[2 + c] / t[0];
                y[c] += w * lc * (s[i].off - t[1] / t[0]);
                for (int q = 0; q < moves; q++) N[c][q] += w * lc * (s[i].lean[q] - t[2 + q] / t[0]);
            }
        }
        for (int c = 0; c < moves; c++) N[c][c] += 1e-6 * N[0][0] * (c ? size * size : 1) + 1e-12;
        if (moves) solve3(d, N, y, moves);
        for (int k = 0; k < o->n; k++) {
            const double *t = top + 5 * k;
            o->weight[k] = t[0];
            if (t[0] <= 0) continue;
            e[k] = t[1] / t[0];
            for (int c = 0; c < moves; c++) e[k] -= t[2 + c] / t[0] * d[c];
        }
        double sum = 0, all = 0;
        for (int i = 0; i < n; i++) {
            double r = s[i].off - e[s[i].point];
            for (int c = 0; c < moves; c++) r -= s[i].lean[c] * d[c];
            sum += s[i].w * fmin(fabs(r), s[i].width), all += s[i].w;
        }
        scale = all > 0 ? fmax(1.5 * sum / all, 1e-4 * size) : 1;
    }
    free(top);
}

/* Points that the pictures don't see follow their neighbours. */
static void even_out(double *e, const outline *o)
{
    double mean = 0;

    for (int k = 0; k < o->n; k++) mean += o->weight[k] / o->n;
    for (int round = 0; round < 40; round++)
        for (int q = 0; q < o->n; q++) {
            const int k = round & 1 ? o->n - 1 - q : q;
            double own = round ? 0 : e[k], w = o->weight[k] / (mean + 1e-30), sum = 0, all = .02;
            (void)own;
            for (int b = 0; b < 2; b++)
                if (o->beside[k][b] >= 0) sum += .5 * e[o->beside[k][b]], all += .5;
            if (w < .05) e[k] = sum / all;
        }
}

/* A light smoothing along the line, as sure points pull less than unsure ones. */
static void smooth_along(double *e, const outline *o)
{
    double mean = 0, *was = malloc((size_t)o->n * sizeof *was);

    for (int k = 0; k < o->n; k++) mean += o->weight[k] / o->n;
    for (int round = 0; round < 3 && was; round++) {
        memcpy(was, e, (size_t)o->n * sizeof *was);
        for (int k = 0; k < o->n; k++) {
            double sum = was[k] * (o->weight[k] / (mean + 1e-30) + .2),
                   all = o->weight[k] / (mean + 1e-30) + .2;
            for (int b = 0; b < 2; b++)
                if (o->beside[k][b] >= 0) {
                    const double w = .3 * (o->weight[o->beside[k][b]] / (mean + 1e-30) + .2);
                    sum += w * was[o->beside[k][b]], all += w;
                }
            e[k] = sum / all;
        }
    }
    free(was);
}

int outline_settle(outline *o, const lightfield *f, int fold, int moves)
{
    saying *s;
    const int n = outline_listen(&s, o, f, fold);
    double *e = calloc((size_t)o->n + 1, sizeof *e), d[3], sum = 0, all = 0, seen = 0;

    if (n < 0 || !e) return free(s), free(e), -1;
    agree(d, e, o, s, n, n > 40 ? moves : 0, f->size);
    for (int i = 0; i < n; i++) {
        double r = s[i].off - e[s[i].point];
        for (int c = 0; c < moves; c++) r -= s[i].lean[c] * d[c];
        sum += s[i].w * s[i].width * s[i].width * fmin(1, r * r / (s[i].width * s[i].width)),
            all += s[i].w * s[i].width * s[i].width;
    }
    for (int k = 0; k < o->n; k++) seen += o->weight[k] > 0;
    o->scatter = all > 0 ? sqrt(sum / all) : 1, o->sure = seen / o->n;
    even_out(e, o), smooth_along(e, o);
    const double most = .15 * fabs(o->plane[0]);
    d[0] = fmax(-most, fmin(most, d[0]));
    for (int c = 0; c < 3; c++) o->plane[c] += d[c];
    for (int k = 0; k < o->n; k++)
        for (int c = 0; c < 2; c++) o->at[k][c] += e[k] * o->normal[k][c];
    set_normals(o);
    free(s), free(e);
    return 0;
}

/* Signed distance of a place from the line: above 0 on the clear side. */
static double distance(const outline *o, double x, double y)
{
    double best = 1e30, side = 0;

    for (int k = 0; k < o->n; k++)
        for (int b = 0; b < 2; b++) {
            const int q = o->beside[k][b];
            if (q < k) continue;
            const double ax = o->at[q][0] - o->at[k][0], ay = o->at[q][1] - o->at[k][1], bx = x - o->at[k][0],
                         by = y - o->at[k][1];
            const double len2 = ax * ax + ay * ay,
                         t = len2 > 0 ? fmax(0, fmin(1, (ax * bx + ay * by) / len2)) : 0;
            const double ex = bx - t * ax, ey = by - t * ay, d = ex * ex + ey * ey;
            if (d > best + 1e-14) continue;
            const double nx = o->normal[k][0] + o->normal[q][0], ny = o->normal[k][1] + o->normal[q][1];
            const double now = (ex * nx + ey * ny) / (hypot(nx, ny) + 1e-30);
            if (d < best - 1e-14 || fabs(now) > fabs(side)) side = now;
            best = fmin(best, d);
        }
    return side < 0 ? -sqrt(best) : sqrt(best);
}

int outline_mask(ilf_mask *m, const outline *o, const sheetgrid *g)
{
    const double soft = .22 * g->cell;

    memset(m, 0, sizeof *m);
    m->kind = ILF_MASK_LAYER, m->link = ILF_LINK_LOGISTIC;
    memcpy(m->plane, o->plane, sizeof m->plane);
    if (mask_grid(m, g->nx, g->ny, g->x0, g->y0, g->x0 + (g->nx - 1) * g->cell,
                  g->y0 + (g->ny - 1) * g->cell))
        return -1;
#pragma omp parallel for schedule(dynamic, 1)
    for (int j = 0; j < m->ny; j++)
        for (int i = 0; i < m->nx; i++)
            m->grid[j * m->nx + i] =
                (float)fmax(-40, fmin(40, distance(o, m->x0 + i * m->dx, m->y0 + j * m->dy) / soft));
    return 0;
}
