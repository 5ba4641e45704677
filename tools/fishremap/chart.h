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
 * A GRID is a rectangle in (longitude, polar angle): the contract's probe, with the pole at
 * the top, or a world map (latlong) whose middle is n.
 */
#ifndef CHART_H
#define CHART_H

#include "lens.h"

typedef enum chart_kind { CHART_DISC, CHART_GRID } chart_kind;

typedef struct chart {
    chart_kind kind;
    int width, height;      /* pixels */
    double frame[3][3];     /* rows: the chart's right, up (towards azimuth 90) and axis, in (u, v, n) */
    /* disc */
    lens lens;
    double cx, cy, radius;  /* pixels; radius at field angle lens.half */
    /* grid: azimuth = lon0 + x lon_span/width about the axis, counted from right to up;
     * polar angle = y polar_max/height */
    double lon0, lon_span, polar_max;
} chart;

/* A disc as a fisheye looking along n sees it (mirror = 0) or as a mirror sphere seen
 * from above shows it (mirror = 1).  rotate turns the picture counter-clockwise as seen,
 * in radians, before it is read; then the axis leans by tilt from n towards the picture's
 * azimuth tilt_to (counter-clockwise from right, as seen; 90 degrees: the top of the picture). */
void chart_disc(chart *c, int width, int height, const lens *l, double cx, double cy, double radius,
                int mirror, double rotate, double tilt, double tilt_to);

/* The contract's probe: azimuth -pi..pi from left to right, polar angle 0..polar_max down. */
void chart_probe(chart *c, int width, int height, double polar_max);

/* A world map: n in the middle, v up, longitude growing to the picture's right over span;
 * right is -u as in a camera picture (mirror = 0) or +u (mirror = 1). */
void chart_latlong(chart *c, int width, int height, double span, int mirror);

/* Direction -> position.  Disc: directions beyond the field come to lie on the rim, at their
 * azimuth, and the result is 0; else 1.  Grid: x may be any of its periods. */
int chart_project(double xy[2], const chart *c, const double d[3]);

/* Position -> unit direction.  Positions outside a disc are taken to the rim (result 0). */
int chart_unproject(double d[3], const chart *c, double x, double y);

/* Solid angle of pixel (x, y) in steradians: exact for a grid, by the Jacobian at the centre for a
 * disc (0 outside it). */
double chart_pixel_solid_angle(const chart *c, int x, int y);

#endif
