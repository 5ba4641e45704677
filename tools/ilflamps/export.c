/*
 * export.c - lamps and what is left for other programs: which file, by its ending.
 */
#include "export.h"

#include <stdio.h>
#include <string.h>

#include "exportjson.h"
#include "exportrad.h"
#include "exportusd.h"

typedef int exporter(const char *path, const analysis *a, const viewpoint *v, const char *line, errmsg *e);

static exporter *kind_of(const char *path)
{
    static const struct {
        const char *ending;
        exporter *write;
    } KINDS[] = {{".usda", exportusd_write}, {".rad", exportrad_file}, {".json", exportjson_write}};
    const size_t n = strlen(path);

    for (int k = 0; k < 3; k++) {
        const size_t m = strlen(KINDS[k].ending);
        if (n > m && !strcmp(path + n - m, KINDS[k].ending) && path[n - m - 1] != '/') return KINDS[k].write;
    }
    return NULL;
}

int export_check(const char *path, errmsg *e)
{
    if (kind_of(path)) return 0;
    return err_set(e, "expected FILE.usda, FILE.rad or FILE.json, found \"%s\"", path);
}

int export_write(const char *path, const analysis *a, const viewpoint *v, const char *line, errmsg *e)
{
    return kind_of(path)(path, a, v, line, e);
}

void export_left_out(char *text, size_t room, int number, const ilf_luminaire *l,
                     int (*keeps)(const ilf_mask *m, const ilf_luminaire *l))
{
    static const char *const WORDS[] = {"a sheet", "a picture of what arrives", "a gate",
                                        "a beam",  "twigs or leaves",           "a ball"};

    for (int j = 0; j < l->nmasks; j++) {
        const ilf_mask *m = &l->masks[j];
        const size_t n = strlen(text);
        if (keeps(m, l)) continue;
        (void)!snprintf(text + n, room - n, "%slamp %d: %s", n ? ", " : "", number,
                        m->adds                              ? "what its masks leave"
                        : l->far && m->kind != ILF_MASK_BEAM ? "what hides it, at infinity"
                                                             : WORDS[m->kind]);
    }
}
