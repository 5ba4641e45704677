/* rawfile.c - see rawfile.h. */
#include "rawfile.h"

#include <math.h>

static const double matrix_most = 100, row_sum_tolerance = 0.01;

/* The offset's type differs between LibRaw's versions. */
static void damaged(void *data, const char *file, const int offset)
{
    (void)file;
    (void)offset;
    *(int *)data = 1;
}

static void damaged_64(void *data, const char *file, const INT64 offset)
{
    (void)file;
    (void)offset;
    *(int *)data = 1;
}

libraw_data_t *rawfile_new(int *broken)
{
    libraw_data_t *raw = libraw_init(0);
    *broken = 0;
    if (!raw) return NULL;
    libraw_set_dataerror_handler(
        raw,
        _Generic((data_callback)0, void (*)(void *, const char *, const int): damaged, default: damaged_64),
        broken);
    raw->params.use_camera_wb = 1; /* the file's own matrix counts only with it */
    return raw;
}

/* LibRaw's turn (dcraw's bits 4 transpose, 2 bottom up, 1 right to left; or degrees) in EXIF's numbers. */
int rawfile_orientation(const libraw_data_t *raw)
{
    static const int exif[8] = {1, 2, 4, 3, 5, 8, 6, 7};
    const int flip = raw->sizes.flip, degrees = (flip + 3600) % 360;
    return degrees == 270 ? 8 : degrees == 180 ? 3 : degrees == 90 ? 6 : exif[flip & 7];
}

double rawfile_stated(float v)
{
    return isfinite(v) && v > 0 && v < 1e9f ? (double)v : 0;
}

int rawfile_white_lacks_black(const libraw_data_t *raw, int channel)
{
    const libraw_colordata_t *c = &raw->color;
    return raw->idata.dng_version && c->black &&
           c->dng_levels.dng_whitelevel[channel] == c->maximum + c->black;
}

int rawfile_matrix(double m[3][3], const libraw_data_t *raw, int coloured)
{
    int known = coloured && !raw->rawdata.ioparams.raw_color;
    for (int i = 0; i < 3; i++) {
        double sum = 0;
        for (int c = 0; c < 3; c++) {
            m[i][c] = (double)raw->color.rgb_cam[i][c];
            sum += m[i][c];
            known &= fabs(m[i][c]) < matrix_most; /* a NaN is not */
        }
        known &= fabs(sum - 1) < row_sum_tolerance;
        for (int c = 0; c < 3; c++) m[i][c] /= sum; /* 0.99999 of single precision: grey stays grey */
    }
    for (int i = 0; i < 9 && !known; i++) m[i / 3][i % 3] = i % 4 == 0;
    return known;
}
