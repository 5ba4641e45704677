/*
 * job.c - the stages of one series: open, calibrate, merge.
 */
#include "job.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "cli.h"
#include "exif.h"
#include "samples.h"

enum { WANTED_SAMPLES = 40000 };

static double cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int channels_of(const job *j)
{
    return j->opts.bayer ? 3 : frames_get_facts(j->frames)->channels;
}

int job_open(job *j, const char *times_file, errmsg *e)
{
    char **paths = calloc((size_t)j->n, sizeof *paths);
    if (!paths)
        return err_set(e, "out of memory");
    for (int k = 0; k < j->n; k++)
        paths[k] = (char *)(uintptr_t)j->shots[k].path;
    int bad = frames_open(&j->frames, paths, j->n, j->opts.memory, j->opts.fill, e);
    free(paths);
    if (bad)
        return -1;
    for (int k = 0; k < j->n; k++) {
        const img_info *i = frames_info(j->frames, k);
        exif_facts x = exif_read(j->shots[k].path);
        j->shots[k].seconds = i->exposure_s > 0 ? i->exposure_s : x.exposure_s;
        j->shots[k].f_number = i->f_number > 0 ? i->f_number : x.f_number;
        j->shots[k].iso = i->iso > 0 ? i->iso : x.iso;
    }
    if (times_file && times_load(j->shots, j->n, times_file, e))
        return -1;
    int varies;
    if (j->n == 1 && !(j->shots[0].seconds > 0)) {
        j->shots[0].seconds = 1; /* one picture of unknown time: radiance is relative anyway */
        cli_note("%s: no exposure time, 1 s assumed", j->shots[0].path);
    }
    if (shots_resolve(j->shots, j->n, &varies, e))
        return -1;
    if (varies)
        cli_note("ISO or f-number vary: taken into account relative to %s", j->shots[0].path);
    j->exposure = calloc((size_t)j->n, sizeof *j->exposure);
    if (!j->exposure)
        return err_set(e, "out of memory");
    for (int k = 0; k < j->n; k++)
        j->exposure[k] = j->shots[k].exposure;
    return 0;
}

static int collect_samples(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    sampler p;
    const uint16_t **codes = calloc((size_t)j->n, sizeof *codes);
    if (!codes)
        return err_set(e, "out of memory");
    if (sampler_init(&p, f->width, f->height, j->n, channels_of(j), f->max_code, j->opts.bayer,
                     WANTED_SAMPLES, e)) {
        free(codes);
        return -1;
    }
    int rows, y = 0;
    for (;;) {
        double t0 = cpu_s();
        rows = frames_next(j->frames, codes, e);
        double t1 = cpu_s();
        j->facts.read_s += t1 - t0;
        if (rows <= 0)
            break;
        sampler_strip(&p, codes, y, rows);
        j->facts.recover_s += cpu_s() - t1;
        y += rows;
        cli_progress("reading", y, f->height);
    }
    free(codes);
    if (rows < 0 || frames_rewind(j->frames, e)) {
        samples_free(&p.s);
        return -1;
    }
    j->samples = p.s;
    return 0;
}

static int same_exposure(const job *j)
{
    for (int k = 1; k < j->n; k++)
        if (fabs(log(j->exposure[k] / j->exposure[0])) > 1e-6)
            return 0;
    return 1;
}

static int first_response(job *j, const double *lnt, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int ch = channels_of(j);
    response_kind kind = j->opts.response;
    if (kind == RESPONSE_AUTO)
        kind = f->raw ? RESPONSE_LINEAR : RESPONSE_DEBEVEC;
    if (kind == RESPONSE_DEBEVEC || kind == RESPONSE_MITSUNAGA) {
        if (j->n < 2)
            return err_set(e, "%s: expected two images or more to recover a response, found one: give --response",
                           j->shots[0].path);
        if (same_exposure(j))
            return err_set(e, "%s: expected images of different exposure to recover a response, found %d of the same: "
                           "give --response", j->shots[0].path, j->n);
    }
    switch (kind) {
    case RESPONSE_LINEAR:
        return response_linear(&j->response, ch, f->max_code, e);
    case RESPONSE_SRGB:
        return response_srgb(&j->response, ch, f->max_code, e);
    case RESPONSE_GAMMA:
        return response_gamma(&j->response, ch, f->max_code, j->opts.gamma, e);
    case RESPONSE_FILE:
        return response_load(&j->response, j->opts.response_file, ch, f->max_code, e);
    case RESPONSE_MITSUNAGA:
        return mitsunaga_solve(&j->response, &j->facts.solve, &j->samples, lnt, e);
    default:
        return debevec_solve(&j->response, &j->facts.solve, &j->samples, lnt, j->opts.lambda, e);
    }
}

