/* ambientfile.c - see ambientfile.h. */
#include "ambientfile.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/outfile.h"
#include "stagectl/scenefiles.h"

static int read_digest(char hex[65], const char *path)
{
    FILE *f = fopen(path, "r");
    int ok = f && fscanf(f, "%64s", hex) == 1;
    if (f) fclose(f);
    return ok;
}

static int write_digest(const char *path, const char *hex, errmsg *e)
{
    outfile *o;
    if (out_begin(&o, path, e) != 0) return -1;
    fprintf(out_stream(o), "%s\n", hex);
    return out_commit(o, e);
}

/* Is it certainly another scene's?  Without a digest: when the octree is younger. */
static int of_another(const char *ambient, const char *octree, int known, const char *then, const char *now)
{
    struct stat a, o;
    if (known) return strcmp(then, now) != 0;
    return stat(ambient, &a) == 0 && stat(octree, &o) == 0 &&
           (o.st_mtim.tv_sec > a.st_mtim.tv_sec ||
            (o.st_mtim.tv_sec == a.st_mtim.tv_sec && o.st_mtim.tv_nsec > a.st_mtim.tv_nsec));
}

int ambient_settle(char remark[512], const argwords *options, const char *octree, errmsg *e)
{
    const char *ambient = NULL;
    char now[65], then[65] = "", *beside = NULL, *old = NULL;
    struct stat st;
    remark[0] = 0;
    for (int i = 0; i + 1 < options->n; i++)
        if (!strcmp(options->word[i], "-af")) ambient = options->word[i + 1];
    if (!ambient) return 0;
    if (scene_digest(now, octree, e) != 0) return -1;
    if (asprintf(&beside, "%s.scene", ambient) < 0) return err_set(e, "out of memory");
    int bad = 0, known = read_digest(then, beside), there = stat(ambient, &st) == 0 && st.st_size > 0;
    if (there && of_another(ambient, octree, known, then, now)) {
        if (asprintf(&old, "%s.old", ambient) < 0) bad = err_set(e, "out of memory");
        else if (rename(ambient, old) != 0) bad = err_errno(e, "%s", ambient);
        else
            snprintf(remark, 512, "%.200s: %s; begun anew, the old one is %.200s", ambient,
                     known ? "holds another scene's indirect light" : "is older than the octree", old);
        free(old);
    }
    if (!bad && (!known || strcmp(then, now) != 0)) bad = write_digest(beside, now, e);
    free(beside);
    return bad;
}
