/*
 * meshfile.h - meshes in files: Wavefront OBJ, and Radiance polygons of the material ilf.
 */
#ifndef MESHFILE_H
#define MESHFILE_H

#include "mesh.h"

/* OBJ: groups "measured" and "closed"; each vertex's texture coordinates are its relative standard error and 1 where it closes
 * a hole, else 0.  obj2mesh takes it. line: the command, for a comment. */
int meshfile_obj(const char *path, const mesh *m, const char *line, errmsg *e);

/* A scene file: the material ilf of this light field, and the mesh's triangles of it. */
int meshfile_rad(const char *path, const mesh *m, const char *field, const char *line, errmsg *e);

#endif
