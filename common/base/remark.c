/*
 * remark.c - see remark.h.
 */
#include "remark.h"

#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>

#include "errmsg.h"

enum { KEPT = 256 }; /* different remarks that are told apart */

static void (*listener)(const char *line);
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static uint64_t said[KEPT];
static int nsaid;

void remark_to(void (*say)(const char *line))
{
    listener = say;
}

/* 1 the first time that these words come by. */
static int is_new(const char *words)
{
    uint64_t hash = 0xcbf29ce484222325u; /* FNV-1a */
    for (; *words; words++) hash = (hash ^ (unsigned char)*words) * 0x100000001b3u;
    for (int i = 0; i < nsaid; i++)
        if (said[i] == hash) return 0;
    if (nsaid < KEPT) said[nsaid++] = hash;
    return 1;
}

void remark(const char *file, const char *fmt, ...)
{
    char words[sizeof((errmsg *)0)->text];
    errmsg line;
    va_list ap;
    if (!listener) return;
    va_start(ap, fmt);
    vsnprintf(words, sizeof words, fmt, ap);
    va_end(ap);
    err_set(&line, "%s: %s", file, words);
    pthread_mutex_lock(&lock);
    if (is_new(words)) listener(line.text);
    pthread_mutex_unlock(&lock);
}
