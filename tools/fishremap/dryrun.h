/*
 * dryrun.h - are the options and the files that they name right?  Before there is a picture.
 */
#ifndef DRYRUN_H
#define DRYRUN_H

#include "base/errmsg.h"
#include "settings.h"

/* Lens, falloff, mask and second picture: can they be read? */
int job_dry_run(const settings *s, errmsg *e);

#endif
