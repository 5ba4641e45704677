/*
 * Shading function for incident light fields
 */

#include "copyright.h"

#include  <signal.h>
#include  <time.h>
#include  <unistd.h>

#include  "ray.h"
#include  "otypes.h"
#include  "rtotypes.h"
#include  "paths.h"
#include  "ilfsrc.h"

/*
 *	Arguments for an incident light field are:
 *
 *  1+ file.ilf.exr [depth|nodepth]
 *  0
 *  0
 *
 *	or, to place the light field's plane in the scene:
 *
 *  9  Ox Oy Oz  Ux Uy Uz  Vx Vy Vz
 *  12 Ox Oy Oz  Ux Uy Uz  Vx Vy Vz  Nx Ny Nz
 *
 *  The file is found along RAYPATH.  O is the corner of the sampled
 *  rectangle and U, V its edges, in place of what the file's header
 *  says; N, along plus or minus U x V, says on which side the light is.
 *
 *  The material goes on auxiliary geometry, which has no look of its
 *  own:  a ray that meets it sees what the light field holds for that
 *  ray.  With "depth" (the default) the geometry stands for the surfaces
 *  that the light came from, and the four probes around the ray are each
 *  looked up towards the point that was met; with "nodepth" they are
 *  looked up in the ray's direction.  On a source, which is infinitely
 *  far away, the two are the same.  The surface's orientation does not
 *  matter.  A pattern multiplies the value.
 *
 *  The light field itself is in libilf (ilf.h).  All that happens here
 *  is translation:  arguments to handle, world to the plane's space,
 *  error to objerror().
 */

int  ilfsamp = 16;			/* samples per point */

static ILFFILE  *ilflist = NULL;	/* open files */

static struct sigaction  oldfault;	/* who had SIGBUS before us */

extern char  *progname;


void
ilferror(			/* report libilf's error for a material */
	OBJREC  *m,
	ilf_error  *ep
)
{
	ep->text[300] = '\0';		/* objerror() has room for 512 */
	objerror(m, USER, ep->text);
}


static void
checkfile(			/* was file left as it was? */
	ILFFILE  *fp
)
{
	ilf_error  err;

	if (ilf_check_unchanged(fp->field, &err) == ILF_OK)
		return;
	eputs(err.text);
	eputs("\n");
	fflush(NULL);
	_exit(1);			/* what we computed is a mixture */
}


static void
watchfile(			/* the same, as often as the clock ticks */
	ILFFILE  *fp
)
{
	struct timespec  now;

	if (clock_gettime(CLOCK_MONOTONIC_COARSE, &now) < 0 ||
			now.tv_nsec == fp->tick)
		return;
	fp->tick = now.tv_nsec;
	checkfile(fp);
}


static void
ilfcheck(void)			/* were files left as they were till the end? */
{
	ILFFILE  *fp;

	for (fp = ilflist; fp != NULL; fp = fp->next)
		checkfile(fp);
}


static void
onfault(			/* a file was cut short while we used it */
	int  signo,
	siginfo_t  *info,
	void  *context
)
{
	const char  *words = NULL, *part[4], *cp;
	char  line[1024];
	ILFFILE  *fp;
	int  i, n = 0;

	for (fp = ilflist; (fp != NULL) & (words == NULL); fp = fp->next)
		words = ilf_fault(fp->field, info->si_addr);
	if (words == NULL) {		/* not ours:  do it again, as it was */
		sigaction(signo, &oldfault, NULL);
		return;
	}
	part[0] = progname; part[1] = ": fatal - "; part[2] = words;
	part[3] = "\n";
	for (i = 0; i < 4; i++)		/* no stdio in a signal handler */
		for (cp = part[i]; *cp && n < sizeof(line); cp++)
			line[n++] = *cp;
	i = write(2, line, n);
	_exit(1);
}


static void
catchfault(void)		/* see to signals from mapped files */
{
	struct sigaction  act;

	memset(&act, 0, sizeof(act));
	act.sa_sigaction = onfault;
	act.sa_flags = SA_SIGINFO;
	sigaction(SIGBUS, &act, &oldfault);
}


static ILFFILE *
openilf(			/* get light field file for material */
	OBJREC  *m
)
{
	static int  caught = 0;
	char  *path = getpath(m->oargs.sarg[0], getrlibpath(), R_OK);
	ilf_error  err;
	ILFFILE  *fp;

	if (path == NULL) {
		sprintf(errmsg, "cannot find light field \"%.256s\"",
				m->oargs.sarg[0]);
		objerror(m, USER, errmsg);
	}
	for (fp = ilflist; fp != NULL; fp = fp->next)
		if (!strcmp(fp->path, path)) {
			fp->nused++;
			return(fp);
		}
	fp = (ILFFILE *)malloc(sizeof(ILFFILE));
	if (fp == NULL)
		goto memerr;
	if (ilf_open(&fp->field, path, &err) != ILF_OK)
		ilferror(m, &err);
	if (!caught++) {
		atexit(ilfcheck);
		catchfault();
	}
	fp->path = savqstr(path);
	fp->nused = 1;
	fp->tick = -1;
	fp->next = ilflist;
	return(ilflist = fp);
memerr:
	error(SYSTEM, "out of memory in openilf");
	return NULL; /* pro forma return */
}


