/*
 * ilfmark.h - where light fields are shown, for m_ilf.c.  Include after ray.h and ilfobj.h.
 */
#ifndef _RAD_ILFMARK_H_
#define _RAD_ILFMARK_H_

#ifdef __cplusplus
extern "C" {
#endif
					/* light field as placed where ray met */
extern ILFMAT	*ilfplaced(ILFMAT *ip, const RAY *r);
					/* did ray meet this light field? */
extern int	ilfseen(const ILFMAT *ip, const RAY *r);
					/* is it a source for this ray? */
extern int	ilfaimed(const ILFMAT *ip, const RAY *r);
					/* say that it isn't a source */
extern void	ilfliteral(ILFMAT *ip, OBJREC *m, const RAY *r);

#ifdef __cplusplus
}
#endif
#endif /* _RAD_ILFMARK_H_ */
