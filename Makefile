# Incident light fields for Radiance: everything is built from here, all output lies under build/.
#
#   make              all programs            make help         what else there is
#   make demo         the main job            make test         the tests
#
# One folder, one rule: tools/X/*.c are X's parts, archived together; a file there that is named
# in PROGRAMS_X holds a main().  Rooms include each other by their names ("base/cli.h"), downwards only.  V=1 shows the compiler's command lines; SAN=1 builds everything of ours with ASan and UBSan in build/san/.

SHELL      := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:
.SECONDARY:
MAKEFLAGS  += --no-builtin-rules
Q          := $(if $(V),,@)

VERSION    := 0.1.0
TOP        := $(CURDIR)
B0         := build
B          := $(B0)$(if $(SAN),/san)
CC         ?= gcc
ifeq ($(origin CC),default)
CC         := gcc
endif
CXX        ?= g++
ifeq ($(origin CXX),default)
CXX        := g++
endif
PYTHON     ?= python3
PREFIX     ?= /usr/local
OPT        ?= -O2 -g
# warnings are errors where we look at them, not on a user's machine with another compiler
WERROR     := $(if $(CI),-Werror)
WARN       := -Wall -Wextra -Wshadow -Wconversion $(WERROR)
OPENMP     := -fopenmp
# clang has OpenMP in a package of its own (libomp-dev), and warns where our enum constants, whole numbers, meet doubles
ifneq ($(findstring clang,$(CC)),)
WARN       += -Wno-enum-float-conversion
OPENMP     := $(shell printf '\043include <omp.h>\nint main(void) { return omp_get_max_threads() < 1; }\n' | $(CC) -fopenmp -x c -o /dev/null - 2>/dev/null && echo -fopenmp)
ifeq ($(OPENMP),)
$(warning $(CC) finds no OpenMP (package libomp-dev): our programs will use one thread)
endif
endif
, := ,
SANFLAGS   := $(if $(SAN),-fsanitize=address$(,)undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer)
override CPPFLAGS += -D_GNU_SOURCE -DILF_VERSION='"$(VERSION)"' -Icommon -Iilfmat -Itools -isystem /usr/include/OpenEXR -isystem /usr/include/Imath
override CFLAGS   += -std=c11 $(OPT) $(WARN) $(SANFLAGS) $(OPENMP) -MMD -MP
override CXXFLAGS += -std=c++17 $(OPT) -Wall -Wextra -Wshadow $(WERROR) $(SANFLAGS) -MMD -MP
override LDFLAGS  += $(SANFLAGS) $(OPENMP) -Wl,--as-needed
LIBS_ILF   := -lOpenEXRCore -lOpenEXR -lpthread -lm
LIBS_IMAGE := -lOpenEXRCore -lOpenEXR -lImath -lIex -lpng -ljpeg -ltiff -lraw_r -lz -lstdc++ -lpthread -lm
LIBS_VISION := -lopencv_video -lopencv_imgproc -lopencv_core

# ---- programs ------------------------------------------------------------------------------------
PROGRAMS_ilfmat    := ilfinfo ilftrace
PROGRAMS_hdrgen    := hdrgen
PROGRAMS_fishremap := fishremap falloffcal
PROGRAMS_stagectl  := stagectl
PROGRAMS_twin      := virtualstage virtualcamera
PROGRAMS_ilflamps  := ilflamps
PROGRAMS_ilfpack   := ilfpack
PROGRAMS_ilfdepth  := ilfdepth
PROGRAMS_ilfview   := ilfview
LIBS_hdrgen        := $(LIBS_VISION) -lexif -llapacke -llapack
LIBS_fishremap     := $(LIBS_VISION) -llapacke -llapack -ljansson
LIBS_stagectl      := -lutil -lexif -lcrypto
LIBS_ilflamps      := -llapacke -llapack
LIBS_ilfpack       := $(LIBS_ilflamps)
LIBS_ilfview       := $(LIBS_ilflamps)
LIBS_twin          := $(LIBS_stagectl)
# the tool whose parts another stands on: the virtual stage speaks the real one's language, free pictures have lamps, the viewer
# guesses walls as ilflamps does
UNDER_twin         := stagectl
UNDER_ilfpack      := ilflamps
UNDER_ilfview      := ilflamps
TOOLS              := hdrgen fishremap stagectl twin ilflamps ilfpack ilfdepth ilfview

