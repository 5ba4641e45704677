/*
 * field_guard.h - for programs: a light field opened so that, when its file is cut short in use, the program ends
 * with words and exit status 1 (base/fault.h).
 */
#ifndef FIELD_GUARD_H
#define FIELD_GUARD_H

#include "base/cli.h"
#include "base/fault.h"
#include "ilf.h"

static inline const char *field_fault(const void *field, const void *address)
{
    return ilf_fault(field, address);
}

/* ilf_open and ilf_close, watched over. */
static inline ilf_status field_open(ilf **field, const char *path, ilf_error *err)
{
    const ilf_status status = ilf_open(field, path, err);

    if (status == ILF_OK) fault_watch(cli_name(), *field, field_fault);
    return status;
}

static inline void field_close(ilf *field)
{
    if (field) fault_forget(field);
    ilf_close(field);
}

#endif
