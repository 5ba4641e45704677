/*
 * lensfile.c - lens models from text files (lensfile.h).
 */
#include "lensfile.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/textfile.h"
#include "calibration.h"

#define DEG (M_PI / 180)

static int bad_line(const char *path, const textlines *t, const char *line, errmsg *e)
{
    return err_set(e,
                   "%s: line %d: expected model, polynomial, kannala-brandt, camera, size, table, fov or "
                   "from-first (see the man page), found \"%.60s\"",
                   path, t->number, line);
}

/* Is this the line that begins a camera of several?  Its name, without the brackets. */
static int begins_camera(char name[64], const char *line)
{
    char end;
    return sscanf(line, "[%63[^]]%c", name, &end) == 2 && end == ']';
}

/* Of a file with several cameras only the one that is wanted is left: the lines of all others become empty, so
 * that a message still has the right number. */
static int keep_camera(char *text, const char *path, const char *camera, int which, errmsg *e)
{
    textlines t = textlines_of(text);
    char line[2048], name[64], list[256] = "", *begin[2] = {NULL, NULL}, *end[2] = {NULL, NULL};
    int n = 0, wanted = -1;
    for (const char *at = text; textlines_next(line, sizeof line, &t); at = t.next) {
        if (!begins_camera(name, line)) continue;
        if (n < 2) begin[n] = text + (t.next - text);
        if (n > 0 && n < 3) end[n - 1] = text + (at - text);
        if (camera && strcmp(camera, name) == 0) wanted = n;
        snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", n ? ", " : "", name);
        n++;
    }
    if (n == 0 && !camera) return 0;
    if (n > 2) return err_set(e, "%s: expected up to two cameras, found %d", path, n);
    if (!camera) wanted = n == 2 && which ? which - 1 : n == 1 ? 0 : -1;
    if (wanted < 0 && camera)
        return err_set(e, "%s: expected a camera [%s], found %s", path, camera, n ? list : "none");
    if (wanted < 0)
        return err_set(e, "%s: expected one camera, found %s; name it as %s@NAME", path, list, path);
    for (char *p = text; *p; p++)
        if (*p != '\n' && (p < begin[wanted] || (end[wanted] && p >= end[wanted]))) *p = ' ';
    return 0;
}

static int parse(lens *l, double *fov_deg, const char *text, const char *path, errmsg *e)
{
    textlines t = textlines_of(text);
    char line[2048], word[32];
    int models = 0, in_table = 0;
    while (textlines_next(line, sizeof line, &t)) {
        double v[LENS_MAX_COEF];
        int used = 0;
        if (in_table && text_numbers(v, 2, line) == 2) {
            if (l->ntable == LENS_MAX_TABLE)
                return err_set(e, "%s: expected at most %d lines of table", path, LENS_MAX_TABLE - 1);
            if (!l->ntable && v[0] != 0) l->ntable = 1; /* r(0) = 0 goes without saying */
            l->tab_t[l->ntable] = v[0] * DEG;
            l->tab_r[l->ntable++] = v[1];
            continue;
        }
        in_table = 0;
        if (sscanf(line, "%31s%n", word, &used) != 1) return bad_line(path, &t, line, e);
        const char *rest = line + used;
        if (strcmp(word, "model") == 0) {
            char name[32];
            int k = sscanf(rest, " %31s", name) == 1 ? lens_kind_by_name(name) : -1;
            if (k < 0) return bad_line(path, &t, line, e);
            l->kind = (lens_kind)k;
            models++;
        } else if (strcmp(word, "polynomial") == 0) {
            l->ncoef = text_numbers(l->coef, LENS_MAX_COEF, rest);
            if (l->ncoef < 1) return bad_line(path, &t, line, e);
            l->kind = LENS_POLYNOMIAL;
            models++;
        } else if (strcmp(word, "kannala-brandt") == 0) {
            int n = text_numbers(v, 4, rest);
            if (n < 0) return bad_line(path, &t, line, e);
            memset(l->coef, 0, sizeof l->coef);
            l->coef[0] = 1;
            for (int k = 0; k < n; k++) l->coef[2 * k + 2] = v[k];
            l->ncoef = 9;
            l->kind = LENS_POLYNOMIAL;
            models++;
        } else if (strcmp(word, "camera") == 0) {
            int n = text_numbers(v, 5, rest);
            if (n < 4 || !(v[0] > 0 && v[1] > 0) || (n == 5 && !(fabs(v[4]) < v[0])))
                return bad_line(path, &t, line, e);
            lens_camera(l, v[0], v[1], v[2], v[3], n == 5 ? v[4] : 0);
        } else if (strcmp(word, "size") == 0) {
            if (text_numbers(l->size_px, 2, rest) != 2 || !(l->size_px[0] >= 1 && l->size_px[1] >= 1))
                return bad_line(path, &t, line, e);
        } else if (strcmp(word, "table") == 0) {
            l->kind = LENS_TABLE;
            l->ntable = 0;
            in_table = 1;
            models++;
        } else if (strcmp(word, "fov") == 0) {
            if (text_numbers(v, 1, rest) != 1) return bad_line(path, &t, line, e);
            if (*fov_deg == 0) *fov_deg = v[0];
        } else if (strcmp(word, "from-first") == 0) {
            if (text_numbers(l->from_first, 9, rest) != 9) return bad_line(path, &t, line, e);
        } else {
            return bad_line(path, &t, line, e);
        }
    }
    if (models != 1) return err_set(e, "%s: expected one lens model, found %d", path, models);
    return 0;
}

