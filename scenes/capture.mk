# From a capture session to its light field:
#
#   make -C scenes CAPTURE=SESSION.conf [-j N] [QUIET=--quiet] [ANEW=1|changed] [ON=slurm]   in the source tree
#   make -f PREFIX/share/ilf/chain/capture.mk CAPTURE=SESSION.conf ...                       as installed
#
#   SESSION.conf ──stagectl capture──► PLACE/*.png, times.txt ──hdrgen──► PLACE/fisheye.exr ──fishremap──► PLACE/probe.exr
#       ──ilfpack──► room.ilf.exr [──ilflamps──► room.lamps.ilf.exr]
#
# The same rules serve a virtual and a real stage, `make demo` and `make figures`: port, camera command and the options of each
# step stand in the session file ([chain]; `stagectl keys` explains them), whose own folder is the working folder of every command.
# Everything can be stopped at any point and goes on from there; a second run runs [chain] before, and nothing else where that made
# the same room again.  A room that has changed since the capture began is refused: ANEW=1 takes all exposures again,
# ANEW=changed does where they are of another room or plan, another [output] folder keeps the old ones.  The chain's options are
# checked before the first exposure.  What a program makes is made anew when the program's bytes have changed (rules.mk), pictures
# of a virtual camera too where its session counts FOLDER/camera.programs among [camera] depends; those of a real one never.
# Names must be free of blanks.
#
# Where [grid] positions says that only some nodes are visited, ilfpack --positions makes the regular field of them:
#
#   FOLDER/PLACE/probe.exr ──ilfpack --positions──► room.ilf.exr [and, lamps taken out, room.lamps.ilf.exr], FOLDER/positions.json
#
# positions = adaptive: between two rounds of the capture stagectl asks for the goal `next`, which makes these of what is there, and
# by the report puts the next places on FOLDER/positions.txt (adaptive.py).

SHELL       := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
MAKEFLAGS   += --no-builtin-rules
.PRECIOUS: %/fisheye.exr %/probe.exr
.DELETE_ON_ERROR:
.DEFAULT_GOAL := light_field

CHAIN   := $(abspath $(dir $(lastword $(MAKEFILE_LIST))))
ROOT    := $(abspath $(CHAIN)/..)
# the source tree's programs, or those of the installation that this file belongs to: there under their own names
INSTALLED := $(wildcard $(CHAIN)/../../../lib/ilf/bin)
BUILD   ?= $(ROOT)/build
BIN     := $(abspath $(or $(INSTALLED),$(BUILD)/bin))
DIGESTED := stagectl hdrgen fishremap ilfpack ilflamps virtualcamera rtrace
QUIET   ?=
CAPTURE ?=
SESSION := $(abspath $(firstword $(wildcard $(CAPTURE) $(if $(INSTALLED),,$(ROOT)/$(CAPTURE)))))
ifeq ($(and $(CAPTURE),$(SESSION)),)
$(error expected CAPTURE=SESSION.conf, a session file$(if $(CAPTURE),: $(CAPTURE) is not there))
endif

# function files and meshes that several scenes share stand behind the session's own
export PATH    := $(BIN):$(PATH)
OURS    := $(if $(INSTALLED),$(abspath $(firstword $(wildcard $(INSTALLED)/../lib/ray) $(INSTALLED)/../../ray)),$(abspath $(BUILD))/lib:$(ROOT)/build/lib:$(ROOT)/scenes/studio:$(ROOT)/build/models)
export RAYPATH := .:$(dir $(SESSION)):$(OURS):$(or $(RAYPATH),/usr/local/lib/ray)

get = $(shell $(BIN)/stagectl get $(SESSION) $(1))
TIMES := $(shell $(BIN)/stagectl list $(SESSION))
ifeq ($(TIMES),)
$(error $(SESSION): see above)
endif
HERE    := $(dir $(SESSION))
FOLDER  := $(call get,output.folder)
DIGEST  := $(if $(INSTALLED),$(abspath $(FOLDER))/.digest,$(abspath $(BUILD))/digest)
LIGHT   := $(FOLDER)/$(call get,chain.light_field)
# the same with its lamps taken out, where the session asks for it
ILFLAMPS := $(call get,chain.ilflamps)
LIT     := $(if $(ILFLAMPS),$(LIGHT:.ilf.exr=.lamps.ilf.exr))
LIST    := $(notdir $(firstword $(TIMES)))
PLACES  := $(patsubst %/,%,$(dir $(TIMES)))
MISSING := $(filter-out $(wildcard $(TIMES)),$(TIMES))
NODES   := $(call get,grid.nodes)
PLANE   := $(call get,grid.plane)
COMMAND := $(call get,camera.command)
BESIDE  := $(call get,chain.beside)
BEFORE  := $(call get,chain.before)
PORT    := $(call get,stage.port)

