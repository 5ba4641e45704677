/*
 * mesh.h - a surface as triangles: closed, each vertex with how far it may be wrong.
 */
#ifndef MESH_H
#define MESH_H

#include "judge.h"

typedef struct corner3 {
    double at[3]; /* scene's coordinates */
    double error; /* standard error of its distance, as part of it */
    int closed;   /* 1: no picture tells; it is what closes the mesh */
} corner3;

typedef struct mesh {
    corner3 *v;
    int n, triangles;
    int (*t)[3]; /* vertices of each, from 0, counter-clockwise as seen from within */
} mesh;

/* maps say which places of a box are seen. Below the horizon of pictures that end there the mesh is closed by a floor
 * half the positions' extent below the plane.  *m is the caller's until mesh_free. */
int mesh_make(mesh *m, const surface *f, const depthmap *maps, int n, const views *s, errmsg *e);
void mesh_free(mesh *m);

/* A triangle is closed where one of its vertices is. */
int mesh_is_closed(const mesh *m, int triangle);

#endif
