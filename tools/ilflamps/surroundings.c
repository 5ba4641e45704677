/*
 * surroundings.c - how far away the room's walls are, as seen from the plane's middle.
 */
#include "surroundings.h"

#include <errno.h>
#include <math.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "vec.h"

extern char **environ;

enum { COLUMNS = 192, ROWS = 48 };
static const double pi = 3.14159265358979323846;

static int make(surroundings *s, const lightfield *f, errmsg *e)
{
    memset(s, 0, sizeof *s);
    s->nt = COLUMNS, s->np = ROWS;
    s->centre[0] = f->len_u / 2, s->centre[1] = f->len_v / 2;
    s->far = malloc(COLUMNS * ROWS * sizeof *s->far);
    return s->far ? 0 : err_set(e, "no memory for the surroundings");
}

void surroundings_free(surroundings *s)
{
    free(s->far);
    s->far = NULL;
}

/* Directions of the map's nodes: columns round, rows from the pole to the horizon (both ends included). */
static void node(double d[3], int k)
{
    const double t = 2 * pi * (k % COLUMNS) / COLUMNS - pi,
                 p = pi / 2 * fmin(k / COLUMNS, ROWS - 1.02) / (ROWS - 1);

    d[0] = sin(p) * cos(t), d[1] = sin(p) * sin(t), d[2] = cos(p);
}

void surroundings_meet(double x[3], const surroundings *s, const double o[3], const double d[3])
{
    double t = 0, e[3];

    for (int round = 0; round < 6; round++) {
        for (int c = 0; c < 3; c++) x[c] = o[c] + t * d[c], e[c] = x[c] - s->centre[c];
        const double far = v_len(e), use = far > 1e-9;
        const double *g = use > 0 ? e : d;
        const double px = (atan2(g[1], g[0]) + pi) / (2 * pi) * COLUMNS, r = hypot(g[0], g[1]);
        const double py = fmin(atan2(r, fmax(0, g[2])) / (pi / 2) * (ROWS - 1), ROWS - 1.001),
                     a = px - floor(px), b = py - floor(py);
        const int i = (int)px % COLUMNS, i1 = (i + 1) % COLUMNS, j = (int)py;
        const double R =
            (1 - b) * ((1 - a) * (double)s->far[j * COLUMNS + i] + a * (double)s->far[j * COLUMNS + i1]) +
            b * ((1 - a) * (double)s->far[(j + 1) * COLUMNS + i] +
                 a * (double)s->far[(j + 1) * COLUMNS + i1]);
        t += R - far;
    }
    for (int c = 0; c < 3; c++) x[c] = o[c] + t * d[c];
}

/* Rays out, distances back, through files: rtrace may be slow to read what it is slow to answer. */
static int run_rtrace(FILE *in, FILE *out, const char *what, const char *octree, errmsg *e)
{
    char *argv[] = {"rtrace", "-h", "-w", "-fdf", (char *)what, "-ab", "0", (char *)octree, NULL};
    posix_spawn_file_actions_t acts;
    pid_t pid;
    int status, r;

    posix_spawn_file_actions_init(&acts);
    posix_spawn_file_actions_adddup2(&acts, fileno(in), 0);
    posix_spawn_file_actions_adddup2(&acts, fileno(out), 1);
    r = posix_spawnp(&pid, argv[0], &acts, NULL, argv, environ);
    posix_spawn_file_actions_destroy(&acts);
    if (r) {
        errno = r;
        return err_errno(e, "rtrace");
    }
    while (waitpid(pid, &status, 0) < 0)
        if (errno != EINTR) return err_errno(e, "rtrace");
    return status ? err_set(e, "%s: rtrace can't trace rays in it", octree) : 0;
}

/* Rays (six doubles each) through rtrace; what it answers, `each` floats a ray, as `what` (-o...) says. */
int surroundings_rtrace(float *got, int each, const char *what, const double *rays, int n, const char *octree,
                        errmsg *e)
{
    FILE *in = tmpfile(), *out = tmpfile();
    const size_t all = (size_t)n * (size_t)each;
    int bad = in && out ? 0 : err_errno(e, "temporary file");

    if (!bad &&
        (fwrite(rays, 6 * sizeof *rays, (size_t)n, in) != (size_t)n || fflush(in) || fseek(in, 0, SEEK_SET)))
        bad = err_errno(e, "temporary file");
    if (!bad) bad = run_rtrace(in, out, what, octree, e);
    if (!bad && (fseek(out, 0, SEEK_SET) || fread(got, sizeof *got, all, out) != all))
        bad = err_set(e, "%s: expected rtrace to answer %d rays, found fewer answers", octree, n);
    if (in) fclose(in);
    if (out) fclose(out);
    return bad;
}

