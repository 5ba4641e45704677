/*
 * jobmerge.c - the last stage of a series: all rows through the merge, then what is done to the whole.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "aside.h"
#include "develop.h"
#include "finish.h"
#include "job.h"

/* Deghosting: relative differences up to so many times what is usual in the series are none, within
 * bounds. */
static const double usual_differences = 5, least_tolerance = 0.06, most_tolerance = 0.5;

/* What one thread needs for a row. */
typedef struct bench {
    const uint16_t **at;  /* [n] */
    const uint8_t **gone; /* [n] */
    float *pedestal;      /* [width * channels] */
    uint64_t *reject;     /* [2 * width] */
    uint8_t *bytes;       /* [2 * width] */
} bench;

static int bench_init(bench *b, const job *j)
{
    const frames_facts *f = frames_get_facts(j->frames);
    size_t w = (size_t)f->width;
    b->at = malloc(sizeof *b->at * (size_t)j->n);
    b->gone = malloc(sizeof *b->gone * (size_t)j->n);
    b->pedestal = malloc(sizeof *b->pedestal * w * (size_t)f->channels);
    b->reject = malloc(sizeof *b->reject * w * 2);
    b->bytes = malloc(w * 2);
    return b->at && b->gone && b->pedestal && b->reject && b->bytes ? 0 : -1;
}

static void bench_free(bench *b)
{
    free(b->at);
    free(b->gone);
    free(b->pedestal);
    free(b->reject);
    free(b->bytes);
}

/* The picture as merged is RGB, grey, or a mosaic of one value per pixel.  A lane is a set of samples of
 * one channel in a row: first sample, step, number. */
typedef struct lane {
    int channel, first, step, count; /* in pixels; */
    int offset;                      /* in values within a pixel */
} lane;

static int lanes_of_row(lane out[CFA_MOST], const job *j, int y)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int n = 0;
    if (j->mosaic) {
        int step = j->mosaic->columns;
        for (int p = 0; p < step && p < f->width; p++)
            out[n++] = (lane){cfa_at(j->mosaic, p, y), p, step, (f->width - p + step - 1) / step, 0};
        return n;
    }
    for (; n < f->channels; n++) out[n] = (lane){n, 0, 1, f->width, n};
    return n;
}

/* A strip of the series as frames_next gives it. */
typedef struct strip {
    const uint16_t **codes;  /* [n] */
    const uint8_t **missing; /* [n] */
    uint64_t *votes, *room;  /* [strip rows * width] for deghosting, or NULL */
    int y, rows;
} strip;

static merge_row row_for(const job *j, const lane *l, bench *b, const strip *s, int row)
{
    const frames_facts *f = frames_get_facts(j->frames);
    size_t ch = (size_t)f->channels, w = (size_t)f->width;
    size_t start = (size_t)l->first * ch + (size_t)l->offset, out = (size_t)(s->y + row) * w * ch + start;
    int any = 0;
    for (int k = 0; k < j->n; k++) {
        b->at[k] = s->codes[k] + (size_t)row * w * ch + start;
        b->gone[k] = s->missing[k] ? s->missing[k] + (size_t)row * w + (size_t)l->first : NULL;
        any |= b->gone[k] != NULL;
    }
    return (merge_row){.codes = b->at,
                       .stride = ch * (size_t)l->step,
                       .count = l->count,
                       .pedestal = j->dark ? b->pedestal + start : NULL,
                       .missing = any ? b->gone : NULL,
                       .missing_stride = (size_t)l->step,
                       .radiance = j->radiance.pix + out,
                       .sigma = j->sigma ? j->sigma + out : NULL,
                       .used = j->count ? b->bytes : NULL,
                       .flags = b->bytes + w,
                       .out_stride = ch * (size_t)l->step};
}

