/*
 * ilf_eval_avx2.c - ilf_eval.c's lookup with the four probes side by side, for processors with AVX2, FMA and
 * F16C.
 *
 * No branch depends on a random direction: a wrongly guessed one costs as much as an arc tangent, and it
 * stops the processor from fetching the next lookup's texels while it waits for this one's.  Lane k is probe
 * k, in column k & 1 and row k >> 1 of the cell that the ray crosses.
 *
 * Usual rays: those that need no care against over- and underflow, all coordinates and lengths below 1e100
 * and the ray neither within 1e-100 of parallel to the plane nor, with depth correction, as near to it where
 * it meets the geometry.
 */
#include "ilf_internal.h"

#if defined(__x86_64__) && defined(__GNUC__)
#include <cpuid.h>
#include <float.h>
#include <immintrin.h>

#define AVX2        __attribute__((target("avx2,fma,f16c")))
#define INLINE_AVX2 static inline __attribute__((always_inline, target("avx2,fma,f16c")))

/* gcc -O2 leaves short loops as they are, with what they sum up in memory; clang does not. */
#ifdef __clang__
#define UNROLL
#else
#define UNROLL _Pragma("GCC unroll 8")
#endif

/* ---- angles --------------------------------------------------------------------------------- */

/* atan2(y, x) as ilf_angle.h has it, with its polynomial. */
INLINE_AVX2 __m256d atan2_4(__m256d y, __m256d x)
{
    const __m256d sign = _mm256_set1_pd(-0.0), zero = _mm256_setzero_pd();
    const __m256d ax = _mm256_andnot_pd(sign, x), ay = _mm256_andnot_pd(sign, y);
    const __m256d hi = _mm256_max_pd(ax, ay), lo = _mm256_min_pd(ax, ay);
    const __m256d upper =
        _mm256_cmp_pd(lo, _mm256_mul_pd(hi, _mm256_set1_pd(0.41421356237309505)), _CMP_GT_OQ);
    const __m256d steep = _mm256_cmp_pd(ay, ax, _CMP_GT_OQ), back = _mm256_cmp_pd(x, zero, _CMP_LT_OQ);
    const __m256d num = _mm256_sub_pd(lo, _mm256_and_pd(upper, hi));
    const __m256d den = _mm256_max_pd(_mm256_add_pd(hi, _mm256_and_pd(upper, lo)),
                                      _mm256_set1_pd(DBL_MIN)); /* (0, 0) gives 0 */
    const __m256d t = _mm256_div_pd(num, den), z = _mm256_mul_pd(t, t), z2 = _mm256_mul_pd(z, z),
                  z4 = _mm256_mul_pd(z2, z2);
#define PAIR(c1, c0) _mm256_fmadd_pd(_mm256_set1_pd(c1), z, _mm256_set1_pd(c0))
    const __m256d p01 = PAIR(-0.33333333276922492141, 0.99999999999924476158);
    const __m256d p23 = PAIR(-0.14285386553752139329, 0.19999993053555813595);
    const __m256d p45 = PAIR(-0.089925529061509114781, 0.11103456908947462942);
    const __m256d p67 = PAIR(-0.037655106012914020993, 0.069741976865952651326);
#undef PAIR
    const __m256d p = _mm256_fmadd_pd(_mm256_fmadd_pd(p67, z2, p45), z4, _mm256_fmadd_pd(p23, z2, p01));
    const __m256d a = _mm256_fmadd_pd(p, t, _mm256_and_pd(upper, _mm256_set1_pd(0.78539816339744831)));
    /* pi/2 - a if steep, then pi - that if back */
    const __m256d turn = _mm256_and_pd(_mm256_xor_pd(steep, back), sign);
    const __m256d from =
        _mm256_or_pd(_mm256_and_pd(steep, _mm256_set1_pd(1.57079632679489662)),
                     _mm256_andnot_pd(steep, _mm256_and_pd(back, _mm256_set1_pd(3.14159265358979324))));
    const __m256d b = _mm256_add_pd(from, _mm256_xor_pd(a, turn));
    return _mm256_xor_pd(b, _mm256_and_pd(y, sign));
}

