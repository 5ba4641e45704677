/* exr_header.c - see exr_header.h. */
#include "exr_header.h"

#include "exr_bytes.h"

enum { SEVERAL_PARTS = 0x1000 }; /* a bit of the version */

int exr_walk_begin(exr_walk *w, int fd, uint64_t file_bytes)
{
    unsigned char head[8];

    *w = (exr_walk){.fd = fd, .end = file_bytes, .at = sizeof head};
    if (file_bytes < sizeof head || exr_bytes_at(fd, head, sizeof head, 0) != 0) return -1;
    w->several = (exr_u32(head + 4) & SEVERAL_PARTS) != 0;
    return 0;
}

static exr_step header_ends(exr_walk *w)
{
    unsigned char next;

    w->at++;
    if (!w->several) return EXR_STEP_END;
    if (w->at >= w->end || exr_bytes_at(w->fd, &next, 1, w->at) != 0) return EXR_STEP_BROKEN;
    if (next) return EXR_STEP_PART;
    w->at++;
    return EXR_STEP_END;
}

exr_step exr_walk_next(exr_walk *w)
{
    unsigned char head[2 * EXR_NAME_ROOM + 4];

    if (w->at >= w->end) return EXR_STEP_BROKEN;
    const size_t have = w->end - w->at < sizeof head ? (size_t)(w->end - w->at) : sizeof head;
    if (exr_bytes_at(w->fd, head, have, w->at) != 0) return EXR_STEP_BROKEN;
    if (head[0] == 0) return header_ends(w);
    const unsigned char *type = memchr(head, 0, have < EXR_NAME_ROOM ? have : EXR_NAME_ROOM), *size = NULL;
    if (type) {
        const size_t left = have - (size_t)(++type - head);
        size = memchr(type, 0, left < EXR_NAME_ROOM ? left : EXR_NAME_ROOM);
    }
    if (!size || (size_t)(++size - head) + 4 > have) return EXR_STEP_BROKEN;
    memcpy(w->name, head, (size_t)(type - head));
    memcpy(w->type, type, (size_t)(size - type));
    w->value = w->at + (uint64_t)(size - head) + 4;
    w->size = exr_u32(size);
    w->at = w->value + w->size;
    return EXR_STEP_VALUE;
}

/* ---- channels ---------------------------------------------------------------------------------------- */

/* name \0 type, linear and three bytes unused, x and y sampling; the list ends in an empty name. */
uint64_t exr_channel_bytes(const exr_walk *w)
{
    enum { HALF = 1, REST = 16 };
    const uint64_t end = w->value + w->size;
    uint64_t sum = 0;

    for (uint64_t at = w->value; at < end;) {
        unsigned char p[EXR_NAME_ROOM + REST];
        const size_t have = end - at < sizeof p ? (size_t)(end - at) : sizeof p;
        if (exr_bytes_at(w->fd, p, have, at) != 0) return 0;
        if (p[0] == 0) return at + 1 == end ? sum : 0;
        const unsigned char *stop = memchr(p, 0, have < EXR_NAME_ROOM ? have : EXR_NAME_ROOM);
        if (!stop || (size_t)(stop - p) + 1 + REST > have) return 0;
        sum += exr_u32(stop + 1) == HALF ? 2 : 4; /* else UINT or FLOAT */
        at += (uint64_t)(stop - p) + 1 + REST;
    }
    return 0;
}

/* Does it end in an empty name at its last byte?  A list may be empty. */
static int channels_sound(const exr_walk *w)
{
    unsigned char first;

    if (w->size == 1) return exr_bytes_at(w->fd, &first, 1, w->value) == 0 && first == 0;
    return exr_channel_bytes(w) > 0;
}

/* ---- sizes ------------------------------------------------------------------------------------------- */

static int preview_sound(const exr_walk *w)
{
    unsigned char wh[8];

    return w->size >= 8 && exr_bytes_at(w->fd, wh, 8, w->value) == 0 && (w->size - 8) % 4 == 0 &&
           (uint64_t)exr_u32(wh) * exr_u32(wh + 4) == (w->size - 8) / 4;
}

static int value_sound(const exr_walk *w)
{
    static const struct {
        const char *type;
        uint64_t size;
    } fixed[] = {{"box2i", 16},
                 {"box2f", 16},
                 {"chromaticities", 32},
                 {"compression", 1},
                 {"deepImageState", 1},
                 {"double", 8},
                 {"envmap", 1},
                 {"float", 4},
                 {"int", 4},
                 {"keycode", 28},
                 {"lineOrder", 1},
                 {"m33f", 36},
                 {"m33d", 72},
                 {"m44f", 64},
                 {"m44d", 128},
                 {"rational", 8},
                 {"tiledesc", 9},
                 {"timecode", 8},
                 {"v2i", 8},
                 {"v2f", 8},
                 {"v2d", 16},
                 {"v3i", 12},
                 {"v3f", 12},
                 {"v3d", 24}};

    for (size_t k = 0; k < sizeof fixed / sizeof *fixed; k++)
        if (!strcmp(w->type, fixed[k].type)) return w->size == fixed[k].size;
    if (!strcmp(w->type, "chlist")) return channels_sound(w);
    if (!strcmp(w->type, "preview")) return preview_sound(w);
    return strcmp(w->type, "floatvector") != 0 || w->size % 4 == 0;
}

/* Is the name new among the n before it? */
static int name_new(uint64_t *names, int n, const char *name)
{
    uint64_t hash = 0xcbf29ce484222325u; /* FNV-1a */

    for (; *name; name++) hash = (hash ^ (unsigned char)*name) * 0x100000001b3u;
    for (int k = 0; k < n; k++)
        if (names[k] == hash) return 0;
    names[n] = hash;
    return 1;
}

int exr_header_sound(int fd, uint64_t file_bytes)
{
    enum { MOST = 1024 };
    uint64_t names[MOST];
    int n = 0;
    exr_walk w;

    if (exr_walk_begin(&w, fd, file_bytes) != 0) return 0;
    for (;;) {
        switch (exr_walk_next(&w)) {
        case EXR_STEP_END: return 1;
        case EXR_STEP_BROKEN: return 0;
        case EXR_STEP_PART: n = 0; break;
        case EXR_STEP_VALUE:
            if (n == MOST || !name_new(names, n++, w.name) || w.size > w.end - w.value || !value_sound(&w))
                return 0;
        }
    }
}
