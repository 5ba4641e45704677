/*
 * lookround.c - what is left in the probes, as one picture from one place.
 */
#include "lookround.h"

#include "vec.h"

enum { LEAST_ROWS = 128, MOST_ROWS = 2048 };
/* Mean log mismatch of the probes' pictures of a wall from which on its guessed distance says nothing. */
#define GUESSED_WELL .2

static const double pi = 3.14159265358979323846;

void look_to_scene(double x[3], const ilf_frame *f, const double p[3], int point)
{
    for (int k = 0; k < 3; k++)
        x[k] = (point ? f->origin[k] : 0) + p[0] * f->u[k] + p[1] * f->v[k] + p[2] * f->n[k];
}

static void to_field(double p[3], const ilf_frame *f, const double x[3], int point)
{
    double e[3];

    for (int k = 0; k < 3; k++) e[k] = x[k] - (point ? f->origin[k] : 0);
    p[0] = v_dot(e, f->u), p[1] = v_dot(e, f->v), p[2] = v_dot(e, f->n);
}

void look_from_middle(double at[3], const lightfield *f)
{
    const double middle[3] = {f->len_u / 2, f->len_v / 2, 0};

    look_to_scene(at, &f->frame, middle, 1);
}

int look_rows(const lightfield *f)
{
    return (int)fmin(MOST_ROWS, fmax(LEAST_ROWS, ceil(f->np * pi / f->polar_max)));
}

static int distances_known(const surroundings *s)
{
    return s->far && (s->measured || s->box[5] < GUESSED_WELL);
}

/* Where a ray from the place meets the surroundings; 0 where they are not known, or it looks down. */
static int meets(double hit[3], const analysis *a, const double o[3], const double d[3])
{
    double p[3], q[3], x[3];

    to_field(p, &a->f.frame, o, 1), to_field(q, &a->f.frame, d, 0);
    if (!distances_known(&a->around) || q[2] <= 1e-6) return 0;
    surroundings_meet(x, &a->around, p, q);
    look_to_scene(hit, &a->f.frame, x, 1);
    return 1;
}

int look_round(img *im, const ilf *residual, const analysis *a, const viewpoint *v, look_dir *dir, errmsg *e)
{
    double d[3], hit[3];
    ilf_error err;

    for (int y = 0; y < im->info.height; y++)
        for (int x = 0; x < im->info.width; x++) {
            float *rgb = im->pix + 3 * ((size_t)y * (size_t)im->info.width + (size_t)x);
            dir(d, x, y, im, &a->f.frame);
            const double *h = meets(hit, a, v->at, d) ? hit : NULL;
            if (ilf_eval(rgb, residual, ilf_get_frame(residual), v->at, d, h, ILF_DEPTH, &err) != ILF_OK)
                return err_set(e, "%s", err.text);
        }
    return 0;
}
