/*
 * report.c - what was found and how sure it is, as JSON: positions in the scene's coordinates, lengths in its unit, angles in degrees.
 */
#include "report.h"

#include <stdio.h>
#include <stdlib.h>

#include "base/outfile.h"
#include "vec3.h"

static const double pi = 3.14159265358979323846;
static const char *const SIDES[] = {"-x", "+x", "-y", "+y", "-z", "+z"};
enum { SECTORS = 12, BANDS = 3 };

static void text(FILE *o, const char *s)
{
    fputc('"', o);
    for (; *s; s++)
        if (*s == '"' || *s == '\\') fprintf(o, "\\%c", *s);
        else if ((unsigned char)*s < 32) fprintf(o, "\\u%04x", (unsigned)*s);
        else fputc(*s, o);
    fputc('"', o);
}

/* A triangle's middle in working coordinates from the middle of the positions, its solid angle about, and its error. */
static double seen_from_middle(double p[3], double *error, const mesh *m, int k, const views *s)
{
    double a[3], b[3], n[3], q[3][3], centre[3];

    views_to_scene(centre, s, s->centre);
    *error = 0, p[0] = p[1] = p[2] = 0;
    for (int c = 0; c < 3; c++) {
        double x[3];
        v3_add(x, m->v[m->t[k][c]].at, -1, centre);
        v3_into(q[c], s->axes, x);
        v3_add(p, p, 1. / 3, q[c]);
        *error += m->v[m->t[k][c]].error / 3;
    }
    v3_add(a, q[1], -1, q[0]), v3_add(b, q[2], -1, q[0]);
    n[0] = a[1] * b[2] - a[2] * b[1], n[1] = a[2] * b[0] - a[0] * b[2], n[2] = a[0] * b[1] - a[1] * b[0];
    return .5 * fabs(v3_dot(n, p)) / pow(v3_len(p) + 1e-12, 3);
}

typedef struct piece {
    double error, sr;
} piece;

static int compare(const void *a, const void *b)
{
    const piece *x = a, *y = b;

    return (x->error > y->error) - (x->error < y->error);
}

/* Of pieces (sorted here): where a share of their solid angle has no larger error. */
static double quantile(piece *p, int n, double share)
{
    double all = 0, sum = 0;

    qsort(p, (size_t)n, sizeof *p, compare);
    for (int k = 0; k < n; k++) all += p[k].sr;
    for (int k = 0; k < n; k++) {
        sum += p[k].sr;
        if (sum >= share * all) return p[k].error;
    }
    return 0;
}

void report_certainty(certainty *c, const mesh *m, const views *s)
{
    piece *p = malloc((size_t)m->triangles * sizeof *p);
    double all = 1e-30, measured = 0;
    int n = 0;

    *c = (certainty){0, 0, 0};
    for (int k = 0; k < m->triangles && p; k++) {
        double at[3], error;
        const double sr = seen_from_middle(at, &error, m, k, s);
        if (!s->below && at[2] < 0) continue;
        all += sr;
        if (mesh_is_closed(m, k)) continue;
        measured += sr, p[n++] = (piece){error, sr};
    }
    if (p && n) *c = (certainty){measured / all, quantile(p, n, .5), quantile(p, n, .9)};
    free(p);
}

static void place(FILE *o, const char *name, const views *s, const double p[3], int point)
{
    double x[3];

    if (point) views_to_scene(x, s, p);
    else v3_back(x, s->axes, p);
    fprintf(o, "\"%s\": [%.6g, %.6g, %.6g]", name, x[0], x[1], x[2]);
}

static void the_box(FILE *o, const process *q)
{
    const box *b = &q->b;

    if (!b->fitted) {
        fprintf(o, "  \"box\": null,\n");
        return;
    }
    fprintf(o, "  \"box\": {");
    place(o, "from", &q->s, b->c, 1), fprintf(o, ", ");
    place(o, "x", &q->s, b->axis[0], 0), fprintf(o, ", ");
    place(o, "y", &q->s, b->axis[1], 0), fprintf(o, ", ");
    place(o, "z", &q->s, b->axis[2], 0);
    fprintf(o,
            ",\n    \"explains\": %.4f, \"things_before_it\": %.4f, \"nearest_thing\": %.4g, \"sides\": [\n",
            b->explains, q->things, q->thing);
    for (int k = 0; k < 6; k++) {
        fprintf(o, "      {\"side\": \"%s\", \"seen\": %s, \"distance\": %.6g, ", SIDES[k],
                b->seen[k] ? "true" : "false", b->side[k]);
        if (b->error[k] > 0) fprintf(o, "\"error\": %.3g}%s\n", b->error[k], k < 5 ? "," : "");
        else fprintf(o, "\"error\": null}%s\n", k < 5 ? "," : "");
    }
    fprintf(o, "    ]},\n");
}

