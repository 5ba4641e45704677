/*
 * hdrgen.c - the command: options, messages, order of events.  The stages are in job.h, the output
 * in output.h, the plot in plot.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/cli.h"
#include "job.h"
#include "notes.h"
#include "output.h"
#include "plot.h"

static struct {
    job_opts job;
    output_opts out;
    const char *times, *save_response, *plot;
    int verbose, strict, dry_run;
} set = {.job = {.lambda = 1, .gain = -1, .read_noise = -1, .memory = (int64_t)256 << 20}};

/* ---- values with a syntax of their own ----------------------------------------------------------- */

static int take_response(const char *v, void *arg, errmsg *e)
{
    job_opts *o = arg;
    static const struct {
        const char *name;
        response_kind kind;
    } named[] = {{"debevec", RESPONSE_DEBEVEC},
                 {"mitsunaga", RESPONSE_MITSUNAGA},
                 {"linear", RESPONSE_LINEAR},
                 {"srgb", RESPONSE_SRGB}};
    for (size_t i = 0; i < sizeof named / sizeof *named; i++)
        if (strcmp(v, named[i].name) == 0) {
            o->response = named[i].kind;
            return 0;
        }
    if (strncmp(v, "gamma:", 6) == 0) {
        o->response = RESPONSE_GAMMA;
        if (cli_parse_double(&o->gamma, v + 6, e)) return -1;
        return o->gamma >= 0.1 && o->gamma <= 10
                   ? 0
                   : err_set(e, "expected gamma:G with G from 0.1 to 10, found \"%s\"", v);
    }
    if (!*v) return err_set(e, "expected debevec, mitsunaga, linear, srgb, gamma:G or a file, found nothing");
    o->response = RESPONSE_FILE;
    o->response_file = v;
    return 0;
}

static int take_weight(const char *v, void *arg, errmsg *e)
{
    job_opts *o = arg;
    if (strcmp(v, "noise") == 0) o->weight = MERGE_NOISE;
    else if (strcmp(v, "debevec") == 0) o->weight = MERGE_DEBEVEC;
    else return err_set(e, "expected noise or debevec, found \"%s\"", v);
    return 0;
}

static int take_bayer(const char *v, void *arg, errmsg *e)
{
    job_opts *o = arg;
    static const char *const known[] = {"RGGB", "BGGR", "GRBG", "GBRG"};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (strcmp(v, known[i]) == 0) {
            o->bayer = (cfa){.columns = 2, .rows = 2};
            for (int p = 0; p < 4; p++) o->bayer.colour[p] = v[p] == 'R' ? 0 : v[p] == 'G' ? 1 : 2;
            return 0;
        }
    return err_set(e, "expected RGGB, BGGR, GRBG or GBRG, found \"%s\"", v);
}

static int take_fill(const char *v, void *arg, errmsg *e)
{
    job_opts *o = arg;
    double d[3];
    if (cli_parse_doubles(d, 3, v, ",", e)) return -1;
    for (int c = 0; c < 3; c++) {
        if (d[c] != floor(d[c]) || d[c] < 0 || d[c] > 65535)
            return err_set(e, "expected three codes R,G,B, found \"%s\"", v);
        o->fill[c] = (int)d[c];
    }
    o->has_fill = 1;
    return 0;
}

static int take_patch(const char *v, void *arg, errmsg *e)
{
    job_opts *o = arg;
    const char *eq = strchr(v, '=');
    char rect[128];
    if (!eq || (size_t)(eq - v) >= sizeof rect) return err_set(e, "expected X,Y,W,H=cd/m2, found \"%s\"", v);
    memcpy(rect, v, (size_t)(eq - v));
    rect[eq - v] = 0;
    if (cli_parse_doubles(o->patch, 4, rect, ",", e) || cli_parse_double(&o->patch[4], eq + 1, e)) return -1;
    for (int i = 0; i < 4; i++)
        if (o->patch[i] != floor(o->patch[i]) || o->patch[i] < (i < 2 ? 0 : 1) || o->patch[i] > 1e9)
            return err_set(e, "expected whole pixels X,Y,W,H, W and H above 0, found \"%s\"", rect);
    return o->patch[4] > 0 ? 0 : err_set(e, "expected a luminance above 0 cd/m2, found \"%s\"", eq + 1);
}

