#!/bin/sh
# Debian packages of what `make install APART=1` leaves:  deb.sh STAGED VERSION ABI OUT
#
#   ilf-tools     all programs; Radiance's, whose names others have too, in /usr/lib/ilf/bin only; hdrgen as ilf-hdrgen
#   libilf0       libilf, shared (the number is ABI)        libilf-dev   headers, static library, pkg-config
#   python3-ilf   the package ilf for the system's Python
#
# STAGED is a DESTDIR with PREFIX=/usr, and is eaten up: each file goes to one package, and none may be left.  OUT gets the *.deb.  Needs
# dpkg-dev and file, no root.  The same tree gives the same bytes (SOURCE_DATE_EPOCH: the last commit's, else the changelog's).
set -eu
umask 022
staged=$1 version=$2 abi=$3 out=$4
top=$(pwd)
arch=$(dpkg --print-architecture)
multi=$(dpkg-architecture -qDEB_HOST_MULTIARCH)
maintainer=${DEB_MAINTAINER:-Incident light field toolchain <ilf@packages.invalid>}
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || stat -c %Y CHANGELOG.md)}
export SOURCE_DATE_EPOCH
lib=libilf$abi # its name has the number of its interface
work=$(mktemp -d "$out/work.XXXXXX")
trap 'rm -rf "$work"' EXIT

move() { # move PACKAGE FROM TO: paths below their roots
    mkdir -p "$work/$1/$(dirname "$3")"
    mv "$staged/$2" "$work/$1/$3"
}

# ---- who gets what -------------------------------------------------------------------------------------
for f in "libilf.so.$abi" "libilf.so.$abi.$version"; do move "$lib" "usr/lib/$f" "usr/lib/$multi/$f"; done
for f in libilf.so libilf.a; do move libilf-dev "usr/lib/$f" "usr/lib/$multi/$f"; done
sed -i "s,^libdir=.*,libdir=\${prefix}/lib/$multi," "$staged/usr/lib/pkgconfig/ilf.pc"
move libilf-dev usr/lib/pkgconfig/ilf.pc "usr/lib/$multi/pkgconfig/ilf.pc"
move libilf-dev usr/include usr/include
# the package finds libilf by the loader, and the declarations that it calls by in itself
move python3-ilf usr/share/ilf/python/src/ilf usr/lib/python3/dist-packages/ilf
mkdir "$work/python3-ilf/usr/lib/python3/dist-packages/ilf/include"
cp "$work/libilf-dev/usr/include/"*.h "$work/python3-ilf/usr/lib/python3/dist-packages/ilf/include/"
mkdir -p "$work/python3-ilf/usr/share/doc/python3-ilf"
move python3-ilf usr/share/ilf/python/README.md usr/share/doc/python3-ilf/README.md
move python3-ilf usr/share/ilf/python/examples usr/share/doc/python3-ilf/examples
rm -r "$staged/usr/share/ilf/python" # pip's part
rm "$staged/usr/share/ilf/programs/ilf/libilf.so.$abi" # the loader finds it
move ilf-tools usr/bin usr/bin
move ilf-tools usr/lib/ilf usr/lib/ilf
move ilf-tools usr/share/ilf usr/share/ilf
move ilf-tools usr/share/man usr/share/man
move ilf-tools usr/share/bash-completion usr/share/bash-completion
move ilf-tools usr/share/zsh/site-functions usr/share/zsh/vendor-completions # Debian's name for it
doc=$work/ilf-tools/usr/share/doc/ilf-tools
mkdir -p "$doc"
mv "$staged/usr/share/doc/ilf/Radiance-License.txt" "$doc/"
[ ! -f "$staged/usr/share/doc/ilf/pyradiance.txt" ] || mv "$staged/usr/share/doc/ilf/pyradiance.txt" "$doc/"
rm "$staged/usr/share/doc/ilf/LICENSE" # stands in each copyright file
left=$(cd "$staged" && find . ! -type d)
[ -z "$left" ] || { echo "deb: $staged: expected every file in a package, found left over:" $left >&2; exit 1; }

