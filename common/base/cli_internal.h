/* cli_internal.h - what the parts of cli share. */
#ifndef CLI_INTERNAL_H
#define CLI_INTERNAL_H

#include "cli.h"

extern const cli_opt cli_builtin[]; /* --quiet --threads --help --version; NULL name ends it */
void cli_print_help(const cli_prog *prog);

/* Does the program's own table have this one of cli_builtin? */
int cli_is_replaced(const cli_prog *prog, const char *name);

/* To stdout: completion for the shell, "bash" or "zsh", of a program called `called` (a path's last part counts). */
void cli_print_completion(const cli_prog *prog, const char *called, const char *shell);

#endif
