/*
 * calibration.c - OpenCV's, gyroflow's, ROS's and Kalibr's calibrations (calibration.h).
 *
 * What they call a model is, for a direction at angle t from the axis, a radius r before the camera matrix:
 *
 *   fisheye, equidistant  t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)                (cv::fisheye)
 *   pinhole               u (1 + k1 u^2 + k2 u^4 + k3 u^6) / (1 + k4 u^2 + k5 u^4 + k6 u^6),  u = tan t
 *                                                                                  (cv::calibrateCamera)
 *   fov                   atan(2 tan t tan(w/2)) / w                               (Devernay & Faugeras 2001)
 *   omni                  u = sin t / (cos t + xi), then as pinhole                (Mei & Rives 2007)
 *   eucm                  sin t / (a sqrt(b sin^2 t + cos^2 t) + (1 - a) cos t)    (Khomutenko et al. 2016)
 *   ds                    sin t / (a sqrt(sin^2 t + (xi + cos t)^2) + (1 - a) (xi + cos t))
 *                                                                                  (Usenko et al. 2018)
 *
 * Tangential terms (p1, p2) are not radial: lens.tangential keeps what they may move, for lensfile.c to
 * judge.
 */
#include "calibration.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "vision/tree.h"

#define DEG (M_PI / 180)

typedef enum radial_kind { R_KB, R_PINHOLE, R_FOV, R_OMNI, R_EUCM, R_DS } radial_kind;

typedef struct radial {
    radial_kind kind;
    double k[8], a, b, xi;
} radial;

static double radius_at(const radial *m, double t)
{
    const double s = sin(t), c = cos(t), *k = m->k;
    double u = tan(t);
    switch (m->kind) {
    case R_FOV: return t < M_PI / 2 ? atan(2 * u * tan(m->a / 2)) / m->a : NAN;
    case R_EUCM: {
        double d = m->a * sqrt(m->b * s * s + c * c) + (1 - m->a) * c;
        return d > 0 ? s / d : NAN;
    }
    case R_DS: {
        double z = m->xi + c, d = m->a * sqrt(s * s + z * z) + (1 - m->a) * z;
        return d > 0 ? s / d : NAN;
    }
    case R_OMNI: u = c + m->xi > 0 ? s / (c + m->xi) : NAN; break;
    default:
        if (t >= M_PI / 2) return NAN;
    }
    double q = u * u, den = 1 + q * (k[3] + q * (k[4] + q * k[5]));
    return den > 0 ? u * (1 + q * (k[0] + q * (k[1] + q * k[2]))) / den : NAN;
}

/* The radial model as a table, as far as it grows; up to 89.9 degrees where the tangent has no bound. */
static int fill_table(lens *l, const radial *m, const char *name, errmsg *e)
{
    enum { STEPS = 8192 };
    const double most = m->kind == R_PINHOLE || m->kind == R_FOV ? 89.9 * DEG : M_PI * (1 - 1e-6);
    double last = 0, end = 0;
    for (int i = 1; i <= STEPS; i++) {
        double t = most * i / STEPS, r = radius_at(m, t);
        if (!(r > last * (1 + 1e-12)) || r > 1e6) break;
        last = r, end = t;
    }
    if (!(end > 0.01)) return err_set(e, "%s: expected a radius that grows with the angle, found none", name);
    l->kind = LENS_TABLE;
    l->ntable = LENS_MAX_TABLE;
    for (int i = 0; i < LENS_MAX_TABLE; i++) {
        /* where tan grows steeply, steps of equal radius would miss the middle and of equal angle the end:
         * both alike */
        double x = (double)i / (LENS_MAX_TABLE - 1);
        l->tab_t[i] = end * (m->kind == R_PINHOLE || m->kind == R_FOV ? sin(x * M_PI / 2) : x);
        l->tab_r[i] = i ? radius_at(m, l->tab_t[i]) : 0;
    }
    return 0;
}

/* ---- finding things in the tree ---------------------------------------------------------------------- */

