/*
 * exportrad.h - lamps and what is left for Radiance programs without our patches.
 */
#ifndef EXPORTRAD_H
#define EXPORTRAD_H

#include "lookround.h"

/* Write to the folder dir, which is made if need be and named in the files as given:
 *   lamps.rad, lamps.cal, mask.K.dat   lamps as `light`, behind patterns of the ray
 *   panorama.rad, residual.hdr         what is left, seen from v->at, infinitely far away
 *   residual.ilf.exr                   what is left, as a light field of version 1
 * Masks that are no pattern of Radiance's are left out, with a remark (remark.h). */
int exportrad_write(const char *dir, const analysis *a, const viewpoint *v, const char *line, errmsg *e);

/* The same as NAME.rad, lamps and panorama in one file; the others lie beside it: NAME.lamps.cal and so on. */
int exportrad_file(const char *path, const analysis *a, const viewpoint *v, const char *line, errmsg *e);

#endif
