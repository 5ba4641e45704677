#!/bin/sh
# Function files (.cal ...) and further programs from the library package:
# extras.sh PYTHON NAME==VERSION LIB BIN PROGRAM...
set -eu
py=$1 pkg=$2 lib=$3 bin=$4
shift 4
dir=$(mktemp -d "$lib/fetch.XXXXXX")
trap 'rm -rf "$dir"' EXIT
echo "fetching $pkg (function files, obj2mesh, genbox ...)"
"$py" -m pip install -q --disable-pip-version-check --no-deps --target "$dir" "$pkg" ||
    { echo "extras: $pkg could not be installed" >&2; exit 1; }
cp -R "$dir"/pyradiance/lib/. "$lib/"
mkdir -p "$bin"
for p in "$@"; do
    if [ -f "$dir/pyradiance/bin/$p" ]; then
        cp "$dir/pyradiance/bin/$p" "$bin/$p"
        chmod 755 "$bin/$p"
    else
        echo "extras: $pkg has no program $p" >&2
        exit 1
    fi
done
# whose these are, and under which licence
mkdir -p "$lib/../doc"
cp "$dir"/*.dist-info/METADATA "$lib/../doc/${pkg%%==*}.txt"
for f in "$dir"/*.dist-info/licenses/* "$dir"/*.dist-info/LICENSE*; do
    [ ! -f "$f" ] || cp "$f" "$lib/../doc/${pkg%%==*}-$(basename "$f")"
done
