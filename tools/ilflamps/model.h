/*
 * model.h - hypotheses of what hides or shapes a lamp, and how they are judged.
 *
 * A model is a chain of masks.  It is fitted five times: without each fourth of the probes, and with all of
 * them.  Its error is that of rows (lamp.h) of probes that had no part in the fit, so every part of a chain
 * keeps its five versions: nothing leaks from one link to the next.
 */
#ifndef MODEL_H
#define MODEL_H

#include <math.h>

#include "lamp.h"

enum { MODEL_MASKS = 12, ALL = FOLDS }; /* fold number ALL: fitted to all probes */

typedef struct model {
    char name[96];                      /* for people */
    int n;                              /* masks */
    ilf_mask m[FOLDS + 1][MODEL_MASKS]; /* grids owned */
    double error;                       /* rms over left-out rows, shares as weights */
    double blind;                       /* error that rows can't show */
    int saw;                            /* it has seen in the pictures what hides the lamp */
    int shaped;                         /* a beam or gate is among the masks: a lamp has one at most */
    double height;                      /* of what hides the lamp, where that means something; else 0 */
} model;

/* What a row of the lamp would measure behind these masks. */
double model_row(const row *r, const lamp *l, const lightfield *f, const ilf_mask *masks, int n);

/* Set error from left-out rows. */
void model_judge(model *m, const lamp *l, const lightfield *f);

/* Lines along which hypotheses are compared where no probe stands: from place k, between the probes and up to
 * .3 sizes of the plane above them, to one of LAMP_POINTS points of the lamp.  0 if place k is above it. */
enum { PLACES = 15 * 15 * 3, LAMP_POINTS = 5 };
int model_place(double o[3], int k, const lamp *l, const lightfield *f);
void model_line(double d[3], const double o[3], int point, const lamp *l);

/* How far the folds' versions part from that of all probes at those places, as a standard error of
 * the latter (jackknife). */
double model_spread(const model *m, const lamp *l, const lightfield *f);

/* Error by all that is known. */
static inline double model_doubt(const model *m)
{
    return hypot(m->error, m->blind);
}

/* A model's deep copy, and its end. */
int model_copy(model *to, const model *from);
void model_free(model *m);

/* Bytes of a mask's pictures. */
size_t mask_bytes(const ilf_mask *m);

/* A picture for a mask: zeroed grid, or -1. */
int mask_grid(ilf_mask *m, int nx, int ny, double x0, double y0, double x1, double y1);

#endif
