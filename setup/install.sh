#!/bin/sh
# Install what was built:
# install.sh BUILD BUILD0 DEST PREFIX PROGRAM_PREFIX VERSION OUR-PROGRAM... -- RADIANCE-PROGRAM...
# Radiance's programs keep their names: they replace an installation of their own version under PREFIX.
set -eu
build=$1 build0=$2 dest=$3 prefix=$4 mark=$5 version=$6
shift 6
mkdir -p "$dest/bin" "$dest/lib/pkgconfig" "$dest/lib/ray" "$dest/include" "$dest/share/man/man1" "$dest/share/man/man7"
ours=1
for p in "$@"; do
    if [ "$p" = -- ]; then
        ours=
        continue
    fi
    to=$p
    [ -z "$ours" ] || to=$mark$p
    cp "$build/bin/$p" "$dest/bin/$to"
    page=$build0/man/man1/$p.1
    [ -z "$ours" ] || [ ! -f "$page" ] || cp "$page" "$dest/share/man/man1/$to.1"
done
cp "$build0/man/man7/"*.7 "$dest/share/man/man7/"
cp "$build/lib/libilf.a" "$dest/lib/"
cp ilfmat/ilf.h "$dest/include/"
for f in "$build0"/lib/*; do
    case $f in *.a) ;; *) [ ! -f "$f" ] || cp "$f" "$dest/lib/ray/" ;; esac
done
cat >"$dest/lib/pkgconfig/ilf.pc" <<EOF
prefix=$prefix
includedir=\${prefix}/include
libdir=\${prefix}/lib

Name: ilf
Description: incident light fields: open, evaluate, sample, write
Version: $version
Requires.private: OpenEXR
Libs: -L\${libdir} -lilf -lOpenEXRCore -lOpenEXR -lpthread -lm
Cflags: -I\${includedir}
EOF
echo "installed under $dest; function files in $prefix/lib/ray (RAYPATH=.:$prefix/lib/ray)"
