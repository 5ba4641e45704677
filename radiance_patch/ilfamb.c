/*
 * Light fields in the headers of ambient files
 *
 *  External symbols declared in ilfsrc.h
 */

#include "copyright.h"

#include  <ctype.h>

#include  "ray.h"
#include  "resolu.h"
#include  "ambient.h"
#include  "ilfsrc.h"
#include  "ilfobj.h"

/*
 *	An ambient value is what a surface gets from all around but from light
 *  sources.  If a light field is one (-di N), its bright part is not in the
 *  value, with the literal method (-di 0) it is:  values of one kind used as
 *  the other count light twice or lose it.  They are no use either if the light
 *  field has changed or was moved.  So each light field that surfaces show has
 *  a line in the ambient file's header:
 *
 *  LIGHTFIELD= sampled|literal depth|nodepth DIGEST Ox Oy Oz Ux Uy Uz Vx Vy Vz +|- FILE
 *
 *	DIGEST is that of the probes' values (ilf.h), whatever file holds them and
 *  however it is compressed.  O, U, V place the plane in the world, and + or -
 *  is the side of U x V on which the light is.  FILE is its last name, for us to
 *  say.  A scene without light fields has no such line, and its ambient files are
 *  those of any Radiance.
 */

#define  LFID		"LIGHTFIELD="
#define  MOVED		1e-5	/* in units of the plane's edges */

typedef struct {
	int  sampled;			/* is it a light source? */
	int  depth;			/* depth correction? */
	unsigned long long  digest;	/* what the file holds */
	FVECT  o, u, v;			/* where it is */
	int  side;			/* on which side light is */
	char  name[128];		/* file's last name */
	int  met;			/* has it met its equal? */
}  LFLINE;			/* a light field as in the header */

typedef struct {
	LFLINE  *l;
	int  n;
}  LFLIST;

static char  badmsg[] = "\"%.200s\": expected ambient values of this scene's \
light fields, found %s: remove it or name another -af file";


static LFLINE *
newline(			/* get room for one more */
	LFLIST  *lp
)
{
	lp->l = (LFLINE *)realloc((void *)lp->l, (lp->n+1)*sizeof(LFLINE));
	if (lp->l == NULL)
		error(SYSTEM, "out of memory in newline");
	memset((void *)(lp->l + lp->n), 0, sizeof(LFLINE));
	return(lp->l + lp->n++);
}


static double
planesize(			/* size of light field's plane */
	const LFLINE  *a
)
{
	return(VLEN(a->u) + VLEN(a->v));
}


static int
sameplane(			/* are planes in the same place? */
	const LFLINE  *a,
	const LFLINE  *b
)
{
	double  far = MOVED*planesize(a) + FTINY*VLEN(a->o);

	return((a->side == b->side) & (dist2(a->o, b->o) <= far*far) &
			(dist2(a->u, b->u) <= far*far) &
			(dist2(a->v, b->v) <= far*far));
}


static int
samefield(			/* do light fields look the same? */
	const LFLINE  *a,
	const LFLINE  *b
)
{
	return((a->digest == b->digest) & (a->depth == b->depth) &&
			sameplane(a, b));
}


static void
ourlines(			/* get the scene's light fields */
	LFLIST  *lp
)
{
	ILFMAT  *ip;
	LFLINE  *np;
	char  *s;
	int  i;

	for (ip = ilflist.shown; ip != NULL; ip = ip->next) {
		np = newline(lp);
		np->sampled = (ip->sn >= 0);
		np->depth = ip->depth;
		np->digest = ilfvalues(ip);
		np->side = ilfplane(ip, np->o, np->u, np->v);
		s = strrchr(ip->file->path, '/');
		strncpy(np->name, s == NULL ? ip->file->path : s+1,
				sizeof(np->name)-1);
		for (s = np->name; *s; s++)
			if (!isprint(*(unsigned char *)s))
				*s = '?';
		for (i = lp->n-1; i-- > 0; )	/* once is enough */
			if (samefield(lp->l+i, np) &&
					lp->l[i].sampled == np->sampled) {
				lp->n--;
				break;
			}
	}
}


