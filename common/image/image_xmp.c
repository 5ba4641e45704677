/*
 * image_xmp.c - what XMP says of a panorama (Google's Photo Sphere metadata, the namespace "GPano").
 *
 * A property is an attribute of rdf:Description or an element of its own,
 *   GPano:FullPanoWidthPixels="6144"        <GPano:FullPanoWidthPixels>6144</GPano:FullPanoWidthPixels>
 * under the prefix that the packet binds to the namespace.  The packet lies in a block in memory that may hold
 * anything; what can't be read says nothing.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "image_internal.h"

typedef struct packet {
    const char *text;
    size_t n;
    char prefix[32]; /* with its colon */
} packet;

static const char *find(const packet *p, size_t from, const char *what)
{
    return from < p->n ? memmem(p->text + from, p->n - from, what, strlen(what)) : NULL;
}

/* The prefix of xmlns:PREFIX="...panorama/", else GPano. */
static void find_prefix(packet *p)
{
    strcpy(p->prefix, "GPano:");
    const char *uri = find(p, 0, "http://ns.google.com/photos/1.0/panorama/");
    if (!uri) return;
    const char *q = uri;
    while (q > p->text && q[-1] != ':' && uri - q < (long)sizeof p->prefix) q--;
    char name[sizeof p->prefix - 1];
    if (q == p->text || q[-1] != ':' || sscanf(q, "%30[A-Za-z0-9_.-]", name) != 1) return;
    snprintf(p->prefix, sizeof p->prefix, "%s:", name);
}

/* The value of a property as text, without what is around it: 1, or 0. */
static int property(char value[64], const packet *p, const char *name)
{
    char key[96];
    const size_t n = (size_t)snprintf(key, sizeof key, "%s%s", p->prefix, name);
    for (const char *at = find(p, 0, key); at; at = find(p, (size_t)(at - p->text) + 1, key)) {
        const char *q = at + n, *end = p->text + p->n;
        while (q < end && strchr(" \t\r\n", *q)) q++;
        if (q == end || (*q != '=' && *q != '>')) continue; /* the beginning of a longer name */
        for (q++; q < end && strchr(" \t\r\n\"'", *q);) q++;
        size_t k = 0;
        while (q + k < end && k < 63 && !strchr("<\"'", q[k])) k++;
        memcpy(value, q, k);
        value[k] = 0;
        return k > 0;
    }
    return 0;
}

static int number(double *v, const packet *p, const char *name)
{
    char text[64], *end;
    if (!property(text, p, name)) return 0;
    const double x = strtod(text, &end);
    end += strspn(end, " \t\r\n");
    if (end == text || *end || !(fabs(x) < 1e9)) return 0;
    *v = x;
    return 1;
}

static int numbers(double *v, const packet *p, const char *const *names, int n)
{
    double got[4];
    for (int k = 0; k < n; k++)
        if (!number(got + k, p, names[k])) return 0;
    memcpy(v, got, sizeof *v * (size_t)n);
    return 1;
}

/* From pixels of the whole panorama, as it was written: a picture that was made smaller since keeps them. */
static void extent(img_panorama *o, const double size[2], const double at[4])
{
    o->shows_deg[0] = 360 * at[0] / size[0] - 180, o->shows_deg[1] = 360 * (at[0] + at[2]) / size[0] - 180;
    o->shows_deg[2] = 90 - 180 * at[1] / size[1], o->shows_deg[3] = 90 - 180 * (at[1] + at[3]) / size[1];
    o->aspect = at[3] > 0 ? at[2] / at[3] : 0;
}

void img_xmp_panorama(img_info *info, const unsigned char *block, size_t n)
{
    static const char *const full[] = {"FullPanoWidthPixels", "FullPanoHeightPixels"},
                             *const part[] = {"CroppedAreaLeftPixels", "CroppedAreaTopPixels",
                                              "CroppedAreaImageWidthPixels", "CroppedAreaImageHeightPixels"},
                             *const pose[] = {"PoseHeadingDegrees", "PosePitchDegrees", "PoseRollDegrees"};
    char kind[64];
    double size[2], at[4];
    packet p = {.text = (const char *)block, .n = n};
    if (info->panorama) return;
    find_prefix(&p);
    if (!property(kind, &p, "ProjectionType") || strncmp(kind, "equirectangular", 15) != 0) return;
    info->panorama = 1;
    if (numbers(size, &p, full, 2) && numbers(at, &p, part, 4) && size[0] > 0 && size[1] > 0)
        extent(&info->pano, size, at);
    for (int k = 0; k < 3; k++) info->pano.has_pose[k] = number(info->pano.pose_deg + k, &p, pose[k]);
}