static void fill_pedestal(const job *j, bench *b, int y)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int ch = f->channels;
    const uint16_t *d = j->dark + (size_t)y * (size_t)f->width * (size_t)ch;
    for (int x = 0; x < f->width; x++)
        for (int c = 0; c < ch; c++) {
            int from = j->mosaic ? cfa_at(j->mosaic, x, y) : c;
            b->pedestal[x * ch + c] = (float)j->response.finv[from][d[x * ch + c]];
        }
}

/* What contradicts in one channel goes in all. */
static void vote(job *j, const merge *m, const strip *s, int row, bench *b)
{
    int w = frames_get_facts(j->frames)->width;
    uint64_t *votes = s->votes + (size_t)row * (size_t)w;
    lane lanes[CFA_MOST];
    int n = lanes_of_row(lanes, j, s->y + row);
    if (j->dark) fill_pedestal(j, b, s->y + row);
    memset(votes, 0, sizeof *votes * (size_t)w);
    for (int l = 0; l < n; l++) {
        merge_row r = row_for(j, &lanes[l], b, s, row);
        if (!j->mosaic) {
            merge_find_ghosts(m, lanes[l].channel, &r, votes);
            continue;
        }
        memset(b->reject, 0, sizeof *b->reject * (size_t)r.count);
        merge_find_ghosts(m, lanes[l].channel, &r, b->reject);
        for (int i = 0; i < r.count; i++) votes[lanes[l].first + i * lanes[l].step] = b->reject[i];
    }
}

/* In a mosaic the photosites of a cell of the pattern see one place in its colours: what one says goes for
 * all. */
static void share_votes(const job *j, const strip *s)
{
    int w = frames_get_facts(j->frames)->width, wide = j->mosaic->columns, high = j->mosaic->rows;
    for (int y = 0; y < s->rows; y += high)
        for (int x = 0; x < w; x += wide) {
            uint64_t any = 0;
            for (int pass = 0; pass < 2; pass++)
                for (int v = y; v < y + high && v < s->rows; v++)
                    for (int u = x; u < x + wide && u < w; u++) {
                        uint64_t *one = &s->votes[(size_t)v * (size_t)w + (size_t)u];
                        any |= *one;
                        *one = pass ? any : *one;
                    }
        }
}

/* The row's votes, one after the other as the lane's pixels are. */
static const uint64_t *votes_of(const job *j, const strip *s, const lane *l, int row, bench *b)
{
    const uint64_t *votes =
        s->votes ? s->votes + (size_t)row * (size_t)frames_get_facts(j->frames)->width : NULL;
    if (!votes || !j->mosaic) return votes;
    for (int i = 0; i < l->count; i++) b->reject[i] = votes[l->first + i * l->step];
    return b->reject;
}

static void one_row(job *j, const merge *m, const strip *s, int row, bench *b)
{
    int w = frames_get_facts(j->frames)->width, y = s->y + row;
    size_t out = (size_t)y * (size_t)w;
    lane lanes[CFA_MOST];
    int n = lanes_of_row(lanes, j, y);
    memset(j->flags + out, 0, (size_t)w);
    if (j->count) memset(j->count + out, 255, (size_t)w);
    if (j->dark) fill_pedestal(j, b, y);
    for (int l = 0; l < n; l++) {
        merge_row r = row_for(j, &lanes[l], b, s, row);
        r.reject = votes_of(j, s, &lanes[l], row, b);
        merge_do_row(m, lanes[l].channel, &r);
        for (int i = 0; i < r.count; i++) {
            size_t x = out + (size_t)(lanes[l].first + i * lanes[l].step);
            j->flags[x] |= r.flags[i];
            if (j->count && r.used[i] < j->count[x]) j->count[x] = r.used[i];
        }
    }
}

