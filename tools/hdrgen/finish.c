/*
 * finish.c - see finish.h.
 */
#include "finish.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void heal_pixels(float *pix, int channels, int width, int height, const uint8_t *marked, int step)
{
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            size_t i = (size_t)y * (size_t)width + (size_t)x;
            if (!marked[i]) continue;
            for (int c = 0; c < channels; c++) {
                double sum = 0;
                int n = 0;
                for (int reach = 1; reach <= 3 && n == 0; reach++)
                    for (int dy = -reach; dy <= reach; dy++)
                        for (int dx = -reach; dx <= reach; dx++) {
                            int xx = x + dx * step, yy = y + dy * step;
                            if (xx < 0 || yy < 0 || xx >= width || yy >= height) continue;
                            size_t j = (size_t)yy * (size_t)width + (size_t)xx;
                            if (marked[j]) continue;
                            sum += pix[j * (size_t)channels + (size_t)c];
                            n++;
                        }
                if (n > 0) pix[i * (size_t)channels + (size_t)c] = (float)(sum / n);
            }
        }
}

int apply_flat(float *pix, float *sigma, float *flat, int channels, int64_t pixels, const char *path,
               errmsg *e)
{
    for (int c = 0; c < channels; c++) {
        double mean = 0;
        for (int64_t i = 0; i < pixels; i++) mean += flat[i * channels + c];
        mean /= (double)pixels;
        for (int64_t i = 0; i < pixels; i++) {
            double f = flat[i * channels + c] / mean;
            if (!(mean > 0) || !(f > 0.01) || !isfinite(f))
                return err_set(
                    e, "%s: expected a flat field above 1 %% of its mean everywhere, found %g at pixel (%d)",
                    path, f, (int)i);
            flat[i * channels + c] = (float)(1 / f);
        }
    }
    for (int64_t i = 0; i < pixels * channels; i++) {
        pix[i] *= flat[i];
        if (sigma) sigma[i] *= flat[i];
    }
    return 0;
}

double patch_luminance(const float *pix, int channels, int width, int x, int y, int w, int h,
                       const double weight[3])
{
    double sum = 0;
    for (int j = y; j < y + h; j++)
        for (int i = x; i < x + w; i++) {
            const float *p = pix + ((size_t)j * (size_t)width + (size_t)i) * (size_t)channels;
            for (int c = 0; c < channels; c++) sum += channels == 1 ? (double)p[0] : weight[c] * (double)p[c];
        }
    return 179 * sum / ((double)w * h);
}
