/*
 * libpath.c - where Radiance's programs look for function files, fonts, pictures and light fields.
 *
 * In place of Radiance's common/getlibpath.c: RAYPATH where it is set, as there.  Where it is not, the
 * current directory, then the installation that the program stands in (BIN/../lib/ray as installed,
 * BIN/../lib as built), so that a tree that was moved works with PATH alone, then Radiance's own default.
 */
#include "copyright.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "rtio.h"
#include "paths.h"

char *
getrlibpath()
{
	static const char  *const  sub[] = {"lib/ray", "lib"};
	static char  *libpath = NULL, path[PATH_MAX+64];
	char  exe[PATH_MAX], probe[PATH_MAX+32], *cp;
	ssize_t  n;
	int  i;

	if (libpath != NULL)
		return(libpath);
	if ((libpath = getenv(ULIBVAR)) != NULL)
		return(libpath);
	libpath = DEFPATH;
	n = readlink("/proc/self/exe", exe, sizeof(exe)-1);
	if (n <= 0)
		return(libpath);
	exe[n] = '\0';
	for (i = 2; i--; *cp = '\0')		/* PREFIX/bin/program */
		if ((cp = strrchr(exe, '/')) == NULL)
			return(libpath);
	if (strchr(exe, ':') != NULL)		/* parts a list of folders */
		return(libpath);
	for (i = 0; i < 2; i++) {
		snprintf(probe, sizeof(probe), "%s/%s/rayinit.cal", exe, sub[i]);
		if (access(probe, R_OK) != 0)
			continue;
		snprintf(path, sizeof(path), ":%s/%s%s", exe, sub[i], DEFPATH);
		return(libpath = path);
	}
	return(libpath);
}
