/*
 * placing.h - which direction each pixel of the input and of the output is: their charts, as the settings and
 * the picture place them.
 */
#ifndef PLACING_H
#define PLACING_H

#include "base/errmsg.h"
#include "chart.h"
#include "image/image.h"
#include "outcome.h"
#include "settings.h"

/* The chart of the input im, or of the output (im NULL).  The camera's turn is IN's, but where a camera's
 * view is made of a probe or a panorama it is that camera's: so the same options lead there and back. */
int place_chart(chart *c, outcome *o, const settings *s, view_kind kind, const img *im, errmsg *e);

/* A round picture: a fisheye's, a ball's, an angular map. */
int view_is_disc(view_kind kind);

/* That a panorama made with a heading has its zenith where one may not expect it. */
void say_zenith(outcome *o, const settings *s);

/* Take c's camera as the settings turn it (chart.h). */
void turn_chart(chart *c, const settings *s, int mirror);

/* What lies below the camera: pixels within angle (radians) of straight down, as the camera stands unless it is
 * tilted, get alpha 0.  rotate: what a disc's picture must be turned by to stand upright, radians. */
void hide_nadir(float *pix, int *all_good, const chart *c, double rotate, double angle);

/* The camera sees itself in a ball: pixels within the hidden angle (radians) of the axis get alpha 0. */
void hide_camera(float *pix, int *all_good, const chart *c, double angle);

#endif