typedef struct source {
    const vision_tree *t;
    const char *name; /* of the file */
    char at[128];     /* path of the camera with its '.', or "" */
} source;

static const double *numbers(const source *s, const char *key, int *n)
{
    char path[256];
    snprintf(path, sizeof path, "%s%s", s->at, key);
    const double *v = vision_tree_numbers(s->t, path, n);
    if (v) return v;
    snprintf(path, sizeof path, "%s%s.data", s->at, key);
    return vision_tree_numbers(s->t, path, n);
}

static const double *any_numbers(const source *s, const char *const *keys, int *n)
{
    for (; *keys; keys++) {
        const double *v = numbers(s, *keys, n);
        if (v) return v;
    }
    *n = 0;
    return NULL;
}

static const char *words(const source *s, const char *key)
{
    char path[256];
    snprintf(path, sizeof path, "%s%s", s->at, key);
    const char *w = vision_tree_words(s->t, path);
    return w && *w ? w : NULL;
}

static double number(const source *s, const char *key)
{
    int n;
    const double *v = numbers(s, key, &n);
    return v && n == 1 ? *v : 0;
}

static const char *const matrix_keys[] = {"camera_matrix",
                                          "Camera_Matrix",
                                          "cameraMatrix",
                                          "CameraMatrix",
                                          "camera_matrix_left",
                                          "intrinsic_matrix",
                                          "K",
                                          NULL};
static const char *const dist_keys[] = {"distortion_coefficients",
                                        "Distortion_Coefficients",
                                        "distortion_coeffs",
                                        "dist_coeffs",
                                        "dist_coefs",
                                        "distCoeffs",
                                        "DistCoeffs",
                                        "distortion",
                                        "D",
                                        NULL};

/* Where the camera is: the path before a key that only a camera has.  Several cameras need a name. */
static int find_camera(source *s, const char *camera, int which, errmsg *e)
{
    char list[256] = "", second[sizeof s->at] = "";
    int found = 0, length;
    if (!camera && vision_tree_numbers(s->t, "fisheye_params.camera_matrix",
                                       &length)) { /* gyroflow: others are for other zooms */
        strcpy(s->at, "fisheye_params.");
        return 0;
    }
    for (int k = 0; k < vision_tree_count(s->t); k++) {
        const char *p = vision_tree_path(s->t, k);
        char path[128];
        if (strlen(p) >= sizeof path) continue;
        strcpy(path, p);
        size_t n = strlen(path);
        if (n > 5 && strcmp(path + n - 5, ".data") == 0) path[n - 5] = 0;
        char *dot = strrchr(path, '.'), *key = dot ? dot + 1 : path;
        int is = strcmp(key, "intrinsics") == 0;
        for (const char *const *q = matrix_keys; *q; q++) is |= strcmp(key, *q) == 0;
        if (!is || !vision_tree_numbers(s->t, p, &length)) continue;
        size_t before = dot ? (size_t)(dot + 1 - path) : 0;
        if (camera && (before < 1 || strlen(camera) != before - 1 || strncmp(path, camera, before - 1) != 0))
            continue;
        if (strncmp(s->at, path, before) == 0 && strlen(s->at) == before && found) continue;
        if (found > 1 && strncmp(second, path, before) == 0 && strlen(second) == before) continue;
        snprintf(found ? second : s->at, sizeof second, "%.*s", (int)before, path);
        found++;
        if (strlen(list) + before + 4 < sizeof list)
            snprintf(list + strlen(list), sizeof list - strlen(list), "%s%.*s", *list ? ", " : "",
                     before ? (int)before - 1 : 0, path);
    }
    if (found == 0)
        return err_set(e, "%s: expected a camera matrix or intrinsics%s%s, found none", s->name,
                       camera ? " of " : "", camera ? camera : "");
    if (found == 2 && which) {
        if (which == 2) strcpy(s->at, second);
        return 0;
    }
    if (found > 1)
        return err_set(e, "%s: expected one camera, found %s; name it as %s@NAME", s->name, list, s->name);
    return 0;
}