static int same_aspect(double w, double h, double W, double H)
{
    return fabs(w * H - h * W) <= 0.75 * fmax(W + w, H + h);
}

/* The camera matrix for the picture at hand. */
static int fit_to_picture(lens *l, char said[512], const char *spec, const lens_use *u, errmsg *e)
{
    const double w = u->width, h = u->height;
    double W = l->size_px[0], H = l->size_px[1];
    if (W > 0 && u->of_whole && same_aspect(W, H, u->of_whole[2], u->of_whole[3])) {
        const double k = u->of_whole[2] / W;
        W = w / k, H = h / k;
        for (int i = 0; i < 2; i++) l->centre_px[i] -= u->of_whole[i] / k;
    }
    if (W > 0) {
        /* a size that was rounded to whole pixels has the aspect to half a pixel either way */
        if (!same_aspect(w, h, W, H))
            return err_set(e,
                           "%s: expected a picture of %g x %g pixels, for which the lens was calibrated, or "
                           "of its aspect, found %g x %g",
                           spec, W, H, w, h);
        double k = 0.5 * (w / W + h / H);
        l->focal_px *= k;
        l->centre_px[0] *= w / W, l->centre_px[1] *= h / H;
    }
    double off = fmax(fabs(l->centre_px[0] / w - 0.5), fabs(l->centre_px[1] / h - 0.5));
    if (off > (W > 0 ? 0.25 : 0.1) && !u->centre)
        return err_set(e,
                       "%s: expected a camera matrix for a picture of %g x %g pixels, found the principal "
                       "point at %.5g, %.5g, far from its middle%s",
                       spec, w, h, l->centre_px[0], l->centre_px[1],
                       W > 0 ? "" : "; state the size that it is for (a line \"size W H\")");
    if (!(W > 0))
        snprintf(said + strlen(said), 512 - strlen(said),
                 "%s%s: no picture size stated; its camera matrix is taken to be for %g x %g pixels",
                 *said ? "; " : "", spec, w, h);
    return 0;
}

/* The picture's farthest corner from the centre, in focal lengths. */
static double farthest(const lens *l, const lens_use *u)
{
    const double(*s)[2] = l->shape, det = s[0][0] * s[1][1] - s[0][1] * s[1][0];
    const double *c = u->centre ? u->centre : l->centre_px;
    double far = 0;
    for (int k = 0; k < 4; k++) {
        double dx = (k & 1 ? u->width : 0) - c[0], dy = c[1] - (k & 2 ? u->height : 0);
        far = fmax(far, hypot(s[1][1] * dx - s[0][1] * dy, s[0][0] * dy - s[1][0] * dx) / det);
    }
    return far / l->focal_px;
}

/* The picture's nearest edge, in focal lengths. */
static double nearest(const lens *l, const lens_use *u)
{
    const double *c = u->centre ? u->centre : l->centre_px;
    const double across = hypot(l->shape[0][0], l->shape[0][1]), up = hypot(l->shape[1][0], l->shape[1][1]);
    const double x = fmin(c[0], u->width - c[0]) / across, y = fmin(c[1], u->height - c[1]) / up;
    return fmin(x, y) / l->focal_px;
}

/* The angle up to which a pixel holds less than four times what it does in the middle: towards the end of a
 * model's growth a small error of its coefficients is one of many degrees. */
static double fine_enough(const lens *l, double last)
{
    enum { STEPS = 2048 };
    double middle, here;
    lens_radius(&middle, l, 0);
    for (int i = 1; i <= STEPS; i++) {
        lens_radius(&here, l, last * i / STEPS);
        if (here < middle / 4) return last * (i - 1) / STEPS;
    }
    return last;
}

/* Half the field of view of a lens whose place in the picture is known: what is asked for, or all of the
 * picture, as far as the model goes. */
static int choose_half(double *half, const lens *l, char said[512], const char *spec, const lens_use *u,
                       double fov_deg, errmsg *e)
{
    lens all = *l;
    const double end = lens_end(l), corner = u->inscribed && fov_deg == 0 ? nearest(l, u) : farthest(l, u);
    if (l->kind == LENS_POLYNOMIAL && !(end > 1e-3))
        return err_set(e, "%s: expected a radius that grows with the angle, found none", spec);
    *half = fov_deg / 2 * DEG;
    if (fov_deg > 0 && *half <= end) return 0;
    double last = end < 179 * DEG && l->kind == LENS_POLYNOMIAL
                      ? end * (1 - 1e-3)
                      : end; /* at its end a pixel would hold any solid angle */
    if (lens_finish(&all, last, e)) return -1;
    const double reach = 1 / all.scale;
    if (u->inscribed && fov_deg == 0) last = fine_enough(&all, last);
    if (reach >= corner && lens_angle(&all, corner / reach) <= last) {
        double seen = lens_angle(&all, corner / reach);
        *half = fov_deg > 0 ? fmin(*half, seen) : seen;
        return 0;
    }
    if (fov_deg > 0 && l->kind != LENS_TABLE) return 0; /* lens_finish() has the words */
    if (fov_deg > 0)
        return err_set(e,
                       "%s: expected a model that reaches %g degrees, half the field of view, found that it "
                       "ends at %.4g, within the picture",
                       spec, fov_deg / 2, end / DEG);
    *half = last;
    if (u->inscribed) return 0; /* that it is used no farther is said with what is made of it */
    snprintf(said + strlen(said), 512 - strlen(said),
             "%s%s: the model ends at %.4g degrees, within the picture: what lies beyond is not used",
             *said ? "; " : "", spec, end / DEG);
    return 0;
}

