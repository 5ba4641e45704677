/* stage.c - the driver table and what all drivers share. */
#include "stage.h"

#include <stddef.h>
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

stage_code stage_open(stage *s, const stage_driver *d, const char *path, errmsg *e)
{
    errmsg warning;
    s->driver = d;
    s->state = NULL;
    s->position_known = 0;
    memset(&s->facts, 0, sizeof s->facts);
    if (port_open(&s->port, path, d->baud, &warning, e) != 0) return STAGE_FAILED;
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

stage_code stage_port_error(errmsg *e, port_result r, const char *doing)
{
    switch (r) {
    case PORT_TIMEOUT:
        err_set(e, "stage: no answer while %s", doing);
        return STAGE_SILENT;
    case PORT_GONE:
        err_set(e, "stage: disconnected while %s", doing);
        return STAGE_GONE;
    case PORT_INTERRUPTED:
        err_set(e, "interrupted while %s", doing);
        return STAGE_INTERRUPTED;
    case PORT_OK:
        break;
    }
    return STAGE_OK;
}
