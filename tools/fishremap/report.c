/*
 * report.c - what was found and how long it took, as JSON (report.h).
 */
#include "report.h"

#include <jansson.h>
#include <math.h>

#include "base/outfile.h"

/* A number to the digits that it has; null where it is none.  Makers of members return NULL for out of
 * memory, which json_object_set_new() and json_pack() take for a failure. */
static json_t *number(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

static json_t *cpu_of(const outcome *o)
{
    return json_pack("{s:o, s:o, s:o}", "plan", number(o->cpu_plan_s), "prepare", number(o->cpu_prepare_s),
                     "remap", number(o->cpu_remap_s));
}

static json_t *circle_of(const circle_found *c)
{
    return json_pack("{s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "rim_seen", number(c->share), "in_picture",
                     number(c->seen), "rms_px", number(c->rms), "contrast", number(c->contrast), "strength",
                     number(c->strength), "margin", number(c->margin), "apart", number(c->apart));
}

static json_t *one_circle(const outcome *o, int k)
{
    const sphere_seen *q = o->circles + k;
    return json_pack("{s:[o, o], s:o, s:o}", "centre", number(q->x), number(q->y), "radius", number(q->r),
                     "fov_deg", number(2 * o->circle_half_deg[k]));
}

static json_t *circles_of(const outcome *o)
{
    return json_pack("[o, o]", one_circle(o, 0), one_circle(o, 1));
}

static json_t *spheres_of(const outcome *o)
{
    json_t *list = json_array();
    for (int k = 0; list && k < o->nspheres; k++) {
        const sphere_seen *s = o->spheres + k;
        if (json_array_append_new(list, json_pack("[o, o, o]", number(s->x), number(s->y), number(s->r)))) {
            json_decref(list);
            return NULL;
        }
    }
    return list;
}

/* -1: out of memory. */
static int fill(json_t *j, const outcome *o)
{
    int bad = json_object_set_new(j, "bad_pixels", json_integer(o->bad_pixels)) |
              json_object_set_new(j, "covered", number(o->covered)) |
              json_object_set_new(j, "cpu_s", cpu_of(o));
    if (o->radius > 0)
        bad |= json_object_set_new(j, "centre", json_pack("[o, o]", number(o->cx), number(o->cy))) |
               json_object_set_new(j, "radius", number(o->radius));
    if (o->circles[0].r > 0)
        bad |= json_object_set_new(j, "circles", circles_of(o)) |
               json_object_set_new(j, "second_colour",
                                   json_pack("[o, o, o]", number(o->second_colour[0]),
                                             number(o->second_colour[1]), number(o->second_colour[2])));
    if (o->second_gain > 0)
        bad |= json_object_set_new(j, "second_gain", number(o->second_gain)) |
               json_object_set_new(j, "second_residual", number(o->second_residual)) |
               json_object_set_new(j, "second_overlap_sr", number(o->second_overlap));
    if (o->circle.r > 0) bad |= json_object_set_new(j, "circle", circle_of(&o->circle));
    if (o->spheres_from) bad |= json_object_set_new(j, "spheres_from", json_string(o->spheres_from));
    if (o->rims_seen)
        bad |= json_object_set_new(j, "rims_seen", json_integer(o->rims_seen)) |
               json_object_set_new(j, "rims_rms_px", number(o->rims_rms));
    if (o->nspheres)
        bad |= json_object_set_new(j, "polar_valid_deg", number(o->polar_valid_deg)) |
               json_object_set_new(j, "pitch_per_diameter", number(o->pitch)) |
               json_object_set_new(j, "tilt_deg", number(o->tilt_deg)) |
               json_object_set_new(j, "spheres", spheres_of(o));
    return bad;
}

int report_write(const char *path, const outcome *o, errmsg *e)
{
    outfile *out;
    json_t *j = json_object();
    char *text = j && fill(j, o) == 0 ? json_dumps(j, JSON_INDENT(1) | JSON_REAL_PRECISION(9)) : NULL;
    json_decref(j);
    if (!text) return err_set(e, "%s: out of memory", path);
    int rc = out_begin(&out, path, e);
    if (!rc) {
        fprintf(out_stream(out), "%s\n", text);
        rc = out_commit(out, e);
    }
    free(text);
    return rc;
}