# A main that is not written yet is left out, so that a partial checkout builds.
have = $(foreach p,$(PROGRAMS_$(1)),$(if $(wildcard $(2)/$(p).c),$(p)))
ILF_PROGRAMS  := $(call have,ilfmat,ilfmat/programs)
TOOL_PROGRAMS := $(foreach t,$(TOOLS),$(call have,$(t),tools/$(t)))
# in Python: nothing is built but the script that finds it; its packages come with build/venv/.packages (tests, reports), or are the user's own
SCRIPTS       := ilfstage

.PHONY: all radiance tools examples demo test bench install clean help env deps deps-radiance deps-tools deps-test man
all: radiance tools man

# A change of compiler or flags rebuilds what it touches: what each kind of object was made with is kept in a file.
define remembered
FLAGS_$(1) := $$(strip $$(filter-out -Werror,$(2)))
ifneq ($$(file <$(B)/flags/$(1)),$$(FLAGS_$(1)))
.PHONY: $(B)/flags/$(1)
endif
$(B)/flags/$(1):
	@mkdir -p $$(@D) && printf '%s\n' '$$(subst ','\'',$$(FLAGS_$(1)))' >$$@
endef
$(eval $(call remembered,c,$$(CC) $$(CPPFLAGS) $$(CFLAGS)))
$(eval $(call remembered,cxx,$$(CXX) $$(CPPFLAGS) $$(CXXFLAGS)))
$(eval $(call remembered,ld,$$(CC) $$(LDFLAGS)))
# what a program is linked of
PARTS = $(filter %.o %.a,$^)

# ---- what a machine needs --------------------------------------------------------------------------
DEBS_RADIANCE := gcc libc6-dev make patch python3 python3-venv libopenexr-dev
DEBS_TOOLS    := g++ libpng-dev libjpeg-dev libtiff-dev libraw-dev libexif-dev liblapacke-dev libssl-dev libjansson-dev \
	libopencv-core-dev libopencv-imgproc-dev libopencv-video-dev
DEBS_TEST     := gphoto2 openexr pkg-config zsh
deps: deps-radiance deps-tools deps-test
deps-radiance: $(B0)/.debs-radiance
deps-tools: $(B0)/.debs-tools
deps-test: $(B0)/.debs-test
$(B0)/.debs-radiance: setup/debs.sh Makefile
	@sh setup/debs.sh $(DEBS_RADIANCE) && mkdir -p $(@D) && touch $@
$(B0)/.debs-tools: setup/debs.sh Makefile | $(B0)/.debs-radiance
	@sh setup/debs.sh $(DEBS_TOOLS) && mkdir -p $(@D) && touch $@

$(B0)/.debs-test: setup/debs.sh Makefile | $(B0)/.debs-tools
	@sh setup/debs.sh $(DEBS_TEST) && mkdir -p $(@D) && touch $@

# Python lives in a virtual environment of the project's own.
VENV := $(B0)/venv
PY   := $(VENV)/bin/python
$(VENV)/.made: setup/venv.sh | $(B0)/.debs-radiance
	@sh setup/venv.sh $(VENV) $(PYTHON)
	@touch $@
$(VENV)/.packages: setup/requirements.txt $(VENV)/.made
	@echo "installing Python packages for tests and reports"
	@$(PY) -m pip install -q --disable-pip-version-check -r setup/requirements.txt
	@touch $@