static int take_circle(const char *v, void *arg, errmsg *e)
{
    job_opts *o = arg;
    int whole = strchr(v, ',') != NULL;
    o->circle[0] = o->circle[1] = -1;
    if (whole ? cli_parse_doubles(o->circle, 3, v, ",", e) : cli_parse_double(&o->circle[2], v, e)) return -1;
    return o->circle[2] > 0 || (!whole && o->circle[2] == 0)
               ? 0
               : err_set(e,
                         "expected X,Y,R in pixels or R over half the shorter side, R above 0, found \"%s\"",
                         v);
}

static int take_colour(const char *v, void *arg, errmsg *e)
{
    job_opts *o = arg;
    static const colour_space known[] = {COLOUR_SRGB, COLOUR_CAMERA, COLOUR_XYZ, COLOUR_ACESCG};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (strcmp(v, colour_name(known[i])) == 0) {
            o->colour = known[i];
            return 0;
        }
    return err_set(e, "expected srgb, camera, xyz or acescg, found \"%s\"", v);
}

static int take_type(const char *v, void *arg, errmsg *e)
{
    output_opts *o = arg;
    if (strcmp(v, "half") == 0) o->type = OUTPUT_HALF;
    else if (strcmp(v, "float") == 0) o->type = OUTPUT_FLOAT;
    else return err_set(e, "expected half or float, found \"%s\"", v);
    return 0;
}

static int take_align(const char *v, void *arg, errmsg *e)
{
    job_opts *o = arg;
    if (!v || strcmp(v, "always") == 0) o->align = ALIGN_ALWAYS;
    else if (strcmp(v, "auto") == 0) o->align = ALIGN_AUTO;
    else if (strcmp(v, "never") == 0) o->align = ALIGN_NEVER;
    else return err_set(e, "expected auto, always or never, found \"%s\"", v);
    return 0;
}

