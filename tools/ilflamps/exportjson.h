/*
 * exportjson.h - every number of the lamps, as JSON: enough to evaluate them by docs/FORMAT.md, section 2.7.
 */
#ifndef EXPORTJSON_H
#define EXPORTJSON_H

#include "lookround.h"

/* Lamps that were taken out, with their units, in the scene's coordinates and in their own. */
int exportjson_write(const char *path, const analysis *a, const viewpoint *v, const char *line, errmsg *e);

#endif
