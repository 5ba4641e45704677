/*
 * overlap.h - exact overlap of a polygon with the squares of a pixel grid.
 *
 * For every pixel: area of (pixel and polygon) and its first moments about the pixel's
 * centre, in pixels and y down, by Green's theorem over the polygon's edges cut at the
 * grid lines.  The polygon is the sum of closed contours; overlapping or reversed contours
 * add with sign (positive: clockwise on the screen, where y points down).
 *
 * This is what makes the remap conserve energy: neighbouring texels share their edges, so the
 * areas of a pixel's pieces sum to the pixel (second-order conservative remapping, P. W.
 * Jones, Monthly Weather Review 127, 1999).
 *
 * One overlap is for one thread.  Pure: no I/O.
 */
#ifndef OVERLAP_H
#define OVERLAP_H

typedef struct overlap_cell {
    double area;   /* 0..1 (sign as the contour) */
    double mx, my; /* moments about the pixel centre, |m| <= 1/8 */
} overlap_cell;

typedef struct overlap overlap;

overlap *overlap_new(void); /* NULL: no memory */
void overlap_free(overlap *o);

/* Begin with the pixels [x0, x1) x [y0, y1); parts of the polygon outside are left out.
 * Returns -1 without memory. */
int overlap_begin(overlap *o, int x0, int y0, int x1, int y1);

/* Add a closed contour: n points xy[2*i], xy[2*i+1]; the last joins the first. */
void overlap_contour(overlap *o, const double *xy, int n);

/* Those pixels of row y that the polygon may reach: from *from up to what is returned, exclusive; out holds
 * no more than x1 - x0.  All rows, each once, before the next overlap_begin. */
int overlap_row(overlap_cell *out, int *from, overlap *o, int y);

#endif
