/* session_internal.h - between session.c and session_keys.c. */
#ifndef SESSION_INTERNAL_H
#define SESSION_INTERNAL_H

#include "session.h"

typedef enum key_kind {
    KEY_TEXT,
    KEY_NUMBER,
    KEY_NUMBERS2,
    KEY_NUMBERS4,
    KEY_NUMBERS9,
    KEY_WHOLE,
    KEY_SIZE,
    KEY_YES_NO,
    KEY_ON_OFF,
    KEY_ORDER,
    KEY_CHECK,
    KEY_TIMES,
    KEY_ON_FAIL,
    KEY_AXES,
    KEY_EXPOSURES
} key_kind;

int session_take(session *s, const session_key *k, const char *value, errmsg *e);

#endif
