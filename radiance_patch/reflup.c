/*
 * Part of a rough surface's Gaussian lobe that is reflected upwards
 *
 *  External symbols declared in source.h
 */

#include "copyright.h"

#include  "rtmath.h"

#define  LEASTCOS	.001		/* flatter views count as this */
#define  LEASTPART	.01		/* Radiance's tries find no less */


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

	if (cosv < LEASTCOS)
		cosv = LEASTCOS;
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
	return(sum > LEASTPART ? sum : LEASTPART);
}
