/*
 * exportrad.c - lamps and what is left for Radiance programs without our patches.
 *
 * A pattern knows the point that its ray met and the ray's direction and length: all that a mask asks for
 * (docs/FORMAT.md, section 2.7).  So a mask becomes a pattern on its lamp's material, with its picture as a data file,
 * and hides nothing but its own lamp.  Not a stack, which takes the largest of several pictures, nor one that adds.
 */
#include "exportrad.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/outfile.h"
#include "base/remark.h"
#include "export.h"
#include "vec.h"

enum { RIM = 48, LEAST_ROWS = 64 };
static const double pi = 3.14159265358979323846;

static const ilf_frame *frame_of(const analysis *a)
{
    return &a->f.frame;
}

/* ---- patterns -------------------------------------------------------------------------------------- */

/* The ray in lamp coordinates: ilf_a* its origin, ilf_d* its direction, ilf_p* where it crosses the plane. */
static void write_ray(FILE *o, const ilf_frame *f)
{
    static const char *const axis[] = {"x", "y", "z"};
    const double *const to[] = {f->u, f->v, f->n};

    fprintf(o, "{ the ray in the light field's own coordinates, by ilflamps }\n");
    for (int k = 0; k < 3; k++) {
        fprintf(o, "ilf_d%s = Dx*(%.9g) + Dy*(%.9g) + Dz*(%.9g);\n", axis[k], to[k][0], to[k][1], to[k][2]);
        fprintf(o, "ilf_h%s = (Px-(%.9g))*(%.9g) + (Py-(%.9g))*(%.9g) + (Pz-(%.9g))*(%.9g);\n", axis[k],
                f->origin[0], to[k][0], f->origin[1], to[k][1], f->origin[2], to[k][2]);
        fprintf(o, "ilf_a%s = ilf_h%s - Ts*ilf_d%s;\n", axis[k], axis[k], axis[k]);
    }
    fprintf(o, "ilf_rise = if(ilf_dz - 1e-9, ilf_dz, 1e-9);\n");
    for (int k = 0; k < 2; k++) {
        fprintf(o, "ilf_at%s(z) = ilf_h%s + (z - ilf_hz)*ilf_d%s/ilf_rise;\n", axis[k], axis[k], axis[k]);
        fprintf(o, "ilf_foot%s(b,c,cz) = ilf_at%s(0) + b*(ilf_at%s(cz) - c);\n", axis[k], axis[k], axis[k]);
    }
    fprintf(o, "ilf_logistic(g) = 1/(1 + exp(-bound(-80, g, 80)));\n");
    fprintf(o, "ilf_u = bound(0, (atan2(ilf_dy, ilf_dx) + PI)/PI, 2);\n");
    fprintf(o, "ilf_v = bound(0, 1 - Acos(ilf_dz)/(PI/2), 1);\n");
}

/* Where the ray meets the picture, m%d_x and m%d_y, and what a sample passes, m%d(v); a picture is held beyond
 * its edge by that edge's samples. */
static void write_picture(FILE *o, const ilf_mask *m, int k, const double c[3])
{
    const double x1 = m->x0 + (m->nx - 1) * m->dx, y1 = m->y0 + (m->ny - 1) * m->dy;

    if (m->kind == ILF_MASK_LAYER) {
        fprintf(o, "m%d_gap = (%.9g) + (%.9g)*ilf_ax + (%.9g)*ilf_ay - ilf_az;\n", k, m->plane[0],
                m->plane[1], m->plane[2]);
        fprintf(o, "m%d_rise = ilf_dz - (%.9g)*ilf_dx - (%.9g)*ilf_dy;\n", k, m->plane[1], m->plane[2]);
        fprintf(o, "m%d_t = if(m%d_rise - 1e-9, m%d_gap/m%d_rise, -1);\n", k, k, k, k);
        fprintf(o, "m%d_x = bound(%.9g, ilf_ax + m%d_t*ilf_dx, %.9g);\n", k, m->x0, k, x1);
        fprintf(o, "m%d_y = bound(%.9g, ilf_ay + m%d_t*ilf_dy, %.9g);\n", k, m->y0, k, y1);
        fprintf(o, "m%d(v) = if(m%d_t, if((%.9g) - ilf_az - m%d_t*ilf_dz, %s, 1), 1);\n", k, k, c[2], k,
                m->link == ILF_LINK_LOGISTIC ? "ilf_logistic(v)" : "v");
        return;
    }
    fprintf(o, "m%d_x = bound(%.9g, ilf_footx(%.9g, %.9g, %.9g), %.9g);\n", k, m->x0, m->beta, c[0], c[2],
            x1);
    fprintf(o, "m%d_y = bound(%.9g, ilf_footy(%.9g, %.9g, %.9g), %.9g);\n", k, m->y0, m->beta, c[1], c[2],
            y1);
    fprintf(o, "m%d(v) = %s;\n", k, m->link == ILF_LINK_LOGISTIC ? "ilf_logistic(v)" : "v");
}

