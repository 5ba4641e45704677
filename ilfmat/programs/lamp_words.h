/*
 * lamp_words.h - for ilfinfo: the lamps of a light field in words.
 */
#ifndef LAMP_WORDS_H
#define LAMP_WORDS_H

#include <math.h>
#include <stdio.h>

#include "ilf.h"

#define LAMP_PI 3.14159265358979323846

static double lamp_length(const double v[3])
{
    return hypot(v[0], hypot(v[1], v[2]));
}

/* A point of the field's coordinates in the scene's. */
static void lamp_place(double x[3], const ilf_frame *f, const double p[3])
{
    for (int k = 0; k < 3; k++) x[k] = f->origin[k] + p[0] * f->u[k] + p[1] * f->v[k] + p[2] * f->n[k];
}

static void print_lamp_body(const ilf_luminaire *l, const ilf_frame *f)
{
    double x[3];

    lamp_place(x, f, l->centre);
    if (l->shape == ILF_SPHERE) printf("sphere of radius %.4g", l->radius);
    else if (l->shape == ILF_RECTANGLE)
        printf("rectangle of %.4g x %.4g", 2 * lamp_length(l->a), 2 * lamp_length(l->b));
    else if (l->shape == ILF_DISC)
        printf("disc of radii %.4g and %.4g", lamp_length(l->a), lamp_length(l->b));
    else printf("tube of length %.4g and radius %.4g", 2 * lamp_length(l->a), l->radius);
    printf(" at %.5g %.5g %.5g%s\n", x[0], x[1], x[2], l->far ? ", infinitely far away" : "");
}

/* What a colour is called: from its share of grey, and its hue on the circle red, green, blue. */
static const char *colour_word(const float c[3])
{
    static const char *const hues[12] = {"red",  "orange", "yellow", "yellow-green", "green",   "blue-green",
                                         "cyan", "azure",  "blue",   "violet",       "magenta", "pink"};
    const double r = (double)c[0], g = (double)c[1], b = (double)c[2];
    const double most = fmax(r, fmax(g, b)), least = fmin(r, fmin(g, b));

    if (!(most > 0)) return "none";
    if (least > 0.9 * most) return "neutral";
    if (least > 0.3 * most && g < most && g > least) return r > b ? "warm" : "cool";
    const double hue = atan2(sqrt(3.) * (g - b), 2 * r - g - b) / (2 * LAMP_PI) * 12;
    return hues[(int)floor(hue + 12.5) % 12];
}

/* The beams' share of the light from the lamp's centre to a point. */
static double beam_share(const ilf_luminaire *l, const double o[3])
{
    double d[3], share = 1;

    for (int k = 0; k < 3; k++) d[k] = l->centre[k] - o[k];
    const double len = lamp_length(d);
    for (int k = 0; k < 3; k++) d[k] /= len;
    for (int k = 0; k < l->nmasks; k++)
        if (l->masks[k].kind == ILF_MASK_BEAM && !l->masks[k].adds)
            share *= ilf_mask_pass(&l->masks[k], l->centre, o, d);
    return share;
}

/* cd towards the plane's middle, and all light of the body; both as if nothing hid it. */
static void print_lamp_light(const ilf_luminaire *l, const ilf_frame *f)
{
    const double middle[3] = {f->len_u / 2, f->len_v / 2, 0}, L = 179 * ilf_luminance(l->rgb);
    const double most = fmax((double)l->rgb[0], fmax((double)l->rgb[1], (double)l->rgb[2]));
    double e[3];
    int beam = 0;

    if (L == 0 && most == 0) {
        printf("  light       put out\n");
        return;
    }
    for (int k = 0; k < 3; k++) e[k] = l->centre[k] - middle[k];
    const double far = lamp_length(e), omega = ilf_luminaire_omega(l, middle);
    for (int k = 0; k < l->nmasks; k++) beam |= l->masks[k].kind == ILF_MASK_BEAM;
    printf("  light       radiance %.5g %.5g %.5g, %.4g cd/m^2, ", (double)l->rgb[0], (double)l->rgb[1],
           (double)l->rgb[2], L);
    if (l->far) printf("%.4g lx across its rays", L * omega);
    else printf("%.4g cd towards the plane's middle", L * omega * far * far * beam_share(l, middle));
    if (!beam && !l->far)
        printf(", %.4g lm%s", LAMP_PI * L * ilf_luminaire_surface(l),
               l->shape == ILF_SPHERE || l->shape == ILF_TUBE ? " in all" : " to one side");
    printf("\n  colour      %.3g : %.3g : %.3g, %s\n", (double)l->rgb[0] / most, (double)l->rgb[1] / most,
           (double)l->rgb[2] / most, colour_word(l->rgb));
}

