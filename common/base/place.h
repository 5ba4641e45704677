/*
 * place.h - where a picture was taken, and which way the camera looked: one line of a list of places.
 *
 *     picture x y z heading [pitch roll]      # scene's unit, degrees; names with blanks in "quotes"
 *
 * heading is that of the picture's middle, counter-clockwise from +x about +z; then pitch (nose up), then
 * roll (right side down).  Angles that are missing are 0; a heading of ? is not known.
 */
#ifndef PLACE_H
#define PLACE_H

typedef struct place {
    char *name;
    int line; /* of the file, from 1 */
    double at[3];
    double heading, pitch, roll; /* degrees */
    int unknown;                 /* 1: nobody knows the heading; it is 0 then */
} place;

/* Read a line, which is cut in two: *name is the picture (NULL: none), *rest the numbers' text.  Sets p's numbers, its
 * name and line to nothing.  Returns how many numbers there are, or -1 where they are not up to six. */
int place_of_line(place *p, char **name, char *line, const char **rest);

/* Unit vectors forward, left, up of a place's picture, in the scene's coordinates. */
void place_axes(double axes[3][3], const place *p);

/* A place's angles from its axes. */
void place_angles(place *p, const double axes[3][3]);

#endif
