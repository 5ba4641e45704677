/*
 * panorama.h - which directions a latlong picture shows and how its camera stood: as the options say, else as
 * the picture states, else all of them.
 */
#ifndef PANORAMA_H
#define PANORAMA_H

#include "base/errmsg.h"
#include "chart.h"
#include "image/image.h"
#include "outcome.h"
#include "settings.h"

/* The unturned chart of w x h pixels, of the input im or of the output (im NULL). */
int panorama_place(chart *c, outcome *o, const settings *s, const img *im, int w, int h, errmsg *e);

/* --pose stated: *t gets s with heading, tilt and rotate as the input im says; what it leaves open is 0 (north is
 * v), and said.  Without --pose what is stated and not used is said. */
int panorama_pose(settings *t, outcome *o, const settings *s, const img *im, errmsg *e);

#endif
