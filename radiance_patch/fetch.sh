#!/bin/sh
# Fetch a source distribution by name and check it: fetch.sh PYTHON NAME==VERSION SHA256 OUT
set -eu
name=${2%%==*}
dir=$(mktemp -d "$(dirname "$4")/fetch.XXXXXX")
trap 'rm -rf "$dir"' EXIT
echo "fetching the source distribution $2"
"$1" -m pip download -q --disable-pip-version-check --no-deps --no-binary "$name" -d "$dir" "$2" ||
    { echo "fetch: $2 could not be downloaded; RADIANCE_SRC=DIR builds from a tree that you have" >&2; exit 1; }
set -- "$@" "$dir"/*.tar.gz
sum=$(sha256sum "$5" | cut -d' ' -f1)
[ "$sum" = "$3" ] || { echo "fetch: $2: expected sha256 $3, found $sum" >&2; exit 1; }
mv "$5" "$4"
