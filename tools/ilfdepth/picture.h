/*
 * picture.h - pictures, distances and how sure they are, side by side.
 */
#ifndef PICTURE_H
#define PICTURE_H

#include "process.h"

/* Up to four pictures, a row each: what it shows; how far that is (near: red, far: blue); how sure that is (white: sure). */
int picture_write(const char *path, const process *q, errmsg *e);

#endif