# ---- words -----------------------------------------------------------------------------------------------
# Radiance's licence and notice lie beside its programs, too
ln -s ../../share/doc/ilf-tools/Radiance-License.txt "$work/ilf-tools/usr/lib/ilf/Radiance-License.txt"
cat >"$work/ilf-tools/usr/lib/ilf/env.sh" <<'END'
# For a shell in which rpict, oconv, hdrgen ... shall be those of this package (others' of the same names come after them):
#   . /usr/lib/ilf/env.sh
PATH=/usr/lib/ilf/bin:$PATH
RAYPATH=.:/usr/lib/ilf/lib/ray${RAYPATH:+:$RAYPATH}
export PATH RAYPATH
END
cat >"$doc/README.Debian" <<'END'
Programs of names that others have, too
---------------------------------------

The renderers with the material ilf and their companions (rpict, rtrace, oconv, pfilt ...) have the names of the
programs that they are built from, and hdrgen that of a program by Greg Ward. So as not to stand in anyone's way they lie in
/usr/lib/ilf/bin; of these /usr/bin has hdrgen alone, as ilf-hdrgen. A shell that shall use them wants the line

    . /usr/lib/ilf/env.sh

(PATH, and RAYPATH for function files; the manual's examples are written for such a shell). A make rule or a program may
call /usr/lib/ilf/bin/rpict as it is: it finds its function files by itself.

The chain from a session to a light field: copy /usr/share/ilf/example and run, in the copy,

    make -f /usr/share/ilf/chain/capture.mk CAPTURE=session.conf
END
copyright() { # copyright PACKAGE: what the tree's LICENSE says, and Radiance's own licence beside its programs
    mkdir -p "$work/$1/usr/share/doc/$1"
    {
        printf 'The incident light field toolchain, packaged from its own source tree.\n\n'
        sed -e '/^-----/,$d' LICENSE
        [ "$1" = ilf-tools ] || return 0
        printf 'usr/lib/ilf/bin and usr/lib/ilf/lib:\n'
        sed -n '/^-----/,$p' LICENSE | sed 1d
        echo
        cat "$doc/Radiance-License.txt"
    } >"$work/$1/usr/share/doc/$1/copyright"
}
changelog() { # changelog PACKAGE
    { printf '%s (%s) unstable; urgency=medium\n\n  * Built from the tree; CHANGELOG.md there says what has changed.\n\n' "$1" "$version"
      printf ' -- %s  %s\n' "$maintainer" "$(LC_ALL=C date -u -d "@$SOURCE_DATE_EPOCH" '+%a, %d %b %Y %H:%M:%S +0000')"
    } | gzip -9n >"$work/$1/usr/share/doc/$1/changelog.gz"
}

# ---- as Debian has them: stripped, compressed, with what they need ------------------------------------------
find "$work" -type f \( -path '*/bin/*' -o -name '*.so.*' \) | while IFS= read -r f; do
    case $(file -b "$f") in *ELF*) strip --strip-unneeded --remove-section=.comment --remove-section=.note "$f" ;; esac
done
strip --strip-debug --enable-deterministic-archives "$work/libilf-dev/usr/lib/$multi/libilf.a"
find "$work/ilf-tools/usr/share/man" -type f -exec gzip -9n {} +

