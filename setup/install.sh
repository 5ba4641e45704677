#!/bin/sh
# Install what was built:
# install.sh BUILD BUILD0 DESTDIR PREFIX PROGRAM_PREFIX VERSION ABI OUR-PROGRAM... -- RADIANCE-PROGRAM...
# Radiance's programs keep their names (scenes call them by these): they replace an installation of their own version
# under PREFIX.  With APART=1 in the environment nothing is replaced: all programs and function files lie in PREFIX/lib/ilf, of which
# PREFIX/bin has links to ours alone.  PREFIXED="hdrgen" gives PROGRAM_PREFIX to these only, not to all of ours.
# Every file comes whole under its name, so that a running program keeps its own.
set -eu
umask 022
build=$1 build0=$2 destdir=$3 prefix=$4 mark=$5 version=$6 abi=$7
shift 7
[ -n "$prefix" ] || { echo "install: expected PREFIX=FOLDER, found nothing" >&2; exit 1; }
case $prefix in /*) ;; *) prefix=$(pwd)/$prefix ;; esac
dest=$destdir$prefix
apart=${APART-} prefixed=${PREFIXED-}
bin=$dest/bin ray=$dest/lib/ray doc=$dest/share/doc/ilf man=$dest/share/man
[ -z "$apart" ] || bin=$dest/lib/ilf/bin ray=$dest/lib/ilf/lib/ray
bash=$dest/share/bash-completion/completions zsh=$dest/share/zsh/site-functions
mkdir -p "$dest/bin" "$bin" "$dest/lib/pkgconfig" "$ray" "$dest/include" "$man/man1" "$man/man7" "$doc" "$bash" "$zsh"

put() { # put MODE FROM TO
    cp "$2" "$3.part" && chmod "$1" "$3.part" && mv -f "$3.part" "$3"
}

named() { # named PROGRAM: what it is called in PREFIX/bin
    case " ${prefixed:-$1} " in *" $1 "*) echo "$mark$1" ;; *) echo "$1" ;; esac
}

# programs in Python: their parts, and the package ilf as they use it; what is in bin finds them
parts=$dest/share/ilf/programs
mkdir -p "$parts/ilfstage" "$parts/ilf/include"
for f in tools/ilfstage/*.py; do put 644 "$f" "$parts/ilfstage/$(basename "$f")"; done
for f in python/src/ilf/*.py; do put 644 "$f" "$parts/ilf/$(basename "$f")"; done
for h in ilf ilf_luminaire; do put 644 "ilfmat/$h.h" "$parts/ilf/include/$h.h"; done
ln -sf "../../../../lib/libilf.so.$abi" "$parts/ilf/libilf.so.$abi"

ours=1
for p in "$@"; do
    if [ "$p" = -- ]; then
        ours=
        continue
    fi
    to=$p
    [ -z "$ours" ] || to=$(named "$p")
    from=$build/bin/$p
    [ -f "$from" ] || from=$build0/bin/$p # fetched, not built: not in SAN's folder
    if [ -n "$apart" ]; then
        put 755 "$from" "$bin/$p"
        [ -z "$ours" ] || ln -sf "../lib/ilf/bin/$p" "$dest/bin/$to"
    else put 755 "$from" "$bin/$to"; fi
    [ -n "$ours" ] || continue
    page=$build0/man/man1/$p.1
    [ ! -f "$page" ] || put 644 "$page" "$man/man1/$to.1"
    # what completes a command in the shells is made by the program itself
    "$dest/bin/$to" --completion=bash >"$bash/$to"
    "$dest/bin/$to" --completion=zsh >"$zsh/_$to"
done
for f in "$build0/man/man7/"*.7; do put 644 "$f" "$man/man7/$(basename "$f")"; done
put 644 "$build/lib/libilf.a" "$dest/lib/libilf.a"
put 644 "$build/lib/libilf.so.$abi" "$dest/lib/libilf.so.$abi.$version"
ln -sf "libilf.so.$abi.$version" "$dest/lib/libilf.so.$abi"
ln -sf "libilf.so.$abi" "$dest/lib/libilf.so"
for h in ilf ilf_luminaire; do put 644 "ilfmat/$h.h" "$dest/include/$h.h"; done
# function files, the font, data: all that build/lib holds but the libraries
(cd "$build0/lib" && find . -type f ! -name '.*' ! -name '*.a' ! -name '*.so*' ! -name '*.part') | while IFS= read -r f; do
    mkdir -p "$(dirname "$ray/$f")"
    put 644 "$build0/lib/$f" "$ray/$f"
done
# the chain from a session to its light field, a session to begin with, and our programs under the names that both use
mkdir -p "$dest/share/ilf/chain" "$dest/share/ilf/example" "$dest/lib/ilf/bin"
for f in capture.mk panoramas.mk hdri.mk picture.mk rules.mk twin.mk view.sh digest.sh on.mk slurm.sh rows.mk rows.py timed.py builds.py adaptive.py; do put 644 "scenes/$f" "$dest/share/ilf/chain/$f"; done
put 644 scenes/capture/room.rad "$dest/share/ilf/example/room.rad"
sed -e 's,\.\./\.\./build/capture,out,g' -e 's,make -C scenes CAPTURE=.*,make -f PREFIX/share/ilf/chain/capture.mk CAPTURE=session.conf   (in a copy of this folder),' \
    scenes/capture/session.conf >"$build0/session.part"
put 644 "$build0/session.part" "$dest/share/ilf/example/session.conf"
rm -f "$build0/session.part"
for p in "$@"; do
    [ -z "$apart" ] || break
    if [ "$p" = -- ]; then mark=; else ln -sf "../../../bin/$(named "$p")" "$dest/lib/ilf/bin/$p"; fi
done
# the Python package, to be installed by pip, which finds libilf beside it
(cd python && find . -type f ! -path '*/__pycache__/*') | while IFS= read -r f; do
    mkdir -p "$(dirname "$dest/share/ilf/python/$f")"
    put 644 "python/$f" "$dest/share/ilf/python/$f"
done
# the lookup as a shader of OSL, and who makes a material of it in Blender
for f in ilf.osl ilf_blender.py; do put 644 "ilfmat/osl/$f" "$dest/share/ilf/$f"; done
put 644 LICENSE "$doc/LICENSE"
[ ! -f "$build/radiance/src/License.txt" ] || put 644 "$build/radiance/src/License.txt" "$doc/Radiance-License.txt"
for f in "$build0"/doc/*; do [ ! -f "$f" ] || put 644 "$f" "$doc/$(basename "$f")"; done
cat >"$dest/lib/pkgconfig/ilf.pc" <<EOF
prefix=$prefix
includedir=\${prefix}/include
libdir=\${prefix}/lib

Name: ilf
Description: incident light fields: open, evaluate, sample, write
Version: $version
Requires.private: OpenEXR
Libs: -L"\${libdir}" -lilf
Libs.private: -lOpenEXRCore -lOpenEXR -lpthread -lm
Cflags: -I"\${includedir}"
EOF
chmod 644 "$dest/lib/pkgconfig/ilf.pc"
echo "installed under $dest; a shell needs:"
[ -z "$apart" ] || prefix=$prefix/lib/ilf
echo "  export PATH=\"$prefix/bin:\$PATH\" RAYPATH=\".:$prefix/lib/ray:\${RAYPATH-}\""