/* ---- places --------------------------------------------------------------------------------- */

/* The four texels around a direction in each probe, by corner (0, 0), (1, 0), (0, 1), (1, 1): bytes from the
 * probe's first texel, and weights. */
typedef struct texels {
    __m256d w[4];
    _Alignas(16) int32_t at[4][4];
    int apart; /* somewhere the second column is not the first's neighbour, but the row's first */
    int poles; /* the value is also `above` and `below` parts of the poles' means */
    __m256d above, below;
} texels;

/* As ilf_eval.c's find_place. */
INLINE_AVX2 void find_texels(texels *t, const ilf *f, __m256d theta, __m256d phi, __m256d w)
{
    const __m256d zero = _mm256_setzero_pd(), one = _mm256_set1_pd(1), two = _mm256_set1_pd(2);
    const __m256d last = _mm256_set1_pd(f->last_row);

    /* columns: theta wraps; fx lies in [-1/2, n_theta - 1/2] */
    const __m256d fx =
        _mm256_fmadd_pd(theta, _mm256_set1_pd(f->columns_per_radian), _mm256_set1_pd(f->column_ahead));
    const __m256d fx0 = _mm256_floor_pd(fx), a = _mm256_sub_pd(fx, fx0);
    const __m128i n = _mm_set1_epi32(f->info.n_theta), x = _mm256_cvttpd_epi32(fx0),
                  next = _mm_add_epi32(x, _mm_set1_epi32(1));
    const __m128i before = _mm_srai_epi32(x, 31), after = _mm_cmpeq_epi32(next, n),
                  step = _mm_set1_epi32((int)f->pixel_bytes);
    const __m128i x0 = _mm_mullo_epi32(_mm_add_epi32(x, _mm_and_si128(before, n)), step);
    const __m128i x1 = _mm_mullo_epi32(_mm_andnot_si128(after, next), step);
    t->apart = _mm_movemask_epi8(_mm_or_si128(before, after));

    /* rows: towards a pole the value goes to the mean of the nearest row */
    phi = _mm256_min_pd(phi, _mm256_set1_pd(f->info.polar_valid));
    const __m256d fy = _mm256_fmadd_pd(phi, _mm256_set1_pd(f->rows_per_radian), _mm256_set1_pd(-0.5));
    const __m256d held = _mm256_min_pd(_mm256_max_pd(fy, zero), last), fy0 = _mm256_floor_pd(held),
                  b = _mm256_sub_pd(held, fy0);
    const __m128i y = _mm256_cvttpd_epi32(fy0), row = _mm_set1_epi32((int)f->row_bytes);
    const __m128i y0 = _mm_mullo_epi32(y, row);
    const __m128i y1 = _mm_mullo_epi32(
        _mm_min_epi32(_mm_add_epi32(y, _mm_set1_epi32(1)), _mm_set1_epi32(f->info.n_phi - 1)), row);
    t->poles = _mm256_movemask_pd(_mm256_cmp_pd(fy, held, _CMP_NEQ_OQ));
    if (__builtin_expect(t->poles, 0)) {
        const __m256d part_above =
            _mm256_min_pd(_mm256_mul_pd(_mm256_max_pd(_mm256_sub_pd(zero, fy), zero), two), one);
        const __m256d part_below =
            _mm256_min_pd(_mm256_mul_pd(_mm256_max_pd(_mm256_sub_pd(fy, last), zero), two),
                          _mm256_set1_pd(f->full_sphere ? 1 : 0));
        t->above = _mm256_mul_pd(w, part_above);
        t->below = _mm256_mul_pd(w, part_below);
        w = _mm256_sub_pd(_mm256_sub_pd(w, t->above), t->below);
    }
    const __m256d second = _mm256_mul_pd(w, b), first = _mm256_sub_pd(w, second);
    t->w[1] = _mm256_mul_pd(first, a);
    t->w[0] = _mm256_sub_pd(first, t->w[1]);
    t->w[3] = _mm256_mul_pd(second, a);
    t->w[2] = _mm256_sub_pd(second, t->w[3]);
    _mm_store_si128((__m128i *)(void *)t->at[0], _mm_add_epi32(y0, x0));
    _mm_store_si128((__m128i *)(void *)t->at[1], _mm_add_epi32(y0, x1));
    _mm_store_si128((__m128i *)(void *)t->at[2], _mm_add_epi32(y1, x0));
    _mm_store_si128((__m128i *)(void *)t->at[3], _mm_add_epi32(y1, x1));
}

