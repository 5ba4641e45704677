/*
 * mesh.c - a surface as triangles.
 */
#include "mesh.h"

#include <stdlib.h>
#include <string.h>

#include "vec3.h"

enum { PARTS = 16, ALONG = PARTS + 1 };

void mesh_free(mesh *m)
{
    free(m->v), free(m->t);
    memset(m, 0, sizeof *m);
}

int mesh_is_closed(const mesh *m, int triangle)
{
    const int *t = m->t[triangle];

    return m->v[t[0]].closed || m->v[t[1]].closed || m->v[t[2]].closed;
}

static int room_for(mesh *m, int vertices, int triangles, errmsg *e)
{
    memset(m, 0, sizeof *m);
    m->v = calloc((size_t)vertices, sizeof *m->v), m->t = calloc((size_t)triangles, sizeof *m->t);
    if (m->v && m->t) return 0;
    mesh_free(m);
    return err_set(e, "no memory for a mesh");
}

static void triangle(mesh *m, int a, int b, int c)
{
    int *t = m->t[m->triangles++];

    t[0] = a, t[1] = b, t[2] = c;
}

static void four(mesh *m, int a, int b, int c, int d)
{
    triangle(m, a, b, c), triangle(m, a, c, d);
}

/* ---- a box ---- */

/* A place p on the box: seen where at least a fourth of the maps that look there found the box. */
static int is_seen(const double p[3], const depthmap *maps, int n, const views *s)
{
    int could = 0, did = 0;

    for (int k = 0; k < n; k++) {
        double e[3];
        v3_add(e, p, -1, s->v[maps[k].view].at);
        const int cell = depthmap_cell(&maps[k], s, e);
        if (cell < 0) continue;
        const double q = (double)maps[k].near[cell] * v3_len(e);
        could++, did += fabs(q - 1) < .1 && (maps[k].from[cell] == DEPTH_BOX || maps[k].sure[cell] > .5f);
    }
    return could > 0 && did >= .25 * could;
}

/* A lattice of PARTS cells along each axis; only its outside is used. */
static void box_vertex(corner3 *v, const box *b, const int at[3], const depthmap *maps, int n, const views *s)
{
    double q[3], p[3], error = 0;

    v->closed = 0;
    for (int k = 0; k < 3; k++) {
        q[k] = -b->side[2 * k] + (b->side[2 * k] + b->side[2 * k + 1]) * at[k] / PARTS;
        const int side = at[k] == 0 ? 2 * k : at[k] == PARTS ? 2 * k + 1 : -1;
        if (side < 0) continue;
        error = fmax(error, b->error[side] / b->side[side]);
        v->closed |= !b->seen[side];
    }
    v3_back(p, b->axis, q);
    v3_add(p, p, 1, b->c);
    v->error = v->closed ? 1 : error;
    if (!v->closed && !is_seen(p, maps, n, s)) v->closed = 1, v->error = fmax(.05, error);
    views_to_scene(v->at, s, p);
}

static int on_outside(const int at[3])
{
    for (int k = 0; k < 3; k++)
        if (at[k] == 0 || at[k] == PARTS) return 1;
    return 0;
}

static void box_face(mesh *m, const int *number, int axis, int end)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;

    for (int i = 0; i < PARTS; i++)
        for (int j = 0; j < PARTS; j++) {
            int q[4];
            for (int c = 0; c < 4; c++) {
                int at[3];
                at[axis] = end * PARTS, at[u] = i + (c == 1 || c == 2), at[v] = j + (c >= 2);
                q[c] = number[(at[2] * ALONG + at[1]) * ALONG + at[0]];
            }
            if (end) four(m, q[0], q[3], q[2], q[1]);
            else four(m, q[0], q[1], q[2], q[3]);
        }
}

static int of_box(mesh *m, const box *b, const depthmap *maps, int n, const views *s, errmsg *e)
{
    int *number = malloc(ALONG * ALONG * ALONG * sizeof *number);

    if (!number) return err_set(e, "no memory for a mesh");
    if (room_for(m, ALONG * ALONG * ALONG, 6 * 2 * PARTS * PARTS, e)) {
        free(number);
        return -1;
    }
    for (int k = 0; k < ALONG * ALONG * ALONG; k++) {
        const int at[3] = {k % ALONG, k / ALONG % ALONG, k / ALONG / ALONG};
        number[k] = -1;
        if (!on_outside(at)) continue;
        number[k] = m->n;
        box_vertex(&m->v[m->n++], b, at, maps, n, s);
    }
    for (int axis = 0; axis < 3; axis++) box_face(m, number, axis, 0), box_face(m, number, axis, 1);
    free(number);
    return 0;
}

/* ---- a shell ---- */

static void shell_vertex(corner3 *v, const shell *h, int column, int row, const views *s)
{
    const int k = row * h->columns + column;
    const double near = fmax((double)h->near[k], 1e-4 / s->size);
    double d[3], p[3];

    shell_direction(d, h, column, row);
    v3_add(p, h->c, 1 / near, d);
    views_to_scene(v->at, s, p);
    v->error = fmin(1, (double)h->error[k] / near), v->closed = h->closed[k];
}

/* Below the horizon nothing was measured: walls go straight down to a floor. */
static void close_below(mesh *m, const shell *h, int last, const views *s)
{
    const int C = h->columns, first = m->n;

    for (int x = 0; x <= C; x++) {
        corner3 *v = &m->v[m->n++];
        double p[3];
        if (x < C) memcpy(v->at, m->v[last + x].at, sizeof v->at);
        else views_to_scene(v->at, s, h->c);
        for (int c = 0; c < 3; c++) p[c] = v->at[c];
        v3_add(v->at, p, -s->reach, s->axes[2]);
        v->closed = 1, v->error = 1;
    }
    for (int x = 0; x < C; x++) {
        const int x1 = (x + 1) % C;
        four(m, last + x, last + x1, first + x1, first + x);
        triangle(m, first + x, first + x1, first + C);
    }
}

static int of_shell(mesh *m, const shell *h, const views *s, errmsg *e)
{
    const int C = h->columns, whole = h->polar_max > 3.1, rings = whole ? h->rows - 2 : h->rows - 1;

    if (room_for(m, (rings + 3) * C + 3, 2 * C * (rings + 3), e)) return -1;
    shell_vertex(&m->v[m->n++], h, 0, 0, s);
    for (int y = 1; y <= rings; y++)
        for (int x = 0; x < C; x++) shell_vertex(&m->v[m->n++], h, x, y, s);
    for (int x = 0; x < C; x++) triangle(m, 0, 1 + (x + 1) % C, 1 + x);
    for (int y = 1; y < rings; y++)
        for (int x = 0; x < C; x++) {
            const int a = 1 + (y - 1) * C, x1 = (x + 1) % C;
            four(m, a + x, a + x1, a + C + x1, a + C + x);
        }
    const int last = 1 + (rings - 1) * C;
    if (!whole) close_below(m, h, last, s);
    else {
        shell_vertex(&m->v[m->n], h, 0, h->rows - 1, s);
        for (int x = 0; x < C; x++) triangle(m, last + x, last + (x + 1) % C, m->n);
        m->n++;
    }
    return 0;
}

int mesh_make(mesh *m, const surface *f, const depthmap *maps, int n, const views *s, errmsg *e)
{
    return f->kind == SURFACE_BOX ? of_box(m, f->box, maps, n, s, e) : of_shell(m, f->shell, s, e);
}
