/*
 * job.c - the stages of one series: open and calibrate (merging: jobmerge.c).
 */
#include "job.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "develop.h"
#include "image/exif.h"
#include "samples.h"

enum { WANTED_SAMPLES = 32000 };

double job_cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int job_channels(const job *j)
{
    return j->mosaic ? 3 : frames_get_facts(j->frames)->channels;
}

int job_linear_codes(const job *j)
{
    return j->opts.response == RESPONSE_LINEAR ||
           (j->opts.response == RESPONSE_AUTO && frames_get_facts(j->frames)->raw);
}

static int earlier(const shot *a, const shot *b)
{
    return a->exposure < b->exposure || (a->exposure == b->exposure && strcmp(a->path, b->path) < 0);
}

/* From here on exposures go from the shortest to the longest, so that the result does not depend on the order
 * in which the images were named. */
static int sort_shots(job *j, errmsg *e)
{
    size_t n = (size_t)j->n;
    int *order = malloc(n * sizeof *order), code = -1;
    shot *was = malloc(n * sizeof *was);
    if (!order || !was) {
        err_set(e, "out of memory");
        goto done;
    }
    memcpy(was, j->shots, n * sizeof *was);
    for (int k = 0; k < j->n; k++) {
        int at = 0;
        for (int i = 0; i < j->n; i++)
            at += earlier(&was[i], &was[k]) || (!earlier(&was[k], &was[i]) && i < k);
        order[at] = k;
    }
    for (int k = 0; k < j->n; k++) j->shots[k] = was[order[k]];
    code = frames_reorder(j->frames, order, e);
done:
    free(order);
    free(was);
    return code;
}

static int load_dark(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    img im;
    if (img_load(&im, j->opts.dark, e)) return -1;
    int ch = im.info.channels >= 3 ? 3 : 1, from = im.info.channels;
    int64_t n = (int64_t)im.info.width * im.info.height;
    if (im.info.width != f->width || im.info.height != f->height || ch != f->channels || !im.info.coded ||
        fmin(im.info.max_code, j->opts.bits ? (1 << j->opts.bits) - 1 : im.info.max_code) != f->max_code) {
        err_set(
            e,
            "%s: expected a dark frame of %dx%d pixels, %d channel(s), codes 0..%d, found %dx%d, %d, 0..%g",
            j->opts.dark, f->width, f->height, f->channels, f->max_code, im.info.width, im.info.height, ch,
            im.info.max_code);
        img_free(&im);
        return -1;
    }
    j->dark = malloc((size_t)n * (size_t)ch * sizeof *j->dark);
    for (int64_t i = 0; j->dark && i < n; i++)
        for (int c = 0; c < ch; c++)
            j->dark[i * ch + c] = (uint16_t)fminf(im.pix[i * from + c] + 0.5f, (float)f->max_code);
    img_free(&im);
    return j->dark ? 0 : err_set(e, "%s: out of memory", j->opts.dark);
}

static int settle_mosaic(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    if (j->opts.bayer.columns && (f->channels != 1 || f->raw))
        return err_set(e, "%s: expected grey images with --bayer, found %s", j->shots[0].path,
                       f->raw ? "camera raw" : "colour");
    if (j->opts.dark && f->raw)
        return err_set(e, "%s: expected no --dark with camera raw, whose black level is known", j->opts.dark);
    j->mosaic = f->raw ? f->mosaic : j->opts.bayer.columns ? &j->opts.bayer : NULL;
    return 0;
}