static void write_formula(FILE *o, const ilf_mask *m, int k, const double c[3])
{
    const double *q = m->coef;

    if (m->kind == ILF_MASK_BEAM) {
        fprintf(o, "m%d_c = -(ilf_dx*(%.9g) + ilf_dy*(%.9g) + ilf_dz*(%.9g));\n", k, q[0], q[1], q[2]);
        fprintf(o, "m%d = if(m%d_c, (%.9g)*m%d_c^(%.9g), 0);\n", k, k, q[4], k, q[3]);
    } else if (m->kind == ILF_MASK_GATE) {
        fprintf(o, "m%d_x = ilf_footx(%.9g, %.9g, %.9g);\n", k, m->beta, c[0], c[2]);
        fprintf(o, "m%d_y = ilf_footy(%.9g, %.9g, %.9g);\n", k, m->beta, c[1], c[2]);
        fprintf(o,
                "m%d = ilf_logistic((%.9g) + (%.9g)*m%d_x + (%.9g)*m%d_y + (%.9g)*m%d_x*m%d_x + "
                "(%.9g)*m%d_x*m%d_y + (%.9g)*m%d_y*m%d_y);\n",
                k, q[0], q[1], k, q[2], k, q[3], k, k, q[4], k, k, q[5], k, k);
    } else {
        static const char *const axis[] = {"x", "y", "z"};
        for (int i = 0; i < 3; i++) fprintf(o, "m%d_%s = (%.9g) - ilf_a%s;\n", k, axis[i], q[i], axis[i]);
        fprintf(o, "m%d_t = m%d_x*ilf_dx + m%d_y*ilf_dy + m%d_z*ilf_dz;\n", k, k, k, k);
        fprintf(o, "m%d_r = m%d_x*m%d_x + m%d_y*m%d_y + m%d_z*m%d_z - m%d_t*m%d_t;\n", k, k, k, k, k, k, k, k,
                k);
        fprintf(o,
                "m%d = if(m%d_t, if(((%.9g) - ilf_az)/ilf_rise - m%d_t, if((%.9g) - m%d_r, 0, 1), 1), 1);\n",
                k, k, c[2], k, q[3] * q[3], k);
    }
}

static int has_picture(const ilf_mask *m)
{
    return m->kind == ILF_MASK_LAYER || m->kind == ILF_MASK_FOOT;
}

/* Is it a pattern that Radiance has?  Of what is met infinitely far away only directions are known. */
static int is_pattern(const ilf_mask *m, const ilf_luminaire *l)
{
    return !m->adds && m->kind != ILF_MASK_STACK && (!l->far || m->kind == ILF_MASK_BEAM);
}

/* ---- files ------------------------------------------------------------------------------------------- */

/* What all names begin with ("DIR/", "FILE."), and a name. */
static const char *in(char *path, size_t room, const char *base, const char *name)
{
    (void)!snprintf(path, room, "%s%s", base, name);
    return path;
}

/* A text file that a function writes: whole or not at all. */
typedef void writer(FILE *o, const char *base, const analysis *a, const void *what);

static int write_text(const char *base, const char *name, writer *fill, const analysis *a, const void *what,
                      errmsg *e)
{
    char path[4096];
    outfile *o = NULL;

    if (out_begin(&o, in(path, sizeof path, base, name), e)) return -1;
    fill(out_stream(o), base, a, what);
    return out_commit(o, e);
}

