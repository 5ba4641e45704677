/*
 * ilf_slice.c - what is bright as seen from a cube of space.
 *
 * The rays through a point are a two-dimensional slice of the light field; the probes nearest to the
 * point are not its environment.  A patch of probe q shows in direction d from point x with the bilinear
 * weight that q has where the ray is traced back to the plane:
 *
 *             P  patch's ball, seen from x in direction P - x
 *            /
 *       x [ ]    cube            foot f = x - x_n (P - x)_uv / (P - x)_n
 *          /                     weight = tent(f - q) in grid units; over the cube, its largest value
 *     ----f-----q---  plane
 *
 * For all of a cube at once the foot becomes an interval and the ball's cone is widened, so that no patch is
 * missed that only a part of the cube sees (a miss is what makes a firefly).
 */
#include <stdlib.h>

#include "ilf_hemi.h"
#include "ilf_sampler.h"

/* Cells of the marks' map are at most that far (radians) from their centres to their corners. */
#define HALF_CELL (1.5 * 1.4142136 / MARK_SIDE * 1.5708)

#define SQRT3 1.7320508

/* What a look may see at most, in units of the brightest patch: a bound on what one odd texel can draw. */
#define MOST_SEEN 1e6

float (*ilf_cell_centres(int side))[3]
{
    float(*dir)[3] = malloc((size_t)(side * side) * sizeof *dir);

    for (int k = 0; dir && k < side * side; k++) {
        double d[3];
        ilf_square_to_hemi(d, (k % side + 0.5) * 2 / side - 1, (k / side + 0.5) * 2 / side - 1);
        for (int c = 0; c < 3; c++) dir[k][c] = (float)d[c];
    }
    return dir;
}

/* ---- the probes' weights ------------------------------------------------------------------------ */

/* Largest tent weight of grid node k while the grid coordinate runs over lo..hi, clamped to the grid. */
static float tent(float lo, float hi, int k, int n)
{
    if (n == 1) return 1;
    const float last = (float)(n - 1), node = (float)k;

    lo = lo < 0 ? 0 : lo > last ? last : lo;
    hi = hi < 0 ? 0 : hi > last ? last : hi;
    const float off = node < lo ? lo - node : node > hi ? node - hi : 0;
    return off < 1 ? 1 - off : 0;
}

/* See ilf_sampler.h; the drawing above. */
float ilf_patch_weight(const ilf_patches *pl, const patch *p, const float x[3], float r)
{
    const ilf_info *in = &pl->field->info;
    const float up = p->n - x[2], slack = r + p->radius;

    if (up + slack <= 0) return 0;
    const float su = (float)(in->n_u - 1) / (float)pl->frame.len_u,
                sv = (float)(in->n_v - 1) / (float)pl->frame.len_v;
    if (up <= 2 * slack) return 1; /* so close that the foot may be anywhere */
    const float tu = (p->u - x[0]) / up, tv = (p->v - x[1]) / up, k = fabsf(x[2]) / (up - slack);
    const float spread_u = (1 + fabsf(tu)) * (r * (1 + k) + p->radius * k);
    const float spread_v = (1 + fabsf(tv)) * (r * (1 + k) + p->radius * k);
    const float fu = x[0] - x[2] * tu, fv = x[1] - x[2] * tv;
    const float wu = tent((fu - spread_u) * su, (fu + spread_u) * su, p->i, in->n_u);

    return wu > 0 ? wu * tent((fv - spread_v) * sv, (fv + spread_v) * sv, p->j, in->n_v) : 0;
}

/* ---- the map ------------------------------------------------------------------------------------ */

/* Light of a probe in a cell.  Within one probe patches overlap: the larger counts; different probes' weights
 * add up, as in the lookup.  Returns 1 if the cell is new. */
static inline int add_light(struct mark *m, int owner, float value, float dist)
{
    const int is_new = m->owner == 0;

    if (is_new) m->near = m->far = dist;
    if (dist < m->near) m->near = dist;
    if (dist > m->far) m->far = dist;
    if (m->owner != owner) {
        m->owner = owner;
        m->probe_weight = 0;
    }
    if (value > m->probe_weight) {
        m->weight += value - m->probe_weight;
        m->probe_weight = value;
    }
    return is_new;
}

static int clamp_mark(double x)
{
    return x < 0 ? 0 : x >= MARK_SIDE ? MARK_SIDE - 1 : (int)x;
}

