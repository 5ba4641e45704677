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
	struct ilffile  *next;
}  ILFFILE;			/* an open file, shared by materials */

typedef struct ilfmat {
	ILFFILE  *file;			/* our file */
	ilf_frame  frame;		/* plane in the material's space */
	ilf_mode  mode;			/* depth correction */
	OBJREC  *m;			/* our material */
	int  sn;			/* source to aim at, -1 if none */
	ilf_sampler  *smp;		/* what is bright, NULL till needed */
	struct ilfmat  *next;		/* next to be sampled */
}  ILFMAT;			/* a material's light field */

					/* which part of the radiance counts */
#define  ILF_NONE	0
#define  ILF_BASE	01		/* what is sampled blindly */
#define  ILF_EXCESS	02		/* what is sampled as a source */
#define  ILF_ALL	(ILF_BASE|ILF_EXCESS)

	/* m_ilf.c */
					/* get (open) a material's light field */
extern ILFMAT	*getilf(OBJREC *m);
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

#ifdef __cplusplus
}
#endif
#endif /* _RAD_ILFSRC_H_ */
