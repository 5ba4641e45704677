/*
 * exportjson.c - every number of the lamps, as JSON.
 *
 * Positions are given twice: `scene`, for people and other programs, and `field`, the lamp coordinates of
 * docs/FORMAT.md (section 1.8), in which masks are defined.
 */
#include "exportjson.h"

#include "base/outfile.h"
#include "report.h"
#include "vec.h"

static const double pi = 3.14159265358979323846;

static void numbers(FILE *o, const char *name, const double *v, int n)
{
    fprintf(o, "\"%s\": [", name);
    for (int k = 0; k < n; k++) fprintf(o, "%s%.9g", k ? ", " : "", v[k]);
    fprintf(o, "]");
}

static void place(FILE *o, const char *name, const ilf_frame *f, const double p[3], int point)
{
    double x[3];

    look_to_scene(x, f, p, point);
    numbers(o, name, x, 3);
}

static void samples(FILE *o, const ilf_mask *m)
{
    const int n = m->nx * m->ny * (m->kind == ILF_MASK_STACK ? m->nz : 1);

    fprintf(o, ", \"nx\": %d, \"ny\": %d, \"nz\": %d, ", m->nx, m->ny, m->kind == ILF_MASK_STACK ? m->nz : 1);
    fprintf(o, "\"x0\": %.9g, \"y0\": %.9g, \"dx\": %.9g, \"dy\": %.9g, \"samples\": [", m->x0, m->y0, m->dx,
            m->dy);
    for (int k = 0; k < n; k++) fprintf(o, "%s%.7g", k ? "," : "", (double)m->grid[k]);
    fprintf(o, "]");
}

static void one_mask(FILE *o, const ilf_mask *m)
{
    static const char *const KINDS[] = {"layer", "foot", "gate", "beam", "stack", "ball"};

    fprintf(o, "      {\"kind\": \"%s\", \"adds\": %s", KINDS[m->kind], m->adds ? "true" : "false");
    if (m->kind == ILF_MASK_FOOT || m->kind == ILF_MASK_GATE) fprintf(o, ", \"beta\": %.9g", m->beta);
    if (m->kind == ILF_MASK_LAYER) fprintf(o, ", "), numbers(o, "plane", m->plane, 3);
    if (m->kind == ILF_MASK_STACK) fprintf(o, ", "), numbers(o, "plane", m->plane, 2);
    if (m->kind == ILF_MASK_GATE) fprintf(o, ", "), numbers(o, "coef", m->coef, 6);
    if (m->kind == ILF_MASK_BEAM) fprintf(o, ", "), numbers(o, "coef", m->coef, 5);
    if (m->kind == ILF_MASK_STACK) fprintf(o, ", "), numbers(o, "coef", m->coef, 2);
    if (m->kind == ILF_MASK_BALL) fprintf(o, ", "), numbers(o, "coef", m->coef, 4);
    if (m->kind == ILF_MASK_LAYER || m->kind == ILF_MASK_FOOT)
        fprintf(o, ", \"link\": \"%s\"", m->link == ILF_LINK_LOGISTIC ? "logistic" : "value");
    if (m->grid) samples(o, m);
    fprintf(o, "}");
}

static void body(FILE *o, const char *name, const ilf_luminaire *l, const ilf_frame *f)
{
    const ilf_frame own = {.u = {1, 0, 0}, .v = {0, 1, 0}, .n = {0, 0, 1}};
    const ilf_frame *in = f ? f : &own;

    fprintf(o, "     \"%s\": {", name);
    place(o, "centre", in, l->centre, 1);
    if (l->shape != ILF_SPHERE) fprintf(o, ", "), place(o, "a", in, l->a, 0);
    if (l->shape == ILF_RECTANGLE || l->shape == ILF_DISC) fprintf(o, ", "), place(o, "b", in, l->b, 0);
    if (l->shape == ILF_SPHERE || l->shape == ILF_TUBE) fprintf(o, ", \"radius\": %.9g", l->radius);
    fprintf(o, "},\n");
}

