/* camerawords.c - see camerawords.h (pure). */
#include "camerawords.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cli.h"
#include "names.h"

const char camera_default_lens[] = "equidistant";
const double camera_default_fov = 185;

int camera_words(argwords *words, const session *s, errmsg *e)
{
    const double at[2] = {0, 0};
    argwords argv;
    place p;
    plan_place(&p, s, 0);
    if (name_command(&argv, s, &p, at, 0, "file", e) != 0) return -1;
    if (!s->shell) {
        *words = argv;
        return 0;
    }
    int bad = argwords_split(words, argv.word[argv.n - 1], e);
    argwords_free(&argv);
    return bad;
}

int camera_runs(const argwords *words, const char *program)
{
    const size_t n = strlen(program);
    for (int w = 0; w < words->n; w++) {
        size_t len = strlen(words->word[w]);
        if (len >= n && !strcmp(words->word[w] + len - n, program)) return 1;
    }
    return 0;
}

int camera_is_virtual(const argwords *words)
{
    return camera_runs(words, "virtualcamera");
}

const char *option_value(const argwords *words, const char *name, char letter)
{
    const char *found = NULL;
    for (int w = 0; w < words->n; w++) {
        const char *s = words->word[w], *next = w + 1 < words->n ? words->word[w + 1] : NULL;
        if (letter && s[0] == '-' && s[1] == letter) {
            found = s[2] ? s + 2 : next;
            continue;
        }
        if (strncmp(s, "--", 2) != 0) continue;
        size_t len = strcspn(s + 2, "=");
        if (len < 2 || strncmp(s + 2, name, len) != 0) continue;
        found = s[2 + len] ? s + 3 + len : next;
    }
    return found; /* the last one counts */
}

void camera_lens(const char **lens, double *fov, const session *s, const argwords *words)
{
    int ours = camera_is_virtual(words);
    const char *l = ours ? option_value(words, "lens", 0) : NULL,
               *f = ours ? option_value(words, "fov", 0) : NULL;
    *lens = s->lens[0] ? s->lens : l ? l : camera_default_lens;
    *fov = s->fov > 0 ? s->fov : camera_default_fov;
    if (!(s->fov > 0) && f) (void)cli_parse_double(fov, f, NULL);
}

void plane_text(char out[256], const double plane[9])
{
    size_t n = 0;
    for (int k = 0; k < 9; k++) {
        char one[32];
        for (int digits = 6; digits <= 17; digits++) {
            snprintf(one, sizeof one, "%.*g", digits, plane[k] + 0.0);
            if (strtod(one, NULL) == plane[k]) break;
        }
        n += (size_t)snprintf(out + n, 256 - n, "%s%s", k ? " " : "", one);
    }
}

int session_fill(char out[FILLED_ROOM], const session *s, const char *text, errmsg *e)
{
    char plane[256], fov[32];
    const char *lens;
    double degrees;
    argwords words;
    size_t n = 0;
    if (camera_words(&words, s, e) != 0) return -1;
    camera_lens(&lens, &degrees, s, &words);
    plane_text(plane, s->plane);
    snprintf(fov, sizeof fov, "%.10g", degrees);
    const char *const vars[][2] = {{"{plane}", plane}, {"{lens}", lens}, {"{fov}", fov}};
    int bad = 0;
    for (const char *p = text; *p && !bad;) {
        char one[2] = {*p, 0};
        const char *put = one;
        size_t used = 1;
        for (size_t k = 0; k < sizeof vars / sizeof *vars; k++)
            if (!strncmp(p, vars[k][0], strlen(vars[k][0]))) {
                put = vars[k][1];
                used = strlen(vars[k][0]);
            }
        if (n + strlen(put) >= FILLED_ROOM)
            bad = err_set(e, "'%.60s...': expected at most %d characters once filled in", text,
                          FILLED_ROOM - 1);
        else {
            strcpy(out + n, put);
            n += strlen(put);
        }
        p += used;
    }
    out[n] = 0;
    argwords_free(&words);
    return bad;
}

