/*
 * cputime.h - CPU time, seconds: of all threads, and of this one.
 */
#ifndef CPUTIME_H
#define CPUTIME_H

double cpu_seconds(void);
double cpu_thread_seconds(void);

#endif
