/*
 * compose.c - lamps and what is left, as a light field of version 1.
 */
#include "compose.h"

#include <stdlib.h>
#include <string.h>

#include "base/outfile.h"
#include "raysfile.h"
#include "vec.h"

enum { RAYS = 8 }; /* a side of texels that may show a lamp */

static void to_scene(double x[3], const ilf_frame *f, const double p[3], int point)
{
    for (int k = 0; k < 3; k++)
        x[k] = (point ? f->origin[k] : 0) + p[0] * f->u[k] + p[1] * f->v[k] + p[2] * f->n[k];
}

/* What is left, seen from a place of the plane: towards where the ray meets the surroundings, where those are
 * known. */
static int left_over(float rgb[3], const ilf *residual, const analysis *a, const double o[3],
                     const double d[3], ilf_error *err)
{
    double so[3], sd[3], sh[3], h[3];

    to_scene(so, &a->f.frame, o, 1), to_scene(sd, &a->f.frame, d, 0);
    if (a->around.far) surroundings_meet(h, &a->around, o, d), to_scene(sh, &a->f.frame, h, 1);
    return ilf_eval(rgb, residual, ilf_get_frame(residual), so, sd, a->around.far ? sh : NULL, ILF_DEPTH,
                    err) == ILF_OK
               ? 0
               : -1;
}

/* 1 if the texel may show a lamp. */
static int near_lamp(const analysis *a, const double o[3], const double d[3])
{
    const double half = .75 * hypot(a->f.dp, a->f.dt);

    for (int i = 0; i < a->n; i++) {
        const ilf_luminaire *l = &a->lamps[i].l.s.l;
        double e[3];
        if (a->lamps[i].fate != TAKEN) continue;
        v_sub(e, l->centre, o);
        v_unit(e);
        if (v_dot(e, d) > cos(fmin(3, ilf_luminaire_cone(l, o) + half))) return 1;
    }
    return 0;
}

static void with_lamps(float *rgb, const analysis *a, const double o[3], int x, int y)
{
    double sum[3] = {0, 0, 0}, all = 0;

    for (int k = 0; k < RAYS * RAYS; k++) {
        const double py = y + (k / RAYS + .5) / RAYS, w = sin(py * a->f.dp);
        float v[3];
        double d[3];
        lf_direction(d, &a->f, LF_FIELD, x + (k % RAYS + .5) / RAYS, py);
        memcpy(v, rgb, sizeof v);
        if (d[2] > 0) rays_add_lamps(v, a, o, d);
        for (int c = 0; c < 3; c++) sum[c] += w * (double)v[c];
        all += w;
    }
    for (int c = 0; c < 3; c++) rgb[c] = (float)(sum[c] / all);
}

static int probe(float *out, const ilf *residual, const analysis *a, const double o[3], int same, errmsg *e)
{
    int bad = 0;

#pragma omp parallel for schedule(dynamic, 64)
    for (int k = 0; k < a->f.nt * a->f.np; k++) {
        double d[3];
        ilf_error err;
        float *t = out + 3 * k;
        lf_direction(d, &a->f, LF_FIELD, k % a->f.nt + .5, k / a->f.nt + .5);
        if (same >= 0) memcpy(t, lf_texel(&a->f, same, k % a->f.nt, k / a->f.nt), 3 * sizeof *t);
        else if (left_over(t, residual, a, o, d, &err)) {
#pragma omp critical
            bad = err_set(e, "%s", err.text);
        }
        if (near_lamp(a, o, d)) with_lamps(t, a, o, k % a->f.nt, k / a->f.nt);
    }
    return bad;
}

static int all_probes(ilf_writer *w, const ilf *residual, const analysis *a, int nu, int nv, errmsg *e)
{
    float *out = malloc((size_t)a->f.nt * (size_t)a->f.np * 3 * sizeof *out);
    ilf_error err;
    int bad = out ? 0 : err_set(e, "no memory for a probe");

    for (int k = 0; k < nu * nv && !bad; k++) {
        const double o[3] = {nu > 1 ? a->f.len_u * (k % nu) / (nu - 1) : a->f.len_u / 2,
                             nv > 1 ? a->f.len_v * (k / nu) / (nv - 1) : a->f.len_v / 2, 0};
        bad = probe(out, residual, a, o, nu == a->f.nu && nv == a->f.nv ? k : -1, e);
        if (!bad && ilf_writer_probe(w, out, &err) != ILF_OK) bad = err_set(e, "%s", err.text);
    }
    free(out);
    return bad;
}

int compose_write_as(const char *path, const analysis *a, const ilf_spec *spec, errmsg *e)
{
    outfile *o = NULL, *temporary = NULL;
    ilf *residual = NULL;
    ilf_writer *w = NULL;
    ilf_error err;
    int bad = out_begin(&o, path, e) || out_begin(&temporary, "-", e) ||
              lf_write(&a->f, out_path(temporary), NULL, e);

    if (!bad && (ilf_open(&residual, out_path(temporary), &err) != ILF_OK ||
                 ilf_writer_open(&w, out_path(o), spec, &err) != ILF_OK))
        bad = err_set(e, "%s", err.text);
    if (!bad) bad = all_probes(w, residual, a, spec->n_u, spec->n_v, e);
    if (w && bad) ilf_writer_abort(w);
    else if (w && ilf_writer_close(w, &err) != ILF_OK) bad = err_set(e, "%s", err.text);
    ilf_close(residual);
    out_abort(temporary);
    if (bad) out_abort(o);
    return bad ? -1 : out_commit(o, e);
}

int compose_write(const char *path, const analysis *a, int nu, int nv, const char *comments, errmsg *e)
{
    ilf_spec spec = lf_spec(&a->f);

    spec.n_u = nu, spec.n_v = nv, spec.comments = comments, spec.name = path;
    return compose_write_as(path, a, &spec, e);
}
