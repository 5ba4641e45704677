/*
 * cli.h - one option table per command drives parsing, --help and the man page's test.
 *
 * Every command also takes --help, --version, --quiet (-q) and --threads N without naming
 * them in its table.  Long options may be written --name=value or --name value and may be
 * shortened to an unambiguous prefix; options and operands may be mixed; "--" ends the
 * options; "-" alone and anything that reads as a negative number are operands.
 *
 * A lone --completion=bash or --completion=zsh, which --help doesn't name, prints the table as the shell's
 * completion, for the name that the program was called by.
 */
#ifndef CLI_H
#define CLI_H

#include "errmsg.h"

enum {
    CLI_OK = 0,     /* done */
    CLI_FAILED = 1, /* input or I/O */
    CLI_USAGE = 2   /* the command line itself */
};

typedef enum cli_kind {
    CLI_FLAG,   /* dest: int *, set to 1; no value */
    CLI_INT,    /* dest: int *; whole number */
    CLI_DOUBLE, /* dest: double *; finite number */
    CLI_STRING, /* dest: const char **; points into argv */
    CLI_CALL,   /* dest: cli_call_fn; for values with a syntax of their own */
    CLI_MAYBE   /* as CLI_CALL, but the value may be left out (NULL then): only --name=VALUE has one */
} cli_kind;

/* Take the value of one option.  Return 0, or -1 with words in e ("expected X, found Y"). */
typedef int cli_call_fn(const char *value, void *arg, errmsg *e);

typedef struct cli_opt {
    const char *name; /* long name without dashes; NULL ends the table */
    char letter;      /* short form, or 0 */
    cli_kind kind;
    void *dest;          /* as the kind says; for CLI_CALL and CLI_MAYBE what the function gets as arg */
    cli_call_fn *call;   /* CLI_CALL and CLI_MAYBE only */
    const char *metavar; /* value's name in --help, NULL for CLI_FLAG */
    const char *help;    /* running text, filled to the terminal's width; unit and default included */
} cli_opt;

/* Words that an option's value may be, where its metavar ("half|float") doesn't say them: for shell completion. */
typedef struct cli_choice {
    const char *option; /* long name; "" for the first operand; NULL ends the table */
    const char *words;  /* separated by blanks; FILE among them: or a file */
} cli_choice;

typedef struct cli_prog {
    const char *name;     /* as printed before ':' in messages */
    const char *operands; /* usage after the options: "-o OUT IMAGE..." */
    const char *summary;  /* one sentence */
    const cli_opt *opts;
    const char *epilog; /* more text for --help, or NULL: filled too, but for empty lines and lines that begin
                           with a blank */
    const cli_choice *choices; /* or NULL */
} cli_prog;

extern int cli_quiet;   /* --quiet was given */
extern int cli_threads; /* --threads N; 0 = as many as there are cores */

/* Parse argv; operands are moved, in order, to argv[1..].  Returns their number.
 * --help and --version print to stdout and exit 0; a usage error prints one line and
 * exits CLI_USAGE.  Also sets OpenMP's thread count where the program is built with it,
 * ignores SIGPIPE, installs out_cleanup on fatal signals (outfile.h) and sends the libraries' remarks
 * (remark.h) to cli_note.  main() only. */
int cli_parse(const cli_prog *prog, int argc, char **argv);

/* The program's name, before ':' in messages; "ilf" before cli_parse. */
const char *cli_name(void);

/* One line on stderr: "prog: words\n". */
void cli_warn(const char *fmt, ...) __attribute__((format(printf, 1, 2)));

/* As cli_warn unless --quiet: for what the user may like to know. */
void cli_note(const char *fmt, ...) __attribute__((format(printf, 1, 2)));

/* As cli_warn, then remove unfinished output and exit with the code.  main() files only. */
_Noreturn void cli_fail(int code, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

/* Last act of main: flush stdout, and fail if it could not take what was written. */
int cli_end(int code);

/* Progress bar on stderr, only on a terminal and without --quiet; done and total in any
 * unit; done == total ends the line.  Cheap enough for every row. */
void cli_progress(const char *what, double done, double total);

/* Command line as one string for a picture's header: quoted where needed.  malloc'd, never NULL.  main()
 * only. */
char *cli_command_line(const cli_prog *prog, int argc, char *const *argv);

/* Parsers of common values, usable from cli_call_fn: whole string or failure. */
int cli_parse_double(double *v, const char *s, errmsg *e);             /* finite; "1/60" too */
int cli_parse_share(double *v, double most, const char *s, errmsg *e); /* "1%" or ".01": above 0, to most */
int cli_parse_doubles(double *v, int n, const char *s, const char *sep, errmsg *e); /* exactly n */
int cli_parse_size(int *w, int *h, const char *s, errmsg *e);                       /* "WxH", both >= 1 */

#endif
