/* stage.c - the driver table and what all drivers share. */
#include "stage.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

static const stage_driver *const drivers[] = {&stage_driver_grbl, &stage_driver_c4, NULL};

const stage_driver *stage_driver_at(int k)
{
    return drivers[k];
}

const stage_driver *stage_driver_by_name(const char *name)
{
    for (int k = 0; drivers[k]; k++)
        if (!strcmp(drivers[k]->name, name)) return drivers[k];
    return NULL;
}

int stage_homing_check(const char *words, errmsg *e)
{
    int n = 0;
    for (const char *p = words; *p; p += strspn(p, " ")) {
        size_t len = strcspn(p, " ");
        if (len < 2 || len > 3 || strncmp(p, "$H", 2) != 0 || (len == 3 && !strchr("XYZ", p[2])))
            return err_set(e, "homing: expected $H, or $HX $HY ..., found '%s'", words);
        p += len;
        n++;
    }
    return n > 0 ? 0 : err_set(e, "homing: expected $H, or $HX $HY ..., found nothing");
}

stage_code stage_open(stage *s, const stage_driver *d, const char *path, errmsg *e)
{
    errmsg warning;
    s->driver = d;
    s->state = NULL;
    s->position_known = s->under_way = s->locked = s->restarted = 0;
    memset(&s->facts, 0, sizeof s->facts);
    s->facts.motors_rest_ms = -1;
    if (port_open(&s->port, path, s->baud > 0 ? s->baud : d->baud, &warning, e) != 0) return STAGE_FAILED;
    if (s->dtr_off && port_drop_dtr(s->port, path, &warning) != 0 && s->note)
        s->note(warning.text), warning.text[0] = 0;
    if (warning.text[0] && s->note) s->note(warning.text);
    stage_code r = d->connect(s, e);
    if (r != STAGE_OK) stage_close(s);
    return r;
}

void stage_close(stage *s)
{
    if (s->driver && s->port) s->driver->release(s);
    port_close(s->port);
    s->port = NULL;
}

int motors_words(char *out, size_t room, const stage_facts *f)
{
    if (f->motors_rest_ms < 0 || f->motors_rest_ms == 255) return 0;
    return snprintf(out, room,
                    "stage: $1=%d: %d ms after each move the motors lose their current, and the stage is "
                    "free to drift while "
                    "the camera exposes; $1=255 keeps them on",
                    f->motors_rest_ms, f->motors_rest_ms) > 0;
}

stage_code stage_port_error(errmsg *e, port_result r, const char *doing)
{
    switch (r) {
    case PORT_TIMEOUT: err_set(e, "stage: no answer while %s", doing); return STAGE_SILENT;
    case PORT_GONE: err_set(e, "stage: disconnected while %s", doing); return STAGE_GONE;
    case PORT_INTERRUPTED: err_set(e, "interrupted while %s", doing); return STAGE_INTERRUPTED;
    case PORT_OK: break;
    }
    return STAGE_OK;
}