/* Radiance's data files: the slower dimension first, at least two samples along each. */
static void fill_data(FILE *o, const char *base, const analysis *a, const void *what)
{
    const ilf_mask *m = what;
    const int nx = m->nx > 1 ? m->nx : 2, ny = m->ny > 1 ? m->ny : 2;

    (void)base, (void)a;
    fprintf(o, "2\n%.9g %.9g %d\n%.9g %.9g %d\n", m->y0, m->y0 + (ny - 1) * m->dy, ny, m->x0,
            m->x0 + (nx - 1) * m->dx, nx);
    for (int j = 0; j < ny; j++)
        for (int i = 0; i < nx; i++)
            fprintf(
                o, "%.6g%c",
                (double)m->grid[(size_t)(m->ny > 1 ? j : 0) * (size_t)m->nx + (size_t)(m->nx > 1 ? i : 0)],
                i + 1 < nx ? ' ' : '\n');
}

static void fill_cal(FILE *o, const char *base, const analysis *a, const void *what)
{
    int k = 0;

    (void)base, (void)what;
    write_ray(o, frame_of(a));
    for (int i = 0; i < a->n; i++)
        for (int j = 0; a->lamps[i].fate == TAKEN && j < a->lamps[i].l.s.l.nmasks; j++) {
            const ilf_luminaire *l = &a->lamps[i].l.s.l;
            k++;
            if (!is_pattern(&l->masks[j], l)) continue;
            if (has_picture(&l->masks[j])) write_picture(o, &l->masks[j], k, l->centre);
            else write_formula(o, &l->masks[j], k, l->centre);
        }
}

/* ---- the lamps ---------------------------------------------------------------------------------------- */

static void point(FILE *o, const ilf_frame *f, const double p[3])
{
    double x[3];

    look_to_scene(x, f, p, 1);
    fprintf(o, " %.9g %.9g %.9g", x[0], x[1], x[2]);
}

static void polygon(FILE *o, const analysis *a, const ilf_luminaire *l, double side)
{
    const int n = l->shape == ILF_RECTANGLE ? 4 : RIM;
    const double grow = l->shape == ILF_RECTANGLE ? sqrt(2.) : sqrt(2 * pi / n / sin(2 * pi / n));

    fprintf(o, "0\n0\n%d\n", 3 * n);
    for (int k = 0; k < n; k++) {
        /* a rectangle's corners lie between its axes; one turns so that the front looks at the plane */
        const double t = 2 * pi * (k + (n == 4 ? .5 : 0)) / n, s = grow * sin(t) * side;
        double p[3];
        for (int c = 0; c < 3; c++) p[c] = l->centre[c] + grow * cos(t) * l->a[c] + s * l->b[c];
        point(o, frame_of(a), p);
        fputc('\n', o);
    }
}

static void flat(FILE *o, const analysis *a, const ilf_luminaire *l, const char *material, int number)
{
    const ilf_frame *f = frame_of(a);
    double A[3], B[3], n[3], to[3], c[3];

    look_to_scene(A, f, l->a, 0), look_to_scene(B, f, l->b, 0), look_to_scene(c, f, l->centre, 1);
    v_cross(n, A, B), v_unit(n);
    for (int k = 0; k < 3; k++)
        to[k] = f->origin[k] + (a->f.len_u * f->u[k] + a->f.len_v * f->v[k]) / 2 - c[k];
    const double side = v_dot(n, to) < 0 ? -1 : 1, ra = v_len(A), rb = v_len(B);
    const int round = l->shape == ILF_DISC && fabs(ra - rb) < 1e-3 * ra;
    fprintf(o, "%s %s lamp_%d\n", material, round ? "ring" : "polygon", number);
    if (!round) polygon(o, a, l, side);
    else {
        fprintf(o, "0\n0\n8");
        point(o, f, l->centre);
        fprintf(o, " %.9g %.9g %.9g 0 %.9g\n", side * n[0], side * n[1], side * n[2], sqrt(ra * rb));
    }
}

