# hdrgen: the comparison with other programs.

#?measures: bench-hdrgen    exposure merging: error and CPU seconds beside OpenCV, and the real series
BENCH_HDRGEN := $(B0)/bench/hdrgen
bench-hdrgen: $(B)/bin/hdrgen $(VENV)/.packages
	@mkdir -p $(BENCH_HDRGEN)
	@[ -e $(BENCH_HDRGEN)/venv/.made ] || { $(PY) -m venv $(BENCH_HDRGEN)/venv && $(BENCH_HDRGEN)/venv/bin/python -m pip install -q \
	    --disable-pip-version-check numpy OpenEXR opencv-python-headless && touch $(BENCH_HDRGEN)/venv/.made; }
	ILF_BUILD=$(B) $(BENCH_HDRGEN)/venv/bin/python bench/hdrgen/bench.py --work $(BENCH_HDRGEN) --shared $(or $(ILF_SHARED),../shared)
