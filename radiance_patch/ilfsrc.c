/*
 * Incident light fields as light sources
 *
 *  External symbols declared in ilfsrc.h, and in source.h
 */

#include "copyright.h"

#include  "ray.h"
#include  "otypes.h"
#include  "otspecial.h"
#include  "source.h"
#include  "random.h"
#include  "ambient.h"
#include  "pmap.h"
#include  "ilfsrc.h"

/*
 *	A light field's radiance is split at a threshold into a smooth base
 *  and an excess (ilf.h).  As with Radiance's sources, each surface
 *  samples the excess in its direct calculation, and rays that the
 *  surface scatters see the base only, so that nothing counts twice.
 *
 *	The direct samples are drawn in two steps (Talbot, Cline, Egbert,
 *  "Importance Resampling for Global Illumination", 2005).  Many
 *  candidates come from the map of what is bright around the point, and
 *  get the weight
 *
 *	w = f(x, d) X(x, d) / p(d)
 *
 *  where f is the material's coefficient, X the excess as looked up
 *  without tracing anything, and p the density of the draw.  Of these a
 *  few are chosen in proportion to w, in the order of the map (so that
 *  they spread over it), and only those send a shadow ray.  Each counts
 *
 *	f X' V / (f X)  mean(w) / n
 *
 *  where X' is what the ray met and V whether it came through.  This has
 *  the right mean whatever X is, as long as it is not 0 where X' isn't;
 *  with depth correction, where X is only an estimate, a part of the
 *  map's own weight is added.
 *
 *	The number of shadow rays goes with the ray's weight, and falls where
 *  earlier tests in the same cube of space all had the same result.  So
 *  many candidates are drawn that their part of the error costs no more
 *  than the rays' part: with the root of the weights' variance, as
 *  earlier points in the cube had it.  These tests and points are others,
 *  so that the mean stays right.
 */

#define  ILFCAND		16		/* most candidates per shadow ray */
#define  ILFFEWCAND	2		/* least */
#define  ILFCANDCV	20.		/* in proportion to their variation */
#define  ILFMINCAND	64		/* but at least this many for what we see */
#define  ILFLEASTCAND	8		/* and this many for any point */
#define  ILFHIST		128		/* tests before we believe history */
#define  ILFSURE		8		/* fewer rays where we do */
#define  ILFDOUBT	.01		/* part of map's weight added to estimate */
#define  ILFMAXPASS	64		/* objects to pass to our surface */

typedef struct {
	FVECT  dir;		/* direction */
	COLOR  coef;		/* material coefficient per steradian */
	double  targ;		/* f X */
	double  wt;		/* f X / p */
}  ILFCND;			/* a candidate */

int  dirparts = DIRDIFF|DIRSPEC;	/* components of coefficients */

static const RAY  *auxray = NULL;	/* ray for whom auxhit() looks */

static ILFCND  *cand = NULL;		/* our candidates */
static int  maxcand = 0;

static RNUMBER  ndrawn = 0;		/* candidates drawn */
static RNUMBER  ntraced = 0;		/* shadow rays traced */
static double  setuptime = 0;		/* CPU seconds finding what's bright */


void
dropilf(			/* forget material about to be freed */
	ILFMAT  *ip
)
{
	ILFMAT  **ipp;

	for (ipp = &ilfmats; *ipp != NULL; ipp = &(*ipp)->next)
		if (*ipp == ip) {
			*ipp = ip->next;
			break;
		}
	ilf_sampler_close(ip->smp);
	ip->smp = NULL;
	free((void *)ip->ball);
	ip->ball = NULL;
	ip->nballs = -1;
}


static int
auxhit(				/* find auxiliary geometry along ray */
	double  hit[3],
	const double  org[3],
	const double  dir[3],
	void  *p
)
{
	ILFMAT  *ip = (ILFMAT *)p;
	RAY  tr;
	int  n;

	rayorigin(&tr, PRIMARY, NULL, NULL);
	tr.parent = auxray;		/* so that newrayxf() spares its own */
	tr.rmax = 0.0;
	VCOPY(tr.rorg, org);
	VCOPY(tr.rdir, dir);
	for (n = ILFMAXPASS; n-- > 0 && localhit(&tr, &thescene); ) {
		if (ilfseen(ip, &tr)) {
			VCOPY(hit, tr.rop);
			return(1);
		}
		VCOPY(tr.rorg, tr.rop);		/* pass through others */
		rayclear(&tr);
	}
	return(0);
}