# ---- libraries -------------------------------------------------------------------------------------
# C++ only where a library asks for it: thin shims with a C interface
COMMON_SRC := $(wildcard common/base/*.c common/exr/*.c common/image/*.c common/image/*.cpp)
COMMON_OBJ := $(patsubst %,$(B)/obj/%.o,$(basename $(COMMON_SRC)))
VISION_OBJ := $(patsubst %.cpp,$(B)/obj/%.o,$(wildcard common/vision/*.cpp))
# common/exr knows OpenEXR's bytes, for libilf and for the pictures
ILFLIB_SRC := $(wildcard common/exr/*.c ilfmat/file/*.c ilfmat/lookup/*.c ilfmat/sampling/*.c ilfmat/lamps/*.c)
ILFLIB_OBJ := $(ILFLIB_SRC:%.c=$(B)/obj/%.o)
LIBILF     := $(B)/lib/libilf.a
# the shared library's number changes with its interface, not with each version of the programs
ILF_ABI    := 0
LIBILF_SO  := $(B)/lib/libilf.so.$(ILF_ABI)
LIBCOMMON  := $(B)/obj/libcommon.a
LIBVISION  := $(B)/obj/libvision.a

$(B)/obj/%.o: %.c $(B)/flags/c | $(B0)/.debs-tools
	@mkdir -p $(@D)
	@echo "  CC  $<"
	$(Q)$(CC) $(CPPFLAGS) $(CFLAGS) -c -o $@ $<
$(B)/obj/%.o: %.cpp $(B)/flags/cxx | $(B0)/.debs-tools
	@mkdir -p $(@D)
	@echo "  CXX $<"
	$(Q)$(CXX) $(CPPFLAGS) $(CXXFLAGS) -c -o $@ $<
$(B)/obj/common/vision/%.o: override CPPFLAGS += -isystem /usr/include/opencv4
# libilf is all that rendering needs
$(ILFLIB_OBJ): $(B)/obj/%.o: %.c $(B)/flags/c | $(B0)/.debs-radiance
	@mkdir -p $(@D)
	@echo "  CC  $<"
	$(Q)$(CC) $(CPPFLAGS) $(CFLAGS) -c -o $@ $<

$(LIBILF): $(ILFLIB_OBJ)
	@mkdir -p $(@D) && rm -f $@
	@ar rcs $@ $^
# the functions of ilf.h and of what it includes, and nothing else can be seen in the shared one
$(B)/pic/%.o: %.c $(B)/flags/c | $(B0)/.debs-radiance
	@mkdir -p $(@D)
	@echo "  CC  $< (shared)"
	$(Q)$(CC) $(CPPFLAGS) $(CFLAGS) -fPIC -c -o $@ $<
$(B)/pic/exports: ilfmat/ilf.h ilfmat/ilf_luminaire.h
	@mkdir -p $(@D)
	@{ echo "{ global:"; sed -n 's/^[a-z][^(]*[ *]\(ilf_[a-z0-9_]*\)(.*/\1;/p' $^ | grep -v '^static'; echo "local: *; };"; } >$@
$(LIBILF_SO): $(ILFLIB_SRC:%.c=$(B)/pic/%.o) $(B)/pic/exports $(B)/flags/ld
	@mkdir -p $(@D)
	@echo "  LD  $(@F)"
	$(Q)$(CC) $(LDFLAGS) -shared -Wl,-soname,$(@F) -Wl,--version-script,$(B)/pic/exports $(if $(SAN),,-Wl$(,)-z$(,)defs) -o $@ $(PARTS) $(LIBS_ILF)
$(LIBCOMMON): $(COMMON_OBJ)
	@mkdir -p $(@D) && rm -f $@
	@ar rcs $@ $^
# OpenCV behind a C interface, for the programs that look at photographs
$(LIBVISION): $(VISION_OBJ)
	@mkdir -p $(@D) && rm -f $@
	@ar rcs $@ $^

# our own package is used from where it stands (python/): the path that Python is told is relative, so that the tree may be moved.
# It opens the plain build's libilf: a sanitized one can't be loaded into a plain Python.
PYLIB := $(B0)/lib/libilf.so.$(ILF_ABI)
ifneq ($(B),$(B0))
.PHONY: $(PYLIB)
$(PYLIB):
	@$(MAKE) -s SAN= B=$(B0) $@
endif
$(VENV)/.ilf: Makefile | $(VENV)/.packages $(PYLIB)
	@echo ../../../../../python/src >"$$(echo $(VENV)/lib/python3*/site-packages)/ilf.pth"
	@touch $@

# ---- our programs ----------------------------------------------------------------------------------
tools: $(ILF_PROGRAMS:%=$(B)/bin/%) $(TOOL_PROGRAMS:%=$(B)/bin/%) $(SCRIPTS:%=$(B0)/bin/%) $(LIBILF_SO)

# the version is the Makefile's alone
$(SCRIPTS:%=$(B0)/bin/%): $(B0)/bin/%: tools/%/launch.sh Makefile
	@mkdir -p $(@D)
	@echo "  SH  $(@F)"
	$(Q)sed 's/@VERSION@/$(VERSION)/' $< >$@.part && chmod 755 $@.part && mv -f $@.part $@

$(ILF_PROGRAMS:%=$(B)/bin/%): $(B)/bin/%: $(B)/obj/ilfmat/programs/%.o $(LIBCOMMON) $(LIBILF) $(B)/flags/ld
	@mkdir -p $(@D)
	@echo "  LD  $(@F)"
	$(Q)$(CC) $(LDFLAGS) -o $@ $(PARTS) $(LIBS_IMAGE)

# a host of libilf's beside Radiance, of ilf.h and libilf alone
EXAMPLES := $(patsubst ilfmat/examples/%.c,$(B)/examples/%,$(wildcard ilfmat/examples/*.c))
examples: $(EXAMPLES)
$(EXAMPLES): $(B)/examples/%: $(B)/obj/ilfmat/examples/%.o $(LIBILF) $(B)/flags/ld
	@mkdir -p $(@D)
	@echo "  LD  $(@F)"
	$(Q)$(CC) $(LDFLAGS) -o $@ $(PARTS) $(LIBS_ILF)

define tool_rules
$(1)_PARTS := $$(patsubst tools/%,$(B)/obj/tools/%.o,$$(basename $$(filter-out $$(PROGRAMS_$(1):%=tools/$(1)/%.c),$$(wildcard tools/$(1)/*.c))))
$(B)/obj/lib$(1).a: $$($(1)_PARTS)
	@mkdir -p $$(@D) && rm -f $$@
	@ar rcs $$@ $$^
$$(patsubst %,$(B)/bin/%,$(call have,$(1),tools/$(1))): $(B)/bin/%: $(B)/obj/tools/$(1)/%.o $(B)/obj/lib$(1).a $(UNDER_$(1):%=$(B)/obj/lib%.a) $(if $(findstring opencv,$(LIBS_$(1))),$(LIBVISION)) $(LIBCOMMON) $(LIBILF) $(B)/flags/ld
	@mkdir -p $$(@D)
	@echo "  LD  $$(@F)"
	$(Q)$(CC) $(LDFLAGS) -o $$@ $$(PARTS) $$(LIBS_$(1)) $(LIBS_IMAGE)
endef
$(foreach t,$(TOOLS),$(eval $(call tool_rules,$(t))))

# ---- Radiance with the material --------------------------------------------------------------------
include radiance_patch/build.mk

# ---- man pages -------------------------------------------------------------------------------------
MAN_PAGES := $(patsubst man/%.1,$(B0)/man/man1/%.1,$(wildcard man/*.1)) $(patsubst man/%.7,$(B0)/man/man7/%.7,$(wildcard man/*.7))
man: $(MAN_PAGES)
$(B0)/man/man1/% $(B0)/man/man7/%: man/%
	@mkdir -p $(@D) && cp $< $@

# ---- the main job, tests, measurements -------------------------------------------------------------
-include scenes/scenes.mk scenes/composite.mk scenes/figures.mk tools/hdrgen/hdrgen.mk tools/fishremap/fishremap.mk tools/ilfview/ilfview.mk scenes/reproduce.mk
TEST_DRIVERS := $(patsubst tests/c/%.c,$(B)/test/%,$(wildcard tests/c/*.c))
-include tests/slurm/slurm.mk report/report.mk tests/radiance_patch/stock.mk bench/bench.mk tests/fuzz/fuzz.mk tests/stability/stability.mk
-include docs/docs.mk setup/deb.mk

# ---- test drivers ----------------------------------------------------------------------------------
$(B)/test/falloffsim: LIBS_IMAGE += -llapacke -llapack
$(TEST_DRIVERS): $(B)/test/%: $(B)/obj/tests/c/%.o $(LIBCOMMON) $(LIBILF) $(B)/flags/ld
	@mkdir -p $(@D)
	@echo "  LD  $(@F)"
	$(Q)$(CC) $(LDFLAGS) -o $@ $(PARTS) $(LIBS_IMAGE)

# a tool's pure parts: numbers or text in, numbers or text out
define parts_rule
$(B)/test/$(1)parts: $(B)/obj/tests/$(1)/parts.o $(B)/obj/lib$(1).a $(UNDER_$(1):%=$(B)/obj/lib%.a) $(if $(findstring opencv,$(LIBS_$(1))),$(LIBVISION)) $(LIBCOMMON) $(LIBILF) $(B)/flags/ld
	@mkdir -p $$(@D)
	@echo "  LD  $$(@F)"
	$$(Q)$$(CC) $$(LDFLAGS) -o $$@ $$(PARTS) $$(LIBS_$(1)) $$(LIBS_IMAGE)
TEST_DRIVERS += $(B)/test/$(1)parts
endef
$(foreach t,$(patsubst tests/%/parts.c,%,$(wildcard tests/*/parts.c)),$(eval $(call parts_rule,$(t))))

