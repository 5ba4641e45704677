/*
 * report.c - what was found, as JSON: positions in the scene's coordinates and unit, radiance in W/sr/m^2 per
 * channel, cd and lm by 179 lm/W (for a scene in metres).
 */
#include "report.h"

#include <math.h>
#include <stdio.h>

#include "base/outfile.h"
#include "vec.h"

#define DEG (180 / 3.14159265358979323846)

static const char *const SHAPES[] = {"sphere", "rectangle", "disc", "tube"};
static const char *const FATES[] = {"taken out", "left in the field: too wide",
                                    "left in the field: not explained", "left in the field: no shape fits"};
static const char *const KINDS[] = {"sheet", "foot picture", "gate", "beam", "stack", "ball"};

void report_text(FILE *o, const char *s)
{
    fputc('"', o);
    for (; *s; s++)
        if (*s == '"' || *s == '\\') fprintf(o, "\\%c", *s);
        else if ((unsigned char)*s < 32) fprintf(o, "\\u%04x", (unsigned)*s);
        else fputc(*s, o);
    fputc('"', o);
}

static void triple(FILE *o, const char *name, const double v[3])
{
    fprintf(o, "\"%s\": [%.6g, %.6g, %.6g], ", name, v[0], v[1], v[2]);
}

static void place(FILE *o, const char *name, const ilf_frame *f, const double p[3], int point)
{
    double x[3];

    for (int k = 0; k < 3; k++)
        x[k] = (point ? f->origin[k] : 0) + p[0] * f->u[k] + p[1] * f->v[k] + p[2] * f->n[k];
    triple(o, name, x);
}

/* Projected area towards the plane's middle: candela there = luminance x area. */
static double area(const ilf_luminaire *l, const lightfield *f)
{
    const double eye[3] = {f->len_u / 2, f->len_v / 2, 0};
    double e[3];

    v_sub(e, l->centre, eye);
    return ilf_luminaire_omega(l, eye) * v_dot(e, e);
}

static void masks(FILE *o, const ilf_luminaire *l, const ilf_frame *fr)
{
    fprintf(o, "\"masks\": [");
    for (int k = 0; k < l->nmasks; k++) {
        const ilf_mask *m = &l->masks[k];
        fprintf(o, "%s{\"kind\": \"%s\", ", k ? ", " : "", KINDS[m->kind]);
        if (m->kind == ILF_MASK_FOOT || m->kind == ILF_MASK_GATE) fprintf(o, "\"beta\": %.4g, ", m->beta);
        if (m->kind == ILF_MASK_LAYER) triple(o, "plane", m->plane);
        if (m->kind == ILF_MASK_BEAM) {
            place(o, "axis", fr, m->coef, 0);
            fprintf(o, "\"exponent\": %.4g, \"gain\": %.4g, ", m->coef[3], m->coef[4]);
        }
        if (m->kind == ILF_MASK_BALL) {
            place(o, "centre", fr, m->coef, 1);
            fprintf(o, "\"radius\": %.4g, ", m->coef[3]);
        }
        fprintf(o, "\"adds\": %s, \"picture\": [%d, %d]}", m->adds ? "true" : "false", m->nx, m->ny);
    }
    fprintf(o, "], ");
}

static void one_lamp(FILE *o, const found *it, const lightfield *f)
{
    const ilf_luminaire *l = &it->l.s.l;
    const double lum = 179 * it->l.s.radiance;

    fprintf(o, "    {\"fate\": \"%s\", \"shape\": \"%s\", \"at_infinity\": %s, ", FATES[it->fate],
            !it->l.seen ? "unknown" : SHAPES[l->shape], it->l.c.far ? "true" : "false");
    place(o, "position", &f->frame, !it->l.seen ? it->l.c.at : l->centre, 1);
    fprintf(o, "\"position_error\": %.3g, \"seen_by\": %d, \"seen_whole_by\": %d, ", it->l.c.sigma,
            it->l.c.seen, it->l.s.full);
    if (it->l.seen) {
        if (l->shape == ILF_SPHERE || l->shape == ILF_TUBE) fprintf(o, "\"radius\": %.6g, ", l->radius);
        if (l->shape != ILF_SPHERE) place(o, "a", &f->frame, l->a, 0);
        if (l->shape == ILF_RECTANGLE || l->shape == ILF_DISC) place(o, "b", &f->frame, l->b, 0);
        const double rgb[3] = {(double)l->rgb[0], (double)l->rgb[1], (double)l->rgb[2]};
        triple(o, "radiance", rgb);
        fprintf(o, "\"radiance_error\": %.3g, \"width_deg\": %.4g, ", it->l.s.sigma_radiance,
                it->l.width * 57.29577951308232);
        if (f->info.version == ILF_FILE_VERSION) fprintf(o, "\"shape_misfit\": %.3g, ", it->l.s.misfit);
        fprintf(o, "\"candela\": %.4g, \"lumen\": %.4g, ", lum * area(l, f),
                3.14159265358979 * lum * ilf_luminaire_surface(l));
    }
    if (it->fate == TAKEN || it->fate == UNEXPLAINED) {
        fprintf(o, "\"model\": ");
        report_text(o, it->best.n ? it->best.name : "nothing hides it");
        fprintf(o, ", \"error\": %.4g, \"error_of_interpolation\": %.4g, ", it->best.error,
                it->interpolation);
        if (it->best.height > 0) fprintf(o, "\"height\": %.4g, ", it->best.height);
        masks(o, l, &f->frame);
    }
    fprintf(o, "\"seen\": [");
    for (int k = 0; it->l.seen && k < f->n; k++) fprintf(o, "%s%.4g", k ? ", " : "", it->l.seen[k]);
    fprintf(o, "]}");
}

void report_lamps(FILE *o, const analysis *a)
{
    fprintf(o, "  \"lamps\": [\n");
    for (int i = 0; i < a->n; i++) {
        one_lamp(o, &a->lamps[i], &a->f);
        fprintf(o, i + 1 < a->n ? ",\n" : "\n");
    }
    fprintf(o, "  ]\n");
}

int report_write(const char *path, const char *input, const analysis *a, errmsg *e)
{
    outfile *out;

    if (out_begin(&out, path, e)) return -1;
    FILE *o = out_stream(out);
    fprintf(o, "{\n  \"input\": ");
    report_text(o, input);
    fprintf(o, ",\n  \"version\": %d, \"probes\": [%d, %d], \"texels\": [%d, %d],", a->f.info.version,
            a->f.nu, a->f.nv, a->f.nt, a->f.np);
    if (a->f.info.version == ILF_FILE_VERSION)
        fprintf(o, " \"spots\": %d, \"stray_spots\": %d, \"cpu_s\": %.2f,", a->spots, a->stray, a->cpu_s);
    if (a->steady.measured)
        fprintf(o, " \"turned_probes\": {\"measured\": %d, \"degrees\": %.4g, \"error_degrees\": %.4g},",
                a->steady.measured, a->steady.turn * DEG, a->steady.sure * DEG);
    if (a->blur.lamps)
        fprintf(o,
                " \"blur\": {\"degrees\": %.4g, \"lamps\": %d, \"misfit\": %.3g, \"misfit_if_sharp\": %.3g},",
                a->blur.width * DEG, a->blur.lamps, a->blur.misfit, a->blur.sharp);
    fprintf(o, "\n");
    report_lamps(o, a);
    fprintf(o, "}\n");
    return out_commit(out, e);
}
