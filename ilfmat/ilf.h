/*
 * ilf.h - incident light fields: open, validate, evaluate, write.
 *
 * An incident light field (ILF) is an n_u x n_v grid of light probes on a plane; each probe is a
 * latitude/longitude map of the radiance arriving from direction (theta, phi).  Unger, Wenger,
 * Hawkins, Gardner, Debevec, "Capturing and Rendering With Incident Light Fields" (2003),
 * section 3 for the parametrisation, 5.1 for the lookup, 5.2 for the depth correction.  The file and
 * the lookup are specified in docs/FORMAT.md.
 *
 *                   n = u x v
 *                   |    . d          d = sin(phi) cos(theta) u + sin(phi) sin(theta) v + cos(phi) n
 *                   |phi.               points from the plane towards the light
 *                   |  .
 *      origin ------+--------- U      probe (i, j) stands at origin + i/(n_u-1) U + j/(n_v-1) V
 *            \     theta (from u to v)
 *             V
 *
 * Units: lengths in the scene's unit, angles in radians, radiance in W/sr/m^2 per RGB channel.
 *
 * Values below 0 (noise about 0 where a background was subtracted) are values like others: kept when written,
 * interpolated and looked up as they are, by every estimator.  Only luminance above 0 is aimed at: a
 * threshold is never below 0, and what lies under it, all of a texel whose luminance is below 0, belongs to
 * the smooth base.  Their sum is right on average; clipping would add light.
 *
 * Errors: calls return ILF_OK or an ilf_status; outputs are untouched on failure and the words
 * go to a caller-owned ilf_error (may be NULL).  The library never prints, exits, or keeps
 * globals.
 *
 * Threads: one ilf may be evaluated from any number of threads at once; opening, closing and
 * writing belong to one thread.  A forked child may go on using an ilf opened before the fork.
 */
#ifndef ILF_H
#define ILF_H

#include <stddef.h>
#include <stdint.h>

#include "ilf_luminaire.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a call came to. */
typedef enum ilf_status {
    ILF_OK = 0,
    ILF_ERR_IO,     /* the system refused to open, read or write */
    ILF_ERR_FORMAT, /* the file breaks the format; the words name attribute or probe */
    ILF_ERR_VALUE,  /* a texel is NaN or infinite; the words name probe and pixel */
    ILF_ERR_ARG,    /* an argument is out of its range */
    ILF_ERR_MEMORY,
    ILF_ERR_CHANGED /* the file was changed in place while open; see ilf_fault */
} ilf_status;

/* The words that go with a status; the caller's. */
typedef struct ilf_error {
    ilf_status status; /* as the call returned it */
    char text[512];    /* one line, no newline, begins with the file's name where there is one */
} ilf_error;

/* ---- the plane ---------------------------------------------------------------------------- */

/* A light field's place in space.  u, v, n are unit vectors; (u, v, n) is left-handed where the
 * caller gave a normal opposite to U x V. */
typedef struct ilf_frame {
    double origin[3]; /* position of probe (0, 0) */
    double u[3], v[3], n[3];
    double len_u, len_v; /* |U|, |V|: edge lengths of the sampled rectangle */
    double cos_uv;       /* u.v: up to 1e-4 off a right angle is allowed */
} ilf_frame;

/* Build a frame from the plane's origin and edge vectors.  normal may be NULL (n = u x v) or
 * +-(U x V) of any length, which says from which side the light comes.
 * Fails with ILF_ERR_ARG if a number is not finite, U or V is zero, |U.V| > 1e-4 |U||V|, or the
 * normal is more than 1e-3 rad off +-(U x V). */
ilf_status ilf_frame_init(ilf_frame *frame, const double origin[3], const double U[3], const double V[3],
                          const double *normal, ilf_error *err);

/* ---- the file ----------------------------------------------------------------------------- */

/* The versions of docs/FORMAT.md that are read and written: probes alone, and with lamps that were taken out
 * of them. */
#define ILF_FILE_VERSION       1
#define ILF_FILE_VERSION_LAMPS 2

/* Numbers of 16 or of 32 bits. */
typedef enum ilf_type { ILF_HALF, ILF_FLOAT } ilf_type;

