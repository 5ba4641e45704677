/*
 * spherearray.c - the job of turning a photograph of mirror spheres into a light field.
 *
 * Every sphere is a lens of its own (lens.h) at its own place in the picture, turned so that +u is
 * where the grid's first direction runs (paper, section 4.1).
 */
#include "spherearray.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/outfile.h"
#include "cputime.h"
#include "filter.h"
#include "ilf.h"
#include "image/image.h"
#include "input.h"
#include "overlay.h"
#include "placing.h"
#include "remap.h"
#include "result.h"
#include "slope.h"
#include "spherefind.h"
#include "spherepose.h"

#define DEG (M_PI / 180)

/* A light field, or a picture? */
static int is_field(const char *path)
{
    size_t n = strlen(path);
    return n >= 8 && strcmp(path + n - 8, ".ilf.exr") == 0;
}

/* The window of the picture around a sphere, as a picture of its own. */
static int cut_window(float **pix, int box[4], const img *im, const sphere_seen *q, errmsg *e)
{
    double r = q->r + 2;
    box[0] = (int)fmax(floor(q->x - r), 0), box[1] = (int)fmax(floor(q->y - r), 0);
    box[2] = (int)fmin(ceil(q->x + r), im->info.width), box[3] = (int)fmin(ceil(q->y + r), im->info.height);
    if (box[2] <= box[0] || box[3] <= box[1])
        return err_set(e, "expected the sphere at %.1f,%.1f radius %.1f to lie in the picture (%d x %d)",
                       q->x, q->y, q->r, im->info.width, im->info.height);
    size_t w = (size_t)(box[2] - box[0]), h = (size_t)(box[3] - box[1]);
    float *p = malloc(w * h * 4 * sizeof(float));
    if (!p) return err_set(e, "out of memory");
    for (size_t y = 0; y < h; y++)
        memcpy(p + y * w * 4, im->pix + (((size_t)box[1] + y) * (size_t)im->info.width + (size_t)box[0]) * 4,
               w * 4 * sizeof(float));
    *pix = p;
    return 0;
}

/* What one sphere's remap adds to the outcome. */
typedef struct tally {
    int64_t bad;
    double covered, prepare_s, remap_s;
} tally;

typedef struct sphere_source {
    const chart *src;
    const remap_source *ready;
} sphere_source;

static int sphere_areas(float *rgb, float *alpha, const chart *dst, void *arg, errmsg *e)
{
    const sphere_source *q = arg;
    return remap_run(rgb, alpha, dst, q->src, q->ready, e);
}

static int one_sphere(float *rgb, float *alpha, tally *o, const settings *s, const img *im,
                      const sphere_seen *q, double (*frame)[3], double turn, double polar_max, errmsg *e)
{
    float *pix = NULL;
    int box[4];
    chart src, dst;
    lens l;
    remap_source ready;
    int all_good = 0;
    double d = s->camera_distance > 0 ? 2 * s->camera_distance / s->diameter : 0;
    if (lens_sphere(&l, d, e) || cut_window(&pix, box, im, q, e)) return -1;
    chart_disc(&src, box[2] - box[0], box[3] - box[1], &l, q->x - box[0], q->y - box[1], q->r, 1, turn,
               s->tilt_deg * DEG, s->tilt_to_deg * DEG);
    if (frame) memcpy(src.frame, frame, sizeof src.frame);
    hide_camera(pix, &all_good, &src, s->hide_camera_deg * DEG);
    chart_probe(&dst, s->out_w, s->out_h, polar_max);
    double (*now)(void) =
        s->nu > 1 ? cpu_thread_seconds : cpu_seconds; /* spheres side by side, or one by all threads */
    double t0 = now();
    int rc = source_clean(&ready, pix, src.width, src.height, all_good, &src, e);
    double t1 = now();
    if (rc) {
        free(pix);
        return -1;
    }
    sphere_source sphere = {&src, &ready};
    rc = filter_texels(rgb, alpha, &dst, s->filter_sd, sphere_areas, &sphere, e);
    *o = (tally){ready.nbad, 0, t1 - t0, now() - t1};
    source_free(&ready);
    free(pix);
    size_t n = (size_t)s->out_w * (size_t)s->out_h;
    for (size_t i = 0; i < 3 * n; i++) rgb[i] = (float)(rgb[i] / s->reflectance[i % 3]);
    for (size_t i = 0; i < n; i++) o->covered += (double)alpha[i] / (double)n;
    if (is_field(s->out) || s->outside == OUTSIDE_HOLD)
        outside_fill(rgb, alpha, s->out_w, s->out_h, OUTSIDE_HOLD);
    return rc;
}

