/*
 * Shading function for incident light fields, and their light on other surfaces
 *
 *  External symbols declared in ilfsrc.h, and in source.h
 */

#include "copyright.h"

#include  <time.h>

#include  "ray.h"
#include  "otypes.h"
#include  "otspecial.h"
#include  "rtotypes.h"
#include  "source.h"
#include  "random.h"
#include  "ambient.h"
#include  "ilf.h"
#include  "ilfhost.h"
#include  "ilfsrc.h"
#include  "ilfobj.h"
#include  "ilfmark.h"
#include  "ilfshiny.h"

/*
 *	The material goes on auxiliary geometry, which has no look of its
 *  own:  a ray that meets it sees what the light field holds for that
 *  ray.  With "depth" (the default) the geometry stands for the surfaces
 *  that the light came from, and the four probes around the ray are each
 *  looked up towards the point that was met; with "nodepth" they are
 *  looked up in the ray's direction.  On a source, which is infinitely
 *  far away, the two are the same.  The surface's orientation does not
 *  matter.  A pattern multiplies the value.
 *
 *  The light field itself is in libilf (ilf.h), which also brings the
 *  light of its bright part to surfaces:  as Radiance's sources do, in
 *  the direct calculation.  All that happens here is translation, of
 *  rays and materials to libilf's points, lobes and balls, and back.
 */

#define  ILFOMEGA	1e-6		/* solid angle for coefficients: none
					   of Radiance's functions may widen
					   its lobe by it */
#define  ILFMAXPASS	64		/* objects to pass to our surface */
#define  ILFSTRAIGHT	1e-9		/* 1 - cosine of what isn't deflected */
#define  ILFSEED	8713		/* keeps our dimension off others */

typedef struct {
	ILFMAT  *ip;			/* light field */
	RAY  *r;			/* ray that met the surface */
	srcdirf_t  *f;			/* surface's coefficients */
	void  *p;			/* data for f */
}  ILFHOST;			/* for whom libilf works */

typedef struct ilfglint {
	const RAY  *ray;		/* ray that looks for the glint */
	const OBJREC  *ball;		/* where it must be mirrored */
	SCOLOR  sum;			/* what it found */
}  ILFGLINT;			/* a glint of a lamp on a ball */

int  ilfsamp = 16;			/* samples per point */


static int
auxhit(				/* find auxiliary geometry along ray */
	double  hit[3],
	const double  org[3],
	const double  dir[3],
	void  *p
)
{
	ILFHOST  *hp = (ILFHOST *)p;
	RAY  tr;
	int  n;

	rayorigin(&tr, PRIMARY, NULL, NULL);
	tr.parent = hp->r;		/* so that newrayxf() spares its own */
	tr.rmax = 0.0;
	VCOPY(tr.rorg, org);
	VCOPY(tr.rdir, dir);
	for (n = ILFMAXPASS; n-- > 0 && localhit(&tr, &thescene); ) {
		if (ilfseen(hp->ip, &tr)) {
			VCOPY(hit, tr.rop);
			return(1);
		}
		VCOPY(tr.rorg, tr.rop);		/* pass through others */
		rayclear(&tr);
	}
	return(0);
}


static ilf_ball *
makeballs(			/* describe shiny balls to libilf */
	OBJREC  **op,
	int  n
)
{
	ilf_ball  *balls = (ilf_ball *)malloc((n+1)*sizeof(ilf_ball));
	int  i;

	if (balls == NULL)
		error(SYSTEM, "out of memory in makeballs");
	for (i = 0; i < n; i++) {
		VCOPY(balls[i].centre, op[i]->oargs.farg);
		balls[i].radius = op[i]->oargs.farg[3];
		balls[i].roughness = shininess(findmaterial(op[i]));
	}
	return(balls);
}


static void
findbright(			/* find (once) what is bright in light field */
	ILFMAT  *ip,
	const RAY  *r		/* ray that asks */
)
{
	ILFHOST  host = {ip, (RAY *)r, NULL, NULL};
	ilf_patches_spec  spec;
	ilf_ball  *balls;
	ilf_error  err;
	clock_t  start;

	if (ip->sampler != NULL)
		return;
	start = clock();
	memset(&spec, 0, sizeof(spec));
	spec.mode = ip->depth ? ILF_DEPTH : ILF_NO_DEPTH;
	spec.hit = auxhit;
	spec.context = (void *)&host;
	spec.n_balls = shinyballs(&ip->ball);
	spec.balls = balls = makeballs(ip->ball, spec.n_balls);
	if (ilf_patches_open(&ip->bright, ip->file->field, ip->frame,
			&spec, &err) != ILF_OK ||
			ilf_sampler_open(&ip->sampler, ip->bright,
			&err) != ILF_OK)
		ilferror(ip->m, &err);
	free((void *)balls);
	ip->setup = (double)(clock() - start) / CLOCKS_PER_SEC;
}