/* What a file's header says; angles in radians. */
typedef struct ilf_info {
    int n_u, n_v;            /* grid of probes */
    int n_theta, n_phi;      /* texels of one probe: columns, rows */
    ilf_type type;           /* texels as stored (mixed channels count as float) */
    const char *compression; /* OpenEXR's name: "none", "zip", ...; static */
    int interleaved; /* the file holds the texels a second time, in the order that lookups like best */
    float origin[3], U[3], V[3]; /* of the sampled rectangle, scene's unit */
    double polar_max;            /* polar angle at the map's lower edge, (0, pi] */
    double polar_valid;          /* beyond it lookups hold the value at it; at most polar_max here */
    int64_t file_bytes;
    int version; /* of the file: ILF_FILE_VERSION or ILF_FILE_VERSION_LAMPS */
} ilf_info;

typedef struct ilf ilf; /* an open light field */

/* Open and validate a light field.  Reads the header and the table of tiles, no probe.
 * The handle is owned by the caller until ilf_close. */
ilf_status ilf_open(ilf **field, const char *path, ilf_error *err);
void ilf_close(ilf *field); /* NULL allowed */

const ilf_info *ilf_get_info(const ilf *field);   /* owned by field */
const ilf_frame *ilf_get_frame(const ilf *field); /* the header's plane; owned by field */
const char *ilf_get_path(const ilf *field);       /* as given to ilf_open */

/* What else the header says of the file, for those who hand it on. */
typedef struct ilf_notes {
    const char *comments, *owner, *cap_date; /* or NULL; owned by the field */
    double white_luminance;                  /* cd/m^2 of RGB (1,1,1); 0: not stated */
} ilf_notes;

/* Fill notes from the header; nothing is checked but that the white luminance is above 0. */
void ilf_get_notes(ilf_notes *notes, const ilf *field);

/* The lamps that were taken out of the field (a file of version 2), in its own coordinates (ilf_luminaire.h);
 * *n of them.  The texels hold what is left.  NULL and 0 where none were.  Owned by field. */
const ilf_luminaire *ilf_get_luminaires(int *n, const ilf *field);

/* May the field lie in this frame?  ILF_ERR_ARG, with words, where its lamps were taken out and the frame's
 * edges are not in the header's proportion: lamps can be moved, turned, mirrored and scaled evenly. */
ilf_status ilf_check_frame(const ilf *field, const ilf_frame *frame, ilf_error *err);

/* Bound the memory of probes that have to be decoded (those of compressed files): beyond `bytes` the one that was decoded
 * longest ago is given back, and decoded again when it is needed again.  At least 16 are kept, however large, and those that ilf_view_probe
 * was asked for.  0: all that were needed are kept, as without this call.  Before the field's first lookup, or ILF_ERR_ARG. */
ilf_status ilf_set_memory(ilf *field, int64_t bytes, ilf_error *err);

/* What has been used so far.  Probes come in when a lookup first needs them. */
typedef struct ilf_usage {
    int64_t probes;        /* touched */
    int64_t mapped_bytes;  /* of them, used in place in the file: shared between processes */
    int64_t decoded_bytes; /* of them, decompressed and kept in this process's memory */
} ilf_usage;

/* Fill usage with what this process has used of field; any thread, at any time. */
void ilf_get_usage(ilf_usage *usage, const ilf *field);

/* ILF_ERR_CHANGED if the file was written to in place since it was opened.  Each probe's first use asks by
 * itself; what was used before lies in the mapped file and changes with it, so ask again at the end. */
ilf_status ilf_check_unchanged(const ilf *field, ilf_error *err);

/* A field that is used in place lies in the mapped file.  Where that was cut short, or can't be read, a
 * lookup ends in the signal SIGBUS, which no library may catch for its program: the program does (SA_SIGINFO)
 * and asks here, with si_addr, for the words of ILF_ERR_CHANGED: one line that names the file, owned by
 * field; NULL if address is none of field's. May be called in a signal handler.  (Files to be replaced while
 * in use are replaced by rename: then nothing happens.) */
const char *ilf_fault(const ilf *field, const void *address);

/* A number that tells the field's values from any other's: the same for the same values however they are
 * stored, and another (but for one chance in 2^64) where a single texel, the grid, the polar angles, or a
 * lamp's light or masks differ.  The plane does not count, nor how sure the lamps are. Looks through every
 * probe; fails as ilf_read_probe does. */
ilf_status ilf_digest(uint64_t *digest, const ilf *field, ilf_error *err);

/* One probe's texels as float, n_phi*n_theta*3, row-major from phi = 0, R G B interleaved. */
ilf_status ilf_read_probe(float *rgb, const ilf *field, int i, int j, ilf_error *err);

