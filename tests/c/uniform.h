/*
 * uniform.h - numbers between 0 and 1 for test drivers, the same in each run: xorshift64 (Marsaglia 2003).
 */
#ifndef UNIFORM_H
#define UNIFORM_H

#include <stdint.h>

static inline double uniform(void)
{
    static uint64_t state = 88172645463325252u;

    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return (double)(state >> 11) * 0x1p-53;
}

#endif
