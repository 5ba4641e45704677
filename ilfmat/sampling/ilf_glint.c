/*
 * ilf_glint.c - mirror images of lamps in shiny balls.
 *
 * A matt surface beside a mirror ball sees the light field's lamps mirrored in the ball.  These glints are
 * too small for blind rays, one of which in ten thousand finds one and makes a white dot.  But in a sphere we
 * can tell where they are.  With the ball's centre C and radius R, our point X at distance D, and the lamp at
 * angle g from X as seen from C, the glint is at angle b where both angles to the normal are equal:
 *
 *               lamp
 *        n  .    /     atan2(D sin b, D cos b - R) = g - b
 *         \b|  /
 *    -----( C )------ X     (the left side rises with b, from 0 to 90 degrees where X sees the rim)
 *
 * A ball demagnifies more in the plane of incidence than across, so that a round lamp's glint is an ellipse.
 * A cone around each glint is sampled on its own (as a Gaussian where the ball is rough), and a ray that
 * leaves the point inside a cone by its lobe and finds the lamp in that ball drops its excess (ilf_ray_part).
 * This divides directions between the two, so that their sum has the right mean wherever we put the cones.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ilf_sampler.h"

#include "ilf_vec.h"

/* With more balls that see lamps we don't begin; so many lamps of a ball, and glints of a point, are looked
 * at.  A point's cones are found anew for each scattered ray that meets a ball: some 10 microseconds for 64.
 */
enum { MOST_BALLS = 64, MOST_LAMPS = 16, MOST_GLINTS = 64 };

/* Cones are wider than the glint by that: what they don't cover is left to blind rays. */
#define CONE_MARGIN 1.15

/* A rough ball's lobe has fallen by exp(-4) at the cone's edge, which is where half vectors are 2 alpha off:
 * 4 alpha in angle. */
#define LOBE_FALL  4.0
#define LOBE_REACH 4.0

/* Rays per glint over those per point; no more than 16: further ones cost what they gain where glints are
 * few. */
#define RAYS_PER_SAMPLE 0.5
#define MOST_RAYS       16

/* Points this near to a ball, in radii, are on it; a glint seen at a flatter angle than that (cosine) is left
 * to blind rays. */
#define ON_THE_BALL 1.0001
#define FLAT        0.01

/* Less than this is 0, of roughness or of a cosine. */
#define TINY 1e-6

/* Turn about the cone from ray to ray: the golden section, the most even of all. */
#define TURN 0.61803398874989485

typedef struct glint_ball {
    double centre[3], radius, roughness;
    int index; /* as the host counts */
    int n;
    ilf_lamp lamp[MOST_LAMPS];
} glint_ball;

struct ilf_glint_balls {
    int n;
    glint_ball ball[MOST_BALLS];
};

typedef struct glint {
    int ball;          /* as the host counts */
    double fall;       /* the Gaussian's exponent at the cone's edge; 0: even */
    double dir[3];     /* from our point */
    double u[3], v[3]; /* in the plane of incidence, and across */
    double tu, tv;     /* tangents of its half angles */
} glint;

/* ---- vectors ---------------------------------------------------------------------------------- */

static double normalize(double a[3])
{
    const double len = sqrt(dot(a, a));

    for (int k = 0; k < 3 && len > 0; k++) a[k] /= len;
    return len;
}

/* A unit vector across a unit vector: of the axis along which that is shortest. */
static void across(double r[3], const double a[3])
{
    const double x = fabs(a[0]), y = fabs(a[1]), z = fabs(a[2]);
    const double axis[3] = {x <= y && x <= z, (y < x) && y <= z, (z < x) && z < y};

    cross(r, a, axis);
    normalize(r);
}

/* ---- where glints are -------------------------------------------------------------------------- */

