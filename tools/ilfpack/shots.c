/*
 * shots.c - see shots.h.
 *
 * A panorama whose columns are mirrored is a probe in its camera's own axes (forward, left, up): azimuth runs
 * from forward to the left.  Rows that lie below the plane's horizon, however the camera was tilted, are not
 * kept.
 */
#include "shots.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ilflamps/vec.h"
#include "image/holes.h"
#include "image/image.h"

static const double pi = 3.14159265358979323846;
#define MARGIN .06 /* radians kept below the horizon: poses may be corrected */

static int open_shot(img_reader **r, const char *path, const shotplan *how, errmsg *e)
{
    const img_open_opts opts = {.keep_aspect = 1, .layer = how->layer};

    return img_reader_open_as(r, path, &opts, e);
}

/* The polar angle at a picture's lower edge as far as its header says that it is a probe; else 0. */
static double probe_edge(img_reader *r)
{
    char text[64];
    double edge = 0;

    if (img_reader_fact(r, "ilf:polarMax", text, sizeof text)) edge = strtod(text, NULL);
    if (!(edge > 0) && img_reader_fact(r, "ilf:chart", text, sizeof text) && !strcmp(text, "probe"))
        edge = pi / 2;
    return edge > 0 && isfinite(edge) ? edge : 0;
}

static int whole_factor(int width, int height, int most)
{
    int best = 1;

    for (int k = 2; k <= height / 16; k++)
        if (height > most && width % k == 0 && height % k == 0 && height / k >= most / 2 &&
            (best == 1 || height / best > most))
            best = k;
    return best;
}

/* Look at the first picture: what all of them must be. */
static int look_first(shotfacts *facts, double *edge, const char *path, const shotplan *how, errmsg *e)
{
    img_reader *r;
    char text[64];

    memset(facts, 0, sizeof *facts);
    if (open_shot(&r, path, how, e)) return -1;
    facts->width = img_reader_info(r)->width, facts->height = img_reader_info(r)->height;
    *edge = how->polar_max > 0 ? how->polar_max : probe_edge(r);
    facts->probes = *edge > 0;
    if (!facts->probes) *edge = pi;
    if (img_reader_fact(r, "whiteLuminance", text, sizeof text)) facts->white_luminance = strtod(text, NULL);
    if (!(facts->white_luminance > 0) || !isfinite(facts->white_luminance)) facts->white_luminance = 0;
    (void)img_reader_fact(r, "owner", facts->owner, sizeof facts->owner);
    (void)img_reader_fact(r, "capDate", facts->cap_date, sizeof facts->cap_date);
    img_reader_close(r);
    if (!facts->probes && facts->width != 2 * facts->height)
        return err_set(
            e,
            "%s: expected an equirectangular panorama, twice as wide as high, found %dx%d pixels (a "
            "probe's header, or --polar-max, says that it is one)",
            path, facts->width, facts->height);
    facts->factor = whole_factor(facts->width, facts->height,
                                 facts->probes ? (int)(how->most_rows * *edge / pi) : how->most_rows);
    return 0;
}

/* ---- one picture ---------------------------------------------------------------------------------- */

/* Sums of a row of texels: colour, and what was seen of them. */
typedef struct band {
    double *rgb, *seen, all;
} band;

static void add_row(band *b, const float *row, const img_info *in, int nt, int factor, int mirror, double w,
                    int alpha)
{
    const int ch = in->channels;

    for (int x = 0; x < in->width; x++) {
        const int t = x / factor, at = mirror ? nt - 1 - t : t;
        const float *from = row + (size_t)x * (size_t)ch;
        const double share = w * (alpha ? fmax(0, (double)from[ch - 1]) : 1);
        if (!(share > 0)) continue;
        for (int c = 0; c < 3; c++) b->rgb[3 * at + c] += share * (double)from[ch < 3 ? 0 : c];
        b->seen[at] += share;
    }
    b->all += w * factor;
}

static void finish_row(float *rgb, float *seen, const band *b, int nt)
{
    for (int x = 0; x < nt; x++) {
        seen[x] = (float)(b->seen[x] / b->all);
        for (int c = 0; c < 3; c++)
            rgb[3 * x + c] = (float)(b->seen[x] > 0 ? b->rgb[3 * x + c] / b->seen[x] : 0);
    }
}