TEST_ARGS ?=
# files of tests side by side: one more than processors, since stagectl's wait for their stages most of the time
TEST_JOBS ?= $(shell n=$$(nproc 2>/dev/null || echo 2); echo $$((n + 1)))
test: $(B0)/.debs-test all $(EXAMPLES) $(TEST_DRIVERS) $(VENV)/.ilf
	ILF_BUILD=$(B) $(PY) -m pytest -q -p no:cacheprovider -n $(TEST_JOBS) --dist loadfile --no-loadscope-reorder tests $(TEST_ARGS)

# the programs that our patches touch, in a build folder beside another Radiance's that lends the rest
.PHONY: test-renderers
test-renderers: stock $(RAD_PATCHED:%=$(B)/bin/%) $(RAD_LIB) $(ILF_PROGRAMS:%=$(B)/bin/%) $(B)/bin/ilfpack $(VENV)/.ilf
	ILF_BUILD=$(B) $(PY) -m pytest -q -p no:cacheprovider -n $(TEST_JOBS) --dist loadfile tests/radiance_patch $(TEST_ARGS)
#?measures: test-renderers  those of the material in Radiance alone (for a second Radiance: B=build/6.1 RADIANCE_SRC=...)

# speed and accuracy beside the peers', as ratios within one run
bench: bench-hdrgen bench-fishremap bench-render
#?measures: bench           all benchmarks (bench-hdrgen, bench-fishremap, bench-render)

