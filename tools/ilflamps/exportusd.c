/*
 * exportusd.c - lamps and what is left for programs that read USD.
 *
 * UsdLux: a light with normalize off has the radiance intensity x 2^exposure x color, everywhere on it and to all
 * sides; RectLight and DiskLight lie in their xy plane and shine along -z; CylinderLight lies along x, without ends;
 * DistantLight shines along -z.  DomeLight's own y axis is up, its picture's middle column looks along +z, and
 * columns go from longitude +pi (left) to -pi, longitude +pi/2 being +x.
 *
 *       own axes of the dome        in a stage with z up (turned about x by 90 degrees)
 *            y                           z
 *            |                           |
 *            +--- x                      +--- x          picture's middle: -y
 *           /                           /
 *          z                          -y
 */
#include "exportusd.h"

#include <stdlib.h>
#include <string.h>

#include "base/outfile.h"
#include "base/remark.h"
#include "export.h"
#include "vec.h"

static const double pi = 3.14159265358979323846;

typedef struct axes {
    double x[3], y[3], z[3]; /* a light's own, in the scene's coordinates, of length 1 */
} axes;

/* Text between quotes of USD's. */
static void quoted(FILE *o, const char *s)
{
    fputc('"', o);
    for (; *s; s++)
        if (*s == '"' || *s == '\\') fprintf(o, "\\%c", *s);
        else fputc(*s == '\n' ? ' ' : *s, o);
    fputc('"', o);
}

/* ---- lamps ---------------------------------------------------------------------------------------- */

static void transform(FILE *o, const axes *t, const double at[3])
{
    const double *r[] = {t->x, t->y, t->z};

    fprintf(o, "            matrix4d xformOp:transform = (");
    for (int k = 0; k < 3; k++) fprintf(o, " (%.12g, %.12g, %.12g, 0),", r[k][0], r[k][1], r[k][2]);
    fprintf(o, " (%.9g, %.9g, %.9g, 1) )\n", at[0], at[1], at[2]);
    fprintf(o, "            uniform token[] xformOpOrder = [\"xformOp:transform\"]\n");
}

static void brightness(FILE *o, const ilf_luminaire *l)
{
    const double r = fmax(0, (double)l->rgb[0]), g = fmax(0, (double)l->rgb[1]),
                 b = fmax(0, (double)l->rgb[2]);
    const double most = fmax(r, fmax(g, b)), of = most > 0 ? most : 1;

    fprintf(o, "            color3f inputs:color = (%.7g, %.7g, %.7g)\n", r / of, g / of, b / of);
    fprintf(o, "            float inputs:intensity = %.7g\n", most);
    fprintf(o, "            float inputs:exposure = 0\n            bool inputs:normalize = 0\n");
}

/* Axes of what lies along a and b and shines along -z to where somebody stands. */
static void flat_axes(axes *t, const ilf_luminaire *l, const ilf_frame *f, const double eye[3])
{
    double c[3], to[3];

    look_to_scene(t->x, f, l->a, 0), look_to_scene(t->y, f, l->b, 0), look_to_scene(c, f, l->centre, 1);
    v_unit(t->x), v_cross(t->z, t->x, t->y), v_unit(t->z);
    v_sub(to, eye, c);
    if (v_dot(t->z, to) > 0)
        for (int k = 0; k < 3; k++) t->z[k] = -t->z[k];
    v_cross(t->y, t->z, t->x);
}

static void axes_about_z(axes *t)
{
    v_basis(t->x, t->y, t->z);
}

static const char *kind_of(const ilf_luminaire *l)
{
    static const char *const KINDS[] = {"SphereLight", "RectLight", "DiskLight", "CylinderLight"};

    return l->far ? "DistantLight" : KINDS[l->shape];
}

static void flat_light(FILE *o, const ilf_luminaire *l, const ilf_frame *f, const double eye[3],
                       const double c[3])
{
    const double ra = v_len(l->a), rb = v_len(l->b);
    axes t;

    flat_axes(&t, l, f, eye);
    if (l->shape == ILF_RECTANGLE)
        fprintf(o, "            float inputs:width = %.9g\n            float inputs:height = %.9g\n", 2 * ra,
                2 * rb);
    else {
        /* an ellipse is a disk that its axes stretch */
        fprintf(o, "            float inputs:radius = %.9g\n", ra);
        for (int k = 0; k < 3; k++) t.y[k] *= rb / ra;
    }
    transform(o, &t, c);
}

/* Round ends become length: seen from the side, the tube is as large. */
static void tube_light(FILE *o, const ilf_luminaire *l, const ilf_frame *f, const double c[3])
{
    axes t;

    look_to_scene(t.x, f, l->a, 0), v_unit(t.x);
    v_basis(t.y, t.z, t.x);
    fprintf(o, "            float inputs:radius = %.9g\n            float inputs:length = %.9g\n", l->radius,
            2 * v_len(l->a) + pi * l->radius / 2);
    transform(o, &t, c);
}

