/*
 * place.c - see place.h.
 */
#include "place.h"

#include <math.h>
#include <string.h>

#include "textfile.h"

enum { MOST_NUMBERS = 6 };
static const double degree = 3.14159265358979323846 / 180;

/* Cut a line into a name and what follows; NULL where there is no name. */
static char *take_name(char *line, const char **rest)
{
    char *name = line, *end;

    if (*line == '"') {
        name++;
        end = strchr(name, '"');
        if (!end) return NULL;
    } else end = line + strcspn(line, " \t,;");
    *rest = *end ? end + 1 : end;
    *end = 0;
    return *name ? name : NULL;
}

/* A heading of "?" (the fourth word) becomes 0; 1 if it was one. */
static int unknown_heading(char *rest)
{
    static const char blanks[] = " \t,;";

    for (int k = 0; k < 3; k++) {
        rest += strspn(rest, blanks);
        rest += strcspn(rest, blanks);
    }
    rest += strspn(rest, blanks);
    if (*rest != '?' || (rest[1] && !strchr(blanks, rest[1]))) return 0;
    *rest = '0';
    return 1;
}

int place_of_line(place *p, char **name, char *line, const char **rest)
{
    double v[MOST_NUMBERS] = {0};

    *rest = "";
    *name = take_name(line, rest);
    const int unknown = *name ? unknown_heading(line + (*rest - line)) : 0;
    const int n = *name ? text_numbers(v, MOST_NUMBERS, *rest) : -1;
    memset(p, 0, sizeof *p);
    memcpy(p->at, v, sizeof p->at);
    p->unknown = unknown;
    p->heading = v[3], p->pitch = v[4], p->roll = v[5];
    return n;
}

void place_axes(double a[3][3], const place *p)
{
    const double ch = cos(p->heading * degree), sh = sin(p->heading * degree), cp = cos(p->pitch * degree),
                 sp = sin(p->pitch * degree), cr = cos(p->roll * degree), sr = sin(p->roll * degree);
    const double left[3] = {-sh, ch, 0}, up[3] = {-sp * ch, -sp * sh, cp};

    a[0][0] = cp * ch, a[0][1] = cp * sh, a[0][2] = sp;
    for (int k = 0; k < 3; k++) a[1][k] = cr * left[k] + sr * up[k], a[2][k] = cr * up[k] - sr * left[k];
}

void place_angles(place *p, const double a[3][3])
{
    p->heading = atan2(a[0][1], a[0][0]) / degree;
    p->pitch = asin(fmax(-1, fmin(1, a[0][2]))) / degree;
    p->roll = atan2(a[1][2], a[2][2]) / degree;
}
