/* result.c - see result.h. */
#include "result.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "image/image.h"

#define DEG (M_PI / 180)

void outside_fill(float *rgb, float *alpha, int w, int h, outside_mode mode)
{
    if (mode != OUTSIDE_HOLD) return;
    for (int x = 0; x < w; x++) {
        int last = -1;
        for (int y = 0; y < h; y++) {
            size_t at = (size_t)y * (size_t)w + (size_t)x;
            if (alpha[at] > 0) last = y;
            else if (last >= 0)
                memcpy(rgb + 3 * at, rgb + 3 * ((size_t)last * (size_t)w + (size_t)x), 3 * sizeof(float));
        }
        for (int y = h - 1, next = -1; y >= 0; y--) {
            size_t at = (size_t)y * (size_t)w + (size_t)x;
            if (alpha[at] > 0) next = y;
            else if (next >= 0 && rgb[3 * at] == 0 && rgb[3 * at + 1] == 0 && rgb[3 * at + 2] == 0)
                memcpy(rgb + 3 * at, rgb + 3 * ((size_t)next * (size_t)w + (size_t)x), 3 * sizeof(float));
        }
    }
}

int result_write(const settings *s, const float *rgb, const float *alpha, int partial, const char *view,
                 const chart *c, errmsg *e)
{
    img im;
    int ch = partial && s->outside == OUTSIDE_ALPHA ? 4 : 3;
    if (img_alloc(&im, s->out_w, s->out_h, ch, e)) return -1;
    size_t n = (size_t)s->out_w * (size_t)s->out_h;
    for (size_t i = 0; i < n; i++) {
        memcpy(im.pix + i * (size_t)ch, rgb + 3 * i, 3 * sizeof(float));
        if (ch == 4) im.pix[4 * i + 3] = alpha[i];
    }
    static const char *const names[] = {[VIEW_FISHEYE] = "fisheye",
                                        [VIEW_BALL] = "ball",
                                        [VIEW_PROBE] = "probe",
                                        [VIEW_LATLONG] = "latlong",
                                        [VIEW_ANGULAR] = "angular"};
    img_attr attrs[4] = {{.name = "ilf:chart", .kind = IMG_ATTR_STRING, .s = names[s->to]}};
    img_write_opts opts = {
        .type = IMG_FLOAT, .compression = s->compression, .comment = s->command, .attrs = attrs, .nattrs = 1};
    if (s->to == VIEW_PROBE)
        attrs[opts.nattrs++] = (img_attr){.name = "ilf:polarMax",
                                          .kind = IMG_ATTR_FLOAT,
                                          .v = {(s->polar_max_deg > 0 ? s->polar_max_deg : 90) * DEG}};
    char shown[128];
    snprintf(shown, sizeof shown, "%.9g %.9g %.9g %.9g", c->lon0 / DEG, (c->lon0 + c->lon_span) / DEG,
             90 - c->polar_min / DEG, 90 - c->polar_max / DEG);
    if (s->to == VIEW_LATLONG && !chart_whole(c))
        attrs[opts.nattrs++] = (img_attr){.name = "ilf:latlong", .kind = IMG_ATTR_STRING, .s = shown};
    if (view) attrs[opts.nattrs++] = (img_attr){.name = "VIEW", .kind = IMG_ATTR_STRING, .s = view};
    if (s->half_float == 1) opts.type = IMG_HALF;
    int rc = img_write(&im, s->out, &opts, e);
    img_free(&im);
    return rc;
}
