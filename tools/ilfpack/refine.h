/*
 * refine.h - are the given poses true?  They are compared with what the pictures agree on (poses.h), and
 * corrected where that clearly helps or is asked for.
 */
#ifndef REFINE_H
#define REFINE_H

#include "poses.h"
#include "suspects.h"

typedef enum refining { REFINE_AUTO, REFINE_ALWAYS, REFINE_NEVER } refining;

enum { REFINE_MOST = 200 }; /* pictures; with more, poses stay as given */

typedef struct refined {
    int tried, applied;
    suspects wrong; /* lines that can't be true */
    poses found;    /* corrections that were made, or would have been */
    double shift, turn,
        gain; /* their rms: scene's unit (three numbers of a place together), radians, relative */
} refined;

/* Refine the poses (and with them the gains) of a field of free pictures; lines that can't be true are put
 * right before, but for REFINE_NEVER.  at: places as given, kept as the field has them. */
int refine(refined *r, lightfield *f, place *at, char *const *pictures, const char *octree, refining how,
           errmsg *e);
void refined_free(refined *r);

#endif
