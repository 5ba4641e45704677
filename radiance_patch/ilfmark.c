/*
 * Find the surfaces that show incident light fields
 *
 *  External symbols declared in ilfsrc.h, and in ilfmark.h
 */

#include "copyright.h"

#include  "ray.h"
#include  "otypes.h"
#include  "otspecial.h"
#include  "instance.h"
#include  "source.h"
#include  "ambient.h"
#include  "pmap.h"
#include  "ilfsrc.h"
#include  "ilfobj.h"
#include  "ilfmark.h"
#include  "ilfoct.h"

/*
 *	A light field may shade a surface as its material, through an alias,
 *  as a part of a mixture, or inside antimatter, and the surface may be
 *  anything, meshes included.  A surface in an octree that is instanced
 *  shows the light field in the instance's space:  each place is a light
 *  source of its own, whose plane is moved with it, and rays that meet it
 *  are told by their transformation.
 *	As a substitute for an illum or a mirror a light field is no source,
 *  since these decide by themselves which rays may see it.
 *
 *	What we don't find is still met by rays, and rendered by the literal
 *  method:  an octree that another oconv wrote, a mesh with materials of its
 *  own, and more than a sane number of places.
 */

#define  ILFMAXNEST	16		/* most instances inside each other */
#define  ILFMAXPLACE	64		/* most places in instances */

typedef struct octname {
	char  *name;			/* octree file as named */
	int  has;			/* does it show a light field? */
	struct octname  *next;
}  OCTNAME;			/* an octree that we looked at */

typedef struct {
	OCTNAME  *seen;			/* octrees that we looked at */
	int  nsurf;			/* surfaces found */
	int  warned;			/* said that photons don't know it */
}  SEARCH;			/* what we found so far */

typedef struct {
	OBJREC  *o;			/* surface */
	const FULLXF  *xf;		/* where its scene is, NULL for world */
	SEARCH  *sp;			/* who asks */
}  PLACE;			/* a surface, somewhere */

typedef int  ilfuse_f(OBJREC *m, int subst, void *p);


static int
useilfs(			/* call f for each ilf that a modifier leads to */
	OBJECT  mod,
	int  subst,
	ilfuse_f  *f,
	void  *p
)
{
	OBJREC  *m, *tm;
	OBJECT  t, part;
	int  i, n, found = 0;

	for ( ; mod != OVOID; mod = m->omod) {
		t = mod;
		m = tm = objptr(t);
		if (m->otype == MOD_ALIAS && !m->oargs.nsargs)
			continue;		/* stands for its modifier */
		while (tm->otype == MOD_ALIAS) {
			t = tm->oargs.nsargs ? lastmod(t, tm->oargs.sarg[0]) :
					tm->omod;
			if (t == OVOID)
				return(found);	/* m_alias() will complain */
			tm = objptr(t);
		}
		if (tm->otype == MAT_ILF)
			return(found | (*f)(tm, subst, p));
		n = 0;
		if (ismixture(tm->otype))
			n = 2;
		else if ((tm->otype == MAT_CLIP) | (tm->otype == MAT_ILLUM) |
				(tm->otype == MAT_MIRROR))
			n = 1;
		for (i = 0; i < n && i < tm->oargs.nsargs; i++) {
			if (!strcmp(tm->oargs.sarg[i], VOIDID))
				continue;
			part = lastmod(t, tm->oargs.sarg[i]);
			found |= useilfs(part, subst |
					(tm->otype == MAT_ILLUM) |
					(tm->otype == MAT_MIRROR), f, p);
		}
		if (ismaterial(tm->otype))
			break;
	}
	return(found);
}


static int
samexf(				/* are transformations the same? */
	const FULLXF  *a,
	const FULLXF  *b
)
{				/* both from the same products */
	return(!memcmp((const void *)a->f.xfm, (const void *)b->f.xfm,
			sizeof(MAT4)));
}


ILFMAT *
ilfplaced(			/* get light field as placed where ray met it */
	ILFMAT  *ip,
	const RAY  *r
)
{
	if (r->rox == NULL)
		return(ip);
	for (ip = ip->place; ip != NULL; ip = ip->place)
		if (samexf(&ip->xf, r->rox))
			break;
	return(ip);
}


static int
markilf(			/* note that surface shows light field */
	OBJREC  *m,
	int  subst,
	void  *p
)
{
	const PLACE  *pl = (const PLACE *)p;
	ILFMAT  *ip = getilf(m);
	int  ns;

	if (ilflist.unwanted != NULL)
		objerror(m, USER, ilflist.unwanted);
	if (photonMapping && !pl->sp->warned++)
		objerror(m, WARNING, "no photons come from a light field");
	pl->sp->nsurf++;
	ilflist.nsubst += (subst != 0);
	if (pl->xf != NULL) {		/* in an instance */
		ILFMAT  *base = ip;
		while ((ip = ip->place) != NULL)
			if (samexf(&ip->xf, pl->xf))
				break;
		if (ip == NULL) {
			if (ilflist.nplaces++ == ILFMAXPLACE)
				objerror(m, WARNING,
	"in too many instances: the literal method is used in the rest of them");
			if (ilflist.nplaces > ILFMAXPLACE)
				return(1);
			ip = placeilf(base, pl->xf, m);
		}
	}
	if (!ip->marked++) {
		ip->m = m;
		ip->next = ilflist.shown;
		ilflist.shown = ip;
	}
	if (findmaterial(pl->o) != m)
		ip->mixed = 1;
					/* the world's sources must be found */
	if (pl->o->otype == OBJ_SOURCE && !subst) {
		if ((ns = newsource()) < 0)
			goto memerr;
		setsource(&source[ns], pl->o);
		source[ns].sflags |= SSKIP|SILF;
	} else if ((ilfsamp <= 0) | subst | (ip->sn >= 0))
		return(1);
	else if ((ns = newsource()) < 0)
		goto memerr;
	else {				/* not sampled as others are */
		source[ns].so = pl->o;
		source[ns].sflags |= SSKIP|SILF;
	}
	if ((ilfsamp > 0) & (ip->sn < 0))
		ip->sn = ns;
	return(1);
memerr:
	error(SYSTEM, "out of memory in markilf");
	return(0); /* pro forma return */
}