static void tube(FILE *o, const analysis *a, const ilf_luminaire *l, const char *material, int number)
{
    const ilf_frame *f = frame_of(a);

    fprintf(o, "%s cylinder lamp_%d\n0\n0\n7", material, number);
    for (int end = -1; end < 2; end += 2) {
        const double p[3] = {l->centre[0] + end * l->a[0], l->centre[1] + end * l->a[1],
                             l->centre[2] + end * l->a[2]};
        point(o, f, p);
    }
    fprintf(o, " %.9g\n", l->radius);
    for (int end = -1; end < 2; end += 2) {
        const double p[3] = {l->centre[0] + end * l->a[0], l->centre[1] + end * l->a[1],
                             l->centre[2] + end * l->a[2]};
        fprintf(o, "%s sphere lamp_%d_end_%d\n0\n0\n4", material, number, (end + 3) / 2);
        point(o, f, p);
        fprintf(o, " %.9g\n", l->radius);
    }
}

static void body(FILE *o, const analysis *a, const ilf_luminaire *l, const char *material, int number)
{
    const double middle[3] = {a->f.len_u / 2, a->f.len_v / 2, 0};
    double d[3], e[3];

    if (l->far) {
        v_sub(e, l->centre, middle), look_to_scene(d, frame_of(a), e, 0), v_unit(d);
        fprintf(o, "%s source lamp_%d\n0\n0\n4 %.9g %.9g %.9g %.9g\n", material, number, d[0], d[1], d[2],
                2 * ilf_luminaire_cone(l, middle) * 180 / pi);
    } else if (l->shape == ILF_SPHERE) {
        fprintf(o, "%s sphere lamp_%d\n0\n0\n4", material, number);
        point(o, frame_of(a), l->centre);
        fprintf(o, " %.9g\n", l->radius);
    } else if (l->shape == ILF_TUBE) tube(o, a, l, material, number);
    else flat(o, a, l, material, number);
}

/* A lamp's patterns, one upon the other, its light, and its body; *k counts all masks. */
static void one_lamp(FILE *o, const char *base, const analysis *a, const ilf_luminaire *l, int number, int *k)
{
    char above[64] = "void", material[64];

    fprintf(o, "\n");
    for (int j = 0; j < l->nmasks; j++) {
        const ilf_mask *m = &l->masks[j];
        ++*k;
        if (!is_pattern(m, l)) continue;
        if (has_picture(m))
            fprintf(o, "%s brightdata mask_%d\n5 m%d %smask.%d.dat %slamps.cal m%d_y m%d_x\n0\n0\n", above,
                    *k, *k, base, *k, base, *k, *k);
        else fprintf(o, "%s brightfunc mask_%d\n2 m%d %slamps.cal\n0\n0\n", above, *k, *k, base);
        (void)!snprintf(above, sizeof above, "mask_%d", *k);
    }
    (void)!snprintf(material, sizeof material, "light_%d", number);
    fprintf(o, "%s light %s\n0\n0\n3 %.7g %.7g %.7g\n", above, material, fmax(0, (double)l->rgb[0]),
            fmax(0, (double)l->rgb[1]), fmax(0, (double)l->rgb[2]));
    body(o, a, l, material, number);
}

static void fill_lamps(FILE *o, const char *base, const analysis *a, const void *line)
{
    int k = 0, number = 0;

    fprintf(o, "# %s\n", (const char *)line);
    for (int i = 0; i < a->n; i++) {
        const ilf_luminaire *l = &a->lamps[i].l.s.l;
        if (a->lamps[i].fate != TAKEN) continue;
        number++;
        if (!lamp_is_out(l)) one_lamp(o, base, a, l, number, &k);
        else {
            fprintf(o, "\n# lamp %d is put out\n", number);
            k += l->nmasks;
        }
    }
}

static int write_data(const char *base, const analysis *a, errmsg *e)
{
    char name[32];
    int k = 0;

    for (int i = 0; i < a->n; i++)
        for (int j = 0; a->lamps[i].fate == TAKEN && j < a->lamps[i].l.s.l.nmasks; j++) {
            const ilf_luminaire *l = &a->lamps[i].l.s.l;
            (void)!snprintf(name, sizeof name, "mask.%d.dat", ++k);
            if (is_pattern(&l->masks[j], l) && has_picture(&l->masks[j]) &&
                write_text(base, name, fill_data, a, &l->masks[j], e))
                return -1;
        }
    return 0;
}

/* ---- what is left --------------------------------------------------------------------------------------- */

