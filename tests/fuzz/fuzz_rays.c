/* fuzz_rays.c - rays as text, as ilftrace takes them, and the lookups that follow. */
#include <math.h>

#include "fuzz.h"

/* the program itself, for its reader of rays */
#define main ilftrace_main
int ilftrace_main(int argc, char **argv);
#include "../../ilfmat/programs/ilftrace.c"

static ilf *the_field(void)
{
    static ilf *field;
    enum { NU = 3, NV = 2, NT = 5, NP = 4 };

    if (field) return field;
    const ilf_spec spec = {.n_u = NU,
                           .n_v = NV,
                           .n_theta = NT,
                           .n_phi = NP,
                           .U = {2, 0, 0},
                           .V = {0, 1, 0},
                           .polar_max = 1.6144f,
                           .polar_valid = 1.39f,
                           .type = ILF_FLOAT};
    float rgb[NT * NP * 3];
    uint32_t x = 1;
    ilf_writer *w;
    ilf_error err;
    fuzz_file f = file_of(NULL, 0);

    HOLDS(ilf_writer_open(&w, f.path, &spec, &err) == ILF_OK);
    for (int k = 0; k < NU * NV; k++) {
        for (size_t t = 0; t < sizeof rgb / sizeof *rgb; t++) {
            x = x * 1664525u + 1013904223u;
            rgb[t] = ldexpf((float)(x >> 8), (int)(x % 40) - 40);
        }
        HOLDS(ilf_writer_probe(w, rgb, &err) == ILF_OK);
    }
    HOLDS(ilf_writer_close(w, &err) == ILF_OK);
    HOLDS(ilf_open(&field, f.path, &err) == ILF_OK);
    return field;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const double origin[3] = {-1.5e308, 1, 1e308}, U[3] = {1, 1, 1}, V[3] = {1, -1, 0};
    ilf *field = the_field();
    char *text = malloc(size + 1);
    ilf_error err;

    HOLDS(text != NULL);
    ilf_frame frames[2] = {*ilf_get_frame(field)};
    HOLDS(ilf_frame_init(&frames[1], origin, U, V, NULL, &err) == ILF_OK);
    memcpy(text, data, size);
    text[size] = 0;
    for (char *line = text, *next; line; line = next) {
        double ray[9];
        next = strchr(line, '\n');
        if (next) *next++ = 0;
        if (read_ray(ray, line) != 0) continue;
        for (int m = 0; m < 6; m++) {
            float rgb[3];
            if (ilf_eval(rgb, field, &frames[m / 3], ray, ray + 3, m % 3 < 2 ? ray + 6 : NULL,
                         m % 3 ? ILF_DEPTH : ILF_NO_DEPTH, &err) != ILF_OK) {
                HOLDS(err.status == ILF_ERR_ARG);
                one_line(err.text);
                continue;
            }
            for (int c = 0; c < 3; c++) HOLDS(isfinite(rgb[c]) && rgb[c] >= 0);
        }
    }
    free(text);
    return 0;
}
