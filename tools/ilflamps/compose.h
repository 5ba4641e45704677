/*
 * compose.h - lamps and what is left, as a light field of version 1.
 */
#ifndef COMPOSE_H
#define COMPOSE_H

#include "analysis.h"

/* nu x nv probes on the input's plane; lamps become texels that are means over their area, behind what hides
 * them. */
int compose_write(const char *path, const analysis *a, int nu, int nv, const char *comments, errmsg *e);

/* The same with a file's whole spec (its grid, sizes of probes as the analysis' field). */
int compose_write_as(const char *path, const analysis *a, const ilf_spec *spec, errmsg *e);

#endif
