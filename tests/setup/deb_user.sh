# An ordinary user's work with the installed packages, in a clean root (setup/test-deb.sh); in this user's home.
# Nobody's names are taken: what clashes is found only by who asks for it.
for p in rpict rtrace oconv hdrgen; do ! command -v "$p" || { echo "expected no $p in PATH"; exit 1; }; done
ilf-hdrgen --version
ilfinfo --version
[ "$(bash -c 'source /usr/share/bash-completion/completions/ilf-hdrgen; complete -p ilf-hdrgen')" = "complete -F _ilf_complete_hdrgen ilf-hdrgen" ]
[ -s /usr/share/man/man1/ilf-hdrgen.1.gz ] && [ -s /usr/share/man/man7/ilf.7.gz ]
grep -q 'Radiance Software License, Version 2.0' /usr/share/doc/ilf-tools/copyright
grep -q 'Radiance Software License, Version 2.0' /usr/lib/ilf/Radiance-License.txt
grep -q 'This product includes Radiance software' /usr/share/doc/ilf-tools/copyright

# the example's session, fewer and smaller: virtual camera, hdrgen, fishremap, ilfpack
cp -r /usr/share/ilf/example mine
cd mine
sed -i -e 's/nodes = 4x3/nodes = 2x2/' -e 's,1/4096 1/256 1/16 1,1/256 1/8,' -e 's/--size 256/--size 96/' session.conf
make -s -f /usr/share/ilf/chain/capture.mk CAPTURE=session.conf QUIET=--quiet
ilfinfo out/room.ilf.exr | grep '2 x 2 probes'
python3 -c 'import ilf; f = ilf.open("out/room.ilf.exr"); assert (f.info.n_u, f.info.n_v) == (2, 2); print("Python:", f, ilf.library_path())'

# a ball in it, by the renderer of the package
cat >scene.rad <<'END'
void ilf room
1 out/room.ilf.exr
0
0
room bubble around
0
0
4 0 0 0 2
void plastic grey
0
0
5 .5 .5 .5 0 0
grey sphere ball
0
0
4 0 0 .05 .04
END
/usr/lib/ilf/bin/oconv scene.rad >plain.oct # by its path, without any settings
. /usr/lib/ilf/env.sh
oconv scene.rad >scene.oct
rpict -w -vp 0 -.3 .1 -vd 0 1 -.2 -x 64 -y 64 -ab 1 scene.oct | pvalue -h -H -d -b | total -m >mean
awk '{exit !($1 > 0)}' mean
