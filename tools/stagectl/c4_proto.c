/* c4_proto.c - see c4_proto.h (pure). */
#include "c4_proto.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

size_t c4_format_move(char *out, size_t room, const long steps[2])
{
    int n = snprintf(out, room, "!1");
    if (steps[0] == 0 && steps[1] == 0) return 0;
    for (int a = 0; a < 2; a++)
        if (steps[a] != 0)
            n += snprintf(out + n, room - (size_t)n, "m%d%c%ld", a + 1, steps[a] > 0 ? 'f' : 'r',
                          labs(steps[a]));
    n += snprintf(out + n, room - (size_t)n, "n\r");
    return (size_t)n;
}

long c4_steps(double mm, double steps_per_mm)
{
    return lround(mm * steps_per_mm);
}