/* One row of the grid, its spheres in parallel: probes side by side in rgb. */
static int row_of_spheres(float *rgb, float *alpha, outcome *o, const settings *s, const img *im,
                          const sphere_grid *g, const sphere_seen *q, const sphere_pose *pose, int j,
                          double polar_max, errmsg *e)
{
    size_t n = (size_t)s->out_w * (size_t)s->out_h;
    int failed = 0, nu = s->nu;
    double covered = 0, prepare_s = 0, remap_s = 0;
    int64_t bad = 0;
#pragma omp parallel for schedule(dynamic) reduction(+ : covered, prepare_s, remap_s, bad) if (nu > 1)
    for (int i = 0; i < nu; i++) {
        double u_angle, frame[3][3];
        errmsg mine;
        tally t = {0};
        sphere_grid_at(&u_angle, g, i, j);
        if (pose) sphere_pose_frame(frame, pose, i, j);
        size_t at = (size_t)i * n;
        if (one_sphere(rgb + 3 * at, alpha + at, &t, s, im, q + i + (size_t)j * (size_t)nu,
                       pose ? frame : NULL, -u_angle, polar_max, &mine)) {
#pragma omp critical
            {
                failed = 1;
                *e = mine;
            }
        }
        covered += t.covered, prepare_s += t.prepare_s, remap_s += t.remap_s, bad += t.bad;
    }
    o->covered += covered / ((double)nu * s->nv);
    o->cpu_prepare_s += prepare_s, o->cpu_remap_s += remap_s, o->bad_pixels += bad;
    return failed ? -1 : 0;
}

static void default_plane(double p[9], int nu, int nv)
{
    double q[9] = {0, 0, 0, nu > 1 ? nu - 1 : 1, 0, 0, 0, nv > 1 ? nv - 1 : 1, 0};
    memcpy(p, q, sizeof q);
}

static int ilf_words(const ilf_error *ie, const char *out, errmsg *e)
{
    return err_set(e, "%s: %s", out, ie->text);
}

static int write_field(outcome *o, const settings *s, const img *im, const sphere_grid *g,
                       const sphere_seen *q, const sphere_pose *pose, double polar_max, double valid,
                       errmsg *e)
{
    size_t n = (size_t)s->out_w * (size_t)s->out_h, all = n * (size_t)s->nu;
    float *rgb = malloc(all * 3 * sizeof(float)), *alpha = malloc(all * sizeof(float));
    outfile *out = NULL;
    ilf_writer *w = NULL;
    ilf_error ie;
    chart dst;
    int rc = -1;
    chart_probe(&dst, s->out_w, s->out_h, polar_max);
    if (!rgb || !alpha) {
        err_set(e, "out of memory");
        goto done;
    }
    if (!is_field(s->out)) { /* one sphere, as a plain probe */
        rc = row_of_spheres(rgb, alpha, o, s, im, g, q, pose, 0, polar_max, e) ||
                     result_write(s, rgb, alpha, o->covered < 1, NULL, &dst, e)
                 ? -1
                 : 0;
        goto done;
    }
    ilf_spec spec = {.n_u = s->nu,
                     .n_v = s->nv,
                     .n_theta = s->out_w,
                     .n_phi = s->out_h,
                     .polar_max = polar_max,
                     .polar_valid = valid < polar_max ? valid : 0,
                     .type = s->half_float == 1 ? ILF_HALF : ILF_FLOAT,
                     .compression = s->compression ? s->compression : "zip",
                     .comments = s->command};
    double plane[9];
    if (s->have_plane) memcpy(plane, s->plane, sizeof plane);
    else default_plane(plane, s->nu, s->nv);
    memcpy(spec.origin, plane, sizeof spec.origin);
    memcpy(spec.U, plane + 3, sizeof spec.U);
    memcpy(spec.V, plane + 6, sizeof spec.V);
    if (out_begin(&out, s->out, e)) goto done;
    if (ilf_writer_open(&w, out_path(out), &spec, &ie)) {
        ilf_words(&ie, s->out, e);
        goto done;
    }
    for (int j = 0; j < s->nv; j++) {
        if (row_of_spheres(rgb, alpha, o, s, im, g, q, pose, j, polar_max, e)) goto done;
        for (int i = 0; i < s->nu; i++)
            if (ilf_writer_probe(w, rgb + 3 * (size_t)i * n, &ie)) {
                ilf_words(&ie, s->out, e);
                goto done;
            }
        if (s->progress) s->progress("rows of spheres", j + 1, s->nv);
    }
    ilf_status st = ilf_writer_close(w, &ie);
    w = NULL;
    if (st) {
        ilf_words(&ie, s->out, e);
        goto done;
    }
    rc = out_commit(out, e);
    out = NULL;
done:
    ilf_writer_abort(w);
    out_abort(out);
    free(rgb);
    free(alpha);
    return rc;
}