static int finite_all(const double *v, int n)
{
    for (int k = 0; k < n; k++)
        if (!isfinite(v[k])) return 0;
    return 1;
}

static int set_camera(lens *l, const source *s, double fx, double fy, double cx, double cy, double skew,
                      errmsg *e)
{
    if (!(fx > 0 && fy > 0 && fx < 1e9 && fy < 1e9) || !(fabs(cx) < 1e9 && fabs(cy) < 1e9) ||
        !(fabs(skew) < fx))
        return err_set(e, "%s: expected a camera matrix fx, fy, cx, cy in pixels, found %g, %g, %g, %g",
                       s->name, fx, fy, cx, cy);
    lens_camera(l, fx, fy, cx, cy, skew);
    return 0;
}

static int read_size(lens *l, const source *s, errmsg *e)
{
    static const char *const keys[] = {"resolution",      "image_size", "imageSize", "img_size",
                                       "calib_dimension", "size",       NULL};
    static const char *const across[] = {"image_width",       "image_Width", "Image_Width",
                                         "calib_dimension.w", "width",       NULL};
    static const char *const down[] = {"image_height",      "image_Height", "Image_Height",
                                       "calib_dimension.h", "height",       NULL};
    int n;
    const double *v = any_numbers(s, keys, &n);
    double w = v && n == 2 ? v[0] : 0, h = v && n == 2 ? v[1] : 0;
    for (int k = 0; !(w > 0) && across[k]; k++) w = number(s, across[k]), h = number(s, down[k]);
    if (w == 0 && h == 0) return 0;
    if (!(w >= 1 && h >= 1 && w < 1e6 && h < 1e6))
        return err_set(e, "%s: expected the picture's width and height, found %g and %g", s->name, w, h);
    l->size_px[0] = w, l->size_px[1] = h;
    return 0;
}

/* ---- models ------------------------------------------------------------------------------------------- */

static int set_kb(lens *l, const double *k, int n)
{
    memset(l->coef, 0, sizeof l->coef);
    l->kind = LENS_POLYNOMIAL;
    l->ncoef = 9;
    l->coef[0] = 1;
    for (int i = 0; i < n && i < 4; i++) l->coef[2 * i + 2] = k[i];
    return 0;
}

/* k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty; m gets the radial ones. */
static int set_radtan(lens *l, radial *m, const source *s, const double *k, int n, errmsg *e)
{
    for (int i = 8; i < n; i++)
        if (k[i] != 0)
            return err_set(e, "%s: expected no thin-prism or tilt terms, which are not radial, found %g",
                           s->name, k[i]);
    m->k[0] = n > 0 ? k[0] : 0, m->k[1] = n > 1 ? k[1] : 0, m->k[2] = n > 4 ? k[4] : 0;
    for (int i = 5; i < 8; i++) m->k[i - 2] = n > i ? k[i] : 0;
    l->tangential = n > 3 ? hypot(k[2], k[3]) : 0;
    return 0;
}

static int is_any(const char *w, const char *const *list)
{
    for (; w && *list; list++)
        if (strcasecmp(w, *list) == 0) return 1;
    return 0;
}

static const char *const fisheyes[] = {"fisheye",        "equidistant",     "equi",
                                       "kannala_brandt", "kannala_brandt4", "kb4",
                                       "KannalaBrandt8", "opencv_fisheye",  NULL};
static const char *const pinholes[] = {
    "plumb_bob", "radtan",        "rational_polynomial", "pinhole",         "perspective", "opencv",
    "brown",     "brown_conrady", "radial-tangential",   "opencv_standard", NULL};

