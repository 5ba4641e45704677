/*
 * ilfshiny.h - shiny materials and balls, for m_ilf.c.  Include after ray.h.
 */
#ifndef _RAD_ILFSHINY_H_
#define _RAD_ILFSHINY_H_

#ifdef __cplusplus
extern "C" {
#endif
					/* roughness, -1 if it isn't shiny */
extern double	shininess(const OBJREC *m);
					/* is ray's surface shiny but rough? */
extern int	isglossy(const RAY *r);
					/* list scene's shiny balls, to be freed */
extern int	shinyballs(OBJREC ***balls);

#ifdef __cplusplus
}
#endif
#endif /* _RAD_ILFSHINY_H_ */
