/*
 * surface.h - the auxiliary geometry that the page offers: spheres and boxes, in the field's own coordinates.
 *
 * A surface is a map to the unit ball or the cube [-1, 1]^3: X -> M (X - centre), so that a box may lie any
 * way round.
 */
#ifndef VIEW_SURFACE_H
#define VIEW_SURFACE_H

#include "base/errmsg.h"
#include "ilflamps/lightfield.h"

typedef enum surface_kind { SURFACE_FAR, SURFACE_SPHERE, SURFACE_BOX } surface_kind;

typedef struct surface {
    surface_kind kind;
    double centre[3];
    double M[3][3];  /* rows */
    char words[128]; /* for a menu */
} surface;

/* As somebody wrote it: "none", "sphere X Y Z R" or "box X0 Y0 Z0 X1 Y1 Z1", in the scene's coordinates. */
typedef struct surface_given {
    surface_kind kind;
    double at[6];
} surface_given;

int surface_parse(surface_given *g, const char *words, errmsg *e);

/* It in the field's own coordinates. */
void surface_place(surface *s, const surface_given *g, const ilf_frame *frame);

/* No geometry: infinitely far away. */
void surface_far(surface *s);

/* A box estimated from the probes (of several probes only), how far their pictures of its points differ
 * still (mean log) to *mismatch. */
int surface_guess(surface *s, double *mismatch, const lightfield *f, errmsg *e);

/* A sphere around the plane's middle: as large as the box, or four times the plane's longer edge. */
void surface_sphere(surface *s, const surface *box, const lightfield *f);

#endif
