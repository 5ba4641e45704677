/*
 * content.h - what the page holds of one light field: numbers in the order that its script reads them.
 *
 * Probes are halves times 2^scale, R G B side by side, rows from the pole, and after each probe's texels two
 * more: the mean of its first row (the pole's value) and of its last (the lower pole's, where the probe is a
 * whole sphere).  Nothing is clipped: the scale is such that the largest value fits.
 */
#ifndef VIEW_CONTENT_H
#define VIEW_CONTENT_H

#include <stdint.h>

#include "surface.h"

enum { VIEW_ROW = 24 }; /* floats of a lamp or a mask, as FORMAT.md has them */

typedef struct content {
    const char *name;
    lightfield field;
    ilf *file;                  /* open for its lamps */
    const ilf_luminaire *lamps; /* of file */
    int n_lamps, n_masks;
    int nt, np;       /* texels of a probe in the page */
    int scale;        /* log2 */
    uint16_t *texels; /* n probes of (nt*np + 2)*3 */
    float *lamp_rows; /* n_lamps; number 20: its first mask's index */
    float *mask_rows; /* n_masks; number 20: where its picture begins */
    float *pictures;  /* n_pictures samples */
    int64_t n_pictures;
    double picture_factor; /* pictures' sides were divided by it */
    float *irradiance;     /* of the probes, n*3 */
    float *lamp_light;     /* on the plane, ex*ey*3; none without lamps */
    int ex, ey;
    surface surfaces[4]; /* the first is the one to begin with */
    int n_surfaces;
} content;

/* Read a file and prepare it so that it takes at most `bytes` in the page, if not NULL with geometry as given.
 * What is assumed is noted.  *c is the caller's until content_free. */
int content_read(content *c, const char *path, double bytes, const surface_given *given, errmsg *e);
void content_free(content *c);

#endif
