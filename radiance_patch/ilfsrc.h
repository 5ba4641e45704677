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
	OBJREC  *m;			/* our material, if marked */
	int  sn;			/* source to aim at, -1 if none */
	ilf_sampler  *smp;		/* what is bright, NULL till needed */
	struct ilfball  *ball;		/* shiny balls that show lamps */
	int  nballs;			/* number of balls, -1 till known */
	int  marked;			/* do surfaces show it? */
	int  mixed;			/* some by more than their material? */
	int  warned;			/* said that it's literal */
	int  inside;			/* is it in an instance? */
	FULLXF  xf;			/* where then */
	struct ilfmat  *place;		/* same in (another) instance */
	struct ilfmat  *next;		/* next that surfaces show */
}  ILFMAT;			/* a material's light field */

extern ILFMAT	*ilfmats;	/* light fields that surfaces show */

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

	/* ilfmark.c */
					/* find surfaces of light fields */
extern int	markilfs(int lit);
					/* light field as placed where ray met */
extern ILFMAT	*ilfplaced(ILFMAT *ip, const RAY *r);
					/* did ray meet this light field? */
extern int	ilfseen(const ILFMAT *ip, const RAY *r);
					/* is it a source for this ray? */
extern int	ilfaimed(ILFMAT *ip, const RAY *r);
					/* say that it isn't a source */
extern void	ilfliteral(ILFMAT *ip, OBJREC *m, const RAY *r);

	/* ilfamb.c */
					/* tell ambient file's light fields */
extern void	ilfputamb(FILE *fp);
					/* check ambient file's light fields */
extern void	ilfcheckamb(FILE *fp);

	/* ilfsrc.c */
					/* find (once) what is bright */
extern ilf_sampler	*ilfsampler(ILFMAT *ip, const RAY *r);
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
