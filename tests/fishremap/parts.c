/*
 * parts.c - test driver for fishremap's pure parts; numbers in on stdin, numbers out on stdout.
 *
 *   parts nnls ROWS COLUMNS     rows "a_1 .. a_n b", any number of systems one after the other; a line x each
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../../tools/fishremap/nnls.h"

static int nnls_main(int m, int n)
{
    double *a = calloc((size_t)m * (size_t)n, sizeof *a), *b = calloc((size_t)m, sizeof *b),
           *x = calloc((size_t)n, sizeof *x);
    int bad = !a || !b || !x, more = 1;
    while (!bad && more) {
        for (int i = 0; i < m && more; i++) {
            for (int k = 0; k < n && more; k++) more = scanf("%lf", &a[i * n + k]) == 1;
            more = more && scanf("%lf", &b[i]) == 1;
        }
        if (!more) break;
        bad = nnls(x, n, a, b, m);
        for (int k = 0; k < n && !bad; k++) printf("%.17g%c", x[k], k + 1 < n ? ' ' : '\n');
    }
    free(a);
    free(b);
    free(x);
    return bad ? 1 : 0;
}

int main(int argc, char **argv)
{
    if (argc == 4 && strcmp(argv[1], "nnls") == 0) return nnls_main(atoi(argv[2]), atoi(argv[3]));
    return 2;
}