static int
glintparts(			/* by which components does a point see glints? */
	const RAY  *r
)
{
	return((ambounce > 0 && !(r->crtype & AMBIENT) ? ILF_DIFFUSE : 0) |
			(isglossy(r) ? ILF_GLOSSY : 0));
}


static int
glintdone(			/* does a glint's cone count this ray? */
	ILFMAT  *ip,
	const RAY  *ar		/* ray that met a shiny surface */
)
{
	int  i;

	if (ar->ro == NULL || ar->ro->otype != OBJ_SPHERE || ar->parent == NULL)
		return(0);
	if (!(glintparts(ar->parent) & (ar->rtype & AMBIENT ? ILF_DIFFUSE :
			ar->rtype & SPECULAR ? ILF_GLOSSY : 0)))
		return(0);
	findbright(ip, ar);
	i = ilf_glint_ball(ip->bright, ar->rorg, ar->rdir);
	return(i >= 0 && ip->ball[i] == ar->ro);
}


static const RAY *
lastturn(			/* go back to where ray was turned last */
	const RAY  *r
)
{
	while (r->rtype & TRANS && r->parent != NULL &&
			DOT(r->rdir, r->parent->rdir) >= 1. - ILFSTRAIGHT)
		r = r->parent;
	return(r);
}


static ilf_part
raypart(			/* which part does a ray see? */
	ILFMAT  *ip,
	const RAY  *r
)
{
	const RAY  *rp = lastturn(r);
	ilf_way  way = {0, 0, 0};
	const ILFGLINT  *gp = r->glint;

	if (r->crtype & SHADOW)		/* aimed at us, and not deflected */
		way.aimed = rp->rtype & SHADOW && r->rsrc == ip->sn ? 1 : -1;
	else if (gp != NULL)		/* looks for a glint */
		way.aimed = rp->rtype & REFLECTED ? 1 : -1;
	else if (rp->rtype & (AMBIENT|SPECULAR))
		way.scattered = 1;
	else if (rp->rtype & REFLECTED && rp->parent != NULL)
		way.in_glint = glintdone(ip, rp->parent);
					/* from that ball? */
	if (gp != NULL && (rp->parent != gp->ray || gp->ray->ro != gp->ball))
		way.aimed = -1;
	return(ilf_ray_part(&way));
}


static void
glintadd(			/* count what a glint ray found */
	const RAY  *r
)
{
	ILFGLINT  *gp = r->glint;
	SCOLOR  c;

	copyscolor(c, r->rcol);
	do {
		smultscolor(c, r->rcoef);
	} while (r != gp->ray && (r = r->parent) != NULL);
	saddscolor(gp->sum, c);
}


static double
ilfrandom(			/* get random number for libilf */
	int  dim,
	void  *p
)
{
	double  d;

	if (dim != ILF_ALONG_MAP)
		return(frandom());
	dimlist[ndims_inc()] = ((ILFHOST *)p)->ip->sn + ILFSEED;
	d = urand(ilhash(dimlist,ndims)+samplendx);
	dec_ndims();
	return(d);
}


static double
ilflobe(			/* get surface's coefficient for libilf */
	void  *coef,
	const double  dir[3],
	int  lobes,
	void  *p
)
{
	ILFHOST  *hp = (ILFHOST *)p;
	COLORV  *cv = (COLORV *)coef;
	FVECT  d;

	VCOPY(d, dir);
	hp->r->rparts = DIRBLIND | (lobes & ILF_DIFFUSE ? DIRDIFF : 0) |
			(lobes & ILF_GLOSSY ? DIRSPEC : 0);
	(*hp->f)(cv, hp->p, d, ILFOMEGA);
	hp->r->rparts = 0;
	return(sintens(cv)*(1./ILFOMEGA));
}


static int
ilfshadow(			/* trace shadow ray for libilf */
	const ilf_aim  *ap,
	void  *p
)
{
	ILFHOST  *hp = (ILFHOST *)p;
	RAY  sr;
	int  i;

	rayorigin(&sr, shadowtype(hp->r,ap->dir), hp->r, NULL);
	VCOPY(sr.rdir, ap->dir);
	sr.rsrc = hp->ip->sn;
	copyscolor(sr.rcoef, (const COLORV *)ap->coef);
	scalescolor(sr.rcoef, 1./ILFOMEGA);
	scalescolor(sr.rcoef, ap->scale);
	rayvalue(&sr);
	for (i = NCSAMP; i--; )		/* a channel of it may be < 0 */
		if (sr.rcol[i] != 0.0)
			break;
	if (i < 0)
		return(0);
	smultscolor(sr.rcol, sr.rcoef);
	saddscolor(hp->r->rcol, sr.rcol);
	return(1);
}


