/*
 * lensfile.c - lens models from text files (lensfile.h).
 */
#include "lensfile.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "textfile.h"

#define DEG (M_PI / 180)

static int bad_line(const char *path, const textlines *t, const char *line, errmsg *e)
{
    return err_set(e,
                   "%s: line %d: expected model, polynomial, kannala-brandt, camera, table or fov (see the man page), found \"%.60s\"",
                   path, t->number, line);
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
            if (l->ntable == LENS_MAX_TABLE) return err_set(e, "%s: expected at most %d lines of table", path, LENS_MAX_TABLE - 1);
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
            if (text_numbers(v, 4, rest) != 4 || !(v[0] > 0 && v[1] > 0)) return bad_line(path, &t, line, e);
            if (fabs(v[0] - v[1]) > 0.01 * v[0])
                return err_set(e, "%s: expected fx and fy alike to 1 %%, found %g and %g", path, v[0], v[1]);
            l->focal_px = sqrt(v[0] * v[1]);
            l->centre_px[0] = v[2] + 0.5;
            l->centre_px[1] = v[3] + 0.5;
        } else if (strcmp(word, "table") == 0) {
            l->kind = LENS_TABLE;
            l->ntable = 0;
            in_table = 1;
            models++;
        } else if (strcmp(word, "fov") == 0) {
            if (text_numbers(v, 1, rest) != 1) return bad_line(path, &t, line, e);
            if (*fov_deg == 0) *fov_deg = v[0];
        } else {
            return bad_line(path, &t, line, e);
        }
    }
    if (models != 1) return err_set(e, "%s: expected one lens model, found %d", path, models);
    return 0;
}

int lens_read(lens *l, const char *spec, double fov_deg, errmsg *e)
{
    lens t;
    memset(&t, 0, sizeof t);
    int k = lens_kind_by_name(spec);
    if (k >= 0) {
        t.kind = (lens_kind)k;
    } else {
        char *text;
        errmsg why;
        if (text_read(&text, spec, &why))
            return err_set(e, "lens: expected equidistant, equisolid, stereographic, orthographic or a file, found %s", why.text);
        int rc = parse(&t, &fov_deg, text, spec, e);
        free(text);
        if (rc) return -1;
    }
    if (fov_deg == 0) return err_set(e, "lens %s: expected a field of view (--fov), found none", spec);
    if (lens_finish(&t, fov_deg / 2 * DEG, e)) return -1;
    *l = t;
    return 0;
}
