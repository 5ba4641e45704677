/*
 * ilf_sampler.h - what the sampling's files share: bright patches, slices, and what is kept with them.
 */
#ifndef ILF_SAMPLER_H
#define ILF_SAMPLER_H

#include "ilf_internal.h"

/* The map of a slice: SIDE x SIDE cells of equal solid angle over the hemisphere, numbered along a Morton
 * curve so that neighbours in number are neighbours in direction. */
enum { SLICE_BITS = 8, SLICE_SIDE = 1 << SLICE_BITS, SLICE_CELLS = SLICE_SIDE * SLICE_SIDE };
#define SLICE_OMEGA (2 * ILF_PI / SLICE_CELLS)

/* Where light may be is marked in cells of 2 x 2 of the map's: the bounds are no finer than that. */
enum { MARK_SIDE = SLICE_SIDE / 2, MARK_CELLS = MARK_SIDE * MARK_SIDE };

/* Part of the draws that goes to all directions alike, in case a patch is not where it seems. */
#define SLICE_UNIFORM 0.02

/* Part of the draws that goes where the bounds say that light may be, seen from the cube's centre or not. */
#define SLICE_BOUND 0.1

/* A probe's bright patch: some texels whose luminance exceeds the threshold, as a ball in the plane's
 * coordinates (u, v, n; origin at probe (0,0)) around the place where their light comes from. */
typedef struct patch {
    float u, v, n; /* centre */
    float radius;  /* holds all of the patch, bilinear lookup's half texel included */
    float excess;  /* largest luminance over the threshold, in units of the list's */
    int i, j;      /* the probe */
    int whole;     /* 0: a part of a patch that lies on two things, one behind the other */
} patch;

typedef struct ilf_glint_balls ilf_glint_balls; /* shiny balls and the lamps that each sees (ilf_glint.c) */
typedef struct ilf_scratch ilf_scratch;         /* candidates (ilf_light.c) */

struct ilf_patches {
    const ilf *field;
    ilf_frame frame;
    ilf_mode mode;
    ilf_hit_fn *hit; /* while the list is made */
    void *context;
    double threshold;
    double cube; /* edge of the cubes of space that share a slice */
    double unit; /* largest excess of all: weights relative to it stay in a float's range for any light */
    patch *p;    /* probe after probe */
    size_t n, room;
    float (*cell_dir)[3], (*mark_dir)[3]; /* centres of cells, by row and column */
    ilf_glint_balls *balls;               /* or NULL */
};

/* A cube's memory of the points that drew from its slice, for adapting their number: kept apart from the
 * estimate itself, so that adapting does not bias it. */
typedef struct slice_past {
    double visible, tests; /* rays that met light, and all */
    double mean2, var;     /* sums of squared means, and of variances, of the candidates' weights */
    double points;         /* that drew candidates; of lamps only */
} slice_past;

struct ilf_slice {
    int64_t key[3]; /* cube of space */
    slice_past past;
    slice_past *lamp_past; /* of each lamp that was taken out of the field */
    double total;          /* sum of the cells' excess luminance */
    int cells;             /* with light */
    int last;              /* cell drawn last */
    uint16_t *cell;        /* ascending Morton numbers */
    float *cdf;            /* cells + 1 values from 0 to 1 */
    float *near, *far;     /* distances of the light in each cell */
};

struct ilf_sampler {
    const ilf_patches *of;
    ilf_slice **table; /* open addressing, table_size a power of two */
    size_t table_size, used, bytes;
    int busy; /* rays being traced for points: their slices must stay */
    ilf_work work;
    ilf_scratch *scratch;
    struct mark {
        float weight, probe_weight, near, far;
        int owner; /* probe that marked it last, + 1 */
    } *mark;       /* scratch of MARK_CELLS; below, of SLICE_CELLS */
    float *weight, *near, *far, *seen, *most;
    uint16_t *marked, *touched;
};

/* Two distances nearer to each other than that are one. */
#define ONE_DISTANCE 0.98

/* No weight is 0: a slice may see the faintest patch alone. */
#define LEAST_WEIGHT 1e-30

/* Rows of a probe that may light a point: those above the plane, and with depth correction those below it, too: from a
 * point under the plane a rising ray may meet what the probe sees under its horizon. */
int ilf_patch_rows(const ilf_patches *patches);

/* Add the balls for texels [x[0], x[1]) x [y[0], y[1]) of probe (i, j) to the list; not 0 for want of memory.
 */
int ilf_make_patch(ilf_patches *patches, int i, int j, const int x[2], const int y[2], double excess);

/* Where light that is infinitely far away is put: its distance from the plane's corner. */
double ilf_far_away(const ilf_frame *frame);

/* The largest bilinear weight that a patch's probe has anywhere in the cube (or ball) of half edge r around
 * x, plane's coordinates; 0 where the patch is not seen. */
float ilf_patch_weight(const ilf_patches *patches, const patch *p, const float x[3], float r);

/* Directions of the centres of the cells of a map of side x side; owned by the caller. */
float (*ilf_cell_centres(int side))[3];

/* The slice of the cube around a point, though nothing of the texels may be bright there (cells is 0); owned
 * by the sampler, valid until the next call. */
ilf_status ilf_sampler_cube(ilf_slice **slice, ilf_sampler *s, const double point[3], ilf_error *err);

/* Memory of a slice with so many cells. */
size_t ilf_slice_bytes(const ilf_patches *patches, size_t cells);

/* Build the slice that the cube `key` sees; to be freed with free(). */
ilf_status ilf_build_slice(ilf_slice **slice, ilf_sampler *s, const int64_t key[3], ilf_error *err);

/* Balls that see lamps; *balls is NULL where none does, or too many to look at for each point. */
ilf_status ilf_glint_balls_open(ilf_glint_balls **balls, const ilf_patches *patches, const ilf_ball *b, int n,
                                ilf_error *err);

/* Sample the cones around a point's glints, as ilf_light does; coef is room for one coefficient. */
void ilf_light_glints(ilf_sampler *s, const ilf_point *point, const ilf_host *host, void *coef);

void ilf_scratch_free(ilf_scratch *scratch);

/* ---- numbering of cells: Morton, column's bits even, row's odd ---- */

/* Every second bit, and back. */
static inline uint32_t spread(uint32_t x)
{
    x = (x | x << 4) & 0x0f0fu;
    x = (x | x << 2) & 0x3333u;
    return (x | x << 1) & 0x5555u;
}

static inline uint32_t gather(uint32_t x)
{
    x &= 0x5555u;
    x = (x | x >> 1) & 0x3333u;
    x = (x | x >> 2) & 0x0f0fu;
    return (x | x >> 4) & 0x00ffu;
}

static inline uint16_t cell_number(int a, int b)
{
    return (uint16_t)(spread((uint32_t)a) | spread((uint32_t)b) << 1);
}

static inline int clamp_cell(double x)
{
    return x < 0 ? 0 : x >= SLICE_SIDE ? SLICE_SIDE - 1 : (int)x;
}

#endif
