/*
 * parts.c - test driver for stagectl's pure parts.
 *
 *   parts digest FILE ...    SHA-256, bytes and name of each file, a line each
 *   parts words              a command line on stdin; a line each word
 *   parts ini                a session-like text on stdin; per key: line, section, key and value, each in [ ]
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../../tools/stagectl/argwords.h"
#include "../../tools/stagectl/ini.h"
#include "../../tools/stagectl/sha256.h"

static int digest_main(char **names)
{
    for (; *names; names++) {
        char hex[65];
        int64_t size;
        errmsg e;
        if (sha256_file(hex, &size, *names, &e) != 0) {
            fprintf(stderr, "%s\n", e.text);
            return 1;
        }
        printf("%s %lld %s\n", hex, (long long)size, *names);
    }
    return 0;
}

static int show(void *arg, const char *section, const char *key, const char *value, int line, errmsg *e)
{
    (void)arg;
    (void)e;
    printf("%d [%s] [%s] [%s]\n", line, section, key, value);
    return 0;
}

static char text[1 << 16];

static int words_main(void)
{
    argwords a;
    errmsg e;
    if (argwords_split(&a, text, &e) != 0) {
        fprintf(stderr, "%s\n", e.text);
        return 1;
    }
    for (int k = 0; k < a.n; k++) puts(a.word[k]);
    argwords_free(&a);
    return 0;
}

static int ini_main(void)
{
    errmsg e;
    if (ini_parse(text, "stdin", show, NULL, &e) == 0) return 0;
    fprintf(stderr, "%s\n", e.text);
    return 1;
}

int main(int argc, char **argv)
{
    const char *what = argc > 1 ? argv[1] : "";
    if (strcmp(what, "digest") == 0) return digest_main(argv + 2);
    text[fread(text, 1, sizeof text - 1, stdin)] = 0;
    if (strcmp(what, "words") == 0) return words_main();
    if (strcmp(what, "ini") == 0) return ini_main();
    return 2;
}
