/*
 * poses.h - where pictures really stood, how they were turned, and how bright each was taken: least squares
 * over all of them at once.
 *
 * What they should agree on: the luminance of points on the walls, the places of creases (landmarks.h), and
 * the directions of lamps that they see whole. Unknown: three numbers of place, three of turn and a gain for
 * each picture, each lamp's place, and the box, if there is no octree.  The given poses count as measured to
 * the sigmas of poseplan: what the pictures can't say (a common shift, where walls have no creases) stays as
 * given.
 */
#ifndef POSES_H
#define POSES_H

#include "landmarks.h"
#include "views.h"

enum { POSE = 7 }; /* place, turn (radians about the field's axes), log gain */

typedef struct poseplan {
    double place, turn, gain; /* standard errors of what is given: scene's unit, radians, relative */
    const double *heading; /* of each picture: that of its turn about the vertical, or NULL: as the others */
} poseplan;

typedef struct pose {
    double change[POSE]; /* in all, since the poses were given; gain: log of how much too bright it is */
    double sigma[POSE];  /* standard errors */
    double differs;      /* from the others, log luminance of walls' points, when all was done */
} pose;

typedef struct poses {
    pose *p;              /* n of the field */
    double before, after; /* rms misfit of all that is measured, in its standard errors */
    int lamps, sightings; /* beacons */
    int points, edges;    /* of walls, and sightings of creases, that took part */
} poses;

/* Solve.  f: v->f, whose places and turns are set to the result (not its texels: poses_expose does that). */
int poses_solve(poses *out, lightfield *f, const views *v, landmarks *l, const poseplan *plan, errmsg *e);
void poses_free(poses *p);

/* Take the gains out of the texels. */
void poses_expose(lightfield *f, const poses *p);

#endif
