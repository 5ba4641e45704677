/*
 * surface.c - the auxiliary geometry that the page offers.
 */
#include "surface.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/cli.h"
#include "ilflamps/surroundings.h"

int surface_parse(surface_given *g, const char *words, errmsg *e)
{
    double *v = g->at;

    memset(g, 0, sizeof *g);
    if (!strcmp(words, "none")) return 0;
    if (!strncmp(words, "sphere ", 7) && !cli_parse_doubles(v, 4, words + 7, " ", e) && v[3] > 0) {
        g->kind = SURFACE_SPHERE;
        return 0;
    }
    if (!strncmp(words, "box ", 4) && !cli_parse_doubles(v, 6, words + 4, " ", e) && v[0] < v[3] &&
        v[1] < v[4] && v[2] < v[5]) {
        g->kind = SURFACE_BOX;
        return 0;
    }
    return err_set(
        e,
        "expected none, \"sphere X Y Z RADIUS\" or \"box X0 Y0 Z0 X1 Y1 Z1\" (lowest corner first), "
        "found \"%s\"",
        words);
}

void surface_far(surface *s)
{
    memset(s, 0, sizeof *s);
    snprintf(s->words, sizeof s->words, "infinitely far away");
}

/* Column by column: what one step along an axis of the field is along the scene's. */
static void scaled_axes(surface *s, const ilf_frame *f, const double half[3])
{
    for (int k = 0; k < 3; k++) {
        s->M[k][0] = f->u[k] / half[k];
        s->M[k][1] = f->v[k] / half[k];
        s->M[k][2] = f->n[k] / half[k];
    }
}

void surface_place(surface *s, const surface_given *g, const ilf_frame *f)
{
    const double *v = g->at, r = v[3];
    double mid[3], half[3] = {r, r, r};

    surface_far(s);
    s->kind = g->kind;
    if (g->kind == SURFACE_FAR) return;
    for (int k = 0; k < 3; k++) {
        mid[k] = v[k] - f->origin[k];
        if (g->kind == SURFACE_BOX)
            mid[k] = (v[k] + v[3 + k]) / 2 - f->origin[k], half[k] = (v[3 + k] - v[k]) / 2;
    }
    for (int k = 0; k < 3; k++) {
        s->centre[0] += mid[k] * f->u[k];
        s->centre[1] += mid[k] * f->v[k];
        s->centre[2] += mid[k] * f->n[k];
    }
    scaled_axes(s, f, half);
    if (g->kind == SURFACE_SPHERE) snprintf(s->words, sizeof s->words, "sphere of radius %.4g (given)", r);
    else
        snprintf(s->words, sizeof s->words, "box of %.4g x %.4g x %.4g (given)", 2 * half[0], 2 * half[1],
                 2 * half[2]);
}

int surface_guess(surface *s, double *mismatch, const lightfield *f, errmsg *e)
{
    surroundings around;

    if (surroundings_guess(&around, f, e)) return -1;
    const double *b = around.box;
    const double low[3] = {b[0], b[2], -b[4]}, high[3] = {b[1], b[3], b[4]};
    surface_far(s);
    s->kind = SURFACE_BOX;
    for (int k = 0; k < 3; k++) {
        s->centre[k] = (low[k] + high[k]) / 2;
        s->M[k][k] = 2 / (high[k] - low[k]);
    }
    snprintf(s->words, sizeof s->words, "box of %.3g x %.3g, %.3g high (estimated)", high[0] - low[0],
             high[1] - low[1], high[2]);
    *mismatch = b[5];
    surroundings_free(&around);
    return 0;
}

void surface_sphere(surface *s, const surface *box, const lightfield *f)
{
    const double r = box ? cbrt(1 / (box->M[0][0] * box->M[1][1] * box->M[2][2])) : 4 * f->size;

    surface_far(s);
    s->kind = SURFACE_SPHERE;
    s->centre[0] = f->len_u / 2, s->centre[1] = f->len_v / 2;
    for (int k = 0; k < 3; k++) s->M[k][k] = 1 / r;
    snprintf(s->words, sizeof s->words, "sphere of radius %.3g (assumed)", r);
}
