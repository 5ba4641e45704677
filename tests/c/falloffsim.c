/*
 * falloffsim - fits of falloff curves to readings from standard input, for simulations of many lenses.
 *
 *   in:  N HALF            then N lines DEG Y, and so on
 *   out: one line a set:   used(0 or 1, N times)  then V and its relative standard deviation at 0, 1, 2 ...
 * up to HALF degrees
 */
#include "../../tools/fishremap/falloff_fit.c"
#include "../../tools/fishremap/falloff_outliers.c"
#include "../../tools/fishremap/nnls.c"

#include <stdio.h>

int main(void)
{
    int n;
    double half;
    errmsg e;
    while (scanf("%d %lf", &n, &half) == 2) {
        falloff_reading *r = calloc((size_t)n, sizeof *r);
        falloff_curve f;
        for (int i = 0; i < n; i++) {
            if (!r || scanf("%lf %lf", &r[i].theta, &r[i].y[0]) != 2) return 2;
            r[i].theta *= M_PI / 180;
        }
        if (falloff_fit(&f, r, n, 0, half * M_PI / 180, &e)) {
            fprintf(stderr, "%s\n", e.text);
            return 1;
        }
        for (int i = 0; i < n; i++) printf("%d ", r[i].used[0]);
        for (int k = 0; k <= half; k++) {
            double sd, v = falloff_curve_at(&f, k * M_PI / 180, &sd);
            printf(" %.6g %.4g", v, sd);
        }
        putchar('\n');
        free(r);
    }
    return 0;
}
