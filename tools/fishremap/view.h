/*
 * view.h - Radiance's name for a view that was made.
 */
#ifndef VIEW_H
#define VIEW_H

#include <stddef.h>

#include "chart.h"
#include "settings.h"

/* Radiance's name for the view that chart c of kind is, after "VIEW=": 0, or -1 where Radiance has none (text
 * is ""). */
int radiance_view(char *text, size_t room, const chart *c, view_kind kind);

#endif