static int
octreehas(			/* does instance's octree show a light field? */
	OBJREC  *o,
	SEARCH  *sp
)
{
	OCTNAME  *np;

	if (o->oargs.nsargs < 1)
		return(0);
	for (np = sp->seen; np != NULL; np = np->next)
		if (!strcmp(np->name, o->oargs.sarg[0]))
			return(np->has);
	np = (OCTNAME *)malloc(sizeof(OCTNAME));
	if (np == NULL)
		error(SYSTEM, "out of memory in octreehas");
	np->name = savqstr(o->oargs.sarg[0]);
	np->has = ilfinoct(o);
	np->next = sp->seen;
	sp->seen = np;
	return(np->has);
}


static void
markobject(			/* find light fields that object shows */
	OBJREC  *o,
	INSTANCE  **up,		/* instances that it is in, world's first */
	int  n,
	SEARCH  *srch
)
{
	FULLXF  xf;
	PLACE  pl;
	SCENE  *sp;
	OBJECT  i;
	int  k;

	if (!issurface(o->otype) && !isvolume(o->otype))
		return;
	if (o->otype == OBJ_INSTANCE && o->omod == OVOID) {
		if (n >= ILFMAXNEST || !octreehas(o, srch))
			return;
		up[n] = getinstance(o, IO_ALL);
		sp = up[n]->obj;
		for (i = sp->firstobj; i < sp->firstobj+sp->nobjs; i++)
			markobject(objptr(i), up, n+1, srch);
		return;
	}
	if (o->omod == OVOID || (n && o->otype == OBJ_SOURCE))
		return;			/* instances have no sources */
	pl.o = o;
	pl.xf = NULL;
	pl.sp = srch;
	if (n) {			/* products as in o_instance() */
		xf = up[k=n-1]->x;
		while (k-- > 0)
			multmat4(xf.f.xfm, xf.f.xfm, up[k]->x.f.xfm);
		pl.xf = &xf;
	}
	useilfs(o->omod, 0, markilf, (void *)&pl);
}


int
markilfs(			/* find all surfaces that show light fields */
	int  lit		/* or only the sources that rays may meet */
)
{
	INSTANCE  *up[ILFMAXNEST];
	SEARCH  srch = {NULL, 0, 0};
	OCTNAME  *np;
	OBJREC  *o;
	OBJECT  i;

	for (i = 0; i < nsceneobjs; i++) {
		o = objptr(i);
		if (lit ? o->otype != OBJ_INSTANCE || o->omod != OVOID ||
				(ilfsamp > 0) | (ambfile != NULL) :
				o->otype == OBJ_SOURCE)
			markobject(o, up, 0, &srch);
	}
	while ((np = srch.seen) != NULL) {
		srch.seen = np->next;
		freeqstr(np->name);
		free((void *)np);
	}
	ilflist.looked = lit;
	return(srch.nsurf);
}


void
noilfs(				/* refuse light fields that markilfs() finds */
	char  *why
)
{
	ilflist.unwanted = why;
}


static int
isthis(				/* is it the light field that we look for? */
	OBJREC  *m,
	int  subst,
	void  *p
)
{
	return(!subst & (m == (OBJREC *)p));
}


int
ilfseen(			/* did ray meet this light field? */
	const ILFMAT  *ip,
	const RAY  *r
)
{
	if (ip->inside ? r->rox == NULL || !samexf(&ip->xf, r->rox) :
			r->rox != NULL)
		return(0);
	return(findmaterial(r->ro) == ip->m || (ip->mixed &&
			useilfs(r->ro->omod, 0, isthis, (void *)ip->m)));
}


int
ilfaimed(			/* is light field a source for this ray? */
	const ILFMAT  *ip,
	const RAY  *r
)
{
	OBJREC  *m;

	if (ip == NULL || ip->sn < 0)
		return(0);
	if (!ilflist.nsubst)
		return(1);
	m = findmaterial(r->ro);
	return(m == NULL || (m->otype != MAT_ILLUM) & (m->otype != MAT_MIRROR));
}


void
ilfliteral(			/* say that light field isn't a source */
	ILFMAT  *ip,
	OBJREC  *m,
	const RAY  *r
)
{
	OBJREC  *rm;

	if ((ilfsamp <= 0) | !ilflist.looked | ip->warned | (ilflist.nplaces > ILFMAXPLACE))
		return;
	rm = findmaterial(r->ro);
	if (rm != NULL && (rm->otype == MAT_ILLUM) | (rm->otype == MAT_MIRROR)) {
		if (!(r->crtype & (AMBIENT|SPECULAR)))
			return;
		objerror(m, WARNING,
	"substitute of an illum or mirror: the literal method is used");
	} else
		objerror(m, WARNING, r->rox != NULL &&
				rm != NULL && r->ro->otype != OBJ_INSTANCE ?
"in an octree or mesh that does not tell of it: the literal method is used (make the octree again)" :
				"the literal method is used");
	ip->warned = 1;
}