libraries() { # libraries PACKAGE: those of its programs, as dpkg-shlibdeps finds them
    mkdir -p "$work/source/debian"
    printf 'Source: ilf\n\nPackage: %s\nArchitecture: any\n' "$1" >"$work/source/debian/control"
    (cd "$work/source" && find "$work/$1" -type f \( -path '*/bin/*' -o -name '*.so.*' \) -exec sh -c 'for f; do case $(file -b "$f") in *ELF*dynamic*) echo "$f" ;; esac; done' sh {} + |
        sed 's/^/-e/' | tr '\n' '\0' | xargs -0 dpkg-shlibdeps -O --warnings=1 2>"$work/shlibdeps.log" | sed 's/^shlibs:Depends=//') ||
        { cat "$work/shlibdeps.log" >&2; exit 1; }
}
pack() { # pack PACKAGE SECTION DEPENDS SHORT LONG [FURTHER FIELD]
    copyright "$1"
    changelog "$1"
    mkdir -p "$work/$1/DEBIAN"
    (cd "$work/$1" && find . -type f ! -path './DEBIAN/*' -printf '%P\0' | sort -z | xargs -0 md5sum) >"$work/$1/DEBIAN/md5sums"
    { printf 'Package: %s\nSource: ilf\nVersion: %s\nArchitecture: %s\nMaintainer: %s\n' "$1" "$version" "$arch" "$maintainer"
      printf 'Installed-Size: %s\nDepends: %s\n' "$(du -sk --apparent-size --exclude=DEBIAN "$work/$1" | cut -f1)" "$3"
      [ -z "${6-}" ] || printf '%s\n' "$6"
      printf 'Section: %s\nPriority: optional\nDescription: %s\n' "$2" "$4"
      printf '%s\n' "$5" | sed -e 's/^$/./' -e 's/^/ /'
    } >"$work/$1/DEBIAN/control"
    find "$work/$1" -exec touch -h -d "@$SOURCE_DATE_EPOCH" {} +
    dpkg-deb --root-owner-group -Zxz --build "$work/$1" "$out/${1}_${version}_$arch.deb" >/dev/null
    echo "  DEB $out/${1}_${version}_$arch.deb"
}

mkdir -p "$work/$lib/DEBIAN"
printf 'libilf %s %s (>= %s)\n' "$abi" "$lib" "$version" >"$work/$lib/DEBIAN/shlibs"
echo 'activate-noawait ldconfig' >"$work/$lib/DEBIAN/triggers"
what='An incident light field records the light that arrives at a plane from
every direction at a grid of positions. Synthetic objects are lit with it as
if they stood in the place where it was captured.'
libs=$(libraries "$lib")
pack "$lib" libs "$libs" "incident light fields: shared library" "$what

This package has the library that opens, evaluates, samples and writes light
fields." "Multi-Arch: same"
pack libilf-dev libdevel "$lib (= $version), libopenexr-dev" "incident light fields: headers and static library" "$what

This package has what programs that use libilf are built with." "Multi-Arch: same"
# Python's own compiled files come and go with the package
mkdir -p "$work/python3-ilf/DEBIAN"
printf '#!/bin/sh\nset -e\n[ "$1" != configure ] || py3compile -p python3-ilf\n' >"$work/python3-ilf/DEBIAN/postinst"
printf '#!/bin/sh\nset -e\npy3clean -p python3-ilf\n' >"$work/python3-ilf/DEBIAN/prerm"
chmod 755 "$work/python3-ilf/DEBIAN/postinst" "$work/python3-ilf/DEBIAN/prerm"
pack python3-ilf python "$lib (>= $version), python3 (>= 3.11), python3-numpy, python3-cffi-backend, python3-cffi" \
    "incident light fields: Python package" "$what

This package has the Python package ilf: light fields as numpy arrays,
lookups by the million."
libs=$(libraries ilf-tools)
pack ilf-tools graphics "$lib (>= $version), $libs" "incident light fields: from photographs to pictures" "$what

This package has the whole way: exposure merging, remapping, packing, a
stage's control, lamps and distances found in light fields, a page to look at
them; and renderers with a material for them, which lie in /usr/lib/ilf/bin
(see README.Debian)." "Recommends: make, python3 (>= 3.11), python3-numpy, python3-scipy, python3-cffi, python3-cffi-backend
Suggests: gphoto2, libilf-dev, python3-ilf, python3-matplotlib"