# ---- the rest --------------------------------------------------------------------------------------
# Ours in front of what the shell has.  Where it has no RAYPATH, Radiance's programs would look in their default folder,
# so that stays; an empty part at the end of MANPATH stands for the system's pages.
# a build folder within the other takes from that what it lacks
BESIDE := $(filter-out $(B0),$(B))
quoted = "$(subst ",\",$(subst $$,\$$,$(subst `,\`,$(1))))"
env:
	@echo 'export PATH=$(call quoted,$(TOP)/$(B)/bin)$(if $(BESIDE),:$(call quoted,$(TOP)/$(B0)/bin)):"$$PATH" RAYPATH=.$(if $(BESIDE),:$(call quoted,$(TOP)/$(B)/lib)):$(call quoted,$(TOP)/$(B0)/lib):"$${RAYPATH:-/usr/local/lib/ray}" MANPATH=$(call quoted,$(TOP)/$(B0)/man):"$${MANPATH-}"'

clean:
	rm -rf $(B0)

install: all
	@sh setup/install.sh $(B) $(B0) "$(DESTDIR)" "$(PREFIX)" "$(PROGRAM_PREFIX)" "$(VERSION)" "$(ILF_ABI)" $(ILF_PROGRAMS) $(TOOL_PROGRAMS) $(SCRIPTS) -- $(RAD_PROGRAMS) $(RAD_EXTRA) $(RAD_BUILT)

#?main: demo            the main job on real photographs and on a virtual capture
#?main: test            the tests (TEST_ARGS=... goes to pytest)
#?main: install         PREFIX=/usr/local [DESTDIR=] [PROGRAM_PREFIX=] [APART=1: all in PREFIX/lib/ilf, links to ours]
#?build: all             every program, Radiance with the material, man pages (the default)
#?build: radiance        Radiance's programs with the material ilf (needs no OpenCV)
#?build: tools           the toolchain's own programs
#?build: examples        ilfmat/examples: a path tracer over libilf alone
#?build: env             print the line that a shell needs to use what is built
#?build: deps            install the packages that the machine lacks
#?build: clean           remove build/
#?build: NAME            one program: rpict, hdrgen, ilfpack ...
#?
# Each target's line stands beside its rule, after "#?" and the group that it belongs to.
help:
	@echo "make TARGET"
	@for group in "main:" "build: Building" "pictures: Pictures and figures" "measures: Tests and measurements, longer" "words: Documents"; do \
	    echo; [ "$${group#*: }" = "$$group" ] || echo "$${group#*: }"; sed -n "s/^#?$${group%%:*}: /  /p" $(MAKEFILE_LIST); done
	@echo; echo "Variables"; sed -n 's/^#?variable: /  /p' $(MAKEFILE_LIST)
#?variable: V=1             show the compiler's command lines
#?variable: SAN=1           build ours with ASan and UBSan, in build/san
#?variable: CC= CXX= OPT=   another compiler (clang wants libomp-dev), other optimisation; what they touch is built again
#?variable: CI=1            warnings are errors
#?variable: RADIANCE_SRC=   build from Radiance source of your own, 5.4a or 6.1a: a folder or a tar archive
#?variable: B=build/NAME    a build folder beside the other, for a second Radiance say

# short names: make rpict, make hdrgen ...
SHORT := $(RAD_PROGRAMS) $(RAD_ALL) $(ILF_PROGRAMS) $(TOOL_PROGRAMS)
.PHONY: $(SHORT) $(SCRIPTS)
$(SHORT): %: $(B)/bin/%
$(SCRIPTS): %: $(B0)/bin/%

-include $(shell find $(B)/obj $(B)/pic -name '*.d' 2>/dev/null)
