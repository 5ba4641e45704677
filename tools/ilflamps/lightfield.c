/*
 * lightfield.c - a light field in memory, its directions, and its luminance anywhere.
 */
#include "lightfield.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "programs/field_guard.h"

static const double pi = 3.14159265358979323846;

static void set_places(lightfield *f)
{
    for (int j = 0; j < f->nv; j++)
        for (int i = 0; i < f->nu; i++) {
            double *p = f->pos[j * f->nu + i];
            p[0] = f->nu > 1 ? f->len_u * i / (f->nu - 1) : f->len_u / 2;
            p[1] = f->nv > 1 ? f->len_v * j / (f->nv - 1) : f->len_v / 2;
            p[2] = 0;
        }
}

static int read_probes(lightfield *f, const ilf *file, errmsg *e)
{
    ilf_error err;

    for (int k = 0; k < f->n; k++)
        if (ilf_read_probe(lf_texel(f, k, 0, 0), file, k % f->nu, k / f->nu, &err) != ILF_OK)
            return err_set(e, "%s", err.text);
    return 0;
}

int lf_read(lightfield *f, const char *path, errmsg *e)
{
    ilf_error err;
    ilf *file;

    memset(f, 0, sizeof *f);
    if (field_open(&file, path, &err) != ILF_OK) return err_set(e, "%s", err.text);
    f->info = *ilf_get_info(file), f->frame = *ilf_get_frame(file);
    f->nu = f->info.n_u, f->nv = f->info.n_v, f->n = f->nu * f->nv, f->nt = f->info.n_theta,
    f->np = f->info.n_phi;
    f->polar_max = f->info.polar_max, f->dt = 2 * pi / f->nt, f->dp = f->polar_max / f->np;
    f->len_u = f->frame.len_u, f->len_v = f->frame.len_v, f->size = fmax(f->len_u, f->len_v);
    f->pos = malloc((size_t)f->n * sizeof *f->pos);
    f->rgb = malloc((size_t)f->n * (size_t)f->np * (size_t)f->nt * 3 * sizeof *f->rgb);
    int bad = f->pos && f->rgb ? 0 : err_set(e, "%s: no memory for its texels", path);
    if (!bad) bad = read_probes(f, file, e);
    if (!bad && ilf_check_unchanged(file, &err) != ILF_OK) bad = err_set(e, "%s", err.text);
    if (!bad) set_places(f);
    field_close(file);
    if (bad) lf_free(f);
    return bad;
}

void lf_free(lightfield *f)
{
    free(f->pos), free(f->turn), free(f->rgb), free(f->unseen);
    memset(f, 0, sizeof *f);
}

ilf_spec lf_spec(const lightfield *f)
{
    ilf_spec spec = {.n_u = f->nu,
                     .n_v = f->nv,
                     .n_theta = f->nt,
                     .n_phi = f->np,
                     .polar_max = f->polar_max,
                     .type = ILF_FLOAT,
                     .compression = "zip"};

    for (int k = 0; k < 3; k++)
        spec.origin[k] = (double)f->info.origin[k], spec.U[k] = (double)f->info.U[k],
        spec.V[k] = (double)f->info.V[k];
    if (f->info.polar_valid < f->polar_max) spec.polar_valid = f->info.polar_valid;
    return spec;
}

int lf_write_as(const lightfield *f, const char *path, const ilf_spec *spec, errmsg *e)
{
    ilf_writer *w;
    ilf_error err;

    if (ilf_writer_open(&w, path, spec, &err) != ILF_OK) return err_set(e, "%s", err.text);
    for (int k = 0; k < f->n; k++)
        if (ilf_writer_probe(w, lf_texel(f, k, 0, 0), &err) != ILF_OK) {
            ilf_writer_abort(w);
            return err_set(e, "%s", err.text);
        }
    return ilf_writer_close(w, &err) == ILF_OK ? 0 : err_set(e, "%s", err.text);
}

int lf_write(const lightfield *f, const char *path, const char *comments, errmsg *e)
{
    ilf_spec spec = lf_spec(f);

    spec.comments = comments;
    return lf_write_as(f, path, &spec, e);
}

int lf_neighbours(const lightfield *f, int a, int b)
{
    if (!f->free) return abs(a % f->nu - b % f->nu) + abs(a / f->nu - b / f->nu) == 1;
    const double *p = f->pos[a], *q = f->pos[b];
    for (int k = 0; k < f->n; k++) {
        const double *r = f->pos[k];
        if (k != a && k != b && (r[0] - p[0]) * (r[0] - q[0]) + (r[1] - p[1]) * (r[1] - q[1]) < 0) return 0;
    }
    return a != b;
}

void lf_outward(double d[3], const lightfield *f, int probe)
{
    if (!f->turn || probe == LF_FIELD) return;
    const double *t = f->turn[probe], e[3] = {d[0], d[1], d[2]};
    for (int k = 0; k < 3; k++) d[k] = e[0] * t[k] + e[1] * t[3 + k] + e[2] * t[6 + k];
}

void lf_inward(double d[3], const lightfield *f, int probe)
{
    if (!f->turn || probe == LF_FIELD) return;
    const double *t = f->turn[probe], e[3] = {d[0], d[1], d[2]};
    for (int k = 0; k < 3; k++) d[k] = e[0] * t[3 * k] + e[1] * t[3 * k + 1] + e[2] * t[3 * k + 2];
}

void lf_direction(double d[3], const lightfield *f, int probe, double x, double y)
{
    const double t = x * f->dt - pi, p = y * f->dp, s = sin(p);

    d[0] = s * cos(t), d[1] = s * sin(t), d[2] = cos(p);
    lf_outward(d, f, probe);
}

void lf_place(double *x, double *y, const lightfield *f, int probe, const double d[3])
{
    double e[3] = {d[0], d[1], d[2]};

    lf_inward(e, f, probe);
    const double r = sqrt(e[0] * e[0] + e[1] * e[1]);
    *x = (r > 0 ? atan2(e[1], e[0]) + pi : pi) / f->dt;
    *y = atan2(r, e[2]) / f->dp;
}

int lf_common(const lightfield *f, int probe, int texel)
{
    double d[3], x, y;

    if (!f->turn) return texel;
    lf_direction(d, f, probe, texel % f->nt + .5, texel / f->nt + .5);
    lf_place(&x, &y, f, LF_FIELD, d);
    const int i = (int)x % f->nt, j = y < f->np ? (int)y : f->np - 1;
    return j * f->nt + i;
}

double lf_texel_sr(const lightfield *f, int y)
{
    return f->dt * (cos(y * f->dp) - cos((y + 1) * f->dp));
}

int lf_beside(int *x, int *y, const lightfield *f, int dx, int dy)
{
    *x += dx, *y += dy;
    if (*y < 0) *y = -1 - *y, *x += f->nt / 2;
    if (*y >= f->np) return 0;
    *x = ((*x % f->nt) + f->nt) % f->nt;
    return 1;
}

double lf_look(const lightfield *f, int probe, double x, double y)
{
    const double fx = floor(x - .5), fy = floor(y - .5), a = x - .5 - fx, b = y - .5 - fy;
    double sum = 0;

    for (int k = 0; k < 4; k++) {
        int i = (int)fx, j = (int)fy;
        const double w = (k & 1 ? a : 1 - a) * (k & 2 ? b : 1 - b);
        if (j + (k >> 1) >= f->np) j = f->np - 1 - (k >> 1);
        if (w > 0 && lf_beside(&i, &j, f, k & 1, k >> 1)) sum += w * lf_lum(f, probe, i, j);
    }
    return sum;
}
