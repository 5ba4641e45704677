#!/bin/sh
# The packages as a stranger's machine has them:  test-deb.sh FOLDER (with *.deb)
#
# lintian's errors; then in a clean root of this release (debootstrap, kept in FOLDER/base.tar) what they depend on is installed, then they,
# as an ordinary user a small light field is captured, packed, looked at and rendered, and its picture is compared with the one that
# the build's own programs make; then they are purged, and no file may be more or less than before.
set -eu
folder=$1
here=$(pwd)
say() { echo "test-deb: $*"; }
fail() { say "$*" >&2; exit 1; }
skip() { say "skipped: $*"; exit 0; }

if command -v lintian >/dev/null; then
    lintian --allow-root --fail-on error "$folder"/*.deb | grep '^E' && fail "lintian found errors"
    say "lintian: no errors, $(lintian --allow-root "$folder"/*.deb | grep -c '^W' || :) warnings"
else say "lintian is not there (apt-get install lintian): left out"; fi

[ "$(id -u)" = 0 ] || skip "expected root for a clean root, found user $(id -un)"
command -v debootstrap >/dev/null || skip "debootstrap is not there (apt-get install debootstrap)"
command -v unshare >/dev/null || skip "unshare is not there (package util-linux)"
suite=$(. /etc/os-release && echo "${VERSION_CODENAME-}")
mirror=${DEB_MIRROR:-$(apt-get indextargets --format '$(SITE)' "Codename: $suite" 2>/dev/null | head -n 1)}
[ -n "$suite" ] && [ -n "$mirror" ] || skip "expected a release and a mirror of it in apt's sources, found '$suite' '$mirror' (DEB_MIRROR=URL names one)"
unshare -m true 2>/dev/null || skip "no mounts of one's own are allowed here"

if [ ! -f "$folder/base.tar" ]; then
    say "a clean $suite (once)"
    rm -rf "$folder/base"
    debootstrap --variant=minbase "$suite" "$folder/base" "$mirror" >"$folder/base.log" 2>&1 || { tail -n 5 "$folder/base.log" >&2; fail "debootstrap failed"; }
    tar -C "$folder/base" -cf "$folder/base.tar.part" . && mv "$folder/base.tar.part" "$folder/base.tar"
    rm -rf "$folder/base"
fi
root=$(mktemp -d "$folder/root.XXXXXX")
trap 'rm -rf "$root"' EXIT
tar -C "$root" -xf "$folder/base.tar"
mkdir "$root/packages"
cp "$folder"/*.deb "$root/packages/"
[ ! -f /etc/resolv.conf ] || cp -L /etc/resolv.conf "$root/etc/resolv.conf"
cp /etc/hosts "$root/etc/hosts"

inside() { # inside USER COMMAND: /proc and /dev are mounted for this command alone
    unshare -m sh -euc '
        mount -t proc proc "$1/proc" 2>/dev/null || mount --rbind /proc "$1/proc"
        mount --rbind /dev "$1/dev"
        exec chroot --userspec="$2" "$1" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/home/someone LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
            ${http_proxy:+http_proxy="$http_proxy"} sh -euc "$3"' sh "$root" "$1" "$2"
}
quiet() { "$@" >"$folder/apt.log" 2>&1 || { tail -n 15 "$folder/apt.log" >&2; fail "failed: $*"; }; }
# what there is but for what apt and dpkg write for themselves
files() { (cd "$root" && find . -xdev \( -path ./packages -o -path ./proc -o -path ./dev -o -path ./tmp -o -path ./var/log -o -path ./var/cache/apt -o -path ./var/cache/ldconfig \
    -o -path ./var/lib/apt -o -path './var/lib/dpkg/*-old' \) -prune -o -print | LC_ALL=C sort); }

mkdir -p "$root/home/someone" && chown nobody:nogroup "$root/home/someone"
quiet inside root:root 'apt-get update'
needs=$(inside root:root 'apt-get install -s --no-install-recommends /packages/*.deb make bash' | awk '/^Inst/ {print $2}')
quiet inside root:root "apt-get install -y --no-install-recommends $(echo "$needs" | grep -Ev '^(ilf-tools|libilf.*|python3-ilf)$' | tr '\n' ' ')"
files >"$folder/before"
quiet inside root:root 'apt-get install -y --no-install-recommends /packages/*.deb'
say "installed with $(echo "$needs" | wc -l) packages: $(du -sm "$root" | cut -f1) MB in all"

cp tests/setup/deb_user.sh "$root/home/someone/deb_user.sh"
inside nobody:nogroup 'cd && sh -eu deb_user.sh' || fail "the user's work failed"
# the same scene by the build's own programs
(cd "$root/home/someone/mine" && eval "$(make -s -C "$here" env)" && rpict -w -vp 0 -.3 .1 -vd 0 1 -.2 -x 64 -y 64 -ab 1 scene.oct | pvalue -h -H -d -b | total -m) >"$folder/mean"
cmp -s "$folder/mean" "$root/home/someone/mine/mean" ||
    awk 'NR == FNR {a = $1; next} {d = a / $1 - 1; if (d * d > 1e-4) exit 1}' "$folder/mean" "$root/home/someone/mine/mean" ||
    fail "expected the build's picture, mean $(cat "$folder/mean"), found $(cat "$root/home/someone/mine/mean")"
say "captured, packed, looked at, rendered: mean $(cat "$root/home/someone/mine/mean"), by the build's programs $(cat "$folder/mean")"
rm -rf "$root/home/someone/"*
inside root:root 'python3 -c "import ilf"' # may write beside the package

quiet inside root:root 'dpkg --purge ilf-tools python3-ilf libilf-dev $(cd /packages && ls libilf[0-9]*.deb | cut -d_ -f1)'
files >"$folder/after"
diff "$folder/before" "$folder/after" || fail "expected the files of before after purging, found those"
say "purged: no file more or less than before ($(wc -l <"$folder/after") files)"
