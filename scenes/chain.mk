# From a room to its light field: file rules that any scene can use.
#
#   capture session ──capture.mk: stagectl, hdrgen, fishremap, ilfpack──► room.ilf.exr [──ilflamps──► room.lamps.ilf.exr]
#   octree with mirror spheres ──rpict──► camera.py ──hdrgen──► fishremap --array──► room.ilf.exr ──ilflamps──► room.lamps.ilf.exr
#
# A run that was stopped goes on where it was, and -j works.  Programs count by their digests (rules.mk): what a program makes is
# made anew when its bytes have changed.

BIN      := $(B)/bin
DIGEST   := $(B)/digest
DIGESTED := $(RAD_PROGRAMS) $(RAD_EXTRA) $(ILF_PROGRAMS) $(TOOL_PROGRAMS)
include scenes/rules.mk scenes/on.mk

# The environment of every step: our programs first, function files, then what the scenes bring.
ILF_ENV = PATH="$(TOP)/$(B)/bin:$$PATH" RAYPATH=.:$(TOP)/$(B0)/lib
# what Radiance's programs read at their start
FUNCTIONS := $(B0)/lib/.radiance
# what keeps the cost of a command beside its output is TIMED
ROWS_PY    = $(PY)
include scenes/rows.mk

# One probe for the whole scene.  Its node is the middle of a rectangle as large as the plane, so
# that the depth correction knows where it stood.   $(eval $(call single_probe,NAME,PROBE))
define single_probe
$($(1)_OUT)/single.ilf.exr: $(2) $(call made_by,ilfpack)
	@plane=$$$$(echo "$($(1)_PLANE)" | awk -v ij=$($(1)_SINGLE) -v n=$($(1)_NU) -v m=$($(1)_NV) \
	    '{split(ij, k, "_"); a = k[1] / (n - 1) - .5; b = k[2] / (m - 1) - .5; \
	      for (c = 1; c <= 3; c++) printf "%.9g ", $$$$c + a * $$$$(c + 3) + b * $$$$(c + 6); print $$$$4, $$$$5, $$$$6, $$$$7, $$$$8, $$$$9}'); \
	$$(ILF_ENV) ilfpack --quiet --grid 1x1 --plane "$$$$plane" --type half -o $$@ $$<
endef

# ---- a capture session ------------------------------------------------------------------------------------
# $(eval $(call capture,NAME)) takes the exposures of a session, $(eval $(call light_field,NAME)) makes its light field and one of
# a single probe, for the scene NAME, which says before
#
#   NAME_OUT      folder of everything that is made        NAME_SESSION  the session, which says how
#   NAME_STAGE    octree that its camera sees              NAME_NAMES    further files that it names
#   NAME_NU _NV   grid nodes along u and v                 NAME_PLANE    "Ox Oy Oz Ux Uy Uz Vx Vy Vz"
#   NAME_SINGLE   I_J, the node of the single-probe light field
#   NAME_LIT      not empty: the session asks for ilflamps, which makes room.lamps.ilf.exr
#   NAME_DISCARD  not empty: the camera's views are thrown away once the exposures are there
#
# A session that has changed, another room and another program are taken anew.  Make has no other way to a session's values than
# stagectl, so that its rules are a make of their own, which is begun when one of these files is younger than what it has left.
# (make -n shows its steps as well, where stagectl is there to be asked)
taken  = $(if $(shell [ -x $(B)/bin/stagectl -a -e $(1) ] && echo yes),+)@$(a_make) --no-print-directory -C scenes CAPTURE=$(abspath $(1)) BUILD=$(TOP)/$(B) QUIET=--quiet ANEW=changed $(2)
a_make = $(MAKE)

define capture
$($(1)_OUT)/.taken: $($(1)_SESSION) $($(1)_STAGE) $($(1)_NAMES) scenes/view.sh $(call made_by,virtualcamera rtrace $(3)) | $(B)/bin/stagectl $(B)/bin/virtualstage $(FUNCTIONS)
	$$(call taken,$($(1)_SESSION),$(2))
	@$(if $($(1)_DISCARD),rm -rf $($(1)_OUT)/views; )touch $$@
