/*
 * exr_header.h - an OpenEXR file's headers, value by value, as their own sizes say.
 *
 *     magic number, version                       4 + 4 bytes
 *     header: name \0 type \0 size value ...      closed by an empty name
 *     further headers, if the version's bit 12 says so, and an empty one
 *     table: where each chunk begins              8 bytes a chunk, part after part
 *     chunks
 *
 * Names and types have at most 255 characters.  (OpenEXR File Layout, openexr.com.)
 */
#ifndef EXR_HEADER_H
#define EXR_HEADER_H

#include <stdint.h>

enum { EXR_NAME_ROOM = 256 };

typedef enum exr_step {
    EXR_STEP_BROKEN = -1,
    EXR_STEP_END,  /* of the last header: `at` is where the table begins */
    EXR_STEP_PART, /* of a header; the next part's follows */
    EXR_STEP_VALUE /* name, type, value and size say which; it may end beyond the file */
} exr_step;

typedef struct exr_walk {
    int fd, several; /* several: the file may have several parts */
    uint64_t end;    /* of the file */
    uint64_t at;     /* what comes next */
    char name[EXR_NAME_ROOM], type[EXR_NAME_ROOM];
    uint64_t value, size; /* place and bytes of the value */
} exr_walk;

/* Begin before the first header; -1 where the file can't be read. */
int exr_walk_begin(exr_walk *w, int fd, uint64_t file_bytes);
exr_step exr_walk_next(exr_walk *w);

/* 1 if every value of every header ends inside the file, is as long as its type, and stands there once: of
 * two the libraries take different ones.
 *
 * For DWA a file is opened a second time by OpenEXR's older library, which reads a value by its type and not
 * by the size that stands before it: a wrong size puts it out of step, and what it then takes for a size it
 * believes and allocates (2 GB for a file of 900 bytes).  So files whose sizes don't fit are kept from it. */
int exr_header_sound(int fd, uint64_t file_bytes);

/* Bytes of a pixel, summed over a list of channels that lies at the walk's value; 0 where it is none that
 * ends in an empty name at its last byte. */
uint64_t exr_channel_bytes(const exr_walk *w);

#endif