ILFMAT *
getilf(				/* get (open) material's light field */
	OBJREC  *m
)
{
	ILFMAT  *ip;
	ilf_error  err;
	RREAL  *fa;

	if ((ip = (ILFMAT *)m->os) != NULL)
		return(ip);
					/* check arguments */
	if ((m->oargs.nsargs < 1) | (m->oargs.nsargs > 2))
		objerror(m, USER,
			"expected string arguments: file [depth|nodepth]");
	if ((m->oargs.nfargs != 0) & (m->oargs.nfargs != 9) &
			(m->oargs.nfargs != 12))
		objerror(m, USER,
			"expected 0, 9 or 12 real arguments (O U V [N])");
	ip = (ILFMAT *)malloc(sizeof(ILFMAT));
	if (ip == NULL)
		error(SYSTEM, "out of memory in getilf");
	memset((void *)ip, 0, sizeof(ILFMAT));
	ip->sn = -1;
	ip->nballs = -1;
	ip->mode = ILF_DEPTH;
	if (m->oargs.nsargs > 1) {
		if (!strcmp(m->oargs.sarg[1], "nodepth"))
			ip->mode = ILF_NO_DEPTH;
		else if (strcmp(m->oargs.sarg[1], "depth")) {
			sprintf(errmsg,
	"expected \"depth\" or \"nodepth\" as second argument, found \"%.64s\"",
					m->oargs.sarg[1]);
			objerror(m, USER, errmsg);
		}
	}
	ip->file = openilf(m);
	ip->frame = *ilf_get_frame(ip->file->field);
	fa = m->oargs.farg;
	if (m->oargs.nfargs && ilf_frame_init(&ip->frame, fa, fa+3, fa+6,
			m->oargs.nfargs == 12 ? fa+9 : NULL, &err) != ILF_OK)
		ilferror(m, &err);
	return((ILFMAT *)(m->os = (char *)ip));
}


void
freeilf(			/* free material's light field */
	OBJREC  *m
)
{
	ILFMAT  *ip = (ILFMAT *)m->os;
	ILFMAT  *pp;
	ILFFILE  **fpp;

	if (ip == NULL)
		return;
	dropilf(ip);
	while ((pp = ip->place) != NULL) {
		ip->place = pp->place;
		dropilf(pp);
		free((void *)pp);
	}
	if (!--ip->file->nused)		/* last user closes file */
		for (fpp = &ilflist; *fpp != NULL; fpp = &(*fpp)->next)
			if (*fpp == ip->file) {
				*fpp = ip->file->next;
				checkfile(ip->file);
				ilf_close(ip->file->field);
				freeqstr(ip->file->path);
				free((void *)ip->file);
				break;
			}
	free((void *)ip);
	m->os = NULL;
}


void
ilfreport(void)			/* print what light fields were used */
{
	ILFFILE  *fp;
	ilf_usage  use;
	const ilf_info  *ii;

	if (!nrays)			/* ended before it began */
		return;
	for (fp = ilflist; fp != NULL; fp = fp->next) {
		ilf_get_usage(&use, fp->field);
		ii = ilf_get_info(fp->field);
		sprintf(errmsg,
	"%.256s: %ld of %ld probes used, %.1f MB in place, %.1f MB decoded\n",
				fp->path, (long)use.probes,
				(long)ii->n_u*ii->n_v,
				use.mapped_bytes*1e-6, use.decoded_bytes*1e-6);
		eputs(errmsg);
	}
	ilfsrcreport();
}


int
m_ilf(				/* ray met auxiliary geometry */
	OBJREC  *m,
	RAY  *r
)
{
	ILFMAT  *mp = getilf(m), *ip = ilfplaced(mp, r);
	RREAL  *org = r->rorg, *dir = r->rdir, *hit = r->rop;
	FVECT  lorg, ldir, lhit;
	float  rgb[3];
	ilf_error  err;
	double  d;
	int  part;
					/* which part counts? */
	if (ilfaimed(ip, r)) {
		part = ilfpart(ip, r);
	} else if (r->crtype & SHADOW) {
		part = ILF_NONE;
	} else {
		part = ILF_ALL;
		ilfliteral(mp, m, r);
	}
	if (part == ILF_NONE)
		return(1);
	if (r->rox != NULL) {		/* into the instance's space */
		multp3(lorg, org, r->rox->b.xfm);
		multv3(ldir, dir, r->rox->b.xfm);
		multp3(lhit, hit, r->rox->b.xfm);
		org = lorg; dir = ldir; hit = lhit;
	}
	if (r->ro->otype == OBJ_SOURCE)
		hit = NULL;		/* infinitely far away */
	watchfile(mp->file);
	if (ilf_eval(rgb, mp->file->field, &mp->frame, org, dir, hit,
			mp->mode, &err) != ILF_OK)
		ilferror(m, &err);
					/* modify value */
	raytexture(r, m->omod);
	setcolor(r->rcol, rgb[0], rgb[1], rgb[2]);
	multcolor(r->rcol, r->pcol);
	if (part != ILF_ALL) {
		d = ilf_excess_part(rgb, ilf_sampler_threshold(ilfsampler(ip, r)));
		if (part == ILF_BASE)
			d = 1. - d;
		scalecolor(r->rcol, d);
	}
	if (part == ILF_GLINT) {	/* counted on its own */
		glintadd(r);
		setcolor(r->rcol, 0.0, 0.0, 0.0);
	}
	r->rsrc = -1;			/* we are what was aimed for */
	return(1);
}
