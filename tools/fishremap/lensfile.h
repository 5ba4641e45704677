/*
 * lensfile.h - a lens by name or from a file.
 *
 * A lens file has one model ("#" begins a comment):
 *
 *   model NAME                              equidistant, equisolid, stereographic or orthographic
 *   polynomial c1 c2 c3 ...                 r = c1 t + c2 t^2 + ..., t in radians; any scale
 *   kannala-brandt k1 k2 k3 k4              r = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8): OpenCV's
 *                                           fisheye model, with its camera matrix if wanted:
 *   camera fx fy cx cy                      pixels, OpenCV's (0,0) in the middle of the first pixel
 *   table                                   then lines DEG R, angles growing; any scale
 *   fov DEG                                 field of view, if --fov is not given
 */
#ifndef LENSFILE_H
#define LENSFILE_H

#include "errmsg.h"
#include "lens.h"

/* spec: a model's name or a file's path.  fov_deg: full field of view in degrees, or 0 to take the
 * file's.  The lens is finished (lens_finish). */
int lens_read(lens *l, const char *spec, double fov_deg, errmsg *e);

#endif
