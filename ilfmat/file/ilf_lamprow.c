/*
 * ilf_lamprow.c - lamps and masks as rows of numbers, and what those must be.
 */
#include "ilf_lampfile.h"
#include "ilf_vec.h"

/* Lengths and radiances: squares and products of them stay far within what a double holds. */
#define LEAST 1e-30
#define MOST  1e30

/* What all masks of a lamp may let through together, times what arrives. */
#define MOST_PASS 1e6

/* A number of a row: which shapes or kinds use it (bits), whether it is whole, and its range. */
typedef struct rule {
    const char *name;
    unsigned used;
    int whole;
    double least, most;
} rule;

enum {
    SPHERE = 1 << ILF_SPHERE,
    RECTANGLE = 1 << ILF_RECTANGLE,
    DISC = 1 << ILF_DISC,
    TUBE = 1 << ILF_TUBE,
    LAYER = 1 << ILF_MASK_LAYER,
    FOOT = 1 << ILF_MASK_FOOT,
    GATE = 1 << ILF_MASK_GATE,
    BEAM = 1 << ILF_MASK_BEAM,
    STACK = 1 << ILF_MASK_STACK,
    BALL = 1 << ILF_MASK_BALL,
    PICTURE = LAYER | FOOT | STACK,
    ANY = 255
};

static const rule of_lamp[ROW_NUMBERS] = {
    {"shape", ANY, 1, 0, 3},
    {"far", ANY, 1, 0, 1},
    {"centre", ANY, 0, -MOST, MOST},
    {"centre", ANY, 0, -MOST, MOST},
    {"centre", ANY, 0, -MOST, MOST},
    {"a", RECTANGLE | DISC | TUBE, 0, -MOST, MOST},
    {"a", RECTANGLE | DISC | TUBE, 0, -MOST, MOST},
    {"a", RECTANGLE | DISC | TUBE, 0, -MOST, MOST},
    {"b", RECTANGLE | DISC, 0, -MOST, MOST},
    {"b", RECTANGLE | DISC, 0, -MOST, MOST},
    {"b", RECTANGLE | DISC, 0, -MOST, MOST},
    {"radius", SPHERE | TUBE, 0, LEAST, MOST},
    {"radiance", ANY, 0, -MOST, MOST},
    {"radiance", ANY, 0, -MOST, MOST},
    {"radiance", ANY, 0, -MOST, MOST},
    {"number of masks", ANY, 1, 0, MOST_MASKS},
    {"error of its masks", ANY, 0, 0, MOST},
    {"error of interpolation", ANY, 0, 0, MOST},
    {"error of its position", ANY, 0, 0, MOST},
    {"error of its radiance", ANY, 0, 0, MOST},
    {"number 20", 0, 0, 0, 0},
    {"number 21", 0, 0, 0, 0},
    {"number 22", 0, 0, 0, 0},
    {"number 23", 0, 0, 0, 0},
};

static const rule of_mask[ROW_NUMBERS] = {
    {"kind", ANY, 1, 0, 5},
    {"link", LAYER | FOOT, 1, 0, 1},
    {"adds", ANY, 1, 0, 1},
    {"beta", FOOT | GATE, 0, -MOST, MOST},
    {"plane[0]", LAYER | STACK, 0, -MOST, MOST},
    {"plane[1]", LAYER | STACK, 0, -MOST, MOST},
    {"plane[2]", LAYER, 0, -MOST, MOST},
    {"coef[0]", GATE | BEAM | STACK | BALL, 0, -MOST, MOST},
    {"coef[1]", GATE | BEAM | STACK | BALL, 0, -MOST, MOST},
    {"coef[2]", GATE | BEAM | BALL, 0, -MOST, MOST},
    {"coef[3]", GATE | BEAM | BALL, 0, -MOST, MOST},
    {"coef[4]", GATE | BEAM, 0, -MOST, MOST},
    {"coef[5]", GATE, 0, -MOST, MOST},
    {"nx", PICTURE, 1, 1, MOST_SIDE},
    {"ny", PICTURE, 1, 1, MOST_SIDE},
    {"nz", STACK, 1, 1, MOST_SHEETS},
    {"x0", PICTURE, 0, -MOST, MOST},
    {"y0", PICTURE, 0, -MOST, MOST},
    {"dx", PICTURE, 0, LEAST, MOST},
    {"dy", PICTURE, 0, LEAST, MOST},
    {"number 20", 0, 0, 0, 0},
    {"number 21", 0, 0, 0, 0},
    {"number 22", 0, 0, 0, 0},
    {"number 23", 0, 0, 0, 0},
};

