/*
 * falloff_write.c - falloff curves as text and as an SVG plot (falloff_write.h).
 */
#include "falloff_write.h"

#include <math.h>
#include <stdio.h>

#include "base/outfile.h"
#include "base/svgplot.h"

#define DEG (M_PI / 180)

int falloff_write(const char *path, const falloff_curve f[3], const falloff_reading *r, int n,
                  const char *command, errmsg *e)
{
    outfile *out;
    double last = 0, rim = f[0].half / DEG, before[3] = {0};
    if (out_begin(&out, path, e)) return -1;
    FILE *o = out_stream(out);
    fprintf(o, "# brightness falloff of a lens: signal relative to the axis; divide by it\n# %s\n", command);
    for (int i = 0; i < n; i++) {
        fprintf(o, "# reading %8.4f deg", r[i].theta / DEG);
        for (int c = 0; c < 3; c++)
            fprintf(o, "  %.6g%s", r[i].y[c] / f[c].axis, r[i].used[c] ? "" : " (outlier)");
        fputc('\n', o);
        for (int c = 0; c < 3; c++)
            if (r[i].used[c]) last = fmax(last, r[i].theta / DEG);
    }
    fprintf(o, "# readings end at %.4g degrees; what follows beyond is extrapolated\n", last);
    for (int c = 0; c < 3; c++)
        fprintf(o, "# %c: %d readings of %d used, scatter %.3g %%, %.3g parameters%s\n", "RGB"[c], f[c].used,
                n, 100 * f[c].scatter, f[c].freedom,
                f[c].rises_to > 0 ? ", rise from the axis proven by the readings" : "");
    fprintf(o, "# deg        R        G        B     sd R     sd G     sd B\n");
    for (int k = 0;; k++) {
        double t = fmin(k, rim), v[3], s[3];
        for (int c = 0; c < 3; c++) {
            v[c] = falloff_curve_at(&f[c], t * DEG, &s[c]);
            if (k && t * DEG > f[c].rises_to + f[c].half / (FIT_NODES - 1))
                v[c] = fmin(v[c], before[c]); /* a cubic between nodes may overshoot by a last digit */
            before[c] = v[c];
            s[c] *= v[c];
        }
        fprintf(o, "%7.4g  %.6f %.6f %.6f %.2e %.2e %.2e\n", t, v[0], v[1], v[2], s[0], s[1], s[2]);
        if (t >= rim) break;
    }
    return out_commit(out, e);
}

static void draw_channel(svgplot *p, const falloff_curve *f, const char *colour, double rim)
{
    enum { STEPS = 200 };
    double t[STEPS + 1], low[STEPS + 1], high[STEPS + 1], line[STEPS + 1][2];
    for (int k = 0; k <= STEPS; k++) {
        double s;
        line[k][0] = t[k] = rim * k / STEPS;
        line[k][1] = falloff_curve_at(f, t[k] * DEG, &s);
        low[k] = line[k][1] * exp(-2 * s), high[k] = line[k][1] * exp(2 * s);
    }
    svgplot_band(p, colour, t, low, high, STEPS + 1);
    svgplot_line(p, colour, (const double(*)[2])line, STEPS + 1);
}

int falloff_plot(const char *path, const falloff_curve f[3], const falloff_reading *r, int n, errmsg *e)
{
    static const char *const colour[] = {"#c0392b", "#27803b", "#2d5fb3"};
    svgplot *p;
    double rim = f[0].half / DEG, top = 1.1;
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < FIT_NODES; k++) top = fmax(top, 1.05 * f[c].v[k]);
    const svgplot_axis x = {0, rim, 10, "angle from the optical axis (degrees)"},
                       y = {0, top, top > 2 ? 0.5 : 0.1, "signal relative to the axis"};
    if (svgplot_begin(&p, path, &x, &y,
                      "falloff; dots: readings (hollow: left out); band: 2 standard deviations", e))
        return -1;
    for (int c = 0; c < 3; c++) {
        draw_channel(p, &f[c], colour[c], rim);
        for (int i = 0; i < n; i++) {
            const double at[1][2] = {{r[i].theta / DEG, r[i].y[c] / f[c].axis}};
            svgplot_dots(p, colour[c], at, 1, r[i].used[c] ? SVGPLOT_FULL : SVGPLOT_HOLLOW);
        }
    }
    return svgplot_end(p, e);
}
