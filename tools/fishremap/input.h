/*
 * input.h - the picture that is asked for, ready to be remapped.
 */
#ifndef INPUT_H
#define INPUT_H

#include "base/errmsg.h"
#include "image/image.h"
#include "settings.h"

/* Load s->in as linear radiance with mask and alpha folded in: 4 channels, img_free() after use.  all_good:
 * every pixel is finite and has alpha 1. */
int input_load(img *im, int *all_good, const settings *s, errmsg *e);

#endif
