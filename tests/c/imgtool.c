/*
 * imgtool.c - test driver for common/image.h.
 *
 *   imgtool probe FILE              what img_probe says
 *   imgtool dump FILE OUT.f32       width height channels, then all floats, whole picture at once
 *   imgtool rows FILE OUT.f32       the same through the row stream, in uneven portions
 *   imgtool stream FILE             read all rows, one at a time; print peak memory in KiB
 *   imgtool linear FILE OUT.f32     the same after img_linearise_srgb
 *   imgtool convert FILE OUT        img_load, img_write
 */
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "base/outfile.h"
#include "image/image.h"

static const char *type, *compression, *comment;
static int extra;
static double scale = 1;
static img_open_opts how;

static const cli_opt opts[] = {
    {"type", 0, CLI_STRING, &type, NULL, "T", "half or float (default: no options at all)"},
    {"compression", 0, CLI_STRING, &compression, NULL, "C", "as in image.h"},
    {"comment", 0, CLI_STRING, &comment, NULL, "TEXT", "comment of the output"},
    {"extra", 0, CLI_FLAG, &extra, NULL, NULL,
     "write planes sigma.R (half) and count (float) and attributes of every kind"},
    {"scale", 0, CLI_DOUBLE, &scale, NULL, "X", "multiply the values before writing"},
    {"keep-orientation", 0, CLI_FLAG, &how.keep_orientation, NULL, NULL, "pixels as they lie in the file"},
    {"keep-aspect", 0, CLI_FLAG, &how.keep_aspect, NULL, NULL, "oblong pixels as they are"},
    {"layer", 0, CLI_STRING, &how.layer, NULL, "NAME", "of an EXR"},
    {0},
};
static const cli_prog prog = {
    "imgtool", "probe|dump|rows|stream|linear|convert FILE [OUT]", "Tests picture I/O.", opts, NULL, NULL};

static void print_info(const img_info *i)
{
    printf("%s %dx%d channels=%d coded=%d max=%g exposure=%.9g f=%.9g iso=%.9g orientation=%d aspect=%.9g "
           "panorama=%d\n",
           i->format, i->width, i->height, i->channels, i->coded, i->max_code, i->exposure_s, i->f_number,
           i->iso, i->orientation, i->pixel_aspect, i->panorama);
}

static void save(const img *im, const char *path)
{
    errmsg e;
    outfile *o;
    const int size[3] = {im->info.width, im->info.height, im->info.channels};
    if (out_begin(&o, path, &e) < 0) cli_fail(CLI_FAILED, "%s", e.text);
    fwrite(size, sizeof size, 1, out_stream(o));
    fwrite(im->pix, sizeof *im->pix, (size_t)size[0] * (size_t)size[1] * (size_t)size[2], out_stream(o));
    if (out_commit(o, &e) < 0) cli_fail(CLI_FAILED, "%s", e.text);
}

static void load_rows(img *im, const char *path)
{
    errmsg e;
    img_reader *r;
    if (img_reader_open_as(&r, path, &how, &e) < 0) cli_fail(CLI_FAILED, "%s", e.text);
    const img_info *i = img_reader_info(r);
    im->info = *i;
    size_t stride = (size_t)i->width * (size_t)i->channels;
    im->pix = malloc(stride * (size_t)i->height * sizeof *im->pix);
    if (!im->pix) cli_fail(CLI_FAILED, "%s: out of memory", path);
    for (int y = 0, step = 1; y < i->height; step = step % 7 + 1) {
        int n = i->height - y < step ? i->height - y : step;
        if (img_reader_rows(r, im->pix + stride * (size_t)y, n, &e) < 0) {
            img_reader_close(r);
            cli_fail(CLI_FAILED, "%s", e.text);
        }
        y += n;
    }
    float past[4];
    if (img_reader_rows(r, past, 1, &e) == 0) cli_fail(CLI_FAILED, "a row beyond the last one was given");
    img_reader_close(r);
}

