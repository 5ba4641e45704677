/*
 * freereport.c - see freereport.h.
 */
#include "freereport.h"

#include <math.h>
#include <stdio.h>

#include "base/outfile.h"
#include "ilflamps/report.h"

static void numbers(FILE *o, const char *name, const double *v, int n)
{
    fprintf(o, "\"%s\": [", name);
    for (int k = 0; k < n; k++) fprintf(o, "%s%.8g", k ? ", " : "", v[k]);
    fprintf(o, "]");
}

/* What refining found of a picture: place and turn (about u, v and the normal) with standard errors; gain: how
 * much too bright it was. */
static void corrections(FILE *o, const pose *p)
{
    const double deg = 180 / 3.14159265358979323846;
    double turn[3], sigma[3];

    for (int c = 0; c < 3; c++) turn[c] = deg * p->change[3 + c], sigma[c] = deg * p->sigma[3 + c];
    fprintf(o, ", "), numbers(o, "moved", p->change, 3);
    fprintf(o, ", "), numbers(o, "moved_error", p->sigma, 3);
    fprintf(o, ", "), numbers(o, "turned", turn, 3);
    fprintf(o, ", "), numbers(o, "turned_error", sigma, 3);
    fprintf(o, ", \"gain\": %.6g, \"gain_error\": %.3g", exp(p->change[6]), p->sigma[6]);
}

static void pictures(FILE *o, const freefacts *f)
{
    fprintf(o, "  \"pictures\": [\n");
    for (int k = 0; k < f->n; k++) {
        const place *p = &f->at[k];
        const double angles[3] = {p->heading, p->pitch, p->roll};
        fprintf(o, "    {\"picture\": ");
        report_text(o, f->pictures[k]);
        fprintf(o, ", \"line\": %d, ", p->line);
        numbers(o, "position", p->at, 3);
        fprintf(o, ", ");
        numbers(o, "angles", angles, 3);
        if (f->poses->tried) corrections(o, &f->poses->found.p[k]);
        fprintf(o, k + 1 < f->n ? "},\n" : "}\n");
    }
    fprintf(o, "  ],\n");
}

static void refining_of(FILE *o, const refined *r)
{
    fprintf(o, "  \"refined\": %s", r->applied ? "true" : "false");
    if (r->tried)
        fprintf(o,
                ", \"disagreement_as_given\": %.4g, \"disagreement_refined\": %.4g, \"lamps_seen\": %d, "
                "\"sightings\": %d, \"wall_points\": %d, \"crease_points\": %d",
                r->found.before, r->found.after, r->found.lamps, r->found.sightings, r->found.points,
                r->found.edges);
    fprintf(o, ",\n  \"wrong_lines\": [");
    for (int k = 0; k < r->wrong.n; k++) {
        fprintf(o, k ? ", " : "");
        report_text(o, r->wrong.s[k].words);
    }
    fprintf(o, "],\n");
}

static void grid(FILE *o, const freefacts *f)
{
    fprintf(o, "  \"grid\": [%d, %d], ", f->n_u, f->n_v);
    numbers(o, "plane", f->plane, 9);
    fprintf(o, ",\n  \"nodes\": [\n");
    for (int k = 0; k < f->n_u * f->n_v; k++)
        fprintf(o, "    {\"node\": [%d, %d], \"nearest\": %.4g, \"error\": %.4g}%s\n", k % f->n_u, k / f->n_u,
                f->nodes[k].nearest, f->nodes[k].error, k + 1 < f->n_u * f->n_v ? "," : "");
    fprintf(o, "  ],\n");
}

int freereport_write(const char *path, const freefacts *f, const analysis *a, errmsg *e)
{
    outfile *out;

    if (out_begin(&out, path, e)) return -1;
    FILE *o = out_stream(out);
    fprintf(o, "{\n  \"positions\": ");
    report_text(o, f->positions);
    fprintf(o, ",\n");
    refining_of(o, f->poses);
    pictures(o, f);
    grid(o, f);
    report_lamps(o, a);
    fprintf(o, "}\n");
    return out_commit(out, e);
}