/* Where a kind of mask asks more of a number of its row. */
static const struct {
    ilf_mask_kind kind;
    int k;
    double least, most;
} of_kind[] = {
    {ILF_MASK_BEAM, 10, 0, 1e5},      {ILF_MASK_BEAM, 11, 0, MOST_PASS}, {ILF_MASK_STACK, 4, LEAST, MOST},
    {ILF_MASK_STACK, 5, LEAST, MOST}, {ILF_MASK_STACK, 8, LEAST, MOST},  {ILF_MASK_BALL, 10, LEAST, MOST},
};

/* ---- rows ------------------------------------------------------------------------------------- */

/* Nothing of what the kind (row[0]) doesn't use. */
static void only_used(float *row, const rule *rules)
{
    for (int k = 1; k < ROW_NUMBERS; k++)
        if (!(rules[k].used >> (int)row[0] & 1)) row[k] = 0;
}

void ilf_lamp_to_row(float row[ROW_NUMBERS], const ilf_luminaire *l)
{
    memset(row, 0, ROW_NUMBERS * sizeof *row);
    row[0] = (float)l->shape, row[1] = (float)(l->far != 0);
    for (int c = 0; c < 3; c++) {
        row[2 + c] = (float)l->centre[c], row[5 + c] = (float)l->a[c], row[8 + c] = (float)l->b[c];
        row[12 + c] = l->rgb[c];
    }
    row[11] = (float)l->radius, row[15] = (float)l->nmasks;
    row[16] = (float)l->error_masks, row[17] = (float)l->error_interpolation;
    row[18] = (float)l->error_position, row[19] = (float)l->error_radiance;
    if (l->shape <= ILF_TUBE) only_used(row, of_lamp);
}

void ilf_lamp_from_row(ilf_luminaire *l, const float row[ROW_NUMBERS])
{
    memset(l, 0, sizeof *l);
    l->shape = (ilf_shape)(int)row[0], l->far = (int)row[1];
    for (int c = 0; c < 3; c++) {
        l->centre[c] = (double)row[2 + c], l->a[c] = (double)row[5 + c], l->b[c] = (double)row[8 + c];
        l->rgb[c] = row[12 + c];
    }
    l->radius = (double)row[11], l->nmasks = (int)row[15];
    l->error_masks = (double)row[16], l->error_interpolation = (double)row[17];
    l->error_position = (double)row[18], l->error_radiance = (double)row[19];
}

void ilf_mask_to_row(float row[ROW_NUMBERS], const ilf_mask *m)
{
    memset(row, 0, ROW_NUMBERS * sizeof *row);
    row[0] = (float)m->kind, row[1] = (float)m->link, row[2] = (float)(m->adds != 0), row[3] = (float)m->beta;
    for (int c = 0; c < 3; c++) row[4 + c] = (float)m->plane[c];
    for (int c = 0; c < 6; c++) row[7 + c] = (float)m->coef[c];
    row[13] = (float)m->nx, row[14] = (float)m->ny, row[15] = (float)m->nz;
    row[16] = (float)m->x0, row[17] = (float)m->y0, row[18] = (float)m->dx, row[19] = (float)m->dy;
    if (m->kind <= ILF_MASK_BALL) only_used(row, of_mask);
}

void ilf_mask_from_row(ilf_mask *m, const float row[ROW_NUMBERS])
{
    memset(m, 0, sizeof *m);
    m->kind = (ilf_mask_kind)(int)row[0], m->link = (ilf_link)(int)row[1], m->adds = (int)row[2];
    m->beta = (double)row[3];
    for (int c = 0; c < 3; c++) m->plane[c] = (double)row[4 + c];
    for (int c = 0; c < 6; c++) m->coef[c] = (double)row[7 + c];
    m->nx = (int)row[13], m->ny = (int)row[14], m->nz = (int)row[15];
    m->x0 = (double)row[16], m->y0 = (double)row[17], m->dx = (double)row[18], m->dy = (double)row[19];
}

/* ---- what they must be -------------------------------------------------------------------------- */

/* Who complains of what: "FILE: ilf:lamps: lamp 2: WHAT". */
typedef struct plaintiff {
    const char *path, *attribute, *what;
    int number;
    ilf_status status;
} plaintiff;

