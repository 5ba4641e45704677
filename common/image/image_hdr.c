/*
 * image_hdr.c - reading Radiance pictures.
 *
 * A text header up to an empty line, a resolution line, then scan lines of four bytes a pixel
 * (R, G, B or X, Y, Z, and a common exponent), each line flat, in old run lengths (a pixel
 * 1 1 1 n repeats the last one) or in new ones (2 2 w w, then four runs of bytes).
 * A byte c with exponent e stands for (c + 1/2)·2^(e - 136), as in Radiance.
 *
 * Radiance = value / (product of all EXPOSURE lines), and per channel / COLORCORR.  The product of all
 * PIXASPECT lines is a pixel's height over its width.  XYZE values are photometric: Y in cd/m², so RGB =
 * M·XYZ / 179 with the matrix of Radiance's primaries.
 */
#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/remark.h"
#include "image_internal.h"

enum { HEADER_MAX = 1 << 20, LINE_MAX_BYTES = 4096, RLE_MIN = 8, RLE_MAX = 32767 };

typedef struct hdr_state {
    int xyz, recolour;
    img_order order;
    int length;          /* pixels in a stored line */
    double scale[3];     /* value -> radiance */
    double to_rgb[3][3]; /* XYZE, and other primaries than Radiance's */
    float power[256];    /* of the exponent byte */
    unsigned char *line; /* 4 bytes a pixel */
    void *held;
} hdr_state;

/* Some tools put lines before "#?RADIANCE", so that any line of the header may tell. */
static int hdr_sniff(const unsigned char *head, size_t n)
{
    static const char format[] = "FORMAT=32-bit_rle_";
    if (n >= 2 && head[0] == '#' && head[1] == '?') return 1;
    for (size_t i = 0; i < n && head[i]; i++) {
        if (i > 0 && head[i - 1] != '\n') continue;
        if (head[i] == '\n') return 0; /* the header's end */
        if (n - i >= 10 && memcmp(head + i, "#?RADIANCE", 10) == 0) return 1;
        if (n - i >= sizeof format - 1 && memcmp(head + i, format, sizeof format - 1) == 0) return 1;
    }
    return 0;
}

/* ---- header ------------------------------------------------------------------------------------ */

/* One line without its end, cut at the buffer's size; returns bytes read or -1 at the end. */
static long read_line(FILE *f, char *buf, size_t size)
{
    long n = 0;
    size_t kept = 0;
    int c;
    while ((c = getc_unlocked(f)) != EOF && n < HEADER_MAX) {
        n++;
        if (c == '\n') break;
        if (kept + 1 < size) buf[kept++] = (char)c;
    }
    while (kept > 0 && buf[kept - 1] == '\r') kept--;
    buf[kept] = 0;
    return c == EOF ? -1 : n;
}

/* Numbers after "NAME="; all must be there, finite and positive. */
static int positive_numbers(const char *s, double *v, int n)
{
    for (int i = 0; i < n; i++) {
        char *end;
        v[i] = strtod(s, &end);
        if (end == s || !isfinite(v[i]) || !(v[i] > 0)) return -1;
        s = end;
    }
    return 0;
}

/* The last such line counts.  XYZE has none of its own. */
static int primaries_line(img_reader *r, hdr_state *s, const char *line, errmsg *e)
{
    double xy[8];
    const char *p = line + 10;
    for (int i = 0; i < 8; i++) {
        char *end;
        xy[i] = strtod(p, &end);
        if (end == p || !isfinite(xy[i]))
            return img_bad(r, e, "expected PRIMARIES= with eight numbers, found '%.100s'", line);
        p = end;
    }
    s->recolour = img_primaries(s->to_rgb, xy);
    return s->recolour < 0
               ? img_bad(r, e, "expected PRIMARIES= that make a colour space, found '%.100s'", line)
               : 0;
}

static int header_line(img_reader *r, hdr_state *s, const char *line, errmsg *e)
{
    double v[3];
    if (strncmp(line, "FORMAT=", 7) == 0) {
        const char *name = line + 7 + strspn(line + 7, " \t");
        if (strncmp(name, "32-bit_rle_xyze", 15) == 0) s->xyz = 1;
        else if (strncmp(name, "32-bit_rle_rgbe", 15) != 0)
            return img_bad(r, e, "expected FORMAT=32-bit_rle_rgbe or 32-bit_rle_xyze, found '%.100s'", line);
    } else if (strncmp(line, "EXPOSURE=", 9) == 0) {
        if (positive_numbers(line + 9, v, 1) < 0)
            return img_bad(r, e, "expected EXPOSURE= with a positive number, found '%.100s'", line);
        for (int i = 0; i < 3; i++) s->scale[i] /= v[0];
    } else if (strncmp(line, "COLORCORR=", 10) == 0) {
        if (positive_numbers(line + 10, v, 3) < 0)
            return img_bad(r, e, "expected COLORCORR= with three positive numbers, found '%.100s'", line);
        for (int i = 0; i < 3; i++) s->scale[i] /= v[i];
    } else if (strncmp(line, "PIXASPECT=", 10) == 0) {
        if (positive_numbers(line + 10, v, 1) < 0)
            return img_bad(r, e, "expected PIXASPECT= with a positive number, found '%.100s'", line);
        r->info.pixel_aspect *= v[0];
    } else if (strncmp(line, "aperture=", 9) ==
               0) { /* as hdrgen writes it; nothing hangs on it being a number */
        if (positive_numbers(line + 9, v, 1) == 0) r->info.f_number = v[0];
    } else if (strncmp(line, "isoSpeed=", 9) == 0) {
        if (positive_numbers(line + 9, v, 1) == 0) r->info.iso = v[0];
    } else if (strncmp(line, "PRIMARIES=", 10) == 0) {
        return primaries_line(r, s, line, e);
    }
    return 0; /* every other line is somebody else's */
}