/* Root b of atan2(D sin b, D cos b - R) = g - b between 0 and hi, by Newton's steps kept in bounds. */
static double mirror_angle(double g, double D, double R, double hi)
{
    double lo = 0, b = 0.5 * hi;

    for (int k = 0; k < 20; k++) { /* half as many do but at the rim */
        const double c = cos(b), s = sin(b), f = atan2(D * s, D * c - R) - (g - b);

        if (f > 0) hi = b;
        else lo = b;
        if (fabs(f) < 1e-7) break; /* of a glint's size of 1e-3 */
        b -= f / (1 + D * (D - R * c) / (D * D + R * R - 2 * D * R * c));
        if (b <= lo || b >= hi) b = 0.5 * (lo + hi);
    }
    return b;
}

/* The ball's normal n where a lamp in direction l is mirrored to a point in direction e from its centre, at
 * distance D. 0 if the ball hides it. */
static int glint_normal(double n[3], const double e[3], double D, double R, const double l[3])
{
    const double c = dot(e, l), g = acos(fmin(fmax(c, -1), 1)), rim = acos(R / D);
    double t[3] = {l[0] - c * e[0], l[1] - c * e[1], l[2] - c * e[2]};

    if (normalize(t) < TINY) {
        memcpy(n, e, 3 * sizeof *n);
        return c >= 0; /* or the lamp is behind the ball */
    }
    if (g >= rim && g - rim > ILF_PI / 2) return 0;
    const double b = mirror_angle(g, D, R, fmin(g, rim));
    for (int k = 0; k < 3; k++) n[k] = cos(b) * e[k] + sin(b) * t[k];
    return 1;
}

/* The glint of a lamp in a ball as seen from x.  0 if there is none to be sampled. */
static int find_glint(glint *gl, const glint_ball *b, const ilf_lamp *lamp, const double x[3])
{
    const double R = b->radius;
    double e[3], l[3], n[3], d[3], to_lamp = 0;

    for (int k = 0; k < 3; k++) e[k] = x[k] - b->centre[k], l[k] = lamp->position[k] - b->centre[k];
    const double D = normalize(e);
    if (D <= ON_THE_BALL * R) return 0;
    normalize(l);
    for (int round = 0; round < 2;
         round++) { /* with the lamp as seen from the centre, then as from the glint */
        if (!glint_normal(n, e, D, R, l)) return 0;
        for (int k = 0; k < 3; k++) l[k] = lamp->position[k] - b->centre[k] - R * n[k];
        to_lamp = normalize(l);
    }
    for (int k = 0; k < 3; k++) d[k] = b->centre[k] + R * n[k] - x[k];
    const double dist = normalize(d), cosine = -dot(d, n);
    if (cosine <= FLAT) return 0;
    const double lamp_angle = lamp->radius < to_lamp ? asin(lamp->radius / to_lamp) : ILF_PI / 2;
    const double angle = CONE_MARGIN * (lamp_angle + LOBE_REACH * b->roughness),
                 most = asin(R / D); /* the ball's own */

    gl->ball = b->index;
    gl->fall = b->roughness > TINY ? LOBE_FALL : 0;
    memcpy(gl->dir, d, sizeof gl->dir);
    cross(gl->v, d, n);
    if (normalize(gl->v) < TINY) across(gl->v, d);
    cross(gl->u, gl->v, d);
    /* the ball demagnifies: a look turned by an angle meets it that much times dist / cosine (across: dist)
     * further, where the normal has turned by a radius' part of that, and the mirrored ray by twice as much
     */
    gl->tu = tan(fmin(angle / (1 + 2 * dist / (R * cosine)), most));
    gl->tv = tan(fmin(angle / (1 + 2 * dist * cosine / R), most));
    return 1;
}

static int find_glints(glint *gl, const ilf_patches *p, const double x[3])
{
    int n = 0;

    for (int k = 0; p->balls && k < p->balls->n; k++)
        for (int a = 0; a < p->balls->ball[k].n && n < MOST_GLINTS; a++)
            n += find_glint(&gl[n], &p->balls->ball[k], &p->balls->ball[k].lamp[a], x);
    return n;
}

