/*
 * image_pnm.c - PNM (P2 P3 text, P5 P6 binary, 8 and 16 bit) as codes, and PFM (PF Pf, float,
 * bottom row first, the sign of the scale tells the byte order, its size is a factor) as radiance.
 */
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "image_internal.h"

typedef struct pnm_state {
    char kind;      /* '2' '3' '5' '6' 'f' 'F' */
    int max, bytes; /* of a code */
    int big;        /* PFM: most significant byte first */
    double factor;  /* PFM */
    int64_t data;   /* offset of the pixels */
    unsigned char *line;
} pnm_state;

static int pnm_sniff(const unsigned char *head, size_t n)
{
    return n >= 3 && head[0] == 'P' && head[1] && strchr("2356fF", head[1]) &&
           (isspace(head[2]) || head[2] == '#');
}

/* Next character that is neither space nor comment, or EOF; the byte count keeps headers short. */
static int skip_space(FILE *f, int *budget)
{
    int c, comment = 0;
    while ((c = getc_unlocked(f)) != EOF && (*budget)-- > 0) {
        if (comment) comment = c != '\n';
        else if (c == '#') comment = 1;
        else if (!isspace(c)) return c;
    }
    return EOF;
}

/* A whole number up to limit, or -1; the character after it is consumed. */
static long read_number(FILE *f, long limit, int budget)
{
    int c = skip_space(f, &budget);
    long v = 0;
    if (c == EOF || !isdigit(c)) return -1;
    for (; c != EOF && isdigit(c); c = getc_unlocked(f)) {
        v = v * 10 + (c - '0');
        if (v > limit) return -1;
    }
    return c == EOF || isspace(c) || c == '#' ? v : -1;
}

static int read_scale(FILE *f, double *scale)
{
    char word[64];
    int n = 0, budget = 1 << 16, c = skip_space(f, &budget);
    for (; c != EOF && !isspace(c) && n < (int)sizeof word - 1; c = getc_unlocked(f)) word[n++] = (char)c;
    word[n] = 0;
    char *end;
    *scale = strtod(word, &end);
    return end == word || *end || !isspace(c) || !isfinite(*scale) || *scale == 0 ? -1 : 0;
}

static int pnm_open(img_reader *r, errmsg *e)
{
    enum { HEADER_MAX = 1 << 20 };
    pnm_state *s = r->state = calloc(1, sizeof *s);
    if (!s) return img_bad(r, e, "out of memory");
    getc_unlocked(r->f);
    s->kind = (char)getc_unlocked(r->f);
    int pfm = s->kind == 'f' || s->kind == 'F', text = s->kind == '2' || s->kind == '3';
    int channels = s->kind == '3' || s->kind == '6' || s->kind == 'F' ? 3 : 1;
    long w = read_number(r->f, 1L << 40, HEADER_MAX), h = read_number(r->f, 1L << 40, HEADER_MAX), max = 0;
    if (w < 0 || h < 0) return img_bad(r, e, "broken PNM header: expected width and height");
    if (pfm) {
        double scale;
        if (read_scale(r->f, &scale) < 0)
            return img_bad(r, e, "broken PFM header: expected a scale that is not 0");
        s->big = scale > 0;
        s->factor = fabs(scale);
        s->bytes = 4;
    } else {
        max = read_number(r->f, 65535, HEADER_MAX);
        if (max < 1) return img_bad(r, e, "broken PNM header: expected a largest value of 1 to 65535");
        s->max = (int)max;
        s->bytes = max > 255 ? 2 : 1;
    }
    snprintf(r->info.format, sizeof r->info.format, pfm ? "pfm" : "pnm");
    if (img_set_info(r, w, h, channels, (double)max, e) < 0) return -1;
    s->data = ftello(r->f);
    int64_t need = text ? 2 * (int64_t)w * h * channels - 1 : (int64_t)w * h * channels * s->bytes;
    if (s->data < 0 || r->bytes - s->data < need)
        return img_bad(r, e, "expected %lld bytes of pixels, found %lld", (long long)need,
                       (long long)(r->bytes - s->data));
    if (text) return 0;
    s->line = malloc((size_t)w * (size_t)channels * (size_t)s->bytes);
    return s->line ? 0 : img_bad(r, e, "out of memory");
}

static void pnm_close(img_reader *r)
{
    pnm_state *s = r->state;
    if (s) free(s->line);
    free(s);
}

static float float_at(const unsigned char *p, int big)
{
    uint32_t u = 0;
    float v;
    for (int i = 0; i < 4; i++) u |= (uint32_t)p[big ? 3 - i : i] << (8 * i);
    memcpy(&v, &u, sizeof v);
    return v;
}

static int pnm_row(img_reader *r, float *row, errmsg *e)
{
    enum { COMMENT_MAX = 1 << 20 };
    pnm_state *s = r->state;
    size_t n = (size_t)r->info.width * (size_t)r->info.channels;
    int over = 0;
    if (s->kind == '2' || s->kind == '3') {
        for (size_t i = 0; i < n; i++) {
            long v = read_number(r->f, s->max, COMMENT_MAX);
            if (v < 0) return img_bad(r, e, "row %d: expected numbers from 0 to %d", r->y, s->max);
            row[i] = (float)v;
        }
        return 0;
    }
    if (s->factor > 0) { /* rows stand in the file from the bottom */
        int64_t at = s->data + (int64_t)(r->info.height - 1 - r->y) * (int64_t)n * 4;
        if (fseeko(r->f, at, SEEK_SET) != 0) return img_bad(r, e, "row %d: can't seek", r->y);
    }
    if (fread(s->line, (size_t)s->bytes, n, r->f) != n)
        return img_bad(r, e, "row %d: found the end of the file", r->y);
    for (size_t i = 0; i < n; i++) {
        const unsigned char *p = s->line + i * (size_t)s->bytes;
        if (s->factor > 0) {
            row[i] = (float)((double)float_at(p, s->big) * s->factor);
            continue;
        }
        int v = s->bytes == 2 ? p[0] << 8 | p[1] : p[0];
        over |= v > s->max;
        row[i] = (float)v;
    }
    return over ? img_bad(r, e, "row %d: expected values from 0 to %d, found a larger one", r->y, s->max) : 0;
}

const img_codec img_codec_pnm = {"pnm", pnm_sniff, pnm_open, pnm_row, pnm_close, NULL};