static void
ilfglint(			/* trace ray to a glint for libilf */
	const ilf_aim  *ap,
	int  ball,
	void  *p
)
{
	ILFHOST  *hp = (ILFHOST *)p;
	ILFGLINT  gl;
	SCOLOR  coef;
	RAY  gr;

	copyscolor(coef, (const COLORV *)ap->coef);
	scalescolor(coef, ap->scale/ILFOMEGA);
	if (rayorigin(&gr, ambienttype(hp->r,ap->dir), hp->r, coef) < 0)
		return;
	VCOPY(gr.rdir, ap->dir);
	gl.ray = &gr;
	gl.ball = hp->ip->ball[ball];
	scolorblack(gl.sum);
	gr.glint = &gl;
	rayvalue(&gr);
	saddscolor(hp->r->rcol, gl.sum);
}


static int
sampledat(			/* does ray's surface sample light fields? */
	const RAY  *r
)
{
	int  n = ambounce > 1 ? ambounce : 1;
				/* as deep as blind rays would see them */
	if (r->crtype & AMBIENT)
		for ( ; r != NULL; r = r->parent)
			if (r->rtype & AMBIENT && --n <= 0)
				return(0);
	return(1);
}


void
ilfdirect(			/* add direct part of light fields */
	RAY  *r,
	srcdirf_t  *f,
	void  *p
)
{
	ILFHOST  me = {NULL, r, f, p};
	ilf_host  host = {ilfrandom, ilflobe, ilfshadow, ilfglint, auxhit,
				NCSAMP*sizeof(COLORV), (void *)&me};
	ilf_point  pt;
	ilf_error  err;
	ILFMAT  *ip;
	int  deep;

	if (ilflist.shown == NULL)
		return;
	VCOPY(pt.position, r->rop);
	pt.samples = ilfsamp;
	pt.weight = r->rweight;
	pt.narrow = isglossy(r);
	pt.apart = (r->glint != NULL);
	pt.glint_lobes = pt.apart ? 0 : glintparts(r);
	deep = pt.apart || !sampledat(r);
	for (ip = ilflist.shown; ip != NULL; ip = ip->next) {
		if (ip->sn < 0)
			continue;	/* not sampled */
		findbright(ip, r);
		if (!ilf_patches_count(ip->bright))
			continue;	/* nothing bright */
		pt.lobes = !deep ? ILF_DIFFUSE|ILF_GLOSSY :
				pt.narrow ? ILF_GLOSSY : 0;
		if (!pt.apart && r->rtype & (AMBIENT|SPECULAR) &&
				glintdone(ip, r))
			pt.lobes &= ~ILF_GLOSSY;
		me.ip = ip;
		if (ilf_light(ip->sampler, &pt, &host, &err) != ILF_OK)
			ilferror(ip->m, &err);
	}
}


int
m_ilf(				/* ray met auxiliary geometry */
	OBJREC  *m,
	RAY  *r
)
{
	ILFMAT  *mp = getilf(m), *ip = ilfplaced(mp, r);
	const RREAL  *org = lastturn(r)->rorg;
	RREAL  *dir = r->rdir, *hit = r->rop;
	FVECT  lorg, ldir, lhit;
	ilf_part  part = ILF_ALL;
	ilf_status  ok;
	float  rgb[3];
	ilf_error  err;
					/* which part counts? */
	if (ilfaimed(ip, r)) {
		part = raypart(ip, r);
	} else if (r->crtype & SHADOW) {
		part = ILF_NONE;
	} else {
		ilfliteral(mp, m, r);
	}
	if (part == ILF_NONE)
		return(1);
	if (r->ro->otype == OBJ_SOURCE)
		hit = NULL;		/* infinitely far away */
	ilfwatch(mp->file);
	if (part != ILF_ALL) {
		findbright(ip, r);
		ok = ilf_eval_part(rgb, ip->bright, part, org, dir, hit, &err);
	} else {
		if (r->rox != NULL) {	/* into the instance's space */
			multp3(lorg, (RREAL *)org, r->rox->b.xfm);
			multv3(ldir, dir, r->rox->b.xfm);
			org = lorg; dir = ldir;
			if (hit != NULL) {
				multp3(lhit, hit, r->rox->b.xfm);
				hit = lhit;
			}
		}
		ok = ilf_eval(rgb, mp->file->field, mp->frame, org, dir, hit,
				mp->depth ? ILF_DEPTH : ILF_NO_DEPTH, &err);
	}
	if (ok != ILF_OK)
		ilferror(m, &err);
					/* modify value */
	raytexture(r, m->omod);
	setscolor(r->rcol, rgb[0], rgb[1], rgb[2]);
	smultscolor(r->rcol, r->pcol);
	if (r->glint != NULL) {		/* counted on its own */
		glintadd(r);
		scolorblack(r->rcol);
	}
	r->rsrc = -1;			/* we are what was aimed for */
	return(1);
}

