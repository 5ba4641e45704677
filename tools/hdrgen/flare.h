/*
 * flare.h - light that the lens scatters around lamps: estimated from the picture itself.
 *
 * A picture is (1 - v) S + sum_j a_j G_j * S: S the scene, G_j Gaussians of growing width (mixtures of which
 * make up exponentials and power laws alike), v the sum of all a_j, * the convolution.  Where a place is
 * dark, what is seen there is at least what is scattered there: the mixture is a lower envelope of the
 * picture.  Ward's idea (the least value over that of the lamps at each distance bounds the scattering from
 * above), made a bound from below by two things: smooth real light may take what it can of the envelope (a
 * bilinear one over the picture), and the same a_j must hold around two groups of lamps, each on its own.
 * Light that surrounds one lamp is not what surrounds another.  Where no light of the scene falls (outside a
 * fisheye's circle), none of that is needed.  Pure: no I/O.
 */
#ifndef HDRGEN_FLARE_H
#define HDRGEN_FLARE_H

#include "base/errmsg.h"

enum { FLARE_MOST = 16 }; /* Gaussians, and the even veil */

typedef enum flare_verdict {
    FLARE_NONE,      /* the picture has none that could be told from its own light */
    FLARE_ONE_LAMP,  /* some would fit, but one lamp's surroundings alone say so */
    FLARE_UNSETTLED, /* lamps' surroundings disagree, or too little of the dark lies at the envelope */
    FLARE_LAMPS,     /* found: around two groups of lamps alike */
    FLARE_DARK       /* found: where no light of the scene falls */
} flare_verdict;

enum flare_kind { FLARE_SEEN, FLARE_BOUND, FLARE_NOTHING }; /* a value; a bound from above; no data */

/* width*height values >= 0 of one channel, flare_kind of each, and not 0 where no light of the scene falls.
 */
typedef struct flare_picture {
    int width, height;
    const float *light;
    const unsigned char *kind, *dark;
} flare_picture;

typedef struct flare_found {
    flare_verdict verdict;
    int n, used;             /* Gaussians; of those, from the narrowest on, the ones that values bear out */
    double sd[FLARE_MOST];   /* pixels; 0: the same everywhere in the picture */
    double part[FLARE_MOST]; /* a_j */
    double total; /* v: the sum of part, as far as it lies within the picture's size of where it comes from */
    double most;  /* v if everything at the envelope is flare */
    double error; /* relative, of the veil: between groups of lamps, and between halves of the places */
    double misfit;  /* rms of ln(value / envelope) where that is mostly flare */
    double pile_up; /* ln likelihood that values gain by lying on the envelope, over smooth light's */
    int places, on; /* dark places looked at; those that lie on the envelope and are mostly flare */
} flare_found;

/* The verdict is one of the two that let the veil be taken out. */
int flare_is_certain(const flare_found *f);

/* Groups of lamps: [height][width], 0: no lamp, 1 and 2: of about the same light each, apart from each other.
 * Returns how many lamps there are in all, or -1. */
int flare_lamps(unsigned char *group, const flare_picture *p, errmsg *e);

/* Estimate, and fill veil [height][width] with sum_j a_j G_j * S, whatever the verdict is; where it is
 * certain, that is what all that bears it out agrees on.  like: NULL, or what was found in all channels
 * together: it says which Gaussians are used. */
int flare_estimate(flare_found *out, float *veil, const flare_picture *p, const unsigned char *group,
                   const flare_found *like, errmsg *e);

#endif
