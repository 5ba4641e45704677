#!/bin/sh
# Lay out Radiance's src tree in OUT and patch it: unpack.sh TARBALL-OR-FOLDER OUT [SERIES]
# Our patches, and the list of them that is used where no other is named (/dev/null: none), are beside this script.
# Where OUT is there already, files that come out the same keep their dates.
set -eu
here=$(dirname "$0")
series=${3:-$here/series}
refuse() {
    echo "unpack: $1" >&2
    rm -rf "$2.new"
    exit 1
}
rm -rf "$2.new"
mkdir -p "$2.new"
if [ -d "$1" ]; then
    src=$1
    [ -d "$src/rt" ] || src=$1/src
    [ -f "$src/rt/raytrace.c" ] ||
        refuse "$1: expected Radiance's src folder (common/, rt/, ot/ ...), found no rt/raytrace.c" "$2"
    for d in common rt ot gen px util cal; do
        [ -d "$src/$d" ] || refuse "$1: expected Radiance's src folder, found no $d/" "$2"
        cp -R "$src/$d" "$2.new/"
    done
    for f in "$src/License.txt" "$src/../License.txt"; do
        [ ! -f "$f" ] || cp "$f" "$2.new/"
    done
    chmod -R u+w "$2.new"
elif [ ! -f "$1" ]; then
    refuse "$1: expected Radiance's source folder or its source distribution, found nothing" "$2"
else
    if ! tar tzf "$1" --wildcards '*/src/Radiance/src/rt/raytrace.c' >/dev/null 2>&1; then
        refuse "$1: expected a folder with Radiance's source, or the source distribution craytraverse, found another file (unpack it and name its folder)" "$2"
    fi
    tar xzf "$1" -C "$2.new" --strip-components=4 --wildcards '*/src/Radiance/src/*'
    tar xzf "$1" -C "$2.new" --strip-components=3 --wildcards '*/src/Radiance/License.txt'
fi
version=$(cat "$2.new/rt/VERSION" 2>/dev/null || echo 'no rt/VERSION')
revision=$(sed -n 's/.*Id: source.c,v \([0-9.]*\) \([0-9/]*\).*/\1 of \2/p' "$2.new/rt/source.c" 2>/dev/null | head -n 1)
while read -r p; do
    # one that fails halfway leaves nothing, and says it in one line
    patch -s -p1 -r - -d "$2.new" <"$here/$p" >"$2.new/log" 2>&1 ||
        refuse "$1: expected Radiance 5.4a of October 2021 to September 2023, found \"$version\", rt/source.c ${revision:-of no known revision}: $p does not apply" "$2"
done <"$series"
rm -f "$2.new/log"
if [ -d "$2" ]; then
    (cd "$2.new" && find . -type f) | while IFS= read -r f; do
        ! cmp -s "$2/$f" "$2.new/$f" || mv "$2/$f" "$2.new/$f"
    done
    rm -rf "$2"
fi
mv "$2.new" "$2"
