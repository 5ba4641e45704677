# Unpatched Radiance, for comparison, beside ours: only what the patches change is compiled a second time, all other objects are those of our programs.

STOCK          := $(B)/test/stock
STOCK_PROGRAMS := rpict rtrace rcontrib oconv
# sources that a patch changes, those that know rays, which a patch makes longer, or have tables as long as the list of types, which
# another does, and what libpath.c stands for
STOCK_OWN      := $(sort $(shell sed -n 's,^+++ b/\(.*\)\.c$$,\1,p' $(RAD_SERIES)) $(RAD_RT:%=rt/%) $(filter rt/%,$(foreach p,$(STOCK_PROGRAMS),$(RAD_MAIN_$(p)))) \
	common/otypes ot/initotypes common/getlibpath)
STOCK_CFLAGS    = $(filter-out -I%,$(RAD_CFLAGS)) -I$(STOCK)/src/common -I$(STOCK)/src/rt
# $(call stock,FILES): the objects of Radiance's files, in the unpatched form where the forms differ
stock           = $(foreach f,$(1),$(if $(filter $(f),$(STOCK_OWN)),$(STOCK)/obj,$(RADOBJ))/$(f).o)

# what is compiled twice follows from these
STOCK_LIST     := tests/radiance_patch/stock.mk radiance_patch/$(RAD_VERSION)/series $(RAD_SERIES)

$(STOCK)/src/.unpacked: radiance_patch/unpack.sh $(RAD_ORIGIN) $(if $(RADIANCE_SRC),,$(B0)/radiance/sdist.tar.gz)
	@mkdir -p $(@D)
	@sh radiance_patch/unpack.sh "$(if $(RADIANCE_SRC),$(RADIANCE_SRC),$(B0)/radiance/sdist.tar.gz)" $(@D) /dev/null >/dev/null
	@touch $@
$(STOCK)/obj/%.o: $(B)/flags/radiance | $(STOCK)/src/.unpacked
	@mkdir -p $(@D)
	@echo "  CC  $*.c (unpatched)"
	$(Q)$(CC) $(STOCK_CFLAGS) -c -o $@ $(STOCK)/src/$*.c
$(STOCK)/obj/Version.o: $(B)/flags/radiance
	@mkdir -p $(@D)
	@printf 'char VersionID[]="unpatched";\n' | $(CC) -x c -c -o $@ -

$(STOCK)/libradiance.a: $(call stock,$(RAD_RT:%=rt/%)) $(STOCK)/obj/Version.o $(STOCK_LIST)
	@rm -f $@; ar rcs $@ $(PARTS)
$(STOCK)/librtrad.a: $(call stock,$(RAD_COMMON:%=common/%) common/getlibpath) $(STOCK_LIST)
	@rm -f $@; ar rcs $@ $(PARTS)
define stock_rules
$(STOCK)/bin/$(1): $$(call stock,$$(RAD_MAIN_$(1))) $(if $(filter $(1),$(RAD_RENDERERS)),$(STOCK)/libradiance.a) $(STOCK)/librtrad.a $(STOCK_LIST)
	@mkdir -p $$(@D)
	@echo "  LD  $(1) (unpatched)"
	$(Q)$(CC) -o $$@ $$(PARTS) -lm
endef
$(foreach p,$(STOCK_PROGRAMS),$(eval $(call stock_rules,$(p))))
# its random numbers follow the clock: this stops it
$(STOCK)/clock.so: tests/radiance_patch/clock.c | $(B0)/.debs-radiance
	@mkdir -p $(@D)
	@echo "  CC  $< (shim)"
	$(Q)$(CC) -std=c11 $(OPT) $(WARN) -fPIC -shared -o $@ $<

.PHONY: stock
stock: $(STOCK_PROGRAMS:%=$(STOCK)/bin/%) $(STOCK)/clock.so
test: stock

-include $(shell find $(STOCK)/obj -name '*.d' 2>/dev/null)
#?measures: stock           unpatched rpict, rtrace, rcontrib and oconv in build/test/stock, for comparison
