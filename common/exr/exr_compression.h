/*
 * exr_compression.h - OpenEXR's compressions: their names, since when there are which, and what a file says.
 *
 * OpenEXR's core library 3.1 takes a compression that it does not know for zip.  So a file is asked before it
 * is.
 */
#ifndef EXR_COMPRESSION_H
#define EXR_COMPRESSION_H

#include <stddef.h>
#include <stdint.h>

/* The name of a number, as in the file (ImfCompression.h); NULL for one that is not known here. */
const char *exr_compression_name(int number);

/* The number of a name, or -1. */
int exr_compression_number(const char *name);

/* Lines of a chunk of scan lines; the most that there are where the number is not known. */
int exr_compression_lines(int number);

/* The number that the first header states; -1 if it states none or is broken. */
int exr_stated_compression(int fd, uint64_t file_bytes);

/* Words for what this OpenEXR can't decompress: "found zstd, ..."; NULL if it can. */
const char *exr_foreign_compression(char *words, size_t room, int number);

#endif
