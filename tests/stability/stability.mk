# Stiff and extreme cases: the table, its long form, and what breaks when the code is broken.

STABILITY = ILF_BUILD=$(B) ILF_STABILITY_TABLE=$(B)/stability.csv $(PY) -m pytest -q -p no:cacheprovider -n $(TEST_JOBS) --dist loadfile \
	tests/stability $$($(PY) tests/stability/elsewhere.py) $(TEST_ARGS)
STABILITY_NEEDS = $(B0)/.debs-test all $(TEST_DRIVERS) $(REPLAYS) $(SHIM) $(VENV)/.ilf

SHIM := $(B)/test/faultshim.so $(B)/test/memoryshim.so
$(SHIM): $(B)/test/%.so: tests/stability/%.c | $(B0)/.debs-tools
	@mkdir -p $(@D)
	@echo "  CC  $< (shim)"
	$(Q)$(CC) -D_GNU_SOURCE -std=c11 $(OPT) $(WARN) -fPIC -shared -o $@ $< -ldl
test: $(SHIM)

.PHONY: stability stability-long mutations
stability: $(STABILITY_NEEDS)
	ILF_STABILITY=table $(STABILITY)
stability-long: $(STABILITY_NEEDS)
	ILF_STABILITY=long $(STABILITY)
mutations: $(STABILITY_NEEDS)
	$(PY) tests/stability/mutate.py $(MUTATIONS)

#?measures: stability       stiff and extreme cases as a table (build/stability.csv); stability-long tries more and other examples
#?measures: mutations       break the code on purpose, one thing at a time: which test notices? (MUTATIONS="name ..." some)
