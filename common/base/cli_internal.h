/* cli_internal.h - what the parts of cli share. */
#ifndef CLI_INTERNAL_H
#define CLI_INTERNAL_H

#include "cli.h"

extern const cli_opt cli_builtin[]; /* --quiet --threads --help --version; NULL name ends it */
void cli_print_help(const cli_prog *prog);

#endif