int job_open(job *j, const char *times_file, errmsg *e)
{
    char **paths = calloc((size_t)j->n, sizeof *paths);
    if (!paths) return err_set(e, "out of memory");
    for (int k = 0; k < j->n; k++) paths[k] = (char *)(uintptr_t)j->shots[k].path;
    int bad = frames_open(&j->frames, paths, j->n, j->opts.memory, j->opts.bits,
                          j->opts.has_fill ? j->opts.fill : NULL, j->opts.half_size, e);
    free(paths);
    if (bad) return -1;
    for (int k = 0; k < j->n; k++) {
        const img_info *i = frames_info(j->frames, k);
        exif_facts x = exif_read(j->shots[k].path);
        j->shots[k].seconds = i->exposure_s > 0 ? i->exposure_s : x.exposure_s;
        j->shots[k].f_number = i->f_number > 0 ? i->f_number : x.f_number;
        j->shots[k].iso = i->iso > 0 && i->iso != 65535 ? i->iso : x.iso; /* 65535: more than 16 bits hold */
    }
    j->times_given = times_file != NULL;
    if (times_file && times_load(j->shots, j->n, times_file, e)) return -1;
    if (j->n == 1 && !(j->shots[0].seconds > 0)) {
        j->shots[0].seconds = 1; /* one picture of unknown time: radiance is relative anyway */
        j->facts.assumed_time = 1;
    }
    if (shots_resolve(j->shots, j->n, times_file != NULL, &j->facts.times, e) || sort_shots(j, e)) return -1;
    shots_relate(j->shots, j->n);
    if (settle_mosaic(j, e) || develop_settle(j, e) || frames_begin(j->frames, j->progress, e)) return -1;
    if (j->opts.dark && load_dark(j, e)) return -1;
    j->exposure = calloc((size_t)j->n, sizeof *j->exposure);
    if (!j->exposure) return err_set(e, "out of memory");
    for (int k = 0; k < j->n; k++) j->exposure[k] = j->shots[k].exposure;
    return 0;
}

/* Codes of fewer bits than their file's, at the low end (12 bits of a camera in 16 of a PNG): none is above
 * 2^b - 1, and what is clipped lies there.  b, or 0 where the codes don't look so. */
static int bits_used(const samples *s)
{
    enum { ENOUGH = 8 };
    int highest = 0, there = 0;
    for (int c = 0; c < s->channels; c++)
        for (size_t i = 0; i < (size_t)s->n[c] * (size_t)s->exposures; i++) {
            int z = s->z[c][i];
            there = z == highest ? there + 1 : z > highest ? 1 : there;
            highest = z > highest ? z : highest;
        }
    for (int b = 9; b < 16; b++)
        if (highest == (1 << b) - 1 && highest < s->max_code && there >= ENOUGH) return b;
    return 0;
}

static int settle_white(job *j, errmsg *e)
{
    double t0 = job_cpu_s();
    int top = j->samples.max_code;
    if (j->opts.white > top)
        return err_set(e, "%s: expected --white 4 to %d, found %d", j->shots[0].path, top, j->opts.white);
    if (!j->opts.white && white_find(j->facts.clip, &j->samples, j->exposure, e)) return -1;
    for (int c = 0; c < RESPONSE_MAX_CHANNELS && j->opts.white; c++) j->facts.clip[c] = j->opts.white;
    const int *sensor = frames_get_facts(j->frames)->clip;
    for (int c = 0; c < RESPONSE_MAX_CHANNELS; c++) /* camera raw states it for each colour */
        if (j->facts.clip[c] > sensor[c]) j->facts.clip[c] = sensor[c];
    for (int c = 0; c < j->samples.channels; c++)
        j->facts.bits_used = j->facts.clip[c] < top ? 0 : j->facts.bits_used; /* known better */
    white_apply(&j->samples, j->facts.clip);
    j->facts.recover_s += job_cpu_s() - t0;
    return 0;
}

