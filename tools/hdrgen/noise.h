/*
 * noise.h - how far a sample is from what it should be (Hasinoff et al. 2010, Granados et al. 2010).
 *
 * For exposure e relative to saturation (e = 1 at the highest code):
 *   variance(e) = photon * e + read^2 + code_var * (d finv / dz)^2
 * photon = 1 / (electrons at saturation), read = read noise / (electrons at saturation), and
 * code_var is the variance in the code itself: 1/12 for rounding, more where a codec adds its own.
 */
#ifndef HDRGEN_NOISE_H
#define HDRGEN_NOISE_H

typedef struct noise_model {
    double photon, read, code_var;
} noise_model;

/* A middling 8-bit camera, for series that say nothing (one image, no overlap). */
noise_model noise_default(void);

/* From a gain (electrons per code of the linearised scale) and read noise (electrons). */
noise_model noise_from_camera(double gain, double read_electrons, int max_code);

/* Variance at e where one code is `slope` wide. */
double noise_variance(const noise_model *m, double e, double slope);

/* One cell of measured scatter: n samples about exposure e with mean square relative residual. */
typedef struct noise_cell {
    double n, e, slope, relative_square;
} noise_cell;

/* Fit the three parameters, none negative and code_var >= 1/12, by weighted least squares
 * (QR over every active set).  Parameters that are >= 0 in `fixed` are kept.  -1 if there are fewer than
 * three cells to go by, -2 when out of memory; m is then left alone. */
int noise_fit(noise_model *m, const noise_cell *cells, int n, const noise_model *fixed);

#endif