POSITIONS := $(call get,grid.positions)

.PHONY: light_field capture next
# an adaptive capture adds places: what is made of them is a make of its own after it
ifeq ($(POSITIONS)$(ROUND),adaptive)
light_field: $(FOLDER)/.captured
	+@$(MAKE) -s --no-print-directory -f $(CHAIN)/capture.mk CAPTURE=$(SESSION) BUILD=$(abspath $(BUILD)) QUIET=$(QUIET) ON=$(ON) ROUND=1 light_field
else
light_field: $(LIGHT) $(LIT)
endif
capture: $(FOLDER)/.captured
include $(CHAIN)/rules.mk $(CHAIN)/on.mk

# ---- what the camera sees: built anew each time, for who knows what `before` depends on; the digests of the files that its view
# depends on stand in a file that is touched only when they change.
CAMERA_PROGRAMS := $(if $(filter virtualcamera %/virtualcamera,$(COMMAND)),virtualcamera rtrace)
$(FOLDER)/camera.programs: $(call made_by,$(CAMERA_PROGRAMS))
	@mkdir -p $(@D); cat $^ /dev/null > $@
# (a make before the capture shares the jobs of this one)
$(FOLDER)/.seen: $(if $(CAMERA_PROGRAMS),$(FOLDER)/camera.programs) FORCE
	@mkdir -p $(@D)
	$(if $(BEFORE),$(if $(filter make,$(BEFORE)),+)@cd $(HERE) && $(BEFORE))
	@cd $(HERE); stagectl seen $(SESSION) > $@.part; if cmp -s $@.part $@; then rm $@.part; else mv $@.part $@; fi

# ---- capture: one process, resumed as long as a place is missing or the session file or the room has changed ---------
# A program that runs beside it (a virtual stage) is ended with it; its port is waited for.  In a process group of its own
# it is spared the Ctrl-C that tells stagectl to hold the stage.
include $(CHAIN)/twin.mk
# (ROUND: a make that works on what was captured, and captures nothing)
ifeq ($(ROUND),)
$(FOLDER)/.captured: $(SESSION) $(FOLDER)/.seen $(VIEWS_DONE) $(if $(MISSING)$(filter-out changed,$(ANEW)),FORCE)
	@mkdir -p $(@D)
	@cd $(HERE); stagectl plan $(SESSION) >/dev/null
	@cd $(HERE); anew=$(if $(filter-out changed,$(ANEW)),--anew); \
	$(if $(filter changed,$(ANEW)),case $$(stagectl verify $(SESSION) 2>&1 || :) in (*--anew*) anew=--anew;; esac;) \
	$(if $(BESIDE),set -m; { exec >/dev/null 2>&1; exec $(BESIDE); } & beside=$$!; set +m; trap 'kill -- -$$beside 2>/dev/null || :' EXIT; \
	    for k in {1..100}; do [ ! -e "$(PORT)" ] || break; sleep .1; done;) \
	stagectl $(QUIET) $$anew capture $(SESSION)
	@touch $@
# (with an empty recipe make looks at the lists again once they may have been written anew)
$(TIMES): $(FOLDER)/.captured ;
endif

# ---- from the pictures to the light field: each step with its program, its options and the files that these name -----
# corners outside a fisheye's image circle are black by nature: hdrgen counts inside
HDRGEN    := $(call get,chain.hdrgen)
HDRGEN    += $(if $(filter --circle%,$(HDRGEN)),,--circle $(call get,camera.circle))
FISHREMAP := $(call get,chain.fishremap)
ILFPACK   := $(call get,chain.ilfpack)
named      = $(foreach w,$(subst =, ,$(1)),$(wildcard $(if $(filter /%,$(w)),,$(HERE))$(w)))
$(eval $(call settings,$(FOLDER)/.hdrgen,$(HDRGEN)))
$(eval $(call settings,$(FOLDER)/.fishremap,$(FISHREMAP)))
$(eval $(call settings,$(FOLDER)/.ilfpack,$(ILFPACK) $(NODES) $(PLANE)))

# With ON, PER_JOB places are one job, a make on the node, for their steps are short: a merge and a remap are some seconds.  (-o: what was captured
# is no business of its; a place that fails leaves the others made)
PER_JOB ?= 16
ifneq ($(and $(ON),$(filter-out 1,$(PER_JOB)),$(filter grouped-target,$(.FEATURES))),)
define places_of_a_job
$(1:%=%/probe.exr) &: $(1:%=%/$(LIST)) $(FOLDER)/.hdrgen $(FOLDER)/.fishremap $(call named,$(HDRGEN) $(FISHREMAP)) $(call made_by,hdrgen fishremap)
	@$$(call on,places,$(lastword $(1))/probe.exr) $(notdir $(MAKE)) -s -k -j$$$${SLURM_CPUS_PER_TASK:-1} -o $(FOLDER)/.captured -f $(CHAIN)/capture.mk CAPTURE=$(SESSION) \
	    BUILD=$(abspath $(BUILD)) QUIET=$(QUIET) ON= $(1:%=%/probe.exr)
