/*
 * viewcache.c - the cache of rendered views: key, look-up, store.
 *
 * The key is the SHA-256 of every input in words; the octree counts with the contents of all files that it
 * names (scenefiles.h).
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/outfile.h"
#include "stagectl/scenefiles.h"
#include "stagectl/sha256.h"
#include "viewrender.h"

static const char magic[] = "virtualcamera view 2"; /* change it when the rendering changes */

static void add_words(sha256 *h, const char *s)
{
    sha256_add(h, s, strlen(s) + 1);
}

int view_check_options(const argwords *options, errmsg *e)
{
    for (int i = 0; i < options->n; i++) {
        const char *w = options->word[i];
        if (w[0] == '-' && (strchr("fohxynI", w[1] ? w[1] : '?') || !strcmp(w, "-i") || !strcmp(w, "-i+")))
            return err_set(e, "--render-options: expected options on light and sampling, found '%s'", w);
    }
    return 0;
}

int view_key(char hex[65], const fisheye *f, const camera_frame *c, const view_settings *s, errmsg *e)
{
    sha256 h;
    struct stat st;
    char words[256];
    if (scene_digest(words, s->octree, e) != 0) return -1;
    sha256_begin(&h);
    add_words(&h, magic);
    add_words(&h, words);
    if (stat(s->rtrace, &st) == 0) { /* another build of the renderer may see otherwise */
        snprintf(words, sizeof words, "%lld %lld.%09ld", (long long)st.st_size, (long long)st.st_mtim.tv_sec,
                 st.st_mtim.tv_nsec);
        add_words(&h, words);
    }
    for (int i = 0; i < s->options->n; i++) add_words(&h, s->options->word[i]);
    snprintf(words, sizeof words, "lens %d half %a size %d K %d R %d", (int)f->lens, f->half_fov, f->size,
             s->supersample, s->refine);
    add_words(&h, words);
    for (int a = 0; a < 3; a++) {
        snprintf(words, sizeof words, "%a %a %a", c->pos[a] + 0.0, c->u[a] + 0.0, c->v[a] + 0.0);
        add_words(&h, words);
    }
    return sha256_end(&h, hex, e);
}

static char *cache_path(const char *dir, const char *key, errmsg *e)
{
    char *p = NULL;
    if (asprintf(&p, "%s/view-%.32s.pfm", dir, key) < 0) {
        err_set(e, "out of memory");
        return NULL;
    }
    return p;
}

static int read_map(float *radiance, int size, FILE *f)
{
    int w, h;
    float scale;
    size_t row = (size_t)size * 3;
    if (fscanf(f, "PF %d %d %f", &w, &h, &scale) != 3 || getc(f) != '\n') return -1;
    if (w != size || h != size || scale != -1.0f) return -1;
    for (int y = size - 1; y >= 0; y--)
        if (fread(radiance + (size_t)y * row, sizeof *radiance, row, f) != row) return -1;
    return getc(f) == EOF ? 0 : -1;
}

int view_cached(float *radiance, int size, const char *dir, const char *key, errmsg *e)
{
    char *path = cache_path(dir, key, e);
    if (!path) return -1;
    FILE *f = fopen(path, "rb");
    /* a damaged entry is made again, it is only a cache */
    int found = f && read_map(radiance, size, f) == 0;
    int bad = !f && errno != ENOENT ? err_errno(e, "%s", path) : 0;
    if (f) fclose(f);
    free(path);
    return bad ? -1 : found;
}

/* Portable float map: rows from the bottom, scale -1 = little endian. */
int view_store(const float *radiance, int size, const char *dir, const char *key, errmsg *e)
{
    outfile *o;
    size_t row = (size_t)size * 3;
    if (mkdir(dir, 0777) != 0 && errno != EEXIST) return err_errno(e, "%s", dir);
    char *path = cache_path(dir, key, e);
    if (!path) return -1;
    int bad = out_begin(&o, path, e);
    free(path);
    if (bad) return -1;
    fprintf(out_stream(o), "PF\n%d %d\n-1.0\n", size, size);
    for (int y = size - 1; y >= 0; y--)
        fwrite(radiance + (size_t)y * row, sizeof *radiance, row, out_stream(o));
    return out_commit(o, e);
}