/* One probe's texels where they lie, to be looked at and not to be written: texel (x, y)'s channel c stands
 * x*column + y*row + c*channel bytes after red.  Valid until ilf_close. */
typedef struct ilf_view {
    const void *red; /* R of texel (0, 0); at any address: it may be no multiple of the number's size */
    ilf_type type;   /* of the texels there */
    ptrdiff_t row, column, channel; /* bytes from one to the next; channel (R to G to B) may be below 0 */
    int in_file;                    /* 1: in the mapped file (see ilf_fault), 0: decoded into memory */
} ilf_view;

/* Bring the probe in, as a lookup does, and say where it lies; fails as ilf_read_probe does. */
ilf_status ilf_view_probe(ilf_view *view, const ilf *field, int i, int j, ilf_error *err);

/* ---- lookup (sections 5.1 and 5.2 of the paper) --------------------------------------------- */

/* Where the four probes around the back-traced point are looked up. */
typedef enum ilf_mode {
    ILF_NO_DEPTH, /* all in the ray's direction */
    ILF_DEPTH     /* each towards the point where the ray met the auxiliary geometry */
} ilf_mode;

/* Radiance that arrives along a ray.
 *   rgb        out: radiance of R, G, B
 *   frame      where the light field lies (ilf_get_frame, or a frame of the caller's)
 *   origin     ray's origin; where the field has no lamps taken out, used only when hit is NULL
 *   dir        direction towards the light, any length > 0
 *   hit        where the ray meets the auxiliary geometry; NULL when that is at infinity:
 *              the ray is then traced back from its own origin, without depth correction
 * Rays with dir.n <= 0 give 0.  Where the field's lamps were taken out, a ray that meets one before hit sees it
 * in front of the texels' radiance, dimmed by what lies between the lamp and the ray's origin; without depth
 * correction, between the lamp and where the ray crosses the plane.  The result is finite for every finite ray.  If hit falls on a
 * probe's own position, that probe is looked up in direction dir.
 * Fails if dir is zero, a coordinate is not finite, or a probe can't be read.  The frame must be one that
 * ilf_check_frame takes. */
ilf_status ilf_eval(float rgb[3], const ilf *field, const ilf_frame *frame, const double origin[3],
                    const double dir[3], const double *hit, ilf_mode mode, ilf_error *err);

/* Rays to be looked up together: ray k's origin begins at origins[k*origin_step], and so on.  A step is 3 where
 * they lie one after the other, 0 where one serves all. */
typedef struct ilf_rays {
    size_t n;
    const double *origins, *dirs;
    const double *hits; /* NULL: the auxiliary geometry is at infinity for all; an infinite coordinate says so
                           of one ray */
    size_t origin_step, dir_step, hit_step;
} ilf_rays;

/* ilf_eval of many rays by several threads.
 *   rgb        out: n*3, radiance of R, G, B of each ray
 *   threads    this call's, the caller's own among them, which it waits for; 0: one for each processor that this
 *              process may use.  What comes out does not hang on their number.
 * Fails where ilf_eval would for the first such ray, whose number (from 0) the words name where it is the ray's
 * fault; rgb then holds what was done so far. */
ilf_status ilf_eval_many(float *rgb, const ilf *field, const ilf_frame *frame, const ilf_rays *rays,
                         ilf_mode mode, int threads, ilf_error *err);

/* ---- what is bright ---------------------------------------------------------------------------
 *
 * A light field is split by luminance at a threshold T into a smooth base and an excess,
 *     L = min(L, T) + max(L - T, 0)        (colour kept: both parts have L's chromaticity)
 * of which the excess is small in solid angle and worth aiming at.  Where lamps were taken out of the field, the
 * base is the texels' alone, and the lamps all excess.  The list of the probes' bright
 * patches is made once, is not changed any more, and may be shared by threads; its field must stay open. */

typedef struct ilf_patches ilf_patches;

/* Where a ray meets the auxiliary geometry: 1 and the point, or 0 when it meets none (the light then
 * counts as infinitely far away).  Coordinates as the frame's. */
typedef int ilf_hit_fn(double hit[3], const double origin[3], const double dir[3], void *context);

/* A shiny ball of the scene, in which matt things beside it see the light field's lamps (see ilf_light). */
typedef struct ilf_ball {
    double centre[3], radius; /* frame's coordinates */
    double roughness;         /* Ward's alpha, the root mean square slope of its facets; 0: a mirror */
} ilf_ball;

