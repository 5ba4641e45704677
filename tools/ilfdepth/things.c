/*
 * things.c - what hangs in the room before its box (shell.h).
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "shell.h"

static const double pi = 3.14159265358979323846;
static const float BEFORE = 1.12f,
                   STEP = 1.35f; /* nearness over the box's: of a thing's nodes, and behind its edge */

/* The node beside (x, y); -1 below the last row. */
static int beside(const shell *h, int x, int y, int dx, int dy)
{
    const int C = h->columns;

    x += dx, y += dy;
    if (y < 0) y = -y, x += C / 2;
    return y >= h->rows ? -1 : y * C + (x + 2 * C) % C;
}

/* Give all nodes of a patch its number. */
static void flood(int *label, int *stack, const shell *h, const float *ratio, int start, int number)
{
    int top = 0;

    stack[top++] = start, label[start] = number;
    while (top) {
        const int k = stack[--top];
        for (int i = 0; i < 4; i++) {
            const int b = beside(h, k % h->columns, k / h->columns, (i == 0) - (i == 1), (i == 2) - (i == 3));
            if (b >= 0 && !label[b] && ratio[b] > BEFORE) label[b] = number, stack[top++] = b;
        }
    }
}

/* The most that the patch stands out within two nodes of a node. */
static float stands_out(const shell *h, const int *label, const float *ratio, int k)
{
    float most = 0;

    for (int i = 0; i < 25; i++) {
        const int b = beside(h, k % h->columns, k / h->columns, i % 5 - 2, i / 5 - 2);
        if (b >= 0 && label[b] == label[k]) most = fmaxf(most, ratio[b]);
    }
    return most;
}

/* Share of a patch's outline that is a step; what goes on below the last row is none. */
static double steps(const shell *h, const int *label, const float *ratio, int number)
{
    double outline = 0, step = 0;

    for (int k = 0; k < h->columns * h->rows; k++) {
        if (label[k] != number) continue;
        for (int i = 0; i < 4; i++) {
            const int b = beside(h, k % h->columns, k / h->columns, (i == 0) - (i == 1), (i == 2) - (i == 3));
            if (b >= 0 && label[b] == number) continue;
            outline++, step += b >= 0 && stands_out(h, label, ratio, k) > STEP;
        }
    }
    return outline > 0 ? step / outline : 0;
}

static double share(const shell *h, const int *label, int number)
{
    double sum = 0, all = 0;

    for (int k = 0; k < h->columns * h->rows; k++) {
        const double sr = sin(h->polar_max * (k / h->columns) / (h->rows - 1));
        all += sr, sum += label[k] == number ? sr : 0;
    }
    return sum / all * (h->polar_max > .99 * pi ? 1 : .5);
}

static void ratios(float *ratio, const shell *h, const box *b)
{
    for (int k = 0; k < h->columns * h->rows; k++) {
        double d[3];
        shell_direction(d, h, k % h->columns, k / h->columns);
        ratio[k] = h->near[k] / (float)box_near(b, h->c, d);
    }
}

/* Nodes beside a thing show some of it. */
static void widen(shell *h, const unsigned char *from)
{
    for (int k = 0; k < h->columns * h->rows; k++)
        for (int i = 0; i < 9; i++) {
            const int b = beside(h, k % h->columns, k / h->columns, i % 3 - 1, i / 3 - 1);
            if (b >= 0 && from[b]) h->thing[k] = 1;
        }
}

int shell_mark_things(shell *h, const box *b, errmsg *e)
{
    const size_t n = (size_t)h->columns * (size_t)h->rows;
    int *label = calloc(2 * n, sizeof *label), *stack = label + n, number = 0;
    float *ratio = malloc(n * sizeof *ratio);
    unsigned char *mark = calloc(n, 1);
    const int bad = label && ratio && mark ? 0 : err_set(e, "no memory for a surface");

    if (!bad) ratios(ratio, h, b);
    for (int k = 0; k < (int)n && !bad; k++) {
        if (label[k] || ratio[k] <= BEFORE) continue;
        flood(label, stack, h, ratio, k, ++number);
        if (share(h, label, number) > .15 || steps(h, label, ratio, number) < .7) continue;
        for (size_t i = 0; i < n; i++) mark[i] |= label[i] == number;
    }
    if (!bad) widen(h, mark);
    free(label), free(ratio), free(mark);
    return bad;
}

void shell_drop_things(shell *h, const shell *from, const box *b)
{
    for (int k = 0; k < h->columns * h->rows; k++) {
        double d[3];
        if (!from->thing[k]) continue;
        shell_direction(d, h, k % h->columns, k / h->columns);
        h->near[k] = (float)box_near(b, h->c, d);
        h->error[k] = .01f * h->near[k];
    }
}