static int collect_samples(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    sampler p;
    const uint16_t **codes = calloc((size_t)j->n, sizeof *codes);
    const uint8_t **missing = calloc((size_t)j->n, sizeof *missing);
    if (!codes || !missing) {
        free(codes);
        free(missing);
        return err_set(e, "out of memory");
    }
    if (sampler_init(&p, f->width, f->height, j->n, job_channels(j), f->max_code, j->mosaic, j->dark != NULL,
                     WANTED_SAMPLES, e)) {
        free(codes);
        free(missing);
        return -1;
    }
    int rows, y = 0;
    for (;;) {
        double t0 = job_cpu_s();
        rows = frames_next(j->frames, codes, missing, e);
        double t1 = job_cpu_s();
        j->facts.read_s += t1 - t0;
        if (rows <= 0) break;
        size_t at = (size_t)y * (size_t)f->width * (size_t)f->channels;
        if (sampler_strip(&p, codes, missing, j->dark ? j->dark + at : NULL, y, rows, e)) {
            rows = -1;
            break;
        }
        j->facts.recover_s += job_cpu_s() - t1;
        y += rows;
        if (j->progress) j->progress("reading", y, f->height);
    }
    free(codes);
    free(missing);
    if (rows < 0 || frames_rewind(j->frames, e)) {
        samples_free(&p.s);
        return -1;
    }
    j->samples = p.s;
    j->facts.bits_used = bits_used(&j->samples);
    return settle_white(j, e);
}

static int same_exposure(const job *j)
{
    for (int k = 1; k < j->n; k++)
        if (fabs(log(j->exposure[k] / j->exposure[0])) > 1e-6) return 0;
    return 1;
}

/* All stated exposures alike, all pictures not: wrong times, which no response can mend. */
static int check_stated(job *j, errmsg *e)
{
    static const double most_alike = 0.5; /* stops: lamps flicker, clouds move */
    stated_facts *f = &j->facts.stated;
    int linear = frames_get_facts(j->frames)->raw || j->opts.response == RESPONSE_LINEAR;
    stated_check(f, &j->samples, j->exposure, linear);
    if (j->n > 1 && same_exposure(j) && f->span > most_alike && !j->times_given)
        return err_set(e,
                       "%s: expected the exposure times that were used, found %.4g s in all %d files, though "
                       "their brightness "
                       "differs by %.1f stops: give --times",
                       j->shots[0].path, j->shots[0].seconds, j->n, f->span);
    return 0;
}

/* A polynomial's fit is not robust: what contradicts is found by one that is.  Where that fails, nothing is
 * marked. */
static void mark_by_debevec(job *j, const double *lnt)
{
    response r = {0};
    solve_facts unused;
    errmsg words;
    noise_model noise[RESPONSE_MAX_CHANNELS] = {noise_default(), noise_default(), noise_default()};
    if (debevec_solve(&r, &unused, &j->samples, lnt, j->opts.lambda, &words) == 0)
        contradict_mark(&j->samples, &r, noise, lnt, &words);
    response_free(&r);
}

static int first_response(job *j, const double *lnt, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int ch = job_channels(j);
    response_kind kind = j->opts.response;
    if (kind == RESPONSE_AUTO) kind = f->raw ? RESPONSE_LINEAR : RESPONSE_DEBEVEC;
    if (kind == RESPONSE_DEBEVEC || kind == RESPONSE_MITSUNAGA) {
        if (j->n < 2)
            return err_set(
                e, "%s: expected two images or more to recover a response, found one: give --response",
                j->shots[0].path);
        if (same_exposure(j))
            return err_set(
                e,
                "%s: expected images of different exposure to recover a response, found %d of the same: "
                "give --response, or --times if these are wrong",
                j->shots[0].path, j->n);
    }
    switch (kind) {
    case RESPONSE_LINEAR: return response_linear(&j->response, ch, f->max_code, e);
    case RESPONSE_SRGB: return response_srgb(&j->response, ch, f->max_code, e);
    case RESPONSE_GAMMA: return response_gamma(&j->response, ch, f->max_code, j->opts.gamma, e);
    case RESPONSE_FILE: return response_load(&j->response, j->opts.response_file, ch, f->max_code, e);
    case RESPONSE_MITSUNAGA:
        mark_by_debevec(j, lnt);
        return mitsunaga_solve(&j->response, &j->facts.solve, &j->samples, lnt, e);
    default: return debevec_solve(&j->response, &j->facts.solve, &j->samples, lnt, j->opts.lambda, e);
    }
}

