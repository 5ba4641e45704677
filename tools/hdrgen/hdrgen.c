/*
 * hdrgen.c - the command: options, messages, outputs.  The stages are in job.c.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"
#include "job.h"

typedef struct settings {
    job_opts job;
    const char *out, *times, *save_response;
    int verbose;
} settings;

static settings set = {.job = {.lambda = 1, .gain = -1, .read_noise = -1, .memory = (int64_t)256 << 20}};

static int take_response(const char *v, void *arg, errmsg *e)
{
    job_opts *o = arg;
    static const struct {
        const char *name;
        response_kind kind;
    } named[] = {{"debevec", RESPONSE_DEBEVEC}, {"mitsunaga", RESPONSE_MITSUNAGA},
                 {"linear", RESPONSE_LINEAR}, {"srgb", RESPONSE_SRGB}};
    for (size_t i = 0; i < sizeof named / sizeof *named; i++)
        if (strcmp(v, named[i].name) == 0) {
            o->response = named[i].kind;
            return 0;
        }
    if (strncmp(v, "gamma:", 6) == 0) {
        o->response = RESPONSE_GAMMA;
        if (cli_parse_double(&o->gamma, v + 6, e))
            return -1;
        return o->gamma >= 0.1 && o->gamma <= 10
                   ? 0 : err_set(e, "expected gamma:G with G from 0.1 to 10, found \"%s\"", v);
    }
    if (!*v)
        return err_set(e, "expected debevec, mitsunaga, linear, srgb, gamma:G or a file, found nothing");
    o->response = RESPONSE_FILE;
    o->response_file = v;
    return 0;
}

static int take_weight(const char *v, void *arg, errmsg *e)
{
    job_opts *o = arg;
    if (strcmp(v, "noise") == 0)
        o->weight = MERGE_NOISE;
    else if (strcmp(v, "debevec") == 0)
        o->weight = MERGE_DEBEVEC;
    else
        return err_set(e, "expected noise or debevec, found \"%s\"", v);
    return 0;
}

static const cli_opt options[] = {
    {"response", 'r', CLI_CALL, &set.job, take_response, "KIND",
     "camera response: debevec or mitsunaga (recovered from the series; debevec is the\n"
     "default), linear (default for camera raw), srgb, gamma:G, or a file"},
    {"save-response", 0, CLI_STRING, &set.save_response, NULL, "FILE", "write the response as text"},
    {"weight", 'w', CLI_CALL, &set.job, take_weight, "KIND",
     "noise: inverse variance (default); debevec: hat, zero at both ends"},
    {"times", 't', CLI_STRING, &set.times, NULL, "FILE",
     "exposure times: lines \"image seconds\" (default: from the images' EXIF data)"},
    {"sigma", 0, CLI_FLAG, &set.job.want_sigma, NULL, NULL,
     "add channels sigma.R, sigma.G, sigma.B: the standard deviation (OpenEXR only)"},
    {"lambda", 0, CLI_DOUBLE, &set.job.lambda, NULL, "L", "smoothness of the recovered response (default 1)"},
    {"verbose", 'v', CLI_FLAG, &set.verbose, NULL, NULL, "say what was found, on standard error"},
    {"output", 'o', CLI_STRING, &set.out, NULL, "OUT", "radiance, .exr or .hdr"},
    {0},
};

static const cli_prog prog = {
    .name = "hdrgen",
    .operands = "-o OUT IMAGE...",
    .summary = "Merge an exposure series into one picture of radiance.",
    .opts = options,
};

static void report(const job *j)
{
    const frames_facts *f = frames_get_facts(j->frames);
    fprintf(stderr, "%d images, %dx%d, %d channel%s, codes 0..%d\n", f->n, f->width, f->height,
            f->channels, f->channels == 1 ? "" : "s", f->max_code);
    for (int c = 0; c < j->response.channels; c++) {
        const noise_model *n = &j->noise[c];
        if (j->facts.solve.condition[c] > 0)
            fprintf(stderr, "channel %d: first response from %d pixels, condition %.3g, residual %.3g\n", c,
                    j->facts.solve.pixels[c], j->facts.solve.condition[c], j->facts.solve.residual[c]);
        if (j->facts.calibrated)
            fprintf(stderr, "channel %d: refined on %d pixels in %d rounds, condition %.3g, chi2 %.3f\n", c,
                    j->facts.calib.pixels[c], j->facts.calib.rounds + 1, j->facts.calib.condition[c],
                    j->facts.calib.chi2[c]);
        fprintf(stderr, "channel %d: %.0f electrons at the highest code, read noise %.2f electrons, code variance %.3f\n",
                c, n->photon > 0 ? 1 / n->photon : INFINITY, n->photon > 0 ? n->read / n->photon : 0, n->code_var);
    }
    fprintf(stderr, "CPU s: reading %.3f, recovering %.3f, merging %.3f\n", j->facts.read_s,
            j->facts.recover_s, j->facts.merge_s);
}

static void summary(const job *j)
{
    double pixels = (double)j->radiance.info.width * j->radiance.info.height;
    if (j->facts.clipped)
        cli_note("%ld pixels (%.3g %%) clipped in every exposure: lower bound", j->facts.clipped,
                 100.0 * (double)j->facts.clipped / pixels);
    if (j->facts.black)
        cli_note("%ld pixels (%.3g %%) black in every exposure: upper bound", j->facts.black,
                 100.0 * (double)j->facts.black / pixels);
    if (j->facts.gap)
        cli_note("%ld pixels (%.3g %%) clipped or black in every exposure: between two bounds", j->facts.gap,
                 100.0 * (double)j->facts.gap / pixels);
}

static int write_output(const job *j, const char *command, errmsg *e)
{
    static const char *const rgb[] = {"sigma.R", "sigma.G", "sigma.B"};
    static const char *const grey[] = {"sigma.Y"};
    img_plane planes[3];
    int ch = j->radiance.info.channels, half = 1;
    size_t values = (size_t)j->radiance.info.width * (size_t)j->radiance.info.height * (size_t)ch;
    float most = 0, least = INFINITY;
    for (size_t i = 0; i < values; i++) {
        most = fmaxf(most, j->radiance.pix[i]);
        if (j->radiance.pix[i] > 0)
            least = fminf(least, j->radiance.pix[i]);
    }
    /* half keeps 11 bits from 6.1e-5 to 65504 only */
    if (most > 65504 || least < 6.2e-5f)
        half = 0;
    img_write_opts w = {.type = half ? IMG_HALF : IMG_FLOAT, .comment = command};
    w.type = IMG_FLOAT;
    if (j->sigma) {
        for (int c = 0; c < ch; c++)
            planes[c] = (img_plane){ch == 1 ? grey[c] : rgb[c], j->sigma + c, (size_t)ch, IMG_FLOAT};
        w.planes = planes;
        w.nplanes = ch;
    }
    return img_write(&j->radiance, set.out, &w, e);
}

