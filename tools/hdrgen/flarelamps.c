/*
 * flarelamps.c - lamps told apart and dealt out to two groups (flare.h).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "flare.h"
#include "vision/spread.h"

enum { MOST_LAMPS = 64 };
static const double half_of_light = 0.5; /* the brightest pixels that hold so much of it are lamps' */
static const double lamp_floor = 0.02;   /* of the brightest: nothing below is a lamp's */
static const double lamp_edge = 0.3;     /* of the least of those: a lamp reaches as far as this */
static const double apart = 0.04;        /* of the diagonal: lamps nearer than twice that are one */

static int brighter_first(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return x < y ? 1 : x > y ? -1 : 0;
}

/* The brightest pixels that hold half of the light, but none below 2 % of the brightest; 0.3 of the least. */
static int lamp_level(double *level, const float *light, size_t n, errmsg *e)
{
    float *v = malloc(n * sizeof *v);
    double all = 0, sum = 0;
    size_t i = 0;
    if (!v) return err_set(e, "flare: out of memory");
    memcpy(v, light, n * sizeof *v);
    qsort(v, n, sizeof *v, brighter_first);
    for (size_t k = 0; k < n; k++) all += (double)v[k];
    for (; i + 1 < n && sum + (double)v[i] < half_of_light * all; i++) sum += (double)v[i];
    *level = lamp_edge * fmax((double)v[i], lamp_floor * (double)v[0]);
    free(v);
    return 0;
}

/* Deal the lamps out, brightest first, to the group that has less. */
static void deal(unsigned char *group, const int *label, double *light, int lamps, size_t n)
{
    unsigned char *of = calloc((size_t)lamps + 1, 1);
    double got[3] = {0};
    for (int turn = 0; of && turn < lamps && turn < MOST_LAMPS; turn++) {
        int best = 1, to;
        for (int k = 2; k <= lamps; k++) best = light[k] > light[best] ? k : best;
        to = got[2] < got[1] ? 2 : 1;
        got[to] += light[best];
        of[best] = (unsigned char)to;
        light[best] = -1;
    }
    for (size_t i = 0; i < n; i++) group[i] = of ? of[label[i]] : 0;
    free(of);
}

int flare_lamps(unsigned char *group, const flare_picture *p, errmsg *e)
{
    size_t n = (size_t)p->width * (size_t)p->height;
    int *label = malloc(n * sizeof *label), lamps = -1;
    double level = 0, *light = NULL;
    if (!label) err_set(e, "flare: out of memory");
    else if (lamp_level(&level, p->light, n, e) == 0) {
        for (size_t i = 0; i < n; i++) group[i] = (double)p->light[i] >= level && level > 0;
        lamps =
            vision_spots(label, group, p->width, p->height, 1 + (int)(apart * hypot(p->width, p->height)), e);
        memset(group, 0, n);
    }
    if (lamps > 0) {
        light = calloc((size_t)lamps + 1, sizeof *light);
        for (size_t i = 0; light && i < n; i++) light[label[i]] += (double)p->light[i];
        if (light) deal(group, label, light, lamps, n);
        else lamps = err_set(e, "flare: out of memory");
    }
    free(label);
    free(light);
    return lamps;
}
