/*
 * jobalign.c - the stage that puts the shots of one series over each other: small grey pictures of all of
 * them, their motions (align.h), the frames told to move.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "job.h"

static const double small_pixels = 1e6; /* of the pictures that are registered, at most about so many */
static const double gamma_seen = 2.2;   /* linear codes are made as people look at them */

/* Small pictures of all exposures: means over factor x factor pixels. */
typedef struct small {
    int width, height, factor;
    float *grey;         /* [n][height][width] sums, then 0..255 */
    unsigned char *seen; /* [n][height][width] */
    align_picture *pictures;
} small;

static void small_free(small *s)
{
    free(s->grey);
    free(s->seen);
    free(s->pictures);
}

static int small_init(small *s, const job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int most = f->width < f->height ? f->width : f->height;
    *s = (small){.factor = (int)ceil(sqrt((double)f->width * f->height / small_pixels))};
    s->factor += j->mosaic && s->factor % 2; /* whole 2x2 cells */
    if (s->factor > most) s->factor = most;
    s->width = f->width / s->factor;
    s->height = f->height / s->factor;
    size_t pixels = (size_t)s->width * (size_t)s->height, n = (size_t)j->n;
    s->grey = calloc(pixels * n, sizeof *s->grey);
    s->seen = malloc(pixels * n);
    s->pictures = malloc(n * sizeof *s->pictures);
    if (!s->grey || !s->seen || !s->pictures)
        return err_set(e, "aligning: out of memory for %d images", j->n);
    memset(s->seen, 1, pixels * n);
    for (size_t k = 0; k < n; k++)
        s->pictures[k] = (align_picture){s->grey + k * pixels, s->seen + k * pixels};
    return 0;
}

/* One row of exposure k into its sums. */
static void add_row(small *s, const frames_facts *f, int k, const uint16_t *codes, const uint8_t *missing,
                    int y)
{
    int row = y / s->factor, ch = f->channels;
    if (row >= s->height) return;
    float *to = s->grey + ((size_t)k * (size_t)s->height + (size_t)row) * (size_t)s->width;
    unsigned char *seen = s->seen + (to - s->grey);
    for (int x = 0; x < s->width * s->factor; x++) {
        const uint16_t *z = codes + (size_t)x * (size_t)ch;
        to[x / s->factor] += ch == 3 ? 0.25f * ((float)z[0] + 2 * (float)z[1] + (float)z[2]) : (float)z[0];
        if (missing && missing[x]) seen[x / s->factor] = 0;
    }
}

static void finish_greys(small *s, const job *j)
{
    int linear = job_linear_codes(j);
    double top = 0;
    for (int c = 0; c < job_channels(j); c++) top = fmax(top, j->facts.clip[c]);
    double scale = 1 / (top * s->factor * s->factor);
    size_t values = (size_t)s->width * (size_t)s->height * (size_t)j->n;
    for (size_t i = 0; i < values; i++) {
        double v = (double)s->grey[i] * scale;
        s->grey[i] = (float)(255 * (linear ? pow(v, 1 / gamma_seen) : v));
    }
}

static int gather(small *s, job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    const uint16_t **codes = calloc((size_t)j->n, sizeof *codes);
    const uint8_t **missing = calloc((size_t)j->n, sizeof *missing);
    int rows = codes && missing ? 1 : err_set(e, "aligning: out of memory"), y = 0;
    for (; rows > 0; y += rows) {
        rows = frames_next(j->frames, codes, missing, e);
#pragma omp parallel for schedule(static)
        for (int k = 0; k < j->n; k++)
            for (int i = 0; i < rows; i++)
                add_row(s, f, k, codes[k] + (size_t)i * (size_t)f->width * (size_t)f->channels,
                        missing[k] ? missing[k] + (size_t)i * (size_t)f->width : NULL, y + i);
        if (j->progress && rows > 0) j->progress("looking", y + rows, f->height);
    }
    free(codes);
    free(missing);
    if (rows < 0 || frames_rewind(j->frames, e)) return -1;
    finish_greys(s, j);
    return 0;
}

static int all_registered(const job *j, errmsg *e)
{
    for (int k = 0; k < j->n; k++)
        if (!j->align[k].registered)
            return err_set(
                e,
                "%s: expected a picture that can be registered against its neighbour in time, found a "
                "correlation of %.2f: --align=auto leaves such shots where their neighbours are",
                j->shots[k].path, j->align[k].after);
    return 0;
}

/* What frames_move needs to know of the codes. */
static int warp_of_codes(warp_opts *o, const job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    if (j->mosaic && (j->mosaic->columns != 2 || j->mosaic->rows != 2))
        return err_set(e, "%s: expected a sensor with cells of 2x2 colours for --align, found %dx%d",
                       j->shots[0].path, j->mosaic->columns, j->mosaic->rows);
    *o = (warp_opts){f->width, f->height, f->channels, j->mosaic != NULL, job_linear_codes(j), {0}};
    for (int i = 0; i < 4; i++)
        o->clip[i] = j->facts.clip[j->mosaic ? cfa_at(j->mosaic, i % 2, i / 2) : i % f->channels];
    return 0;
}

int job_align(job *j, errmsg *e)
{
    small s = {0};
    warp_opts o;
    double t0 = job_cpu_s();
    j->align = calloc((size_t)j->n, sizeof *j->align);
    int bad = j->align ? warp_of_codes(&o, j, e) : err_set(e, "aligning: out of memory");
    if (!bad)
        bad = small_init(&s, j, e) || gather(&s, j, e) ||
              align_estimate(j->align, s.pictures, j->exposure, j->n, s.width, s.height, e);
    if (!bad && j->opts.align == ALIGN_ALWAYS) bad = all_registered(j, e);
    for (int k = 0; k < j->n && !bad; k++) {
        align_shot *a = &j->align[k];
        a->m = motion_scaled(a->m, s.factor);
        if (a->moves) bad = frames_move(j->frames, k, &a->m, &o, e);
        if (j->progress) j->progress("aligning", k + 1, j->n);
    }
    small_free(&s);
    j->facts.align_s += job_cpu_s() - t0;
    return bad ? -1 : 0;
}