/* Rows of a reader, radiance at last. */
static int next_row(img_reader *r, img *line, errmsg *e)
{
    line->info = *img_reader_info(r);
    line->info.height = 1;
    if (img_reader_rows(r, line->pix, 1, e)) return -1;
    img_linearise_srgb(line);
    return 0;
}

static int read_texels(float *rgb, float *seen, const lightfield *f, img_reader *r, const shotfacts *facts,
                       int alpha, errmsg *e)
{
    const img_info in = *img_reader_info(r);
    img line = {.pix = malloc((size_t)in.width * (size_t)in.channels * sizeof(float))};
    double *sums = malloc((size_t)f->nt * 4 * sizeof *sums);
    int bad = line.pix && sums ? 0 : err_set(e, "no memory for a row of a picture");

    for (int y = 0; y < f->np && !bad; y++) {
        band b = {sums, sums + 3 * f->nt, 0};
        memset(sums, 0, (size_t)f->nt * 4 * sizeof *sums);
        for (int k = 0; k < facts->factor && !bad; k++) {
            bad = next_row(r, &line, e);
            const double fine = f->dp / facts->factor, p = (y * facts->factor + k) * fine;
            if (!bad)
                add_row(&b, line.pix, &in, f->nt, facts->factor, !facts->probes, cos(p) - cos(p + fine),
                        alpha);
        }
        if (!bad)
            finish_row(rgb + (size_t)y * (size_t)f->nt * 3, seen + (size_t)y * (size_t)f->nt, &b, f->nt);
    }
    free(line.pix), free(sums);
    return bad;
}

/* Remember what picture k did not see. */
static int mark(lightfield *f, int k, const float *seen, errmsg *e)
{
    const size_t texels = (size_t)f->np * (size_t)f->nt;

    if (!f->unseen) f->unseen = calloc((size_t)f->n * texels, 1);
    if (!f->unseen) return err_set(e, "no memory for holes");
    for (size_t i = 0; i < texels; i++) f->unseen[(size_t)k * texels + i] = !(seen[i] > 0);
    return 0;
}

/* Directions that a picture did not see get what is around them, for now (gaps.h). */
static int fill(lightfield *f, int k, float *seen, shotfacts *facts, const char *path, errmsg *e)
{
    const holes gaps = holes_find(seen, f->nt, f->np, f->polar_max, 0);

    if (gaps.rows == 0)
        return err_set(e, "%s: expected a picture that sees something, found alpha 0 everywhere", path);
    if (gaps.among > facts->holes) facts->holes = gaps.among, facts->holes_of = path;
    if (!(gaps.among > 0)) return 0;
    if (mark(f, k, seen, e)) return -1;
    return holes_fill(lf_texel(f, k, 0, 0), seen, f->nt, f->np, f->polar_max)
               ? err_set(e, "%s: no memory to fill its holes", path)
               : 0;
}

static int check_finite(const float *rgb, const lightfield *f, const char *path, errmsg *e)
{
    const size_t n = (size_t)f->nt * (size_t)f->np * 3;

    for (size_t k = 0; k < n; k++)
        if (!isfinite(rgb[k]))
            return err_set(e, "%s: expected finite values, found %g", path, (double)rgb[k]);
    return 0;
}

static int load_one(lightfield *f, int k, float *seen, shotfacts *facts, const char *path,
                    const shotplan *how, errmsg *e)
{
    img_reader *r;
    float *rgb = lf_texel(f, k, 0, 0);

    if (open_shot(&r, path, how, e)) return -1;
    const img_info *in = img_reader_info(r);
    const int alpha = (in->channels == 2 || in->channels == 4) && !how->ignore_alpha;
    const int probe = how->polar_max > 0 || probe_edge(r) > 0;
    int bad = 0;
    if (in->width != facts->width || in->height != facts->height)
        bad = err_set(e, "%s: expected %dx%d pixels as the first picture has, found %dx%d", path,
                      facts->width, facts->height, in->width, in->height);
    else if (probe != facts->probes)
        bad = err_set(e, "%s: expected %s as the first picture, found %s", path,
                      facts->probes ? "a probe" : "a panorama", probe ? "a probe" : "a panorama");
    if (!bad) bad = read_texels(rgb, seen, f, r, facts, alpha, e) || check_finite(rgb, f, path, e);
    img_reader_close(r);
    if (!bad && alpha) bad = fill(f, k, seen, facts, path, e);
    return bad ? -1 : 0;
}

