/*
 * cfa.h - the colour filters over a sensor's photosites: which colour photosite (x, y) sees.
 */
#ifndef HDRGEN_CFA_H
#define HDRGEN_CFA_H

#include <stdint.h>

enum { CFA_MOST = 16 }; /* sites after which the longest known pattern repeats, either way */

typedef struct cfa {
    int columns, rows; /* of the pattern; 0: every pixel has all its values */
    uint8_t
        colour[CFA_MOST * CFA_MOST]; /* 0 red, 1 green, 2 blue; row by row, (0, 0) the top-left photosite */
} cfa;

static inline int cfa_at(const cfa *f, int x, int y)
{
    return f->colour[y % f->rows * f->columns + x % f->columns];
}

/* Two greens on one diagonal of each 2x2, red and blue on the other. */
static inline int cfa_is_bayer(const cfa *f)
{
    const uint8_t *c = f->colour;
    if (f->columns != 2 || f->rows != 2) return 0;
    return (c[0] == 1 && c[3] == 1 && c[1] + c[2] == 2 && c[1] != 1) ||
           (c[1] == 1 && c[2] == 1 && c[0] + c[3] == 2 && c[0] != 1);
}

#endif
