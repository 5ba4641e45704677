/*
 * parts.c - test driver for hdrgen's pure parts; numbers in on stdin, numbers out on stdout.
 *
 *   parts basis MAX DERIV        codes' logs v in; per line: sum of the functions, first index, the four
 *   parts lsq COLUMNS            rows "a_1 .. a_n b" in; x, then condition, rank, rss
 *   parts eliminate COLUMNS      blocks of 3 rows "u a_1 .. a_n b"; u is the block's own unknown's column
 *   parts monotone               a table's values in (code 1 on); the monotone table
 *   parts noise                  cells "n e slope relative_square" in; photon read code_var
 *   parts mosaic RGGB W H        a mosaic in; RGB after interpolation
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../../tools/hdrgen/basis.h"
#include "../../tools/hdrgen/demosaic.h"
#include "../../tools/hdrgen/noise.h"
#include "../../tools/hdrgen/qrls.h"
#include "../../tools/hdrgen/response.h"

enum { MOST = 200000 };
static double in[MOST];

static int read_all(void)
{
    int n = 0;
    while (n < MOST && scanf("%lf", &in[n]) == 1) n++;
    return n;
}

static int basis_main(double max, int deriv, int n)
{
    basis b;
    basis_init(&b, max);
    for (int i = 0; i < n; i++) {
        double f[4];
        int first = basis_eval(&b, in[i], deriv, f);
        printf("%.17g %d %.17g %.17g %.17g %.17g\n", f[0] + f[1] + f[2] + f[3], first, f[0], f[1], f[2],
               f[3]);
    }
    return 0;
}

static int lsq_main(int columns, int n, int eliminate)
{
    enum { BLOCK = 3 };
    qrls *q = qrls_new(columns);
    size_t m = (size_t)columns + 1;
    double *x = calloc(m, sizeof *x), *rows = calloc(BLOCK * m, sizeof *rows), u[BLOCK];
    qrls_facts f;
    errmsg e;
    int wide = columns + 1 + eliminate, block = eliminate ? BLOCK : 1;
    if (!q || !x || !rows) return 1;
    for (int i = 0; i + block * wide <= n; i += block * wide) {
        for (int k = 0; k < block; k++) {
            u[k] = in[i + k * wide];
            memcpy(rows + (size_t)k * m, in + i + k * wide + eliminate, m * sizeof *rows);
        }
        if (eliminate) {
            if (qrls_add_eliminating(q, rows, u, block)) return 1;
        } else memcpy(qrls_row(q), rows, m * sizeof *rows);
    }
    if (qrls_solve(q, x, 1e-13, &f, &e)) {
        fprintf(stderr, "%s\n", e.text);
        return 1;
    }
    for (int j = 0; j < columns; j++) printf("%.17g ", x[j]);
    printf("%.17g %d %.17g\n", f.condition, f.rank, f.rss);
    qrls_free(q);
    free(x);
    free(rows);
    return 0;
}

static int monotone_main(int n)
{
    response r;
    errmsg e;
    if (response_alloc(&r, 1, n, &e)) return 1;
    memcpy(r.finv[0] + 1, in, (size_t)n * sizeof *in);
    printf("%d\n", response_make_monotone(&r, 0));
    for (int z = 0; z <= n; z++) printf("%.17g\n", r.finv[0][z]);
    response_free(&r);
    return 0;
}

static int noise_main(int n)
{
    noise_model m = noise_default();
    noise_cell *c = calloc((size_t)n / 4 + 1, sizeof *c);
    for (int i = 0; c && i < n / 4; i++)
        c[i] = (noise_cell){in[4 * i], in[4 * i + 1], in[4 * i + 2], in[4 * i + 3]};
    int bad = c ? noise_fit(&m, c, n / 4, NULL) : 1;
    printf("%d %.17g %.17g %.17g\n", bad, m.photon, m.read, m.code_var);
    free(c);
    return 0;
}

static int mosaic_main(const char *order, int w, int h)
{
    cfa bayer = {.columns = 2, .rows = 2};
    errmsg e;
    size_t n = (size_t)w * (size_t)h;
    float *mosaic = calloc(n, sizeof *mosaic), *rgb = calloc(3 * n, sizeof *rgb);
    if (!mosaic || !rgb) return 1;
    for (int p = 0; p < 4; p++) bayer.colour[p] = (uint8_t)(order[p] == 'R' ? 0 : order[p] == 'G' ? 1 : 2);
    for (size_t i = 0; i < n; i++) mosaic[i] = (float)in[i];
    if (demosaic(rgb, NULL, mosaic, NULL, w, h, &bayer, &e)) return 1;
    for (size_t i = 0; i < 3 * n; i++) printf("%.9g\n", (double)rgb[i]);
    free(mosaic);
    free(rgb);
    return 0;
}

int main(int argc, char **argv)
{
    const char *what = argc > 1 ? argv[1] : "";
    int n = read_all();
    if (strcmp(what, "basis") == 0 && argc == 4) return basis_main(atof(argv[2]), atoi(argv[3]), n);
    if (strcmp(what, "lsq") == 0 && argc == 3) return lsq_main(atoi(argv[2]), n, 0);
    if (strcmp(what, "eliminate") == 0 && argc == 3) return lsq_main(atoi(argv[2]), n, 1);
    if (strcmp(what, "monotone") == 0) return monotone_main(n);
    if (strcmp(what, "noise") == 0) return noise_main(n);
    if (strcmp(what, "mosaic") == 0 && argc == 5) return mosaic_main(argv[2], atoi(argv[3]), atoi(argv[4]));
    return 2;
}
