/*
 * raysfile.c - radiance along rays of a file, by the field as it was and by lamps and residual.
 */
#include "raysfile.h"

#include <stdlib.h>
#include <unistd.h>

#include "base/outfile.h"
#include "programs/field_guard.h"
#include "vec.h"

void rays_add_lamps(float rgb[3], const analysis *a, const double o[3], const double d[3])
{
    const ilf_luminaire *met = NULL;
    double nearest = 1e300, t;

    for (int i = 0; i < a->n; i++)
        if (a->lamps[i].fate == TAKEN && !lamp_is_out(&a->lamps[i].l.s.l) &&
            ilf_luminaire_hit(&t, &a->lamps[i].l.s.l, o, d) && t < nearest)
            nearest = t, met = &a->lamps[i].l.s.l;
    if (!met) return;
    const double pass = ilf_luminaire_pass(met, o, d), left = 1 - fmin(pass, 1);
    for (int c = 0; c < 3; c++) rgb[c] = (float)(pass * (double)met->rgb[c] + left * (double)rgb[c]);
}

static void local(double p[3], const ilf_frame *fr, const double x[3], int point)
{
    double e[3];

    for (int k = 0; k < 3; k++) e[k] = x[k] - (point ? fr->origin[k] : 0);
    p[0] = v_dot(e, fr->u), p[1] = v_dot(e, fr->v), p[2] = v_dot(e, fr->n);
}

static int evaluate(float *out, const double *ray, long n, const ilf *field, const analysis *a, errmsg *e)
{
    int bad = 0;

#pragma omp parallel for schedule(dynamic, 4096)
    for (long i = 0; i < n; i++) {
        const double *r = ray + 9 * i;
        double o[3], d[3];
        ilf_error err;
        if (ilf_eval(out + 3 * i, field, ilf_get_frame(field), r, r + 3, isinf(r[6]) ? NULL : r + 6,
                     ILF_DEPTH, &err) != ILF_OK) {
#pragma omp critical
            bad = err_set(e, "%s", err.text);
        }
        if (!a) continue;
        local(o, &a->f.frame, r, 1), local(d, &a->f.frame, r + 3, 0);
        v_unit(d);
        if (d[2] > 0) rays_add_lamps(out + 3 * i, a, o, d);
    }
    return bad;
}

static double *read_rays(long *n, const char *path, errmsg *e)
{
    FILE *f = fopen(path, "rb");
    double *ray = NULL;
    long bytes = -1;

    if (f && fseek(f, 0, SEEK_END) == 0) bytes = ftell(f);
    *n = bytes / 72;
    if (bytes < 0) err_errno(e, "%s", path);
    else if (bytes % 72) err_set(e, "%s: expected rays of 72 bytes, found %ld bytes", path, bytes);
    else if (!(ray = malloc((size_t)bytes + 1))) err_set(e, "%s: no memory for its rays", path);
    else if (fseek(f, 0, SEEK_SET) || fread(ray, 72, (size_t)*n, f) != (size_t)*n) {
        err_errno(e, "%s", path);
        free(ray), ray = NULL;
    }
    if (f) fclose(f);
    return ray;
}

static int one_field(float *out, const char *path, const double *ray, long n, const analysis *a, errmsg *e)
{
    ilf_error err;
    ilf *field;

    if (field_open(&field, path, &err) != ILF_OK) return err_set(e, "%s", err.text);
    const int bad = evaluate(out, ray, n, field, a, e);
    field_close(field);
    return bad;
}

int rays_evaluate(const char *radiance, const char *rays, const char *input, const analysis *a, errmsg *e)
{
    outfile *residual = NULL, *o = NULL;
    long n;
    double *ray = read_rays(&n, rays, e);
    float *out = ray ? malloc((size_t)n * 6 * sizeof *out + 1) : NULL;
    int bad = ray && out ? 0 : ray ? err_set(e, "%s: no memory for its rays", rays) : -1;

    if (!bad) bad = out_begin(&o, radiance, e);
    if (!bad) bad = out_begin(&residual, "-", e); /* a temporary file, thrown away at the end */
    if (!bad) bad = lf_write(&a->f, out_path(residual), NULL, e);
    if (!bad) bad = one_field(out, input, ray, n, NULL, e);
    if (!bad) bad = one_field(out + 3 * n, out_path(residual), ray, n, a, e);
    if (!bad && fwrite(out, 6 * sizeof *out, (size_t)n, out_stream(o)) != (size_t)n)
        bad = err_errno(e, "%s", radiance);
    out_abort(residual);
    if (bad) out_abort(o);
    else bad = out_commit(o, e);
    free(ray), free(out);
    return bad;
}
