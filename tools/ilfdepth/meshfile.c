/*
 * meshfile.c - meshes in files.
 */
#include "meshfile.h"

#include <stdio.h>

#include "base/outfile.h"

static void group(FILE *o, const mesh *m, int closed)
{
    fprintf(o, "g %s\n", closed ? "closed" : "measured");
    for (int k = 0; k < m->triangles; k++) {
        const int *t = m->t[k];
        if (mesh_is_closed(m, k) != closed) continue;
        fprintf(o, "f %d/%d %d/%d %d/%d\n", t[0] + 1, t[0] + 1, t[1] + 1, t[1] + 1, t[2] + 1, t[2] + 1);
    }
}

int meshfile_obj(const char *path, const mesh *m, const char *line, errmsg *e)
{
    outfile *out;

    if (out_begin(&out, path, e)) return -1;
    FILE *o = out_stream(out);
    fprintf(o, "# %s\n# vt: relative standard error of a vertex's distance, and 1 where no picture tells\n",
            line);
    for (int k = 0; k < m->n; k++)
        fprintf(o, "v %.9g %.9g %.9g\n", m->v[k].at[0], m->v[k].at[1], m->v[k].at[2]);
    for (int k = 0; k < m->n; k++) fprintf(o, "vt %.4g %d\n", m->v[k].error, m->v[k].closed);
    group(o, m, 0), group(o, m, 1);
    return out_commit(out, e);
}

int meshfile_rad(const char *path, const mesh *m, const char *field, const char *line, errmsg *e)
{
    outfile *out;

    if (out_begin(&out, path, e)) return -1;
    FILE *o = out_stream(out);
    fprintf(o, "# %s\n\nvoid ilf surroundings\n1 %s\n0\n0\n", line, field);
    for (int k = 0; k < m->triangles; k++) {
        fprintf(o, "\nsurroundings polygon %s.%d\n0\n0\n9\n", mesh_is_closed(m, k) ? "closed" : "measured",
                k);
        for (int c = 0; c < 3; c++) {
            const double *p = m->v[m->t[k][c]].at;
            fprintf(o, "\t%.9g %.9g %.9g\n", p[0], p[1], p[2]);
        }
    }
    return out_commit(out, e);
}