static void light(FILE *o, const ilf_luminaire *l, const viewpoint *v, const ilf_frame *f)
{
    const double rgb[3] = {(double)l->rgb[0], (double)l->rgb[1], (double)l->rgb[2]};
    const double lum = 179 * ilf_luminance(l->rgb), m2 = v->metres * v->metres;
    double eye[3], e[3];

    for (int k = 0; k < 3; k++) e[k] = v->at[k] - f->origin[k];
    eye[0] = v_dot(e, f->u), eye[1] = v_dot(e, f->v), eye[2] = v_dot(e, f->n);
    v_sub(e, l->centre, eye);
    const double omega = ilf_luminaire_omega(l, eye);
    fprintf(o, "     "), numbers(o, "radiance", rgb, 3);
    fprintf(o, ", \"luminance\": %.7g, \"solid_angle\": %.7g, \"illuminance\": %.7g,\n", lum, omega,
            lum * omega);
    if (!l->far && v->metres > 0)
        fprintf(o, "     \"intensity\": %.7g, \"flux\": %.7g,\n", lum * omega * v_dot(e, e) * m2,
                pi * lum * ilf_luminaire_surface(l) * m2);
}

static void one_lamp(FILE *o, const found *it, const viewpoint *v, const ilf_frame *f)
{
    static const char *const SHAPES[] = {"sphere", "rectangle", "disc", "tube"};
    const ilf_luminaire *l = &it->l.s.l;

    fprintf(o, "    {\"shape\": \"%s\", \"at_infinity\": %s, \"out\": %s,\n", SHAPES[l->shape],
            it->l.c.far ? "true" : "false", lamp_is_out(l) ? "true" : "false");
    body(o, "scene", l, f), body(o, "field", l, NULL);
    ilf_luminaire lit = *l;
    lit.far = it->l.c.far;
    light(o, &lit, v, f);
    fprintf(o,
            "     \"error\": {\"position\": %.4g, \"radiance\": %.4g, \"masks\": %.4g, \"interpolation\": "
            "%.4g},\n",
            it->l.c.sigma, it->l.s.sigma_radiance, it->best.error, it->interpolation);
    fprintf(o, "     \"masks\": [");
    for (int k = 0; k < l->nmasks; k++) fprintf(o, k ? ",\n" : "\n"), one_mask(o, &l->masks[k]);
    fprintf(o, "]}");
}

static void head(FILE *o, const analysis *a, const viewpoint *v, const char *line)
{
    const ilf_frame *f = &a->f.frame;

    fprintf(o, "{\n  \"made_by\": ");
    report_text(o, line);
    fprintf(o, ",\n  \"units\": {\"length\": \"scene unit\", \"metres_in_scene_unit\": ");
    if (v->metres > 0) fprintf(o, "%.9g", v->metres);
    else fprintf(o, "null");
    fprintf(o, ", \"radiance\": \"W/sr/m^2 for each of R, G, B\", \"luminance\": \"cd/m^2 = 179 (.265 R + "
               ".670 G + .065 B)\",\n"
               "    \"solid_angle\": \"sr, seen from `from`, nothing hiding it\", \"illuminance\": \"lx at "
               "`from` on what faces it, nothing hiding it\",\n"
               "    \"intensity\": \"cd towards `from`\", \"flux\": \"lm from its surface, of flat ones to "
               "one side\",\n"
               "    \"error\": \"position: scene unit; others: of 1, rms; 0: not known\"},\n");
    fprintf(o, "  "), numbers(o, "from", v->at, 3);
    fprintf(o, ",\n  \"field\": {"), numbers(o, "origin", f->origin, 3);
    fprintf(o, ", "), numbers(o, "u", f->u, 3), fprintf(o, ", "), numbers(o, "v", f->v, 3);
    fprintf(o, ", "), numbers(o, "n", f->n, 3);
    fprintf(o, ", \"edges\": [%.9g, %.9g]},\n  \"lamps\": [", a->f.len_u, a->f.len_v);
}

int exportjson_write(const char *path, const analysis *a, const viewpoint *v, const char *line, errmsg *e)
{
    outfile *out;
    int n = 0;

    if (out_begin(&out, path, e)) return -1;
    FILE *o = out_stream(out);
    head(o, a, v, line);
    for (int i = 0; i < a->n; i++)
        if (a->lamps[i].fate == TAKEN) {
            fprintf(o, n++ ? ",\n" : "\n");
            one_lamp(o, &a->lamps[i], v, &a->f.frame);
        }
    fprintf(o, "\n  ]\n}\n");
    return out_commit(out, e);
}