static int allocate(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    size_t pixels = (size_t)f->width * (size_t)f->height;
    if (img_alloc(&j->radiance, f->width, f->height, f->channels, e)) return -1;
    if (j->opts.want_sigma) j->sigma = malloc(pixels * (size_t)f->channels * sizeof *j->sigma);
    if (j->opts.want_count) j->count = malloc(pixels);
    j->flags = malloc(pixels);
    if ((j->opts.want_sigma && !j->sigma) || (j->opts.want_count && !j->count) || !j->flags)
        return err_set(e, "out of memory for %dx%d pixels", f->width, f->height);
    return 0;
}

static int all_rows(job *j, const merge *m, strip *s, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int failed = 0;
    s->y = 0;
    for (;;) {
        double t0 = job_cpu_s();
        int rows = s->rows = frames_next(j->frames, s->codes, s->missing, e);
        double t1 = job_cpu_s();
        j->facts.read_s += t1 - t0;
        if (rows <= 0) return rows;
#pragma omp parallel
        {
            bench b;
            int bad = bench_init(&b, j);
            if (bad) {
#pragma omp atomic write
                failed = 1;
            }
            if (s->votes) {
#pragma omp for schedule(static)
                for (int row = 0; row < rows; row++)
                    if (!bad) vote(j, m, s, row, &b);
#pragma omp single
                {
                    if (j->mosaic) share_votes(j, s);
                    merge_gather_ghosts(m, s->votes, s->room, f->width, rows);
                }
            }
#pragma omp for schedule(static)
            for (int row = 0; row < rows; row++)
                if (!bad) one_row(j, m, s, row, &b);
            bench_free(&b);
        }
        if (failed) return err_set(e, "out of memory");
        j->facts.merge_s += job_cpu_s() - t1;
        s->y += rows;
        if (j->progress) j->progress("merging", s->y, f->height);
    }
}

static void scale_all(job *j, double scale)
{
    size_t n =
        (size_t)j->radiance.info.width * (size_t)j->radiance.info.height * (size_t)j->radiance.info.channels;
    j->facts.scale = scale;
    for (size_t i = 0; i < n; i++) {
        j->radiance.pix[i] = (float)(j->radiance.pix[i] * scale);
        if (j->sigma) j->sigma[i] = (float)(j->sigma[i] * scale);
    }
}

/* Saturation-based speed (ISO 12232): the exposure that clips is H = 78/S lx s, and H = 0.65 L t / N^2
 * behind a usual lens,
 * so that L = 120 N^2 / (S t) cd/m2 reaches the highest code.  Radiance 1 does so in the time that
 * job->shots calls exposure. */
static int by_speed(job *j, errmsg *e)
{
    for (int k = 0; k < j->n; k++)
        if (!(j->shots[k].f_number > 0) || !(j->shots[k].iso > 0))
            return err_set(
                e,
                "%s: expected f-number and ISO in its EXIF data for --absolute, found none: give --calibrate",
                j->shots[k].path);
    const shot *s = &j->shots[j->n / 2];
    scale_all(j, 120 * s->f_number * s->f_number / s->iso * s->exposure / s->seconds / 179);
    return 0;
}

static int to_absolute(job *j, errmsg *e)
{
    const double *p = j->opts.patch;
    int w = j->radiance.info.width, h = j->radiance.info.height, ch = j->radiance.info.channels;
    if (p[0] < 0 || p[1] < 0 || p[2] < 1 || p[3] < 1 || p[0] + p[2] > w || p[1] + p[3] > h)
        return err_set(e, "--calibrate: expected a rectangle inside %dx%d pixels, found %g,%g,%g,%g", w, h,
                       p[0], p[1], p[2], p[3]);
    int x = (int)p[0], y = (int)p[1], pw = (int)p[2], ph = (int)p[3];
    for (int i = y; i < y + ph; i++)
        for (int k = x; k < x + pw; k++)
            if (j->flags[(size_t)i * (size_t)w + (size_t)k] &
                (MERGE_CLIPPED | MERGE_BLACK | MERGE_GAP | MERGE_MISSING))
                return err_set(e,
                               "--calibrate: expected a patch that is neither clipped nor black nor missing, "
                               "found pixel %d,%d",
                               k, i);
    double weight[3];
    if (colour_luminance(weight, j->opts.colour))
        return err_set(e, "--calibrate: expected colours whose luminance is known, found --colour camera");
    j->facts.scale = p[4] / patch_luminance(j->radiance.pix, ch, w, x, y, pw, ph, weight);
    if (!(j->facts.scale > 1e-30 && j->facts.scale < 1e30))
        return err_set(e, "--calibrate: expected a patch of positive luminance, found a scale of %g",
                       j->facts.scale);
    scale_all(j, j->facts.scale);
    return 0;
}

