/*
 * cli_text.c - what a command says: messages, progress bar and --help; see cli.h.
 */
#include <errno.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cli_internal.h"
#include "outfile.h"

static atomic_int bar_percent = -1; /* what the terminal shows; -1: no bar */

/* ---- messages ------------------------------------------------------------------------------ */

/* One line in one write, so that lines of several processes don't mix. */
static void say(const char *fmt, va_list ap, const char *tail)
{
    char words[1024], line[2048];
    errmsg clean;
    vsnprintf(words, sizeof words, fmt, ap);
    err_set(&clean, "%s", words);
    int bar = atomic_exchange(&bar_percent, -1) >= 0;
    snprintf(line, sizeof line, "%s%s: %s%s\n", bar ? "\r\033[K" : "", cli_name(), clean.text, tail);
    fputs(line, stderr);
}

void cli_warn(const char *fmt, ...)
{
    va_list ap;
    va_start(ap, fmt);
    say(fmt, ap, "");
    va_end(ap);
}

void cli_note(const char *fmt, ...)
{
    if (cli_quiet) return;
    va_list ap;
    va_start(ap, fmt);
    say(fmt, ap, "");
    va_end(ap);
}

void cli_fail(int code, const char *fmt, ...)
{
    char tail[128] = "";
    if (code == CLI_USAGE) snprintf(tail, sizeof tail, "; try '%s --help'", cli_name());
    va_list ap;
    va_start(ap, fmt);
    say(fmt, ap, tail);
    va_end(ap);
    out_cleanup();
    exit(code);
}

int cli_end(int code)
{
    errno = 0;
    int bad = ferror(stdout);
    if (fflush(stdout) == EOF) bad = 1;
    if (bad) {
        cli_warn("standard output: can't write: %s", errno ? strerror(errno) : "an earlier write failed");
        if (code == CLI_OK) code = CLI_FAILED;
    }
    return code;
}

/* ---- progress ------------------------------------------------------------------------------ */

void cli_progress(const char *what, double done, double total)
{
    enum { WIDTH = 40 };
    static atomic_int terminal = -1;
    if (cli_quiet || !(total > 0)) return;
    if (atomic_load(&terminal) < 0) atomic_store(&terminal, isatty(STDERR_FILENO));
    if (!atomic_load(&terminal)) return;
    double part = done / total;
    int percent = part >= 1 ? 100 : part > 0 ? (int)(part * 100) : 0;
    if (atomic_exchange(&bar_percent, percent) == percent && percent < 100) return;
    char bar[WIDTH + 1];
    int full = percent * WIDTH / 100;
    memset(bar, '-', WIDTH);
    memset(bar, '#', (size_t)full);
    bar[WIDTH] = 0;
    fprintf(stderr, "\r%s: %s [%s] %3d%%%s", cli_name(), what, bar, percent, percent == 100 ? "\n" : "");
    if (percent == 100) atomic_store(&bar_percent, -1);
}

/* ---- --help -------------------------------------------------------------------------------- */

enum { LINE = 80, LEFT_MAX = 30 };

/* A newline in a text is a blank, but for paragraphs and for lines that begin with a blank (a table's rows).
 */
static int ends_line(const char *text, const char *newline)
{
    return newline[1] == '\n' || newline[1] == ' ' || (newline > text && newline[-1] == '\n');
}

/* Text filled to the line's width from `column` on, each line but the first indented; ends the line. */
static void put_wrapped(const char *text, int column, int indent)
{
    int first = 1;
    for (const char *p = text; *p && (*p != '\n' || p[1]);) {
        if (*p == '\n' && ends_line(text, p)) {
            printf("\n%*s", p[1] != '\n' ? indent : 0, "");
            column = indent;
            first = 1;
            p++;
            continue;
        }
        size_t blanks = strspn(p, " ") + (*p == '\n'), word = strcspn(p + blanks, " \n");
        if (!first && column + (int)(blanks + word) > LINE) {
            printf("\n%*s", indent, "");
            column = indent;
            p += blanks;
            blanks = 0;
        }
        printf("%*s%.*s", (int)blanks, "", (int)word, p + blanks);
        column += (int)(blanks + word);
        p += blanks + word;
        first = 0;
    }
    putchar('\n');
}

static int left_part(char *buf, size_t size, const cli_opt *o)
{
    char letter[8] = "    ";
    if (o->letter) snprintf(letter, sizeof letter, "-%c, ", o->letter);
    if (o->kind == CLI_MAYBE) return snprintf(buf, size, "  %s--%s[=%s]", letter, o->name, o->metavar);
    return snprintf(buf, size, "  %s--%s%s%s", letter, o->name, o->metavar ? " " : "",
                    o->metavar ? o->metavar : "");
}

void cli_print_help(const cli_prog *prog)
{
    const cli_opt *tables[2] = {prog->opts, cli_builtin};
    char left[256];
    int width = 0;
    for (int t = 0; t < 2; t++) {
        for (const cli_opt *o = tables[t]; o && o->name; o++) {
            int n = left_part(left, sizeof left, o);
            if (n <= LEFT_MAX && n > width) width = n;
        }
    }
    int used = printf("Usage: %s [OPTION]... ", prog->name);
    put_wrapped(prog->operands ? prog->operands : "", used, 4);
    put_wrapped(prog->summary, 0, 0);
    printf("\nOptions:\n");
    for (int t = 0; t < 2; t++) {
        for (const cli_opt *o = tables[t]; o && o->name; o++) {
            int n = left_part(left, sizeof left, o);
            if (n > width) printf("%s\n%*s", left, width + 2, "");
            else printf("%-*s", width + 2, left);
            put_wrapped(o->help, width + 2, width + 2);
        }
    }
    if (prog->epilog) {
        putchar('\n');
        put_wrapped(prog->epilog, 0, 0);
    }
}
