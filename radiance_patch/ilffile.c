/*
 * Open files of incident light fields
 *
 *  External symbols declared in ilfobj.h
 */

#include "copyright.h"

#include  <signal.h>
#include  <stdlib.h>
#include  <time.h>
#include  <unistd.h>

#include  "standard.h"
#include  "object.h"
#include  "paths.h"
#include  "ilf.h"
#include  "ilfobj.h"

/*
 *	A file is opened once, however many materials use it, and closed by the
 *  last of them.  It is used where it lies:  if it is written over or cut short
 *  meanwhile, what we computed is a mixture, and we end.
 */

#define  MAXWORDS	300		/* objerror() has room for 512 */

ILFLIST  ilflist;			/* all light fields that are open */

extern char  *progname;


void
ilferror(			/* report libilf's error for a material */
	OBJREC  *m,
	ilf_error  *ep
)
{
	ep->text[MAXWORDS] = '\0';
	objerror(m, USER, ep->text);
}


static void
checkfile(			/* was file left as it was? */
	ILFFILE  *fp
)
{
	ilf_error  err;

	if (ilf_check_unchanged(fp->field, &err) == ILF_OK)
		return;
	eputs(err.text);
	eputs("\n");
	fflush(NULL);
	_exit(1);			/* what we computed is a mixture */
}


void
ilfwatch(			/* the same, as often as the clock ticks */
	ILFFILE  *fp
)
{
	struct timespec  now;

	if (clock_gettime(CLOCK_MONOTONIC_COARSE, &now) < 0 ||
			now.tv_nsec == fp->tick)
		return;
	fp->tick = now.tv_nsec;
	checkfile(fp);
}


static void
ilfcheck(void)			/* were files left as they were till the end? */
{
	ILFFILE  *fp;

	for (fp = ilflist.file; fp != NULL; fp = fp->next)
		checkfile(fp);
}


static void
onfault(			/* a file was cut short while we used it */
	int  signo,
	siginfo_t  *info,
	void  *context
)
{
	const char  *words = NULL, *part[4], *cp;
	char  line[1024];
	ILFFILE  *fp;
	int  i, n = 0;

	for (fp = ilflist.file; (fp != NULL) & (words == NULL); fp = fp->next)
		words = ilf_fault(fp->field, info->si_addr);
	if (words == NULL) {		/* not ours:  do it again, as it was */
		signal(signo, SIG_DFL);
		return;
	}
	part[0] = progname; part[1] = ": fatal - "; part[2] = words;
	part[3] = "\n";
	for (i = 0; i < 4; i++)		/* no stdio in a signal handler */
		for (cp = part[i]; *cp && n < sizeof(line); cp++)
			line[n++] = *cp;
	i = write(2, line, n);
	_exit(1);
}


static void
catchfault(void)		/* see to signals from mapped files */
{
	struct sigaction  act;

	memset(&act, 0, sizeof(act));
	act.sa_sigaction = onfault;
	act.sa_flags = SA_SIGINFO;
	sigaction(SIGBUS, &act, NULL);
}


static void
boundmemory(			/* do as ILF_MEMORY says, if it is set */
	OBJREC  *m,
	ilf  *field
)
{
	char  *megabytes = getenv("ILF_MEMORY"), *rest;
	ilf_error  err;
	double  x;

	if (megabytes == NULL)
		return;
	x = strtod(megabytes, &rest);
	if (rest == megabytes || *rest || !(x > 0) || x > 1e12) {
		sprintf(errmsg,
		"ILF_MEMORY: expected megabytes above 0, found \"%.64s\"",
				megabytes);
		objerror(m, USER, errmsg);
	}
	if (ilf_set_memory(field, (int64_t)(x*1e6), &err) != ILF_OK)
		ilferror(m, &err);
}


ILFFILE *
ilfopen(			/* get light field file for material */
	OBJREC  *m
)
{
	char  *path = getpath(m->oargs.sarg[0], getrlibpath(), R_OK);
	ilf_error  err;
	ILFFILE  *fp;

	if (path == NULL) {
		sprintf(errmsg, "cannot find light field \"%.256s\"",
				m->oargs.sarg[0]);
		objerror(m, USER, errmsg);
	}
	for (fp = ilflist.file; fp != NULL; fp = fp->next)
		if (!strcmp(fp->path, path)) {
			fp->nused++;
			return(fp);
		}
	fp = (ILFFILE *)malloc(sizeof(ILFFILE));
	if (fp == NULL)
		error(SYSTEM, "out of memory in ilfopen");
	if (ilf_open(&fp->field, path, &err) != ILF_OK)
		ilferror(m, &err);
	boundmemory(m, fp->field);
	if (!ilflist.caught++) {
		atexit(ilfcheck);
		catchfault();
	}
	fp->path = savqstr(path);
	fp->nused = 1;
	fp->tick = -1;
	fp->next = ilflist.file;
	return(ilflist.file = fp);
}


void
ilfclose(			/* last user closes file */
	ILFFILE  *fp
)
{
	ILFFILE  **fpp;

	if (--fp->nused)
		return;
	for (fpp = &ilflist.file; *fpp != fp; fpp = &(*fpp)->next)
		;
	*fpp = fp->next;
	checkfile(fp);
	ilf_close(fp->field);
	freeqstr(fp->path);
	free((void *)fp);
}


void
ilffilereport(void)		/* print what of the files was used */
{
	const ilf_info  *ii;
	ilf_usage  use;
	ILFFILE  *fp;

	for (fp = ilflist.file; fp != NULL; fp = fp->next) {
		ii = ilf_get_info(fp->field);
		ilf_get_usage(&use, fp->field);
		sprintf(errmsg,
	"%.256s: %ld of %ld probes used, %.1f MB in place, %.1f MB decoded\n",
				fp->path, (long)use.probes,
				(long)ii->n_u*ii->n_v,
				use.mapped_bytes*1e-6, use.decoded_bytes*1e-6);
		eputs(errmsg);
	}
}