static double
auxdist(			/* distance of auxiliary geometry */
	FVECT  org,
	FVECT  dir,
	ILFMAT  *ip,
	const RAY  *r
)
{
	FVECT  hit;
				/* a map that expects nothing here knows no
				   distance, and a wrong one shows lamps
				   where there are none */
	auxray = r;
	if (!auxhit(hit, org, dir, (void *)ip))
		return(FHUGE);
	return(sqrt(dist2(hit, org)));
}


ilf_sampler *
ilfsampler(			/* find what is bright in light field */
	ILFMAT  *ip,
	const RAY  *r		/* ray that asks */
)
{
	ilf_sampler_spec  spec;
	ilf_error  err;
	clock_t  start;

	auxray = r;
	if (ip->smp != NULL)
		return(ip->smp);
	start = clock();
	memset(&spec, 0, sizeof(spec));
	spec.mode = ip->mode;
	spec.hit = auxhit;
	spec.context = (void *)ip;
	if (ilf_sampler_open(&ip->smp, ip->file->field, &ip->frame,
			&spec, &err) != ILF_OK)
		ilferror(ip->m, &err);
	setuptime += (double)(clock() - start) / CLOCKS_PER_SEC;
	return(ip->smp);
}


static int
sampledat(			/* does ray's surface sample light fields? */
	const RAY  *r
)
{
	int  n = ambounce > 1 ? ambounce : 1;
				/* as deep as blind rays would see them */
	if (inglintray())
		return(0);
	if (r->crtype & AMBIENT)
		for ( ; r != NULL; r = r->parent)
			if (r->rtype & AMBIENT && --n <= 0)
				return(0);
	return(1);
}


int
ilfpart(			/* which part does a ray see? */
	ILFMAT  *ip,
	RAY  *r
)
{
	const RAY  *rp = r;
				/* go back to where it was scattered */
	while (rp->rtype & TRANS && rp->parent != NULL &&
			DOT(rp->rdir, rp->parent->rdir) >= 1. - 1e-9)
		rp = rp->parent;
	if (r->crtype & SHADOW) {	/* aimed at us, and not deflected */
		if (!(rp->rtype & SHADOW) | (r->rsrc != ip->sn))
			return(ILF_NONE);
		if (inglintray())
			return(glintmet(rp) ? ILF_GLINT : ILF_NONE);
		return(ILF_EXCESS);
	}
	if (inglintray())
		return(rp->rtype & REFLECTED && glintmet(rp) ?
				ILF_GLINT : ILF_NONE);
	if (rp->rtype & (AMBIENT|SPECULAR))
		return(ILF_BASE);	/* surface sampled the rest */
	if (rp->rtype & REFLECTED && rp->parent != NULL &&
			glintdone(ip, rp->parent))
		return(ILF_BASE);	/* counted as a glint */
	return(ILF_ALL);
}


double
reflup(				/* part of Gaussian lobe reflected upwards */
	double  cosv,		/* cosine of view to normal */
	double  au2,		/* squared roughness along u */
	double  av2,		/* and along v */
	double  uang2		/* squared cosine of view's azimuth from u */
)
/*
 *	Of normals (x, y, 1), with x towards the viewer at tan t, those
 *  mirror the view upwards that have (x-t)^2 + y^2 < 1 + t^2.  The slopes'
 *  variances are au2/2 and av2/2; x given y is a Gaussian again.
 */
{
					/* Gauss-Hermite quadrature in y */
	static const double  node[8] = {
		0.2734810461381524, 0.8229514491446559,
		1.380258539198881, 1.951787990916254,
		2.546202157847481, 3.176999161979956,
		3.869447904860123, 4.688738939305819};
	static const double  wt[8] = {
		0.2865685212380121, 0.1583383727509496,
		0.04728475235401403, 0.007266937601184743,
		0.0005259849265739094, 1.530003216248732e-05,
		1.309473216286819e-07, 1.497814723161831e-10};
	double  t, vx, vy, vxy, s, y, m, h, sum = 0;
	int  i;

	if (cosv < .001)
		cosv = .001;
	t = sqrt(1. - cosv*cosv)/cosv;
	vx = .5*(uang2*au2 + (1.-uang2)*av2);
	vy = .5*(uang2*av2 + (1.-uang2)*au2);
	vxy = .5*sqrt(uang2*(1.-uang2))*(au2 - av2);	/* sign is no matter */
	s = vx - vxy*vxy/vy;
	if (s <= FTINY*FTINY)
		return(1.);
	s = sqrt(2.*s);
	for (i = 0; i < 16; i++) {
		y = sqrt(2.*vy) * (i < 8 ? node[i] : -node[i-8]);
		h = 1. + t*t - y*y;
		if (h <= 0.)
			continue;
		h = sqrt(h);
		m = vxy/vy * y;
		sum += wt[i&7] * .5*(erf((t+h-m)/s) - erf((t-h-m)/s));
	}
	return(sum > .01 ? sum : .01);
}


