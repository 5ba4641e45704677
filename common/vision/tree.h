/*
 * tree.h - what a YAML, JSON or XML file says, as paths with numbers or words: cv::FileStorage behind a C
 * interface.  It reads JSON, too, though elsewhere Jansson does: what older OpenCVs write as JSON is none
 * ("1." for a number, .Nan), and they are whom these files come from.
 *
 * "a: {b: [1, 2]}" has the path "a.b" with two numbers.  A list of lists of numbers is one list, row by row;
 * other lists have their items' numbers in the path ("a.0.b").  OpenCV's matrices are maps with rows, cols
 * and data.  Numbers are doubles; true and false are 1 and 0; null is left out.
 */
#ifndef VISION_TREE_H
#define VISION_TREE_H

#ifdef __cplusplus
extern "C" {
#endif

#include "base/errmsg.h"

typedef struct vision_tree vision_tree;

/* text: a whole file; name: for messages.  -1 with words where it can't be parsed.  YAML needs no "%YAML"
 * line. */
int vision_tree_read(vision_tree **t, const char *text, const char *name, errmsg *e);
void vision_tree_free(vision_tree *t); /* NULL allowed */

int vision_tree_count(const vision_tree *t);
const char *vision_tree_path(const vision_tree *t, int k); /* in the file's order, or NULL */

/* Of path: its numbers (*n of them), or NULL; its words, or NULL.  Owned by the tree. */
const double *vision_tree_numbers(const vision_tree *t, const char *path, int *n);
const char *vision_tree_words(const vision_tree *t, const char *path);

#ifdef __cplusplus
}
#endif

#endif
