# From one panorama (an HDRI) to light that falls off and moves with the place:
#
#   make -C scenes HDRI=room.hdr ROOM="6 5 2.8" AT="3 2.5 1.6" [HEADING=90] [QUIET=--quiet]        in the source tree
#   make -f PREFIX/share/ilf/chain/hdri.mk HDRI=room.hdr ROOM=... AT=...                           as installed
#
#   HDRI ──fishremap──► FIELD/up.exr ──ilfpack──► FIELD/up.probe.ilf.exr ──ilflamps --geometry──► FIELD/up.ilf.exr
#        ──fishremap──► FIELD/down.exr ──ilfpack──► FIELD/down.ilf.exr                   both: materials of FIELD/room.rad
#
#   HDRI      an equirectangular panorama, .hdr or .exr, its top row up
#   ROOM      length, width and height of the room: it stands on z = 0 with a corner at the origin, in the scene's unit;
#             or GEOMETRY=FILE.rad, the room's surfaces with any materials
#   AT        where the panorama was taken, in the same coordinates
#   HEADING   where its middle column looks, degrees from +x towards +y (default 90: along +y)
#   FIELD     the folder of what is made (default: the HDRI's name with .field for its ending)
#   SIZE      texels of the probes (default 512x256; more is sharper in mirrors, and noisier in the same time)
#   ILFLAMPS  further options of ilflamps, say --lamps keep
#
# FIELD/room.rad is part of a scene: the room's surfaces with the light field on them.  A light field sends light from above its plane only, so there are two, of
# the same panorama: one for rays that rise, one for those that fall.  The goal `picture` renders two rows of balls on the floor in that light.
# Names must be free of blanks.

SHELL       := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
MAKEFLAGS   += --no-builtin-rules
.DELETE_ON_ERROR:
.DEFAULT_GOAL := room

CHAIN   := $(abspath $(dir $(lastword $(MAKEFILE_LIST))))
ROOT    := $(abspath $(CHAIN)/..)
INSTALLED := $(wildcard $(CHAIN)/../../../lib/ilf/bin)
BUILD   ?= $(ROOT)/build
BIN     := $(abspath $(or $(INSTALLED),$(BUILD)/bin))
DIGESTED := fishremap ilfpack ilflamps oconv rpict
QUIET   ?=
HDRI    ?=
ROOM    ?=
AT      ?=
HEADING ?= 90
SIZE    ?= 512x256
ILFLAMPS ?=
PICTURE := $(abspath $(firstword $(wildcard $(HDRI) $(if $(INSTALLED),,$(ROOT)/$(HDRI)))))
ifeq ($(and $(HDRI),$(PICTURE)),)
$(error expected HDRI=FILE.hdr, an equirectangular panorama$(if $(HDRI),: $(HDRI) is not there))
endif
SURFACES := $(if $(GEOMETRY),$(abspath $(firstword $(wildcard $(GEOMETRY) $(if $(INSTALLED),,$(ROOT)/$(GEOMETRY))))))
ifeq ($(GEOMETRY),)
ifneq ($(words $(ROOM)),3)
$(error expected ROOM="LENGTH WIDTH HEIGHT" or GEOMETRY=FILE.rad, found ROOM="$(ROOM)")
endif
else ifeq ($(SURFACES),)
$(error expected GEOMETRY=FILE.rad, surfaces of the room: $(GEOMETRY) is not there)
endif
ifneq ($(words $(AT)),3)
$(error expected AT="X Y Z", where the panorama was taken, found AT="$(AT)")
endif
numbers := $(shell awk 'BEGIN { for (i = 1; i < ARGC; i++) if (ARGV[i] !~ /^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?$$/) print ARGV[i] }' $(ROOM) $(AT) $(HEADING))
$(if $(numbers),$(error expected numbers in ROOM, AT and HEADING, found $(numbers)))
outside := $(if $(GEOMETRY),,$(shell set -- $(ROOM) $(AT); awk 'BEGIN { for (k = 1; k < 4; k++) if (ARGV[k+3] <= 0 || ARGV[k+3] >= ARGV[k]) { print "yes"; exit } }' "$$@"))
$(if $(outside),$(error expected AT within the room (0 to $(ROOM)), found AT="$(AT)"))
export PATH := $(BIN):$(PATH)

FIELD  ?= $(basename $(PICTURE)).field
override FIELD := $(abspath $(FIELD))
DIGEST := $(if $(INSTALLED),$(FIELD)/.digest,$(abspath $(BUILD))/digest)
export RAYPATH := .:$(if $(INSTALLED),$(CHAIN)/../../../lib/ray,$(abspath $(BUILD))/lib)
include $(CHAIN)/rules.mk

.PHONY: room picture
room: $(FIELD)/room.rad
	@echo "room: $<"
picture: $(FIELD)/picture.hdr
	@echo "picture: $<"

$(eval $(call settings,$(FIELD)/.remap,$(SIZE) $(HEADING)))
$(eval $(call settings,$(FIELD)/.place,room $(strip $(ROOM)) $(GEOMETRY) at $(AT)))
$(eval $(call settings,$(FIELD)/.ilflamps,ilflamps $(ILFLAMPS)))

