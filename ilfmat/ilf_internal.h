/*
 * ilf_internal.h - what libilf's files share.
 */
#ifndef ILF_INTERNAL_H
#define ILF_INTERNAL_H

#include <math.h>
#include <openexr.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdint.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "exr/exr_half.h"
#include "ilf.h"

#define ILF_PI 3.14159265358979323846

/* Largest probe and grid that are accepted: sizes are checked against these before anything
 * is multiplied or taken from memory. */
#define ILF_MAX_SIDE        65536
#define ILF_MAX_PROBE_BYTES ((int64_t)1 << 30)

/* One probe.  Texel (x, y), channel c begins at
 *     pix + y*row_bytes + chan_offset[c] + x*pixel_bytes
 * in one of two orders, the same for all probes of a field:
 *     planar    OpenEXR's, for each row all B, then all G, then all R: what a first part of the file that is
 *               used in place dictates.  A random lookup waits for 24 cache lines.
 *     together  R G B of a texel side by side, 8 to 10 cache lines: decoded memory and the file's
 *               interleaved part.
 * The TEXEL_HEAD bytes before pix may be read. */
enum { TEXEL_HEAD = 16 };
typedef struct probe {
    void *decoded;      /* owned memory, or NULL when pix points into the file */
    float pole[2][3];   /* means of the first and the last row: the values at the poles */
    atomic_int checked; /* its texels in the file, once */
    int loading;        /* a thread reads it; under lock */
    int known;          /* it was read before: pole is set, for good; under lock */
    int pinned;         /* somebody looks at its memory until the field is closed; under lock */
} probe;

/* A lookup of usual rays: ilf_eval with from = hit, or origin.  An ilf_status, or ILF_UNUSUAL: nothing done.
 */
enum { ILF_UNUSUAL = -1 };
typedef int ilf_fast_fn(float rgb[3], const ilf *field, const ilf_frame *frame, const double from[3],
                        const double dir[3], ilf_error *err);

/* Memory of decoded probes (ilf_memory.c).  Under lock, but for the atomic ones. */
typedef struct probe_memory {
    int64_t most; /* probes that may be kept; 0: all */
    int64_t n;    /* that have memory */
    int64_t
        *order; /* those that can be given back, the oldest first: a ring of as many as there are probes */
    int64_t first, count;
    atomic_uint given_back; /* counts up before a probe's memory is used for another */
} probe_memory;

struct ilf {
    ilf_info info;
    ilf_frame frame;
    char *path;
    exr_context_t exr;
    int fd;
    struct stat st;           /* as opened, to notice a change in place */
    const unsigned char *map; /* whole file, read-only; NULL if it can't be mapped */
    int full_sphere;          /* polar_max is pi: the last row has a pole too */
    int is_half;              /* texels in memory */
    double columns_per_radian, rows_per_radian;
    double column_ahead,
        last_row;          /* column at azimuth 0, and the last row, counted from the first texel's centre */
    double span_u, span_v; /* probe (i, j) stands at i/span_u, j/span_v of the edges; single ones, i = 1, in
                              the middle */
    ilf_fast_fn *fast[2];  /* without and with depth correction, for the texels' order and type and this
                              processor; or NULL */
    size_t texel_bytes, pixel_bytes, row_bytes, probe_bytes; /* of a channel, a texel, a row, a probe */
    size_t chan_offset[3];
    int is_dwa;          /* compressed with DWA, which has a decoder of its own */
    int uniform;         /* all channels of one type */
    struct {             /* a row of an uncompressed tile of the first part: channel after channel */
        size_t bytes;    /* of the row */
        size_t start[3]; /* where R, G, B begin */
        int is_half[3];
    } raw;
    int in_place;                      /* tiles are used where they are in the mapped file */
    int second_part;                   /* number of the part that holds the texels interleaved; 0: none */
    probe *probes;                     /* n_u*n_v, i fastest */
    const unsigned char *_Atomic *pix; /* of each probe, NULL until it is read */
    pthread_mutex_t lock;              /* of what follows, and of probes; not held while one is read */
    pthread_cond_t loaded;             /* a probe was read, or could not be */
    pthread_mutex_t dwa_lock; /* held while a DWA tile is decoded: its library has one place for words */
    probe_memory memory;
    ilf_usage usage;      /* under lock */
    ilf_luminaire *lamps; /* n_lamps, that were taken out of the texels; NULL: none were */
    int n_lamps;
    double (*lamp_balls)[4]; /* of each lamp: centre, square of the radius of a ball that holds it */
    ilf_error fault;         /* what ilf_fault says */
};

/* Fill err (may be NULL) and return status.  Control characters become '?'. */
ilf_status ilf_fail(ilf_error *err, ilf_status status, const char *fmt, ...)
    __attribute__((format(printf, 3, 4)));

/* Rules of the header that reader and writer share; path names the file in the words. */
ilf_status ilf_check_polar(double polar_max, double polar_valid, const char *path, ilf_error *err);
ilf_status ilf_check_plane(ilf_frame *frame, const double origin[3], const double U[3], const double V[3],
                           const char *path, ilf_error *err);