typedef struct ilf_patches_spec {
    ilf_mode mode;    /* as lookups will use */
    ilf_hit_fn *hit;  /* for ILF_DEPTH, while the list is made; NULL: the light is infinitely far away */
    void *context;    /* for hit */
    double threshold; /* T, as of ilf_luminance; 0: 3 times the mean of what field and lamps have above 0 */
    double cube;      /* edge of the cubes of space that share a slice; 0: from the probes' pitch */
    const ilf_ball *balls; /* copied; if more than 64 of them see lamps, glints are left to blind rays */
    int n_balls;
} ilf_patches_spec;

/* Find what is bright in the field: every probe is looked through once.  NaN texels are
 * refused as in lookups. */
ilf_status ilf_patches_open(ilf_patches **patches, const ilf *field, const ilf_frame *frame,
                            const ilf_patches_spec *spec, ilf_error *err);
void ilf_patches_close(ilf_patches *patches); /* NULL allowed; after the samplers over it */

double ilf_patches_threshold(const ilf_patches *patches); /* T, as given or found */
int64_t ilf_patches_count(const ilf_patches *patches); /* with lamps that were taken out; 0: nothing exceeds
                                                          the threshold */

/* Radiance's luminance of a colour, without the 179 lm/W. */
static inline double ilf_luminance(const float rgb[3])
{
    return 0.265 * (double)rgb[0] + 0.670 * (double)rgb[1] + 0.065 * (double)rgb[2];
}

/* The part of a radiance that is excess over the threshold (0 or more), 0 to 1:
 *     excess = part * rgb, base = (1 - part) * rgb
 * A channel of the excess may be below 0, its luminance is not. */
static inline double ilf_excess_part(const float rgb[3], double threshold)
{
    const double y = ilf_luminance(rgb);

    return y > threshold ? 1 - threshold / y : 0;
}

/* A lamp: bright patches that lie together as seen from somewhere. */
typedef struct ilf_lamp {
    double position[3]; /* frame's coordinates; very far for light at infinity */
    double radius; /* about that of a ball that holds it; patches half on a thing behind it don't count */
    double excess; /* its largest luminance over the threshold */
} ilf_lamp;

/* The lamps, brightest first, that can be seen from within a ball (frame's coordinates).
 * At most `most` are written to lamps, their number to *n. */
ilf_status ilf_patches_lamps(ilf_lamp *lamps, int *n, int most, const ilf_patches *patches,
                             const double centre[3], double radius, ilf_error *err);

/* ---- directions -------------------------------------------------------------------------------
 *
 * What is bright at a point is a two-dimensional slice of the four-dimensional field.  Slices are built per
 * cube of space on first use, from the list of patches, and never miss a patch that only a part of the cube
 * sees.  A sampler holds one thread's slices; what it draws hangs on no other thread. */

typedef struct ilf_sampler ilf_sampler;
typedef struct ilf_slice ilf_slice;

/* Open a sampler over the list, which must stay open: *sampler is the caller's until ilf_sampler_close. */
ilf_status ilf_sampler_open(ilf_sampler **sampler, const ilf_patches *patches, ilf_error *err);
void ilf_sampler_close(ilf_sampler *sampler); /* NULL allowed */

/* What a sampler has done so far. */
typedef struct ilf_work {
    int64_t slices;     /* built */
    int64_t candidates; /* drawn and weighed by ilf_light */
    int64_t rays;       /* that it had traced towards the light field */
    int64_t glints;     /* that it had traced towards mirror images of lamps */
} ilf_work;
/* Its own only: a host with several threads adds them up. */
void ilf_sampler_work(ilf_work *work, const ilf_sampler *sampler);

/* The slice of the excess that the cube around a point sees.  *slice is NULL where nothing bright
 * reaches; else it is owned by the sampler and valid until the next call. */
ilf_status ilf_sampler_slice(ilf_slice **slice, ilf_sampler *sampler, const double point[3], ilf_error *err);

/* One direction drawn from a slice. */
typedef struct ilf_draw {
    double dir[3];    /* unit vector in the plane's own coordinates (u, v, n), n > 0 */
    double pdf;       /* density per steradian */
    double near, far; /* about how far away the light there is: the same but where one thing stands before
                       * another; HUGE_VAL: no light is expected there */
    double expected;  /* about the excess luminance to be expected there, not a bound */
} ilf_draw;

