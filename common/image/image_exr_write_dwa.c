/*
 * image_exr_write_dwa.c - writing OpenEXR's lossy DWAA, which the core library of OpenEXR 3.1 leaves to the
 * older one: R, G, B(, A) as HALF.  That library's C interface knows nothing else.
 */
#include <ImfCRgbaFile.h>
#include <stdlib.h>

#include "image_exr.h"

static int put_attr(ImfHeader *h, const img_attr *a)
{
    switch (a->kind) {
    case IMG_ATTR_STRING: return ImfHeaderSetStringAttribute(h, a->name, a->s);
    case IMG_ATTR_FLOAT: return ImfHeaderSetFloatAttribute(h, a->name, (float)a->v[0]);
    case IMG_ATTR_INT: return ImfHeaderSetIntAttribute(h, a->name, (int)a->v[0]);
    case IMG_ATTR_V3F:
        return ImfHeaderSetV3fAttribute(h, a->name, (float)a->v[0], (float)a->v[1], (float)a->v[2]);
    case IMG_ATTR_FLOATS:
    case IMG_ATTR_CHROMATICITIES: break; /* the interface has no call for it */
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
    if (nc == 4) ImfHeaderSetStringAttribute(header, EXR_STRAIGHT, EXR_STRAIGHT_VALUE);
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
