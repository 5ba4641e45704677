/* asked.c - see asked.h. */
#include "asked.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "image/exif.h"
#include "image/image.h"

void asked_read(picture_says *p, const char *path)
{
    img_info info = {0};
    errmsg ignored;
    *p = (picture_says){0};
    if (img_probe(&info, path, &ignored) == 0) {
        snprintf(p->format, sizeof p->format, "%s", info.format);
        p->seconds = info.exposure_s;
        p->f_number = info.f_number;
        p->iso = info.iso;
    }
    if (p->seconds > 0 && p->f_number > 0 && p->iso > 0) return;
    exif_facts x = exif_read(path);
    if (!(p->seconds > 0)) p->seconds = x.exposure_s;
    if (!(p->f_number > 0)) p->f_number = x.f_number;
    if (!(p->iso > 0)) p->iso = x.iso;
}

static int apart(double a, double b, double tolerance)
{
    return fabs(log(a / b)) > log1p(tolerance) + 1e-9;
}

int asked_differs(const picture_says *p, const session *s, int k)
{
    return p->seconds > 0 && apart(p->seconds, s->exposure[k], s->time_tolerance);
}

static int same(const char *what, const char *key, double is, double asked, double first, double tolerance,
                errmsg *e)
{
    if (asked < 0) return 0; /* not to be looked at */
    double want = asked > 0 ? asked : first;
    if (!(want > 0) || (is > 0 && !apart(is, want, tolerance))) return 0;
    if (!(is > 0))
        return asked > 0
                   ? err_set(e, "camera: expected %s %g as asked, the picture doesn't say it", what, want)
                   : 0;
    return asked > 0
               ? err_set(e, "camera: expected %s %g as asked, the picture says %g", what, want, is)
               : err_set(
                     e,
                     "camera: expected %s %g as in the session's first picture, this one says %g ([camera] "
                     "%s = -1: not looked at)",
                     what, want, is, key);
}

int asked_compare(const picture_says *p, const session *s, int k, const double first[2], errmsg *e)
{
    if (s->list_times == TIMES_EXIF && !(p->seconds > 0))
        return err_set(e, "camera: times = exif, but the picture doesn't say its exposure time");
    if (s->list_times == TIMES_ASKED && asked_differs(p, s, k))
        return err_set(
            e,
            "camera: asked for %.6g s, the picture says %.6g s (a factor %.3g; times = exif takes it as "
            "it is, time_tolerance says how far apart they may be)",
            s->exposure[k], p->seconds, p->seconds / s->exposure[k]);
    if (same("f-number", "f_number", p->f_number, s->f_number, first[0], 0.05, e) != 0) return -1;
    return same("ISO", "iso", p->iso, s->iso, first[1], 0.10, e);
}

/* ---- formats ------------------------------------------------------------------------------------------ */

const char *ending_format(const char *name)
{
    static const char *const known[][2] = {
        {"jpg", "jpeg"}, {"jpeg", "jpeg"}, {"jpe", "jpeg"}, {"png", "png"}, {"tif", "tiff"}, {"tiff", "tiff"},
        {"ppm", "pnm"},  {"pgm", "pnm"},   {"pnm", "pnm"},  {"pfm", "pfm"}, {"exr", "exr"},  {"hdr", "hdr"},
        {"pic", "hdr"},  {"dng", "raw"},   {"nef", "raw"},  {"nrw", "raw"}, {"cr2", "raw"},  {"cr3", "raw"},
        {"crw", "raw"},  {"arw", "raw"},   {"sr2", "raw"},  {"raf", "raw"}, {"orf", "raw"},  {"rw2", "raw"},
        {"pef", "raw"},  {"srw", "raw"},   {"raw", "raw"},  {"3fr", "raw"}, {"iiq", "raw"},  {"x3f", "raw"}};
    const char *dot = strrchr(name, '.');
    for (size_t k = 0; dot && k < sizeof known / sizeof *known; k++)
        if (!strcasecmp(dot + 1, known[k][0])) return known[k][1];
    return "";
}

int ending_agrees(const char *name, const char *format)
{
    const char *promised = ending_format(name);
    if (!promised[0] || !format[0] || !strcmp(promised, format)) return 1;
    /* DNG and some makers' raw files are TIFF */
    return (!strcmp(promised, "raw") && !strcmp(format, "tiff")) ||
           (!strcmp(promised, "tiff") && !strcmp(format, "raw"));
}

double asked_label(const char *label)
{
    char *end;
    double v = strtod(label, &end), under = 1;
    if (end == label || !isfinite(v) || v <= 0) return 0;
    int fraction = *end == '/';
    if (fraction) {
        const char *from = end + 1;
        under = strtod(from, &end);
        if (end == from || !isfinite(under) || under <= 0) return 0;
    }
    end += strspn(end, " ");
    int unit = *end == 's' || *end == '"';
    end += unit;
    return *end || (!fraction && !unit) ? 0 : v / under;
}