/* ---- texels --------------------------------------------------------------------------------- */

/* One order of sums for all of them, in double: however a field is stored, the same texels give the same
 * bits.  Of each channel, for each of the four corners the probes one after the other; then the rows; then
 * the columns. */
typedef enum layout { HALF_PLANAR, HALF_TOGETHER, FLOAT_PLANAR, FLOAT_TOGETHER } layout;

/* Weights by row of corners, probe, column. */
typedef struct weights {
    _Alignas(32) double of[2][4][2];
} weights;

INLINE_AVX2 void spread_weights(weights *w, const texels *t)
{
    UNROLL
    for (int row = 0; row < 2; row++) {
        const __m256d even = _mm256_unpacklo_pd(t->w[2 * row], t->w[2 * row + 1]),
                      odd = _mm256_unpackhi_pd(t->w[2 * row], t->w[2 * row + 1]);
        _mm256_store_pd(w->of[row][0], _mm256_permute2f128_pd(even, odd, 0x20));
        _mm256_store_pd(w->of[row][2], _mm256_permute2f128_pd(even, odd, 0x31));
    }
}

/* One texel as another value, R, G, B.  Read from one value before the first, so that nothing beyond the last
 * is read (before the probe's first lies its tile's head, or memory set aside). */
INLINE_AVX2 __m256d texel_together(const unsigned char *p, layout how)
{
    if (how == HALF_TOGETHER)
        return _mm256_cvtps_pd(_mm_cvtph_ps(_mm_loadl_epi64((const __m128i *)(const void *)(p - 2))));
    return _mm256_cvtps_pd(_mm_loadu_ps((const float *)(const void *)(p - 4)));
}

/* Radiance in the upper three lanes. */
INLINE_AVX2 __m256d sum_together(const unsigned char *const pix[4], const texels *t, const weights *w,
                                 layout how, int depth)
{
    __m256d s[2][2];

    UNROLL
    for (int c = 0; c < 4; c++) {
        __m256d sum = _mm256_setzero_pd();
        UNROLL
        for (int k = 0; k < 4; k++)
            sum = _mm256_fmadd_pd(texel_together(pix[k] + t->at[c][depth ? k : 0], how),
                                  _mm256_broadcast_sd(&w->of[c >> 1][k][c & 1]), sum);
        s[c >> 1][c & 1] = sum;
    }
    return _mm256_add_pd(_mm256_add_pd(s[0][0], s[1][0]), _mm256_add_pd(s[0][1], s[1][1]));
}

/* Two halves of a channel in one word, the first low. */
INLINE_AVX2 int pair(const unsigned char *channel, int32_t x0, int32_t x1, int apart)
{
    uint32_t both;

    if (!apart) memcpy(&both, channel + x0, 4);
    else {
        uint16_t a, b;
        memcpy(&a, channel + x0, 2);
        memcpy(&b, channel + x1, 2);
        both = (uint32_t)a | (uint32_t)b << 16;
    }
    return (int)both;
}

/* Two floats of a channel, low. */
INLINE_AVX2 __m128 pair_float(const unsigned char *channel, int32_t x0, int32_t x1, int apart)
{
    if (!apart) return _mm_castsi128_ps(_mm_loadl_epi64((const __m128i *)(const void *)(channel + x0)));
    float v[2];
    memcpy(&v[0], channel + x0, 4);
    memcpy(&v[1], channel + x1, 4);
    return _mm_setr_ps(v[0], v[1], 0, 0);
}