static ilf_status within(const plaintiff *p, const char *name, double least, double most, int whole, double v,
                         ilf_error *err)
{
    if (v >= least && v <= most && (!whole || v == floor(v))) return ILF_OK; /* NaN is not */
    if (least == most)
        return ilf_fail(err, p->status, "%s: %s: %s %d: %s: expected %g as it is not used, found %g", p->path,
                        p->attribute, p->what, p->number, name, least, v);
    return ilf_fail(err, p->status, "%s: %s: %s %d: %s: expected a %snumber from %g to %g, found %g", p->path,
                    p->attribute, p->what, p->number, name, whole ? "whole " : "", least, most, v);
}

static ilf_status check_row(const plaintiff *p, const rule *rules, const float *row, ilf_error *err)
{
    for (int k = 0; k < ROW_NUMBERS; k++) {
        const int used = k == 0 || (rules[k].used >> (int)row[0] & 1);
        const ilf_status st = within(p, rules[k].name, used ? rules[k].least : 0, used ? rules[k].most : 0,
                                     rules[k].whole, (double)row[k], err);
        if (st != ILF_OK) return st;
    }
    return ILF_OK;
}

ilf_status ilf_check_lamp_row(const float row[ROW_NUMBERS], int number, const char *path, ilf_status status,
                              ilf_error *err)
{
    const plaintiff p = {path, LAMPS_ATTRIBUTE, "lamp", number, status};
    const ilf_status st = check_row(&p, of_lamp, row, err);
    ilf_luminaire l;

    if (st != ILF_OK) return st;
    ilf_lamp_from_row(&l, row);
    const double aa = dot(l.a, l.a), bb = dot(l.b, l.b);
    const int two = l.shape == ILF_RECTANGLE || l.shape == ILF_DISC;
    if (l.shape != ILF_SPHERE && (aa < LEAST * LEAST || (two && bb < LEAST * LEAST)))
        return ilf_fail(err, status, "%s: %s: lamp %d: %s: expected a length above 0, found 0", path,
                        LAMPS_ATTRIBUTE, number, aa < LEAST * LEAST ? "a" : "b");
    if (two && fabs(dot(l.a, l.b)) > 1e-4 * sqrt(aa * bb))
        return ilf_fail(err, status,
                        "%s: %s: lamp %d: a, b: expected a right angle to 1e-4, found a cosine of %.3g", path,
                        LAMPS_ATTRIBUTE, number, dot(l.a, l.b) / sqrt(aa * bb));
    return ILF_OK;
}

ilf_status ilf_check_mask_row(const float row[ROW_NUMBERS], int number, const char *path, ilf_status status,
                              ilf_error *err)
{
    const plaintiff p = {path, MASKS_ATTRIBUTE, "mask", number, status};
    ilf_status st = check_row(&p, of_mask, row, err);

    if (st != ILF_OK) return st;
    const ilf_mask_kind kind = (ilf_mask_kind)(int)row[0];
    for (size_t i = 0; i < sizeof of_kind / sizeof *of_kind && st == ILF_OK; i++)
        if (of_kind[i].kind == kind)
            st = within(&p, of_mask[of_kind[i].k].name, of_kind[i].least, of_kind[i].most, 0,
                        (double)row[of_kind[i].k], err);
    const double axis = hypot((double)row[7], hypot((double)row[8], (double)row[9]));
    if (st == ILF_OK && kind == ILF_MASK_BEAM && fabs(axis - 1) > 1e-5)
        st =
            ilf_fail(err, status, "%s: %s: mask %d: coef[0] to [2]: expected an axis of length 1, found %.9g",
                     path, MASKS_ATTRIBUTE, number, axis);
    return st;
}

int64_t ilf_mask_samples(const ilf_mask *m)
{
    if (!(PICTURE >> m->kind & 1)) return 0;
    return (int64_t)m->nx * m->ny * (m->kind == ILF_MASK_STACK ? m->nz : 1);
}

/* ---- values --------------------------------------------------------------------------------------- */

/* Largest of a mask's picture, whatever its sign; fails where one is not finite. */
static ilf_status largest(double *most, const ilf_mask *m, int number, const char *path, ilf_status status,
                          ilf_error *err)
{
    const int64_t n = ilf_mask_samples(m);

    *most = 0;
    for (int64_t k = 0; k < n; k++) {
        if (!isfinite(m->grid[k]))
            return ilf_fail(err, status == ILF_ERR_FORMAT ? ILF_ERR_VALUE : status,
                            "%s: " MASK_PART ": sample (%lld,%lld): expected a finite value, found %g", path,
                            number, (long long)(k % m->nx), (long long)(k / m->nx), (double)m->grid[k]);
        *most = fmax(*most, fabs((double)m->grid[k]));
    }
    return ILF_OK;
}

