# Rendering measured: error against CPU seconds, peers, the paper's own size (about an hour; BENCH="judged box"
# runs some sections only).  Unpatched Radiance stands beside it for comparison (tests/radiance_patch/stock.mk).

BENCH ?=
bench-render: radiance $(B)/bin/ilflamps $(B)/test/ilfspeed $(B)/test/ilfcopy $(STOCK)/bin/rpict $(VENV)/.ilf
	ILF_BUILD=$(B) $(PY) bench/render/bench.py $(BENCH)

#?measures: bench-render    error against run time of rendering (BENCH="judged lamps cache box smooth plain colordata single mitsuba paper lookup")

# Rays in the rooms that judge ilflamps, for Python.  No -ffast-math: a library linked with it flushes the subnormal numbers of every
# program that loads it.
CASTER := $(B)/test/caster.so
$(CASTER): bench/lamps/caster.c | $(B0)/.debs-tools
	@mkdir -p $(@D)
	@echo "  CC  $< (shared)"
	$(Q)$(CC) -std=c11 $(OPT) $(WARN) -fno-math-errno -fno-trapping-math $(OPENMP) -fPIC -shared -o $@ $< -lm
test: $(CASTER)

# Lamps: version 1 against lamps and residual in rooms of known lamps (half an hour on a quiet core); LAMPS="--odd 7000:100 --grid 6x6
# --texels 128x64" for rooms by chance.  One thread: CPU seconds then say what they mean.
LAMPS ?=
bench-lamps: $(B)/bin/ilflamps $(CASTER) radiance $(VENV)/.ilf
	$(ILF_ENV) OMP_NUM_THREADS=1 ILF_BUILD=$(B) $(PY) bench/lamps/table.py $(LAMPS) $(B)/lamps/table.csv

# Positions chosen by need (scenes/adaptive.py): error against their number in rooms that are known, and, with LIGHT="FILE.csv ...", of
# illuminances measured on a cube's six faces at many places of a room (ten minutes; ROOMS="card twigs/40": at most 40 places).
ROOMS ?= card twigs/40
LIGHT ?=
.PHONY: bench-positions
bench-positions: $(B)/bin/ilfpack $(B)/bin/ilflamps $(B)/bin/ilftrace $(CASTER) radiance $(VENV)/.ilf
	@mkdir -p $(B)/bench/positions
	$(if $(LIGHT),ILF_BUILD=$(B) $(PY) bench/positions/positions.py measured $(B)/bench/positions/measured.png $(B)/bench/positions/measured.csv $(LIGHT))
	$(if $(ROOMS),$(ILF_ENV) ILF_BUILD=$(B) $(PY) bench/positions/positions.py rooms $(B)/bench/positions/rooms.csv $(ROOMS))

# Lookups through the Python package beside a loop in C; FIELD=FILE.ilf.exr names the light field, which is taken as it is if it is there.
FIELD ?= $(DEMO)/room.ilf.exr
bench-python: $(B)/test/ilfspeed $(VENV)/.ilf $(if $(wildcard $(FIELD)),,$(FIELD))
	ILF_BUILD=$(B) $(PY) bench/python/speed.py $(FIELD)

#?measures: bench-python    lookups from Python beside a loop in C (FIELD=FILE.ilf.exr)
#?measures: bench-positions error against the number of positions, chosen by need (ROOMS="card twigs/40" LIGHT="FILE.csv ...")
#?measures: bench-lamps     lamps taken out against version 1, in rooms of known lamps (LAMPS="--odd 7000:100 --grid 6x6 --texels 128x64")

# Blender's Cycles with our lookup in OSL beside our renderer (half an hour; PyPI's bpy, 1 GB unpacked, in a Python of their own).
CYCLES := $(B0)/bench/cycles
.PHONY: bench-cycles test-cycles
$(CYCLES)/venv/.packages: setup/requirements-cycles.txt setup/venv.sh | $(B0)/.debs-radiance
	@mkdir -p $(CYCLES) && sh setup/venv.sh $(CYCLES)/venv $(PYTHON)
	@echo "installing Blender as a Python module"
	@$(CYCLES)/venv/bin/python -m pip install -q --disable-pip-version-check -r setup/requirements-cycles.txt
	@touch $@
bench-cycles: $(CYCLES)/venv/.packages radiance $(B)/bin/ilftrace $(VENV)/.ilf $(if $(wildcard $(FIELD)),,$(FIELD))
	$(ILF_ENV) $(PY) bench/cycles/bench.py $(FIELD) $(CYCLES)/venv/bin/python $(CYCLES)

# in Blender: the shader against ilftrace, the exported dome
test-cycles: $(CYCLES)/venv/.packages $(B)/bin/ilflamps $(B)/bin/ilftrace $(VENV)/.ilf
	ILF_BUILD=$(B) ILF_CYCLES=1 $(PY) -m pytest -q -p no:cacheprovider tests/ilfmat/test_osl.py tests/ilflamps/test_export.py -k "cycles or blender" $(TEST_ARGS)
#?measures: test-cycles     the shader and the exported dome in Blender itself (PyPI's bpy)
#?measures: bench-cycles    Blender's Cycles with ilf.osl beside our renderer (PyPI's bpy, 374 MB; FIELD=FILE.ilf.exr)
