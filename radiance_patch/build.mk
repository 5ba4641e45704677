# Radiance's core from source, with the material ilf.  Included by the top Makefile.
#
# The source is the Python source distribution named here (it carries Radiance 5.4a's core tree
# and licence); it is fetched by name, checked, unpacked and patched under build/.  RADIANCE_SRC=DIR
# takes the tree DIR instead (the folder that holds common/, rt/, ot/ ...); it is copied, not changed.

RAD_SDIST  := craytraverse==0.1.6
RAD_SHA256 := 920a519827da7252d6de1794a27a66c191fe294c37a876eea863dcf23aec73c9
RAD_LIBPKG := pyradiance==1.3.1
RAD        := $(B0)/radiance/src
RADOBJ     := $(B)/radiance/obj
RAD_CFLAGS := $(OPT) -w -fcommon -std=gnu99 -DALIGNT=double -MMD -MP -I$(RAD)/common -I$(RAD)/rt -Iradiance_patch -Iilfmat
$(eval $(call remembered,radiance,$$(CC) $$(RAD_CFLAGS) $$(SANFLAGS)))

RAD_COMMON := addobjnotify badarg biggerlib bmalloc bmpfile bsdf bsdf_m bsdf_t byteswap caldefn calexpr \
	calfunc calprnt ccolor ccyrgb chanvalue clip color colrops cone cvtcmd depthcodec dircode disk2square \
	ealloc eputs erf error expandarg ezxml face falsecolor fdate fgetline fgetval fgetword fixargv0 \
	fltdepth font fputword free_os fropen fvect gethomedir getpath header hilbert idmap image \
	instance interp2d invmat4 jitteraperture lamps linregr loadbsdf loadvars lookup mat4 mesh modobject \
	multisamp myhostname normcodec objset octree otypes paths plocate portio process quit readfargs \
	readmesh readobj readoct resolu rexpr savestr savqstr sceneio spec_rgb strlcpy tcos timegm tmap16bit \
	tmapcolrs tmapluv tmaptiff tmesh tonemap triangulate unix_process urand urind wordfile words wputs \
	xf zeroes
# pmcontrib2 goes with rcontrib alone; pmapooc is included by another file
RAD_RT := ambcomp ambient ambio aniso ashikhmin data dielectric fprism freeobjmem func glass initotypes \
	m_alias m_brdf m_bsdf m_clip m_direct m_mirror m_mist mx_data mx_func noise3 normal o_cone o_face \
	o_instance o_mesh p_data p_func pmap pmapamb pmapbias pmapcontrib pmapdata pmapdiag pmapio pmapmat \
	pmapopt pmapparm pmaprand pmapray pmapsrc pmaptype pmutil preload raytrace renderopts source sphere \
	srcobstr srcsamp srcsupp t_data t_func text virtuals

RAD_MAIN_rpict     := rt/rpmain rt/rpict rt/srcdraw rt/persist rt/duphead
RAD_MAIN_rtrace    := rt/rtmain rt/rtrace rt/duphead rt/persist rt/raycalls rt/raypcalls rt/rayfifo
RAD_MAIN_rcontrib  := rt/rcmain rt/rcontrib rt/rc2 rt/rc3 rt/pmcontrib2
RAD_MAIN_lookamb   := rt/lookamb rt/ambio
RAD_MAIN_oconv     := ot/bbox ot/initotypes ot/o_cone ot/o_face ot/o_instance ot/oconv ot/sphere ot/writeoct
RAD_MAIN_xform     := gen/xform
RAD_MAIN_gendaylit := gen/gendaylit gen/sun
RAD_MAIN_pfilt     := px/pfilt px/pf2 px/pf3
RAD_MAIN_pcomb     := px/pcomb
RAD_MAIN_pcompos   := px/pcompos
RAD_MAIN_pvalue    := px/pvalue
RAD_MAIN_getinfo   := util/getinfo
RAD_MAIN_vwrays    := util/vwrays
RAD_MAIN_rcalc     := cal/rcalc
RAD_MAIN_cnt       := cal/cnt
RAD_MAIN_total     := cal/total
RAD_RENDERERS      := rpict rtrace rcontrib
RAD_OTHERS         := oconv xform getinfo pfilt pcomb pcompos pvalue vwrays rcalc cnt total gendaylit lookamb
RAD_PROGRAMS       := $(RAD_RENDERERS) $(RAD_OTHERS)
# programs of the library package that our rules may use and that know no object types
RAD_EXTRA := obj2mesh obj2rad genbox gensurf genrev genworm genprism gensky ies2rad replmarks \
	pcond pextrem pflip protate pinterp psign ra_xyze ra_ppm normtiff ev histo icalc rlam rcomb rmtxop

