/*
 * ilfobj.h - materials' light fields, and the list of them.
 *
 * Include after object.h and rtmath.h (ray.h does).  What libilf's types hold is known to those who include
 * ilf.h besides.
 */
#ifndef _RAD_ILFOBJ_H_
#define _RAD_ILFOBJ_H_

#ifdef __cplusplus
extern "C" {
#endif

struct ilf_error;

typedef struct ilffile {
	char  *path;			/* file path as found */
	struct ilf  *field;		/* open light field */
	int  nused;			/* number of materials using it */
	long  tick;			/* clock when last found unchanged */
	struct ilffile  *next;
}  ILFFILE;			/* an open file, shared by materials */

typedef struct ilfmat {
	ILFFILE  *file;			/* our file */
	struct ilf_frame  *frame;	/* plane in the world's space, or in
					   the material's where that is moved */
	int  depth;			/* depth correction? */
	OBJREC  *m;			/* our material, if marked */
	int  sn;			/* source to aim at, -1 if none */
	struct ilf_patches  *bright;	/* what is bright, NULL till needed */
	struct ilf_sampler  *sampler;	/* what was drawn from it */
	OBJREC  **ball;			/* shiny balls as libilf knows them */
	double  setup;			/* CPU seconds finding all that */
	int  marked;			/* do surfaces show it? */
	int  mixed;			/* some by more than their material? */
	int  warned;			/* said that it's literal */
	int  inside;			/* is it in an instance? */
	FULLXF  xf;			/* where then */
	struct ilfmat  *place;		/* same in (another) instance */
	struct ilfmat  *next;		/* next that surfaces show */
}  ILFMAT;			/* a material's light field */

typedef struct {
	ILFFILE  *file;			/* open files */
	ILFMAT  *shown;			/* light fields that surfaces show */
	int  nplaces;			/* places in instances */
	int  nsubst;			/* shown by illums' and mirrors' substitutes */
	int  looked;			/* did we look for all? */
	int  caught;			/* do we see to changed files? */
	char  *unwanted;		/* why they are refused, or NULL */
}  ILFLIST;

extern ILFLIST	ilflist;	/* all light fields that are open */

	/* ilffile.c */
					/* report libilf's error */
extern void	ilferror(OBJREC *m, struct ilf_error *ep);
					/* get (open) a material's file */
extern ILFFILE	*ilfopen(OBJREC *m);
					/* let go of it */
extern void	ilfclose(ILFFILE *fp);
					/* is it what it was? */
extern void	ilfwatch(ILFFILE *fp);
					/* print what of the files was used */
extern void	ilffilereport(void);

	/* ilfobj.c */
					/* get (open) a material's light field */
extern ILFMAT	*getilf(OBJREC *m);
					/* the same, moved with an instance */
extern ILFMAT	*placeilf(ILFMAT *base, const FULLXF *xf, OBJREC *m);
					/* where does its plane lie?  -> side */
extern int	ilfplane(const ILFMAT *ip, FVECT o, FVECT u, FVECT v);
					/* number that tells its values */
extern unsigned long long	ilfvalues(const ILFMAT *ip);

#ifdef __cplusplus
}
#endif
#endif /* _RAD_ILFOBJ_H_ */
