/*
 * chart.h - pictures of the sphere of directions: which pixel shows which direction.
 *
 * Directions are unit vectors in the plane frame (u, v, n): d = (d.u, d.v, d.n), pointing from
 * the plane towards the light.  Picture positions are pixels, (0,0) the top-left corner, x to
 * the right, y down, pixel centres at +1/2.
 *
 * Two families.  A DISC is what a lens or a mirror sphere makes: angle from the axis by a lens
 * model, azimuth as seen.
 *
 *        up                 A camera that looks along +n with +v up has +u to its left; a mirror
 *     +v |                  sphere seen from above (along -n, +v up) has +u to the right, and a
 *   +u --+   fisheye        point of its picture at azimuth psi shows light from azimuth psi.
 *
 * A GRID is a rectangle in (longitude, polar angle): a light field's probe, with the pole at
 * the top, or a panorama (latlong) whose middle is n and whose top is v, seen from within as a camera sees
 * it: +u to the left.
 *
 * These are the places of a chart that nothing turns.  chart_turn() and chart_face() turn the frame of any
 * chart as they would turn the camera; so all charts but the mirror sphere's picture are of one handedness,
 * and any two of them, by way of directions, are a rotation apart and never a reflection.
 */
#ifndef CHART_H
#define CHART_H

#include "lens.h"

typedef enum chart_kind { CHART_DISC, CHART_GRID } chart_kind;

typedef struct chart {
    chart_kind kind;
    int width, height;  /* pixels */
    double frame[3][3]; /* rows: the chart's right, up (towards azimuth 90) and axis, in (u, v, n) */
    /* disc */
    lens lens;
    double cx, cy, radius; /* pixels; radius at field angle lens.half, to the right where shape is not 1 */
    double shape[2][2]; /* (right, up) offset in pixels = radius shape (r cos psi, r sin psi): the lens's own,
                           or 1 */
    double unshape[2][2]; /* its inverse */
    /* grid: azimuth = lon0 + x lon_span/width about the axis, counted from right to up;
     * polar angle = polar_min + y (polar_max - polar_min)/height */
    double lon0, lon_span, polar_min, polar_max;
} chart;

/* A disc as a fisheye looking along n sees it (mirror = 0) or as a mirror sphere seen
 * from above shows it (mirror = 1), turned as by chart_turn().  The lens's shape counts. */
void chart_disc(chart *c, int width, int height, const lens *l, double cx, double cy, double radius,
                int mirror, double rotate, double tilt, double tilt_to);

/* A light field's probe: azimuth -pi..pi from left to right, polar angle 0..polar_max down. */
void chart_probe(chart *c, int width, int height, double polar_max);

/* Part of a panorama, n in the middle of the whole, v up: longitudes from lon0 (left; 0 is n, growing to the
 * picture's right, -u) over span, polar angles about v from top to bottom.  The whole: -pi, 2 pi, 0, pi. */
void chart_latlong(chart *c, int width, int height, double lon0, double span, double top, double bottom);

/* Grid: polar angle of a pixel's height, where the poles lie (pixels from the upper edge; outside of the
 * picture where it does not reach them), and whether it shows every direction. */
double chart_row_step(const chart *c);
double chart_pole(const chart *c, int lower);
int chart_whole(const chart *c);

/* Turn an unturned chart's frame as the camera stood.  Its picture is turned counter-clockwise as seen by
 * rotate, radians, before it is read; then its axis (disc), or middle (latlong), or pole (probe) leans by
 * tilt from n towards the picture's azimuth tilt_to, counter-clockwise from right, as seen; 90 degrees: the
 * top of the picture. Of a probe "the picture" is what a camera along n sees: +v up, +u to the left.  mirror:
 * +u is to the right. */
void chart_turn(chart *c, int mirror, double rotate, double tilt, double tilt_to);

/* Then stand the camera up: what was along n comes to lie in the plane at azimuth heading (radians, from u to
 * v), what was along v comes to lie along n. */
void chart_face(chart *c, double heading);

/* Position in a disc, in its radius and without its shape: *x right, *y up, 1 = the rim. */
void chart_disc_place(double *x, double *y, const chart *c, double px, double py);

/* Square pixels that a disc's place of 1 x 1 has. */
double chart_disc_scale(const chart *c);

/* Direction -> position.  Disc: directions beyond the field come to lie on the rim, at their
 * azimuth, and the result is 0; else 1.  Grid: x may be any of its periods. */
int chart_project(double xy[2], const chart *c, const double d[3]);

/* Position -> unit direction.  Positions outside a disc are taken to the rim (result 0). */
int chart_unproject(double d[3], const chart *c, double x, double y);

/* Solid angle of pixel (x, y) in steradians: exact for a grid, by the Jacobian at the centre for a
 * disc (0 outside it). */
double chart_pixel_solid_angle(const chart *c, int x, int y);

#endif
