# From a capture session to its light field:
#
#   make -C scenes CAPTURE=SESSION.conf [-j N] [QUIET=--quiet] [ANEW=1]
#
#   SESSION.conf ──stagectl capture──► PLACE/*.png, times.txt ──hdrgen──► PLACE/fisheye.exr ──fishremap──► PLACE/probe.exr
#       ──ilfpack──► room.ilf.exr
#
# The same rules serve a virtual and a real stage: port, camera command and the options of each step stand in the session
# file ([chain]; `stagectl keys` explains them), whose own folder is the working folder of every command.  Everything
# can be stopped at any point and goes on from there; a second run runs [chain] before, and nothing else where that made the
# same room again.  A room that has changed since the capture began is refused: ANEW=1 takes all exposures again, another
# [output] folder keeps the old ones.  The chain's options are checked before the first exposure.  Names must be free of blanks.

SHELL       := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
MAKEFLAGS   += --no-builtin-rules
.PRECIOUS: %/fisheye.exr %/probe.exr
.DEFAULT_GOAL := light_field

ROOT    := $(abspath $(dir $(lastword $(MAKEFILE_LIST)))/..)
BUILD   ?= $(ROOT)/build
BIN     := $(abspath $(BUILD))/bin
QUIET   ?=
CAPTURE ?=
SESSION := $(abspath $(firstword $(wildcard $(CAPTURE) $(ROOT)/$(CAPTURE))))
ifeq ($(and $(CAPTURE),$(SESSION)),)
$(error expected CAPTURE=SESSION.conf, a session file$(if $(CAPTURE),: $(CAPTURE) is not there))
endif

export PATH    := $(BIN):$(PATH)
export RAYPATH := .:$(dir $(SESSION)):$(abspath $(BUILD))/lib:$(ROOT)/build/lib:$(or $(RAYPATH),/usr/local/lib/ray)

get = $(shell $(BIN)/stagectl get $(SESSION) $(1))
TIMES := $(shell $(BIN)/stagectl list $(SESSION))
ifeq ($(TIMES),)
$(error $(SESSION): see above)
endif
HERE    := $(dir $(SESSION))
FOLDER  := $(call get,output.folder)
LIGHT   := $(FOLDER)/$(call get,chain.light_field)
LIST    := $(notdir $(firstword $(TIMES)))
PLACES  := $(patsubst %/,%,$(dir $(TIMES)))
MISSING := $(filter-out $(wildcard $(TIMES)),$(TIMES))
BESIDE  := $(call get,chain.beside)
BEFORE  := $(call get,chain.before)
PORT    := $(call get,stage.port)

.PHONY: light_field capture FORCE
light_field: $(LIGHT)
capture: $(FOLDER)/.captured

# ---- what the camera sees: built anew each time, for who knows what `before` depends on; the digests of the files that its view
# depends on stand in a file that is touched only when they change.
$(FOLDER)/.seen: FORCE
	@mkdir -p $(@D)
	$(if $(BEFORE),@cd $(HERE) && $(BEFORE))
	@cd $(HERE); stagectl seen $(SESSION) > $@.part; if cmp -s $@.part $@; then rm $@.part; else mv $@.part $@; fi

# ---- capture: one process, resumed as long as a place is missing or the session file or the room has changed ---------
# A program that runs beside it (a virtual stage) is ended with it; its port is waited for.  In a process group of its own
# it is spared the Ctrl-C that tells stagectl to hold the stage.
$(FOLDER)/.captured: $(SESSION) $(FOLDER)/.seen $(if $(MISSING)$(ANEW),FORCE)
	@mkdir -p $(@D)
	@cd $(HERE); stagectl plan $(SESSION) >/dev/null
	@cd $(HERE); \
	$(if $(BESIDE),set -m; { exec >/dev/null 2>&1; exec $(BESIDE); } & beside=$$!; set +m; trap 'kill -- -$$beside 2>/dev/null || :' EXIT; \
	    for k in {1..100}; do [ ! -e "$(PORT)" ] || break; sleep .1; done;) \
	stagectl $(QUIET) $(if $(ANEW),--anew) capture $(SESSION)
	@touch $@
# (with an empty recipe make looks at the lists again once they may have been written anew)
$(TIMES): $(FOLDER)/.captured ;

# ---- what a step is made with: the file changes when its options do --------------------------------------------------
define settings
$(FOLDER)/.$(1): FORCE
	@mkdir -p $$(@D); printf '%s\n' '$(subst ','\'',$(2))' > $$@.part; if cmp -s $$@.part $$@; then rm $$@.part; else mv $$@.part $$@; fi
endef
# corners outside a fisheye's image circle are black by nature: hdrgen counts inside
HDRGEN := $(call get,chain.hdrgen)
HDRGEN += $(if $(filter --circle%,$(HDRGEN)),,--circle $(call get,camera.circle))
$(eval $(call settings,hdrgen,$(HDRGEN)))
$(eval $(call settings,fishremap,$(call get,chain.fishremap)))
$(eval $(call settings,ilfpack,$(call get,chain.ilfpack) $(call get,grid.plane)))

# ---- from the pictures to the light field ---------------------------------------------------------------------------
%/fisheye.exr: %/$(LIST) $(FOLDER)/.hdrgen
	@cd $(HERE); hdrgen $(QUIET) $(HDRGEN) --times $< -o $@ $$(awk -v d=$(@D)/ '/^[^#]/ {print d $$1}' $<)
%/probe.exr: %/fisheye.exr $(FOLDER)/.fishremap
	@cd $(HERE); fishremap $(QUIET) $(call get,chain.fishremap) -o $@ $<
$(LIGHT): $(PLACES:%=%/probe.exr) $(FOLDER)/.ilfpack
	@cd $(HERE); ilfpack $(QUIET) $(call get,chain.ilfpack) --grid $(call get,grid.nodes) --plane "$(call get,grid.plane)" -o $@ \
	    $(PLACES:%=%/probe.exr)
	@echo "light field: $@"
