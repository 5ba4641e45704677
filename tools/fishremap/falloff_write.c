/*
 * falloff_write.c - falloff curves as text and as an SVG plot (falloff_write.h).
 */
#include "falloff_write.h"

#include <math.h>
#include <stdio.h>

#include "base/outfile.h"

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

/* Plot area in SVG units. */
static double px(double deg, double rim)
{
    return 60 + 520 * deg / rim;
}

static double py(double v, double top)
{
    return 360 - 330 * v / top;
}

int falloff_plot(const char *path, const falloff_curve f[3], const falloff_reading *r, int n, errmsg *e)
{
    static const char *const colour[] = {"#c0392b", "#27803b", "#2d5fb3"};
    outfile *out;
    double rim = f[0].half / DEG, top = 1.1, t, s;
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < FIT_NODES; k++) top = fmax(top, 1.05 * f[c].v[k]);
    if (out_begin(&out, path, e)) return -1;
    FILE *o = out_stream(out);
    fprintf(o, "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"620\" height=\"410\" "
               "font-family=\"sans-serif\" font-size=\"12\">\n"
               "<rect width=\"620\" height=\"410\" fill=\"white\"/>\n");
    for (int k = 0; k <= 10 && k * 0.1 <= top; k++)
        fprintf(o,
                "<path d=\"M60 %.1fH580\" stroke=\"#ddd\"/><text x=\"52\" y=\"%.1f\" "
                "text-anchor=\"end\">%.1f</text>\n",
                py(k * 0.1, top), py(k * 0.1, top) + 4, k * 0.1);
    for (int d = 0; d <= rim; d += 10)
        fprintf(o,
                "<path d=\"M%.1f 360V365\" stroke=\"black\"/><text x=\"%.1f\" y=\"380\" "
                "text-anchor=\"middle\">%d</text>\n",
                px(d, rim), px(d, rim), d);
    fprintf(o,
            "<path d=\"M60 30V360H580\" fill=\"none\" stroke=\"black\"/>\n"
            "<text x=\"320\" y=\"400\" text-anchor=\"middle\">angle from the optical axis (degrees)</text>\n"
            "<text x=\"60\" y=\"20\">signal relative to the axis; band: 2 standard deviations</text>\n");
    for (int c = 0; c < 3; c++) {
        fprintf(o, "<path fill=\"%s\" fill-opacity=\"0.12\" d=\"", colour[c]);
        for (int pass = 0; pass < 2; pass++)
            for (int k = 0; k <= 100; k++) {
                t = rim * (pass ? 100 - k : k) / 100;
                double v = falloff_curve_at(&f[c], t * DEG, &s),
                       b = fmin(v * exp(pass ? -2 * s : 2 * s), top);
                fprintf(o, "%c%.2f %.2f", k || pass ? 'L' : 'M', px(t, rim), py(b, top));
            }
        fprintf(o, "Z\"/>\n<path fill=\"none\" stroke=\"%s\" stroke-width=\"1.6\" d=\"", colour[c]);
        for (int k = 0; k <= 200; k++) {
            t = rim * k / 200;
            fprintf(o, "%c%.2f %.2f", k ? 'L' : 'M', px(t, rim),
                    py(falloff_curve_at(&f[c], t * DEG, NULL), top));
        }
        fprintf(o, "\"/>\n");
        for (int i = 0; i < n; i++) {
            double v = r[i].y[c] / f[c].axis;
            if (v >= 0 && v <= top)
                fprintf(o, "<circle cx=\"%.2f\" cy=\"%.2f\" r=\"3\" stroke=\"%s\" fill=\"%s\"/>\n",
                        px(r[i].theta / DEG, rim), py(v, top), colour[c], r[i].used[c] ? colour[c] : "none");
        }
    }
    fprintf(o, "</svg>\n");
    return out_commit(out, e);
}
