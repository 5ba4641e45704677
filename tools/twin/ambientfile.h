/*
 * ambientfile.h - an ambient file belongs to one scene.
 *
 * rtrace -af FILE goes on with the indirect light that FILE holds, of whatever room it is: of another room's,
 * the picture would be lit by both.  FILE.scene keeps the digest of the scene that FILE was begun with.
 */
#ifndef AMBIENTFILE_H
#define AMBIENTFILE_H

#include "stagectl/argwords.h"

/* Before rtrace is run with these options on the octree.  A file of another scene is set aside as FILE.old,
 * with words in remark (else ""). */
int ambient_settle(char remark[512], const argwords *options, const char *octree, errmsg *e);

#endif
