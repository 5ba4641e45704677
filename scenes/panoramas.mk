# From panoramas taken anywhere to a light field:
#
#   make -C scenes PANORAMAS=FOLDER/positions.txt [-j N] [QUIET=--quiet]                     in the source tree
#   make -f PREFIX/share/ilf/chain/panoramas.mk PANORAMAS=FOLDER/positions.txt ...           as installed
#
#   exposures of each place ──hdrgen──► FIELD/PLACE.merged.exr ──fishremap──► FIELD/PLACE.exr
#       ──ilfpack --positions──► FIELD/room.ilf.exr                                           FIELD: FOLDER/field
#
# positions.txt has a line a place, as ilfpack(1) says: picture x y z heading [pitch roll], # comments.  `picture` counts from FOLDER:
#
#   a folder           the place's exposures are the pictures in it (a list times.txt there has their times; a mask.png is its mask)
#   a pattern          P03_*.jpg: the pictures that it fits
#   a picture          one of radiance (.exr, .hdr) is taken as it is; any other is an exposure
#
# Options of the steps stand in comments of the same file that begin with #: and a program's name, on as many lines as wanted:
#
#   #: fishremap --dual --lens rig.txt --nadir 20
#   #: hdrgen --response camera.txt
#   #: ilfpack --grid 4x4 --plane "0 0 0  1 0 0  0 1 0"
#
# fishremap's default is --from latlong --to latlong --size 1024x512, each as far as nothing else is said.  FOLDER/mask.png, if it is there,
# is a mask for all places that have none of their own.  Where hdrgen's options say nothing of the response, that of the first place
# is found and serves all: their light is then on one scale.  (Where no place has more than one exposure they count as sRGB.)
#
# Everything can be stopped at any point and goes on from there; what a changed option, picture or program makes is made anew, and nothing
# else.  `panoramas` as the goal stops before ilfpack.  Names must be free of blanks.

SHELL       := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
MAKEFLAGS   += --no-builtin-rules
.DELETE_ON_ERROR:
.DEFAULT_GOAL := light_field

CHAIN   := $(abspath $(dir $(lastword $(MAKEFILE_LIST))))
ROOT    := $(abspath $(CHAIN)/..)
# the source tree's programs, or those of the installation that this file belongs to: there under their own names
INSTALLED := $(wildcard $(CHAIN)/../../../lib/ilf/bin)
BUILD   ?= $(ROOT)/build
BIN     := $(abspath $(or $(INSTALLED),$(BUILD)/bin))
DIGESTED := hdrgen fishremap ilfpack
QUIET   ?=
PANORAMAS ?=
POSITIONS := $(abspath $(firstword $(wildcard $(PANORAMAS) $(if $(INSTALLED),,$(ROOT)/$(PANORAMAS)))))
ifeq ($(and $(PANORAMAS),$(POSITIONS)),)
$(error expected PANORAMAS=FOLDER/positions.txt, a list of places$(if $(PANORAMAS),: $(PANORAMAS) is not there))
endif
export PATH := $(BIN):$(PATH)

HERE   := $(patsubst %/,%,$(dir $(POSITIONS)))
FIELD  ?= $(HERE)/field
DIGEST := $(if $(INSTALLED),$(FIELD)/.digest,$(abspath $(BUILD))/digest)
LIGHT  := $(FIELD)/room.ilf.exr
include $(CHAIN)/rules.mk $(CHAIN)/on.mk

# ---- what the list says ------------------------------------------------------------------------------------------
HASH := \#
QUOTE := "
said = $(strip $(shell sed -n 's/^$(HASH): *$(1)\($$\|[ \t]\)//p' $(POSITIONS)))
HDRGEN    := $(call said,hdrgen)
FISHREMAP := $(call said,fishremap)
ILFPACK   := $(call said,ilfpack)
unless     = $(if $(filter $(1) $(1:%=%=%),$(FISHREMAP)),,$(2))
FISHREMAP := $(strip $(call unless,--from --dual --circles,--from latlong) $(call unless,--to,--to latlong) $(call unless,--size -s,--size 1024x512) $(FISHREMAP))
unknown   := $(filter-out hdrgen fishremap ilfpack,$(shell sed -n 's/^$(HASH): *\([^ \t]*\).*/\1/p' $(POSITIONS)))
$(if $(unknown),$(error $(POSITIONS): expected options of hdrgen, fishremap or ilfpack after "$(HASH):", found $(unknown)))

