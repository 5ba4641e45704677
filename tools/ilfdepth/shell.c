/*
 * shell.c - the surroundings as one distance for each direction from the middle.
 */
#include "shell.h"

#include <stdlib.h>
#include <string.h>

#include "vec3.h"

static const double pi = 3.14159265358979323846;
enum { COLUMNS = 96, STEPS = 48 };

void shell_free(shell *h)
{
    free(h->near), free(h->error), free(h->closed), free(h->thing);
    memset(h, 0, sizeof *h);
}

void shell_direction(double d[3], const shell *h, int column, int row)
{
    const double t = 2 * pi * column / h->columns - pi, p = h->polar_max * row / (h->rows - 1), s = sin(p);

    d[0] = s * cos(t), d[1] = s * sin(t), d[2] = cos(p);
}

/* Where a ray from the middle first is behind what a map shows: its nearness from the middle, or -1. */
static double meets(int *cell, const double d[3], const shell *h, const depthmap *m, const float *near,
                    const views *s, double most)
{
    double last = most * 1.5, last_in = -1;

    for (int k = 0; k <= STEPS; k++) {
        const double r = most * 1.5 * pow(1 - k / (STEPS + .5), 2);
        double x[3], e[3];
        v3_add(x, h->c, 1 / r, d);
        v3_add(e, x, -1, s->v[m->view].at);
        const double look = depthmap_look(m, near, s, e);
        if (look < 0) return -1;
        const double in = look * v3_len(e) - 1; /* above 0: behind */
        if (in > 0) {
            *cell = depthmap_cell(m, s, e);
            return k ? last + (r - last) * -last_in / (in - last_in) : r;
        }
        last = r, last_in = in;
    }
    return -1;
}

typedef struct tell {
    double near, error;
} tell;

static int compare(const void *a, const void *b)
{
    const tell *x = a, *y = b;

    return (x->near > y->near) - (x->near < y->near);
}

/* The median of what the maps tell of a node, and how far the middle half of them differ. */
static void one_node(shell *h, int node, tell *t, const depthmap *maps, int n, int swept, const views *s,
                     const sweep_plan *p)
{
    double d[3];
    int many = 0, could = 0;

    shell_direction(d, h, node % h->columns, node / h->columns);
    for (int k = 0; k < n; k++) {
        const depthmap *m = &maps[k];
        int cell = -1;
        if (p->held[m->view]) continue;
        could++;
        const double r = meets(&cell, d, h, m, swept ? m->free : m->near, s, p->most);
        if (r > 0 && cell >= 0 && m->sure[cell] > .3f) t[many++] = (tell){r, (double)m->error[cell]};
    }
    h->closed[node] = many < 1 || many < .25 * could;
    if (h->closed[node]) return;
    qsort(t, (size_t)many, sizeof *t, compare);
    const double spread = t[(3 * many - 1) / 4].near - t[many / 4].near;
    h->near[node] = (float)t[many / 2].near;
    h->error[node] = (float)hypot(t[many / 2].error, .7 * spread / sqrt(fmin(many, 4)));
}

static float mean_beside(const shell *h, const float *from, int x, int y)
{
    const int C = h->columns;
    const float up = y > 0 ? from[(y - 1) * C + x] : from[C + (x + C / 2) % C],
                down = y + 1 < h->rows ? from[(y + 1) * C + x] : up;

    return .25f * (up + down + from[y * C + (x + 1) % C] + from[y * C + (x + C - 1) % C]);
}

/* What no map tells bends as little as can be between what they do; its error grows with its size. */
static void close_holes(shell *h)
{
    const int n = h->columns * h->rows;
    double mean = 0;
    int told = 0;

    for (int k = 0; k < n; k++)
        if (!h->closed[k]) mean += (double)h->near[k], told++;
    mean = told ? mean / told : 0;
    for (int k = 0; k < n; k++)
        if (h->closed[k]) h->near[k] = (float)mean, h->error[k] = (float)mean / 3;
    for (int round = 0; round < 400; round++)
        for (int k = 0; k < n; k++) {
            if (!h->closed[k]) continue;
            h->near[k] = mean_beside(h, h->near, k % h->columns, k / h->columns);
            h->error[k] = fminf(h->near[k],
                                mean_beside(h, h->error, k % h->columns, k / h->columns) + .02f * h->near[k]);
        }
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;

    return (x > y) - (x < y);
}

