/*
 * spherepose.c - camera position from the grid's homography (spherepose.h).
 *
 * H = K [r1 r2 t] up to scale, K = diag(f, -f, 1) about the principal point (y down in the
 * picture, up in the camera's frame).  From almost straight above, the focal length f does not show in
 * the angle between r1 and r2 (Zhang 2000 needs tilted views); it follows from the known distance instead.
 */
#include "spherepose.h"

#include <math.h>

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(double c[3], const double a[3], const double b[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static void unit(double a[3])
{
    double l = sqrt(dot(a, a));
    for (int k = 0; k < 3; k++) a[k] /= l;
}

/* Pose for focal length f; camera frame: x right, y up, z backwards (out of the scene).  The distance
 * from the camera to the grid's middle, pitches. */
static double pose_for(sphere_pose *p, const sphere_grid *g, double f, double cx, double cy)
{
    double c[3][3]; /* columns r1 r2 t, depth positive along -z */
    for (int k = 0; k < 3; k++) {
        double z = g->h[6 + k], x = (g->h[k] - cx * z) / f, y = -(g->h[3 + k] - cy * z) / f;
        c[k][0] = x, c[k][1] = y, c[k][2] = -z;
    }
    double l = 0.5 * (sqrt(dot(c[0], c[0])) + sqrt(dot(c[1], c[1])));
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++) c[k][i] /= l;
    /* nearest pair of perpendicular unit vectors: turn both by the same small angle */
    double r1[3], r2[3], r3[3], a[3], b[3];
    for (int i = 0; i < 3; i++) a[i] = c[0][i] + c[1][i], b[i] = c[0][i] - c[1][i];
    unit(a);
    double ab = dot(a, b);
    for (int i = 0; i < 3; i++) b[i] -= ab * a[i];
    unit(b);
    for (int i = 0; i < 3; i++) r1[i] = (a[i] + b[i]) * M_SQRT1_2, r2[i] = (a[i] - b[i]) * M_SQRT1_2;
    cross(r3, r1, r2);
    /* camera = -R^T t; rows of R^T are r1, r2, r3 */
    p->camera[0] = -dot(r1, c[2]), p->camera[1] = -dot(r2, c[2]), p->camera[2] = -dot(r3, c[2]);
    p->right[0] = r1[0], p->right[1] = r2[0], p->right[2] = r3[0];
    p->tilt = acos(fmin(fabs(r3[2]), 1));
    double mid[3] = {p->camera[0] - 0.5 * (g->n - 1), p->camera[1] - 0.5 * (g->m - 1), p->camera[2]};
    return sqrt(dot(mid, mid));
}

int sphere_pose_find(sphere_pose *p, const sphere_grid *g, double distance, double cx, double cy, errmsg *e)
{
    double step = hypot(g->h[0], g->h[3]), lo = 0.05 * step * distance, hi = 20 * step * distance;
    sphere_pose t;
    /* the distance grows with the focal length */
    for (int k = 0; k < 100; k++) {
        double f = sqrt(lo * hi);
        if (pose_for(&t, g, f, cx, cy) < distance) lo = f;
        else hi = f;
    }
    double got = pose_for(&t, g, sqrt(lo * hi), cx, cy);
    if (!(fabs(got - distance) < 1e-3 * distance) || !(t.camera[2] > 0) || t.tilt > 0.6)
        return err_set(
            e, "expected a camera at %.4g sphere pitches above the array, found none that sees the grid so",
            distance);
    *p = t;
    return 0;
}

void sphere_pose_frame(double frame[3][3], const sphere_pose *p, double s, double t)
{
    double *right = frame[0], *axis = frame[2];
    axis[0] = p->camera[0] - s, axis[1] = p->camera[1] - t, axis[2] = p->camera[2];
    unit(axis);
    double d = dot(p->right, axis);
    for (int k = 0; k < 3; k++) right[k] = p->right[k] - d * axis[k];
    unit(right);
    cross(frame[1], axis, right);
}
