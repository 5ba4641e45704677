/* fuzz_image.h - any bytes as a picture, for the targets of one format each. */
#ifndef FUZZ_IMAGE_H
#define FUZZ_IMAGE_H

#include <math.h>

#include "fuzz.h"
#include "image/image.h"

/* A header may promise a large picture in few bytes (run lengths, compression): that is no fault, but too
 * slow to read here. */
enum { READ_MOST = 1 << 18 };

static inline void read_picture(const uint8_t *data, size_t size)
{
    fuzz_file file = file_of(data, size);
    img_reader *r = NULL;
    errmsg e = {""};

    if (img_reader_open(&r, file.path, &e) != 0) {
        HOLDS(r == NULL);
        one_line(e.text);
    } else {
        const img_info *i = img_reader_info(r);
        HOLDS(i->width >= 1 && i->height >= 1 && i->width <= IMG_MAX_SIDE && i->height <= IMG_MAX_SIDE);
        HOLDS(i->channels >= 1 && i->channels <= 4);
        HOLDS(!i->coded || (i->max_code >= 1 && isfinite(i->max_code)));
        if ((int64_t)i->width * i->height <= READ_MOST) {
            float *row = malloc((size_t)i->width * (size_t)i->channels * sizeof *row);
            HOLDS(row != NULL);
            for (int y = 0; y < i->height; y++) {
                if (img_reader_rows(r, row, 1, &e) != 0) {
                    one_line(e.text);
                    break;
                }
                for (int x = 0; i->coded && x < i->width * i->channels; x++)
                    HOLDS(row[x] >= 0 && (double)row[x] <= i->max_code);
            }
            free(row);
        }
        img_reader_close(r);
    }
    close(file.fd);
}

#endif
