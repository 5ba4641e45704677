/* template.c - see template.h. */
#include "template.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const template_var *find(const template_var *vars, const char *name, size_t len)
{
    for (; vars->name; vars++)
        if (strlen(vars->name) == len && !strncmp(vars->name, name, len)) return vars;
    return NULL;
}

int template_expand(char *out, size_t room, const char *text, const template_var *vars, errmsg *e)
{
    size_t n = 0;
    for (const char *p = text; *p;) {
        char value[64] = {*p, 0};
        const char *put = value;
        if ((*p == '{' || *p == '}') && p[1] == *p) {
            p += 2;
        } else if (*p == '}') {
            return err_set(e, "'%s': a } without its {", text);
        } else if (*p == '{') {
            size_t len = strcspn(p + 1, ":}");
            const template_var *v = find(vars, p + 1, len);
            int width = 0;
            if (!v) return err_set(e, "'%s': unknown name {%.*s}", text, (int)len, p + 1);
            p += 1 + len;
            if (*p == ':') {
                if (v->text || p[1] != '0' || p[2] < '1' || p[2] > '9' || p[3] != '}')
                    return err_set(e, "'%s': expected {%s} or, for whole numbers, {%s:0N}", text, v->name,
                                   v->name);
                width = p[2] - '0';
                p += 3;
            }
            if (*p != '}') return err_set(e, "'%s': a { without its }", text);
            p++;
            if (v->text) put = v->text;
            else snprintf(value, sizeof value, "%0*ld", width, v->number);
        } else {
            p++;
        }
        size_t len = strlen(put);
        if (n + len >= room)
            return err_set(e, "'%s': expected at most %zu characters once filled in", text, room - 1);
        memcpy(out + n, put, len);
        n += len;
    }
    out[n] = 0;
    return 0;
}