/* Draw a direction distributed as the slice's map: u in [0, 1) runs through the map along a
 * space-filling curve (ascending u are the quickest), (v, w) in [0, 1)^2 place it within a cell. */
void ilf_sample(ilf_draw *draw, ilf_slice *slice, double u, double v, double w);

/* The density per steradian with which ilf_sample draws a direction (plane's coordinates, any length). */
double ilf_pdf(const ilf_slice *slice, const double dir[3]);

/* ---- lighting a point ---------------------------------------------------------------------------
 *
 * A renderer (the host) asks for the excess at each point that it shades, and lets its own rays see the rest:
 *
 *     ilf_light    the excess that comes to the point straight from the light field (many candidates from the
 *                  slice, of which a few are chosen by lobe * excess and traced), and by way of shiny balls
 *     ilf_ray_part what another ray, that met the light field, counts of it, so that nothing counts twice
 *
 * The sum has the right mean for every lobe, threshold, and number of samples. */

/* Components of a lobe, for hosts that tell them apart. */
enum { ILF_DIFFUSE = 1, ILF_GLOSSY = 2 };

/* A point to be lit. */
typedef struct ilf_point {
    double position[3]; /* frame's coordinates */
    int lobes;          /* components that want the excess straight from the light field; 0: none does */
    int glint_lobes;    /* components that want it by way of shiny balls */
    int narrow;         /* its lobe is narrow: the number of its candidates does not go by other points' */
    int apart;          /* its tests are not remembered for other points */
    int samples;        /* rays of a point that counts in full, 1 or more */
    double weight;      /* how much of the result hangs on the point, 0 to 1 */
} ilf_point;

/* One ray that ilf_light wants traced from the point: scale * coef * what it finds is to be added to the
 * result. */
typedef struct ilf_aim {
    const double *dir; /* unit vector, frame's coordinates */
    const void *coef;  /* as the host's lobe left it */
    double scale;
} ilf_aim;

/* What random numbers are for: a host with a sequence of many dimensions tells them apart. */
enum {
    ILF_ALONG_MAP,
    ILF_IN_CELL_U,
    ILF_IN_CELL_V,
    ILF_CHOICE,
    ILF_GLINT_RADIUS,
    ILF_GLINT_ANGLE,
    ILF_IN_LAMP
};

/* What a host does for ilf_light.  Calls come from within ilf_light, in the same thread; shadow and glint may
 * call ilf_light again (for points that their rays meet), and may leave it for good (longjmp, exit). */
typedef struct ilf_host {
    /* A number in [0, 1), independent of all others but those of its dimension at other points. */
    double (*random)(int dimension, void *context);
    /* The point's coefficient for light from direction dir (a unit vector): reflected radiance per radiance
     * and steradian, cosine included, of the components in `lobes`, in the host's own kind of colour, to coef
     * (coef_bytes).  Returns how much it counts (a luminance, say, or the largest channel): 0 where it is 0,
     * above 0 elsewhere. */
    double (*lobe)(void *coef, const double dir[3], int lobes, void *context);
    /* Trace a ray and add the light field's excess that it meets, straight on.  Returns 1 if it met some, 0
     * if not. */
    int (*shadow)(const ilf_aim *aim, void *context);
    /* Trace a ray and add the excess that it meets after its reflection in ball number `ball`, and nothing if
     * it meets another thing before; NULL: no glints. */
    void (*glint)(const ilf_aim *aim, int ball, void *context);
    /* Auxiliary geometry as for ilf_patches_open; NULL: infinitely far away. */
    ilf_hit_fn *hit;
    size_t coef_bytes;
    void *context;
} ilf_host;

/* Light a point.  The sampler's field, frame and depth correction count.  Fails only where a probe can't be
 * read, or for want of memory. */
ilf_status ilf_light(ilf_sampler *sampler, const ilf_point *point, const ilf_host *host, ilf_error *err);

/* Parts of a radiance. */
typedef enum ilf_part { ILF_NONE = 0, ILF_BASE = 1, ILF_EXCESS = 2, ILF_ALL = 3 } ilf_part;

/* How a ray came to meet the light field, by its last turn; passing through something undeflected is none. */
typedef struct ilf_way {
    int aimed;     /* 1: traced by shadow at this light field and not turned since, or by glint and turned by
                    * that ball alone; -1: by one of them, but otherwise; 0: by none of them */
    int scattered; /* drawn from a lobe at a point where ilf_light was asked for it */
    int in_glint;  /* mirrored by a ball, in whose glint (ilf_glint_ball) a lobe had sent it */
} ilf_way;