static void fill_panorama(FILE *o, const char *base, const analysis *a, const void *line)
{
    const double *n = frame_of(a)->n;

    fprintf(o,
            "# %s\n\nvoid colorpict ilf_residual\n7 red green blue %sresidual.hdr %slamps.cal ilf_u ilf_v\n",
            (const char *)line, base, base);
    fprintf(o, "0\n0\nilf_residual glow ilf_glow\n0\n0\n4 1 1 1 0\n");
    fprintf(o, "ilf_glow source ilf_surroundings\n0\n0\n4 %.9g %.9g %.9g 180\n", n[0], n[1], n[2]);
}

/* The upper hemisphere: columns azimuth, rows polar angle, the first and the last ones at the picture's very edges, as
 * Radiance has them. */
static void hemisphere(double d[3], int x, int y, const img *im, const ilf_frame *f)
{
    const double p = .999999 * y * pi / 2 / (im->info.height - 1), t = x * 2 * pi / (im->info.width - 1) - pi;
    const double local[3] = {sin(p) * cos(t), sin(p) * sin(t), cos(p)};

    look_to_scene(d, f, local, 0);
}

static int write_residual(const char *base, const analysis *a, const viewpoint *v, const char *line,
                          errmsg *e)
{
    const int rows = (int)fmax(LEAST_ROWS, ceil(a->f.np * pi / 2 / a->f.polar_max));
    char path[4096];
    outfile *o = NULL;
    ilf *residual = NULL;
    ilf_error err;
    img im = {0};
    int bad = out_begin(&o, in(path, sizeof path, base, "residual.ilf.exr"), e);

    if (bad) return -1;
    bad = lf_write(&a->f, out_path(o), line, e) || img_alloc(&im, 2 * rows, rows, 3, e);
    if (!bad && ilf_open(&residual, out_path(o), &err) != ILF_OK) bad = err_set(e, "%s", err.text);
    if (!bad) bad = look_round(&im, residual, a, v, hemisphere, e);
    ilf_close(residual);
    if (!bad) bad = img_write(&im, in(path, sizeof path, base, "residual.hdr"), NULL, e);
    img_free(&im);
    if (!bad) return out_commit(o, e);
    out_abort(o);
    return -1;
}

/* ---- all of it -------------------------------------------------------------------------------------------- */

static void say_left_out(const char *path, const analysis *a)
{
    char what[1024] = "";
    int number = 0;

    for (int i = 0; i < a->n; i++)
        if (a->lamps[i].fate == TAKEN)
            export_left_out(what, sizeof what, ++number, &a->lamps[i].l.s.l, is_pattern);
    if (what[0]) remark(path, "left out, as Radiance has no pattern for it: %s", what);
}

static int without_blanks(const char *path, errmsg *e)
{
    if (!strpbrk(path, " \t\n#")) return 0;
    return err_set(e, "%s: expected a name without spaces, which Radiance's files can't hold", path);
}

static int write_beside(const char *base, const analysis *a, const viewpoint *v, const char *line, errmsg *e)
{
    return write_text(base, "lamps.cal", fill_cal, a, NULL, e) || write_data(base, a, e) ||
                   write_residual(base, a, v, line, e)
               ? -1
               : 0;
}

int exportrad_write(const char *dir, const analysis *a, const viewpoint *v, const char *line, errmsg *e)
{
    char base[4000];

    (void)!snprintf(base, sizeof base, "%s/", dir);
    if (without_blanks(dir, e)) return -1;
    if (mkdir(dir, 0777) && errno != EEXIST) return err_errno(e, "%s", dir);
    if (write_beside(base, a, v, line, e) || write_text(base, "panorama.rad", fill_panorama, a, line, e) ||
        write_text(base, "lamps.rad", fill_lamps, a, line, e))
        return -1;
    say_left_out(dir, a);
    return 0;
}

static void fill_scene(FILE *o, const char *base, const analysis *a, const void *line)
{
    fill_lamps(o, base, a, line);
    fprintf(o, "\n");
    fill_panorama(o, base, a, line);
}

int exportrad_file(const char *path, const analysis *a, const viewpoint *v, const char *line, errmsg *e)
{
    const size_t n = strlen(path) - 3; /* up to the ending, its dot included */
    char base[4000];

    (void)!snprintf(base, sizeof base, "%.*s", (int)n, path);
    if (without_blanks(path, e) || write_beside(base, a, v, line, e) ||
        write_text(base, "rad", fill_scene, a, line, e))
        return -1;
    say_left_out(path, a);
    return 0;
}
