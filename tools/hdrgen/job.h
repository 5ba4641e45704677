/*
 * job.h - one series from files to radiance: what is asked for, what came out, and the stages.
 */
#ifndef HDRGEN_JOB_H
#define HDRGEN_JOB_H

#include "align.h"
#include "base/errmsg.h"
#include "calibrate.h"
#include "cfa.h"
#include "colour.h"
#include "contradict.h"
#include "debevec.h"
#include "flare.h"
#include "frames.h"
#include "image/image.h"
#include "merge.h"
#include "noise.h"
#include "response.h"
#include "samples.h"
#include "stated.h"
#include "times.h"
#include "white.h"

typedef enum response_kind {
    RESPONSE_AUTO, /* linear for camera raw, else debevec */
    RESPONSE_DEBEVEC,
    RESPONSE_MITSUNAGA,
    RESPONSE_LINEAR,
    RESPONSE_SRGB,
    RESPONSE_GAMMA,
    RESPONSE_FILE
} response_kind;

typedef struct job_opts {
    response_kind response;
    double gamma;
    const char *response_file;
    double lambda;
    merge_weight weight;
    double gain, read_noise; /* electrons per code, electrons; < 0: estimate */
    int bits;                /* that the codes fill of their files', from the lowest; 0: all */
    int white;               /* code from which on all is clipped; 0: find it */
    int refine_times, deghost, want_sigma, want_count, half_size, absolute;
    cfa bayer; /* of grey images; columns 0: none */
    colour_space colour;
    int has_fill, fill[3]; /* code triple of missing pixels */
    double circle[3]; /* what counts as clipped or black lies in it: x, y (< 0: the middle), radius in pixels,
                         or (with x < 0) over half the shorter side; radius 0: all */
    const char *dark, *flat, *hot; /* files or NULL */
    double patch[5];               /* x, y, w, h, cd/m2; w = 0: none */
    align_mode align;
    int flare;      /* take out what the lens has scattered */
    int64_t memory; /* bytes of codes kept between the passes */
} job_opts;

/* How camera raw became colours, and how the picture was turned. */
typedef struct develop_facts {
    const char *camera;     /* NULL: not camera raw in colour */
    double balance[3];      /* multipliers of the white balance */
    int balance_from;       /* the shot that states it; -1: none does */
    int daylight;           /* it is that of daylight, by the camera's matrix */
    double balance_differs; /* the other shots' multipliers are off by this part at most; 0: they agree */
    int no_matrix;          /* this camera's is unknown: colours are its own */
    long outside;           /* pixels of a colour that the space's primaries can't make: negative values */
    int orientation;        /* EXIF's 1..8 that the picture was turned by */
    int turns_differ;       /* the shots' tags do */
} develop_facts;

/* What was found of flare, and as the header states it: per channel, widths in pixels of the result. */
typedef struct flare_facts {
    int lamps;                   /* told apart */
    flare_found all, channel[3]; /* of the channels' mean; of each, where that is certain */
    float total[3], most[3], error[3];
    float width[FLARE_MOST], part[3 * FLARE_MOST];
} flare_facts;

typedef struct job_facts {
    solve_facts solve; /* of the first estimate; condition 0 where none was needed */
    calib_facts calib;
    develop_facts develop;
    int calibrated;              /* calib holds something */
    times_facts times;           /* what the exposures were made of */
    stated_facts stated;         /* and whether the pixels agree */
    contradict_facts contradict; /* of the exposures as they were merged */
    flare_facts flare;
    int assumed_time; /* one image of unknown time: 1 s */
    int bits_used;    /* the codes seem to end at 2^this - 1, below the file's highest; 0: they don't */
    int clip[RESPONSE_MAX_CHANNELS];                     /* codes from here on are clipped */
    long clipped, black, gap, ghosts, missing, healed;   /* pixels (any channel) */
    long counted;                                        /* pixels that those are of */
    double scale;                                        /* radiance was multiplied by this (--calibrate) */
    double read_s, align_s, recover_s, merge_s, flare_s; /* CPU seconds */
} job_facts;

typedef struct job {
    job_opts opts;
    shot *shots;        /* from the shortest exposure on once job_open is done */
    int n, times_given; /* times_given: by a file */
    frames *frames;
    const cfa *mosaic; /* one value per pixel, of these colours; NULL: pixels have all channels */
    response response;
    noise_model noise[RESPONSE_MAX_CHANNELS];
    samples samples;   /* kept for the plot */
    double *exposure;  /* [n], like shots; refined where asked for */
    align_shot *align; /* [n], like shots, in the pictures' own pixels; NULL: not asked for */
    uint16_t *dark;    /* dark frame's codes, like one exposure, or NULL */
    img radiance;
    float *sigma;           /* like radiance.pix, or NULL */
    uint8_t *count, *flags; /* per pixel: least of the channels (or NULL); OR of the channels */
    job_facts facts;
    void (*progress)(const char *what, double done, double total); /* or NULL */
} job;

/* Open the images and settle the times.  times_file may be NULL: EXIF. */
int job_open(job *j, const char *times_file, errmsg *e);

/* Response, noise and times from the samples. */
int job_calibrate(job *j, errmsg *e);

/* Merge all rows into j->radiance, and finish it (hot pixels, flat field, Bayer, scale). */
int job_merge(job *j, errmsg *e);

/* Find how the shots have moved and put them over the middle one; the frames are at their top before and
 * after, the clip levels known.  Called by job_calibrate where job_opts.align asks for it. */
int job_align(job *j, errmsg *e);

/* Take out of j->radiance what the lens has scattered, where that is certain, and fill facts.flare.  Called
 * by job_merge where job_opts.flare asks for it. */
int job_flare(job *j, errmsg *e);

/* Does (x, y) of the turned picture lie in the image circle (its radius times `grow`)?  Everything does
 * without one. */
int job_in_circle(const job *j, double x, double y, double grow);

/* Codes are proportional to light. */
int job_linear_codes(const job *j);

void job_close(job *j);

/* CPU seconds of the process so far; channels that are merged (3 for a mosaic). */
double job_cpu_s(void);
int job_channels(const job *j);

#endif