/* One sensor's colours are read out alike.  Where a colour shows too little of the dark to tell its noise
 * there, far below that of the others, it gets the middle one's. */
static void share_dark_noise(noise_model m[3], int top)
{
    static const double far_below = 0.25; /* of the variance */
    const double code = 1.0 / top;
    double v[3];
    for (int c = 0; c < 3; c++) v[c] = noise_variance(&m[c], 0, code);
    double middle = fmax(fmin(v[0], v[1]), fmin(fmax(v[0], v[1]), v[2]));
    for (int c = 0; c < 3; c++)
        if (v[c] < far_below * middle) {
            m[c].code_var = 1.0 / 12;
            m[c].read = sqrt(fmax(middle - code * code / 12, 0));
        }
}

int job_calibrate(job *j, errmsg *e)
{
    int code = -1, recover;
    double *lnt = malloc(sizeof *lnt * (size_t)j->n);
    if (!lnt) return err_set(e, "out of memory");
    for (int k = 0; k < j->n; k++) lnt[k] = log(j->exposure[k]);
    if (collect_samples(j, e)) goto done;
    if (j->opts.align != ALIGN_NEVER && j->n > 1) {
        samples_free(&j->samples);
        if (job_align(j, e) || collect_samples(j, e)) goto done;
    }
    double t0 = job_cpu_s();
    if (check_stated(j, e) || first_response(j, lnt, e)) goto done;
    memcpy(j->response.clip, j->facts.clip, sizeof j->response.clip);
    /* hat weights on logarithms go with the curve that came from the same: both lean the same way */
    recover = strcmp(j->response.origin, "debevec") == 0 && j->opts.weight == MERGE_NOISE;
    calib_opts o = {.fit_response = recover,
                    .fit_noise = 1,
                    .fit_times = j->opts.refine_times,
                    .fixed_noise = {-1, -1, -1},
                    .lambda = j->opts.lambda,
                    .time_spread = 0.15};
    for (int c = 0; c < j->response.channels; c++) {
        int top = recover ? j->response.clip[c] : j->response.max_code; /* where e is 1 */
        j->noise[c] = noise_default();
        noise_model given = noise_from_camera(j->opts.gain > 0 ? j->opts.gain : 1, 0, top);
        if (j->opts.gain > 0) j->noise[c].photon = o.fixed_noise.photon = given.photon;
        if (j->opts.read_noise >= 0)
            j->noise[c].read = o.fixed_noise.read = j->opts.read_noise * given.photon;
    }
    o.reference = j->n / 2; /* by time */
    if (j->n > 1) {
        if (contradict_mark(&j->samples, &j->response, j->noise, lnt, e) ||
            calibrate(&j->response, j->noise, lnt, &j->facts.calib, &j->samples, &o, e))
            goto done;
        j->facts.calibrated = 1;
        if (frames_get_facts(j->frames)->raw && j->response.channels == 3 && !(j->opts.gain > 0))
            share_dark_noise(j->noise, j->response.max_code);
        if (contradict_measure(&j->facts.contradict, &j->samples, &j->response, j->noise, lnt, e)) goto done;
    }
    for (int k = 0; k < j->n; k++) j->exposure[k] = exp(lnt[k]);
    j->facts.recover_s += job_cpu_s() - t0;
    code = 0;
done:
    free(lnt);
    return code;
}

void job_close(job *j)
{
    frames_close(j->frames);
    response_free(&j->response);
    samples_free(&j->samples);
    free(j->exposure);
    free(j->align);
    free(j->dark);
    img_free(&j->radiance);
    free(j->sigma);
    free(j->count);
    free(j->flags);
}