/* ---- all of them ---------------------------------------------------------------------------------- */

void shots_stand(lightfield *f, int k, const place *at)
{
    const ilf_frame *fr = &f->frame;
    const double *axis[3] = {fr->u, fr->v, fr->n};
    double own[3][3], off[3];

    place_axes(own, at);
    v_sub(off, at->at, fr->origin);
    for (int c = 0; c < 3; c++) {
        f->pos[k][c] = v_dot(off, axis[c]);
        for (int a = 0; a < 3; a++) f->turn[k][3 * a + c] = v_dot(own[a], axis[c]);
    }
}

void shots_place(place *at, const lightfield *f, int k)
{
    const ilf_frame *fr = &f->frame;
    double own[3][3];

    for (int c = 0; c < 3; c++) {
        at->at[c] =
            fr->origin[c] + f->pos[k][0] * fr->u[c] + f->pos[k][1] * fr->v[c] + f->pos[k][2] * fr->n[c];
        for (int a = 0; a < 3; a++) {
            const double *t = f->turn[k] + 3 * a;
            own[a][c] = t[0] * fr->u[c] + t[1] * fr->v[c] + t[2] * fr->n[c];
        }
    }
    place_angles(at, own);
}

/* Rows that show what is above the horizon, whichever way cameras were tilted. */
static int rows_needed(const place *at, int n, const ilf_frame *plane, double dp, int most)
{
    double tilt = 0;

    for (int k = 0; k < n; k++) {
        double own[3][3];
        place_axes(own, &at[k]);
        tilt = fmax(tilt, acos(fmax(-1, fmin(1, v_dot(own[2], plane->n)))));
    }
    const int rows = (int)ceil((pi / 2 + tilt + MARGIN) / dp);
    return rows < most ? rows : most;
}

static void set_sizes(lightfield *f, const shotfacts *facts, double edge, const place *at, int n,
                      const ilf_frame *plane)
{
    memset(f, 0, sizeof *f);
    f->nu = f->n = n, f->nv = 1, f->free = 1;
    f->frame = *plane;
    f->len_u = plane->len_u, f->len_v = plane->len_v, f->size = fmax(f->len_u, f->len_v);
    f->nt = facts->width / facts->factor;
    f->dt = 2 * pi / f->nt, f->dp = edge / facts->height * facts->factor;
    f->np = rows_needed(at, n, plane, f->dp, facts->height / facts->factor);
    f->polar_max = f->np * f->dp;
    f->info.version = ILF_FILE_VERSION;
    for (int k = 0; k < 3; k++)
        f->info.origin[k] = (float)plane->origin[k], f->info.U[k] = (float)(plane->len_u * plane->u[k]),
        f->info.V[k] = (float)(plane->len_v * plane->v[k]);
}

int shots_load(lightfield *f, shotfacts *facts, char *const *pictures, const place *at, int n,
               const ilf_frame *plane, const shotplan *how, errmsg *e)
{
    double edge;

    if (look_first(facts, &edge, pictures[0], how, e)) return -1;
    set_sizes(f, facts, edge, at, n, plane);
    const size_t texels = (size_t)f->np * (size_t)f->nt;
    float *seen = malloc(texels * sizeof *seen);
    f->pos = malloc((size_t)n * sizeof *f->pos), f->turn = malloc((size_t)n * sizeof *f->turn);
    f->rgb = malloc((size_t)n * texels * 3 * sizeof *f->rgb);
    int bad = seen && f->pos && f->turn && f->rgb ? 0 : err_set(e, "no memory for %d pictures", n);
    for (int k = 0; k < n && !bad; k++) {
        shots_stand(f, k, &at[k]);
        bad = load_one(f, k, seen, facts, pictures[k], how, e);
    }
    free(seen);
    if (bad) lf_free(f);
    return bad;
}
