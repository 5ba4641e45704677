/*
 * views.c - the pictures that depth comes from.
 */
#include "views.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "programs/field_guard.h"
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
    const int i = v->slot % s->nu, j = v->slot / s->nu;
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

/* "I,J I,J ...": each once, within the grid. */
static int named_probes(views *s, const char *chosen, char *take, errmsg *e)
{
    for (const char *p = chosen; *p;) {
        int i, j, used = 0;
        if (sscanf(p, " %d,%d%n", &i, &j, &used) < 2 || !used || i < 0 || j < 0 || i >= s->nu || j >= s->nv)
            return err_set(e, "--probes: expected I,J within the grid of %d x %d, found \"%.40s\"", s->nu,
                           s->nv, p);
        take[j * s->nu + i] = 1;
        for (p += used; *p == ' ';) p++;
    }
    return 0;
}

/* About as many as asked for, in rows and columns that keep the edges. */
static void spread_probes(const views *s, int most, char *take)
{
    int a = s->nu, b = s->nv;

    while (a * b > most && a * b > 4) {
        if (a >= b) a--;
        else b--;
    }
    for (int j = 0; j < b; j++)
        for (int i = 0; i < a; i++) {
            const int u = a > 1 ? (int)((double)i * (s->nu - 1) / (a - 1) + .5) : s->nu / 2;
            const int v = b > 1 ? (int)((double)j * (s->nv - 1) / (b - 1) + .5) : s->nv / 2;
            take[v * s->nu + u] = 1;
        }
}

static int choose_probes(views *s, const char *chosen, char *take, errmsg *e)
{
    char *end = NULL;
    const long many = chosen ? strtol(chosen, &end, 10) : 64;

    if (chosen && *end) return named_probes(s, chosen, take, e);
    if (many < 2 || many > 4096)
        return err_set(e, "--probes: expected 2 to 4096, or I,J I,J ..., found \"%.40s\"", chosen);
    spread_probes(s, (int)many, take);
    return 0;
}

static int take_probes(views *s, const char *chosen, errmsg *e)
{
    const ilf_info *info = ilf_get_info(s->file);
    const int all = s->nu * s->nv;
    char *take = calloc((size_t)all, 1);
    int bad;

    s->v = calloc((size_t)all, sizeof *s->v);
    bad =
        take && s->v ? choose_probes(s, chosen, take, e) : err_set(e, "%s: no memory", ilf_get_path(s->file));
    for (int k = 0; k < all && !bad; k++) {
        if (!take[k]) continue;
        s->v[s->n].slot = k;
        bad = one_probe(s, s->n++, e);
        if (!bad) cut_rows(&s->v[s->n - 1], info->polar_valid);
    }
    free(take);
    if (!bad && s->n < 2)
        bad = err_set(e, "%s: expected two probes or more, found %d", ilf_get_path(s->file), s->n);
    return bad;
}

int views_of_field(views *s, const char *path, const char *chosen, errmsg *e)
{
    ilf_error err;

    memset(s, 0, sizeof *s);
    if (field_open(&s->file, path, &err) != ILF_OK) return err_set(e, "%s", err.text);
    const ilf_frame *f = ilf_get_frame(s->file);
    s->nu = ilf_get_info(s->file)->n_u, s->nv = ilf_get_info(s->file)->n_v;
    if (take_probes(s, chosen, e)) {
        views_free(s);
        return -1;
    }
    measure(s);
    s->reach = hypot(f->len_u, f->len_v) / 2;
    for (int c = 0; c < 3; c++)
        s->origin[c] = f->origin[c], s->axes[0][c] = f->u[c], s->axes[1][c] = f->v[c],
        s->axes[2][c] = f->n[c];
    s->lamps = ilf_get_luminaires(&s->n_lamps, s->file);
    return 0;
}

int views_unchanged(const views *s, errmsg *e)
{
    ilf_error err;

    return s->file && ilf_check_unchanged(s->file, &err) != ILF_OK ? err_set(e, "%s", err.text) : 0;
}

void views_free(views *s)
{
    for (int k = 0; s->v && k < s->n; k++) free(s->v[k].rgb), free(s->v[k].feature);
    free(s->v);
    field_close(s->file);
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
