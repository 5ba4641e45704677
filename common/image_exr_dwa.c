/*
 * image_exr_dwa.c - OpenEXR's lossy DWA compressions, which the core library of OpenEXR 3.1 leaves to
 * the older one: R, G, B(, A) or Y(, A) in, R, G, B(, A) as HALF out.
 *
 * That library's C interface knows half RGBA only.  DWA itself keeps no more than a half's precision,
 * but for chunks that it can't make smaller; values there beyond a half's range are refused.
 */
#include <ImfCRgbaFile.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "exr_header.h"
#include "image_exr.h"

struct img_dwa {
    ImfInputFile *in;
    ImfRgba *row;
    int min_x, min_y; /* the data window's corner */
    int half;         /* all channels are HALF in the file */
};

void img_dwa_close(img_dwa *d)
{
    if (!d) return;
    if (d->in) ImfCloseInputFile(d->in);
    free(d->row);
    free(d);
}

int img_dwa_open(img_dwa **out, const img_reader *r, int min_x, int min_y, int half, errmsg *e)
{
    if (!exr_header_sound(fileno(r->f), (uint64_t)r->bytes))
        return img_bad(r, e, "broken OpenEXR file: header whose sizes don't fit (DWA)");
    char name[32]; /* the file as it is open, which may have no name any more */
    snprintf(name, sizeof name, "/dev/fd/%d", fileno(r->f));
    img_dwa *d = calloc(1, sizeof *d);
    if (d) d->row = malloc((size_t)r->info.width * sizeof *d->row);
    if (!d || !d->row) {
        img_dwa_close(d);
        return img_bad(r, e, "out of memory");
    }
    d->in = ImfOpenInputFile(name);
    if (!d->in) {
        img_dwa_close(d);
        return img_bad(r, e, "broken OpenEXR file: header (DWA)");
    }
    d->min_x = min_x;
    d->min_y = min_y;
    d->half = half;
    *out = d;
    return 0;
}

int img_dwa_row(img_dwa *d, const img_reader *r, float *row, errmsg *e)
{
    int nc = r->info.channels, y = d->min_y + r->y;
    /* the frame buffer's base is where pixel (0, 0) would be; all lines share one */
    if (!ImfInputSetFrameBuffer(d->in, d->row - d->min_x, 1, 0) || !ImfInputReadPixels(d->in, y, y))
        return img_bad(r, e, "broken OpenEXR file: pixels of row %d missing or damaged (DWA)", r->y);
    for (int x = 0; x < r->info.width; x++) {
        const ImfRgba *p = &d->row[x];
        const ImfHalf rgba[4] = {p->r, nc == 2 ? p->a : p->g, p->b, p->a};
        for (int c = 0; c < nc; c++) {
            float v = row[x * nc + c] = ImfHalfToFloat(rgba[c]);
            if (isinf(v) && !d->half)
                return img_bad(
                    r, e, "expected values up to 65504 with DWA compression, found more in pixel (%d, %d)", x,
                    r->y);
        }
    }
    return 0;
}

/* ---- writing ----------------------------------------------------------------------------------- */

static int put_attr(ImfHeader *h, const img_attr *a)
{
    switch (a->kind) {
    case IMG_ATTR_STRING:
        return ImfHeaderSetStringAttribute(h, a->name, a->s);
    case IMG_ATTR_FLOAT:
        return ImfHeaderSetFloatAttribute(h, a->name, (float)a->v[0]);
    case IMG_ATTR_INT:
        return ImfHeaderSetIntAttribute(h, a->name, (int)a->v[0]);
    case IMG_ATTR_V3F:
        return ImfHeaderSetV3fAttribute(h, a->name, (float)a->v[0], (float)a->v[1], (float)a->v[2]);
    case IMG_ATTR_FLOATS:
        break; /* the interface has no call for it */
    }
    return 0;
}

static int write_rows(ImfOutputFile *out, const img *im, ImfRgba *row)
{
    int nc = im->info.channels;
    for (int y = 0; y < im->info.height; y++) {
        const float *p = im->pix + (size_t)y * (size_t)im->info.width * (size_t)nc;
        for (int x = 0; x < im->info.width; x++, p += nc) {
            ImfFloatToHalf(p[0], &row[x].r);
            ImfFloatToHalf(p[1], &row[x].g);
            ImfFloatToHalf(p[2], &row[x].b);
            ImfFloatToHalf(nc == 4 ? p[3] : 1, &row[x].a);
        }
        if (!ImfOutputSetFrameBuffer(out, row, 1, 0) || !ImfOutputWritePixels(out, 1)) return -1;
    }
    return 0;
}

int img_write_exr_dwa(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e)
{
    int nc = im->info.channels, w = im->info.width, h = im->info.height;
    if (opts->type != IMG_HALF || opts->nplanes || nc < 3)
        return err_set(e, "%s: expected colours of type half without extra channels for compression dwaa",
                       path);
    ImfHeader *header = ImfNewHeader();
    ImfRgba *row = malloc((size_t)w * sizeof *row);
    ImfOutputFile *out = NULL;
    int rc = -1;
    if (!header || !row) {
        err_set(e, "%s: out of memory", path);
        goto done;
    }
    ImfHeaderSetDisplayWindow(header, 0, 0, w - 1, h - 1);
    ImfHeaderSetDataWindow(header, 0, 0, w - 1, h - 1);
    ImfHeaderSetCompression(header, IMF_DWAA_COMPRESSION);
    if (opts->comment) ImfHeaderSetStringAttribute(header, "comments", opts->comment);
    for (int i = 0; i < opts->nattrs; i++) {
        if (!put_attr(header, &opts->attrs[i])) {
            err_set(e, "%s: can't write attribute %s with compression dwaa", path, opts->attrs[i].name);
            goto done;
        }
    }
    out = ImfOpenOutputFile(out_path(o), header, nc == 4 ? IMF_WRITE_RGBA : IMF_WRITE_RGB);
    rc = out ? write_rows(out, im, row) : -1;
    if (out && !ImfCloseOutputFile(out)) rc = -1; /* it writes the table of chunks */
    if (rc < 0) err_set(e, "%s: can't write pixels", path);
done:
    if (header) ImfDeleteHeader(header);
    free(row);
    return rc;
}