int ilf_is_full_sphere(double polar_max);

/* OpenEXR's own words in this thread's call; a call that may bring some empties it before. */
ilf_error *ilf_exr_words(void);

/* Memory for a probe that is decoded (ilf_memory.c), where their number is bounded: that of the oldest, or NULL: the caller takes some.  Then
 * say that probe k has it, or that none was needed after all.  All under lock. */
unsigned char *ilf_memory_take(ilf *field);
void ilf_memory_keep(ilf *field, int64_t k);
void ilf_memory_none(ilf *field);
void ilf_memory_free(ilf *field);

/* Decode tile (i, j) of a DWA-compressed file to halves in our layout (ilf_dwa.c). */
ilf_status ilf_decode_dwa(const ilf *field, int i, int j, unsigned char *pix, ilf_error *err);

/* The words of ILF_ERR_CHANGED, which it returns. */
ilf_status ilf_fail_changed(const ilf *field, ilf_error *err);

/* Settle in which order texels lie in memory, and what that makes of lookups (ilf_layout.c). */
void ilf_choose_layout(ilf *field);

/* The second part's name and attribute. */
#define ILF_INTERLEAVED_NAME      "interleaved"
#define ILF_INTERLEAVED_ATTRIBUTE "ilf:interleaved"
#define ILF_INTERLEAVED_CHANNEL   "RGB"

/* The tile of the first part that lies uncompressed `planar` bytes from the file's start: does pix hold the
 * same texels together (channels of one type), and put them there, in memory's type.  1 for yes, or done. */
int ilf_same_texels(const ilf *field, const unsigned char *pix, uint64_t planar);
int ilf_copy_texels(const ilf *field, unsigned char *pix, uint64_t planar);

/* ilf_eval without lamps: what the texels hold. */
ilf_status ilf_eval_residual(float rgb[3], const ilf *field, const ilf_frame *frame, const double origin[3],
                             const double dir[3], const double *hit, ilf_mode mode, ilf_error *err);

/* A point in the lamps' own coordinates, which are the header's: frame may have been moved, turned, mirrored
 * and scaled (evenly). */
void ilf_lamp_point(double p[3], const ilf *field, const ilf_frame *frame, const double x[3]);

/* The number of the first lamp that the ray o + t d (lamps' coordinates, d unit) meets, or -1; reach is where
 * it ends. */
int ilf_nearest_lamp(const ilf *field, const double o[3], const double d[3], double reach);

/* Fill in lamp_balls. */
ilf_status ilf_bound_lamps(ilf *field, ilf_error *err);

/* Put a lamp in front of what the texels hold along a ray that meets it. */
void ilf_add_lamp(float rgb[3], const ilf_luminaire *lamp, const double o[3], const double d[3]);

/* Put the lamps of a field that has some in front of rgb; arguments as ilf_eval's, but origin may be NULL. */
ilf_status ilf_add_lamps(float rgb[3], const ilf *field, const ilf_frame *frame, const double *origin,
                         const double dir[3], const double *hit, ilf_mode mode, ilf_error *err);

/* ilf_eval_residual in plain C, for any ray on any processor; and what is faster where the processor has AVX2, FMA and
 * F16C, else NULL. */
ilf_status ilf_eval_plain(float rgb[3], const ilf *field, const ilf_frame *frame, const double origin[3],
                          const double dir[3], const double *hit, ilf_mode mode, ilf_error *err);
ilf_fast_fn *ilf_eval_avx2(const ilf *field, int depth);

/* Make probe k ready (ilf_probe.c).  Cheap when it is. */
ilf_status ilf_load_probe(const ilf *field, int64_t k, ilf_error *err);

static inline ilf_status ilf_need_probe(const ilf *f, int64_t k, ilf_error *err)
{
    if (atomic_load_explicit(&f->pix[k], memory_order_acquire)) return ILF_OK;
    return ilf_load_probe(f, k, err);
}

/* Decode the probes of a field that all are to be looked at, by as many threads as there are processors, where that is worth
 * it and all may be kept (ilf_ahead.c).  What fails is left for the look. */
void ilf_read_ahead(const ilf *field);

/* Processors that this process may use (ilf_many.c). */
int ilf_processors(void);

/* One probe's texels for a single look: in place, or decoded as for lookups, or, where their memory is bounded, into *own; both
 * to be given to ilf_unpeek_probe. */
ilf_status ilf_peek_probe(const ilf *field, int64_t k, const unsigned char **pix, void **own, ilf_error *err);
void ilf_unpeek_probe(const ilf *field, const unsigned char *pix, void *own);

/* Any byte alignment: tiles in a mapped file may begin anywhere. */
static inline double ilf_texel_of(const unsigned char *p, int is_half)
{
    if (is_half) {
        uint16_t h;
        memcpy(&h, p, sizeof h);
        return (double)half_to_float(h);
    }
    float v;
    memcpy(&v, p, sizeof v);
    return (double)v;
}

static inline float ilf_texel(const ilf *f, const unsigned char *p)
{
    return (float)ilf_texel_of(p, f->is_half);
}

#endif
