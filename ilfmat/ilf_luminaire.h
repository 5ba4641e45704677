/*
 * ilf_luminaire.h - lamps that were taken out of a light field, and what hides or shapes each of them.
 *
 * Pure arithmetic on values of the caller's: no files, no globals, no errors.  All coordinates are the
 * field's own: x along u, y along v, z along n (ilf_frame), origin at probe (0, 0), in the scene's unit; the
 * probes' plane is z = 0.
 *
 *                 lamp  c.  q' = where the ray crosses z = c_z
 *                        \
 *      z = h  ------------X------------   a layer's coordinates: X = p + (q' - p) h/c_z
 *                          \
 *      ray's origin         o
 *                            \
 *      z = 0  ----------------p--------   "foot" coordinates: F = p + beta (q' - c)
 *
 * beta = 0 is sharp on the plane; beta = t/(1 - t) with t = h/c_z is sharp at height h; -1 is sharp at
 * infinity (a beam of directions).
 *
 * Light of a ray that meets a lamp: pass * rgb + (1 - min(pass, 1)) * the residual's radiance, where
 *     pass = max(0, product of the masks that multiply + sum of those that add).
 */
#ifndef ILF_LUMINAIRE_H
#define ILF_LUMINAIRE_H

#ifdef __cplusplus
extern "C" {
#endif

typedef enum ilf_shape {
    ILF_SPHERE,    /* centre, radius */
    ILF_RECTANGLE, /* centre, half edges a, b; shines to both sides */
    ILF_DISC,      /* centre, a, b: radii at right angles (an ellipse where they differ); both sides */
    ILF_TUBE       /* centre, a: half length; radius; round ends */
} ilf_shape;

typedef enum ilf_mask_kind {
    ILF_MASK_LAYER, /* a thin sheet: picture over (x, y) of where the ray crosses z = plane . (1, x, y);
                       counts for rays that begin below it only */
    ILF_MASK_FOOT,  /* picture over foot coordinates */
    ILF_MASK_GATE,  /* logistic of a quadratic in foot coordinates: coef . (1, x, y, x2, xy, y2) */
    ILF_MASK_BEAM,  /* coef[4] max(0, -d . coef[0..2])^coef[3]: gain, axis (unit), exponent */
    ILF_MASK_STACK, /* nz pictures over foot coordinates, of sheets at heights from plane[0] to plane[1],
                       evenly in 1/height; pass = 1/(1 + exp((o - coef[0])/coef[1])), o the largest opacity
                       (picture's value) that the ray meets above its origin */
    ILF_MASK_BALL /* opaque ball: centre coef[0..2], radius coef[3]; outside of it only rays that begin below
                     count */
} ilf_mask_kind;

typedef enum ilf_link { ILF_LINK_VALUE, ILF_LINK_LOGISTIC } ilf_link;

typedef struct ilf_mask {
    ilf_mask_kind kind;
    ilf_link link; /* of the picture: pass = sample, or 1/(1 + exp(-sample)) */
    int adds;      /* 0: multiplies, 1: adds */
    double beta;   /* FOOT, GATE */
    double plane[3];
    double coef[6];
    int nx, ny; /* picture; sample (i, j) stands at x0 + i dx, y0 + j dy; held beyond its edge */
    int nz;     /* STACK: pictures, one after the other */
    double x0, y0, dx, dy;
    float *grid; /* nx*ny(*nz), row-major; owned by whoever made the mask */
} ilf_mask;

typedef struct ilf_luminaire {
    ilf_shape shape;
    int far; /* at infinity: met whatever the auxiliary geometry says */
    double centre[3];
    double a[3], b[3];
    double radius;
    float rgb[3]; /* radiance; all 0: put out, rays pass as if it were not there */
    int nmasks;
    ilf_mask *masks; /* nmasks; owned by whoever made the luminaire */
    /* How sure: relative errors, root mean square, of probes left out while the masks were fitted, and of
     * interpolation between probes in their place; standard errors of the position (scene's unit) and of the
     * radiance (relative).  0: not known. */
    double error_masks, error_interpolation, error_position, error_radiance;
    float *seen; /* what each probe measured of the lamp's light, 1: all, below 0: none expected (under the
                    horizon); n_u*n_v, i fastest; NULL: not kept; owned as masks are */
} ilf_luminaire;

/* 1 if the ray o + t d (d unit) meets the lamp at some t > 0, which goes to *t; else 0 and *t is untouched.
 */
int ilf_luminaire_hit(double *t, const ilf_luminaire *lamp, const double o[3], const double d[3]);

/* Radius of a ball round the centre that holds the lamp. */
double ilf_luminaire_extent(const ilf_luminaire *lamp);

/* Half angle of a cone round the centre, as seen from o, that holds the lamp; pi if o is too near. */
double ilf_luminaire_cone(const ilf_luminaire *lamp, const double o[3]);

/* Solid angle of the lamp as seen from o, horizon ignored: exact for sphere and rectangle, to about 1e-4 of
 * itself for discs and tubes. */
double ilf_luminaire_omega(const ilf_luminaire *lamp, const double o[3]);

/* Area of the lamp's surface, of flat ones one side's. */
double ilf_luminaire_surface(const ilf_luminaire *lamp);

/* A direction from o towards the lamp for (s, t) in [0, 1)^2, and its density per steradian; 0 if there is
 * none. Uniform in solid angle for spheres and rectangles (Urena, Fajardo, King 2013), uniform in area for
 * discs; tubes: uniform in the solid angle of the rectangle that holds their outline, pdf 0 beside it. */
double ilf_luminaire_sample(double d[3], const ilf_luminaire *lamp, const double o[3], double s, double t);

/* What a mask lets through along a ray towards the lamp (d unit, d_z > 0). */
double ilf_mask_pass(const ilf_mask *mask, const double centre[3], const double o[3], const double d[3]);

/* All masks of a lamp together, >= 0; may exceed 1 (a beam's middle, a measured remainder). */
double ilf_luminaire_pass(const ilf_luminaire *lamp, const double o[3], const double d[3]);

#ifdef __cplusplus
}
#endif

#endif
