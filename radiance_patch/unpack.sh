#!/bin/sh
# Lay out Radiance's src tree in OUT and patch it: unpack.sh ARCHIVE-OR-FOLDER OUT [SERIES]
# Its own VERSION says which patches it gets, those of a folder beside this script, whose name goes to standard output.  SERIES: another
# list of them than the folder's own (/dev/null: none).  Where OUT is there already, files that come out the same keep their dates.
set -eu
here=$(dirname "$0")
supported='5.4a (October 2021 to September 2023) or 6.1a (August 2026)'
refuse() {
    echo "unpack: $1" >&2
    rm -rf "$2.new"
    exit 1
}
rm -rf "$2.new"
mkdir -p "$2.new"
if [ -d "$1" ]; then
    src=$1
    for d in "$1/src" "$1/ray/src"; do [ -d "$src/rt" ] || src=$d; done
    [ -f "$src/rt/raytrace.c" ] ||
        refuse "$1: expected Radiance's src folder (common/, rt/, ot/ ...), found no rt/raytrace.c" "$2"
    from=$src/..
elif [ ! -f "$1" ]; then
    refuse "$1: expected Radiance's source as a folder or a tar archive, found nothing" "$2"
else
    # the archive's uppermost folder that holds rt/raytrace.c, and the licence beside it
    at=$(tar tf "$1" 2>/dev/null | grep -E '(^|/)rt/raytrace\.c$' | awk -F/ '{ print NF, $0 }' | sort -n | sed -n '1s/^[0-9]* //p') || at=
    [ -n "$at" ] || refuse "$1: expected a tar archive of Radiance's source (.../rt/raytrace.c in it), found another file" "$2"
    at=${at%rt/raytrace.c}
    mkdir "$2.new/.archive"
    tar xf "$1" -C "$2.new/.archive" || refuse "$1: the archive is damaged" "$2"
    src=$2.new/.archive/$at
    from=$src/..
fi
for d in common rt ot gen px util cal; do
    [ -d "$src/$d" ] || refuse "$1: expected Radiance's src folder, found no $d/" "$2"
done
for d in common rt ot gen px util cal cv; do
    [ ! -d "$src/$d" ] || cp -R "$src/$d" "$2.new/"
done
for f in "$src/License.txt" "$from/License.txt"; do
    [ ! -f "$f" ] || cp "$f" "$2.new/"
done
chmod -R u+w "$2.new"
rm -rf "$2.new/.archive"

version=$(cat "$2.new/rt/VERSION" 2>/dev/null || echo 'no rt/VERSION')
revision=$(sed -n 's/.*Id: source.c,v \([0-9.]*\) \([0-9/]*\).*/\1 of \2/p' "$2.new/rt/source.c" 2>/dev/null | head -n 1)
case $version in
*" 5.4a"*) series=5.4a ;;
*" 6.1a"*) series=6.1 ;;
*) refuse "$1: expected Radiance $supported, found \"$version\"" "$2" ;;
esac
while read -r p; do
    # one that fails halfway leaves nothing, and says it in one line
    patch -s -p1 -r - -d "$2.new" <"$here/$series/$p" >"$2.new/log" 2>&1 ||
        refuse "$1: expected Radiance $supported, found \"$version\", rt/source.c ${revision:-of no known revision}: $series/$p does not apply" "$2"
done <"${3:-$here/$series/series}"
rm -f "$2.new/log"
if [ -d "$2" ]; then
    (cd "$2.new" && find . -type f) | while IFS= read -r f; do
        ! cmp -s "$2/$f" "$2.new/$f" || mv "$2/$f" "$2.new/$f"
    done
    rm -rf "$2"
fi
mv "$2.new" "$2"
echo $series
