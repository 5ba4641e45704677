/*
 * agree.h - what the maps say of each other.
 */
#ifndef AGREE_H
#define AGREE_H

#include "depthmap.h"

/* How sure each cell is, anew: by how many of the other maps have something at its place (to a tenth), and how many see through it. */
void agree_maps(depthmap *maps, int n, const views *s);

#endif
