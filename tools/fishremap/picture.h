/*
 * picture.h - the job of remapping one picture.
 */
#ifndef PICTURE_H
#define PICTURE_H

#include "base/errmsg.h"
#include "outcome.h"
#include "remapjob.h"
#include "settings.h"

/* One picture to another. */
int job_picture(outcome *o, session w[2], const settings *s, errmsg *e);

#endif
