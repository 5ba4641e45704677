/*
 * options.h - the command line of fishremap: cfg as parsed, then as checked.
 */
#ifndef OPTIONS_H
#define OPTIONS_H

#include "base/cli.h"
#include "settings.h"

extern settings cfg;
extern const cli_prog prog;

/* Ends the program (CLI_USAGE, in words) where an option is missing or means nothing for these pictures; what
 * was not given gets its default. */
void usage_check(settings *s, int operands);

#endif