static int read_kalibr(lens *l, const source *s, const double *q, int n, errmsg *e)
{
    const char *model = words(s, "camera_model"), *dist = words(s, "distortion_model");
    int nd;
    const double *k = any_numbers(s, dist_keys, &nd);
    radial m = {.kind = R_PINHOLE};
    if (!model || !dist)
        return err_set(e, "%s: expected camera_model and distortion_model beside intrinsics, found %s",
                       s->name, model ? "no distortion_model" : "no camera_model");
    static const struct {
        const char *name;
        int n;
        radial_kind kind;
    } models[] = {{"pinhole", 4, R_PINHOLE}, {"omni", 5, R_OMNI}, {"eucm", 6, R_EUCM}, {"ds", 6, R_DS}};
    int which = -1;
    for (int i = 0; i < 4; i++)
        if (strcmp(model, models[i].name) == 0) which = i;
    if (which < 0)
        return err_set(e, "%s: expected the camera model pinhole, omni, eucm or ds, found %s", s->name,
                       model);
    if (n != models[which].n || !finite_all(q, n))
        return err_set(e, "%s: expected %d finite intrinsics of %s, found %d", s->name, models[which].n,
                       model, n);
    m.kind = models[which].kind;
    if (which == 1) m.xi = q[0];
    if (which == 2) m.a = q[0], m.b = q[1];
    if (which == 3) m.xi = q[0], m.a = q[1];
    q += models[which].n - 4;
    if (set_camera(l, s, q[0], q[1], q[2], q[3], 0, e) || read_size(l, s, e)) return -1;
    if (nd && !finite_all(k, nd)) return err_set(e, "%s: expected finite distortion coefficients", s->name);
    if (strcmp(dist, "none") == 0) return fill_table(l, &m, s->name, e);
    if ((strcmp(dist, "radtan") == 0 || strcmp(dist, "radial-tangential") == 0) && nd == 4 && which < 2)
        return set_radtan(l, &m, s, k, nd, e) ? -1 : fill_table(l, &m, s->name, e);
    if (strcmp(dist, "equidistant") == 0 && nd == 4 && which == 0) return set_kb(l, k, nd);
    if (strcmp(dist, "fov") == 0 && nd == 1 && which == 0 && k[0] > 1e-6 && k[0] < M_PI) {
        m.kind = R_FOV, m.a = k[0];
        return fill_table(l, &m, s->name, e);
    }
    return err_set(e,
                   "%s: expected distortion none, radtan, equidistant or fov as Kalibr has them with %s, "
                   "found %s with %d coefficients",
                   s->name, model, dist, nd);
}

/* What a gyroflow profile says beyond the camera: pictures are stretched or warped before it. */
static int check_gyroflow(const source *top, errmsg *e)
{
    const char *lens_name = words(top, "digital_lens"), *model = words(top, "distortion_model");
    double sx = number(top, "input_horizontal_stretch"), sy = number(top, "input_vertical_stretch");
    if (lens_name)
        return err_set(e, "%s: expected a lens alone, found the digital lens %s after it", top->name,
                       lens_name);
    if (model && !is_any(model, fisheyes))
        return err_set(e, "%s: expected the distortion model opencv_fisheye, found %s", top->name, model);
    if (number(top, "is_superview") != 0)
        return err_set(e, "%s: expected a lens alone, found superview's stretching after it", top->name);
    if (number(top, "distortion_model_id") != 0 || number(top, "use_opencv_standard") != 0)
        return err_set(e, "%s: expected the distortion model opencv_fisheye, found another", top->name);
    if ((sx != 0 && sx != 1) || (sy != 0 && sy != 1))
        return err_set(e, "%s: expected a picture as the lens made it, found one to be stretched by %g x %g",
                       top->name, sx, sy);
    return 0;
}

