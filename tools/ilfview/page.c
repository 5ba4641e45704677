/*
 * page.c - the page: its template with the light fields' numbers in it.
 *
 * Each light field is two elements: what it is, as JSON, and its numbers, little-endian, as base64, one array
 * after the other; the JSON says how many of each.
 */
#include "page.h"

#include <stdint.h>
#include <string.h>

/* The template as one string, from page/ (Makefile). */
static const char template[] =
#include <ilfview_page.inc>
    ;
static const char mark[] = "@DATA@";

double page_bytes(void)
{
    return (double)sizeof template + 8000;
}

/* ---- base64 ------------------------------------------------------------------------------------------ */

typedef struct coder {
    FILE *to;
    uint32_t bits;
    int held; /* bytes */
} coder;

static void put_group(coder *c, int digits)
{
    static const char alphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

    for (int k = 0; k < 4; k++) putc(k < digits ? alphabet[c->bits >> (18 - 6 * k) & 63] : '=', c->to);
    c->bits = 0, c->held = 0;
}

static void put_byte(coder *c, unsigned char b)
{
    c->bits |= (uint32_t)b << (16 - 8 * c->held);
    if (++c->held == 3) put_group(c, 4);
}

static void put_end(coder *c)
{
    if (c->held) put_group(c, c->held + 1);
}

static void put_floats(coder *c, const float *v, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        uint32_t u;
        memcpy(&u, &v[k], sizeof u);
        for (int s = 0; s < 32; s += 8) put_byte(c, (unsigned char)(u >> s));
    }
}

static void put_halves(coder *c, const uint16_t *v, size_t n)
{
    for (size_t k = 0; k < n; k++) put_byte(c, (unsigned char)v[k]), put_byte(c, (unsigned char)(v[k] >> 8));
}

/* ---- JSON -------------------------------------------------------------------------------------------- */

/* "<" would end the element that the text stands in. */
static void put_text(FILE *to, const char *s)
{
    putc('"', to);
    for (; *s; s++) {
        const unsigned char b = (unsigned char)*s;
        if (b < 32 || b == '"' || b == '\\' || b == '<' || b == '&' || b == 127) fprintf(to, "\\u%04x", b);
        else putc(b, to);
    }
    putc('"', to);
}

static void put_vector(FILE *to, const char *name, const double *v, int n)
{
    fprintf(to, ",\"%s\":[", name);
    for (int k = 0; k < n; k++) fprintf(to, "%s%.17g", k ? "," : "", v[k]);
    putc(']', to);
}

static void put_surface(FILE *to, const surface *s)
{
    static const char *const kinds[] = {"far", "sphere", "box"};

    fprintf(to, "{\"kind\":\"%s\",\"words\":", kinds[s->kind]);
    put_text(to, s->words);
    put_vector(to, "centre", s->centre, 3);
    put_vector(to, "M", &s->M[0][0], 9);
    putc('}', to);
}

static const char *last_part(const char *path)
{
    const char *slash = strrchr(path, '/');

    return slash && slash[1] ? slash + 1 : path;
}

static void put_facts(FILE *to, const content *c)
{
    const lightfield *f = &c->field;

    fprintf(to, "<script type=\"application/json\" class=\"facts\">{\"name\":");
    put_text(to, last_part(c->name));
    fprintf(to, ",\"version\":%d,\"grid\":[%d,%d],\"texels\":[%d,%d],\"stored\":[%d,%d],\"scale\":%d",
            f->info.version, f->nu, f->nv, c->nt, c->np, f->nt, f->np, c->scale);
    fprintf(to, ",\"lamps\":%d,\"masks\":%d,\"pictures\":%lld,\"light\":[%d,%d],\"coarser\":%.9g", c->n_lamps,
            c->n_masks, (long long)c->n_pictures, c->ex, c->ey, c->picture_factor);
    put_vector(to, "origin", f->frame.origin, 3);
    put_vector(to, "u", f->frame.u, 3);
    put_vector(to, "v", f->frame.v, 3);
    put_vector(to, "n", f->frame.n, 3);
    put_vector(to, "size", (double[]){f->len_u, f->len_v}, 2);
    put_vector(to, "polar", (double[]){f->polar_max, f->info.polar_valid}, 2);
    fprintf(to, ",\"surfaces\":[");
    for (int k = 0; k < c->n_surfaces; k++) {
        if (k) putc(',', to);
        put_surface(to, &c->surfaces[k]);
    }
    fprintf(to, "]}</script>\n");
}

static void put_numbers(FILE *to, const content *c)
{
    coder b = {.to = to};
    const lightfield *f = &c->field;

    fprintf(to, "<script type=\"text/plain\" class=\"numbers\">");
    put_floats(&b, c->lamp_rows, (size_t)c->n_lamps * VIEW_ROW);
    put_floats(&b, c->mask_rows, (size_t)c->n_masks * VIEW_ROW);
    put_floats(&b, c->pictures, (size_t)c->n_pictures);
    put_floats(&b, c->irradiance, (size_t)f->n * 3);
    put_floats(&b, c->lamp_light, (size_t)c->ex * (size_t)c->ey * 3);
    put_halves(&b, c->texels, (size_t)f->n * ((size_t)c->nt * (size_t)c->np + 2) * 3);
    put_end(&b);
    fprintf(to, "</script>\n");
}

void page_write(FILE *to, const content *c, int n)
{
    const char *gap = strstr(template, mark);

    fwrite(template, 1, (size_t)(gap - template), to);
    for (int k = 0; k < n; k++) put_facts(to, &c[k]), put_numbers(to, &c[k]);
    fputs(gap + strlen(mark), to);
}