int job_in_circle(const job *j, double x, double y, double grow)
{
    const double *c = j->opts.circle, w = j->radiance.info.width, h = j->radiance.info.height;
    if (!(c[2] > 0)) return 1;
    return c[0] < 0 ? hypot(x - w / 2, y - h / 2) < grow * c[2] * fmin(w, h) / 2
                    : hypot(x - c[0], y - c[1]) < grow * c[2];
}

/* Is a pixel's middle in the image circle?  Beyond it a fisheye shows nothing. */
static int in_circle(const job *j, size_t at)
{
    size_t w = (size_t)j->radiance.info.width;
    return job_in_circle(j, (double)(at % w) + 0.5, (double)(at / w) + 0.5, 1);
}

static void count_flags(job *j)
{
    size_t pixels = (size_t)j->radiance.info.width * (size_t)j->radiance.info.height;
    for (size_t i = 0; i < pixels; i++) {
        if (!in_circle(j, i)) continue;
        j->facts.counted++;
        j->facts.clipped += (j->flags[i] & MERGE_CLIPPED) != 0;
        j->facts.black += (j->flags[i] & MERGE_BLACK) != 0;
        j->facts.gap += (j->flags[i] & MERGE_GAP) != 0;
        j->facts.ghosts += (j->flags[i] & MERGE_GHOST) != 0;
        j->facts.missing += (j->flags[i] & MERGE_MISSING) != 0;
    }
}

int job_merge(job *j, errmsg *e)
{
    double t0 = job_cpu_s();
    strip s = {.codes = calloc((size_t)j->n, sizeof *s.codes),
               .missing = calloc((size_t)j->n, sizeof *s.missing)};
    merge *m = merge_new(&j->response, j->noise, j->exposure, j->n, j->opts.weight, j->dark != NULL, e);
    int bad = -1;
    if (!s.codes || !s.missing) err_set(e, "out of memory");
    if (!s.codes || !s.missing || !m || allocate(j, e)) goto done;
    if (j->opts.deghost) {
        size_t most = (size_t)frames_strip_rows(j->frames) * (size_t)frames_get_facts(j->frames)->width;
        s.votes = malloc(most * sizeof *s.votes);
        s.room = malloc(most * sizeof *s.room);
        if (!s.votes || !s.room) {
            err_set(e, "out of memory");
            goto done;
        }
    }
    merge_set_tolerance(
        m, fmin(fmax(least_tolerance, usual_differences * j->facts.contradict.usual), most_tolerance));
    j->facts.scale = 1;
    j->facts.merge_s += job_cpu_s() - t0;
    bad = all_rows(j, m, &s, e);
    t0 = job_cpu_s();
    if (!bad && j->opts.hot) bad = aside_heal(j, e);
    if (!bad && j->opts.flat) bad = aside_flatten(j, e);
    if (!bad) bad = job_develop(j, e);
    if (!bad && j->opts.flare) bad = job_flare(j, e);
    if (!bad && j->opts.patch[2] > 0) bad = to_absolute(j, e);
    else if (!bad && j->opts.absolute) bad = by_speed(j, e);
    if (!bad) count_flags(j);
    j->facts.merge_s += job_cpu_s() - t0;
done:
    free(s.codes);
    free(s.missing);
    free(s.votes);
    free(s.room);
    merge_free(m);
    return bad;
}
