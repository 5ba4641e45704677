#?measures: bench-fishremap fishremap beside OpenCV, nona (hugin-tools) and ffmpeg, if installed: error, energy, CPU time
FISHREMAP_BENCH := $(B0)/venv-bench-fishremap
$(FISHREMAP_BENCH)/.made: | $(VENV)/.made
	@echo "installing OpenCV's Python module for the comparison"
	@$(PYTHON) -m venv $(FISHREMAP_BENCH) && $(FISHREMAP_BENCH)/bin/pip install -q --disable-pip-version-check numpy OpenEXR opencv-python-headless
	@touch $@
.PHONY: bench-fishremap
bench-fishremap: $(B)/bin/fishremap $(FISHREMAP_BENCH)/.made
	ILF_BUILD=$(B) $(FISHREMAP_BENCH)/bin/python bench/fishremap/bench.py