static const cli_opt options[] = {
    {"output", 'o', CLI_STRING, &set.out.path, NULL, "OUT",
     "radiance: .exr or .hdr, \"-\" for .hdr on standard output"},
    {"times", 't', CLI_STRING, &set.times, NULL, "FILE",
     "exposure times: lines \"image seconds\" (default: from the images' EXIF data)"},
    {"response", 'r', CLI_CALL, &set.job, take_response, "KIND",
     "camera response: debevec or mitsunaga (recovered from the series; debevec is the\n"
     "default), linear (default for camera raw), srgb, gamma:G, or a file"},
    {"save-response", 0, CLI_STRING, &set.save_response, NULL, "FILE", "write the response as text"},
    {"lambda", 0, CLI_DOUBLE, &set.job.lambda, NULL, "L", "smoothness of the recovered response (default 1)"},
    {"plot", 0, CLI_STRING, &set.plot, NULL, "FILE.svg", "plot of the response and its sample points"},
    {"weight", 'w', CLI_CALL, &set.job, take_weight, "KIND",
     "noise: inverse variance (default); debevec: hat, zero at both ends"},
    {"gain", 0, CLI_DOUBLE, &set.job.gain, NULL, "E",
     "electrons per code of the linearised scale (default: estimated)"},
    {"read-noise", 0, CLI_DOUBLE, &set.job.read_noise, NULL, "E",
     "read noise in electrons, with --gain (default: estimated)"},
    {"refine-times", 0, CLI_FLAG, &set.job.refine_times, NULL, NULL,
     "estimate the times from the overlap; the middle one is held"},
    {"align", 0, CLI_MAYBE, &set.job, take_align, "WHEN",
     "put hand-held shots over the middle one: always (the default of --align; what can't be registered is "
     "refused), auto (move what is better for it), never (the default)"},
    {"flare", 0, CLI_FLAG, &set.job.flare, NULL, NULL,
     "take out the light that the lens scatters around lamps, where that is certain (with --circle also\n"
     "by what lies outside of it)"},
    {"deghost", 0, CLI_FLAG, &set.job.deghost, NULL, NULL,
     "leave out samples that contradict the other exposures"},
    {"sigma", 0, CLI_FLAG, &set.job.want_sigma, NULL, NULL,
     "add channels sigma.R, .G, .B: the standard deviation (OpenEXR)"},
    {"count", 0, CLI_FLAG, &set.job.want_count, NULL, NULL,
     "add channel exposures: how many had a say (least of the colours; OpenEXR)"},
    {"flags", 0, CLI_FLAG, &set.out.want_flags, NULL, NULL,
     "add channel flags: 1 clipped everywhere, 2 black everywhere, 4 one or the other\n"
     "everywhere, 8 samples left out by --deghost, 16 missing everywhere (OpenEXR)"},
    {"calibrate", 0, CLI_CALL, &set.job, take_patch, "X,Y,W,H=L",
     "scale so that this rectangle has L cd/m2 on average"},
    {"absolute", 0, CLI_FLAG, &set.job.absolute, NULL, NULL,
     "scale by time, f-number and ISO, good to half a stop; all must be known"},
    {"dark", 0, CLI_STRING, &set.job.dark, NULL, "FILE",
     "dark frame: its exposure is subtracted from every image"},
    {"flat", 0, CLI_STRING, &set.job.flat, NULL, "FILE",
     "flat field: the radiance is divided by it (mean 1)"},
    {"hot", 0, CLI_STRING, &set.job.hot, NULL, "FILE",
     "mask: pixels that aren't 0 in it are filled from their neighbours"},
    {"bayer", 0, CLI_CALL, &set.job, take_bayer, "ORDER",
     "grey images are a Bayer mosaic: RGGB, BGGR, GRBG or GBRG; merged, then interpolated"},
    {"colour", 0, CLI_CALL, &set.job, take_colour, "SPACE",
     "camera raw: srgb (linear, default), xyz, acescg, or camera: the sensor's own after\n"
     "white balance"},
    {"half-size", 0, CLI_FLAG, &set.job.half_size, NULL, NULL,
     "camera raw: one pixel for each 2x2 of the sensor"},
    {"bits", 0, CLI_INT, &set.job.bits, NULL, "B",
     "codes fill B bits of their files', from the lowest (default: all)"},
    {"white", 0, CLI_INT, &set.job.white, NULL, "CODE",
     "codes from this on are clipped (default: found from the series)"},
    {"fill", 0, CLI_CALL, &set.job, take_fill, "R,G,B",
     "pixels of exactly these codes are missing in that image"},
    {"circle", 0, CLI_CALL, &set.job, take_circle, "R|X,Y,R",
     "image circle of a fisheye: pixels outside of it are not counted as clipped or black; R over half the "
     "shorter side about the middle, or centre and "
     "radius in pixels (default, or 0: all count)"},
    {"dry-run", 0, CLI_FLAG, &set.dry_run, NULL, NULL,
     "check the options and the files that they name; read no image, write nothing"},
    {"type", 0, CLI_CALL, &set.out, take_type, "T", "OpenEXR values: float (default) or half"},
    {"compression", 0, CLI_STRING, &set.out.compression, NULL, "C",
     "OpenEXR: none, rle, zips, zip (default), piz or dwaa"},
    {"strict", 0, CLI_FLAG, &set.strict, NULL, NULL, "fail where the exposures contradict each other"},
    {"verbose", 'v', CLI_FLAG, &set.verbose, NULL, NULL, "say what was found, on standard error"},
    {0},
};

static const cli_choice choices[] = {
    {"response", "debevec mitsunaga linear srgb FILE"},
    {"weight", "noise debevec"},
    {"align", "always auto never"},
    {"bayer", "RGGB BGGR GRBG GBRG"},
    {"colour", "srgb xyz acescg camera"},
    {"type", "float half"},
    {"compression", "none rle zips zip piz dwaa"},
    {0},
};