int session_fishremap(char out[FILLED_ROOM], const session *s, errmsg *e)
{
    argwords given;
    char text[FILLED_ROOM];
    if (session_fill(text, s, s->fishremap, e) != 0 || argwords_split(&given, text, e) != 0) return -1;
    const char *from = option_value(&given, "from", 0), *lens = option_value(&given, "lens", 'l');
    int fisheye = (!from || !strcmp(from, "fisheye")) && !option_value(&given, "array", 'a');
    int file = lens && strpbrk(lens, "./"); /* it knows its own field of view */
    int add_lens = fisheye && !lens, add_fov = fisheye && !file && !option_value(&given, "fov", 'f');
    argwords_free(&given);
    int n = snprintf(text, sizeof text, "%s%s%s", s->fishremap, add_lens ? " --lens {lens}" : "",
                     add_fov ? " --fov {fov}" : "");
    if (n < 0 || n >= FILLED_ROOM)
        return err_set(e, "[chain] fishremap: expected at most %d characters", FILLED_ROOM - 1);
    return session_fill(out, s, text, e);
}

static int plane_agrees(const session *s, const argwords *words, errmsg *e)
{
    const char *given = option_value(words, "plane", 0);
    double p[9], most = 0, off = 0;
    if (!given || cli_parse_doubles(p, 9, given, " ", NULL) != 0) return 0; /* the camera will say it */
    for (int k = 0; k < 9; k++) {
        most = fmax(most, fabs(s->plane[k]));
        off = fmax(off, fabs(p[k] - s->plane[k]));
    }
    if (off <= 1e-6 * most) return 0;
    char text[256];
    plane_text(text, s->plane);
    return err_set(
        e, "[camera] command: expected --plane \"%s\" as [grid] says, found '%s' (\"{plane}\" stands for it)",
        text, given);
}

/* What one place says of the lens against what another does; NULL and 0 = nothing. */
static int lens_agrees(const char *where, const char *lens, const char *fov, const char *is_lens,
                       double is_fov, errmsg *e)
{
    double degrees;
    if (lens && !strpbrk(lens, "./") && !strpbrk(is_lens, "./") && strcmp(lens, is_lens) != 0)
        return err_set(e, "%s: expected lens %s as the camera's, found %s ({lens} stands for it)", where,
                       is_lens, lens);
    if (!fov || (lens && strpbrk(lens, "./")) || cli_parse_double(&degrees, fov, NULL) != 0 ||
        fabs(degrees - is_fov) <= 1e-6)
        return 0;
    return err_set(
        e, "%s: expected a field of view of %.10g degrees as the camera's, found %s ({fov} stands for it)",
        where, is_fov, fov);
}

int camera_agrees(const session *s, errmsg *e)
{
    argwords words, remap = {0};
    char text[FILLED_ROOM];
    const char *lens;
    double fov;
    if (camera_words(&words, s, e) != 0) return -1;
    int ours = camera_is_virtual(&words), bad = ours ? plane_agrees(s, &words, e) : 0;
    camera_lens(&lens, &fov, s, &words);
    if (!bad && ours) { /* its own defaults count where the command is silent */
        const char *l = option_value(&words, "lens", 0), *f = option_value(&words, "fov", 0);
        char usual[32];
        snprintf(usual, sizeof usual, "%g", camera_default_fov);
        bad = lens_agrees("[camera] command", l ? l : camera_default_lens, f ? f : usual, lens, fov, e);
    }
    errmsg why;
    if (!bad && (session_fill(text, s, s->fishremap, &why) != 0 || argwords_split(&remap, text, &why) != 0))
        bad = err_set(e, "[chain] fishremap: %s", why.text);
    const char *from = bad ? NULL : option_value(&remap, "from", 0);
    int known = ours || s->lens[0] || s->fov > 0, fisheye = !from || !strcmp(from, "fisheye");
    if (!bad && known && fisheye) {
        const char *is = ours || s->lens[0] ? lens : NULL, *l = option_value(&remap, "lens", 'l'),
                   *f = option_value(&remap, "fov", 'f');
        bad = lens_agrees("[chain] fishremap", is ? l : NULL, ours || s->fov > 0 ? f : NULL, is ? is : "",
                          fov, e);
    }
    argwords_free(&remap);
    argwords_free(&words);
    return bad;
}
