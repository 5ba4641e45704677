/*
 * ilf_dwa.c - decode the DWA compressions, which OpenEXR 3.1's core library leaves to the older library.
 *
 * That library's C interface reads half RGBA tiles.  Nothing is lost by it: what DWA compresses of channels
 * R, G and B it turns into halves itself, FLOAT or not.  (A tile that compression did not make smaller is not
 * read this way.)
 */
#include <ImfCRgbaFile.h>
#include <stdio.h>
#include <stdlib.h>

#include "exr/exr_header.h"
#include "ilf_internal.h"

static void put(unsigned char *texel, ImfHalf h, const ilf *f)
{
    const float v = half_to_float_any(h);

    if (f->is_half) memcpy(texel, &h, sizeof h);
    else memcpy(texel, &v, sizeof v);
}

ilf_status ilf_decode_dwa(const ilf *f, int i, int j, unsigned char *pix, ilf_error *err)
{
    const size_t w = (size_t)f->info.n_theta, h = (size_t)f->info.n_phi;
    ImfRgba *rgba = malloc(w * h * sizeof *rgba);
    char name[32]; /* the file as it is open: another may have its name by now */
    (void)!snprintf(name, sizeof name, "/dev/fd/%d", f->fd);
    const int sound = exr_header_sound(f->fd, (uint64_t)f->info.file_bytes);
    ImfTiledInputFile *in = rgba && sound ? ImfOpenTiledInputFile(name) : NULL;
    ilf_status st = ILF_OK;

    if (!rgba) st = ilf_fail(err, ILF_ERR_MEMORY, "%s: probe (%d,%d): no memory", f->path, i, j);
    else if (!sound)
        st = ilf_fail(err, ILF_ERR_FORMAT, "%s: probe (%d,%d): expected a header whose sizes fit", f->path, i,
                      j);
    else if (!in)
        st = ilf_fail(err, ILF_ERR_FORMAT, "%s: probe (%d,%d): %s", f->path, i, j, ImfErrorMessage());
    else {
        /* the frame buffer's base is where pixel (0,0) of the whole picture would be */
        ImfRgba *base = rgba - (ptrdiff_t)((size_t)j * h * w) - (ptrdiff_t)((size_t)i * w);

        if (!ImfTiledInputSetFrameBuffer(in, base, 1, w) || !ImfTiledInputReadTile(in, i, j, 0, 0))
            st = ilf_fail(err, ILF_ERR_FORMAT, "%s: probe (%d,%d): expected a whole tile, found: %s", f->path,
                          i, j, ImfErrorMessage());
        else
            for (size_t y = 0; y < h; y++)
                for (size_t x = 0; x < w; x++) {
                    const ImfRgba *p = &rgba[y * w + x];
                    unsigned char *row = pix + y * f->row_bytes + x * f->pixel_bytes;
                    put(row + f->chan_offset[0], p->r, f);
                    put(row + f->chan_offset[1], p->g, f);
                    put(row + f->chan_offset[2], p->b, f);
                }
    }
    if (in) ImfCloseTiledInputFile(in);
    free(rgba);
    return st;
}
