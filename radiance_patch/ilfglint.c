/*
 * Glints of light fields on shiny spheres
 *
 *  External symbols declared in ilfsrc.h
 */

#include "copyright.h"

#include  "ray.h"
#include  "otypes.h"
#include  "otspecial.h"
#include  "source.h"
#include  "random.h"
#include  "ambient.h"
#include  "ilfsrc.h"

/*
 *	A matt surface beside a mirror ball sees the light field's lamps
 *  mirrored in the ball.  These glints are too small for blind ambient
 *  rays, one of which in ten thousand finds one and makes a white dot.
 *  But in a sphere we can tell where they are.  With the ball's center
 *  C and radius R, our point X at distance D, and the lamp at angle g from
 *  X as seen from C, the glint is at angle b where both angles to the
 *  normal are equal:
 *
 *		      lamp
 *	       n  .    /	atan2(D sin b, D cos b - R) = g - b
 *		\b|  /
 *	   -----( C )------ X	(the left side rises with b, from 0
 *				to 90 degrees where X sees the rim)
 *
 *	A ball demagnifies more in the plane of incidence than across, so
 *  that a round lamp's glint is an ellipse.  A cone around each glint is
 *  sampled on its own (as a Gaussian where the ball is rough), and ambient and
 *  scattered rays that leave the point inside a cone and find the lamp in
 *  that ball drop its excess.  This divides directions between the two, so
 *  that their sum has the right mean wherever we put the cones.  A point's
 *  matt component gets cones if the point is not itself seen by an
 *  ambient ray, its glossy component always.
 */

#define  MAXBALL	64		/* with more we don't begin */
#define  MAXLAMP	16		/* bright places per ball */
#define  MAXGLINT	64		/* glints per point */
#define  GLINTMARG	1.15		/* widen cones to cover glint */
#define  LOBEFALL	4.		/* lobe's exponent at the cone's edge */
#define  LOBEWIDE	4.		/* reflected lobe's reach over alpha */
#define  GLINTRAYS	.5		/* rays per glint over samples */
#define  MAXGRAY		16		/* rays per glint */

typedef struct ilfball {
	OBJREC  *o;			/* sphere */
	double  alpha;			/* roughness */
	int  nl;			/* number of lamps */
	ilf_lamp  lamp[MAXLAMP];
}  ILFBALL;			/* a shiny ball and what it sees */

typedef struct {
	OBJREC  *o;			/* in which ball */
	double  fall;			/* Gaussian's exponent at its edge */
	FVECT  dir;			/* direction from our point */
	FVECT  u, v;			/* in plane of incidence, across */
	double  tu, tv;			/* tangents of its half angles */
}  GLINT;			/* an elliptic cone that sees a glint */

static const RAY  *glintray = NULL;	/* glint ray being traced */
static OBJREC  *glintball = NULL;	/* ball it should hit */
static COLOR  glintsum;			/* what it finds */


static double
shininess(			/* roughness of a shiny material */
	OBJREC  *m		/* returns -1 if it isn't shiny */
)
{
	RREAL  *fa = m->oargs.farg;

	switch (m->otype) {
	case MAT_MIRROR:
	case MAT_DIELECTRIC:
	case MAT_INTERFACE:
		return(0.);
	case MAT_PLASTIC:
	case MAT_METAL:
	case MAT_TRANS:
		if (m->oargs.nfargs >= 5 && fa[3] > .001)
			return(fa[4]);
		break;
	case MAT_PLASTIC2:
	case MAT_METAL2:
	case MAT_TRANS2:
		if (m->oargs.nfargs >= 6 && fa[3] > .001)
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
			(shininess(m) > FTINY));
}


static void
findballs(			/* find the scene's shiny balls */
	ILFMAT  *ip,
	const RAY  *r
)
{
	ILFBALL  *bp;
	OBJREC  *o, *m;
	ilf_error  err;
	double  alpha;
	int  i;

	ip->nballs = 0;
	for (i = 0; i < nsceneobjs; i++) {
		o = objptr(i);
		if (o->otype != OBJ_SPHERE || o->omod == OVOID ||
				o->oargs.nfargs != 4 ||
				o->oargs.farg[3] <= FTINY ||
				(m = findmaterial(o)) == NULL ||
				(alpha = shininess(m)) < 0.)
			continue;
		if (ip->nballs >= MAXBALL) {	/* too many to look at */
			free((void *)ip->ball);
			ip->ball = NULL;
			ip->nballs = 0;
			return;
		}
		ip->ball = (ILFBALL *)realloc((void *)ip->ball,
				(ip->nballs+1)*sizeof(ILFBALL));
		if (ip->ball == NULL)
			error(SYSTEM, "out of memory in findballs");
		bp = ip->ball + ip->nballs;
		bp->o = o;
		bp->alpha = alpha;
		if (ilf_sampler_lamps(bp->lamp, &bp->nl, MAXLAMP,
				ilfsampler(ip, r), o->oargs.farg,
				o->oargs.farg[3], &err) != ILF_OK)
			ilferror(ip->m, &err);
		ip->nballs += (bp->nl > 0);
	}
}