int main(int argc, char **argv)
{
    errmsg e;
    job j = {0};
    char *command = cli_command_line(&prog, argc, argv);
    j.n = cli_parse(&prog, argc, argv);
    if (!set.out)
        cli_fail(CLI_USAGE, "expected -o OUT, found none");
    if (j.n < 1)
        cli_fail(CLI_USAGE, "expected one image or more, found none");
    if (!(set.job.lambda >= 1e-12 && set.job.lambda <= 1e12))
        cli_fail(CLI_USAGE, "--lambda: expected 1e-12 to 1e12, found %g", set.job.lambda);
    j.opts = set.job;
    j.shots = calloc((size_t)j.n, sizeof *j.shots);
    if (!j.shots)
        cli_fail(CLI_FAILED, "out of memory");
    for (int k = 0; k < j.n; k++)
        j.shots[k].path = argv[k + 1];
    if (job_open(&j, set.times, &e) || job_calibrate(&j, &e) || job_merge(&j, &e))
        cli_fail(CLI_FAILED, "%s", e.text);
    if (set.verbose)
        report(&j);
    summary(&j);
    if (set.save_response && response_save(&j.response, set.save_response, &e))
        cli_fail(CLI_FAILED, "%s", e.text);
    if (write_output(&j, command, &e))
        cli_fail(CLI_FAILED, "%s", e.text);
    free(j.shots);
    job_close(&j);
    free(command);
    return cli_end(CLI_OK);
}
