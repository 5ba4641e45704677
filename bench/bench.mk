# Rendering measured: error against CPU seconds, peers, the paper's own size (about an hour; BENCH="judged box"
# runs some sections only).  Unpatched Radiance stands beside it for comparison (tests/radiance_patch/stock.mk).

BENCH ?=
bench-render: radiance $(B)/test/ilfspeed $(B)/test/ilfcopy $(STOCK)/bin/rpict $(VENV)/.packages
	ILF_BUILD=$(B) $(PY) bench/render/bench.py $(BENCH)

#?measures: bench-render    error against run time of rendering (BENCH="judged cache box smooth plain colordata single mitsuba paper lookup")