/* Mark the cells that the patch's cone meets; returns how many are marked. */
static int splat(ilf_sampler *s, const patch *p, const float x[3], float r, float w, int marked)
{
    const double d[3] = {(double)(p->u - x[0]), (double)(p->v - x[1]), (double)(p->n - x[2])};
    const double dist = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    const double ball = (double)p->radius + (double)r * SQRT3; /* a cube's half diagonal */
    const double cone = ball < dist ? asin(ball / dist) : ILF_PI;
    const double reach = cone + HALF_CELL;
    const double unit[3] = {d[0] / dist, d[1] / dist, d[2] / dist};
    const float value = w * p->excess, near = reach < ILF_PI ? (float)cos(reach) : -1.f;
    const int owner = p->j * s->of->field->info.n_u + p->i + 1;
    double a, b;

    ilf_hemi_to_square(&a, &b, unit);
    const double below = unit[2] < 0 ? asin(fmin(1, -unit[2])) : 0; /* the centre was lifted to the horizon */
    const double side = ILF_HEMI_STRETCH * (reach + below);
    const int a0 = clamp_mark((a - side + 1) * (MARK_SIDE / 2)),
              a1 = clamp_mark((a + side + 1) * (MARK_SIDE / 2));
    const int b0 = clamp_mark((b - side + 1) * (MARK_SIDE / 2)),
              b1 = clamp_mark((b + side + 1) * (MARK_SIDE / 2));
    const float du = (float)unit[0], dv = (float)unit[1], dn = (float)unit[2];

    for (int row = b0; row <= b1; row++)
        for (int k = row * MARK_SIDE + a0; k <= row * MARK_SIDE + a1; k++) {
            const float *c = s->of->mark_dir[k];

            if (c[0] * du + c[1] * dv + c[2] * dn >= near &&
                add_light(&s->mark[k], owner, value, (float)dist))
                s->marked[marked++] = (uint16_t)k;
        }
    return marked;
}

/* From the marks to the map's cells; clears the marks.  Returns how many cells are touched. */
static int touch(ilf_sampler *s, int marked)
{
    int touched = 0;

    for (int t = 0; t < marked; t++) {
        struct mark *m = &s->mark[s->marked[t]];
        const int corner = s->marked[t] / MARK_SIDE * 2 * SLICE_SIDE + s->marked[t] % MARK_SIDE * 2;

        for (int c = 0; c < 4; c++) {
            const int k = corner + (c >> 1) * SLICE_SIDE + (c & 1);
            s->touched[touched++] = (uint16_t)k;
            s->weight[k] = m->weight;
            s->near[k] = m->near;
            s->far[k] = m->far;
        }
        m->weight = 0;
        m->owner = 0;
    }
    return touched;
}

static int by_number(const void *a, const void *b)
{
    return (int)*(const uint16_t *)a - (int)*(const uint16_t *)b;
}

/* The bounds say where light may be; a look from the cube's centre at the middle of each touched cell says
 * where it is. Neighbouring cells share what is seen (lamps move by about a cell over the cube, and are about
 * as large). */
