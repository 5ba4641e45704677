#!/bin/sh
# view.sh SESSION NxM I_J NAME [OPTION...]
#
# Renders what the virtual camera of a session sees from node (I, J) of a grid of N x M on its plane, into the cache that the camera's command
# names, with NAME in place of {i}_{j}.  Further options of virtualcamera come last.  The working folder is the session's.
set -eu
session=$1 grid=$2 node=$3 name=$4
shift 4
get() { stagectl get "$session" "$1"; }
cd "$(dirname "$session")"
plane=$(get grid.plane) lens=$(get camera.lens) fov=$(get camera.fov)
[ "$fov" != 0 ] || fov=185
# lengths along U and V in as many digits as stagectl gives: the cache knows a place by its numbers
at=$(echo "$plane" "$grid" "$node" | tr x_ '  ' | awk '{
    u = sqrt($4 * $4 + $5 * $5 + $6 * $6); v = sqrt($7 * $7 + $8 * $8 + $9 * $9)
    printf("%.10g %.10g", ($10 > 1) ? u * $12 / ($10 - 1) : u / 2, ($11 > 1) ? v * $13 / ($11 - 1) : v / 2)}')
picture=$(mktemp -d)
trap 'rm -rf "$picture"' EXIT
command=$(get camera.command | sed -e "s|{i}_{j}|$name|g; s|{i}|${node%_*}|g; s|{j}|${node#*_}|g; s|{plane}|$plane|g; s|{lens}|${lens:-equidistant}|g; s|{fov}|$fov|g" \
    -e "s|{x}|${at% *}|g; s|{y}|${at#* }|g; s|{seconds}|1|g; s|{file}|$picture/view.exr|g")
eval "$command" '"$@"'
