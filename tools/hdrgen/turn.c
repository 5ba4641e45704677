/*
 * turn.c - see turn.h.  One plane at a time, so that one copy of the largest is all that is needed.
 */
#include "turn.h"

#include <stdlib.h>
#include <string.h>

typedef struct turned {
    int w, h;                    /* as stored */
    int columns, flip_x, flip_y; /* rows become columns; then from the right, from the bottom */
} turned;

static turned turned_by(int orientation, int w, int h)
{
    turned t = {w, h, orientation > 4, 0, 0};
    t.flip_x = orientation == 2 || orientation == 3 || orientation == 6 || orientation == 7;
    t.flip_y = orientation == 3 || orientation == 4 || orientation == 7 || orientation == 8;
    return t;
}

/* `size` bytes a pixel. */
static int turn_plane(void **plane, size_t size, const turned *t, errmsg *e)
{
    size_t w = (size_t)t->w, h = (size_t)t->h, ow = t->columns ? h : w, oh = t->columns ? w : h;
    const char *from = *plane;
    char *to = malloc(w * h * size);
    if (!to) return err_set(e, "out of memory for %dx%d pixels", t->w, t->h);
#pragma omp parallel for schedule(static)
    for (size_t y = 0; y < oh; y++)
        for (size_t x = 0; x < ow; x++) {
            size_t px = t->flip_x ? ow - 1 - x : x, py = t->flip_y ? oh - 1 - y : y;
            size_t at = t->columns ? px * w + py : py * w + px;
            memcpy(to + (y * ow + x) * size, from + at * size, size);
        }
    free(*plane);
    *plane = to;
    return 0;
}

int turn_picture(img *im, float **sigma, uint8_t **flags, uint8_t **count, int orientation, errmsg *e)
{
    turned t = turned_by(orientation, im->info.width, im->info.height);
    size_t pixel = (size_t)im->info.channels * sizeof *im->pix;
    if (orientation < 2 || orientation > 8) return 0;
    void *pix = im->pix, *sd = sigma ? *sigma : NULL, *fl = flags ? *flags : NULL,
         *co = count ? *count : NULL;
    int bad = turn_plane(&pix, pixel, &t, e) || (sd && turn_plane(&sd, pixel, &t, e)) ||
              (fl && turn_plane(&fl, 1, &t, e)) || (co && turn_plane(&co, 1, &t, e));
    im->pix = pix;
    if (sigma) *sigma = sd;
    if (flags) *flags = fl;
    if (count) *count = co;
    if (!bad && t.columns) {
        im->info.width = t.h;
        im->info.height = t.w;
    }
    return bad ? -1 : 0;
}