/* What such a ray counts: what ilf_light does not. */
ilf_part ilf_ray_part(const ilf_way *way);

/* The ball in whose glints (those that ilf_light samples at a point) a direction from there lies, or -1. */
int ilf_glint_ball(const ilf_patches *patches, const double point[3], const double dir[3]);

/* A part of the radiance that arrives along a ray; arguments as ilf_eval's. */
ilf_status ilf_eval_part(float rgb[3], const ilf_patches *patches, ilf_part part, const double origin[3],
                         const double dir[3], const double *hit, ilf_error *err);

/* ---- writing ------------------------------------------------------------------------------ */

/* What rounding (ilf_spec's tolerance) did to the light: relative changes of irradiance at the nodes, luminance that falls
 * on the plane from what the probes hold up to 90 degrees of the normal. */
typedef struct ilf_loss {
    double worst, rms;    /* over the nodes; worst: the largest, of either sign */
    double mean;          /* of all nodes' light together: up (above 0) or down */
    double texel;         /* the largest of a single number that is no subnormal one of the type */
    int worst_i, worst_j; /* the node of worst */
} ilf_loss;

/* A file to be written (docs/FORMAT.md, section 1); angles in radians. */
typedef struct ilf_spec {
    int n_u, n_v, n_theta, n_phi; /* all >= 1 */
    double origin[3], U[3], V[3]; /* of the sampled rectangle, scene's unit */
    double polar_max;             /* (0, pi] */
    double polar_valid;           /* 0: none stated */
    ilf_type type;
    const char *compression; /* none rle zips zip piz pxr24 b44 b44a; NULL: none */
    /* write the texels a second time, each one's channels side by side: twice the file, faster lookups in
     * place; needs no compression (what is decoded is interleaved then) */
    int interleave;
    const char *comments;   /* or NULL */
    const char *owner;      /* or NULL */
    const char *cap_date;   /* "YYYY:MM:DD HH:MM:SS" or NULL */
    double white_luminance; /* cd/m^2 of RGB (1,1,1); 0: none stated */
    const char *name;       /* what errors call the file; NULL: its path */
    /* lamps that were taken out of the probes (a file of version 2), in the field's own coordinates; none: a
     * file of version 1.  Not copied: they stay the caller's, unchanged until ilf_writer_close.  Their numbers
     * are rounded to floats; masks' pictures to halves if the texels are and no sample is beyond them. */
    const ilf_luminaire *lamps;
    int n_lamps;
    /* 0: texels as they are given; above 0, to .5: rounded so that none is off by more than this share of itself
     * (ilf_round).  Lamps and their masks are not. */
    double tolerance;
    ilf_loss *loss; /* or NULL; filled by ilf_writer_close */
} ilf_spec;

/* Round n numbers, which then compress better, so that none is off by more than tolerance (above 0) of itself:
 * to the nearest number with as few bits as that allows, ties to even, so that they go up as often as down.
 * As numbers of the type: where its own steps are coarser (a half below 6e-5) its rounding alone counts.  Zero,
 * NaN, infinity, and what would become infinite, stay what they are. */
void ilf_round(float *values, size_t n, ilf_type type, double tolerance);

typedef struct ilf_writer ilf_writer; /* a file that is being written */

/* Begin a file at path (written in place: give a temporary name and rename it after
 * ilf_writer_close).  The spec is checked as ilf_open would. */
ilf_status ilf_writer_open(ilf_writer **writer, const char *path, const ilf_spec *spec, ilf_error *err);

/* The same check without a file: ILF_OK, or ILF_ERR_ARG with the words that ilf_writer_open would give. */
ilf_status ilf_spec_check(const ilf_spec *spec, ilf_error *err);

/* Add the next probe, in i-fastest order: n_phi*n_theta*3 floats as in ilf_read_probe.
 * NaN and infinite texels, and texels beyond 65504 for ILF_HALF, are refused and named. */
ilf_status ilf_writer_probe(ilf_writer *writer, const float *rgb, ilf_error *err);

/* Finish; fails if probes are missing.  Frees the writer in every case. */
ilf_status ilf_writer_close(ilf_writer *writer, ilf_error *err);

/* Give up and free the writer (NULL allowed); the unfinished file stays for the caller to remove. */
void ilf_writer_abort(ilf_writer *writer);

#ifdef __cplusplus
}
#endif

#endif