static int
glintnormal(			/* find normal where lamp is mirrored */
	FVECT  n,
	FVECT  e,		/* from center towards point */
	double  D,		/* distance from center to point */
	double  R,		/* radius */
	FVECT  l		/* towards lamp */
)
{
	double  g, b, lo, hi, f, c, s;
	FVECT  t;
	int  i;

	c = DOT(e, l);
	g = acos(c < -1. ? -1. : c > 1. ? 1. : c);
	for (i = 0; i < 3; i++)
		t[i] = l[i] - c*e[i];
	if (normalize(t) < FTINY) {
		if (c < 0.)
			return(0);		/* lamp behind ball */
		VCOPY(n, e);
		return(1);
	}
	lo = 0.;
	hi = acos(R/D);				/* rim as seen from point */
	if (g < hi)
		hi = g;
	else if (g - hi > PI/2.)
		return(0);			/* ball hides lamp's image */
	b = .5*(lo + hi);
	for (i = 0; i < 20; i++) {		/* Newton, kept in bounds */
		c = cos(b); s = sin(b);
		f = atan2(D*s, D*c - R) - (g - b);
		if (f > 0.) hi = b;
		else lo = b;
		if (fabs(f) < 1e-7)
			break;
		b -= f / (1. + D*(D - R*c)/(D*D + R*R - 2.*D*R*c));
		if ((b <= lo) | (b >= hi))
			b = .5*(lo + hi);
	}
	c = cos(b); s = sin(b);
	VSUM(n, t, t, s-1.);
	for (i = 0; i < 3; i++)
		n[i] = c*e[i] + s*t[i];
	return(1);
}


static int
setglints(			/* find glints from a point */
	GLINT  *gl,
	ILFMAT  *ip,
	const RAY  *r,		/* ray that is at the point, or begins there */
	const FVECT  x
)
{
	ILFBALL  *bp;
	ilf_lamp  *lp;
	FVECT  e, l, n, d;
	double  R, D, dist, dl, cosi, rad, most;
	GLINT  *gp;
	RREAL  *fa;
	int  i, k, ng = 0;

	if (ip->nballs < 0)
		findballs(ip, r);
	for (bp = ip->ball; bp < ip->ball+ip->nballs; bp++) {
		fa = bp->o->oargs.farg;
		R = fa[3];
		VSUB(e, x, fa);
		if ((D = normalize(e)) <= R*1.0001)
			continue;		/* on or in the ball */
		for (lp = bp->lamp; lp < bp->lamp+bp->nl; lp++) {
			if (ng >= MAXGLINT)
				return(ng);
			VSUB(l, lp->position, fa);
			normalize(l);
			for (k = 0; k < 2; k++) {	/* lamp from center, */
				if (!glintnormal(n, e, D, R, l))
					break;		/* then from glint */
				for (i = 0; i < 3; i++)
					l[i] = lp->position[i] - fa[i] - R*n[i];
				dl = normalize(l);
			}
			if (k < 2)
				continue;
			for (i = 0; i < 3; i++)
				d[i] = fa[i] + R*n[i] - x[i];
			dist = normalize(d);
			if ((cosi = -DOT(d, n)) <= .01)
				continue;
			rad = lp->radius < dl ? asin(lp->radius/dl) : PI/2.;
			rad = GLINTMARG*(rad + LOBEWIDE*bp->alpha);
			most = asin(R/D);	/* the ball's own */
			gp = gl + ng++;
			gp->o = bp->o;
			gp->fall = bp->alpha > FTINY ? LOBEFALL : 0.;
			VCOPY(gp->dir, d);
			VCROSS(gp->v, d, n);
			if (normalize(gp->v) < 1e-6)
				getperpendicular(gp->v, d, 0);
			VCROSS(gp->u, gp->v, d);
						/* the ball demagnifies */
			gp->tu = rad/(1. + 2.*dist/(R*cosi));
			gp->tv = rad/(1. + 2.*dist*cosi/R);
			gp->tu = tan(gp->tu < most ? gp->tu : most);
			gp->tv = tan(gp->tv < most ? gp->tv : most);
		}
	}
	return(ng);
}


