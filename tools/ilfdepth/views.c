/*
 * views.c - the pictures that depth comes from.
 */
#include "views.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "vec3.h"

static const double pi = 3.14159265358979323846;

static void measure(views *s)
{
    for (int k = 0; k < s->n; k++) {
        v3_add(s->centre, s->centre, 1. / s->n, s->v[k].at);
        if (s->v[k].polar_max > .55 * pi) s->below = 1;
        for (int i = 0; i < k; i++) {
            double b[3];
            v3_add(b, s->v[k].at, -1, s->v[i].at);
            s->size = fmax(s->size, v3_len(b));
        }
    }
    s->reach = s->size / 2;
}

static int one_probe(views *s, int k, errmsg *e)
{
    const ilf_info *info = ilf_get_info(s->file);
    const ilf_frame *f = ilf_get_frame(s->file);
    view *v = &s->v[k];
    const int i = k % s->nu, j = k / s->nu;
    ilf_error err;

    snprintf(v->name, sizeof v->name, "probe %d,%d", i, j);
    for (int c = 0; c < 3; c++) v->axis[c][c] = 1;
    v->at[0] = s->nu > 1 ? f->len_u * i / (s->nu - 1) : f->len_u / 2;
    v->at[1] = s->nv > 1 ? f->len_v * j / (s->nv - 1) : f->len_v / 2;
    v->nt = info->n_theta, v->np = info->n_phi, v->polar_max = info->polar_max;
    v->rgb = malloc((size_t)v->nt * (size_t)v->np * 3 * sizeof *v->rgb);
    if (!v->rgb) return err_set(e, "%s: no memory for its texels", ilf_get_path(s->file));
    return ilf_read_probe(v->rgb, s->file, i, j, &err) == ILF_OK ? 0 : err_set(e, "%s", err.text);
}

/* Rows beyond polarValid hold nothing that was measured. */
static void cut_rows(view *v, double valid)
{
    const int rows = (int)floor(valid / v->polar_max * v->np + 1e-6);

    if (rows >= 1 && rows < v->np) v->polar_max *= (double)rows / v->np, v->np = rows;
}

int views_of_field(views *s, const char *path, errmsg *e)
{
    ilf_error err;
    int bad = 0;

    memset(s, 0, sizeof *s);
    if (ilf_open(&s->file, path, &err) != ILF_OK) return err_set(e, "%s", err.text);
    const ilf_info *info = ilf_get_info(s->file);
    const ilf_frame *f = ilf_get_frame(s->file);
    s->nu = info->n_u, s->nv = info->n_v, s->n = s->nu * s->nv;
    s->v = calloc((size_t)s->n, sizeof *s->v);
    if (!s->v) bad = err_set(e, "%s: no memory for its probes", path);
    for (int k = 0; k < s->n && !bad; k++) {
        bad = one_probe(s, k, e);
        if (!bad) cut_rows(&s->v[k], info->polar_valid);
    }
    if (bad) {
        views_free(s);
        return -1;
    }
    measure(s);
    s->reach = hypot(f->len_u, f->len_v) / 2;
    for (int c = 0; c < 3; c++)
        s->origin[c] = f->origin[c], s->axes[0][c] = f->u[c], s->axes[1][c] = f->v[c], s->axes[2][c] = f->n[c];
    s->lamps = ilf_get_luminaires(&s->n_lamps, s->file);
    return 0;
}

void views_free(views *s)
{
    for (int k = 0; s->v && k < s->n; k++) free(s->v[k].rgb), free(s->v[k].feature);
    free(s->v);
    ilf_close(s->file);
    memset(s, 0, sizeof *s);
}

void views_to_scene(double x[3], const views *s, const double p[3])
{
    v3_back(x, s->axes, p);
    v3_add(x, x, 1, s->origin);
}

void view_direction(double d[3], const view *v, int nt, int np, double x, double y)
{
    const double t = x * 2 * pi / nt - pi, p = y * v->polar_max / np, s = sin(p);
    const double own[3] = {s * cos(t), s * sin(t), cos(p)};

    v3_back(d, v->axis, own);
}
