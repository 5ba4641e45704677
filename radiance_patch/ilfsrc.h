/*
 * ilfsrc.h - what the renderers know of incident light fields (m_ilf.c).
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
					/* get (open) a material's light field */
extern struct ilfmat	*getilf(OBJREC *m);
					/* note surface o made of ilf m */
extern void	markilf(OBJREC *o, OBJREC *m);
					/* print what light fields were used */
extern void	ilfreport(void);

#ifdef __cplusplus
}
#endif
#endif /* _RAD_ILFSRC_H_ */
