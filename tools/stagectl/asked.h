/*
 * asked.h - does a picture say of itself what was asked for: exposure time, f-number, ISO, format?
 *
 * Cameras round a speed that they don't have, keep the one before when they don't know the word, and drift in
 * an automatic mode; all of it goes straight into the radiance.  The facts are EXIF's (JPEG, TIFF, PNG) or
 * LibRaw's (raw).
 */
#ifndef ASKED_H
#define ASKED_H

#include "session.h"

typedef struct picture_says {
    char format[8];                /* as common/image.h names it; "" = not known */
    double seconds, f_number, iso; /* 0 = it doesn't say */
} picture_says;

/* Never fails: what can't be read is not said. */
void asked_read(picture_says *p, const char *path);

/* Compare with the session: the time of exposure k within time_tolerance (a ratio), or, with times = exif,
 * there at all; f-number within 5 % and ISO within 10 % of what the session asks, or else of `first`, what
 * the session's first picture said (zeros: nothing yet).  The words say what differs. */
int asked_compare(const picture_says *p, const session *s, int k, const double first[2], errmsg *e);

/* Is the picture's time another than asked, beyond the tolerance? */
int asked_differs(const picture_says *p, const session *s, int k);

/* The format that a name's ending promises, as common/image.h names it; "" = none that we know. */
const char *ending_format(const char *name);

/* Do ending and format agree (as far as both are known)? */
int ending_agrees(const char *name, const char *format);

/* A camera's word for a speed (1/60, 0.25s, 2"), in s; 0 when it doesn't look like one. */
double asked_label(const char *label);

#endif
