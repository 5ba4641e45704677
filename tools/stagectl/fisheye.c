/*
 * fisheye.c - lens maps of the virtual camera and its place on the plane (pure arithmetic).
 *
 *      rho = r/R      equidistant   theta = rho h          stereographic  tan(theta/2) = rho tan(h/2)
 *      h = half fov   equisolid     sin(theta/2) = rho sin(h/2)   orthographic   sin(theta) = rho sin(h)
 */
#include "fisheye.h"

#include <math.h>
#include <string.h>

static const struct {
    const char *name;
    double max_fov_deg;
} lenses[] = {[LENS_EQUIDISTANT] = {"equidistant", 360},
              [LENS_EQUISOLID] = {"equisolid", 360},
              [LENS_STEREOGRAPHIC] = {"stereographic", 350},
              [LENS_ORTHOGRAPHIC] = {"orthographic", 180}};

int fisheye_make(fisheye *f, const char *lens, double fov_deg, int size, errmsg *e)
{
    size_t k = 0, n = sizeof lenses / sizeof lenses[0];
    while (k < n && strcmp(lens, lenses[k].name) != 0) k++;
    if (k == n)
        return err_set(e, "lens: expected equidistant, equisolid, stereographic or orthographic, found '%s'",
                       lens);
    if (!(fov_deg > 0 && fov_deg <= lenses[k].max_fov_deg))
        return err_set(e, "field of view: expected 0 < degrees <= %g for a %s lens, found %g",
                       lenses[k].max_fov_deg, lens, fov_deg);
    if (size < 2 || size > 8192) return err_set(e, "size: expected 2..8192 pixels, found %d", size);
    f->lens = (fisheye_lens)k;
    f->half_fov = fov_deg * M_PI / 360;
    f->size = size;
    return 0;
}

double fisheye_theta(const fisheye *f, double rho)
{
    double h = f->half_fov;
    switch (f->lens) {
    case LENS_EQUISOLID: return 2 * asin(fmin(1, rho * sin(h / 2)));
    case LENS_STEREOGRAPHIC: return 2 * atan(rho * tan(h / 2));
    case LENS_ORTHOGRAPHIC: return asin(fmin(1, rho * sin(h)));
    case LENS_EQUIDISTANT: break;
    }
    return rho * h;
}

int fisheye_direction(double d[3], double *theta_rad, const fisheye *f, const camera_frame *c, double x,
                      double y)
{
    double half = f->size / 2.0, px = (x - half) / half, py = (half - y) / half;
    double rho = hypot(px, py);
    if (rho > 1) return 0;
    double theta = fisheye_theta(f, rho), s = rho > 0 ? sin(theta) / rho : 0, k = cos(theta);
    for (int a = 0; a < 3; a++) d[a] = k * c->n[a] - s * px * c->u[a] + s * py * c->v[a];
    if (theta_rad) *theta_rad = theta;
    return 1;
}

static int frame_of(camera_frame *c, double len[2], const double plane[9], errmsg *e)
{
    const double *u = plane + 3, *v = plane + 6;
    for (int a = 0; a < 9; a++)
        if (!isfinite(plane[a])) return err_set(e, "plane: expected nine finite numbers");
    len[0] = hypot(hypot(u[0], u[1]), u[2]);
    len[1] = hypot(hypot(v[0], v[1]), v[2]);
    if (!(len[0] > 0 && len[1] > 0 && isfinite(len[0]) && isfinite(len[1])))
        return err_set(e, "plane: expected U and V longer than zero");
    double dot = 0;
    for (int a = 0; a < 3; a++) {
        c->u[a] = u[a] / len[0];
        c->v[a] = v[a] / len[1];
        dot += c->u[a] * c->v[a];
    }
    if (fabs(dot) > 1e-4) return err_set(e, "plane: expected U at right angles to V, found cosine %g", dot);
    for (int a = 0; a < 3; a++) {
        int b = (a + 1) % 3, g = (a + 2) % 3;
        c->n[a] = c->u[b] * c->v[g] - c->u[g] * c->v[b];
    }
    return 0;
}

int camera_at_point(camera_frame *c, const double plane[9], const double xy[2], errmsg *e)
{
    double len[2];
    if (frame_of(c, len, plane, e) != 0) return -1;
    for (int a = 0; a < 3; a++) c->pos[a] = plane[a] + xy[0] * c->u[a] + xy[1] * c->v[a];
    return 0;
}

int camera_at_node(camera_frame *c, const double plane[9], const int grid[2], const int node[2], errmsg *e)
{
    double len[2], at[2];
    if (frame_of(c, len, plane, e) != 0) return -1;
    for (int a = 0; a < 2; a++) {
        if (node[a] < 0 || node[a] >= grid[a])
            return err_set(e, "node: expected 0..%d along %c, found %d", grid[a] - 1, "uv"[a], node[a]);
        /* a single row or column stands in the middle of the rectangle */
        at[a] = grid[a] > 1 ? len[a] * node[a] / (grid[a] - 1) : len[a] / 2;
    }
    return camera_at_point(c, plane, at, e);
}
