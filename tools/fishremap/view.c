/*
 * view.c - Radiance's name for a disc that was made, so that what reads a VIEW line knows which pixel is
 * which direction.
 *
 * Of Radiance's views (rvu(1), -vt) three are discs:
 *   a  angular fisheye          r ~ theta              equidistant, angular
 *   h  hemispherical fisheye    r ~ sin(theta)         orthographic
 *   s  planisphere              r ~ tan(theta/2)       stereographic
 * -vh and -vv are the angles across the whole picture, beyond the circle too where it is not square.
 * Directions are the plane's: x, y, z of the VIEW line are u, v, n.
 */
#include "view.h"

#include <math.h>
#include <stdio.h>

#define DEG (M_PI / 180)

/* The angle across `extent` radii of half-angle half, degrees; NaN beyond what the view can hold. */
static double across(char type, double half, double extent)
{
    switch (type) {
    case 'a': return extent * half / DEG <= 180 * (1 + 1e-12) ? 2 * extent * half / DEG : NAN;
    case 'h': return 2 * asin(extent * sin(half)) / DEG; /* NaN beyond 1 */
    default: return 4 * atan(extent * tan(half / 2)) / DEG;
    }
}

int radiance_view(char *text, size_t room, const chart *c, view_kind kind)
{
    char type = 0;
    text[0] = 0;
    if (c->kind != CHART_DISC || kind == VIEW_BALL) return -1;
    if (c->lens.kind == LENS_EQUIDISTANT) type = 'a';
    if (c->lens.kind == LENS_ORTHOGRAPHIC) type = 'h';
    if (c->lens.kind == LENS_STEREOGRAPHIC) type = 's';
    if (!type) return -1;
    double vh = across(type, c->lens.half, c->width / 2. / c->radius),
           vv = across(type, c->lens.half, c->height / 2. / c->radius);
    if (!(vh > 0) || !(vv > 0)) return -1;
    const double(*f)[3] = c->frame;
    snprintf(
        text, room,
        " -vt%c -vp 0 0 0 -vd %.9g %.9g %.9g -vu %.9g %.9g %.9g -vh %.9g -vv %.9g -vo 0 -va 0 -vs 0 -vl 0",
        type, f[2][0] + 0., f[2][1] + 0., f[2][2] + 0., f[1][0] + 0., f[1][1] + 0., f[1][2] + 0., vh, vv);
    return 0;
}
