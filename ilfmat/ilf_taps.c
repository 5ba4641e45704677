/*
 * ilf_taps.c - the texels of a lookup, read and summed: up to four probes of two rows of two texels in three channels.
 *
 * Nearly all of a random lookup's time is spent waiting for these texels.  So all addresses are
 * known before the first is read, and neighbours come in one load.
 */
#include "ilf_internal.h"

#if defined(__x86_64__) && defined(__GNUC__)
#include <cpuid.h>
#include <immintrin.h>
#define HAVE_F16C_PATH 1
#endif

static inline void sum_plain(double rgb[3], const ilf *f, const ilf_tap *tap, int taps, int is_half)
{
    for (int k = 0; k < taps; k++)
        for (int c = 0; c < 3; c++) {
            const unsigned char *p = tap[k].row + f->chan_offset[c];
            rgb[c] += tap[k].w0 * ilf_texel_of(p + tap[k].x0, is_half) + tap[k].w1 * ilf_texel_of(p + tap[k].x1, is_half);
        }
}

static void sum_float(double rgb[3], const ilf *f, const ilf_tap *tap, int taps)
{
    sum_plain(rgb, f, tap, taps, 0);
}

static void sum_half(double rgb[3], const ilf *f, const ilf_tap *tap, int taps)
{
    sum_plain(rgb, f, tap, taps, 1);
}

#ifdef HAVE_F16C_PATH
/* Two halves of a channel in one word, the first texel low. */
static inline int pair(const unsigned char *p, const ilf_tap *t)
{
    uint32_t both;

    if (t->x1 == t->x0 + 2)
        memcpy(&both, p + t->x0, 4);
    else {
        uint16_t a, b;
        memcpy(&a, p + t->x0, 2);
        memcpy(&b, p + t->x1, 2);
        both = (uint32_t)a | (uint32_t)b << 16;
    }
    return (int)both;
}

/* R R G G B B in one register, converted by the processor; sums in double as everywhere. */
__attribute__((target("avx2,f16c,fma"))) static void sum_half_f16c(double rgb[3], const ilf *f, const ilf_tap *tap, int taps)
{
    __m128i raw[8];
    __m256d rg = _mm256_setzero_pd();
    __m128d bb = _mm_setzero_pd();

    for (int k = 0; k < taps; k++)
        raw[k] = _mm_setr_epi32(pair(tap[k].row + f->chan_offset[0], &tap[k]), pair(tap[k].row + f->chan_offset[1], &tap[k]),
                                pair(tap[k].row + f->chan_offset[2], &tap[k]), 0);
    for (int k = 0; k < taps; k++) {
        const __m256 v = _mm256_cvtph_ps(raw[k]);
        const __m128d w = _mm_loadu_pd(&tap[k].w0);
        rg = _mm256_fmadd_pd(_mm256_cvtps_pd(_mm256_castps256_ps128(v)), _mm256_broadcast_pd(&w), rg);
        bb = _mm_fmadd_pd(_mm_cvtps_pd(_mm256_extractf128_ps(v, 1)), w, bb);
    }
    double s[4], b[2];
    _mm256_storeu_pd(s, rg);
    _mm_storeu_pd(b, bb);
    rgb[0] += s[0] + s[1];
    rgb[1] += s[2] + s[3];
    rgb[2] += b[0] + b[1];
}
#endif

#ifdef HAVE_F16C_PATH
/* clang before 16 has no name for f16c in __builtin_cpu_supports; that the system keeps the wide
 * registers is checked with avx2. */
static int has_f16c(void)
{
    unsigned a, b, c, d;

    return __get_cpuid(1, &a, &b, &c, &d) && (c & bit_F16C);
}
#endif

ilf_sum_fn *ilf_choose_sum(int is_half)
{
    if (!is_half) return sum_float;
#ifdef HAVE_F16C_PATH
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && has_f16c()) return sum_half_f16c;
#endif
    return sum_half;
}
