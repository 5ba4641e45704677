/*
 * ilfsrc.h - what the renderers know of incident light fields (m_ilf.c, ilfsrc.c).
 *
 * Include after ray.h.
 */
#ifndef _RAD_ILFSRC_H_
#define _RAD_ILFSRC_H_

#include "ilf.h"

#ifdef __cplusplus
extern "C" {
#endif

extern int	ilfsamp;	/* samples of light fields per point (-di) */

typedef struct ilffile {
	char  *path;			/* file path as found */
	ilf  *field;			/* open light field */
	int  nused;			/* number of materials using it */
	long  tick;			/* clock when last found unchanged */
	struct ilffile  *next;
}  ILFFILE;			/* an open file, shared by materials */

typedef struct ilfmat {
	ILFFILE  *file;			/* our file */
	ilf_frame  frame;		/* plane in the material's space */
	ilf_mode  mode;			/* depth correction */
	OBJREC  *m;			/* our material */
	int  sn;			/* source to aim at, -1 if none */
	ilf_sampler  *smp;		/* what is bright, NULL till needed */
	struct ilfball  *ball;		/* shiny balls that show lamps */
	int  nballs;			/* number of balls, -1 till known */
	struct ilfmat  *next;		/* next to be sampled */
}  ILFMAT;			/* a material's light field */

					/* which part of the radiance counts */
#define  ILF_NONE	0
#define  ILF_BASE	01		/* what is sampled blindly */
#define  ILF_EXCESS	02		/* what is sampled as a source */
#define  ILF_ALL	(ILF_BASE|ILF_EXCESS)
#define  ILF_GLINT	04		/* excess that a glint ray looks for */

#define  ILFOMEGA	1e-6		/* solid angle for coefficients: none
					   of Radiance's functions may widen
					   its lobe by it */

	/* m_ilf.c */
					/* get (open) a material's light field */
extern ILFMAT	*getilf(OBJREC *m);
					/* report libilf's error */
extern void	ilferror(OBJREC *m, ilf_error *ep);
					/* print what light fields were used */
extern void	ilfreport(void);

	/* ilfsrc.c */
					/* note surface o made of ilf m */
extern void	markilf(OBJREC *o, OBJREC *m);
					/* find (once) what is bright */
extern ilf_sampler	*ilfsampler(ILFMAT *ip);
					/* which part a ray sees that met an ilf */
extern int	ilfpart(ILFMAT *ip, RAY *r);
					/* forget material about to be freed */
extern void	dropilf(ILFMAT *ip);
					/* print what was sampled */
extern void	ilfsrcreport(void);

	/* ilfglint.c */
					/* is ray's surface shiny but rough? */
extern int	isglossy(const RAY *r);
					/* does a glint cone count this ray? */
extern int	glintdone(ILFMAT *ip, const RAY *ar);
					/* is a glint ray being traced? */
extern int	inglintray(void);
					/* does its continuation r count? */
extern int	glintmet(const RAY *r);
					/* count what it found */
extern void	glintadd(const RAY *r);

#ifdef _RAD_SOURCE_H_
					/* add light field's glints on balls */
extern void	ilfglints(ILFMAT *ip, RAY *r, srcdirf_t *f, void *p);
#endif

#ifdef __cplusplus
}
#endif
#endif /* _RAD_ILFSRC_H_ */