static const cli_prog prog = {
    .name = "hdrgen",
    .operands = "-o OUT IMAGE...",
    .summary = "Merge an exposure series into one picture of radiance.",
    .opts = options,
    .choices = choices,
    .epilog = "Radiance is relative to the exposure that reaches the highest code in one second,\n"
              "unless --calibrate says what it is.\n"
              "Not to be confused with Greg Ward's program of the same name.",
};

/* ---- messages ---------------------------------------------------------------------------------------- */

static void report(const job *j)
{
    const frames_facts *f = frames_get_facts(j->frames);
    fprintf(stderr, "%d images, %dx%d, %d channel%s, codes 0..%d; response %s\n", f->n, f->width, f->height,
            f->channels, f->channels == 1 ? "" : "s", f->max_code, j->response.origin);
    report_shots(j);
    for (int c = 0; c < j->response.channels; c++) {
        const noise_model *n = &j->noise[c];
        if (j->facts.solve.condition[c] > 0)
            fprintf(stderr, "channel %d: first response from %d pixels, condition %.3g, residual %.3g\n", c,
                    j->facts.solve.pixels[c], j->facts.solve.condition[c], j->facts.solve.residual[c]);
        if (j->facts.calibrated)
            fprintf(stderr, "channel %d: refined on %d pixels in %d rounds, condition %.3g, chi2 %.3f\n", c,
                    j->facts.calib.pixels[c], j->facts.calib.rounds, j->facts.calib.condition[c],
                    j->facts.calib.chi2[c]);
        fprintf(stderr, "channel %d: variance %.4g e + %.4g^2 + %.4g (code)^2", c, n->photon, n->read,
                n->code_var);
        if (n->photon > 0)
            fprintf(stderr, ": %.0f electrons at the highest code, read noise %.2f electrons", 1 / n->photon,
                    n->read / n->photon);
        fputc('\n', stderr);
    }
    const contradict_facts *d = &j->facts.contradict;
    fprintf(stderr,
            "neighbouring exposures differ by %.3f stops rms, %.3g %% of pixels by more than a quarter, "
            "cause %d\n",
            d->stops, 100 * d->share, (int)d->cause);
    fprintf(stderr, "CPU s: reading %.3f, aligning %.3f, recovering %.3f, merging %.3f, flare %.3f\n",
            j->facts.read_s, j->facts.align_s, j->facts.recover_s, j->facts.merge_s - j->facts.flare_s,
            j->facts.flare_s);
}

static void report_times(const job *j)
{
    for (int k = 0; k < j->n; k++)
        cli_note("%s: %.6g s, refined %.6g s (%+.2f %%)", j->shots[k].path, j->shots[k].exposure,
                 j->exposure[k], 100 * (j->exposure[k] / j->shots[k].exposure - 1));
}

static void report_motions(const job *j)
{
    const frames_facts *f = frames_get_facts(j->frames);
    for (int k = 0; k < j->n; k++) {
        const align_shot *a = &j->align[k];
        if (k == j->n / 2) cli_note("%s: the others are put over this one", j->shots[k].path);
        else if (!a->registered)
            cli_warn(
                "%s: can't be registered against its neighbour (correlation %.2f): left where that one is",
                j->shots[k].path, a->after);
        else
            cli_note("%s: %s by up to %.2f pixels, %+.3f degrees; correlation with its neighbour %.4f, %.4f "
                     "without",
                     j->shots[k].path, a->moves ? "moved" : "not moved: off",
                     align_reach(&a->m, f->width, f->height), a->m.angle * 180 / acos(-1), a->after,
                     a->before);
    }
}

static void note_pixels(long n, const job *j, const char *what)
{
    if (n)
        cli_note("%ld pixels (%.3g %%%s) %s", n, 100.0 * (double)n / (double)j->facts.counted,
                 j->opts.circle[2] > 0 ? " of the circle" : "", what);
}