static int read_matrix(lens *l, char said[256], source *s, const double *K, int n, errmsg *e)
{
    static const char *const model_keys[] = {"distortion_model", "camera_model", "model",
                                             "projection_model", "model_type",   NULL};
    int nd, gyroflow = strcmp(s->at, "fisheye_params.") == 0,
            fisheye = gyroflow || number(s, "fisheye_model") != 0 || number(s, "fisheye") != 0;
    const double *k = any_numbers(s, dist_keys, &nd);
    const char *model = NULL;
    if (n != 9 || !finite_all(K, 9) || K[3] != 0 || K[6] != 0 || K[7] != 0 || fabs(K[8] - 1) > 1e-9)
        return err_set(
            e, "%s: expected a camera matrix [fx s cx; 0 fy cy; 0 0 1], found %d numbers that are none",
            s->name, n);
    if (!k || !finite_all(k, nd))
        return err_set(e, "%s: expected distortion coefficients beside the camera matrix, found none",
                       s->name);
    if (set_camera(l, s, K[0], K[4], K[2], K[5], K[1], e)) return -1;
    source top = {s->t, s->name, ""};
    if (read_size(l, gyroflow ? &top : s, e)) return -1;
    if (gyroflow && check_gyroflow(&top, e)) return -1;
    for (const char *const *q = model_keys; !model && *q; q++) model = words(s, *q);
    int pinhole = model && is_any(model, pinholes);
    if (model && is_any(model, fisheyes)) fisheye = 1, pinhole = 0;
    if (model && !pinhole && !fisheye)
        return err_set(e, "%s: expected a fisheye (equidistant) or pinhole model, found %s", s->name, model);
    if (pinhole && nd == 4 && !strcasecmp(model, "pinhole") && words(s, "distortion_model") == NULL)
        model = NULL, pinhole = 0;
    if (!fisheye && !pinhole) {
        if (nd == 4) {
            fisheye = 1;
            snprintf(said, 256,
                     "%s: four distortion coefficients and no model's name: taken as cv::fisheye's k1 to k4",
                     s->name);
        } else {
            pinhole = 1;
        }
    }
    if (fisheye) {
        if (nd != 4)
            return err_set(e, "%s: expected 4 distortion coefficients of a fisheye, found %d", s->name, nd);
        return set_kb(l, k, nd);
    }
    if (nd != 4 && nd != 5 && nd != 8 && nd != 12 && nd != 14)
        return err_set(e,
                       "%s: expected 4, 5, 8, 12 or 14 distortion coefficients of a pinhole camera, found %d",
                       s->name, nd);
    radial m = {.kind = R_PINHOLE};
    return set_radtan(l, &m, s, k, nd, e) ? -1 : fill_table(l, &m, s->name, e);
}

int calibration_is_tree(const char *text)
{
    if ((unsigned char)text[0] == 0xef) text += strspn(text, "\xef\xbb\xbf");
    while (isspace((unsigned char)*text)) text++;
    if (*text == '{' || *text == '<' || strncmp(text, "%YAML", 5) == 0 || strncmp(text, "---", 3) == 0)
        return 1;
    while (*text == '#' || isspace((unsigned char)*text)) text += *text == '#' ? strcspn(text, "\n") : 1;
    size_t n =
        strspn(text, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-"); /* YAML: "key:" */
    return n > 0 && text[n] == ':';
}

/* Kalibr's transform of a camera chain, a 4 x 4 matrix that takes points of the camera before to this one. */
static void read_rotation(lens *l, const source *s)
{
    int n;
    const double *t = numbers(s, "T_cn_cnm1", &n);
    for (int i = 0; t && n == 16 && i < 9; i++) l->from_first[i] = t[i / 3 * 4 + i % 3];
}

int calibration_tree(lens *l, char said[256], const char *text, const char *name, const char *camera,
                     int which, errmsg *e)
{
    vision_tree *t;
    if (vision_tree_read(&t, text, name, e)) return -1;
    source s = {t, name, ""};
    int n, rc = find_camera(&s, camera, which, e);
    if (!rc) {
        const double *q = numbers(&s, "intrinsics", &n);
        if (q) rc = read_kalibr(l, &s, q, n, e);
        else {
            q = any_numbers(&s, matrix_keys, &n);
            rc = read_matrix(l, said, &s, q, n, e);
        }
    }
    if (!rc) read_rotation(l, &s);
    vision_tree_free(t);
    return rc;
}
