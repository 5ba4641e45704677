/*
 * ballrim.h - from a circle near a mirror ball's rim to the rim.  Pure.
 *
 * A ball's reflections have circles of their own, inside of the rim: the rim is the outermost at which the
 * picture changes.
 */
#ifndef BALLRIM_H
#define BALLRIM_H

#include "rim.h"

/* c: x, y, radius, pixels of the level (the radius best between 60 and 200 of them); moved by up to 7 % of
 * the radius. */
void ball_rim(double c[3], const rim_level *l);

/* A picture that has been cut to the ball (as wide and as high as the ball within 1.5 %, and the ball in its
 * middle) holds the whole of it: c, in pixels of a picture of w x h, is moved and made smaller to lie inside.
 * 1 if it is such a picture. */
int ball_cut_out(double c[3], int w, int h);

#endif
