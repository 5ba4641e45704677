/*
 * report.c - what was found and how long it took, as JSON (settings.h).
 */
#include <stdio.h>
#include <stdlib.h>

#include "base/outfile.h"
#include "settings.h"

int report_write(const char *path, const outcome *o, errmsg *e)
{
    outfile *out;
    if (out_begin(&out, path, e)) return -1;
    FILE *f = out_stream(out);
    fprintf(f, "{\n \"bad_pixels\": %lld,\n \"covered\": %.9g,\n", (long long)o->bad_pixels, o->covered);
    fprintf(f, " \"cpu_s\": {\"plan\": %.6f, \"prepare\": %.6f, \"remap\": %.6f}", o->cpu_plan_s,
            o->cpu_prepare_s, o->cpu_remap_s);
    if (o->radius > 0)
        fprintf(f, ",\n \"centre\": [%.4f, %.4f],\n \"radius\": %.4f", o->cx, o->cy, o->radius);
    if (o->second_gain > 0)
        fprintf(f, ",\n \"second_gain\": %.6g,\n \"second_residual\": %.6g,\n \"second_overlap_sr\": %.4g",
                o->second_gain, o->second_residual, o->second_overlap);
    const circle_found *c = &o->circle;
    if (c->r > 0)
        fprintf(f,
                ",\n \"circle\": {\"rim_seen\": %.4f, \"in_picture\": %.4f, \"rms_px\": %.3f, \"contrast\": "
                "%.4f, \"strength\": %.4f, \"margin\": %.4f, "
                "\"apart\": %.4f}",
                c->share, c->seen, c->rms, c->contrast, c->strength, c->margin, c->apart);
    if (o->spheres_from) fprintf(f, ",\n \"spheres_from\": \"%s\"", o->spheres_from);
    if (o->rims_seen) fprintf(f, ",\n \"rims_seen\": %d,\n \"rims_rms_px\": %.3f", o->rims_seen, o->rims_rms);
    if (o->nspheres) {
        fprintf(f,
                ",\n \"polar_valid_deg\": %.4f,\n \"pitch_per_diameter\": %.5f,\n \"tilt_deg\": %.4f,\n "
                "\"spheres\": [",
                o->polar_valid_deg, o->pitch, o->tilt_deg);
        for (int k = 0; k < o->nspheres; k++)
            fprintf(f, "%s\n  [%.3f, %.3f, %.3f]", k ? "," : "", o->spheres[k].x, o->spheres[k].y,
                    o->spheres[k].r);
        fprintf(f, "\n ]");
    }
    fprintf(f, "\n}\n");
    return out_commit(out, e);
}