/* Height above the plane at which the line from the plane's middle to the lamp crosses a sheet. */
static double sheet_height(const ilf_mask *m, const double c[3], const ilf_frame *f)
{
    const double o[2] = {f->len_u / 2, f->len_v / 2};
    const double rise = c[2] - m->plane[1] * (c[0] - o[0]) - m->plane[2] * (c[1] - o[1]);

    return rise > 0 ? c[2] * (m->plane[0] + m->plane[1] * o[0] + m->plane[2] * o[1]) / rise : m->plane[0];
}

static void print_mask(const ilf_mask *m, const ilf_luminaire *l, const ilf_frame *f)
{
    const double sharp = m->beta > -1 ? l->centre[2] * m->beta / (1 + m->beta) : HUGE_VAL;
    double x[3];

    if (m->adds) printf("what the probes measured besides, between them smooth");
    else if (m->kind == ILF_MASK_LAYER) {
        const double tilt = atan(hypot(m->plane[1], m->plane[2])) * 180 / LAMP_PI;
        printf("a sheet %.4g above the plane", sheet_height(m, l->centre, f));
        if (tilt >= 0.5) printf(", tilted by %.2g degrees", tilt);
    } else if (m->kind == ILF_MASK_STACK)
        printf("sheets %.4g to %.4g above the plane, as of twigs or leaves", fmin(m->plane[0], m->plane[1]),
               fmax(m->plane[0], m->plane[1]));
    else if (m->kind == ILF_MASK_BEAM)
        printf("a beam, half as strong %.3g degrees off its axis",
               acos(pow(0.5, 1 / fmax(m->coef[3], 1))) * 180 / LAMP_PI);
    else if (m->kind == ILF_MASK_BALL) {
        lamp_place(x, f, m->coef);
        printf("a ball of radius %.4g at %.4g %.4g %.4g", m->coef[3], x[0], x[1], x[2]);
    } else {
        printf(m->kind == ILF_MASK_GATE ? "the outline of a profile spotlight" : "a picture of what arrives");
        if (isinf(sharp)) printf(", sharp at infinity");
        else if (m->beta == 0) printf(", sharp on the plane");
        else printf(", sharp %.4g %s the plane", fabs(sharp), sharp > 0 ? "above" : "below");
    }
}

static void print_lamp_masks(const ilf_luminaire *l, const ilf_frame *f)
{
    printf("  behind      ");
    for (int k = 0; k < l->nmasks; k++) {
        if (k) printf("\n              ");
        print_mask(&l->masks[k], l, f);
    }
    printf("%s\n", l->nmasks ? "" : "nothing that hides it");
}

static void print_lamp_sureness(const ilf_luminaire *l, int probes)
{
    int whole = 0, part = 0;

    if (l->error_position > 0 || l->error_radiance > 0)
        printf("  known to    %.2g of its position, %.2g %% of its radiance\n", l->error_position,
               100 * l->error_radiance);
    if (l->error_masks > 0 || l->error_interpolation > 0)
        printf(
            "  hidden      known to %.2g %% of its light, at probes left out (by interpolation: %.2g %%)\n",
            100 * l->error_masks, 100 * l->error_interpolation);
    for (int k = 0; l->seen && k < probes; k++) {
        whole += l->seen[k] > 0.9f;
        part += l->seen[k] > 0.02f && l->seen[k] <= 0.9f;
    }
    if (l->seen) printf("  seen        whole by %d of %d probes, in part by %d\n", whole, probes, part);
}

/* All lamps that were taken out of a field. */
static void print_lamps(const ilf *field)
{
    const ilf_frame *f = ilf_get_frame(field);
    const ilf_info *in = ilf_get_info(field);
    int n;
    const ilf_luminaire *l = ilf_get_luminaires(&n, field);

    if (n) printf("lamps         %d, taken out of the probes (cd, lm, lx: for a scene in metres)\n", n);
    for (int i = 0; i < n; i++) {
        printf("lamp %-9d", i + 1);
        print_lamp_body(&l[i], f);
        print_lamp_light(&l[i], f);
        print_lamp_masks(&l[i], f);
        print_lamp_sureness(&l[i], in->n_u * in->n_v);
    }
}

#endif