/* Single nodes that stand out of all eight round them are mistakes. */
static void clean(shell *h)
{
    const int C = h->columns;

    for (int y = 1; y + 1 < h->rows; y++)
        for (int x = 0; x < C; x++) {
            float round[8];
            int n = 0;
            for (int k = 0; k < 9; k++)
                if (k != 4) round[n++] = h->near[(y + k / 3 - 1) * C + (x + k % 3 - 1 + C) % C];
            qsort(round, 8, sizeof *round, compare_floats);
            const float lo = round[0], hi = round[7], own = h->near[y * C + x];
            if (own > 1.1f * hi || own < .9f * lo) h->near[y * C + x] = .5f * (round[3] + round[4]);
        }
}

static void join_poles(shell *h)
{
    for (int end = 0; end < 2; end++) {
        const int row = end ? h->rows - 1 : 0;
        float *near = h->near + row * h->columns, sum = 0;
        if (end && h->polar_max < .99 * pi) continue;
        for (int x = 0; x < h->columns; x++) sum += near[x] / (float)h->columns;
        for (int x = 0; x < h->columns; x++) near[x] = sum;
    }
}

int shell_fuse(shell *h, const depthmap *maps, int n, int swept, const views *s, const sweep_plan *p,
               errmsg *e)
{
    memset(h, 0, sizeof *h);
    memcpy(h->c, s->centre, sizeof h->c);
    h->polar_max = s->below ? pi : pi / 2;
    h->columns = COLUMNS, h->rows = COLUMNS / (s->below ? 2 : 4) + 1;
    const size_t all = (size_t)h->columns * (size_t)h->rows;
    h->near = calloc(all, sizeof *h->near), h->error = calloc(all, sizeof *h->error),
    h->closed = calloc(all, 1), h->thing = calloc(all, 1);
    int bad = h->near && h->error && h->closed && h->thing ? 0 : -1;
#pragma omp parallel for schedule(dynamic, 1)
    for (int y = 0; y < h->rows; y++) {
        tell *t = malloc((size_t)n * sizeof *t);
        for (int x = 0; x < h->columns && t && !bad; x++)
            one_node(h, y * h->columns + x, t, maps, n, swept, s, p);
        if (!t) bad = -1;
        free(t);
    }
    if (bad) {
        shell_free(h);
        return err_set(e, "no memory for a surface");
    }
    close_holes(h), clean(h), join_poles(h);
    return 0;
}

static double look(const shell *h, const double d[3])
{
    const double r = hypot(d[0], d[1]), x = ((r > 0 ? atan2(d[1], d[0]) : 0) + pi) / (2 * pi) * h->columns,
                 y = fmin(atan2(r, d[2]) / h->polar_max * (h->rows - 1), h->rows - 1.0001), a = x - floor(x),
                 b = y - floor(y);
    const int i = (int)x % h->columns, i1 = (i + 1) % h->columns;
    const float *p = h->near + (int)y * h->columns, *q = p + h->columns;

    return (1 - b) * ((1 - a) * (double)p[i] + a * (double)p[i1]) +
           b * ((1 - a) * (double)q[i] + a * (double)q[i1]);
}

/* How far a point is beyond the shell, as part of the shell's distance; below 0: within. */
static double beyond(const shell *h, const double o[3], const double d[3], double near)
{
    double x[3];

    v3_add(x, o, 1 / near, d);
    v3_add(x, x, -1, h->c);
    return v3_len(x) * look(h, x) - 1;
}

double shell_near(const shell *h, const double o[3], const double d[3])
{
    double most = 0, in;

    for (int k = 0; k < h->columns * h->rows; k += 7) most = fmax(most, (double)h->near[k]);
    in = 1.5 * most;
    for (int k = 1; k <= STEPS; k++) {
        double out = 1.5 * most * pow(1 - k / (STEPS + .5), 2);
        if (beyond(h, o, d, out) < 0) {
            in = out;
            continue;
        }
        for (int half = 0; half < 16; half++) {
            const double mid = .5 * (in + out);
            if (beyond(h, o, d, mid) < 0) in = mid;
            else out = mid;
        }
        return out;
    }
    return 0;
}

int shell_node(const shell *h, const double d[3])
{
    const double r = hypot(d[0], d[1]), x = ((r > 0 ? atan2(d[1], d[0]) : 0) + pi) / (2 * pi) * h->columns,
                 y = fmin(atan2(r, d[2]) / h->polar_max * (h->rows - 1), h->rows - 1);

    return (int)(y + .5) * h->columns + (int)(x + .5) % h->columns;
}
