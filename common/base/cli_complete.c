/*
 * cli_complete.c - an option table as completion for bash and zsh; see cli.h.
 *
 * What may follow an option is said once, in the table: by its metavar ("half|float" are words, FILE and OUT.exr
 * files, DIR a folder), or by the program's choices.  Anything else (a number, X,Y) is offered nothing.
 */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli_internal.h"

typedef struct values {
    char words[256]; /* each followed by a blank */
    char ending[32]; /* files: "png" of FILE.png; "" any */
    int files, folders;
} values;

/* ---- what may follow an option -------------------------------------------------------------------- */

static void add_word(values *v, const char *word, size_t n)
{
    const size_t used = strlen(v->words);
    if (n == 4 && strncmp(word, "FILE", n) == 0) v->files = 1;
    else if (used + n + 2 <= sizeof v->words)
        snprintf(v->words + used, sizeof v->words - used, "%.*s ", (int)n, word);
}

/* The words of a text that are parted by any of sep; of a metavar only those in small letters are words. */
static void add_words(values *v, const char *text, const char *sep, int small_only)
{
    for (size_t n; text += strspn(text, sep), n = strcspn(text, sep), n > 0; text += n)
        if (!small_only || strspn(text, "abcdefghijklmnopqrstuvwxyz-") == n) add_word(v, text, n);
}

/* FILE, OUT.ilf.exr ...: a file, and its ending after the last point. */
static void by_metavar(values *v, const char *metavar)
{
    static const char *const names[] = {"FILE", "OUT",     "IMAGE", "FALLOFF", "PATH",
                                        "DEV",  "PROGRAM", "VIEW",  "NAME"};
    const size_t n = strcspn(metavar, ".");
    const char *point = strrchr(metavar, '.');
    if (strcmp(metavar, "DIR") == 0) v->folders = 1;
    for (size_t k = 0; k < sizeof names / sizeof *names; k++)
        if (strlen(names[k]) == n && strncmp(metavar, names[k], n) == 0 &&
            (point || strcmp(metavar, "NAME") != 0))
            v->files = 1;
    if (v->files && point) snprintf(v->ending, sizeof v->ending, "%s", point + 1);
    if (strchr(metavar, '|') || strcmp(metavar, "off") == 0) add_words(v, metavar, "|", 1);
}

static const char *choice(const cli_prog *prog, const char *option)
{
    for (const cli_choice *c = prog->choices; c && c->option; c++)
        if (strcmp(c->option, option) == 0) return c->words;
    return NULL;
}

static values values_of(const cli_prog *prog, const cli_opt *o)
{
    values v = {.words = ""};
    const char *words = choice(prog, o->name);
    if (words) add_words(&v, words, " ", 0);
    else if (o->metavar) by_metavar(&v, o->metavar);
    return v;
}

/* Calls one for each option that the program takes. */
static void each_option(const cli_prog *prog, void (*one)(const cli_prog *, const cli_opt *))
{
    for (const cli_opt *o = prog->opts; o && o->name; o++) one(prog, o);
    for (const cli_opt *o = cli_builtin; o->name; o++)
        if (!cli_is_replaced(prog, o->name)) one(prog, o);
}

/* ---- bash ------------------------------------------------------------------------------------------ */

static void bash_name(const cli_prog *prog, const cli_opt *o)
{
    (void)prog;
    if (o->letter) printf("-%c ", o->letter);
    printf("--%s ", o->name);
}

/* A branch of "case option in": what readline is told goes by compopt, which only works within a completion. */
static void bash_value(const cli_prog *prog, const cli_opt *o)
{
    if (o->kind == CLI_FLAG) return;
    const values v = values_of(prog, o);
    /* its value stands behind '=' or nowhere: a following word is no value */
    printf("    --%s%s", o->name, o->kind == CLI_MAYBE ? "=" : "|--");
    if (o->kind != CLI_MAYBE) printf("%s=", o->name);
    if (o->letter) printf("|-%c", o->letter);
    printf(")");
    if (*v.words) printf(" COMPREPLY+=($(compgen -W \"%s\" -- \"$cur\"));", v.words);
    if (v.ending[0]) printf(" _ilf_files \"$cur\" \"%s\";", v.ending);
    else if (v.folders) printf(" compopt -o dirnames 2>/dev/null;");
    else if (v.files) printf(" compopt -o default 2>/dev/null;");
    printf(" return ;;\n");
}

