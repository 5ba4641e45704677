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
 *   from-first r11 r12 ... r33              of a second camera: turns the first one's coordinates to its own
 *                                           (x right, y down, z ahead), as OpenCV's and Kalibr's rotations do
 *   [NAME]                                  begins one of several cameras
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
    /* Two circles in one picture: */
    int camera;    /* 1, 2: which one, where the file has two and no name is given */
    int inscribed; /* without a field of view, to the nearest edge of the picture and not its corner */
    const double
        *of_whole; /* this picture's left and top in a larger one, and that one's width and height, for
                                which the camera matrix may be as well; or NULL */
} lens_use;

/* spec: a model's name or a file's path, for one of several cameras PATH@NAME.  The lens is finished
 * (lens_finish).  said: what had to be assumed, or "". */
int lens_read_for(lens *l, char said[512], const char *spec, const lens_use *use, errmsg *e);

/* Without a picture. */
int lens_read(lens *l, const char *spec, double fov_deg, errmsg *e);

#endif