/* First cone that holds direction, or -1. */
static int cone_of(const glint *gl, int n, const double dir[3])
{
    for (int k = 0; k < n; k++) {
        const double c = dot(gl[k].dir, dir);

        if (c <= TINY) continue;
        const double x = dot(gl[k].u, dir) / (c * gl[k].tu), y = dot(gl[k].v, dir) / (c * gl[k].tv);
        if (x * x + y * y <= 1) return k;
    }
    return -1;
}

int ilf_glint_ball(const ilf_patches *p, const double point[3], const double dir[3])
{
    glint gl[MOST_GLINTS];
    const int k = cone_of(gl, find_glints(gl, p, point), dir);

    return k < 0 ? -1 : gl[k].ball;
}

/* ---- balls ------------------------------------------------------------------------------------- */

ilf_status ilf_glint_balls_open(ilf_glint_balls **balls, const ilf_patches *patches, const ilf_ball *b, int n,
                                ilf_error *err)
{
    ilf_glint_balls *found = calloc(1, sizeof *found);

    if (!found) return ilf_fail(err, ILF_ERR_MEMORY, "%s: no memory for glints", patches->field->path);
    for (int k = 0; k < n; k++) {
        ilf_lamp lamps[MOST_LAMPS];
        int m;
        const ilf_status st =
            ilf_patches_lamps(lamps, &m, MOST_LAMPS, patches, b[k].centre, b[k].radius, err);

        if (st != ILF_OK || (m && found->n == MOST_BALLS)) {
            free(found);
            *balls = NULL;
            return st;
        }
        if (!m) continue;
        glint_ball *g = &found->ball[found->n++];
        *g = (glint_ball){.radius = b[k].radius, .roughness = b[k].roughness, .index = k, .n = m};
        memcpy(g->centre, b[k].centre, sizeof g->centre);
        memcpy(g->lamp, lamps, sizeof g->lamp);
    }
    *balls = found;
    return ILF_OK;
}

/* ---- sampling ---------------------------------------------------------------------------------- */

/* A direction within a cone and the solid angle that it stands for; s in [0, 1) runs outwards, phi around. */
static double place_in_cone(double dir[3], const glint *g, double s, double phi)
{
    double omega = ILF_PI * g->tu * g->tv;

    if (g->fall > 0) { /* density goes as the lobe */
        const double x = (1 - exp(-g->fall)) / g->fall;
        s = -log(1 - s * g->fall * x) / g->fall;
        omega *= x * exp(g->fall * s);
    }
    const double r = sqrt(s), x = r * g->tu * cos(2 * ILF_PI * phi), y = r * g->tv * sin(2 * ILF_PI * phi);
    for (int k = 0; k < 3; k++) dir[k] = g->dir[k] + x * g->u[k] + y * g->v[k];
    const double c = 1 / normalize(dir); /* from the tangent plane's area to solid angle */
    return omega * c * c * c;
}

void ilf_light_glints(ilf_sampler *s, const ilf_point *point, const ilf_host *h, void *coef)
{
    glint gl[MOST_GLINTS];
    const int n = find_glints(gl, s->of, point->position);
    const int wanted = (int)(point->samples * point->weight * RAYS_PER_SAMPLE + 0.999);
    const int rays = wanted < 1 ? 1 : wanted > MOST_RAYS ? MOST_RAYS : wanted;

    for (int k = 0; k < n; k++) {
        const double start = h->random(ILF_GLINT_RADIUS, h->context);
        double phi = h->random(ILF_GLINT_ANGLE, h->context);

        for (int j = 0; j < rays; j++) {
            double dir[3];

            phi += TURN, phi -= phi >= 1;
            const double omega = place_in_cone(dir, &gl[k], (j + start) / rays, phi);
            if (cone_of(gl, k, dir) >= 0) continue; /* an earlier cone's */
            if (!(h->lobe(coef, dir, point->glint_lobes, h->context) > 0)) continue;
            const ilf_aim aim = {dir, coef, omega / rays};
            h->glint(&aim, gl[k].ball, h->context);
            s->work.glints++;
        }
    }
}