/* "-Y H +X W" and its seven sisters: the slow axis first, + is towards the right and the top. */
static int resolution_line(img_reader *r, hdr_state *s, const char *line, errmsg *e)
{
    char sign[2], axis[2], extra;
    long size[2];
    int n = sscanf(line, "%c%c %ld %c%c %ld %c", &sign[0], &axis[0], &size[0], &sign[1], &axis[1], &size[1],
                   &extra);
    int ok = n == 6;
    for (int i = 0; ok && i < 2; i++)
        ok = (sign[i] == '+' || sign[i] == '-') && (axis[i] == 'X' || axis[i] == 'Y');
    if (!ok || axis[0] == axis[1])
        return img_bad(r, e, "expected a resolution like '-Y 480 +X 640', found '%.100s'", line);
    int x = axis[0] == 'X' ? 0 : 1;
    s->order.columns = x == 0;
    s->order.flip_x = sign[x] == '-';
    s->order.flip_y = sign[1 - x] == '+';
    if (img_set_info(r, size[x], size[1 - x], 3, 0, e) < 0) return -1;
    s->length = (int)size[1];
    return 0;
}

/* RGB = M·XYZ: the inverse of the matrix whose columns are the primaries' XYZ, scaled so that
 * (1, 1, 1) is white of Y = 1. */
static void xyz_matrix(double to_rgb[3][3])
{
    static const double xy[3][2] = {{0.640, 0.330}, {0.290, 0.600}, {0.150, 0.060}}; /* Radiance's */
    double p[3][3], inv[3][3], white[3] = {1, 1, 1}; /* equal-energy white: X = Y = Z */
    for (int c = 0; c < 3; c++) {
        p[0][c] = xy[c][0] / xy[c][1];
        p[1][c] = 1;
        p[2][c] = (1 - xy[c][0] - xy[c][1]) / xy[c][1];
    }
    double det = 0;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) { /* cofactors of cyclic indices carry their sign */
            int a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
            inv[i][j] = p[a][c] * p[b][d] - p[a][d] * p[b][c];
        }
    }
    for (int j = 0; j < 3; j++) det += p[0][j] * inv[j][0];
    for (int i = 0; i < 3; i++) {
        double y = 0; /* luminance of primary i in white */
        for (int j = 0; j < 3; j++) y += inv[i][j] / det * white[j];
        for (int j = 0; j < 3; j++) to_rgb[i][j] = inv[i][j] / det / y / 179;
    }
}

static int hdr_open(img_reader *r, errmsg *e)
{
    char line[LINE_MAX_BYTES];
    long total = 0;
    hdr_state *s = r->state = calloc(1, sizeof *s);
    if (!s) return img_bad(r, e, "out of memory");
    for (int i = 0; i < 3; i++) s->scale[i] = 1;
    for (;;) {
        long n = read_line(r->f, line, sizeof line);
        total += n;
        if (n < 0)
            return img_bad(r, e, "expected a header that ends in an empty line, found the end of the file");
        if (total > HEADER_MAX)
            return img_bad(r, e, "expected a header of at most %d bytes, found more", HEADER_MAX);
        if (!line[0]) break;
        if (header_line(r, s, line, e) < 0) return -1;
    }
    if (read_line(r->f, line, sizeof line) < 0)
        return img_bad(r, e, "expected a resolution line, found the end of the file");
    if (resolution_line(r, s, line, e) < 0) return -1;
    for (int i = 0; i < 3; i++)
        if (!isfinite(s->scale[i]) || !(s->scale[i] > 0))
            return img_bad(r, e, "EXPOSURE lines multiply out of range");
    if (s->xyz) xyz_matrix(s->to_rgb);
    else if (s->recolour)
        remark(
            r->path,
            "colours converted from its own primaries to Rec. 709's, through XYZ without adapting the white");
    for (int i = 1; i < 256; i++) s->power[i] = ldexpf(1, i - 136);
    s->line = malloc((size_t)s->length * 4);
    return s->line ? 0 : img_bad(r, e, "out of memory");
}

