/*
 * scenefiles.h - what a scene consists of, as one digest.
 *
 * An octree says what the camera sees together with the files that it names: scene files where it was made
 * without oconv -f, and in any case meshes, instances, function files, data, pictures, fonts and light
 * fields. Those are taken from the words in it: each word that names a file, in the current folder or along
 * RAYPATH, counts with its contents and, where it is text, an octree or a mesh, with the files that it names
 * in turn.  A word that names a file by accident only makes the digest more particular than it had to be.
 */
#ifndef SCENEFILES_H
#define SCENEFILES_H

#include "base/errmsg.h"

/* SHA-256 as hex digits of `path` and all that it names.  -1 when path itself can't be read; files that it
 * names and that are not there are left to the renderer to miss. */
int scene_digest(char hex[65], const char *path, errmsg *e);

#endif
