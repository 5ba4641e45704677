#!/bin/sh
# dual.sh OCTREE POSITIONS PICTURE AMBIENT SIZE [OPTION...] -o OUT.hdr
#
# What a camera of two fisheye lenses of 200 degrees, back to back, stores of a room: both circles side by side, SIZE pixels each.
# It stands where the line of PICTURE in POSITIONS says, level, and looks along the heading (ilfpack(1)).  OPTIONs are rpict's.
# Indirect light starts from a copy of the file AMBIENT, if that is there; so a picture does not depend on what was drawn before.
set -eu
octree=$1 positions=$2 picture=$3 ambient=$4 size=$5
shift 5
options=
while [ "$1" != -o ]; do options="$options $1"; shift; done
out=$2
set -- $(awk -v name="$picture" '$1 == name {h = $5 / 57.29577951308232; printf "%s %s %s %.9f %.9f\n", $2, $3, $4, cos(h), sin(h)}' "$positions")
[ $# = 5 ] || { echo "dual.sh: $positions: expected one line \"$picture x y z heading\"" >&2; exit 1; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
[ ! -e "$ambient" ] || cp "$ambient" "$scratch/room.amb"
see() {
    rpict -vta -vu 0 0 1 -vh 200 -vv 200 -x "$size" -y "$size" -vp "$1" "$2" "$3" -vd "$4" "$5" 0 $options -af "$scratch/room.amb" "$octree"
}
see "$1" "$2" "$3" "$4" "$5" > "$scratch/front.hdr"
see "$1" "$2" "$3" "$(echo "$4" | awk '{print -$1}')" "$(echo "$5" | awk '{print -$1}')" > "$scratch/back.hdr"
pcompos -x $((2 * size)) -y "$size" "$scratch/front.hdr" 0 0 "$scratch/back.hdr" "$size" 0 > "$out.part"
mv "$out.part" "$out"
