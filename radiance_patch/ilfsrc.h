/*
 * ilfsrc.h - what Radiance's own files call of incident light fields.
 *
 * Include after ray.h.
 */
#ifndef _RAD_ILFSRC_H_
#define _RAD_ILFSRC_H_

#ifdef __cplusplus
extern "C" {
#endif

extern int	ilfsamp;	/* samples of light fields per point (-di) */

struct ilfmat;
	/* ilfobj.c */
					/* get (open) a material's light field */
extern struct ilfmat	*getilf(OBJREC *m);
					/* print what light fields were used */
extern void	ilfreport(void);
	/* ilfmark.c */
					/* find surfaces of light fields */
extern int	markilfs(int lit);
					/* have them refuse what they find */
extern void	noilfs(char *why);
	/* ilfamb.c */
					/* tell ambient file's light fields */
extern void	ilfputamb(FILE *fp);
					/* check ambient file's light fields */
extern void	ilfcheckamb(FILE *fp);

#ifdef __cplusplus
}
#endif
#endif /* _RAD_ILFSRC_H_ */