radiance: $(RAD_PROGRAMS:%=$(B)/bin/%) $(B0)/lib/.radiance $(B0)/lib/helvet.fnt $(LIBILF)

# ---- source ----
$(B0)/radiance/sdist.tar.gz: | $(VENV)/.made
	@mkdir -p $(@D)
	@sh radiance_patch/fetch.sh $(PY) $(RAD_SDIST) $(RAD_SHA256) $@

# a change of RADIANCE_SRC is a change of the source
RAD_ORIGIN := $(B0)/radiance/origin
ifneq ($(shell cat $(RAD_ORIGIN) 2>/dev/null),$(if $(RADIANCE_SRC),$(RADIANCE_SRC),$(RAD_SDIST)))
.PHONY: $(RAD_ORIGIN)
endif
$(RAD_ORIGIN):
	@mkdir -p $(@D)
	@echo '$(if $(RADIANCE_SRC),$(RADIANCE_SRC),$(RAD_SDIST))' > $@

RAD_SERIES := $(shell sed 's,^,radiance_patch/,' radiance_patch/series 2>/dev/null)
$(RAD)/.patched: radiance_patch/series $(RAD_SERIES) radiance_patch/unpack.sh $(RAD_ORIGIN) $(if $(RADIANCE_SRC),,$(B0)/radiance/sdist.tar.gz) | $(B0)/.debs-radiance
	@sh radiance_patch/unpack.sh "$(if $(RADIANCE_SRC),$(RADIANCE_SRC),$(B0)/radiance/sdist.tar.gz)" $(RAD)
	@touch $@
# Where the tree lies there already, make brings it up to date before it looks at any file in it (as a makefile, an empty one):
# what a patch does not change keeps its date, and its object.
ifneq ($(if $(filter-out clean help env,$(or $(MAKECMDGOALS),all)),$(wildcard $(RAD)/.patched)),)
include $(RAD)/.patched
endif

# ---- objects ----
$(RADOBJ)/%.o: $(B)/flags/radiance | $(RAD)/.patched
	@mkdir -p $(@D)
	@echo "  CC  $*.c"
	$(Q)$(CC) $(RAD_CFLAGS) -c -o $@ $(RAD)/$*.c
$(RADOBJ)/rt/Version.o: Makefile $(B)/flags/radiance | $(RAD)/.patched
	@mkdir -p $(@D)
	@printf 'char VersionID[]="%s, with the ilf material $(VERSION)";\n' "$$(cat $(RAD)/rt/VERSION)" | $(CC) -x c -c -o $@ -
# ours, in Radiance's idiom, with our sanitizers
RAD_OURS := $(patsubst %,$(RADOBJ)/rt/%.o,m_ilf ilfsrc ilfmark ilfamb ilfglint)
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
$(B)/bin/$(1): $$(RAD_MAIN_$(1):%=$(RADOBJ)/%.o) $(if $(filter $(1),$(RAD_RENDERERS) lookamb),$(RADOBJ)/libradiance.a) $(RADOBJ)/librtrad.a $(if $(filter $(1),$(RAD_RENDERERS)),$(LIBILF)) $(B)/flags/ld
	@mkdir -p $$(@D)
	@echo "  LD  $(1)"
	$(Q)$(CC) $(SANFLAGS) -o $$@ $$(PARTS) $(if $(filter $(1),$(RAD_RENDERERS)),$(LIBS_ILF)) -lm
endef
$(foreach p,$(RAD_PROGRAMS),$(eval $(call rad_rules,$(p))))

-include $(shell find $(RADOBJ) -name '*.d' 2>/dev/null)

# ---- function files, a font, further programs ----
$(B0)/lib/.radiance: radiance_patch/extras.sh | $(VENV)/.made
	@mkdir -p $(@D)
	@sh radiance_patch/extras.sh $(PY) $(RAD_LIBPKG) $(B0)/lib $(B)/bin $(RAD_EXTRA)
	@touch $@
$(RAD_EXTRA:%=$(B)/bin/%): | $(B0)/lib/.radiance ;
# the source distribution has no font file; a Radiance tree has one beside its src folder
RAD_FONT := $(if $(RADIANCE_SRC),$(firstword $(wildcard $(foreach d,$(RADIANCE_SRC) $(RADIANCE_SRC)/..,$(d)/resources/fonts/helvet.fnt $(d)/ray/lib/helvet.fnt))))
$(B0)/lib/helvet.fnt: radiance_patch/letters.py $(RAD_ORIGIN) | $(VENV)/.made
	@mkdir -p $(@D)
	@echo "  font $@"
	@$(if $(RAD_FONT),cp $(RAD_FONT) $@.part,$(PY) radiance_patch/letters.py $@.part) && mv $@.part $@
