/*
 * fuzz_journal.c - the journal of a session.
 *
 * A fuzzer can't guess checksums: if the first byte is odd, each line gets its right one, so that the records
 * behind them are reached too.
 */
#include <fcntl.h>
#include <math.h>
#include <sys/stat.h>
#include <zlib.h>

#include "fuzz.h"
#include "stagectl/journal.h"

static const char conf[] =
    "[grid]\nnodes = 3x2\nplane = 0 0 0 0.2 0 0 0 0.1 0\n[stage]\nunit_mm = 1000\norigin = -500 -400\nfeed = "
    "6000\n"
    "[camera]\ncommand = cam {file}\nexposures = 0.25 1\n[output]\nfolder = out\nfile = {i}_{j}_{k}.ppm\n";

static char folder[64], path[96], lock[96];

static void tidy(void)
{
    unlink(path);
    unlink(lock);
    rmdir(folder);
}

static const session *the_session(void)
{
    static session s;
    errmsg e;

    if (s.folder) return &s;
    fuzz_file f = file_of((const uint8_t *)conf, sizeof conf - 1);
    HOLDS(session_load(&s, f.path, &e) == 0);
    close(f.fd);
    /* in memory where there is such a place: opening may sync */
    snprintf(folder, sizeof folder, "%s/ilf-fuzz-XXXXXX",
             access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp");
    HOLDS(mkdtemp(folder) != NULL);
    atexit(tidy);
    free(s.folder);
    s.folder = strdup(folder);
    HOLDS(s.folder != NULL);
    snprintf(path, sizeof path, "%s/journal", folder);
    snprintf(lock, sizeof lock, "%s/.lock", folder);
    return &s;
}

static void write_journal(const uint8_t *data, size_t size, int seal)
{
    static const char heading[] = "stagectl-journal 1";
    FILE *f = fopen(path, "wb");

    HOLDS(f != NULL);
    if (!seal) {
        HOLDS(fwrite(data, 1, size, f) == size);
    } else {
        fprintf(f, "%08lx %s\n", crc32(crc32(0, NULL, 0), (const Bytef *)heading, sizeof heading - 1),
                heading);
        while (size > 0) {
            const uint8_t *end = memchr(data, '\n', size);
            const size_t n = end ? (size_t)(end - data) : size;
            fprintf(f, "%08lx ", crc32(crc32(0, NULL, 0), data, (uInt)n));
            HOLDS(fwrite(data, 1, n, f) == n);
            if (!end) break;
            fputc('\n', f);
            data = end + 1;
            size -= n + 1;
        }
    }
    HOLDS(fclose(f) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const session *s = the_session();
    errmsg e = {""};
    journal *j = NULL;

    if (size < 1) return 0;
    write_journal(data + 1, size - 1, data[0] & 1);
    for (int readonly = 1; readonly >= 0; readonly--) {
        if (journal_open(&j, s, readonly, &e) != 0) {
            HOLDS(j == NULL);
            one_line(e.text);
            continue;
        }
        HOLDS(journal_shots(j) >= 0 && journal_shots(j) <= 12);
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 2; k++) {
                const journal_place *p = journal_at(j, i, k);
                if (p->has_arrived) HOLDS(isfinite(p->arrived[0]) && isfinite(p->arrived[1]));
                for (int x = 0; p->shot && x < 2; x++) {
                    HOLDS(memchr(p->shot[x].digest, 0, sizeof p->shot[x].digest) &&
                          memchr(p->shot[x].temp, 0, sizeof p->shot[x].temp));
                    HOLDS(!strchr(p->shot[x].temp, '/'));
                    HOLDS(p->shot[x].size >= 0);
                }
            }
        if (journal_steps(j)) HOLDS(isfinite(journal_steps(j)[0]) && isfinite(journal_steps(j)[1]));
        if (!readonly) { /* what was read can be gone on with, and read again */
            const double xy[2] = {1, 2};
            const long before = journal_shots(j);
            HOLDS(journal_arrived(j, 1, 1, xy, &e) == 0);
            journal_close(j);
            HOLDS(journal_open(&j, s, 1, &e) == 0);
            HOLDS(journal_shots(j) == before && journal_at(j, 1, 1)->has_arrived && !journal_dropped(j));
        }
        journal_close(j);
        j = NULL;
    }
    return 0;
}