static int
inglint(			/* first glint cone that holds direction */
	const GLINT  *gl,
	int  ng,
	const FVECT  dir
)
{
	double  c, x, y;
	int  i;

	for (i = 0; i < ng; i++) {
		if ((c = DOT(gl[i].dir, dir)) <= FTINY)
			continue;
		x = DOT(gl[i].u, dir)/(c*gl[i].tu);
		y = DOT(gl[i].v, dir)/(c*gl[i].tv);
		if (x*x + y*y <= 1.)
			return(i);
	}
	return(-1);
}


static int
glintparts(			/* which components does a point give cones? */
	const RAY  *r
)
{
	return((ambounce > 0 && !(r->crtype & AMBIENT) ? DIRDIFF : 0) |
			(isglossy(r) ? DIRSPEC : 0));
}


int
glintdone(			/* does a glint cone count this ray? */
	ILFMAT  *ip,
	const RAY  *ar		/* ray that met a shiny surface */
)
{
	static GLINT  gl[MAXGLINT];
	int  i, n;

	if (ar->ro == NULL || ar->ro->otype != OBJ_SPHERE || ar->parent == NULL)
		return(0);
	if (!(glintparts(ar->parent) & (ar->rtype == AMBIENT ? DIRDIFF :
			ar->rtype == SPECULAR ? DIRSPEC : 0)))
		return(0);
	n = setglints(gl, ip, ar, ar->rorg);
	i = inglint(gl, n, ar->rdir);
	return(i >= 0 && gl[i].o == ar->ro);
}


int
inglintray(void)		/* is a glint ray being traced? */
{
	return(glintray != NULL);
}


int
glintmet(			/* does its continuation count? */
	const RAY  *r		/* ray leaving the shiny surface */
)
{
	return(r->parent == glintray && glintray->ro == glintball);
}


void
glintadd(			/* count what a glint ray found */
	const RAY  *r
)
{
	COLOR  c;
	
	copycolor(c, r->rcol);
	do
		multcolor(c, r->rcoef);
	while (r != glintray && (r = r->parent) != NULL);
	addcolor(glintsum, c);
}


void
ilfglints(			/* add light field's glints on balls */
	ILFMAT  *ip,
	RAY  *r,
	srcdirf_t  *f,
	void  *p
)
{
	GLINT  gl[MAXGLINT];
	int  savebounce = ambounce;
	FVECT  dir;
	double  omega, z, s, x, y, phi;
	COLOR  coef;
	RAY  gr;
	int  ng, i, j, k, n, parts;

	if (!(parts = glintparts(r)))
		return;
	ng = setglints(gl, ip, r, r->rop);
	for (i = 0; i < ng; i++) {
		n = ilfsamp*r->rweight*GLINTRAYS + .999;
		if (n > MAXGRAY)
			n = MAXGRAY;
		z = frandom();
		phi = frandom();
		for (j = 0; j < n; j++) {	/* over the ellipse */
			s = (j + z)/n;
			omega = PI*gl[i].tu*gl[i].tv;
			if (gl[i].fall > 0.) {	/* density goes as the lobe */
				x = (1. - exp(-gl[i].fall))/gl[i].fall;
				s = -log(1. - s*gl[i].fall*x)/gl[i].fall;
				omega *= x*exp(gl[i].fall*s);
			}
			phi += 0.61803398874989485; phi -= (phi >= 1.);
			s = sqrt(s);
			x = s*gl[i].tu*cos(2.*PI*phi);
			y = s*gl[i].tv*sin(2.*PI*phi);
			for (k = 0; k < 3; k++)
				dir[k] = gl[i].dir[k] + x*gl[i].u[k] +
						y*gl[i].v[k];
			s = 1./sqrt(1. + x*x + y*y);
			omega *= s*s*s;
			normalize(dir);
			if (inglint(gl, i, dir) >= 0)
				continue;	/* an earlier cone's */
			dirparts = parts | DIRBLIND;
			(*f)(coef, p, dir, ILFOMEGA);
			dirparts = DIRDIFF|DIRSPEC;
			if (intens(coef) <= 0.0)
				continue;
			scalecolor(coef, omega/(n*ILFOMEGA));
			if (rayorigin(&gr, AMBIENT, r, coef) < 0)
				continue;
			VCOPY(gr.rdir, dir);
			glintray = &gr;
			glintball = gl[i].o;
			setcolor(glintsum, 0.0, 0.0, 0.0);
			ambounce = 0;		/* nothing but the glint */
			rayvalue(&gr);
			ambounce = savebounce;
			glintray = NULL;
			addcolor(r->rcol, glintsum);
		}
	}
}
