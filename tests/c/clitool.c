/*
 * clitool.c - test driver: one option of every kind, printed back; and outputs that end well or badly.
 */
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/cli.h"
#include "base/outfile.h"

static int flag, whole = 7, steps;
static double real = 0.5;
static const char *output, *mode = "commit", *spare = "-";
static int size[2];

static int take_size(const char *value, void *arg, errmsg *e)
{
    int *s = arg;
    return cli_parse_size(&s[0], &s[1], value, e);
}

static int take_three(const char *value, void *arg, errmsg *e)
{
    return cli_parse_doubles(arg, 3, value, ", ", e);
}

static double three[3];

static const cli_opt opts[] = {
    {"output", 'o', CLI_STRING, &output, NULL, "FILE", "write standard input to FILE"},
    {"mode", 0, CLI_STRING, &mode, NULL, "HOW",
     "how the output ends: commit, abort, wait (until killed)\nor fail (default commit)"},
    {"flag", 'f', CLI_FLAG, &flag, NULL, NULL, "a flag"},
    {"whole", 'w', CLI_INT, &whole, NULL, "N", "a whole number (default 7)"},
    {"real", 'r', CLI_DOUBLE, &real, NULL, "X", "a number (default 0.5)"},
    {"size", 0, CLI_CALL, size, take_size, "WxH", "a size in pixels"},
    {"steps", 0, CLI_INT, &steps, NULL, "N", "show a progress bar of N steps, with a remark half way"},
    {"spare-option-with-a-long-name", 0, CLI_STRING, &spare, NULL, "WORD", "nothing"},
    {"three", 0, CLI_CALL, three, take_three, "A,B,C", "three numbers"},
    {0},
};
static const cli_prog prog = {"clitool", "[OPERAND...]", "Prints what it was given.", opts, "The end.", NULL};

static void write_output(void)
{
    errmsg e;
    outfile *o;
    char buf[4096];
    size_t n;
    if (out_begin(&o, output, &e) < 0) cli_fail(CLI_FAILED, "%s", e.text);
    while ((n = fread(buf, 1, sizeof buf, stdin)) > 0) fwrite(buf, 1, n, out_stream(o));
    if (strcmp(mode, "wait") == 0) {
        fflush(out_stream(o));
        puts("waiting");
        fflush(stdout);
        for (;;) pause();
    }
    if (strcmp(mode, "fail") == 0) cli_fail(CLI_FAILED, "%s: asked to fail\nwith a second line", output);
    if (strcmp(mode, "abort") == 0) out_abort(o);
    else if (out_commit(o, &e) < 0) cli_fail(CLI_FAILED, "%s", e.text);
}

int main(int argc, char **argv)
{
    int n = cli_parse(&prog, argc, argv);
    for (int i = 1; i <= steps; i++) {
        cli_progress("stepping", i, steps);
        if (i == steps / 2) cli_note("half way");
    }
    if (output) {
        write_output();
        return cli_end(CLI_OK);
    }
    char *line = cli_command_line(&prog, argc, argv);
    printf("%s\n", line);
    free(line);
    printf("flag=%d quiet=%d threads=%d whole=%d real=%.17g size=%dx%d three=%g,%g,%g\n", flag, cli_quiet,
           cli_threads, whole, real, size[0], size[1], three[0], three[1], three[2]);
    for (int i = 1; i <= n; i++) printf("[%s]\n", argv[i]);
    cli_note("a remark");
    return cli_end(CLI_OK);
}