# ---- the panorama as a probe of a plane that looks up, and of one that looks down -----------------------------------
$(FIELD)/up.exr: $(PICTURE) $(FIELD)/.remap $(call made_by,fishremap)
	@fishremap $(QUIET) --from latlong --heading $(HEADING) --size $(SIZE) --polar-max 180 -o $@ $<
$(FIELD)/down.exr: $(PICTURE) $(FIELD)/.remap $(call made_by,fishremap)
	@fishremap --quiet --from latlong --heading=$$(awk 'BEGIN { print 0 - ($(HEADING)) }') --rotate 180 --size $(SIZE) --polar-max 180 -o $@ $<
# a plane of one probe, which stands in the middle of a square (as large as the room; to one probe's light its size means nothing)
plane = $$(getinfo -d < $(FIELD)/walls.oct | awk -v x=$(word 1,$(AT)) -v y=$(word 2,$(AT)) -v z=$(word 3,$(AT)) -v s=$(1) '{ print x - $$4/2, y - s*$$4/2, z, $$4, 0, 0, 0, s*$$4, 0 }')
$(FIELD)/up.probe.ilf.exr: $(FIELD)/up.exr $(FIELD)/walls.oct $(FIELD)/.place $(call made_by,ilfpack)
	@ilfpack $(QUIET) --grid 1x1 --plane "$(call plane,1)" -o $@ $<
$(FIELD)/down.ilf.exr: $(FIELD)/down.exr $(FIELD)/walls.oct $(FIELD)/.place $(call made_by,ilfpack)
	@ilfpack $(QUIET) --grid 1x1 --plane "$(call plane,-1)" -o $@ $<

# ---- the room, and the lamps on it -------------------------------------------------------------------------------------
ifeq ($(GEOMETRY),)
$(FIELD)/walls.rad: $(FIELD)/.place
	@genbox room_light room $(ROOM) > $@
else
$(FIELD)/walls.rad: $(SURFACES) $(FIELD)/.place
	@xform -m room_light $< > $@
endif
$(FIELD)/walls.oct: $(FIELD)/walls.rad $(call made_by,oconv)
	@printf 'void plastic room_light 0 0 5 .5 .5 .5 0 0\n' | cat - $< | oconv - > $@
$(FIELD)/up.ilf.exr: $(FIELD)/up.probe.ilf.exr $(FIELD)/walls.oct $(FIELD)/.ilflamps $(call made_by,ilflamps)
	@ilflamps $(QUIET) --geometry $(FIELD)/walls.oct --report $(FIELD)/lamps.json $(ILFLAMPS) -o $@ $<
$(FIELD)/room.rad: $(FIELD)/up.ilf.exr $(FIELD)/down.ilf.exr $(FIELD)/walls.rad
	@printf '{ 1 for rays that rise, 0 for those that fall }\nroom_up = if(Dz, 1, 0);\n' > $(FIELD)/room.cal
	@{ printf 'void ilf room_above 1 $(FIELD)/up.ilf.exr 0 0\nvoid ilf room_below 1 $(FIELD)/down.ilf.exr 0 0\n'; \
	    printf 'void mixfunc room_light 4 room_above room_below room_up $(FIELD)/room.cal 0 0\n'; cat $(FIELD)/walls.rad; } > $@

# ---- to look at it ---------------------------------------------------------------------------------------------------------
$(FIELD)/picture.rad: $(FIELD)/.place
	@set -- $(or $(ROOM),$(AT)); awk -v x="$$1" -v y="$$2" 'BEGIN { \
	    print "void plastic clay 0 0 5 .6 .6 .6 0 0\nvoid metal mirror 0 0 5 .9 .9 .9 1 0"; \
	    s = (x < y ? x : y); \
	    printf "clay polygon ground 0 0 12 %g %g .002 %g %g .002 %g %g .002 %g %g .002\n", .1*x, .1*y, .9*x, .1*y, .9*x, .9*y, .1*x, .9*y; \
	    for (i = 0; i < 4; i++) for (j = 0; j < 2; j++) \
	        printf "%s sphere ball_%d_%d 0 0 4 %g %g %g %g\n", (i + j) % 2 ? "mirror" : "clay", i, j, x*(.2 + .2*i), y*(.35 + .35*j), .05*s + .003, .05*s }' > $@
$(FIELD)/picture.oct: $(FIELD)/room.rad $(FIELD)/picture.rad $(call made_by,oconv)
	@oconv $(FIELD)/room.rad $(FIELD)/picture.rad > $@
$(FIELD)/picture.hdr: $(FIELD)/picture.oct $(call made_by,rpict)
	@set -- $(or $(ROOM),$(AT)); rpict $$(awk -v x="$$1" -v y="$$2" -v z="$$3" 'BEGIN { print "-vtv -vu 0 0 1 -vh 65 -vv 50 -vp", .5*x, .06*y, .62*z, "-vd 0", .5*y, -.5*z }') \
	    -x 480 -y 360 -ab 1 -ad 128 -as 32 -aa .2 -ar 64 -st 0 -di 32 $< > $@