static ilf_status sharpen(ilf_sampler *s, int touched, const int64_t key[3], ilf_error *err)
{
    const ilf_frame *fr = &s->of->frame;
    double x[3], seen = 0, bound = 0;

    for (int c = 0; c < 3; c++)
        x[c] = fr->origin[c] +
               s->of->cube * (((double)key[0] + 0.5) * fr->u[c] + ((double)key[1] + 0.5) * fr->v[c] +
                              ((double)key[2] + 0.5) * fr->n[c]);
    for (int t = 0; t < touched; t++) {
        const int k = s->touched[t];
        const int ends = s->of->mode == ILF_DEPTH && s->near[k] < (float)ONE_DISTANCE * s->far[k] ? 2 : 1;

        for (int end = 0; end < ends; end++) {
            const double far = (double)(end ? s->near[k] : s->far[k]);
            double d[3], hit[3];
            float rgb[3];

            for (int c = 0; c < 3; c++) {
                d[c] = (double)s->of->cell_dir[k][0] * fr->u[c] + (double)s->of->cell_dir[k][1] * fr->v[c] +
                       (double)s->of->cell_dir[k][2] * fr->n[c];
                hit[c] = x[c] + far * d[c];
            }
            const ilf_status st = ilf_eval_residual(rgb, s->of->field, fr, x, d,
                                                    s->of->mode == ILF_DEPTH ? hit : x, s->of->mode, err);
            if (st != ILF_OK) return st;
            const float value = (float)fmin(
                ilf_luminance(rgb) / s->of->unit * ilf_excess_part(rgb, s->of->threshold), MOST_SEEN);
            if (value > s->seen[k]) s->seen[k] = value;
        }
    }
    for (int t = 0; t < touched; t++) {
        const int col = s->touched[t] % SLICE_SIDE, row = s->touched[t] / SLICE_SIDE;
        float most = 0;

        for (int b = row > 0 ? row - 1 : 0; b <= row + 1 && b < SLICE_SIDE; b++)
            for (int a = col > 0 ? col - 1 : 0; a <= col + 1 && a < SLICE_SIDE; a++)
                if (s->seen[b * SLICE_SIDE + a] > most) most = s->seen[b * SLICE_SIDE + a];
        s->most[s->touched[t]] = most;
        seen += (double)most;
        bound += (double)s->weight[s->touched[t]];
    }
    const float share = seen > 0 ? (float)(SLICE_BOUND * fmin(seen / bound, 1)) : 1;
    for (int t = 0; t < touched; t++) {
        const int k = s->touched[t];
        s->weight[k] = share * s->weight[k] + s->most[k];
        s->seen[k] = 0;
    }
    return ILF_OK;
}

size_t ilf_slice_bytes(const ilf_patches *patches, size_t cells)
{
    return sizeof(ilf_slice) + (size_t)patches->field->n_lamps * sizeof(slice_past) +
           (3 * cells + 1) * sizeof(float) + cells * sizeof(uint16_t);
}

/* Turn the touched cells into a slice. */
static ilf_slice *collect(ilf_sampler *s, int touched)
{
    const size_t n = (size_t)touched, past = (size_t)s->of->field->n_lamps * sizeof(slice_past);
    ilf_slice *sl = malloc(ilf_slice_bytes(s->of, n));
    double total = 0;

    if (!sl) return NULL;
    memset(sl, 0, sizeof *sl + past);
    sl->cells = touched;
    sl->lamp_past = (slice_past *)(sl + 1);
    sl->cdf = (float *)((char *)(sl + 1) + past);
    sl->near = sl->cdf + n + 1;
    sl->far = sl->near + n;
    sl->cell = (uint16_t *)(sl->far + n);
    for (size_t k = 0; k < n; k++)
        sl->cell[k] = cell_number(s->touched[k] % SLICE_SIDE, s->touched[k] / SLICE_SIDE);
    qsort(sl->cell, n, sizeof *sl->cell, by_number);
    for (size_t k = 0; k < n; k++) {
        const int at = (int)(gather(sl->cell[k]) + gather((uint32_t)sl->cell[k] >> 1) * SLICE_SIDE);
        sl->cdf[k] = (float)total;
        sl->near[k] = s->near[at];
        sl->far[k] = s->far[at];
        total += fmax((double)s->weight[at], LEAST_WEIGHT);
    }
    for (size_t k = 0; k < n; k++) sl->cdf[k] = (float)((double)sl->cdf[k] / total);
    sl->cdf[n] = 1;
    sl->total = total * s->of->unit;
    return sl;
}

ilf_status ilf_build_slice(ilf_slice **slice, ilf_sampler *s, const int64_t key[3], ilf_error *err)
{
    const double e = s->of->cube;
    const float x[3] = {(float)(((double)key[0] + 0.5) * e), (float)(((double)key[1] + 0.5) * e),
                        (float)(((double)key[2] + 0.5) * e)};
    const float r = (float)(0.5 * e);
    int marked = 0;

    for (size_t k = 0; k < s->of->n; k++) {
        const float w = ilf_patch_weight(s->of, &s->of->p[k], x, r);
        if (w > 0) marked = splat(s, &s->of->p[k], x, r, w, marked);
    }
    const int touched = touch(s, marked);
    const ilf_status st = sharpen(s, touched, key, err); /* also clears what it has seen */
    ilf_slice *sl = collect(s, touched);
    if (st != ILF_OK) {
        free(sl);
        return st;
    }
    if (!sl) return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for a slice", s->of->field->path);
    memcpy(sl->key, key, sizeof sl->key);
    s->work.slices++;
    *slice = sl;
    return ILF_OK;
}
