# Pictures of a scene by many processes, on all processors of this machine or, with ON=slurm, on the nodes of a cluster:
#
#   make -C scenes PICTURE=OUT.hdr OCTREE=ROOM.oct VIEW=VIEW.vf OPTIONS="-x 640 -y 480 -ab 2 ..." [ROWS=16] [ON=slurm] -jN   in the source tree
#   make -f PREFIX/share/ilf/chain/picture.mk PICTURE=...                                                                as installed
#
# PICTURE with a % draws the frames of a view path: VIEW has a line VIEW= (or rvu) a frame, % becomes 0001, 0002 ...; each frame has ROWS parts,
# 1 where nothing else is said.  They share one cache of indirect light, from a first look at up to nine of the views.
# OPTIONS are rpict's; the pictures' rays go through the middle of pixels or are jittered (-ps 1; draw larger and use pfilt for smooth edges).
# rows.mk says how parts are made, and what they depend on.  All beside the pictures: X.rows/, X.json (the cost).  Names must be free of blanks.

SHELL       := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
MAKEFLAGS   += --no-builtin-rules
.DELETE_ON_ERROR:
.SECONDARY:
.DEFAULT_GOAL := picture

CHAIN   := $(abspath $(dir $(lastword $(MAKEFILE_LIST))))
ROOT    := $(abspath $(CHAIN)/..)
INSTALLED := $(wildcard $(CHAIN)/../../../lib/ilf/bin)
BUILD   ?= $(ROOT)/build
BIN     := $(abspath $(or $(INSTALLED),$(BUILD)/bin))
DIGESTED := rpict
ROWS_PY := $(or $(if $(INSTALLED),,$(wildcard $(ROOT)/build/venv/bin/python)),python3)
# where the words on make's command line count from
FROM    := $(if $(INSTALLED),$(CURDIR),$(or $(if $(filter $(CHAIN),$(CURDIR)),$(ROOT)),$(CURDIR)))
from     = $(if $(filter /%,$(1)),$(1),$(FROM)/$(1))
needed   = $(if $($(1)),,$(error expected $(1)=..., as picture.mk says))
$(call needed,PICTURE)$(call needed,OCTREE)$(call needed,VIEW)
there    = $(or $(wildcard $(call from,$(1))),$(error $(1): expected a file, found none))
OUT     := $(call from,$(PICTURE))
SCENE   := $(call there,$(OCTREE))
VIEWS   := $(call there,$(VIEW))
DIGEST  := $(if $(INSTALLED),$(dir $(OUT)).digest,$(abspath $(BUILD))/digest)
FILM    := $(findstring %,$(OUT))
ROWS    ?= $(if $(FILM),1,16)
$(if $(filter %.hdr,$(OUT)),,$(error PICTURE=$(PICTURE): expected a name that ends with .hdr))
$(if $(filter -af -o -S -z -r -ro -PP,$(OPTIONS)),$(error OPTIONS: expected none of -af -o -S -z -r -ro -PP: parts have their own))

export PATH    := $(BIN):$(PATH)
export RAYPATH := .:$(dir $(SCENE)):$(if $(INSTALLED),$(abspath $(INSTALLED)/../../ray),$(abspath $(BUILD))/lib:$(ROOT)/build/lib):$(or $(RAYPATH),/usr/local/lib/ray)
include $(CHAIN)/rules.mk $(CHAIN)/on.mk $(CHAIN)/rows.mk

PLACE   := $(patsubst %/,%,$(dir $(OUT)))
BASE    := $(OUT:.hdr=)
PLAIN   := $(subst %,,$(BASE))
.PHONY: picture
$(eval $(call settings,$(PLAIN).settings,$(OPTIONS); $(ROWS) parts))
MADE_BY := $(PLAIN).settings $(TIMED) $(call made_by,rpict)

ifeq ($(FILM),)
picture: $(OUT)
one_OPTIONS := -vf $(VIEWS) $(OPTIONS) -ps 1
one_SAYS    := echo "  render: $(PICTURE) in $(ROWS) parts"
one_RUN      = cd $(PLACE);
$(call in_rows,one,$(OUT),$(BASE).rows,$(SCENE),$(VIEWS) $(MADE_BY))
else
# a line with a view's options a frame; a frame's view is a file of its own, so that a changed line draws that frame anew
LINES   := $(shell grep -c -e ' -v' $(VIEWS))
$(if $(filter-out 0,$(LINES)),,$(error $(VIEW): expected a line with a view's options for each frame, found none))
FRAMES  := $(shell seq -f %04g $(LINES))
frame    = $(subst %,$(1),$(BASE))
view_of  = $(shell grep -e ' -v' $(VIEWS) | sed -n '$(1)s/^[^-]*/VIEW= /p')
$(foreach n,$(FRAMES),$(eval $(call settings,$(call frame,$(n)).vf,$(call view_of,$(shell expr $(n) + 0)))))
# the first look: at most nine views from the first to the last
LOOKS   := $(foreach n,$(shell seq 1 $$((($(LINES) + 8) / 9)) $(LINES)),$(call frame,$(word $(n),$(FRAMES))).vf)
LOOK     = cd $(PLACE); for v in $(LOOKS); do rpict -vf "$$v" $(OPTIONS) -ps 1 $(call small,$(OPTIONS)) -af $(PLAIN).amb.part $(SCENE) || exit; done
$(PLAIN).amb: $(SCENE) $(LOOKS) $(MADE_BY)
	@rm -f $@.part; echo "  render: first look at $(words $(LOOKS)) of $(LINES) views"
	@$(if $(call cached,$(OPTIONS)),$(call on,render,$@.part) $(timed) -o $(PLAIN).look.hdr -- sh -c '$(LOOK)'; mv $@.part $@,: > $@)
picture: $(FRAMES:%=$(BASE:=.hdr))
# $(call frame_rules,NUMBER)
define frame_rules
frame$(1)_OPTIONS := -vf $(call frame,$(1)).vf $(OPTIONS) -ps 1
frame$(1)_SAYS    := echo "  render: frame $(1) of $(LINES)"
frame$(1)_RUN      = cd $(PLACE);
frame$(1)_CACHE   := $(PLAIN).amb
endef
$(foreach n,$(FRAMES),$(eval $(call frame_rules,$(n)))$(call in_rows,frame$(n),$(call frame,$(n)).hdr,$(call frame,$(n)).rows,$(SCENE),$(call frame,$(n)).vf $(MADE_BY)))
endif
