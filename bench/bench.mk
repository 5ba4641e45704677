# Rendering measured: error against CPU seconds, peers, the paper's own size (about an hour; BENCH="judged box"
# runs some sections only).  Unpatched Radiance is built beside it for comparison.

BENCH ?=
STOCK := $(B0)/bench/stock
STOCK_COMMON = $(filter-out abitmap%,$(RAD_COMMON)) getlibpath
bench-render: radiance $(B)/test/ilfspeed $(B)/test/ilfcopy $(STOCK)/bin/rpict $(VENV)/.packages
	ILF_BUILD=$(B) $(PY) bench/render/bench.py $(BENCH)

.PHONY: bench-stock
bench-stock: $(STOCK)/bin/rpict
$(STOCK)/bin/rpict: radiance_patch/unpack.sh $(if $(RADIANCE_SRC),,$(B0)/radiance/sdist.tar.gz)
	@mkdir -p $(STOCK)/bin $(STOCK)/obj
	@sh radiance_patch/unpack.sh "$(if $(RADIANCE_SRC),$(RADIANCE_SRC),$(B0)/radiance/sdist.tar.gz)" $(STOCK)/src unpatched >/dev/null
	@echo "  CC  unpatched rpict"
	@printf 'char VersionID[]="unpatched";\n' >$(STOCK)/obj/Version.c
	$(Q)cd $(STOCK)/obj && $(CC) $(OPT) -w -fcommon -std=gnu99 -DALIGNT=double -I../src/common -I../src/rt -c Version.c \
		$(STOCK_COMMON:%=../src/common/%.c) $(patsubst %,../src/rt/%.c,$(RAD_RT)) $(patsubst %,../src/%.c,$(RAD_MAIN_rpict))
	$(Q)cd $(STOCK)/obj && rm -f rest.a && ar rcs rest.a $(STOCK_COMMON:%=%.o) $(RAD_RT:%=%.o) && \
		$(CC) -o ../bin/rpict $(patsubst %,%.o,$(notdir $(RAD_MAIN_rpict))) Version.o rest.a -lm

#?measures: bench-render    error against run time of rendering (BENCH="judged cache box smooth plain colordata single mitsuba paper lookup")
#?measures: bench-stock     unpatched Radiance's rpict, for comparison
