/*
 * layers.h - hypotheses that look for the occluder in the pictures: one sheet (a card), a stack of sheets
 * (twigs, leaves). As in smooth.h: they append masks to all five versions and judge; 0, 1 (doesn't apply) or
 * -1 (no memory).
 */
#ifndef LAYERS_H
#define LAYERS_H

#include "model.h"
#include "pictures.h"

int layers_sheet(model *m, const lamp *l, const lightfield *f, const pictures *pics);

int layers_stack(model *m, const lamp *l, const lightfield *f, const pictures *pics);

#endif