int job_calibrate(job *j, errmsg *e)
{
    int code = -1, recover;
    double *lnt = malloc(sizeof *lnt * (size_t)j->n);
    if (!lnt)
        return err_set(e, "out of memory");
    for (int k = 0; k < j->n; k++)
        lnt[k] = log(j->exposure[k]);
    if (collect_samples(j, e))
        goto done;
    double t0 = cpu_s();
    if (first_response(j, lnt, e))
        goto done;
    recover = strcmp(j->response.origin, "debevec") == 0;
    calib_opts o = {.fit_response = recover, .fit_noise = 1, .fit_times = j->opts.refine_times,
                    .fixed_noise = {-1, -1, -1}, .lambda = j->opts.lambda, .time_spread = 0.15};
    int top = j->response.max_code;
    for (int c = 0; c < j->response.channels; c++) {
        j->noise[c] = noise_default();
        noise_model given = noise_from_camera(j->opts.gain > 0 ? j->opts.gain : 1, 0, top);
        if (j->opts.gain > 0)
            j->noise[c].photon = o.fixed_noise.photon = given.photon;
        if (j->opts.read_noise >= 0)
            j->noise[c].read = o.fixed_noise.read = j->opts.read_noise * given.photon;
    }
    /* the middle exposure by time is the one held */
    for (int k = 0; k < j->n; k++) {
        int shorter = 0;
        for (int i = 0; i < j->n; i++)
            shorter += lnt[i] < lnt[k] || (lnt[i] == lnt[k] && i < k);
        if (shorter == j->n / 2)
            o.reference = k;
    }
    if (j->n > 1) {
        if (calibrate(&j->response, j->noise, lnt, &j->facts.calib, &j->samples, &o, e))
            goto done;
        j->facts.calibrated = 1;
    }
    for (int k = 0; k < j->n; k++)
        j->exposure[k] = exp(lnt[k]);
    j->facts.recover_s += cpu_s() - t0;
    code = 0;
done:
    free(lnt);
    return code;
}

static int allocate_outputs(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int ch = channels_of(j);
    size_t pixels = (size_t)f->width * (size_t)f->height;
    if (img_alloc(&j->radiance, f->width, f->height, ch, e))
        return -1;
    if (j->opts.want_sigma)
        j->sigma = malloc(pixels * (size_t)ch * sizeof *j->sigma);
    if (j->opts.want_count)
        j->count = malloc(pixels);
    j->flags = malloc(pixels);
    if ((j->opts.want_sigma && !j->sigma) || (j->opts.want_count && !j->count) || !j->flags)
        return err_set(e, "out of memory for %dx%d pixels", f->width, f->height);
    return 0;
}

/* One row, all channels; scratch: 2*width bytes. */
static void merge_one_row(job *j, const merge *m, const uint16_t *const *codes, int y, int row,
                          uint8_t *scratch, const uint16_t **at)
{
    const frames_facts *f = frames_get_facts(j->frames);
    int w = f->width, ch = f->channels;
    size_t out = (size_t)y * (size_t)w;
    uint8_t *count = scratch, *flags = scratch + w;
    memset(j->flags + out, 0, (size_t)w);
    if (j->count)
        memset(j->count + out, 255, (size_t)w);
    for (int c = 0; c < ch; c++) {
        for (int k = 0; k < j->n; k++)
            at[k] = codes[k] + (size_t)row * (size_t)w * (size_t)ch + (size_t)c;
        merge_row r = {.codes = at, .stride = (size_t)ch, .count = w,
                       .radiance = j->radiance.pix + out * (size_t)ch + (size_t)c,
                       .sigma = j->sigma ? j->sigma + out * (size_t)ch + (size_t)c : NULL,
                       .used = j->count ? count : NULL, .flags = flags, .out_stride = (size_t)ch};
        merge_do_row(m, c, &r);
        for (int x = 0; x < w; x++) {
            j->flags[out + (size_t)x] |= flags[x];
            if (j->count && count[x] < j->count[out + (size_t)x])
                j->count[out + (size_t)x] = count[x];
        }
    }
}

static void count_flags(job *j)
{
    size_t pixels = (size_t)j->radiance.info.width * (size_t)j->radiance.info.height;
    for (size_t i = 0; i < pixels; i++) {
        j->facts.clipped += (j->flags[i] & MERGE_CLIPPED) != 0;
        j->facts.black += (j->flags[i] & MERGE_BLACK) != 0;
        j->facts.gap += (j->flags[i] & MERGE_GAP) != 0;
        j->facts.ghosts += (j->flags[i] & MERGE_GHOST) != 0;
    }
}

int job_merge(job *j, errmsg *e)
{
    const frames_facts *f = frames_get_facts(j->frames);
    const uint16_t **codes = calloc((size_t)j->n, sizeof *codes);
    double t0 = cpu_s();
    merge *m = merge_new(&j->response, j->noise, j->exposure, j->n, j->opts.weight, j->opts.deghost, e);
    int rows = -1, y = 0, failed = 0;
    if (!codes || !m || allocate_outputs(j, e)) {
        if (!codes)
            err_set(e, "out of memory");
        goto done;
    }
    j->facts.merge_s += cpu_s() - t0;
    for (;;) {
        t0 = cpu_s();
        rows = frames_next(j->frames, codes, e);
        double t1 = cpu_s();
        j->facts.read_s += t1 - t0;
        if (rows <= 0)
            break;
#pragma omp parallel
        {
            uint8_t *scratch = malloc((size_t)f->width * 2);
            const uint16_t **at = malloc(sizeof *at * (size_t)j->n);
            if (!scratch || !at) {
#pragma omp atomic write
                failed = 1;
            }
#pragma omp for schedule(static)
            for (int row = 0; row < rows; row++)
                if (scratch && at)
                    merge_one_row(j, m, codes, y + row, row, scratch, at);
            free(scratch);
            free(at);
        }
        j->facts.merge_s += cpu_s() - t1;
        y += rows;
        cli_progress("merging", y, f->height);
    }
    if (failed)
        rows = err_set(e, "out of memory");
    if (rows == 0)
        count_flags(j);
done:
    free(codes);
    merge_free(m);
    return rows;
}

void job_close(job *j)
{
    frames_close(j->frames);
    response_free(&j->response);
    samples_free(&j->samples);
    free(j->exposure);
    img_free(&j->radiance);
    free(j->sigma);
    free(j->count);
    free(j->flags);
}
