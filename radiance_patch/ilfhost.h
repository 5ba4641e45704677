/*
 * ilfhost.h - what differs between the Radiances that our files are compiled with.
 *
 * Our files speak as Radiance 6 does:  of spectral colors, and of the side to
 * which a ray leaves its surface.  Earlier ones have three channels in
 * place of a spectrum (and color.h without NCSAMP), and don't tell the sides apart.
 *
 * Include after ray.h and otypes.h.
 */
#ifndef _RAD_ILFHOST_H_
#define _RAD_ILFHOST_H_

#ifndef NCSAMP

#define  MAT_WGMDF		(-1)	/* no such material */

#define  NCSAMP			3
#define  SCOLOR			COLOR

#define  setscolor(sc,r,g,b)	setcolor(sc,r,g,b)
#define  scolorblack(sc)	setcolor(sc, 0.0, 0.0, 0.0)
#define  copyscolor(sc1,sc2)	copycolor(sc1,sc2)
#define  scalescolor(sc,sf)	scalecolor(sc,sf)
#define  smultscolor(sc1,sc2)	multcolor(sc1,sc2)
#define  saddscolor(sc1,sc2)	addcolor(sc1,sc2)
#define  sintens(sc)		intens(sc)

#define  ndims_inc()		(ndims++)
#define  dec_ndims()		(ndims--)

#define  RSHADOW		SHADOW
#define  TSHADOW		SHADOW
#define  RAMBIENT		AMBIENT
#define  TAMBIENT		AMBIENT
#define  thrudir(r,v)		0

#endif
				/* type of ray from r's surface to d */
#define  shadowtype(r,d)	(thrudir(r,d) ? TSHADOW : RSHADOW)
#define  ambienttype(r,d)	(thrudir(r,d) ? TAMBIENT : RAMBIENT)

#endif /* _RAD_ILFHOST_H_ */
