/*
 * colour.c - see colour.h.
 *
 * RGB to XYZ from primaries and white: SMPTE RP 177.  BT.709 as in IEC 61966-2-1; ACEScg: AP1 primaries and
 * white of Academy S-2014-004.  The light itself is kept: no white is adapted to another, so that whoever
 * converts by the chromaticities that are written finds the same XYZ in every space (grey, which is D65's, is
 * not R = G = B in ACEScg).
 */
#include "colour.h"

#include <stddef.h>
#include <string.h>

typedef double mat[3][3];

static const float bt709[8] = {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f};
static const float ap1[8] = {0.713f, 0.293f, 0.165f, 0.830f, 0.128f, 0.044f, 0.32168f, 0.33767f};
static const float xyz[8] = {1, 0, 0, 1, 0, 0, 1.0f / 3, 1.0f / 3}; /* X, Y, Z as the primaries */

static void multiply(mat out, const mat a, const mat b)
{
    mat r;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) r[i][k] = a[i][0] * b[0][k] + a[i][1] * b[1][k] + a[i][2] * b[2][k];
    memcpy(out, r, sizeof r);
}

static void invert(mat out, const mat a)
{
    mat r;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        for (int c = 0; c < 3; c++) {
            int d = (c + 1) % 3, g = (c + 2) % 3;
            r[c][i] = a[j][d] * a[k][g] - a[j][g] * a[k][d];
        }
    }
    double det = a[0][0] * r[0][0] + a[0][1] * r[1][0] + a[0][2] * r[2][0];
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 3; c++) out[i][c] = r[i][c] / det;
}

static void white_xyz(double w[3], const float p[8])
{
    w[0] = (double)p[6] / (double)p[7];
    w[1] = 1;
    w[2] = (1 - (double)p[6] - (double)p[7]) / (double)p[7];
}

/* RGB to XYZ from primaries and white, white at Y = 1. */
static void to_xyz(mat m, const float p[8])
{
    mat prim, inv;
    double w[3];
    for (int c = 0; c < 3; c++) {
        double x = (double)p[2 * c], y = (double)p[2 * c + 1];
        prim[0][c] = x;
        prim[1][c] = y;
        prim[2][c] = 1 - x - y;
    }
    invert(inv, (const double(*)[3])prim);
    white_xyz(w, p);
    for (int c = 0; c < 3; c++) {
        double s = inv[c][0] * w[0] + inv[c][1] * w[1] + inv[c][2] * w[2];
        for (int i = 0; i < 3; i++) m[i][c] = prim[i][c] * s;
    }
}

/* Linear sRGB to `space`. */
static void from_srgb(mat m, colour_space space)
{
    mat a, b;
    memset(a, 0, sizeof a);
    a[0][0] = a[1][1] = a[2][2] = 1;
    if (space == COLOUR_XYZ || space == COLOUR_ACESCG) to_xyz(a, bt709);
    if (space == COLOUR_ACESCG) {
        to_xyz(b, ap1);
        invert(b, (const double(*)[3])b);
        multiply(a, (const double(*)[3])b, (const double(*)[3])a);
    }
    memcpy(m, a, sizeof a);
}

void colour_matrix(double m[3][3], colour_space space, const double camera_to_srgb[3][3])
{
    from_srgb(m, space);
    if (space != COLOUR_CAMERA) multiply(m, (const double(*)[3])m, camera_to_srgb);
}

const float *colour_chromaticities(colour_space space)
{
    return space == COLOUR_SRGB ? bt709 : space == COLOUR_XYZ ? xyz : space == COLOUR_ACESCG ? ap1 : NULL;
}

const char *colour_name(colour_space space)
{
    return space == COLOUR_SRGB     ? "srgb"
           : space == COLOUR_CAMERA ? "camera"
           : space == COLOUR_XYZ    ? "xyz"
           : space == COLOUR_ACESCG ? "acescg"
                                    : "as the images";
}

int colour_luminance(double weight[3], colour_space space)
{
    static const double radiance[3] = {0.265, 0.670, 0.065};
    mat m;
    if (space == COLOUR_CAMERA) return -1;
    from_srgb(m, space);
    invert(m, (const double(*)[3])m);
    for (int c = 0; c < 3; c++)
        weight[c] = radiance[0] * m[0][c] + radiance[1] * m[1][c] + radiance[2] * m[2][c];
    return 0;
}