static int hdr_fact(img_reader *r, const char *name, char *text, size_t room)
{
    char line[LINE_MAX_BYTES];
    size_t n = strlen(name);
    int found = 0;
    off_t back = ftello(r->f);
    rewind(r->f);
    while (!found && read_line(r->f, line, sizeof line) >= 0 && line[0])
        if (strncmp(line, name, n) == 0 && line[n] == '=') {
            snprintf(text, room, "%s", line + n + 1 + strspn(line + n + 1, " "));
            found = 1;
        }
    fseeko(r->f, back, SEEK_SET);
    return found;
}

static void hdr_close(img_reader *r)
{
    hdr_state *s = r->state;
    if (!s) return;
    free(s->line);
    free(s->held);
    free(s);
}

/* ---- scan lines ---------------------------------------------------------------------------------- */

static int cut_short(img_reader *r, errmsg *e)
{
    return img_bad(r, e, "expected %dx%d pixels, found the end of the file", r->info.width, r->info.height);
}

/* From pixel x on, flat or in old run lengths; first holds the pixel that is read already. */
static int old_line(img_reader *r, hdr_state *s, unsigned char first[4], errmsg *e)
{
    int x = 0, shift = 0;
    unsigned char p[4];
    memcpy(p, first, 4);
    for (;;) {
        if (p[0] == 1 && p[1] == 1 && p[2] == 1) { /* repeat; counts of several in a row make one number */
            int64_t run = shift < 32 ? (int64_t)p[3] << shift : INT64_MAX;
            if (x == 0 || run > s->length - x) return img_bad(r, e, "broken run length in a scan line");
            for (; run > 0; run--, x++) memcpy(s->line + 4 * (size_t)x, s->line + 4 * (size_t)(x - 1), 4);
            shift += 8;
        } else {
            memcpy(s->line + 4 * (size_t)x++, p, 4);
            shift = 0;
        }
        if (x == s->length) return 0;
        if (fread(p, 1, 4, r->f) != 4) return cut_short(r, e);
    }
}

static int new_line(img_reader *r, hdr_state *s, errmsg *e)
{
    for (int c = 0; c < 4; c++) {
        for (int x = 0; x < s->length;) {
            int code = getc_unlocked(r->f), value = 0;
            if (code == EOF) return cut_short(r, e);
            int run = code > 128 ? code - 128 : code;
            if (run == 0 || run > s->length - x) return img_bad(r, e, "broken run length in a scan line");
            if (code > 128) value = getc_unlocked(r->f);
            for (; run > 0; run--, x++) {
                if (code <= 128) value = getc_unlocked(r->f);
                if (value == EOF) return cut_short(r, e);
                s->line[4 * (size_t)x + (size_t)c] = (unsigned char)value;
            }
        }
    }
    return 0;
}

/* The next stored line as radiance. */
static int hdr_line(img_reader *r, float *out, errmsg *e)
{
    hdr_state *s = r->state;
    unsigned char p[4];
    if (fread(p, 1, 4, r->f) != 4) return cut_short(r, e);
    int is_new = s->length >= RLE_MIN && s->length <= RLE_MAX && p[0] == 2 && p[1] == 2 && !(p[2] & 0x80);
    if (is_new && ((p[2] << 8) | p[3]) != s->length)
        return img_bad(r, e, "expected a scan line of %d pixels, found %d", s->length, (p[2] << 8) | p[3]);
    if ((is_new ? new_line(r, s, e) : old_line(r, s, p, e)) < 0) return -1;
    for (int x = 0; x < s->length; x++) {
        const unsigned char *b = s->line + 4 * (size_t)x;
        double f = (double)s->power[b[3]], v[3] = {(b[0] + 0.5) * f, (b[1] + 0.5) * f, (b[2] + 0.5) * f};
        for (int i = 0; i < 3; i++) {
            double c = v[i];
            if (s->xyz || s->recolour)
                c = s->to_rgb[i][0] * v[0] + s->to_rgb[i][1] * v[1] + s->to_rgb[i][2] * v[2];
            out[3 * x + i] = (float)(c * s->scale[i]);
        }
    }
    return 0;
}

static int hdr_row(img_reader *r, float *row, errmsg *e)
{
    hdr_state *s = r->state;
    if (!s->order.columns && !s->order.flip_x && !s->order.flip_y) return hdr_line(r, row, e);
    int w = r->info.width, h = r->info.height;
    if (!s->held && img_hold(&s->held, 4, r, w, h, 3, s->order, hdr_line, e) < 0) return -1;
    img_held(row, s->held, 4, (size_t)r->y * (size_t)w * 3, (size_t)w * 3);
    return 0;
}

const img_codec img_codec_hdr = {"hdr", hdr_sniff, hdr_open, hdr_row, hdr_close, hdr_fact};
