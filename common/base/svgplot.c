/* svgplot.c - see svgplot.h. */
#include "svgplot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "outfile.h"

/* In SVG's units, y down. */
enum { WIDTH = 620, HEIGHT = 410, LEFT = 60, RIGHT = 580, TOP = 30, BOTTOM = 360 };

struct svgplot {
    outfile *file;
    FILE *f;
    svgplot_axis x, y;
};

static double px(const svgplot *p, double x)
{
    return LEFT + (RIGHT - LEFT) * (x - p->x.from) / (p->x.to - p->x.from);
}

static double py(const svgplot *p, double y)
{
    return BOTTOM - (BOTTOM - TOP) * (y - p->y.from) / (p->y.to - p->y.from);
}

/* The axis's k-th tick: 1, or 0 beyond its end. */
static int tick(double *at, const svgplot_axis *a, int k)
{
    const double rounding = 1e-9 * a->step;
    *at = (ceil((a->from - rounding) / a->step) + k) * a->step;
    return *at <= a->to + rounding;
}

static void draw_axes(const svgplot *p, const char *title)
{
    double at;
    for (int k = 0; tick(&at, &p->y, k); k++)
        fprintf(p->f,
                "<path d=\"M%d %.1fH%d\" stroke=\"#ddd\"/><text x=\"%d\" y=\"%.1f\" "
                "text-anchor=\"end\">%.6g</text>\n",
                LEFT, py(p, at), RIGHT, LEFT - 8, py(p, at) + 4, at);
    for (int k = 0; tick(&at, &p->x, k); k++)
        fprintf(p->f,
                "<path d=\"M%.1f %dV%d\" stroke=\"black\"/><text x=\"%.1f\" y=\"%d\" "
                "text-anchor=\"middle\">%.6g</text>\n",
                px(p, at), BOTTOM, BOTTOM + 5, px(p, at), BOTTOM + 20, at);
    fprintf(p->f,
            "<path d=\"M%d %dV%dH%d\" fill=\"none\" stroke=\"black\"/>\n"
            "<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">%s</text>\n"
            "<text x=\"15\" y=\"%d\" text-anchor=\"middle\" transform=\"rotate(-90 15 %d)\">%s</text>\n"
            "<text x=\"%d\" y=\"20\">%s</text>\n",
            LEFT, TOP, BOTTOM, RIGHT, (LEFT + RIGHT) / 2, HEIGHT - 10, p->x.label, (TOP + BOTTOM) / 2,
            (TOP + BOTTOM) / 2, p->y.label, LEFT, title);
}

int svgplot_begin(svgplot **out, const char *path, const svgplot_axis *x, const svgplot_axis *y,
                  const char *title, errmsg *e)
{
    const char *dot = strrchr(path, '.');
    if (strcmp(path, "-") != 0 && (!dot || strcasecmp(dot, ".svg") != 0))
        return err_set(e, "%s: expected a plot's name that ends in .svg, found another", path);
    svgplot *p = calloc(1, sizeof *p);
    if (!p) return err_set(e, "%s: out of memory", path);
    if (out_begin(&p->file, path, e)) {
        free(p);
        return -1;
    }
    p->f = out_stream(p->file);
    p->x = *x, p->y = *y;
    fprintf(p->f,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" "
            "font-family=\"sans-serif\" font-size=\"12\">\n"
            "<rect width=\"%d\" height=\"%d\" fill=\"white\"/>\n"
            "<clipPath id=\"area\"><rect x=\"%d\" y=\"%d\" width=\"%d\" height=\"%d\"/></clipPath>\n",
            WIDTH, HEIGHT, WIDTH, HEIGHT, LEFT, TOP, RIGHT - LEFT, BOTTOM - TOP);
    draw_axes(p, title);
    *out = p;
    return 0;
}

void svgplot_line(svgplot *p, const char *colour, const double (*at)[2], int n)
{
    int pen = 0;
    fprintf(p->f, "<path clip-path=\"url(#area)\" fill=\"none\" stroke=\"%s\" stroke-width=\"1.6\" d=\"",
            colour);
    for (int k = 0; k < n; k++) {
        const int known = isfinite(at[k][0]) && isfinite(at[k][1]);
        if (known) fprintf(p->f, "%c%.2f %.2f", pen ? 'L' : 'M', px(p, at[k][0]), py(p, at[k][1]));
        pen = known;
    }
    fprintf(p->f, "\"/>\n");
}

void svgplot_band(svgplot *p, const char *colour, const double *x, const double *low, const double *high,
                  int n)
{
    fprintf(p->f, "<path clip-path=\"url(#area)\" fill=\"%s\" fill-opacity=\"0.12\" d=\"", colour);
    for (int k = 0; k < n; k++) fprintf(p->f, "%c%.2f %.2f", k ? 'L' : 'M', px(p, x[k]), py(p, high[k]));
    for (int k = n - 1; k >= 0; k--) fprintf(p->f, "L%.2f %.2f", px(p, x[k]), py(p, low[k]));
    fprintf(p->f, "Z\"/>\n");
}

static int inside(const svgplot *p, const double at[2])
{
    return at[0] >= p->x.from && at[0] <= p->x.to && at[1] >= p->y.from && at[1] <= p->y.to;
}

void svgplot_dots(svgplot *p, const char *colour, const double (*at)[2], int n, svgplot_dot kind)
{
    if (kind == SVGPLOT_SMALL) /* one path: there may be thousands */
        fprintf(p->f, "<path stroke=\"%s\" stroke-opacity=\"0.5\" stroke-width=\"1\" d=\"", colour);
    for (int k = 0; k < n; k++) {
        if (!inside(p, at[k])) continue;
        const double x = px(p, at[k][0]), y = py(p, at[k][1]);
        if (kind == SVGPLOT_SMALL) fprintf(p->f, "M%.1f %.1fh1", x - 0.5, y);
        else
            fprintf(p->f, "<circle cx=\"%.2f\" cy=\"%.2f\" r=\"3\" stroke=\"%s\" fill=\"%s\"/>\n", x, y,
                    colour, kind == SVGPLOT_FULL ? colour : "none");
    }
    if (kind == SVGPLOT_SMALL) fprintf(p->f, "\"/>\n");
}

int svgplot_end(svgplot *p, errmsg *e)
{
    outfile *file = p->file;
    fprintf(p->f, "</svg>\n");
    free(p);
    return out_commit(file, e);
}