/* The same texel of both columns: two others, R R; G G, B B. */
INLINE_AVX2 void two_planar(__m128 to[2], const unsigned char *p, const int32_t at[2][4], int k, int apart,
                            const ilf *f, layout how)
{
    const unsigned char *r = p + f->chan_offset[0], *g = p + f->chan_offset[1], *b = p + f->chan_offset[2];
    const int32_t x0 = at[0][k], x1 = at[1][k];

    if (how == HALF_PLANAR) {
        const __m256 all = _mm256_cvtph_ps(
            _mm_setr_epi32(0, pair(r, x0, x1, apart), pair(g, x0, x1, apart), pair(b, x0, x1, apart)));
        to[0] = _mm256_castps256_ps128(all);
        to[1] = _mm256_extractf128_ps(all, 1);
    } else {
        to[0] = _mm_movelh_ps(_mm_setzero_ps(), pair_float(r, x0, x1, apart));
        to[1] = _mm_movelh_ps(pair_float(g, x0, x1, apart), pair_float(b, x0, x1, apart));
    }
}

INLINE_AVX2 __m256d sum_planar(const ilf *f, const unsigned char *const pix[4], const texels *t,
                               const weights *w, layout how, int depth, int apart)
{
    __m256d s[2][2];

    UNROLL
    for (int row = 0; row < 2; row++) {
        s[row][0] = s[row][1] = _mm256_setzero_pd();
        UNROLL
        for (int k = 0; k < 4; k++) {
            const __m256d both = _mm256_broadcast_pd((const __m128d *)(const void *)w->of[row][k]);
            __m128 v[2];
            two_planar(v, pix[k], &t->at[2 * row], depth ? k : 0, apart, f, how);
            s[row][0] = _mm256_fmadd_pd(_mm256_cvtps_pd(v[0]), both, s[row][0]);
            s[row][1] = _mm256_fmadd_pd(_mm256_cvtps_pd(v[1]), both, s[row][1]);
        }
    }
    /* first and second column side by side: . . R R, G G B B */
    const __m256d sum =
        _mm256_hadd_pd(_mm256_add_pd(s[0][0], s[1][0]), _mm256_add_pd(s[0][1], s[1][1])); /* . G R B */
    return _mm256_permute4x64_pd(sum, 0xd8);
}

AVX2 __attribute__((noinline, cold)) static void add_poles(float rgb[3], const ilf *f, const int64_t m[4],
                                                           __m256d above, __m256d below)
{
    double part[2][4];

    _mm256_storeu_pd(part[0], above);
    _mm256_storeu_pd(part[1], below);
    for (int c = 0; c < 3; c++) {
        double s = (double)rgb[c];
        for (int k = 0; k < 4; k++)
            s += part[0][k] * (double)f->probes[m[k]].pole[0][c] +
                 part[1][k] * (double)f->probes[m[k]].pole[1][c];
        rgb[c] = (float)s;
    }
}

/* ---- the lookup ----------------------------------------------------------------------------- */

__attribute__((noinline, cold)) static ilf_status read_probes(const ilf *f, const int64_t m[4],
                                                              ilf_error *err)
{
    ilf_status st = ILF_OK;

    for (int k = 0; k < 4 && st == ILF_OK; k++) st = ilf_need_probe(f, m[k], err);
    return st;
}

INLINE_AVX2 double along(const double axis[3], double x, double y, double z)
{
    return __builtin_fma(axis[2], z, __builtin_fma(axis[1], y, axis[0] * x));
}

INLINE_AVX2 __m256d twice(__m128d a)
{
    return _mm256_set_m128d(a, a);
}

