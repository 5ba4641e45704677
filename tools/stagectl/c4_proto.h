/*
 * c4_proto.h - the C4 controller of Arrick Robotics' MD-2 stage, as three independent host programs use it.
 *
 * Inferred: no manual of the protocol is public, and this has not met the hardware.
 *
 *   !1fp             who are you          -> C4...
 *   !1h12            home motors 1 and 2  -> o, o
 *   !1m1f400m2r200n  unsigned relative half steps; a motor that stands still is left out
 *                                         -> a at once, o when done
 *   !1a              stop
 *
 * Each command ends with CR; answers have no line end.
 */
#ifndef C4_PROTO_H
#define C4_PROTO_H

#include <stddef.h>

enum { C4_BAUD = 9600 };

/* The command that moves by so many half steps; 0 when there is nothing to move, else its length. */
size_t c4_format_move(char *out, size_t room, const long steps[2]);

/* Nearest whole number of half steps for a position: targets are rounded, differences never added up. */
long c4_steps(double mm, double steps_per_mm);

#endif
