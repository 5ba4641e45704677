#!/bin/sh
# Lay out Radiance's src tree in OUT and patch it: unpack.sh TARBALL-OR-FOLDER OUT
# Our patches are in ./series beside this script.
set -eu
here=$(dirname "$0")
rm -rf "$2" "$2.new"
mkdir -p "$2.new"
if [ -d "$1" ]; then
    src=$1
    [ -d "$src/rt" ] || src=$1/src
    [ -f "$src/rt/raytrace.c" ] ||
        { echo "unpack: $1: expected Radiance's src folder (common/, rt/, ot/ ...), found no rt/raytrace.c" >&2; exit 1; }
    for d in common rt ot gen px util cal; do cp -R "$src/$d" "$2.new/"; done
    for f in "$1/License.txt" "$1/../License.txt"; do [ ! -f "$f" ] || cp "$f" "$2.new/"; done
elif [ ! -f "$1" ]; then
    echo "unpack: $1: expected Radiance's source folder or its source distribution, found nothing" >&2
    exit 1
else
    tar xzf "$1" -C "$2.new" --strip-components=4 --wildcards '*/src/Radiance/src/*'
    tar xzf "$1" -C "$2.new" --strip-components=3 --wildcards '*/src/Radiance/License.txt'
fi
while read -r p; do
    patch -s -p1 -d "$2.new" <"$here/$p" ||
        { echo "unpack: $p does not apply to $1 (expected Radiance 5.4a)" >&2; exit 1; }
done <"$here/series"
mv "$2.new" "$2"
