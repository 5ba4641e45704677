/*
 * remark.h - what a library assumed about its input and the user should know.
 *
 * A library doesn't print: remarks go where main() sends them (cli_parse() sends them to cli_note(): one line
 * on stderr, none with --quiet), and nowhere if it does not.
 */
#ifndef REMARK_H
#define REMARK_H

/* say gets one line without its end; NULL ends it.  Call before there are threads. */
void remark_to(void (*say)(const char *line));

/* "file: words"; said once, for the first file that it is true of: a series says it once.  From any thread.
 */
void remark(const char *file, const char *fmt, ...) __attribute__((format(printf, 2, 3)));

#endif