/* Where the spheres are: corners given or found, then every rim. */
static int locate(sphere_seen *q, sphere_grid *g, outcome *o, const settings *s, const img *im, errmsg *e)
{
    sphere_seen corner[4];
    sphere_fit fit;
    double rotate = s->rotate_deg * DEG;
    int w = im->info.width, h = im->info.height, total = s->nu * s->nv;
    for (int k = 0; k < 4; k++) corner[k] = s->corner[s->ncorners == 1 ? 0 : k];
    if (s->corners_auto && sphere_find_corners(corner, im->pix, w, h, s->nu, s->nv, rotate, e)) return -1;
    if (sphere_grid_init(g, s->nu, s->nv, corner, rotate, e)) return -1;
    for (int k = 0; k < total; k++) q[k] = sphere_grid_at(NULL, g, k % s->nu, k / s->nu);
    if (total == 1) return 0; /* one sphere is where it is said, or was found, to be */
    /* found corners are off by a cell of the search and by what perspective bends the lattice; given ones by
     * a hand's 3 pixels in x and y */
    double reach = s->corners_auto ? fmax(0.15 * corner[0].r, 3) : fmax(0.06 * corner[0].r, 5);
    o->spheres_from = "corners";
    if (s->nu == 1 || s->nv == 1) {
        snprintf(o->remark, sizeof o->remark,
                 "a single row: the spheres, pitch and radius are those of the corners %s",
                 s->corners_auto ? "found" : "given");
        return 0;
    }
    const sphere_grid given = *g;
    int rc = sphere_refine(q, &fit, g, corner, rotate, reach, im->pix, w, h, e);
    if (rc < 0) return -1;
    /* a grid that the spheres' own rims don't confirm was drawn to something else: by hand it was nearer */
    if (rc == 0 && (s->corners_auto ? 4 * fit.seen < total : 2 * fit.seen <= total)) rc = 1;
    if (rc > 0 && s->corners_auto)
        return err_set(e,
                       "expected rims around what repeats itself like an array of %d x %d spheres, found "
                       "none that stand out; give --corners",
                       s->nu, s->nv);
    if (rc > 0) {
        *g = given;
        for (int k = 0; k < total; k++) q[k] = sphere_grid_at(NULL, g, k % s->nu, k / s->nu);
        snprintf(
            o->remark, sizeof o->remark,
            "no rims to be seen near the corners: spheres, pitch and tilt are those of the corners as given");
        return 0;
    }
    if (s->corners_auto && sphere_check(g, im->pix, w, h, e)) return -1;
    o->spheres_from = "rims", o->rims_seen = fit.seen, o->rims_rms = fit.rms;
    snprintf(o->remark, sizeof o->remark,
             "rims of %d of %d spheres within a pixel of the grid, %.2f pixels rms", fit.seen, total,
             fit.rms);
    return 0;
}

int job_array(outcome *o, const settings *s, errmsg *e)
{
    img im;
    sphere_grid g;
    double polar_max = (s->polar_max_deg > 0 ? s->polar_max_deg : 90) * DEG, valid = polar_max;
    int total = s->nu * s->nv, rc = -1;
    if (total > 1 && !is_field(s->out))
        return err_set(e, "%s: expected an output that ends in .ilf.exr for %d spheres", s->out, total);
    int all_good;
    if (input_load(&im, &all_good, s, e)) return -1;
    sphere_seen *q = malloc(sizeof *q * (size_t)total);
    if (!q) {
        err_set(e, "out of memory");
        goto done;
    }
    if (locate(q, &g, o, s, &im, e)) goto done;
    if (s->overlay && overlay_write(s->overlay, &im, q, total, e)) goto done;
    o->spheres = q, o->nspheres = total;
    if (total > 1) {
        o->pitch = sphere_grid_pitch(&g);
        valid = sphere_free_cone(fmax(o->pitch, 1));
    }
    o->polar_valid_deg = fmin(valid, polar_max) / DEG;
    sphere_pose pose;
    int posed = total > 1 && s->nu > 1 && s->nv > 1 && s->camera_distance > 0;
    if (posed) {
        double px = s->have_centre ? s->centre[0] : im.info.width / 2.,
               py = s->have_centre ? s->centre[1] : im.info.height / 2.;
        if (sphere_pose_find(&pose, &g, s->camera_distance / s->diameter / o->pitch, px, py, e)) goto done;
        o->tilt_deg = pose.tilt / DEG;
    }
    rc = write_field(o, s, &im, &g, q, posed ? &pose : NULL, polar_max, valid, e);
done:
    if (rc) {
        free(q);
        o->spheres = NULL;
    }
    img_free(&im);
    return rc;
}
