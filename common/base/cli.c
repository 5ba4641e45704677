/*
 * cli.c - parsing of a command line by its option table; see cli.h.
 *
 * An option parser of our own instead of getopt_long: one table drives parsing and --help,
 * negative numbers are operands, and every refusal is one line.
 */
#include "cli.h"

#include <ctype.h>
#include <errno.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#include "cli_internal.h"
#include "outfile.h"
#include "remark.h"

int cli_quiet;
int cli_threads;

static const cli_prog *the_prog;
static char **given; /* argv before operands were moved */
static int ngiven;
static char *const *given_as;

const cli_opt cli_builtin[] = {
    {"quiet", 'q', CLI_FLAG, &cli_quiet, NULL, NULL, "no progress bar, no remarks"},
    {"threads", 0, CLI_INT, &cli_threads, NULL, "N", "threads to use at most (default 0: one per core)"},
    {"help", 0, CLI_FLAG, NULL, NULL, NULL, "print this text and exit"},
    {"version", 0, CLI_FLAG, NULL, NULL, NULL, "print name and version and exit"},
    {0},
};

const char *cli_name(void)
{
    return the_prog ? the_prog->name : "ilf";
}

/* ---- finding an option ------------------------------------------------------------------- */

static const cli_opt *by_letter(char c)
{
    const cli_opt *tables[2] = {the_prog->opts, cli_builtin};
    for (int t = 0; t < 2; t++)
        for (const cli_opt *o = tables[t]; o && o->name; o++)
            if (o->letter && o->letter == c) return o;
    return NULL;
}

int cli_is_replaced(const cli_prog *prog, const char *name)
{
    for (const cli_opt *o = prog->opts; o && o->name; o++)
        if (strcmp(o->name, name) == 0) return 1;
    return 0;
}

/* An exact name wins; else the only one that begins so. */
static const cli_opt *by_name(const char *name, size_t len)
{
    const cli_opt *tables[2] = {the_prog->opts, cli_builtin};
    const cli_opt *found = NULL, *second = NULL;
    for (int t = 0; t < 2; t++) {
        for (const cli_opt *o = tables[t]; o && o->name; o++) {
            if (strncmp(o->name, name, len) != 0) continue;
            if (o->name[len] == 0) return o;
            if (t == 1 && cli_is_replaced(the_prog, o->name)) continue; /* the program has its own */
            if (!found) found = o;
            else second = o;
        }
    }
    if (len == 0) found = NULL;
    if (!found) cli_fail(CLI_USAGE, "unknown option --%.*s", (int)len, name);
    if (second)
        cli_fail(CLI_USAGE, "option --%.*s is ambiguous: --%s or --%s", (int)len, name, found->name,
                 second->name);
    return found;
}

/* ---- taking its value -------------------------------------------------------------------- */

static void take(const cli_opt *o, const char *value)
{
    errmsg e = {""};
    int rc = 0;
    switch (o->kind) {
    case CLI_FLAG:
        if (!o->dest) {
            if (o == &cli_builtin[2]) cli_print_help(the_prog);
            else printf("%s %s\n", the_prog->name, ILF_VERSION);
            exit(cli_end(CLI_OK));
        }
        *(int *)o->dest = 1;
        break;
    case CLI_INT: {
        char *end;
        errno = 0;
        long n = strtol(value, &end, 10);
        if (end == value || *end || isspace((unsigned char)*value) || errno || n < INT_MIN || n > INT_MAX)
            rc = err_set(&e, "expected a whole number, found '%s'", value);
        else *(int *)o->dest = (int)n;
        break;
    }
    case CLI_DOUBLE: rc = cli_parse_double(o->dest, value, &e); break;
    case CLI_STRING: *(const char **)o->dest = value; break;
    case CLI_CALL:
    case CLI_MAYBE: rc = o->call(value, o->dest, &e); break;
    }
    if (rc < 0) cli_fail(CLI_USAGE, "option --%s: %s", o->name, e.text);
}

/* --name, --name=value, --name value.  Returns how many further arguments were used. */
static int long_option(const char *arg, const char *next)
{
    const char *name = arg + 2, *eq = strchr(name, '=');
    const cli_opt *o = by_name(name, eq ? (size_t)(eq - name) : strlen(name));
    if (o->kind == CLI_FLAG) {
        if (eq) cli_fail(CLI_USAGE, "option --%s takes no value, found '%s'", o->name, eq + 1);
        take(o, NULL);
        return 0;
    }
    if (o->kind == CLI_MAYBE) {
        take(o, eq ? eq + 1 : NULL);
        return 0;
    }
    if (!eq && !next)
        cli_fail(CLI_USAGE, "option --%s: expected a value (%s), found none", o->name, o->metavar);
    take(o, eq ? eq + 1 : next);
    return !eq;
}

