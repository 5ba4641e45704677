/*
 * ilfoct.h - an octree's header tells whether its scene shows a light field.
 *
 * Written by oconv, read by oconv and the renderers:  an octree that is a part of
 * another scene (an instance) need not be loaded to see that it has none.
 * Include after object.h.
 */
#ifndef _RAD_ILFOCT_H_
#define _RAD_ILFOCT_H_

#include  <string.h>
#include  <unistd.h>

#include  "paths.h"
#include  "resolu.h"

#define  ILFOCTID	"ILF= in scene"		/* header line */


static int
ilfoctline(			/* is this header line ours? */
	char  *s,
	void  *p
)
{
	if (!strncmp(s, ILFOCTID, sizeof(ILFOCTID)-1))
		*(int *)p = 1;
	return(0);
}


static int
ilfinoct(			/* does an instance's octree show a light field? */
	OBJREC  *o
)
{
	char  *path;
	FILE  *fp;
	int  found = 0;

	if (o->oargs.nsargs < 1 || (path = getpath(o->oargs.sarg[0],
			getrlibpath(), R_OK)) == NULL ||
			(fp = fopen(path, "rb")) == NULL)
		return(0);		/* loading it will complain */
	getheader(fp, ilfoctline, (void *)&found);
	fclose(fp);
	return(found);
}

#endif /* _RAD_ILFOCT_H_ */