INLINE_AVX2 int lookup(float rgb[3], const ilf *f, const ilf_frame *fr, const double from[3],
                       const double dir[3], ilf_error *err, int depth, layout how)
{
    const double du = along(fr->u, dir[0], dir[1], dir[2]), dv = along(fr->v, dir[0], dir[1], dir[2]),
                 dn = along(fr->n, dir[0], dir[1], dir[2]);
    const double x = from[0] - fr->origin[0], y = from[1] - fr->origin[1], z = from[2] - fr->origin[2];
    const double hu = along(fr->u, x, y, z), hv = along(fr->v, x, y, z), hn = along(fr->n, x, y, z);
    /* NaN if any coordinate is not finite */
    const double r2 = __builtin_fma(du, du, dv * dv);
    const double squares = __builtin_fma(hu, hu, __builtin_fma(hv, hv, hn * hn)) + __builtin_fma(dn, dn, r2);

    if (!(squares < 1e200) || !(fr->len_u + fr->len_v < 1e100) || (depth && !(fabs(hn) > 1e-100)))
        return ILF_UNUSUAL;
    if (!(dn > 1e-100)) {
        if (!(dn < 0)) return ILF_UNUSUAL;
        rgb[0] = rgb[1] = rgb[2] = 0; /* no light from below the plane */
        return ILF_OK;
    }

    /* back to the plane, and the grid's cell there */
    const double back = hn / dn;
    const __m128d p = _mm_fnmadd_pd(_mm_setr_pd(du, dv), _mm_set1_pd(back), _mm_setr_pd(hu, hv));
    const __m128d len = _mm_setr_pd(fr->len_u, fr->len_v),
                  last = _mm_setr_pd((double)(f->info.n_u - 1), (double)(f->info.n_v - 1));
    const __m128d s = _mm_min_pd(_mm_max_pd(_mm_mul_pd(_mm_div_pd(p, len), last), _mm_setzero_pd()), last);
    const __m128i node = _mm_cvttpd_epi32(s);
    const __m128d node_f = _mm_cvtepi32_pd(node), ab = _mm_sub_pd(s, node_f);
    const int beyond = _mm_movemask_pd(
        _mm_cmpgt_pd(ab, _mm_setzero_pd())); /* else the next probe has no weight, and may not exist */
    const int64_t right = beyond & 1, up = beyond & 2 ? f->info.n_u : 0;
    const int64_t first = (int64_t)_mm_extract_epi32(node, 1) * f->info.n_u + _mm_cvtsi128_si32(node);
    const int64_t m[4] = {first, first + right, first + up, first + right + up};
    const unsigned char *_Atomic *const all = f->pix + first;
#define READ(at) atomic_load_explicit(&all[at], memory_order_acquire)
    const unsigned char *pix[4] = {READ(0), READ(right), READ(up), READ(right + up)};

    /* again where what was read gave back another's memory */
    while (__builtin_expect(!pix[0] || !pix[1] || !pix[2] || !pix[3], 0)) {
        const ilf_status st = read_probes(f, m, err);
        if (st != ILF_OK) return (int)st;
        pix[0] = READ(0), pix[1] = READ(right), pix[2] = READ(up), pix[3] = READ(right + up);
#undef READ
    }
    const __m128d rest = _mm_sub_pd(_mm_set1_pd(1), ab);
    const __m256d wu = twice(_mm_unpacklo_pd(rest, ab));
    const __m256d wv = _mm256_set_m128d(_mm_unpackhi_pd(ab, ab), _mm_unpackhi_pd(rest, rest));
    const __m256d w = _mm256_mul_pd(wu, wv);

    __m256d theta, phi;
    texels t;
    if (depth) {
        /* the probes' places: single ones stand in the middle */
        const __m128d at = _mm_setr_pd(f->info.n_u == 1 ? 1 : 0, f->info.n_v == 1 ? 1 : 0),
                      span = _mm_setr_pd(f->span_u, f->span_v);
        const __m128d q0 = _mm_add_pd(node_f, at), q1 = _mm_add_pd(q0, _mm_set1_pd(1));
        const __m256d q =
            _mm256_div_pd(_mm256_mul_pd(_mm256_set_m128d(q1, q0), twice(len)), twice(span)); /* u0 v0 u1 v1 */
        const __m256d qu = _mm256_permute4x64_pd(q, 0x88), qv = _mm256_permute4x64_pd(q, 0xf5),
                      skew = _mm256_set1_pd(fr->cos_uv);
        const __m256d u = _mm256_fnmadd_pd(qv, skew, _mm256_sub_pd(_mm256_set1_pd(hu), qu));
        const __m256d v = _mm256_fnmadd_pd(qu, skew, _mm256_sub_pd(_mm256_set1_pd(hv), qv));
        phi = atan2_4(_mm256_sqrt_pd(_mm256_fmadd_pd(u, u, _mm256_mul_pd(v, v))), _mm256_set1_pd(hn));
        theta = atan2_4(v, u);
    } else {
        const __m128d r = _mm_sqrt_sd(_mm_setzero_pd(), _mm_set_sd(r2));
        const __m256d both = atan2_4(_mm256_castpd128_pd256(_mm_unpacklo_pd(r, _mm_set_sd(dv))),
                                     _mm256_castpd128_pd256(_mm_setr_pd(dn, du)));
        phi = _mm256_permute4x64_pd(both, 0x00);
        theta = _mm256_permute4x64_pd(both, 0x55);
    }
    find_texels(&t, f, theta, phi, w);
    weights each;
    spread_weights(&each, &t);
    const __m256d sum = how == HALF_TOGETHER || how == FLOAT_TOGETHER
                            ? sum_together(pix, &t, &each, how, depth)
                        : t.apart ? sum_planar(f, pix, &t, &each, how, depth, 1)
                                  : sum_planar(f, pix, &t, &each, how, depth, 0);
    float out[4];
    _mm_storeu_ps(out, _mm256_cvtpd_ps(sum));
    memcpy(rgb, out + 1, 3 * sizeof *rgb);
    if (__builtin_expect(t.poles, 0)) add_poles(rgb, f, m, t.above, t.below);
    return ILF_OK;
}

