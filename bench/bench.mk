# Rendering measured: error against CPU seconds, peers, the paper's own size (about an hour; BENCH="judged box"
# runs some sections only).  Unpatched Radiance stands beside it for comparison (tests/radiance_patch/stock.mk).

BENCH ?=
bench-render: radiance $(B)/test/ilfspeed $(B)/test/ilfcopy $(STOCK)/bin/rpict $(VENV)/.packages
	ILF_BUILD=$(B) $(PY) bench/render/bench.py $(BENCH)

#?measures: bench-render    error against run time of rendering (BENCH="judged cache box smooth plain colordata single mitsuba paper lookup")

# Rays in the rooms that judge ilflamps, for Python.  No -ffast-math: a library linked with it flushes the subnormal numbers of every
# program that loads it.
CASTER := $(B)/test/caster.so
$(CASTER): bench/lamps/caster.c | $(B0)/.debs-tools
	@mkdir -p $(@D)
	@echo "  CC  $< (shared)"
	$(Q)$(CC) -std=c11 $(OPT) $(WARN) -fno-math-errno -fno-trapping-math $(OPENMP) -fPIC -shared -o $@ $< -lm
test: $(CASTER)
