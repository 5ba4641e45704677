/*
 * page.h - the page: its template (page/, compiled in) with the light fields' numbers in it.
 */
#ifndef VIEW_PAGE_H
#define VIEW_PAGE_H

#include <stdio.h>

#include "content.h"

/* Bytes of the page without any light field. */
double page_bytes(void);

/* Write it; what went wrong shows in the stream. */
void page_write(FILE *to, const content *c, int n);

#endif
