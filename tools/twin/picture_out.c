/* picture_out.c - the writers of picture_out.h. */
#include "picture_out.h"

#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/outfile.h"

const char *picture_format(const char *path)
{
    const char *dot = strrchr(path, '.');
    if (dot && !strcasecmp(dot, ".png")) return "png";
    if (dot && !strcasecmp(dot, ".ppm")) return "ppm";
    return NULL;
}

/* One row as the file wants it: one byte, or two with the high one first. */
static void pack_row(unsigned char *to, const picture *p, int y, unsigned scale_to)
{
    size_t n = (size_t)p->width * 3;
    unsigned max = (1u << p->bits) - 1;
    const uint16_t *from = p->code + (size_t)y * n;
    for (size_t i = 0; i < n; i++) {
        unsigned v = (from[i] * scale_to + max / 2) / max;
        if (scale_to > 255) *to++ = (unsigned char)(v >> 8);
        *to++ = (unsigned char)v;
    }
}

static int write_ppm(const picture *p, FILE *f, unsigned char *row)
{
    unsigned max = (1u << p->bits) - 1;
    size_t bytes = (size_t)p->width * 3 * (max > 255 ? 2 : 1);
    fprintf(f, "P6\n# %s\n%d %d\n%u\n", p->comment, p->width, p->height, max);
    for (int y = 0; y < p->height; y++) {
        pack_row(row, p, y, max);
        if (fwrite(row, 1, bytes, f) != bytes) return -1;
    }
    return 0;
}

static int write_png(const picture *p, FILE *f, unsigned char *row)
{
    int depth = p->bits > 8 ? 16 : 8;
    png_text text = {
        .compression = PNG_TEXT_COMPRESSION_NONE, .key = (char *)"Comment", .text = (char *)p->comment};
    png_color_8 sig = {.red = (png_byte)p->bits, .green = (png_byte)p->bits, .blue = (png_byte)p->bits};
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    if (!info || setjmp(png_jmpbuf(png))) {
        png_destroy_write_struct(&png, &info);
        return -1;
    }
    png_init_io(png, f);
    png_set_compression_level(png, 3);
    png_set_IHDR(png, info, (png_uint_32)p->width, (png_uint_32)p->height, depth, PNG_COLOR_TYPE_RGB,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_sBIT(png, info, &sig);
    png_set_text(png, info, &text, 1);
    png_write_info(png, info);
    for (int y = 0; y < p->height; y++) {
        pack_row(row, p, y, depth == 16 ? 65535 : 255);
        png_write_row(png, row);
    }
    png_write_end(png, NULL);
    png_destroy_write_struct(&png, &info);
    return 0;
}

int picture_write(const picture *p, const char *path, errmsg *e)
{
    outfile *o;
    const char *format = picture_format(path);
    if (!format) return err_set(e, "%s: expected a name that ends in .png or .ppm", path);
    unsigned char *row = malloc((size_t)p->width * 6);
    if (!row) return err_set(e, "%s: out of memory", path);
    if (out_begin(&o, path, e) != 0) {
        free(row);
        return -1;
    }
    int bad = format[1] == 'n' ? write_png(p, out_stream(o), row) : write_ppm(p, out_stream(o), row);
    free(row);
    if (bad) {
        err_errno(e, "%s", path);
        out_abort(o);
        return -1;
    }
    return out_commit(o, e);
}
