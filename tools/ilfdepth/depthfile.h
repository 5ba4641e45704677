/*
 * depthfile.h - maps of distances as an OpenEXR picture.
 */
#ifndef DEPTHFILE_H
#define DEPTHFILE_H

#include "depthmap.h"

/* Distances of a picture's every texel: far (np*nt, scene's unit, along the ray), sure and error (relative standard error), from the coarser
 * map: between cells that show one thing in between, elsewhere as the cell that looks most like the texel. */
void depthfile_fine(float *far, float *sure, float *error, const depthmap *m, const views *s);

/* All maps in one picture, laid out as the light field is (panoramas below each other, as they came): Y distance, confidence, error.  Pictures
 * without a map are 0. */
int depthfile_write(const char *path, const depthmap *maps, int n, const views *s, const char *line,
                    errmsg *e);

#endif
