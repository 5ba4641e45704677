/* image_exr.h - what the parts of OpenEXR input and output share. */
#ifndef IMAGE_EXR_H
#define IMAGE_EXR_H

#include "image_internal.h"

/* Rows of a DWA-compressed file that r has open; its info and data window are known;
 * half: all channels are HALF in the file. */
typedef struct img_dwa img_dwa;
int img_dwa_open(img_dwa **d, const img_reader *r, int min_x, int min_y, int half, errmsg *e);
int img_dwa_row(img_dwa *d, const img_reader *r, float *row, errmsg *e);
void img_dwa_close(img_dwa *d);

int img_write_exr_dwa(const img *im, outfile *o, const char *path, const img_write_opts *opts, errmsg *e);

#endif