static void stream(const char *path)
{
    errmsg e;
    img_reader *r;
    if (img_reader_open_as(&r, path, &how, &e) < 0) cli_fail(CLI_FAILED, "%s", e.text);
    const img_info *i = img_reader_info(r);
    float *row = malloc((size_t)i->width * (size_t)i->channels * sizeof *row);
    if (!row) cli_fail(CLI_FAILED, "out of memory");
    for (int y = 0; y < i->height; y++)
        if (img_reader_rows(r, row, 1, &e) < 0) cli_fail(CLI_FAILED, "%s", e.text);
    free(row);
    img_reader_close(r);
    char line[256];
    FILE *status = fopen("/proc/self/status", "r"); /* getrusage() counts what was before exec() too */
    while (status && fgets(line, sizeof line, status))
        if (strncmp(line, "VmHWM:", 6) == 0) printf("%ld\n", strtol(line + 6, NULL, 10));
    if (status) fclose(status);
}

static void write_extra(const img *im, const char *path, img_write_opts *w)
{
    errmsg e;
    size_t n = (size_t)im->info.width * (size_t)im->info.height;
    float *two = malloc(2 * n * sizeof *two);
    if (!two) cli_fail(CLI_FAILED, "out of memory");
    for (size_t i = 0; i < n; i++) {
        two[2 * i] = (float)(i % 2048);
        two[2 * i + 1] = (float)i + 0.1f;
    }
    const float list[3] = {1.5f, 2.5f, -3.5f};
    const img_plane planes[2] = {{"sigma.R", two, 2, IMG_HALF}, {"count", two + 1, 2, IMG_FLOAT}};
    const img_attr attrs[5] = {{.name = "owner", .kind = IMG_ATTR_STRING, .s = "nobody"},
                               {.name = "expTime", .kind = IMG_ATTR_FLOAT, .v = {0.25}},
                               {.name = "ilf:origin", .kind = IMG_ATTR_V3F, .v = {1, 2, 3}},
                               {.name = "ilf:version", .kind = IMG_ATTR_INT, .v = {1}},
                               {.name = "curve", .kind = IMG_ATTR_FLOATS, .f = list, .n = 3}};
    size_t len = strlen(path);
    w->planes = planes;
    w->nplanes = len > 4 && strcmp(path + len - 4, ".exr") == 0 ? 2 : 0;
    w->attrs = attrs;
    w->nattrs = 5;
    if (img_write(im, path, w, &e) < 0) cli_fail(CLI_FAILED, "%s", e.text);
    free(two);
}

int main(int argc, char **argv)
{
    errmsg e;
    int n = cli_parse(&prog, argc, argv);
    if (n < 2) cli_fail(CLI_USAGE, "expected what to do and a file");
    const char *what = argv[1], *file = argv[2], *out = n > 2 ? argv[3] : NULL;
    if (strcmp(what, "probe") == 0) {
        img_info info;
        if (img_probe_as(&info, file, &how, &e) < 0) cli_fail(CLI_FAILED, "%s", e.text);
        print_info(&info);
        return cli_end(CLI_OK);
    }
    if (strcmp(what, "stream") == 0) {
        stream(file);
        return cli_end(CLI_OK);
    }
    img im = {0};
    if (strcmp(what, "rows") == 0) load_rows(&im, file);
    else if (img_load_as(&im, file, &how, &e) < 0) cli_fail(CLI_FAILED, "%s", e.text);
    if (strcmp(what, "linear") == 0) img_linearise_srgb(&im);
    if (!out) cli_fail(CLI_USAGE, "expected an output file");
    if (strcmp(what, "convert") != 0) {
        save(&im, out);
    } else {
        img_write_opts w = {.compression = compression, .comment = comment};
        w.type = type && strcmp(type, "half") == 0 ? IMG_HALF : IMG_FLOAT;
        size_t values = (size_t)im.info.width * (size_t)im.info.height * (size_t)im.info.channels;
        for (size_t i = 0; scale != 1 && i < values; i++) im.pix[i] = (float)((double)im.pix[i] * scale);
        if (extra) write_extra(&im, out, &w);
        else if (img_write(&im, out, type || compression || comment ? &w : NULL, &e) < 0)
            cli_fail(CLI_FAILED, "%s", e.text);
    }
    img_free(&im);
    return cli_end(CLI_OK);
}