static void bash_completion(const cli_prog *prog, const char *called)
{
    const char *first = choice(prog, "");
    printf("# %s in bash: made by `%s --completion=bash`\n", called, called);
    printf("_ilf_files() # WORD ENDING: files that end so, and folders; readline's own way where there are "
           "none\n"
           "{\n"
           "    local IFS=$'\\n'\n"
           "    COMPREPLY+=($(compgen -f -X \"!*.$2\" -- \"$1\") $(compgen -d -- \"$1\"))\n"
           "    compopt -o filenames -o default 2>/dev/null\n"
           "}\n");
    printf("_ilf_complete_%s()\n{\n"
           "    local cur=${COMP_WORDS[COMP_CWORD]} option=${COMP_WORDS[COMP_CWORD - 1]} k\n"
           "    COMPREPLY=()\n"
           "    # --name=value comes as three words\n"
           "    if [[ $cur == = && $option == --* ]]; then option+== cur=\n"
           "    elif [[ $option == = ]]; then option=${COMP_WORDS[COMP_CWORD - 2]}=; fi\n"
           "    case $option in\n",
           prog->name);
    each_option(prog, bash_value);
    printf("    esac\n"
           "    for ((k = 1; k < COMP_CWORD; k++)); do [[ ${COMP_WORDS[k]} != -- ]] || cur=; done # operands "
           "from there on\n"
           "    if [[ $cur == -* ]]; then\n"
           "        COMPREPLY=($(compgen -W \"");
    each_option(prog, bash_name);
    printf("\" -- \"$cur\"))\n        return\n    fi\n");
    if (first)
        printf("    if ((COMP_CWORD == 1)); then COMPREPLY=($(compgen -W \"%s\" -- \"$cur\")); return; fi\n",
               first);
    printf("    compopt -o default 2>/dev/null\n}\ncomplete -F _ilf_complete_%s %s\n", prog->name, called);
}

/* ---- zsh ------------------------------------------------------------------------------------------- */

/* The first words of a help text, as they may stand in a quoted specification. */
static void zsh_words(const char *text)
{
    enum { LONGEST = 60 };
    size_t n = strcspn(text, ":;(\n"), end = n;
    if (n > LONGEST)
        for (end = LONGEST; end > 0 && text[end] != ' '; end--) {
        }
    while (end > 0 && isspace((unsigned char)text[end - 1])) end--;
    for (size_t k = 0; k < end; k++) {
        if (text[k] == '\'') printf("'\\''");
        else printf("%s%c", strchr("[]\\", text[k]) ? "\\" : "", text[k]);
    }
}

static void zsh_value(const cli_prog *prog, const cli_opt *o)
{
    const values v = values_of(prog, o);
    putchar(':');
    for (const char *p = o->metavar; *p; p++)
        if (!strchr("'\"", *p)) printf("%s%c", *p == ':' ? "\\" : "", *p);
    putchar(':');
    const int words = (int)strlen(v.words) - 1; /* without the last blank */
    if (words > 0 && v.files) printf("_ilf_words_or_files \"%.*s\"", words, v.words);
    else if (words > 0) printf("(%.*s)", words, v.words);
    else if (v.ending[0]) printf("_files -g \"*.%s\"", v.ending);
    else if (v.folders) printf("_files -/");
    else printf(v.files ? "_files" : " ");
}

/* '(-o --output)'{-o+,--output=}'[what it is]:OUT:_files'; an option that is a call may gather several values. */
static void zsh_option(const cli_prog *prog, const cli_opt *o)
{
    const char *sign = o->kind == CLI_FLAG ? "" : o->kind == CLI_MAYBE ? "=-" : "=";
    printf(" \\\n        ");
    if (o->kind == CLI_CALL) printf("'*'");
    else if (o->letter) printf("'(-%c --%s)'", o->letter, o->name);
    if (o->letter) printf("{-%c%s,--%s%s}", o->letter, o->kind == CLI_FLAG ? "" : "+", o->name, sign);
    else printf("'--%s%s'", o->name, sign);
    printf("'[");
    zsh_words(o->help);
    putchar(']');
    if (o->kind == CLI_MAYBE) putchar(':');
    if (o->kind != CLI_FLAG) zsh_value(prog, o);
    putchar('\'');
}

static void zsh_completion(const cli_prog *prog, const char *called)
{
    const char *first = choice(prog, "");
    printf("#compdef %s\n# %s in zsh: made by `%s --completion=zsh`\n\n", called, called, called);
    printf("_ilf_words_or_files() { _alternative \"words:word:($argv[-1])\" files:file:_files; }\n"
           "_arguments -s -S");
    each_option(prog, zsh_option);
    if (first) printf(" \\\n        '1:command:(%s)'", first);
    printf(" \\\n        '*:file:_files'\n");
}

void cli_print_completion(const cli_prog *prog, const char *called, const char *shell)
{
    const char *slash = called ? strrchr(called, '/') : NULL;
    const char *name = slash ? slash + 1 : called && *called ? called : prog->name;
    if (strcmp(shell, "bash") == 0) bash_completion(prog, name);
    else if (strcmp(shell, "zsh") == 0) zsh_completion(prog, name);
    else cli_fail(CLI_USAGE, "option --completion: expected bash or zsh, found '%s'", shell);
}
