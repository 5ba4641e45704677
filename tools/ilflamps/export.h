/*
 * export.h - lamps and what is left for other programs: which file, by its ending.
 *
 *   .usda   lights of UsdLux, what is left as a dome (exportusd.h)
 *   .rad    lights of a Radiance without our patches (exportrad.h)
 *   .json   every number of the lamps (exportjson.h)
 */
#ifndef EXPORT_H
#define EXPORT_H

#include "lookround.h"

/* Is it a file that can be written?  -1 with words where not. */
int export_check(const char *path, errmsg *e);

/* Write it, and beside it what it needs, by the same name with other endings.  What the target has no words for is
 * left out, with a remark (remark.h).  line: the command line, for comments. */
int export_write(const char *path, const analysis *a, const viewpoint *v, const char *line, errmsg *e);

/* What hides lamp l and was left out, in words: "lamp 2: a sheet"; appended to text.  A mask of which keeps() says 1
 * was not. */
void export_left_out(char *text, size_t room, int number, const ilf_luminaire *l,
                     int (*keeps)(const ilf_mask *m, const ilf_luminaire *l));

#endif