/* Where white was found below the files' highest code, by more than rounding. */
static void note_white(const job *j)
{
    const int *w = j->facts.clip, top = j->samples.max_code, n = j->samples.channels;
    const int *known = frames_get_facts(j->frames)->clip; /* camera raw states it */
    int low = top, found = 0;
    for (int c = 0; c < n; c++) {
        low = w[c] < low ? w[c] : low;
        found |= w[c] < known[c];
    }
    if (!found || j->opts.white || low >= top - top / 255) return;
    if (n == 1 || (w[0] == w[1] && w[1] == w[2]))
        cli_note("%s: white lies at code %d of %d in this series: from there on is clipped (--white says "
                 "otherwise)",
                 j->shots[0].path, low, top);
    else
        cli_note("%s: white lies at codes %d, %d, %d of %d in this series: from there on is clipped (--white "
                 "says otherwise)",
                 j->shots[0].path, w[0], w[1], w[2], top);
}

/* One line on exposures that contradict each other, with what the pattern tells of the cause. */
static void contradiction(char *words, size_t size, const job *j)
{
    const contradict_facts *d = &j->facts.contradict;
    int n = snprintf(words, size,
                     "the exposures disagree by %.2f stop rms (.1 is usual), %.2g %% of the pixels by more "
                     "than a quarter: ",
                     d->stops, 100 * d->share);
    if (n < 0 || (size_t)n >= size) return;
    words += n;
    size -= (size_t)n;
    switch (d->cause) {
    case CAUSE_EXPOSURE:
        snprintf(words, size,
                 "%s is off by %+.1f stop: wrong time, other settings, moved camera or tone mapping?",
                 j->shots[d->exposure].path, d->off);
        break;
    case CAUSE_REGION: snprintf(words, size, "most of it in few places: something moving?"); break;
    case CAUSE_CAMERA: snprintf(words, size, "most of it at edges: moved camera?"); break;
    case CAUSE_CURVE:
        snprintf(words, size,
                 "no one curve fits them: wrong times, tone mapping, other settings or moved camera?");
        break;
    default: snprintf(words, size, "moved camera, something moving, tone mapping or wrong times?");
    }
}

static void say_contradiction(const job *j)
{
    char words[1024];
    if (!contradict_matters(&j->facts.contradict)) return;
    contradiction(words, sizeof words, j);
    if (set.strict) cli_fail(CLI_FAILED, "%s", words);
    cli_note("%s", words);
}

static void summary(const job *j)
{
    notes_exposures(j);
    notes_turn(j);
    if (j->facts.bits_used)
        cli_warn("%s: the codes of this series end at %d, where files of this kind end at %d: if that is "
                 "where the camera clips, give --bits %d",
                 j->shots[0].path, (1 << j->facts.bits_used) - 1, frames_get_facts(j->frames)->max_code,
                 j->facts.bits_used);
    note_white(j);
    if (j->opts.absolute && !(j->opts.patch[2] > 0))
        cli_note("absolute by ISO 12232: the highest code in one second is %.4g cd/m2, give or take half a "
                 "stop (speed, lens transmission)",
                 179 * j->facts.scale);
    if (j->align) report_motions(j);
    notes_colours(j);
    notes_flare(j);
    note_pixels(j->facts.clipped, j, "clipped in every exposure: lower bound");
    note_pixels(j->facts.black, j, "black in every exposure: upper bound");
    note_pixels(j->facts.gap, j, "clipped or black in every exposure: between two bounds");
    note_pixels(j->facts.missing, j, "missing in every exposure: 0, and alpha 0 in OpenEXR");
    note_pixels(j->facts.ghosts, j, "with samples left out by --deghost");
}