/* -a, -abc (flags), -oVALUE, -o VALUE. */
static int short_options(const char *arg, const char *next)
{
    for (const char *c = arg + 1; *c; c++) {
        const cli_opt *o = by_letter(*c);
        if (!o) cli_fail(CLI_USAGE, "unknown option -%c in '%s'", *c, arg);
        if (o->kind == CLI_FLAG) {
            take(o, NULL);
            continue;
        }
        if (!c[1] && !next)
            cli_fail(CLI_USAGE, "option -%c: expected a value (%s), found none", *c, o->metavar);
        take(o, c[1] ? c + 1 : next);
        return !c[1];
    }
    return 0;
}

static int is_operand(const char *arg)
{
    if (arg[0] != '-' || arg[1] == 0) return 1;
    return isdigit((unsigned char)arg[1]) || (arg[1] == '.' && isdigit((unsigned char)arg[2]));
}

/* ---- what a command does once, at its start ------------------------------------------------ */

static void fatal_signal(int sig)
{
    out_cleanup();
    raise(sig); /* SA_RESETHAND: the default action follows when this handler returns */
}

static void install_signals(void)
{
    static const int fatal[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT};
    signal(SIGPIPE, SIG_IGN); /* a closed pipe is a failed write */
    for (size_t i = 0; i < sizeof fatal / sizeof *fatal; i++) {
        struct sigaction old, act = {.sa_handler = fatal_signal, .sa_flags = (int)SA_RESETHAND};
        sigemptyset(&act.sa_mask);
        if (sigaction(fatal[i], NULL, &old) == 0 && old.sa_handler == SIG_DFL) /* nohup keeps its way */
            sigaction(fatal[i], &act, NULL);
    }
}

static void note_line(const char *line)
{
    cli_note("%s", line);
}

int cli_parse(const cli_prog *prog, int argc, char **argv)
{
    the_prog = prog;
    remark_to(note_line);
    install_signals();
    free(given);
    given = malloc(((size_t)argc + 1) * sizeof *given);
    if (!given) cli_fail(CLI_FAILED, "out of memory");
    memcpy(given, argv, ((size_t)argc + 1) * sizeof *given);
    ngiven = argc;
    given_as = argv;

    static const char completion[] = "--completion=";
    if (argc == 2 && strncmp(argv[1], completion, sizeof completion - 1) == 0) {
        cli_print_completion(prog, argv[0], argv[1] + sizeof completion - 1);
        exit(cli_end(CLI_OK));
    }

    int noperands = 0, only_operands = 0;
    for (int i = 1; i < argc; i++) {
        char *arg = argv[i];
        if (only_operands || is_operand(arg)) argv[1 + noperands++] = arg;
        else if (strcmp(arg, "--") == 0) only_operands = 1;
        else if (arg[1] == '-') i += long_option(arg, argv[i + 1]);
        else i += short_options(arg, argv[i + 1]);
    }
    if (noperands + 1 < argc) argv[1 + noperands] = NULL;
    if (cli_threads < 0 || cli_threads > 4096)
        cli_fail(CLI_USAGE, "option --threads: expected 0 to 4096, found %d", cli_threads);
#ifdef _OPENMP
    if (cli_threads > 0) omp_set_num_threads(cli_threads);
#endif
    return noperands;
}

/* ---- the command line as text -------------------------------------------------------------- */

static char *put_quoted(char *p, const char *word)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_@%+=:,./-";
    if (*word && word[strspn(word, plain)] == 0) return stpcpy(p, word);
    *p++ = '\'';
    for (; *word; word++) {
        if (*word == '\'') p = stpcpy(p, "'\\''");
        else *p++ = (unsigned char)*word < 0x20 || *word == 0x7f ? '?' : *word;
    }
    *p++ = '\'';
    *p = 0;
    return p;
}

char *cli_command_line(const cli_prog *prog, int argc, char *const *argv)
{
    the_prog = prog;
    if (given && argv == given_as) { /* as it was before parsing */
        argv = given;
        argc = ngiven;
    }
    size_t size = strlen(prog->name) + 1;
    for (int i = 1; i < argc; i++) size += 4 * strlen(argv[i]) + 3;
    char *line = malloc(size), *p = line;
    if (!line) cli_fail(CLI_FAILED, "out of memory");
    p = stpcpy(p, prog->name);
    for (int i = 1; i < argc; i++) {
        *p++ = ' ';
        p = put_quoted(p, argv[i]);
    }
    return line;
}