endef
define light_field
$(call capture,$(1),light_field,hdrgen fishremap ilfpack $(if $($(1)_LIT),ilflamps))
$($(1)_OUT)/room.ilf.exr $(if $($(1)_LIT),$($(1)_OUT)/room.lamps.ilf.exr) $($(1)_OUT)/nodes/$($(1)_SINGLE)/probe.exr: $($(1)_OUT)/.taken ;+
$(call single_probe,$(1),$($(1)_OUT)/nodes/$($(1)_SINGLE)/probe.exr)
endef
# the values of a session that is a file of ours   $(call in_session,FILE,KEY)
in_session = $(shell sed -n 's/^$(2) = *//p' $(1))

# The session of a virtual fisheye in the folder of what it makes, as text, for the scene NAME, which says besides
#
#   NAME_TIMES    exposure times, seconds            NAME_CAMERA   options of virtualcamera
#   NAME_LENS     --lens and --fov in words of [camera]: lens and degrees
#   NAME_FALLOFF  falloff file of the lens           NAME_CORRECT  the same as measured, for the remap
#   NAME_LIGHT    ambient options of the renderer    NAME_PROBE    size of a probe, n_theta x n_phi
define session_text
# a virtual fisheye over a plane: made by the rules of the scenes, see scenes/demo/session.conf
[grid]
nodes = $($(1)_NU)x$($(1)_NV)
plane = $($(1)_PLANE)
[stage]
port = port
unit_mm = 1000
origin = -781 -781
feed = 6000
settle = 0.2
[camera]
exposures = $($(1)_TIMES)
lens = $(firstword $($(1)_LENS))
fov = $(lastword $($(1)_LENS))
command = virtualcamera --quiet --octree $(abspath $($(1)_STAGE)) --plane "{plane}" --at {x},{y} --lens {lens} --fov {fov} --seconds {seconds}
  $($(1)_CAMERA) --falloff $(abspath $($(1)_FALLOFF)) --response srgb --cache views/{i}_{j}
  --render-options "$($(1)_LIGHT) -af views/{i}_{j}/room.amb" -o {file}
depends = $(abspath $($(1)_STAGE) $($(1)_FALLOFF)) camera.programs
file_mb = $(if $(BIG),1.5,0.1)
[output]
folder = .
file = nodes/{i}_{j}/e{k}.png
times = nodes/{i}_{j}/times.txt
[chain]
before = make -s -C $(TOP) FIG=$(FIG) SIZE=$(SIZE) $($(1)_STAGE)$(if $($(1)_LIT), $($(1)_OUT)/walls.oct)
beside = virtualstage --with-parent --time-factor 1000 --link port
hdrgen = --response srgb
fishremap = --size $($(1)_PROBE) --polar-max 90 --falloff $(abspath $($(1)_CORRECT))
$(if $($(1)_LIT),ilflamps = --geometry walls.oct --report lamps.json --picture lamps.png)
endef

# ---- an array of mirror spheres ---------------------------------------------------------------------------
#   octree with the spheres ──rpict──► spheres.hdr ──camera.py──► exposures ──hdrgen──► spheres.exr ──fishremap --array──► room.ilf.exr
#       ──ilflamps──► room.lamps.ilf.exr
#
# $(eval $(call array_light_field,NAME)): NAME_OUT _STAGE _NU _NV _PLANE _TIMES _LIGHT _PROBE _SINGLE as above, NAME_PATH: folders of
# its function files, and
#
#   NAME_CAMERA_VIEW  view options of the array's photograph     NAME_PIXELS  its size (square)
#   NAME_RAYS         n: n x n rays a pixel                      NAME_CORNERS the corner spheres, as fishremap has them
#   NAME_ARRAY        further options of fishremap
define array_light_field
$$(eval $$(call settings,$($(1)_OUT)/capture.settings,$($(1)_CAMERA_VIEW) -x $($(1)_PIXELS) $($(1)_RAYS) rays $($(1)_LIGHT)))
$$(eval $$(call settings,$($(1)_OUT)/exposure.settings,$($(1)_TIMES) s))
$$(eval $$(call settings,$($(1)_OUT)/probe.settings,$($(1)_PROBE) $($(1)_PLANE) $$($(1)_CORNERS) $$($(1)_ARRAY)))
$(1)_BIG := $$(shell echo $$$$(($($(1)_PIXELS) * $($(1)_RAYS))))

