/*
 * luminaire.c - test driver for ilfmat/lamps: luminaire
 *
 * Standard input: "shape cx cy cz  ax ay az  bx by bz  radius  ox oy oz" a line (shape 0 to 3).  Out, a line
 * each: omega   as the library says shot    by rays uniform in a cone that holds the lamp drawn   mean of
 * 1/pdf over draws that meet the lamp missed  part of draws with a pdf that do not meet it least most   of
 * pdf x omega over the draws
 */
#include <math.h>
#include <stdio.h>

#include "ilf_luminaire.h"

enum { SIDE = 400 };

static double shot(const ilf_luminaire *l, const double o[3], double cone)
{
    double e[3], len = 0, t;
    int hits = 0;

    for (int k = 0; k < 3; k++) e[k] = l->centre[k] - o[k], len += e[k] * e[k];
    ilf_luminaire round = {.shape = ILF_SPHERE, .radius = sin(cone) * sqrt(len)};
    for (int k = 0; k < 3; k++) round.centre[k] = l->centre[k];
    for (int k = 0; k < SIDE * SIDE; k++) {
        double d[3];
        ilf_luminaire_sample(d, &round, o, (k % SIDE + .5) / SIDE, (k / SIDE + .5) / SIDE);
        hits += ilf_luminaire_hit(&t, l, o, d);
    }
    return ilf_luminaire_omega(&round, o) * hits / (SIDE * SIDE);
}

static void draw(const ilf_luminaire *l, const double o[3], double omega)
{
    double sum = 0, least = 1e30, most = 0, t;
    int missed = 0;

    for (int k = 0; k < SIDE * SIDE; k++) {
        double d[3];
        const double pdf = ilf_luminaire_sample(d, l, o, (k % SIDE + .5) / SIDE, (k / SIDE + .5) / SIDE);
        if (pdf <= 0) continue;
        if (!ilf_luminaire_hit(&t, l, o, d)) missed++;
        else sum += 1 / pdf;
        least = fmin(least, pdf * omega), most = fmax(most, pdf * omega);
    }
    printf(" %.9g %.9g %.9g %.9g\n", sum / (SIDE * SIDE), (double)missed / (SIDE * SIDE), least, most);
}

int main(void)
{
    ilf_luminaire l = {0};
    double o[3];
    int shape;

    while (scanf("%d %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf %lf", &shape, &l.centre[0], &l.centre[1],
                 &l.centre[2], &l.a[0], &l.a[1], &l.a[2], &l.b[0], &l.b[1], &l.b[2], &l.radius, &o[0], &o[1],
                 &o[2]) == 14) {
        l.shape = (ilf_shape)shape;
        const double omega = ilf_luminaire_omega(&l, o);
        printf("%.9g %.9g", omega, shot(&l, o, ilf_luminaire_cone(&l, o)));
        draw(&l, o, omega);
    }
    return 0;
}