endef
upto_job = $(if $(1),$(eval $(call places_of_a_job,$(wordlist 1,$(PER_JOB),$(1))))$(call upto_job,$(wordlist $(next),$(words $(1)),$(1))))
next    := $(shell echo $$(($(PER_JOB) + 1)))
$(call upto_job,$(PLACES))
else
%/probe.exr: %/fisheye.exr $(FOLDER)/.fishremap $(call named,$(FISHREMAP)) $(call made_by,fishremap)
	@cd $(HERE); $(call on,remap,$@) fishremap $(QUIET) $(FISHREMAP) -o $@ $<
endif
%/fisheye.exr: %/$(LIST) $(FOLDER)/.hdrgen $(call named,$(HDRGEN)) $(call made_by,hdrgen)
	@cd $(HERE); $(call on,merge,$@) hdrgen $(QUIET) $(HDRGEN) --times $< -o $@ $$(awk -v d=$(@D)/ '/^[^#]/ {print d $$1}' $<)
ifneq ($(POSITIONS),all)
# places stand exactly where they should: none is refined.  Lamps are taken out where the session wants ilflamps, by its own octree
LIST_OF_NODES := $(if $(filter adaptive,$(POSITIONS)),$(FOLDER)/positions.txt,$(if $(filter /%,$(POSITIONS)),,$(HERE))$(POSITIONS))
OCTREE    := $(patsubst --geometry=%,%,$(filter --geometry=%,$(subst --geometry ,--geometry=,$(ILFLAMPS))))
FREELY     = ilfpack $(QUIET) $(ILFPACK) $(OCTREE:%=--geometry %) --refine never --grid $(NODES) --plane "$(PLANE)" --positions $(FOLDER)/positions.table \
                 --report $(FOLDER)/positions.json
ADAPT      = python3 $(CHAIN)/adaptive.py --nodes $(NODES)
AT_PLACES := $(PLACES:%=%/probe.exr) $(FOLDER)/positions.table $(FOLDER)/.ilfpack $(call named,$(ILFPACK) $(OCTREE)) $(call made_by,ilfpack)
$(eval $(call settings,$(FOLDER)/.ilflamps,$(ILFLAMPS)))
$(FOLDER)/positions.table: $(LIST_OF_NODES) $(CHAIN)/adaptive.py
	@$(ADAPT) --table --plane "$(PLANE)" $< $(PLACES:%=%/probe.exr) > $@
$(LIGHT): $(AT_PLACES)
	@cd $(HERE); $(call on,lamps,$@) $(FREELY) --lamps keep -o $@
	@$(call builds,$(@:.exr=.programs),$(CAMERA_PROGRAMS) hdrgen fishremap ilfpack)
	@echo "light field: $@"
ifneq ($(LIT),)
$(LIT): $(AT_PLACES) $(FOLDER)/.ilflamps
	@cd $(HERE); $(call on,lamps,$@) $(FREELY) -o $@
	@$(call builds,$(@:.exr=.programs),ilfpack)
	@echo "its lamps taken out: $@"
endif
# after a round: stagectl, which asks for it, waits
next: $(or $(LIT),$(LIGHT))
	@$(ADAPT) --most $(or $(filter-out 0,$(call get,grid.positions_most)),$$(echo $(NODES) | awk -Fx '{print int((5 * $$1 * $$2 + 7) / 8)}')) \
	    --error $(call get,grid.positions_error) $(FOLDER)/positions.json $(FOLDER)/positions.txt
else
$(LIGHT): $(PLACES:%=%/probe.exr) $(FOLDER)/.ilfpack $(call named,$(ILFPACK)) $(call made_by,ilfpack)
	@cd $(HERE); ilfpack $(QUIET) $(ILFPACK) --grid $(NODES) --plane "$(PLANE)" -o $@ $(PLACES:%=%/probe.exr)
	@$(call builds,$(@:.exr=.programs),$(CAMERA_PROGRAMS) hdrgen fishremap ilfpack)
	@echo "light field: $@"
ifneq ($(LIT),)
$(eval $(call settings,$(FOLDER)/.ilflamps,$(ILFLAMPS)))
$(LIT): $(LIGHT) $(FOLDER)/.ilflamps $(call named,$(ILFLAMPS)) $(call made_by,ilflamps)
	@cd $(HERE); $(call on,lamps,$@) ilflamps $(QUIET) $(ILFLAMPS) -o $@ $<
	@$(call builds,$(@:.exr=.programs),ilflamps)
	@echo "its lamps taken out: $@"
endif
endif
