/* fuzz_session.c - session files: what is accepted can be planned, named and turned into commands. */
#include <math.h>

#include "fuzz.h"
#include "stagectl/names.h"
#include "stagectl/session.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_file file = file_of(data, size);
    session s;
    errmsg e = {""};

    if (session_load(&s, file.path, &e) != 0) one_line(e.text);
    else {
        static char value[4096];
        char name[NAME_ROOM];

        HOLDS(s.nodes[0] >= 1 && s.nodes[1] >= 1 && s.exposures >= 1 && s.exposures <= EXPOSURES_MAX);
        for (const session_key *k = session_keys; k->name; k++) session_value(value, sizeof value, &s, k);
        for (int n = 0; n < 9; n++) HOLDS(isfinite(s.plane[n]));
        for (int k = 0; k < s.exposures; k++) HOLDS(isfinite(s.exposure[k]) && s.exposure[k] > 0);
        /* names stay inside the folder */
        if (name_picture(name, &s, s.nodes[0] - 1, s.nodes[1] - 1, s.exposures - 1, &e) == 0) {
            HOLDS(name[0] && name[0] != '/' && strcmp(name, "..") && strncmp(name, "../", 3) &&
                  !strstr(name, "/../"));
        } else one_line(e.text);
        place p = {0};
        const double arrived[2] = {1, -2};
        argwords words;
        if (name_command(&words, &s, &p, arrived, 0, "a file", &e) == 0) {
            HOLDS(words.n >= 1 && words.word[words.n] == NULL);
            argwords_free(&words);
        } else one_line(e.text);
        session_free(&s);
    }
    close(file.fd);
    return 0;
}