int surroundings_from(surroundings *s, const char *octree, const lightfield *f, errmsg *e)
{
    double *rays = malloc(COLUMNS * ROWS * 6 * sizeof *rays);
    const ilf_frame *fr = &f->frame;
    int bad = make(s, f, e);

    if (!bad && !rays) bad = err_set(e, "no memory for the surroundings");
    for (int k = 0; k < COLUMNS * ROWS && !bad; k++) {
        double d[3], *r = rays + 6 * k;
        node(d, k);
        for (int c = 0; c < 3; c++) {
            r[c] =
                fr->origin[c] + s->centre[0] * fr->u[c] + s->centre[1] * fr->v[c] + 1e-4 * f->size * fr->n[c];
            r[3 + c] = d[0] * fr->u[c] + d[1] * fr->v[c] + d[2] * fr->n[c];
        }
    }
    if (!bad) bad = surroundings_rtrace(s->far, 1, "-oL", rays, COLUMNS * ROWS, octree, e);
    for (int k = 0; k < COLUMNS * ROWS && !bad; k++)
        if (!(s->far[k] > 0) || s->far[k] > 1e6f * (float)f->size) s->far[k] = 1e3f * (float)f->size;
    free(rays);
    s->measured = 1;
    if (bad) surroundings_free(s);
    return bad;
}

static void box_map(surroundings *s, const double b[5])
{
    for (int k = 0; k < COLUMNS * ROWS; k++) {
        double d[3], t = 1e30;
        node(d, k);
        for (int c = 0; c < 2; c++)
            if (d[c] != 0) t = fmin(t, (b[2 * c + (d[c] > 0)] - s->centre[c]) / d[c]);
        if (d[2] > 0) t = fmin(t, b[4] / d[2]);
        s->far[k] = (float)t;
    }
}

/* Mean mismatch of pairs of pictures: log luminance, large ones bounded. */
static double mismatch(surroundings *s, const double b[5], const lightfield *f)
{
    double sum = 0;
    int n = 0;

    box_map(s, b);
    for (int k = 0; k < 600; k++) {
        const double z = (k + .5) / 600 * .9 + .08, r = sqrt(1 - z * z), t = 2.399963 * k;
        const double d[3] = {r * cos(t), r * sin(t), z};
        const int i = (k * 7) % f->n, j = (i + f->n / 2 + k % 3 * f->nu + 1) % f->n;
        double x[3], e[3], px, py, qx, qy;
        surroundings_meet(x, s, f->pos[i], d);
        v_sub(e, x, f->pos[j]);
        lf_place(&px, &py, f, i, d), lf_place(&qx, &qy, f, j, e);
        sum += fmin(.3, fabs(log(fmax(1e-9, lf_look(f, i, px, py)) / fmax(1e-9, lf_look(f, j, qx, qy))))),
            n++;
    }
    return sum / n;
}

int surroundings_guess(surroundings *s, const lightfield *f, errmsg *e)
{
    const double z = f->size, x = f->len_u / 2, y = f->len_v / 2;
    double best = 1e30, b[5], span = .35;

    if (make(s, f, e)) return -1;
    for (int k = 0; k < 7; k++) {
        const double r = z * 1.2 * pow(1.35, k), t[5] = {x - r, x + r, y - r, y + r, r};
        const double m = mismatch(s, t, f);
        if (m < best) best = m, memcpy(b, t, sizeof b);
    }
    for (int round = 0; round < 14; round++, span *= .8)
        for (int k = 0; k < 5; k++)
            for (int side = -1; side <= 1; side += 2) {
                double t[5];
                memcpy(t, b, sizeof t);
                const double mid = k < 2 ? x : k < 4 ? y : 0;
                t[k] = mid + (t[k] - mid) * (1 + side * span);
                const double m = mismatch(s, t, f);
                if (m < best) best = m, memcpy(b, t, sizeof b);
            }
    box_map(s, b);
    memcpy(s->box, b, sizeof b), s->box[5] = best;
    return 0;
}
