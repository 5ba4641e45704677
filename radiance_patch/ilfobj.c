/*
 * Materials' light fields:  arguments, open files, planes
 *
 *  External symbols declared in ilfobj.h, and in rtotypes.h
 */

#include "copyright.h"

#include  "standard.h"
#include  "object.h"
#include  "ilf.h"
#include  "ilfobj.h"

/*
 *	Arguments for an incident light field are:
 *
 *  1+ file.ilf.exr [depth|nodepth]
 *  0
 *  0
 *
 *	or, to place the light field's plane in the scene:
 *
 *  9  Ox Oy Oz  Ux Uy Uz  Vx Vy Vz
 *  12 Ox Oy Oz  Ux Uy Uz  Vx Vy Vz  Nx Ny Nz
 *
 *  The file is found along RAYPATH.  O is the corner of the sampled
 *  rectangle and U, V its edges, in place of what the file's header
 *  says; N, along plus or minus U x V, says on which side the light is.
 */


static ILFMAT *
newilf(				/* get room for a light field */
	const ILFMAT  *base
)
{
	ILFMAT  *ip = (ILFMAT *)calloc(1, sizeof(ILFMAT));

	if (ip == NULL || (ip->frame = (ilf_frame *)malloc(sizeof(ilf_frame))) == NULL)
		error(SYSTEM, "out of memory in newilf");
	if (base != NULL) {		/* nothing but the field is shared */
		ip->file = base->file;
		ip->depth = base->depth;
		ip->place = base->place;
	}
	ip->sn = -1;
	return(ip);
}


static void
dropilf(			/* free all but the file */
	ILFMAT  *ip
)
{
	ILFMAT  **ipp;

	for (ipp = &ilflist.shown; *ipp != NULL; ipp = &(*ipp)->next)
		if (*ipp == ip) {
			*ipp = ip->next;
			break;
		}
	ilf_sampler_close(ip->sampler);
	ilf_patches_close(ip->bright);
	free((void *)ip->ball);
	free((void *)ip->frame);
	free((void *)ip);
}


ILFMAT *
getilf(				/* get (open) material's light field */
	OBJREC  *m
)
{
	ILFMAT  *ip;
	ilf_error  err;
	RREAL  *fa;

	if ((ip = (ILFMAT *)m->os) != NULL)
		return(ip);
					/* check arguments */
	if ((m->oargs.nsargs < 1) | (m->oargs.nsargs > 2))
		objerror(m, USER,
			"expected string arguments: file [depth|nodepth]");
	if ((m->oargs.nfargs != 0) & (m->oargs.nfargs != 9) &
			(m->oargs.nfargs != 12))
		objerror(m, USER,
			"expected 0, 9 or 12 real arguments (O U V [N])");
	ip = newilf(NULL);
	ip->depth = 1;
	if (m->oargs.nsargs > 1) {
		if (!strcmp(m->oargs.sarg[1], "nodepth"))
			ip->depth = 0;
		else if (strcmp(m->oargs.sarg[1], "depth")) {
			sprintf(errmsg,
	"expected \"depth\" or \"nodepth\" as second argument, found \"%.64s\"",
					m->oargs.sarg[1]);
			objerror(m, USER, errmsg);
		}
	}
	ip->file = ilfopen(m);
	*ip->frame = *ilf_get_frame(ip->file->field);
	fa = m->oargs.farg;
	if (m->oargs.nfargs && ilf_frame_init(ip->frame, fa, fa+3, fa+6,
			m->oargs.nfargs == 12 ? fa+9 : NULL, &err) != ILF_OK)
		ilferror(m, &err);
	if (ilf_check_frame(ip->file->field, ip->frame, &err) != ILF_OK)
		ilferror(m, &err);
	return((ILFMAT *)(m->os = (char *)ip));
}


ILFMAT *
placeilf(			/* place light field once more */
	ILFMAT  *base,
	const FULLXF  *xf,
	OBJREC  *m
)
{
	FVECT  o, u, v, n;
	ilf_error  err;
	ILFMAT  *ip = newilf(base);

	ip->xf = *xf;
	ip->inside = 1;
	ilfplane(base, o, u, v);
	multp3(o, o, ip->xf.f.xfm);
	multv3(u, u, ip->xf.f.xfm);
	multv3(v, v, ip->xf.f.xfm);
	multv3(n, base->frame->n, ip->xf.f.xfm);
	if (ilf_frame_init(ip->frame, o, u, v, n, &err) != ILF_OK)
		ilferror(m, &err);
	return(base->place = ip);
}


void
freeilf(			/* free material's light field */
	OBJREC  *m
)
{
	ILFMAT  *ip = (ILFMAT *)m->os;
	ILFMAT  *pp;
	ILFFILE  *fp;

	if (ip == NULL)
		return;
	fp = ip->file;
	while ((pp = ip->place) != NULL) {
		ip->place = pp->place;
		dropilf(pp);
	}
	dropilf(ip);
	ilfclose(fp);
	m->os = NULL;
}


int
ilfplane(			/* where does light field's plane lie? */
	const ILFMAT  *ip,
	FVECT  o,		/* its corner */
	FVECT  u,		/* and edges */
	FVECT  v
)				/* returns side of u x v where light is */
{
	const ilf_frame  *fp = ip->frame;
	FVECT  n;
	int  i;

	VCOPY(o, fp->origin);
	for (i = 0; i < 3; i++) {
		u[i] = fp->u[i]*fp->len_u;
		v[i] = fp->v[i]*fp->len_v;
	}
	VCROSS(n, u, v);
	return(DOT(n, fp->n) < 0. ? '-' : '+');
}


unsigned long long
ilfvalues(			/* get number that tells field's values */
	const ILFMAT  *ip
)
{
	ilf_error  err;
	uint64_t  digest;

	if (ilf_digest(&digest, ip->file->field, &err) != ILF_OK)
		ilferror(ip->m, &err);
	return(digest);
}


void
ilfreport(void)			/* print what light fields were used */
{
	double  npatches = 0, setup = 0;
	ilf_work  sum, work;
	ILFMAT  *ip;
	int  n = 0;

	ilffilereport();
	memset(&sum, 0, sizeof(sum));
	for (ip = ilflist.shown; ip != NULL; ip = ip->next) {
		n += (ip->sn >= 0);
		if (ip->sampler == NULL)
			continue;
		npatches += ilf_patches_count(ip->bright);
		setup += ip->setup;
		ilf_sampler_work(&work, ip->sampler);
		sum.slices += work.slices;
		sum.candidates += work.candidates;
		sum.rays += work.rays;
	}
	if (!n)
		return;
	sprintf(errmsg,
"light fields: %.0f bright patches in %.2f s, %ld slices, %ld candidates, %ld shadow rays\n",
			npatches, setup, (long)sum.slices,
			(long)sum.candidates, (long)sum.rays);
	eputs(errmsg);
}