void
ilfputamb(			/* tell new ambient file's light fields */
	FILE  *fp
)
{
	LFLIST  ours = {NULL, 0};
	const LFLINE  *a;
	int  i;

	if (ilflist.shown == NULL)
		return;
	ourlines(&ours);
	for (a = ours.l; a < ours.l+ours.n; a++) {
		fprintf(fp, "%s %s %s %016llx", LFID,
				a->sampled ? "sampled" : "literal",
				a->depth ? "depth" : "nodepth", a->digest);
		for (i = 0; i < 9; i++)
			fprintf(fp, " %.9g", i < 3 ? a->o[i] :
					i < 6 ? a->u[i-3] : a->v[i-6]);
		fprintf(fp, " %c %s\n", a->side, a->name);
	}
	free((void *)ours.l);
}


static int
getline1(			/* take light field's line from header */
	char  *s,
	void  *p
)
{
	char  how[10], depth[10], side[2];
	LFLINE  *a;
	int  i, n;

	if (strncmp(s, LFID, sizeof(LFID)-1))
		return(0);
	a = newline((LFLIST *)p);
	s += sizeof(LFID)-1;
	if (sscanf(s, " %9s %9s %llx %n", how, depth, &a->digest, &n) != 3)
		goto notours;
	s += n;
	for (i = 0; i < 9; i++, s += n)
		if (sscanf(s, "%lf%n", i < 3 ? &a->o[i] : i < 6 ? &a->u[i-3] :
				&a->v[i-6], &n) != 1)
			goto notours;
	if (sscanf(s, " %1s %127[^\n]", side, a->name) != 2)
		goto notours;
	a->sampled = !strcmp(how, "sampled");
	a->depth = !strcmp(depth, "depth");
	a->side = side[0];
	if (a->sampled | !strcmp(how, "literal"))
		return(0);
notours:
	a->side = 0;			/* equals none */
	strcpy(a->name, "(unknown)");
	return(0);
}


static void
refuse(				/* say why we don't take the file */
	const char  *found
)
{
	sprintf(errmsg, badmsg, ambfile, found);
	error(USER, errmsg);
}


static void
findline(			/* find scene's light field in file */
	LFLIST  *lp,
	LFLINE  *a
)
{
	const char  *why = NULL;
	char  found[384];
	LFLINE  *b;
	int  near = 0;			/* how near we came */

	for (b = lp->l; b < lp->l+lp->n; b++) {
		if (samefield(a, b)) {
			if (a->sampled == b->sampled) {
				b->met = 1;
				return;
			}
			near = 4;
			why = a->sampled ? "those of the literal method (-di 0)"
					: "those without its bright part (-di above 0)";
		} else if (b->digest == a->digest && near < 3) {
			near = 3;
			why = a->depth == b->depth ? "it in another place" :
					"it with another depth argument";
		} else if (!strcmp(a->name, b->name) && near < 2) {
			near = 2;
			why = "another one of that name, or it before it changed";
		}
	}
	sprintf(found, "for %s %s", a->name, why == NULL ?
			lp->n ? "none" : "none (it was made without light fields)" : why);
	refuse(found);
}


void
ilfcheckamb(			/* check ambient file's light fields */
	FILE  *fp
)
{
	LFLIST  ours = {NULL, 0}, theirs = {NULL, 0};
	off_t  start = ftello(fp);
	char  found[256];
	int  i;
					/* rest of header is others' business */
	rewind(fp);
	if (getheader(fp, getline1, (void *)&theirs) < 0)
		theirs.n = 0;
	else if ((ilflist.shown != NULL) | (theirs.n > 0)) {
		ourlines(&ours);
		for (i = 0; i < ours.n; i++)
			findline(&theirs, ours.l+i);
		for (i = 0; i < theirs.n; i++)
			if (!theirs.l[i].met) {
				sprintf(found, "those of %s, which is not in it",
						theirs.l[i].name);
				refuse(found);
			}
	}
	free((void *)ours.l);
	free((void *)theirs.l);
	fseeko(fp, start, SEEK_SET);
}