$($(1)_OUT)/spheres.big.hdr: $($(1)_STAGE) $($(1)_OUT)/capture.settings $(TIMED) $(call made_by,rpict) | $(VENV)/.packages $(FUNCTIONS)
	@echo "  capture: $($(1)_NU) x $($(1)_NV) mirror spheres"
	@$$(ILF_ENV):$$($(1)_PATH) $$(call on,render,$$@) $(PY) scenes/timed.py --log $($(1)_OUT)/spheres.json -o $$@ -- \
	    rpict $($(1)_CAMERA_VIEW) -x $$($(1)_BIG) -y $$($(1)_BIG) -ps 1 -pj 0 $($(1)_LIGHT) $$<
$($(1)_OUT)/spheres.hdr: $($(1)_OUT)/spheres.big.hdr $(call made_by,pfilt)
	@$$(ILF_ENV) pfilt -1 -x /$($(1)_RAYS) -y /$($(1)_RAYS) $$< > $$@.part
	@mv $$@.part $$@
$($(1)_OUT)/spheres/times.txt: $($(1)_OUT)/spheres.hdr $($(1)_OUT)/exposure.settings scenes/camera.py | $(VENV)/.packages
	@rm -rf $$(@D)
	@$(PY) scenes/camera.py $($(1)_TIMES:%=--seconds %) -o $$(@D) $$<
$($(1)_OUT)/spheres.exr: $($(1)_OUT)/spheres/times.txt $(call made_by,hdrgen)
	@$$(ILF_ENV) $$(call on,merge,$$@) hdrgen --quiet --response srgb --times $$< -o $$@ $$(<D)/e*.png
$($(1)_OUT)/room.ilf.exr: $($(1)_OUT)/spheres.exr $($(1)_OUT)/probe.settings $(call made_by,fishremap)
	@echo "  light field: $($(1)_NU) x $($(1)_NV) spheres"
	@$$(ILF_ENV) $$(call on,remap,$$@) fishremap --quiet --array $($(1)_NU)x$($(1)_NV) --corners $($(1)_CORNERS) $($(1)_ARRAY) --size $($(1)_PROBE) --plane "$($(1)_PLANE)" --type half \
	    --compression none --overlay $($(1)_OUT)/overlay.png --report $($(1)_OUT)/spheres.found.json -o $$@ $$<
	@$$(call builds,$$(@:.exr=.programs),rpict pfilt hdrgen fishremap)
$($(1)_OUT)/overlay.png: $($(1)_OUT)/room.ilf.exr ;
$($(1)_OUT)/room.lamps.ilf.exr: $($(1)_OUT)/room.ilf.exr $($(1)_OUT)/walls.oct $(call made_by,ilflamps)
	@$$(ILF_ENV) $$(call on,lamps,$$@) ilflamps --quiet --geometry $($(1)_OUT)/walls.oct --report $($(1)_OUT)/lamps.json --picture $($(1)_OUT)/lamps.png -o $$@ $$<
	@$$(call builds,$$(@:.exr=.programs),ilflamps)
$($(1)_OUT)/single.probe.exr: $($(1)_OUT)/room.ilf.exr scenes/oneprobe.py | $(VENV)/.ilf
	@$(PY) scenes/oneprobe.py --node $($(1)_SINGLE) -o $$@ $$<
$$(eval $$(call single_probe,$(1),$($(1)_OUT)/single.probe.exr))
endef
