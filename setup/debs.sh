#!/bin/sh
# Install the named Debian/Ubuntu packages that are not there yet.  As root or through sudo;
# on a system without dpkg it only says what is needed.
set -eu
if ! command -v dpkg-query >/dev/null 2>&1; then
    echo "setup: not a Debian system; these packages' equivalents are needed: $*" >&2
    exit 0
fi
missing=
for p in "$@"; do
    case "$(dpkg-query -W -f='${Status}' "$p" 2>/dev/null)" in
        "install ok installed") ;;
        *) missing="$missing $p" ;;
    esac
done
[ -n "$missing" ] || exit 0
sudo=
if [ "$(id -u)" != 0 ]; then
    command -v sudo >/dev/null 2>&1 || { echo "setup: run as root, or install:$missing" >&2; exit 1; }
    sudo=sudo
fi
echo "installing packages:$missing"
export DEBIAN_FRONTEND=noninteractive
log=$(mktemp)
trap 'rm -f "$log"' EXIT
# shellcheck disable=SC2086
if ! { $sudo apt-get update && $sudo apt-get install -y --no-install-recommends $missing; } >"$log" 2>&1; then
    tail -n 20 "$log" >&2
    echo "setup: could not install:$missing" >&2
    exit 1
fi
