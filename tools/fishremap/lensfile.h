/*
 * lensfile.h - a lens by name or from a file.
 *
 * A calibration as another program wrote it (calibration.h), or a lens file of our own, one model ("#" begins
 * a comment):
 *
 *   model NAME                              equidistant, equisolid, stereographic or orthographic
 *   polynomial c1 c2 c3 ...                 r = c1 t + c2 t^2 + ..., t in radians; any scale
 *   kannala-brandt k1 k2 k3 k4              r = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8): OpenCV's
 *                                           fisheye model, with its camera matrix if wanted:
 *   camera fx fy cx cy [skew]               pixels, OpenCV's (0,0) in the middle of the first pixel
 *   size W H                                of the picture that the camera matrix was made for
 *   table                                   then lines DEG R, angles growing; any scale
 *   fov DEG                                 field of view, if --fov is not given
 *
 * A camera matrix is for pictures of one size.  If that is stated, other sizes of the same aspect scale it
 * and others are refused; else the picture is taken to have it, if the principal point is near enough to its
 * middle, and that is said.
 */
#ifndef LENSFILE_H
#define LENSFILE_H

#include "base/errmsg.h"
#include "lens.h"

/* What the lens is for.  Zero: nothing known. */
typedef struct lens_use {
    double fov_deg;    /* full field of view, or 0: the file's, or with a camera matrix as far as picture and
                          model go */
    int width, height; /* the picture's, or 0 */
    int placed;        /* the circle's radius is given: a camera matrix's focal length does not count */
    const double *centre; /* in pixels, instead of the camera matrix's, or NULL */
} lens_use;

/* spec: a model's name or a file's path, for one of several cameras PATH@NAME.  The lens is finished
 * (lens_finish).  said: what had to be assumed, or "". */
int lens_read_for(lens *l, char said[512], const char *spec, const lens_use *use, errmsg *e);

/* Without a picture. */
int lens_read(lens *l, const char *spec, double fov_deg, errmsg *e);

#endif