static void far_light(FILE *o, const ilf_luminaire *l, const ilf_frame *f, const double eye[3],
                      const double c[3])
{
    axes t;
    double p[3], e[3];

    v_sub(t.z, c, eye), v_unit(t.z);
    axes_about_z(&t);
    for (int k = 0; k < 3; k++) e[k] = eye[k] - f->origin[k];
    p[0] = v_dot(e, f->u), p[1] = v_dot(e, f->v), p[2] = v_dot(e, f->n);
    fprintf(o, "            float inputs:angle = %.7g\n", 2 * ilf_luminaire_cone(l, p) * 180 / pi);
    transform(o, &t, (const double[3]){0, 0, 0});
}

static void one_lamp(FILE *o, const found *it, int number, const ilf_frame *f, const double eye[3])
{
    ilf_luminaire l = it->l.s.l;
    double c[3];
    const axes scene = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

    l.far = it->l.c.far;
    look_to_scene(c, f, l.centre, 1);
    fprintf(o, "\n        def %s \"lamp_%d\" (\n            doc = ", kind_of(&l), number);
    quoted(o, lamp_is_out(&l) ? "put out" : it->best.n ? it->best.name : "nothing hides it");
    fprintf(o, "\n        )\n        {\n");
    brightness(o, &l);
    if (l.far) far_light(o, &l, f, eye, c);
    else if (l.shape == ILF_TUBE) tube_light(o, &l, f, c);
    else if (l.shape != ILF_SPHERE) flat_light(o, &l, f, eye, c);
    else {
        fprintf(o, "            float inputs:radius = %.9g\n", l.radius);
        transform(o, &scene, c);
    }
    fprintf(o, "        }\n");
}

/* ---- what is left ----------------------------------------------------------------------------------- */

/* The dome's picture: rows from straight up to straight down along the stage's z axis. */
static void dome_dir(double d[3], int x, int y, const img *im, const ilf_frame *f)
{
    const double lon = pi - (x + .5) * 2 * pi / im->info.width,
                 lat = pi / 2 - (y + .5) * pi / im->info.height;

    (void)f;
    d[0] = cos(lat) * sin(lon), d[1] = -cos(lat) * cos(lon), d[2] = sin(lat);
}

/* The probes as a file for the time of the look. */
static int dome_picture(const char *path, const analysis *a, const viewpoint *v, const char *line, errmsg *e)
{
    const img_write_opts how = {.type = IMG_FLOAT, .compression = "zip", .comment = line};
    const int rows = look_rows(&a->f);
    outfile *probes;
    ilf *residual = NULL;
    ilf_error err;
    img im = {0};

    if (out_begin(&probes, path, e)) return -1;
    int bad = lf_write(&a->f, out_path(probes), line, e) || img_alloc(&im, 2 * rows, rows, 3, e);
    if (!bad && ilf_open(&residual, out_path(probes), &err) != ILF_OK) bad = err_set(e, "%s", err.text);
    if (!bad) bad = look_round(&im, residual, a, v, dome_dir, e);
    ilf_close(residual);
    out_abort(probes);
    if (!bad) bad = img_write(&im, path, &how, e);
    img_free(&im);
    return bad ? -1 : 0;
}

static void dome(FILE *o, const char *picture, const viewpoint *v)
{
    const char *slash = strrchr(picture, '/');

    fprintf(o,
            "\n        def DomeLight \"residual\" (\n            doc = \"what is left without the lamps, as "
            "it is at "
            "(%.6g, %.6g, %.6g)\"\n        )\n        {\n",
            v->at[0], v->at[1], v->at[2]);
    fprintf(o, "            color3f inputs:color = (1, 1, 1)\n            float inputs:intensity = 1\n");
    fprintf(o, "            float inputs:exposure = 0\n            bool inputs:normalize = 0\n");
    fprintf(o, "            asset inputs:texture:file = @./%s@\n", slash ? slash + 1 : picture);
    fprintf(o, "            token inputs:texture:format = \"latlong\"\n");
    fprintf(o, "            float xformOp:rotateX = 90\n            uniform token[] xformOpOrder = "
               "[\"xformOp:rotateX\"]\n");
    fprintf(o, "        }\n");
}

/* ---- surroundings ------------------------------------------------------------------------------------- */

enum { AROUND = 96, RINGS = 24 };

/* Node k of the mesh: 0 is straight up, then rings of AROUND down to the horizon. */
static void node(double x[3], const analysis *a, int k)
{
    const int ring = k ? (k - 1) / AROUND + 1 : 0, at = k ? (k - 1) % AROUND : 0;
    const double p = .9999 * pi / 2 * ring / RINGS, t = 2 * pi * at / AROUND;
    const double d[3] = {sin(p) * cos(t), sin(p) * sin(t), cos(p)};
    double q[3];

    surroundings_meet(q, &a->around, a->around.centre, d);
    look_to_scene(x, &a->f.frame, q, 1);
}

static void box_corner(double x[3], const analysis *a, int k)
{
    const double *b = a->around.box, p[3] = {b[k & 1], b[2 + (k >> 1 & 1)], k >> 2 ? b[4] : 0};

    look_to_scene(x, &a->f.frame, p, 1);
}