static void check_usage(int images)
{
    const job_opts *o = &set.job;
    if (!set.out.path) cli_fail(CLI_USAGE, "expected -o OUT, found none");
    if (o->bits && (o->bits < 2 || o->bits > 16))
        cli_fail(CLI_USAGE, "--bits: expected 2 to 16, found %d", o->bits);
    if (o->white && (o->white < 4 || o->white > 65535))
        cli_fail(CLI_USAGE, "--white: expected a code from 4 to 65535, found %d", o->white);
    if (images < 1) cli_fail(CLI_USAGE, "expected one image or more, found none");
    if (images > MERGE_MOST) cli_fail(CLI_USAGE, "expected at most %d images, found %d", MERGE_MOST, images);
    if (!(o->lambda >= 1e-12 && o->lambda <= 1e12))
        cli_fail(CLI_USAGE, "--lambda: expected 1e-12 to 1e12, found %g", o->lambda);
    if (o->gain != -1 && !(o->gain > 0 && o->gain <= 1e9))
        cli_fail(CLI_USAGE, "--gain: expected electrons per code above 0, found %g", o->gain);
    if (o->read_noise != -1 && !(o->read_noise >= 0 && o->read_noise <= 1e6))
        cli_fail(CLI_USAGE, "--read-noise: expected electrons, 0 or more, found %g", o->read_noise);
    if (o->read_noise >= 0 && !(o->gain > 0))
        cli_fail(CLI_USAGE, "--read-noise: expected --gain with it, found none");
    if (o->align != ALIGN_NEVER && (o->dark || o->hot || o->flat))
        cli_fail(CLI_USAGE,
                 "--align: expected neither --dark, --hot nor --flat with it (they belong to the sensor's "
                 "pixels), found %s",
                 o->dark  ? "--dark"
                 : o->hot ? "--hot"
                          : "--flat");
    size_t n = strlen(set.out.path);
    const char *end = n > 4 ? set.out.path + n - 4 : "";
    int exr = strcmp(end, ".exr") == 0;
    if (!exr && strcmp(end, ".hdr") != 0 && strcmp(set.out.path, "-") != 0)
        cli_fail(CLI_USAGE, "-o: expected a name that ends in .exr or .hdr, found %s", set.out.path);
    if (!exr && o->colour == COLOUR_XYZ)
        cli_fail(CLI_USAGE, "--colour xyz: expected an output named .exr, found %s", set.out.path);
    if (!exr && (o->want_sigma || o->want_count || set.out.want_flags))
        cli_fail(CLI_USAGE, "--sigma, --count, --flags: expected an output named .exr, found %s",
                 set.out.path);
}

/* The options are right by now; are the files that they name there? */
static int dry_run(void)
{
    errmsg e;
    response r = {0};
    const char *const files[] = {set.times, set.job.dark, set.job.flat, set.job.hot};
    if (set.job.response == RESPONSE_FILE) {
        if (response_load(&r, set.job.response_file, 3, 255, &e)) cli_fail(CLI_FAILED, "%s", e.text);
        response_free(&r);
    }
    for (size_t k = 0; k < sizeof files / sizeof *files; k++)
        if (files[k] && access(files[k], R_OK) != 0)
            cli_fail(CLI_FAILED, "%s: %s", files[k], strerror(errno));
    return cli_end(CLI_OK);
}

int main(int argc, char **argv)
{
    errmsg e;
    output_type used;
    job j = {.progress = cli_progress};
    char *command = cli_command_line(&prog, argc, argv); /* before options are moved */
    j.n = cli_parse(&prog, argc, argv);
    check_usage(j.n);
    if (set.dry_run) {
        free(command);
        return dry_run();
    }
    j.opts = set.job;
    set.out.command = command;
    j.shots = calloc((size_t)j.n, sizeof *j.shots);
    if (!j.shots) cli_fail(CLI_FAILED, "out of memory");
    for (int k = 0; k < j.n; k++) j.shots[k].path = argv[k + 1];
    if (job_open(&j, set.times, &e) || job_calibrate(&j, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    say_contradiction(&j);
    if (job_merge(&j, &e)) cli_fail(CLI_FAILED, "%s", e.text);
    if (set.verbose) report(&j);
    if ((set.save_response && response_save(&j.response, set.save_response, &e)) ||
        (set.plot && plot_response(&j, set.plot, &e)) || output_write(&j, &set.out, &used, &e))
        cli_fail(CLI_FAILED, "%s", e.text);
    if (set.job.refine_times) report_times(&j);
    summary(&j);
    if (used != set.out.type) cli_note("%s: values beyond what half can hold: float written", set.out.path);
    free(j.shots);
    job_close(&j);
    free(command);
    return cli_end(CLI_OK);
}
