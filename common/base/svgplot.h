/*
 * svgplot.h - a plot as an SVG picture: two axes with ticks, numbers and labels, lines, bands and dots.
 *
 * Numbers are given in the axes' units; (from, from) is the lower left corner.  What lies outside is cut off.
 */
#ifndef SVGPLOT_H
#define SVGPLOT_H

#include "errmsg.h"

typedef struct svgplot svgplot;

typedef struct svgplot_axis {
    double from, to, step; /* a tick and its number each step, from the first multiple of it on */
    const char *label;
} svgplot_axis;

/* Begin a picture at path (outfile.h), whose name ends in .svg.  title stands above.  The labels' and title's
 * characters are ASCII, none of < > &.  -1 with words. */
int svgplot_begin(svgplot **p, const char *path, const svgplot_axis *x, const svgplot_axis *y,
                  const char *title, errmsg *e);

/* colour: as in SVG.  A line through n points (x, y), broken where one is not finite. */
void svgplot_line(svgplot *p, const char *colour, const double (*at)[2], int n);

/* Between low and high over n places x, pale. */
void svgplot_band(svgplot *p, const char *colour, const double *x, const double *low, const double *high,
                  int n);

/* Dots, of 3 units or (small) 1. */
typedef enum svgplot_dot { SVGPLOT_FULL, SVGPLOT_HOLLOW, SVGPLOT_SMALL } svgplot_dot;
void svgplot_dots(svgplot *p, const char *colour, const double (*at)[2], int n, svgplot_dot kind);

/* Frees p in every case; the file is whole, or not there: -1. */
int svgplot_end(svgplot *p, errmsg *e);

#endif