#define LOOKUP(name, depth, how)                                                                             \
    AVX2 static int name(float rgb[3], const ilf *f, const ilf_frame *fr, const double from[3],              \
                         const double dir[3], ilf_error *err)                                                \
    {                                                                                                        \
        return lookup(rgb, f, fr, from, dir, err, depth, how);                                               \
    }
LOOKUP(half_planar, 0, HALF_PLANAR)
LOOKUP(half_planar_depth, 1, HALF_PLANAR)
LOOKUP(half_together, 0, HALF_TOGETHER)
LOOKUP(half_together_depth, 1, HALF_TOGETHER)
LOOKUP(float_planar, 0, FLOAT_PLANAR)
LOOKUP(float_planar_depth, 1, FLOAT_PLANAR)
LOOKUP(float_together, 0, FLOAT_TOGETHER)
LOOKUP(float_together_depth, 1, FLOAT_TOGETHER)
#undef LOOKUP

/* clang before 16 has no name for f16c in __builtin_cpu_supports; that the system keeps the wide
 * registers is checked with avx2. */
static int has_f16c(void)
{
    unsigned a, b, c, d;

    return __get_cpuid(1, &a, &b, &c, &d) && (c & bit_F16C);
}

ilf_fast_fn *ilf_eval_avx2(const ilf *f, int depth)
{
    static ilf_fast_fn *const all[4][2] = {{half_planar, half_planar_depth},
                                           {half_together, half_together_depth},
                                           {float_planar, float_planar_depth},
                                           {float_together, float_together_depth}};
    const int planar = f->pixel_bytes == f->texel_bytes;

    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") || !has_f16c()) return NULL;
    return all[f->is_half ? (planar ? HALF_PLANAR : HALF_TOGETHER)
               : planar   ? FLOAT_PLANAR
                          : FLOAT_TOGETHER][depth];
}

#else

ilf_fast_fn *ilf_eval_avx2(const ilf *f, int depth)
{
    (void)f, (void)depth;
    return NULL;
}

#endif
