/* argwords.c - the splitter of argwords.h (pure). */
#include "argwords.h"

#include <stdlib.h>
#include <string.h>

void argwords_free(argwords *a)
{
    free(a->word);
    a->word = NULL;
    a->n = 0;
}

int argwords_split(argwords *a, const char *text, errmsg *e)
{
    size_t len = strlen(text), most = len / 2 + 2;
    char **word = calloc(1, most * sizeof *word + len + 1);
    if (!word) return err_set(e, "out of memory");
    char *to = (char *)(word + most), quote = 0;
    int n = 0, inside = 0;
    for (const char *p = text; *p; p++) {
        if (!quote && strchr(" \t\r\n", *p)) {
            if (inside) *to++ = 0;
            inside = 0;
            continue;
        }
        if (!inside) word[n++] = to;
        inside = 1;
        if (quote ? *p == quote : *p == '\'' || *p == '"') {
            quote = quote ? 0 : *p;
        } else if (*p == '\\' && (!quote || (quote == '"' && (p[1] == '"' || p[1] == '\\')))) {
            if (!*++p) break;
            *to++ = *p;
        } else {
            *to++ = *p;
        }
    }
    if (quote) {
        free(word);
        return err_set(e, "expected a closing %c in '%s'", quote, text);
    }
    a->n = n;
    a->word = word;
    return 0;
}
