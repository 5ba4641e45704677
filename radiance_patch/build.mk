# Radiance from source, with the material ilf.  Included by the top Makefile.
#
# The source is the Python source distribution named here (it carries Radiance 5.4a's core tree
# and licence); it is fetched by name, checked, unpacked and patched under build/.  RADIANCE_SRC=PATH
# takes another one instead, a folder or a tar archive that holds Radiance's src (common/, rt/, ot/ ...); it is copied, not changed.
# The tree's own VERSION says which series of patches it gets, and which lists of sources:  5.4a/ or 6.1/ beside this file.

RAD_SDIST  := craytraverse==0.1.6
RAD_SHA256 := 920a519827da7252d6de1794a27a66c191fe294c37a876eea863dcf23aec73c9
RAD_LIBPKG := pyradiance==1.3.1
RAD        := $(B)/radiance/src
RADOBJ     := $(B)/radiance/obj

# ---- which Radiance: known when its tree lies there ----
RAD_VERSION := 5.4a
# Make brings the tree up to date before it looks at any file in it: what a patch does not change keeps its date, and its object.
ifneq ($(if $(filter-out clean help env,$(or $(MAKECMDGOALS),all)),$(RADIANCE_SRC)$(wildcard $(RAD)/.patched)),)
include $(RAD)/.patched
endif

# RAD_COMMON, RAD_RT: the libraries rtrad and radiance.  RAD_MAIN_X, RAD_LIBS_X: what program X has besides.  RAD_CXX: those in C++.
# RAD_RENDERERS: programs that trace rays; RAD_OTHERS: the rest.  RAD_EXTRA: programs of the library package, which know no object types.
# RAD_MORE...: what radiance-all adds.  RAD_SCRIPTS, RAD_FILES: scripts and function files of a whole tree.
include radiance_patch/$(RAD_VERSION)/sources.mk
RAD_SERIES   := $(shell sed 's,^,radiance_patch/$(RAD_VERSION)/,' radiance_patch/$(RAD_VERSION)/series)
RAD_PROGRAMS := $(RAD_RENDERERS) $(RAD_OTHERS)
# those with windows are built where X11's headers are
RAD_MORE     += $(if $(wildcard /usr/include/X11/Xlib.h),$(RAD_MORE_X11))
RAD_TRACERS  := $(RAD_RENDERERS) $(RAD_MORE_RENDERERS) rvu
RAD_ALL      := $(RAD_MORE_RENDERERS) $(RAD_MORE)
# what our patches touch; what is there of radiance-all
RAD_PATCHED  := $(RAD_RENDERERS) oconv xform lookamb mkpmap
RAD_BUILT     = $(notdir $(wildcard $(patsubst %,$(B)/bin/%,$(RAD_ALL) $(basename $(notdir $(RAD_SCRIPTS))))))

RAD_CFLAGS := $(OPT) -w -fcommon -std=gnu99 -DALIGNT=double -MMD -MP -I$(RAD)/common -I$(RAD)/rt -Iradiance_patch -Iilfmat
RAD_CXXFLAGS := $(OPT) -w -std=c++17 -DALIGNT=double -MMD -MP -I$(RAD)/common -I$(RAD)/rt -Iradiance_patch
$(eval $(call remembered,radiance,$$(CC) $$(RAD_CFLAGS) $$(SANFLAGS)))
$(eval $(call remembered,radiance++,$$(CXX) $$(RAD_CXXFLAGS)))

RAD_LIB := $(if $(RAD_FILES),$(B)/lib/.tree,$(B0)/lib/.radiance) $(B)/lib/helvet.fnt
radiance: $(RAD_PROGRAMS:%=$(B)/bin/%) $(RAD_LIB) $(LIBILF)

#?build: radiance-all    and Radiance's further programs, as far as the tree has them: rad, rpiece, rvu, mkillum, mkpmap ...
.PHONY: radiance-all
radiance-all: radiance $(RAD_ALL:%=$(B)/bin/%) $(if $(RAD_SCRIPTS),$(B)/bin/.scripts)

# ---- source ----
$(B0)/radiance/sdist.tar.gz: | $(VENV)/.made
	@mkdir -p $(@D)
	@sh radiance_patch/fetch.sh $(PY) $(RAD_SDIST) $(RAD_SHA256) $@

# a change of RADIANCE_SRC is a change of the source
RAD_ORIGIN := $(B)/radiance/origin
ifneq ($(shell cat $(RAD_ORIGIN) 2>/dev/null),$(if $(RADIANCE_SRC),$(RADIANCE_SRC),$(RAD_SDIST)))
.PHONY: $(RAD_ORIGIN)
endif
$(RAD_ORIGIN):
	@mkdir -p $(@D)
	@echo '$(if $(RADIANCE_SRC),$(RADIANCE_SRC),$(RAD_SDIST))' > $@

$(RAD)/.patched: $(wildcard radiance_patch/*/series radiance_patch/*/*.patch) radiance_patch/unpack.sh $(RAD_ORIGIN) $(if $(RADIANCE_SRC),,$(B0)/radiance/sdist.tar.gz) | $(B0)/.debs-radiance
	@series=$$(sh radiance_patch/unpack.sh "$(if $(RADIANCE_SRC),$(RADIANCE_SRC),$(B0)/radiance/sdist.tar.gz)" $(RAD)) && echo "RAD_VERSION := $$series" >$@