static double
excessat(			/* look up excess, nothing being traced */
	ILFMAT  *ip,
	FVECT  org,
	FVECT  dir,
	double  dist		/* about how far away the light is */
)
{
	ilf_error  err;
	ilf_mode  mode = ILF_NO_DEPTH;
	FVECT  hit;
	float  rgb[3];

	if (ip->mode == ILF_DEPTH && dist < FHUGE) {
		VSUM(hit, org, dir, dist);
		mode = ILF_DEPTH;
	} else {
		VCOPY(hit, org);
	}
	if (ilf_eval(rgb, ip->file->field, &ip->frame, NULL, dir, hit,
			mode, &err) != ILF_OK)
		ilferror(ip->m, &err);
	return(ilf_luminance(rgb) * ilf_excess_part(rgb,
			ilf_sampler_threshold(ip->smp)));
}


static int
drawcands(			/* draw and weigh candidates */
	int  nc,
	ILFMAT  *ip,
	ilf_slice  *sp,
	RAY  *r,
	srcdirf_t  *f,
	void  *p,
	double  *wsum,
	double  *w2sum
)
{
	ilf_draw  dr;
	ILFCND  *cp;
	double  x0, x1, x2, d, x;
	int  i, j;
	
	if (nc > maxcand) {
		cand = (ILFCND *)realloc((void *)cand, nc*sizeof(ILFCND));
		if (cand == NULL)
			error(SYSTEM, "out of memory in drawcands");
		maxcand = nc;
	}
	dimlist[ndims++] = ip->sn + 8713;
	x0 = urand(ilhash(dimlist,ndims)+samplendx);
	ndims--;
	x1 = frandom();
	x2 = frandom();
	*wsum = *w2sum = 0;
	cp = cand;
	for (i = 0; i < nc; i++) {
					/* additive recurrence in a cell */
		x1 += 0.75487766624669276; x1 -= (x1 >= 1.);
		x2 += 0.56984029099805327; x2 -= (x2 >= 1.);
		ilf_sample(&dr, sp, (i+x0)/nc, x1, x2);
		for (j = 0; j < 3; j++)
			cp->dir[j] = dr.dir[0]*ip->frame.u[j] +
					dr.dir[1]*ip->frame.v[j] +
					dr.dir[2]*ip->frame.n[j];
		(*f)(cp->coef, p, cp->dir, ILFOMEGA);
		if ((d = intens(cp->coef)) <= 0.0)
			continue;
		scalecolor(cp->coef, 1./ILFOMEGA);
		d *= 1./ILFOMEGA;
					/* estimate what's there */
		cp->targ = d * excessat(ip, r->rop, cp->dir, dr.far);
		if (ip->mode == ILF_DEPTH && dr.far >= FHUGE &&
				cp->targ > 0.0) {
			dr.near = dr.far = auxdist(r->rop, cp->dir, ip, r);
			cp->targ = d * excessat(ip, r->rop, cp->dir, dr.far);
		}
		if (ip->mode == ILF_DEPTH) {
			if (dr.near < .98*dr.far) {
				x = d * excessat(ip, r->rop, cp->dir, dr.near);
				if (x > cp->targ)
					cp->targ = x;
			}
			cp->targ += ILFDOUBT * d * (dr.expected +
					ilf_sampler_threshold(ip->smp));
		}
		if (cp->targ <= 0.0)
			continue;
		*wsum += cp->wt = cp->targ / dr.pdf;
		*w2sum += cp->wt*cp->wt;
		cp++;
	}
	ndrawn += nc;
	return(cp - cand);
}


