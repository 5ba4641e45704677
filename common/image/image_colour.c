/*
 * image_colour.c - from the primaries that a file states to those that its numbers are taken for.
 *
 * The columns of P are the XYZ of the primaries, (x, y, 1 - x - y), each times what makes their sum the white
 * with Y = 1.  RGB' = P'^-1 P RGB: the light itself is kept, as XYZ, and no white is adapted to another.
 */
#include <math.h>
#include <string.h>

#include "image_internal.h"

typedef double matrix[3][3];

static const double rec709[8] = {0.640, 0.330, 0.300,  0.600,
                                 0.150, 0.060, 0.3127, 0.3290}; /* ITU-R BT.709-6 */
static const double radiance[8] = {0.640, 0.330, 0.290,  0.600,
                                   0.150, 0.060, 1 / 3., 1 / 3.}; /* its color.h */
static const double same = 1e-3;

/* inv = m^-1; cofactors of cyclic indices carry their sign.  -1 where there is none to speak of. */
static int invert(matrix inv, matrix m)
{
    double det = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
            inv[i][j] = m[a][c] * m[b][d] - m[a][d] * m[b][c];
        }
    for (int j = 0; j < 3; j++) det += m[0][j] * inv[j][0];
    if (!isfinite(det) || fabs(det) < 1e-9) return -1;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) inv[i][j] /= det;
    return 0;
}

static int to_xyz(matrix p, const double xy[8])
{
    matrix inv;
    for (int c = 0; c < 3; c++) {
        p[0][c] = xy[2 * c];
        p[1][c] = xy[2 * c + 1];
        p[2][c] = 1 - xy[2 * c] - xy[2 * c + 1];
    }
    if (!(fabs(xy[7]) > 1e-6) || invert(inv, p) < 0) return -1;
    const double white[3] = {xy[6] / xy[7], 1, (1 - xy[6] - xy[7]) / xy[7]};
    for (int c = 0; c < 3; c++) {
        double share = inv[c][0] * white[0] + inv[c][1] * white[1] + inv[c][2] * white[2];
        if (!isfinite(share) || fabs(share) < 1e-6) return -1;
        for (int k = 0; k < 3; k++) p[k][c] *= share;
    }
    return 0;
}

static int alike(const double a[8], const double b[8])
{
    for (int k = 0; k < 8; k++)
        if (!(fabs(a[k] - b[k]) < same)) return 0;
    return 1;
}

int img_primaries(double m[3][3], const double xy[8])
{
    matrix from, to, back;
    if (alike(xy, rec709) || alike(xy, radiance)) return 0;
    if (to_xyz(from, xy) < 0 || to_xyz(to, rec709) < 0 || invert(back, to) < 0) return -1;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            m[i][j] = 0;
            for (int k = 0; k < 3; k++) m[i][j] += back[i][k] * from[k][j];
        }
    return 1;
}