static void the_verdict(FILE *o, const process *q)
{
    fprintf(o, "  \"surface\": \"%s\", \"judged_by_rays\": %d, \"held_out_error\": {", judge_names[q->v.best],
            q->v.rays);
    for (int k = 0, n = 0; k < SURFACES; k++)
        if (q->v.error[k] >= 0) fprintf(o, "%s\"%s\": %.5f", n++ ? ", " : "", judge_names[k], q->v.error[k]);
    fprintf(o, "},\n");
}

/* Elevations in thirds (of the upper half, or of all), azimuths in twelfths: what part of each was measured, and how well. */
static void regions(FILE *o, const process *q)
{
    const double low = q->s.below ? -pi / 2 : 0, high = pi / 2;

    fprintf(o, "  \"regions\": [\n");
    for (int r = 0; r < SECTORS * BANDS; r++) {
        const int band = r / SECTORS, sector = r % SECTORS;
        double all = 1e-30, closed = 0, sum = 0, far = 0;
        for (int k = 0; k < q->m.triangles; k++) {
            double p[3], error;
            const double sr = seen_from_middle(p, &error, &q->m, k, &q->s),
                         up = atan2(p[2], hypot(p[0], p[1]));
            if ((int)fmin(SECTORS - 1, (atan2(p[1], p[0]) + pi) / (2 * pi) * SECTORS) != sector || up < low ||
                (int)fmin(BANDS - 1, (up - low) / (high - low) * BANDS) != band)
                continue;
            all += sr, closed += mesh_is_closed(&q->m, k) ? sr : 0, sum += sr * error, far += sr * v3_len(p);
        }
        fprintf(o,
                "    {\"azimuth\": [%g, %g], \"elevation\": [%g, %g], \"distance\": %.4g, \"error\": %.3g, "
                "\"closed\": %.3f}%s\n",
                sector * 360. / SECTORS - 180, (sector + 1) * 360. / SECTORS - 180,
                180 / pi * (low + (high - low) * band / BANDS),
                180 / pi * (low + (high - low) * (band + 1) / BANDS), far / all, sum / all, closed / all,
                r + 1 < SECTORS * BANDS ? "," : "");
    }
    fprintf(o, "  ],\n");
}

static void the_maps(FILE *o, const process *q)
{
    fprintf(o, "  \"pictures\": [\n");
    for (int k = 0; k < q->s.n; k++) {
        const depthmap *m = &q->maps[k];
        double sure = 0;
        int by_box = 0;
        for (int i = 0; i < m->w * m->h; i++) sure += (double)m->sure[i], by_box += m->from[i] == DEPTH_BOX;
        fprintf(o, "    {\"name\": ");
        text(o, q->s.v[k].name), fprintf(o, ", ");
        place(o, "position", &q->s, q->s.v[k].at, 1);
        fprintf(o, ", \"judges\": %s, \"misfit\": %.4g, \"sure\": %.3f, \"box\": %.3f}%s\n",
                q->held[k] ? "true" : "false", m->fit, sure / (m->w * m->h), (double)by_box / (m->w * m->h),
                k + 1 < q->s.n ? "," : "");
    }
    fprintf(o, "  ]\n");
}

int report_write(const char *path, const char *input, const process *q, errmsg *e)
{
    certainty c;
    outfile *out;

    if (out_begin(&out, path, e)) return -1;
    FILE *o = out_stream(out);
    report_certainty(&c, &q->m, &q->s);
    fprintf(o, "{\n  \"input\": ");
    text(o, input);
    fprintf(o,
            ",\n  \"cells\": [%d, %d], \"levels\": %d, \"nearest_looked_for\": %.4g, \"baseline\": %.4g, "
            "\"cpu_s\": %.2f,\n",
            q->p.w, q->p.h, q->p.levels, 1 / q->p.most, q->s.size, q->cpu_s);
    the_verdict(o, q), the_box(o, q);
    fprintf(o,
            "  \"mesh\": {\"vertices\": %d, \"triangles\": %d, \"measured\": %.4f, \"error_median\": %.4g, "
            "\"error_90\": %.4g},\n",
            q->m.n, q->m.triangles, c.measured, c.median, c.most);
    regions(o, q), the_maps(o, q);
    fprintf(o, "}\n");
    return out_commit(out, e);
}