static void
sampleilf(			/* add light field's excess */
	ILFMAT  *ip,
	RAY  *r,
	srcdirf_t  *f,
	void  *p
)
{
	double  wsum, w2sum, step, next, acc, d;
	ilf_past  past;
	ilf_slice  *sp;
	ilf_error  err;
	ILFCND  *cp;
	RAY  sr;
	int  ns, nc, n, k;
					/* which component? */
	n = dirparts;
	if (!sampledat(r))
		n = isglossy(r) ? DIRSPEC : 0;
	if (inglintray())
		n &= DIRSPEC;
	else if (r->rtype & (AMBIENT|SPECULAR) && glintdone(ip, r))
		n &= ~DIRSPEC;
	if (!n)
		return;
	if (ilf_sampler_slice(&sp, ilfsampler(ip, r), r->rop, &err) != ILF_OK)
		ilferror(ip->m, &err);
	if (sp == NULL)
		return;			/* nothing bright from here */
	ns = ilfsamp*r->rweight + .999;
	if (ns < 1) ns = 1;
	if (ns > ilfsamp) ns = ilfsamp;
	nc = ns*ILFCAND;
	ilf_slice_history(sp, &past);
	if (past.tests >= ILFHIST && past.mean2 > 0. && !isglossy(r)) {
		d = ILFCANDCV*sqrt(past.var/past.mean2);
		if (d < ILFCAND)
			nc = ns*(d > ILFFEWCAND ? d : ILFFEWCAND);
		if ((past.visible <= 0.) | (past.visible >= past.tests))
			ns = (ns + ILFSURE-1)/ILFSURE;
		if (past.visible <= 0. && nc > ns*ILFCAND)
			nc = ns*ILFCAND;
	}
	if (nc < ILFMINCAND*r->rweight)
		nc = ILFMINCAND*r->rweight;
	if (nc < ILFLEASTCAND)
		nc = ILFLEASTCAND;
	dirparts = n | DIRBLIND;
	n = drawcands(nc, ip, sp, r, f, p, &wsum, &w2sum);
	dirparts = DIRDIFF|DIRSPEC;
	if (!n)
		return;
					/* choose in order of map */
	step = wsum/ns;
	next = step*frandom();
	memset(&past, 0, sizeof(past));
	if (!isglossy(r)) {
		past.mean2 = wsum*wsum/((double)nc*nc);
		past.var = w2sum/nc - past.mean2;
	}
	acc = 0.;
	for (cp = cand; n-- > 0; cp++) {
		acc += cp->wt;
		for (k = 0; next < acc; next += step)
			k++;
		if (!k)
			continue;
		rayorigin(&sr, SHADOW, r, NULL);
		VCOPY(sr.rdir, cp->dir);
		sr.rsrc = ip->sn;
		d = k * step/(nc*cp->targ);
		copycolor(sr.rcoef, cp->coef);
		scalecolor(sr.rcoef, d);
		rayvalue(&sr);
		ntraced++;
		past.tests += k;
		if ((colval(sr.rcol,RED) != 0.0) |	/* a channel of it */
				(colval(sr.rcol,GRN) != 0.0) |	/* may be < 0 */
				(colval(sr.rcol,BLU) != 0.0)) {
			multcolor(sr.rcol, sr.rcoef);
			addcolor(r->rcol, sr.rcol);
			past.visible += k;
		}
	}
	if (!inglintray())
		ilf_slice_record(sp, &past);
}


void
ilfdirect(			/* add direct part of light fields */
	RAY  *r,
	srcdirf_t  *f,
	void  *p
)
{
	ILFMAT  *ip;

	for (ip = ilfmats; ip != NULL; ip = ip->next) {
		if (ip->sn < 0)
			continue;	/* not sampled */
		if (!ilf_sampler_patches(ilfsampler(ip, r)))
			continue;	/* nothing bright */
		sampleilf(ip, r, f, p);
		if (!inglintray())
			ilfglints(ip, r, f, p);
	}
}


void
ilfsrcreport(void)		/* print what was sampled */
{
	double  npatches = 0, nslices = 0;
	ILFMAT  *ip;
	int  n = 0;

	for (ip = ilfmats; ip != NULL; ip = ip->next) {
		n += (ip->sn >= 0);
		if (ip->smp != NULL) {
			npatches += ilf_sampler_patches(ip->smp);
			nslices += ilf_sampler_slices(ip->smp);
		}
	}
	if (!n)
		return;
	sprintf(errmsg,
"light fields: %.0f bright patches in %.2f s, %.0f slices, %lu candidates, %lu shadow rays\n",
			npatches, setuptime, nslices, ndrawn, ntraced);
	eputs(errmsg);
}
