/*
 * finish.c - see finish.h.
 */
#include "finish.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int mirror(int i, int n)
{
    if (n == 1)
        return 0;
    i = i < 0 ? -i : i;
    return i >= n ? 2 * (n - 1) - i : i;
}

typedef struct mosaic_view {
    const float *p;
    int w, h;
} mosaic_view;

static float at(const mosaic_view *m, int x, int y)
{
    return m->p[(size_t)mirror(y, m->h) * (size_t)m->w + (size_t)mirror(x, m->w)];
}

static void interpolate_green(float *g, float *gs, const mosaic_view *m, const mosaic_view *s, const int bayer[4])
{
    for (int y = 0; y < m->h; y++)
        for (int x = 0; x < m->w; x++) {
            size_t i = (size_t)y * (size_t)m->w + (size_t)x;
            if (bayer[(y & 1) * 2 + (x & 1)] == 1) {
                g[i] = at(m, x, y);
                if (gs)
                    gs[i] = at(s, x, y);
                continue;
            }
            float l = at(m, x - 1, y), r = at(m, x + 1, y), u = at(m, x, y - 1), d = at(m, x, y + 1);
            float across = fabsf(l - r), along = fabsf(u - d);
            /* weights by the other direction's gradient: 1/2 each where nothing is to choose */
            float tiny = 1e-6f * (l + r + u + d) + 1e-30f;
            float wx = (along + tiny) / (across + along + 2 * tiny), wy = 1 - wx;
            g[i] = 0.5f * (wx * (l + r) + wy * (u + d));
            if (gs) {
                float sl = at(s, x - 1, y), sr = at(s, x + 1, y), su = at(s, x, y - 1), sd = at(s, x, y + 1);
                gs[i] = 0.5f * sqrtf(wx * wx * (sl * sl + sr * sr) + wy * wy * (su * su + sd * sd));
            }
        }
}

int bayer_to_rgb(float *rgb, float *rgb_sigma, const float *mosaic, const float *sigma, int width,
                 int height, const int bayer[4], errmsg *e)
{
    size_t n = (size_t)width * (size_t)height;
    float *g = malloc(n * sizeof *g), *gs = sigma ? malloc(n * sizeof *gs) : NULL;
    if (!g || (sigma && !gs)) {
        free(g);
        free(gs);
        return err_set(e, "out of memory for %dx%d pixels", width, height);
    }
    mosaic_view m = {mosaic, width, height}, s = {sigma, width, height}, green = {g, width, height};
    interpolate_green(g, gs, &m, &s, bayer);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            size_t i = (size_t)y * (size_t)width + (size_t)x;
            rgb[3 * i + 1] = g[i];
            if (rgb_sigma)
                rgb_sigma[3 * i + 1] = gs[i];
            for (int c = 0; c < 3; c += 2) {
                float ratio = 0, weight = 0, var = 0;
                for (int dy = -1; dy <= 1; dy++)
                    for (int dx = -1; dx <= 1; dx++) {
                        if (bayer[((y + dy) & 1) * 2 + ((x + dx) & 1)] != c)
                            continue;
                        if (bayer[(y & 1) * 2 + (x & 1)] == c && (dx || dy))
                            continue; /* the pixel has its own value */
                        float there = at(&green, x + dx, y + dy);
                        if (!(there > 0))
                            continue;
                        ratio += at(&m, x + dx, y + dy) / there;
                        weight++;
                        if (sigma) {
                            float q = at(&s, x + dx, y + dy) / there;
                            var += q * q;
                        }
                    }
                rgb[3 * i + (size_t)c] = weight > 0 ? g[i] * ratio / weight : g[i];
                if (rgb_sigma)
                    rgb_sigma[3 * i + (size_t)c] = weight > 0 ? g[i] * sqrtf(var) / weight : gs[i];
            }
        }
    free(g);
    free(gs);
    return 0;
}

void heal_pixels(float *pix, int channels, int width, int height, const uint8_t *marked, int step)
{
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            size_t i = (size_t)y * (size_t)width + (size_t)x;
            if (!marked[i])
                continue;
            for (int c = 0; c < channels; c++) {
                double sum = 0;
                int n = 0;
                for (int reach = 1; reach <= 3 && n == 0; reach++)
                    for (int dy = -reach; dy <= reach; dy++)
                        for (int dx = -reach; dx <= reach; dx++) {
                            int xx = x + dx * step, yy = y + dy * step;
                            if (xx < 0 || yy < 0 || xx >= width || yy >= height)
                                continue;
                            size_t j = (size_t)yy * (size_t)width + (size_t)xx;
                            if (marked[j])
                                continue;
                            sum += pix[j * (size_t)channels + (size_t)c];
                            n++;
                        }
                if (n > 0)
                    pix[i * (size_t)channels + (size_t)c] = (float)(sum / n);
            }
        }
}

int apply_flat(float *pix, float *sigma, float *flat, int channels, int64_t pixels, const char *path, errmsg *e)
{
    for (int c = 0; c < channels; c++) {
        double mean = 0;
        for (int64_t i = 0; i < pixels; i++)
            mean += flat[i * channels + c];
        mean /= (double)pixels;
        for (int64_t i = 0; i < pixels; i++) {
            double f = flat[i * channels + c] / mean;
            if (!(mean > 0) || !(f > 0.01) || !isfinite(f))
                return err_set(e, "%s: expected a flat field above 1 %% of its mean everywhere, found %g at pixel (%d)",
                               path, f, (int)i);
            flat[i * channels + c] = (float)(1 / f);
        }
    }
    for (int64_t i = 0; i < pixels * channels; i++) {
        pix[i] *= flat[i];
        if (sigma)
            sigma[i] *= flat[i];
    }
    return 0;
}

double patch_luminance(const float *pix, int channels, int width, int x, int y, int w, int h)
{
    static const double weight[3] = {0.265, 0.670, 0.065};
    double sum = 0;
    for (int j = y; j < y + h; j++)
        for (int i = x; i < x + w; i++) {
            const float *p = pix + ((size_t)j * (size_t)width + (size_t)i) * (size_t)channels;
            for (int c = 0; c < channels; c++)
                sum += channels == 1 ? (double)p[0] : weight[c] * (double)p[c];
        }
    return 179 * sum / ((double)w * h);
}