# ---- objects ----
# what a whole tree of today wants besides
$(B0)/.debs-radiance6: setup/debs.sh radiance_patch/build.mk | $(B0)/.debs-radiance
	@sh setup/debs.sh g++ libtiff-dev && mkdir -p $(@D) && touch $@
$(RADOBJ)/%.o: $(RAD)/%.cpp $(B)/flags/radiance++ | $(RAD)/.patched $(B0)/.debs-radiance6
	@mkdir -p $(@D)
	@echo "  CXX $*.cpp"
	$(Q)$(CXX) $(RAD_CXXFLAGS) -c -o $@ $<
$(RADOBJ)/px/ra_tiff.o: | $(B0)/.debs-radiance6
$(RADOBJ)/%.o: $(B)/flags/radiance | $(RAD)/.patched
	@mkdir -p $(@D)
	@echo "  CC  $*.c"
	$(Q)$(CC) $(RAD_CFLAGS) -c -o $@ $(RAD)/$*.c
$(RADOBJ)/rt/Version.o: Makefile $(B)/flags/radiance | $(RAD)/.patched
	@mkdir -p $(@D)
	@printf 'char VersionID[]="%s, with the ilf material $(VERSION)";\n' "$$(cat $(RAD)/rt/VERSION)" | $(CC) -x c -c -o $@ -
# ours, in Radiance's idiom, with our sanitizers
RAD_OURS := $(patsubst %,$(RADOBJ)/rt/%.o,m_ilf ilfobj ilffile ilfmark ilfamb ilfshiny reflup)
$(RAD_OURS): $(RADOBJ)/rt/%.o: radiance_patch/%.c $(B)/flags/radiance | $(RAD)/.patched
	@mkdir -p $(@D)
	@echo "  CC  $<"
	$(Q)$(CC) $(RAD_CFLAGS) -Wall $(SANFLAGS) -c -o $@ $<

# ours, in place of getlibpath.c: a program without RAYPATH finds the function files of its own installation
$(RADOBJ)/common/libpath.o: radiance_patch/libpath.c $(B)/flags/radiance | $(RAD)/.patched
	@mkdir -p $(@D)
	@echo "  CC  $<"
	$(Q)$(CC) $(RAD_CFLAGS) -D_GNU_SOURCE -c -o $@ $<

$(RADOBJ)/librtrad.a: $(RAD_COMMON:%=$(RADOBJ)/common/%.o) $(RADOBJ)/common/libpath.o
	@rm -f $@; ar rcs $@ $^
$(RADOBJ)/libradiance.a: $(RAD_RT:%=$(RADOBJ)/rt/%.o) $(RAD_OURS) $(RADOBJ)/rt/Version.o
	@rm -f $@; ar rcs $@ $^

# ---- programs ----
define rad_rules
$(B)/bin/$(1): $$(RAD_MAIN_$(1):%=$(RADOBJ)/%.o) $(if $(filter $(1),$(RAD_TRACERS) lookamb),$(RADOBJ)/libradiance.a) $(RADOBJ)/librtrad.a $(if $(filter $(1),$(RAD_TRACERS)),$(LIBILF)) $(B)/flags/ld
	@mkdir -p $$(@D)
	@echo "  LD  $(1)"
	$(Q)$(if $(filter $(1),$(RAD_CXX)),$$(CXX),$$(CC)) $(SANFLAGS) -o $$@ $$(PARTS) $(if $(filter $(1),$(RAD_TRACERS)),$(LIBS_ILF)) $(RAD_LIBS_$(1)) -lm
endef
$(foreach p,$(RAD_PROGRAMS) $(RAD_ALL),$(eval $(call rad_rules,$(p))))

# scripts of a whole tree, by their names without ending
$(B)/bin/.scripts: $(RAD)/.patched
	@mkdir -p $(@D)
	@echo "  scripts"
	@for f in $(RAD_SCRIPTS); do p=$${f##*/}; p=$${p%.*}; cp $(RAD)/$$f $(B)/bin/$$p.part && chmod 755 $(B)/bin/$$p.part && mv $(B)/bin/$$p.part $(B)/bin/$$p; done
	@touch $@

-include $(shell find $(RADOBJ) -name '*.d' 2>/dev/null)

# ---- function files, a font, further programs ----
$(B0)/lib/.radiance: radiance_patch/extras.sh | $(VENV)/.made
	@mkdir -p $(@D)
	@sh radiance_patch/extras.sh $(PY) $(RAD_LIBPKG) $(B0)/lib $(B)/bin $(RAD_EXTRA)
	@touch $@
$(RAD_EXTRA:%=$(B)/bin/%): | $(B0)/lib/.radiance ;
# a whole tree brings its own function files
$(B)/lib/.tree: $(RAD)/.patched
	@mkdir -p $(@D)
	@echo "  function files"
	@cp -f $(RAD_FILES:%=$(RAD)/%) $(@D)/
	@touch $@
# the source distribution has no font file; a Radiance tree has one beside its src folder
RAD_FONT := $(if $(RADIANCE_SRC),$(firstword $(wildcard $(foreach d,$(RADIANCE_SRC) $(RADIANCE_SRC)/..,$(d)/resources/fonts/helvet.fnt $(d)/ray/lib/helvet.fnt))))
$(B)/lib/helvet.fnt: radiance_patch/letters.py $(RAD_ORIGIN) | $(VENV)/.made
	@mkdir -p $(@D)
	@echo "  font $@"
	@$(if $(RAD_FONT),cp $(RAD_FONT) $@.part,$(PY) radiance_patch/letters.py $@.part) && mv $@.part $@