# the first word of each line that is none of comment; "a b" in quotes has blanks
NAMES := $(shell sed -e 's/$(HASH).*//' -e 's/^[ \t]*//' -e '/^$$/d' -e 's/[ \t,;].*//' $(POSITIONS))
$(if $(NAMES),,$(error $(POSITIONS): expected lines "picture x y z heading [pitch roll]", found none))
$(if $(findstring $(QUOTE),$(NAMES)),$(error $(POSITIONS): expected names free of blanks and quotes, found $(NAMES)))

# a place's name among what is made: its own without folders, signs of patterns and ending
id = $(patsubst %_,%,$(patsubst %-,%,$(subst *,,$(subst ?,,$(subst [,,$(subst ],,$(basename $(subst /,_,$(1:%/=%)))))))))
IDS := $(foreach n,$(NAMES),$(call id,$(n)))
$(if $(filter-out $(words $(IDS)),$(words $(sort $(IDS)))),$(error $(POSITIONS): expected each place once, found $(strip $(foreach i,$(sort $(IDS)),$(if $(word 2,$(filter $(i),$(IDS))),$(i))))))

KINDS  := jpg jpeg png tif tiff pgm ppm pnm pfm exr hdr dng cr2 cr3 nef arw raf orf rw2 JPG JPEG PNG TIF TIFF DNG CR2 CR3 NEF ARW RAF ORF RW2
whole   = $(filter $(KINDS:%=\%.%),$(1))
from    = $(if $(filter /%,$(1)),$(1),$(HERE)/$(1))
inside  = $(filter-out %/mask.png,$(call whole,$(wildcard $(call from,$(1))/*)))
pictures = $(sort $(if $(wildcard $(call from,$(1:%/=%))/.),$(call inside,$(1:%/=%)),$(call whole,$(wildcard $(call from,$(1))))))
none   := $(strip $(foreach n,$(NAMES),$(if $(call pictures,$(n)),,$(n))))
$(if $(none),$(error $(POSITIONS): expected a folder of pictures, a pattern or a picture, found nothing for $(none)))

# ---- steps ----------------------------------------------------------------------------------------------------------
.PHONY: light_field panoramas
light_field: $(LIGHT)
panoramas: $(IDS:%=$(FIELD)/%.exr)

$(eval $(call settings,$(FIELD)/.hdrgen,hdrgen $(HDRGEN)))
$(eval $(call settings,$(FIELD)/.fishremap,fishremap $(FISHREMAP)))
$(eval $(call settings,$(FIELD)/.ilfpack,ilfpack $(ILFPACK)))
named = $(foreach w,$(subst =, ,$(1)),$(if $(filter -%,$(w)),,$(wildcard $(if $(filter /%,$(w)),,$(HERE)/)$(w))))

# options are checked before the first picture is read
MERGED_BY   := $(FIELD)/.hdrgen $(call named,$(HDRGEN)) $(call made_by,hdrgen)
REMAPPED_BY := $(FIELD)/.fishremap $(call named,$(FISHREMAP)) $(call made_by,fishremap)
$(FIELD)/.checked: $(MERGED_BY) $(REMAPPED_BY)
	@cd $(HERE); hdrgen --dry-run $(HDRGEN) -o x.exr x.png; fishremap --dry-run $(FISHREMAP) -o x.exr x.exr
	@touch $@

# what is between the steps need not be small: writing it would cost more than the merge
QUICKLY   := $(if $(filter --type --type=% -t,$(HDRGEN)),,--type half) $(if $(filter --compression --compression=%,$(HDRGEN)),,--compression none)

# coded pictures need a response: one for all places, the first's with several exposures
radiant   = $(if $(word 2,$(1)),,$(filter %.exr %.hdr,$(1)))
developed = $(filter %.dng %.cr2 %.cr3 %.nef %.arw %.raf %.orf %.rw2 %.DNG %.CR2 %.CR3 %.NEF %.ARW %.RAF %.ORF %.RW2 %.exr %.hdr %.pfm,$(1))
own_word := $(filter --response --response=% -r,$(HDRGEN))
needy    := $(if $(own_word),,$(foreach n,$(NAMES),$(if $(word 2,$(call pictures,$(n))),$(if $(call developed,$(call pictures,$(n))),,$(n)))))
LEADER   := $(call id,$(firstword $(needy)))
RESPONSE := $(FIELD)/response.txt

# $(call place,NAME,ID,PICTURES,MASK)
define place
ifneq ($$(call radiant,$(3)),)
$(FIELD)/$(2).exr: $(3)
$(FIELD)/$(2).exr: SOURCE := $(3)
else
$(FIELD)/$(2).exr: $(FIELD)/$(2).merged.exr
$(FIELD)/$(2).exr: SOURCE := $(FIELD)/$(2).merged.exr
$(FIELD)/$(2).merged.exr: PICTURES := $(3)
$(FIELD)/$(2).merged.exr: TIMES := $(wildcard $(call from,$(1:%/=%))/times.txt)
$(FIELD)/$(2).merged.exr: TAKES := $(if $(LEADER),$(if $(filter $(2),$(LEADER)),--save-response $(RESPONSE),$(if $(call developed,$(3)),,--response $(RESPONSE))),$(if $(own_word)$(call developed,$(3)),,--response srgb))
$(FIELD)/$(2).merged.exr: $(3) $(wildcard $(call from,$(1:%/=%))/times.txt) $(MERGED_BY) | $(FIELD)/.checked
$(if $(LEADER),$(if $(filter $(2),$(LEADER)),,$(FIELD)/$(2).merged.exr: $(RESPONSE)))
endif
$(FIELD)/$(2).exr: MASK := $(4)
$(FIELD)/$(2).exr: $(4) $(REMAPPED_BY) | $(FIELD)/.checked
endef
mask = $(if $(filter --mask --mask=% -m,$(FISHREMAP)),,$(firstword $(wildcard $(call from,$(1:%/=%))/mask.png $(HERE)/mask.png)))
$(foreach n,$(NAMES),$(eval $(call place,$(n),$(call id,$(n)),$(call pictures,$(n)),$(call mask,$(n)))))
ifneq ($(LEADER),)
$(RESPONSE): $(FIELD)/$(LEADER).merged.exr
	@test -s $@ || { rm -f $<; echo "$@: gone; once more" >&2; exit 1; }
endif

$(IDS:%=$(FIELD)/%.merged.exr): %.merged.exr:
	@cd $(HERE); $(call on,merge,$@) hdrgen $(QUIET) $(QUICKLY) $(HDRGEN) $(TAKES) $(if $(TIMES),--times $(TIMES)) -o $@ $(if $(TIMES),$$(awk -v d=$(dir $(TIMES)) '/^[^#]/ {print d $$1}' $(TIMES)),$(PICTURES))
$(IDS:%=$(FIELD)/%.exr): %.exr:
	@cd $(HERE); $(call on,remap,$@) fishremap $(QUIET) $(FISHREMAP) $(if $(MASK),--mask $(MASK)) -o $@ $(SOURCE)

# the list with the panoramas' names, line by line as it was
$(FIELD)/positions.txt: $(POSITIONS)
	@mkdir -p $(@D)
	@set -- $(IDS); while IFS= read -r line || [ -n "$$line" ]; do \
	    case $$(sed -e 's/#.*//' -e 's/[ \t]//g' <<< "$$line") in \
	    ('') printf '%s\n' "$$line";; \
	    (*) printf '%s\n' "$$line" | sed "s|^[ \t]*[^ \t,;]*|$$1.exr|"; shift;; esac; \
	done < $< > $@
$(LIGHT): $(IDS:%=$(FIELD)/%.exr) $(FIELD)/positions.txt $(FIELD)/.ilfpack $(call named,$(ILFPACK)) $(call made_by,ilfpack)
	@cd $(HERE); $(call on,lamps,$@) ilfpack $(QUIET) $(ILFPACK) --positions $(FIELD)/positions.txt -o $@ $(IDS:%=$(FIELD)/%.exr)
	@$(call builds,$(@:.exr=.programs),hdrgen fishremap ilfpack)
	@echo "light field: $@"