static void points(FILE *o, void at(double x[3], const analysis *a, int k), const analysis *a, int n)
{
    double low[3] = {1e300, 1e300, 1e300}, high[3] = {-1e300, -1e300, -1e300}, x[3];

    fprintf(o, "        point3f[] points = [");
    for (int k = 0; k < n; k++) {
        at(x, a, k);
        fprintf(o, "%s(%.7g, %.7g, %.7g)", k ? ", " : "", x[0], x[1], x[2]);
        for (int c = 0; c < 3; c++) low[c] = fmin(low[c], x[c]), high[c] = fmax(high[c], x[c]);
    }
    fprintf(o, "]\n        float3[] extent = [(%.7g, %.7g, %.7g), (%.7g, %.7g, %.7g)]\n", low[0], low[1],
            low[2], high[0], high[1], high[2]);
}

static void box_faces(FILE *o)
{
    fprintf(
        o,
        "        int[] faceVertexCounts = [4, 4, 4, 4, 4]\n"
        "        int[] faceVertexIndices = [0, 1, 5, 4, 1, 3, 7, 5, 3, 2, 6, 7, 2, 0, 4, 6, 4, 5, 7, 6]\n");
}

static void ring_faces(FILE *o)
{
    fprintf(o, "        int[] faceVertexCounts = [");
    for (int k = 0; k < AROUND * RINGS; k++) fprintf(o, "%s%d", k ? "," : "", k < AROUND ? 3 : 4);
    fprintf(o, "]\n        int[] faceVertexIndices = [");
    for (int k = 0; k < AROUND * RINGS; k++) {
        const int next = (k + 1) % AROUND + k / AROUND * AROUND; /* beside it in the ring */
        if (k < AROUND) fprintf(o, "%s0,%d,%d", k ? "," : "", 1 + k, 1 + next);
        else fprintf(o, ",%d,%d,%d,%d", 1 + k - AROUND, 1 + k, 1 + next, 1 + next - AROUND);
    }
    fprintf(o, "]\n");
}

static void mesh(FILE *o, const analysis *a)
{
    const int boxed = !a->around.measured;

    fprintf(o, "\n    def Mesh \"surroundings\" (\n        doc = \"where the walls are, %s\"\n    )\n    {\n",
            boxed ? "a box estimated from the probes" : "as they were given");
    fprintf(o,
            "        uniform token purpose = \"guide\"\n        uniform token subdivisionScheme = \"none\"\n"
            "        uniform bool doubleSided = 1\n");
    if (boxed) box_faces(o);
    else ring_faces(o);
    points(o, boxed ? box_corner : node, a, boxed ? 8 : 1 + AROUND * RINGS);
    fprintf(o, "    }\n");
}

/* ---- all of it ------------------------------------------------------------------------------------------ */

static int keeps(const ilf_mask *m, const ilf_luminaire *l)
{
    (void)m, (void)l;
    return 0;
}

static void head(FILE *o, const viewpoint *v, const char *line)
{
    fprintf(o, "#usda 1.0\n(\n    defaultPrim = \"light_field\"\n    doc = ");
    quoted(o, line);
    fprintf(o, "\n    metersPerUnit = %.9g\n    upAxis = \"Z\"\n)\n\n", v->metres > 0 ? v->metres : 1);
    fprintf(o, "# intensity x color is radiance, W/sr/m^2 for each of R, G, B;\n"
               "# cd/m^2 (nits) is 179 (.265 R + .670 G + .065 B)\n\n");
    fprintf(o, "def Xform \"light_field\"\n{\n    def Scope \"lights\"\n    {");
}

static void fill(FILE *o, const char *picture, const analysis *a, const viewpoint *v, const char *line)
{
    double eye[3];
    int number = 0;

    look_from_middle(eye, &a->f);
    head(o, v, line);
    for (int i = 0; i < a->n; i++)
        if (a->lamps[i].fate == TAKEN) one_lamp(o, &a->lamps[i], ++number, &a->f.frame, eye);
    dome(o, picture, v);
    fprintf(o, "    }\n");
    if (a->around.far) mesh(o, a);
    fprintf(o, "}\n");
}

static void say(const char *path, const analysis *a, const viewpoint *v)
{
    char what[1024] = "";
    int number = 0;

    for (int i = 0; i < a->n; i++)
        if (a->lamps[i].fate == TAKEN)
            export_left_out(what, sizeof what, ++number, &a->lamps[i].l.s.l, keeps);
    if (what[0]) remark(path, "left out, as USD's lights have nothing like it: %s", what);
    if (!(v->metres > 0)) remark(path, "the scene's unit is taken for a metre (--metres says what it is)");
}

int exportusd_write(const char *path, const analysis *a, const viewpoint *v, const char *line, errmsg *e)
{
    char picture[4096];
    outfile *out;

    (void)!snprintf(picture, sizeof picture, "%.*s.dome.exr", (int)(strlen(path) - strlen(".usda")), path);
    if (out_begin(&out, path, e)) return -1;
    fill(out_stream(out), picture, a, v, line);
    if (dome_picture(picture, a, v, line, e)) {
        out_abort(out);
        return -1;
    }
    if (out_commit(out, e)) return -1;
    say(path, a, v);
    return 0;
}