/* Tangential terms, which are left out, move a point by up to about 3 |p| u^2 f, u the tangent.  A twentieth
 * of a degree is said, more refused. */
static int check_tangential(const lens *l, char said[512], const char *spec, errmsg *e)
{
    const double u = tan(fmin(l->half, 89.9 * DEG)), most = 3 * l->tangential * u * u;
    if (most * l->focal_px < 0.01) return 0;
    if (most > 0.05 * DEG)
        return err_set(e,
                       "%s: expected a radial model, found tangential terms that move points by up to %.2g "
                       "pixels; calibrate without "
                       "them (CALIB_ZERO_TANGENT_DIST)",
                       spec, most * l->focal_px);
    snprintf(said + strlen(said), 512 - strlen(said),
             "%s%s: tangential terms, up to %.2g pixels, are left out", *said ? "; " : "", spec,
             most * l->focal_px);
    return 0;
}

static int read_file(lens *l, double *fov_deg, char said[512], const char *spec, int which, errmsg *e)
{
    char *text, *path = strdup(spec), *at = path ? strrchr(path, '@') : NULL;
    errmsg why;
    if (!path) return err_set(e, "out of memory");
    int rc = text_read(&text, path, &why);
    if (!rc) at = NULL; /* part of the name */
    else if (at) {
        *at++ = 0;
        rc = text_read(&text, path, &why);
    }
    if (rc) {
        free(path);
        return err_set(
            e, "lens: expected equidistant, equisolid, stereographic, orthographic or a file, found %s",
            why.text);
    }
    if (calibration_is_ocam(text)) rc = calibration_ocam(l, text, path, e);
    else if (calibration_is_tree(text)) rc = calibration_tree(l, said, text, path, at, which, e);
    else rc = keep_camera(text, path, at, which, e) || parse(l, fov_deg, text, path, e) ? -1 : 0;
    free(text);
    free(path);
    return rc;
}

/* What is stated of the second camera's rotation must be one. */
static int check_rotation(const lens *l, const char *spec, errmsg *e)
{
    const double *r = l->from_first;
    double det = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) +
                 r[2] * (r[3] * r[7] - r[4] * r[6]),
           worst = 0, any = 0;
    for (int i = 0; i < 9; i++) any += fabs(r[i]);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            worst = fmax(worst, fabs(r[3 * i] * r[3 * k] + r[3 * i + 1] * r[3 * k + 1] +
                                     r[3 * i + 2] * r[3 * k + 2] - (i == k)));
    if (any == 0 || (worst < 1e-3 && det > 0)) return 0;
    return err_set(e, "%s: expected a rotation from the first camera, found a matrix of determinant %.4g%s",
                   spec, det, det > 0 ? " that is none" : "");
}

int lens_read_for(lens *l, char said[512], const char *spec, const lens_use *use, errmsg *e)
{
    lens t;
    double fov_deg = use->fov_deg, half = 0;
    memset(&t, 0, sizeof t);
    said[0] = 0;
    int k = lens_kind_by_name(spec);
    if (k >= 0) t.kind = (lens_kind)k;
    else if (read_file(&t, &fov_deg, said, spec, use->camera, e)) return -1;
    if (t.focal_px > 0 && use->width > 0) {
        if (fit_to_picture(&t, said, spec, use, e)) return -1;
    }
    if (t.focal_px > 0 && use->width > 0 && !use->placed) {
        if (choose_half(&half, &t, said, spec, use, fov_deg, e)) return -1;
    } else {
        if (fov_deg == 0 && t.focal_px > 0 && !use->placed) fov_deg = 2 * lens_end(&t) * (1 - 1e-3) / DEG;
        if (fov_deg == 0) return err_set(e, "lens %s: expected a field of view (--fov), found none", spec);
        half = fov_deg / 2 * DEG;
    }
    if (lens_finish(&t, half, e) || check_rotation(&t, spec, e)) return -1;
    if (t.focal_px > 0 && t.tangential > 0 && check_tangential(&t, said, spec, e)) return -1;
    *l = t;
    return 0;
}

int lens_read(lens *l, const char *spec, double fov_deg, errmsg *e)
{
    char said[512];
    const lens_use use = {.fov_deg = fov_deg};
    return lens_read_for(l, said, spec, &use, e);
}
