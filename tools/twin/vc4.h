/*
 * vc4.h - the C4 controller of c4_proto.h in simulated time (pure: bytes in, bytes out).
 */
#ifndef VC4_H
#define VC4_H

#include <stddef.h>

typedef struct vc4 {
    double now, step_rate; /* s simulated; half steps/s */
    long at[2], from[2], to[2];
    double start, end; /* of the move; end < 0 = none */
    int done_bytes;    /* 'o's to say at its end */
    char line[64];
    size_t n;
    char out[256];
    size_t out_n;
    int silent;
} vc4;

void vc4_init(vc4 *c, const long at[2], double step_rate);
void vc4_byte(vc4 *c, unsigned char byte);
void vc4_advance(vc4 *c, double now);
double vc4_next(const vc4 *c); /* INFINITY = nothing */
/* Half steps from home, and whether it moves. */
void vc4_truth(const vc4 *c, double steps[2], int *moving);

#endif
