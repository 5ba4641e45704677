/*
 * falloff_json.c - see falloff_json.h.  Jansson reads; a name that stands twice in an object is refused, as
 * readers differ in which of the two counts.
 */
#include "falloff_json.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Powers that a set has, as far as they are numbers; other members are remarks. */
static int take_set(double c[FALLOFF_MAX_POWER + 1], int *powers, json_t *set, const char *key,
                    const char *name, errmsg *e)
{
    const char *power;
    json_t *value;
    memset(c, 0, sizeof *c * (FALLOFF_MAX_POWER + 1));
    c[0] = 1;
    *powers = 0;
    json_object_foreach(set, power, value)
    {
        char *end;
        long k = strtol(power, &end, 10);
        if (json_is_object(value))
            return err_set(e, "%s: set %.60s: expected powers and their coefficients, found an object", name,
                           key);
        if (end == power || *end) continue;
        if (k < 0 || k > FALLOFF_MAX_POWER)
            return err_set(e, "%s: expected powers 0..%d, found %ld", name, FALLOFF_MAX_POWER, k);
        if (!json_is_number(value))
            return err_set(e, "%s: set %.60s: expected a number for power %ld, found none", name, key, k);
        c[k] = json_number_value(value);
        ++*powers;
    }
    return 0;
}

/* The set that is wanted, or where none is (want is "", or it is only the picture's f-number and there is no
 * other set) the first. */
static int choose(double c[FALLOFF_MAX_POWER + 1], char chosen[FALLOFF_NAME], json_t *root, const char *want,
                  int only_this, const char *name, errmsg *e)
{
    double one[FALLOFF_MAX_POWER + 1], first[FALLOFF_MAX_POWER + 1];
    char list[512] = "", first_name[FALLOFF_NAME] = "";
    const char *key;
    json_t *value;
    int usable = 0, found = 0, powers;
    json_object_foreach(root, key, value)
    {
        if (!json_is_object(value)) continue;
        if (take_set(one, &powers, value, key, name, e)) return -1;
        if (!powers) continue;
        snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", *list ? ", " : "", key);
        if (!usable++) {
            memcpy(first, one, sizeof first);
            snprintf(first_name, sizeof first_name, "%s", key);
        }
        if (strcmp(key, want) != 0) continue;
        memcpy(c, one, sizeof one);
        found = 1;
    }
    chosen[0] = 0;
    if (found) return 0;
    if (usable == 0 || (*want && (only_this || usable > 1)))
        return err_set(e, "%s: expected %s, found the sets (%s)", name,
                       *want ? want : "a set of coefficients", *list ? list : "none");
    memcpy(c, first, sizeof first);
    if (usable > 1) snprintf(chosen, FALLOFF_NAME, "%s", first_name);
    return 0;
}

int falloff_json(double c[FALLOFF_MAX_POWER + 1], char chosen[FALLOFF_NAME], const char *text,
                 const char *name, const char *set, double f_number, errmsg *e)
{
    char number[32];
    const char *want = set ? set : "";
    json_error_t why;
    json_t *root = json_loads(text, JSON_REJECT_DUPLICATES | JSON_DECODE_INT_AS_REAL, &why);
    if (!root) return err_set(e, "%s: line %d: expected JSON, found that: %s", name, why.line, why.text);
    if (!set && f_number > 0) {
        snprintf(number, sizeof number, "f%g", f_number);
        want = number;
    }
    int rc = choose(c, chosen, root, want, set != NULL, name, e);
    json_decref(root);
    return rc;
}