/* What a mask lets through at most: a beam's axis may be a little longer than 1. */
static double most_of(const ilf_mask *m, double picture)
{
    if (m->kind == ILF_MASK_BEAM) return 3 * m->coef[4];
    return (m->kind == ILF_MASK_LAYER || m->kind == ILF_MASK_FOOT) && m->link == ILF_LINK_VALUE
               ? fmax(picture, 1)
               : 1;
}

static ilf_status check_seen(const ilf_luminaire *l, int number, int64_t probes, const char *path,
                             ilf_status status, ilf_error *err)
{
    for (int64_t k = 0; l->seen && k < probes; k++)
        if (!isfinite(l->seen[k]))
            return ilf_fail(err, status == ILF_ERR_FORMAT ? ILF_ERR_VALUE : status,
                            "%s: " MEASURED_PART ": " LAMP_CHANNEL
                            ": probe number %lld: expected a finite value, found %g",
                            path, number, (long long)k, (double)l->seen[k]);
    return ILF_OK;
}

ilf_status ilf_check_lamp_values(const ilf_luminaire *lamps, int n, int64_t probes, const char *path,
                                 ilf_status status, ilf_error *err)
{
    int number = 0;

    for (int i = 0; i < n; i++) {
        double product = 1, sum = 0, most;
        ilf_status st = check_seen(&lamps[i], i + 1, probes, path, status, err);
        for (int k = 0; k < lamps[i].nmasks && st == ILF_OK; k++) {
            const ilf_mask *m = &lamps[i].masks[k];
            st = largest(&most, m, ++number, path, status, err);
            if (m->adds) sum += most_of(m, most);
            else product *= most_of(m, most);
        }
        if (st != ILF_OK) return st;
        if (product + sum > 4 * MOST_PASS)
            return ilf_fail(err, status,
                            "%s: %s: lamp %d: expected masks that let through at most %g, found up to %g",
                            path, LAMPS_ATTRIBUTE, i + 1, 4 * MOST_PASS, product + sum);
    }
    return ILF_OK;
}

/* A writer's lamp: shape and kinds are numbers of the caller's. */
static ilf_status check_lamp(int64_t *samples, int *number, const ilf_luminaire *l, int which,
                             const char *path, ilf_error *err)
{
    float row[ROW_NUMBERS];

    ilf_lamp_to_row(row, l);
    ilf_status st = ilf_check_lamp_row(row, which, path, ILF_ERR_ARG, err);
    if (st == ILF_OK && l->nmasks && !l->masks)
        st = ilf_fail(err, ILF_ERR_ARG, "%s: lamp %d: expected %d masks, found none", path, which, l->nmasks);
    for (int k = 0; st == ILF_OK && k < l->nmasks; k++) {
        ilf_mask_to_row(row, &l->masks[k]);
        st = ilf_check_mask_row(row, ++*number, path, ILF_ERR_ARG, err);
        if (st != ILF_OK) break;
        *samples += ilf_mask_samples(&l->masks[k]);
        if (ilf_mask_samples(&l->masks[k]) && !l->masks[k].grid)
            st = ilf_fail(err, ILF_ERR_ARG, "%s: mask %d: expected a picture, found none", path, *number);
    }
    return st;
}

ilf_status ilf_check_lamps(const ilf_luminaire *lamps, int n, int64_t probes, const char *path,
                           ilf_error *err)
{
    int64_t samples = 0;
    int number = 0;
    ilf_status st = ILF_OK;

    if (n < 0 || n > MOST_LAMPS)
        return ilf_fail(err, ILF_ERR_ARG, "%s: lamps: expected up to %d, found %d", path, MOST_LAMPS, n);
    for (int i = 0; i < n && st == ILF_OK; i++) {
        st = check_lamp(&samples, &number, &lamps[i], i + 1, path, err);
        if (lamps[i].seen) samples += probes;
    }
    if (st == ILF_OK && samples > MOST_SAMPLES)
        st = ilf_fail(err, ILF_ERR_ARG,
                      "%s: lamps: expected pictures of at most %d samples in all, found %lld", path,
                      MOST_SAMPLES, (long long)samples);
    return st == ILF_OK ? ilf_check_lamp_values(lamps, n, probes, path, ILF_ERR_ARG, err) : st;
}
