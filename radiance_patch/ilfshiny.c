/*
 * Shiny materials, and balls that have them
 *
 *  External symbols declared in ilfshiny.h
 */

#include "copyright.h"

#include  "ray.h"
#include  "otypes.h"
#include  "otspecial.h"
#include  "ilfhost.h"
#include  "ilfshiny.h"

#define  SHINYSPEC	.001		/* least specular part of shiny things */


double
shininess(			/* roughness of a shiny material */
	const OBJREC  *m		/* returns -1 if it isn't shiny */
)
{
	const RREAL  *fa = m->oargs.farg;

	switch (m->otype) {
	case MAT_MIRROR:
	case MAT_DIELECTRIC:
	case MAT_INTERFACE:
		return(0.);
	case MAT_PLASTIC:
	case MAT_METAL:
	case MAT_TRANS:
		if (m->oargs.nfargs >= 5 && fa[3] > SHINYSPEC)
			return(fa[4]);
		break;
	case MAT_PLASTIC2:
	case MAT_METAL2:
	case MAT_TRANS2:
		if (m->oargs.nfargs >= 6 && fa[3] > SHINYSPEC)
			return(fa[4] > fa[5] ? fa[4] : fa[5]);
		break;
	}
	return(-1.);
}


int
isglossy(			/* is ray's surface shiny but rough? */
	const RAY  *r
)
{
	OBJREC  *m;

	if (r->ro == NULL)		/* rtrace -I: no surface at all */
		return(0);
	m = findmaterial(r->ro);
	return(m != NULL && (m->otype == MAT_ASHIKHMIN) |
			(m->otype == MAT_BSDF) | (m->otype == MAT_ABSDF) |
			(m->otype == MAT_WGMDF) |
			(shininess(m) > FTINY));
}


static int
isball(				/* is it a shiny ball seen from outside? */
	const OBJREC  *o
)
{
	const OBJREC  *m;

	if (o->otype != OBJ_SPHERE || o->omod == OVOID ||
			o->oargs.nfargs != 4 || o->oargs.farg[3] <= FTINY)
		return(0);
	m = findmaterial((OBJREC *)o);
	return(m != NULL && shininess(m) >= 0.);
}


int
shinyballs(			/* list the scene's shiny balls */
	OBJREC  ***balls
)
{
	OBJREC  **list;
	OBJECT  i;
	int  n = 0;

	for (i = 0; i < nsceneobjs; i++)
		n += isball(objptr(i));
	*balls = list = (OBJREC **)malloc((n+1)*sizeof(OBJREC *));
	if (list == NULL)
		error(SYSTEM, "out of memory in shinyballs");
	for (i = 0; i < nsceneobjs; i++)
		if (isball(objptr(i)))
			*list++ = objptr(i);
	return(n);
}
