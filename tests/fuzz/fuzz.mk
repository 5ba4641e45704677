# Fuzzing: each tests/fuzz/fuzz_X.c is a target.  Under clang libFuzzer drives it (make fuzz); under any compiler
# replay.c runs the kept corpus (make test).

FUZZ_NAMES   := $(patsubst tests/fuzz/fuzz_%.c,%,$(wildcard tests/fuzz/fuzz_*.c))
FUZZ_SECONDS ?= 60
FUZZ         ?= $(FUZZ_NAMES)
FUZZ_DIR     := $(B0)/fuzz
CLANG        ?= clang
FUZZ_CPP      = $(CPPFLAGS)
# the tool whose parts a target needs; all have the libraries
FUZZ_LIB_session := stagectl
FUZZ_LIB_journal := stagectl
FUZZ_LIB_grbl    := stagectl
FUZZ_LIB_curve   := twin
FUZZ_LIB_response := hdrgen
FUZZ_LIB_falloff  := fishremap
FUZZ_LIB_lens     := fishremap
FUZZ_LIB_times    := hdrgen

# ---- replay, with the compiler and the flags of everything else -------------------------------------------
REPLAYS := $(FUZZ_NAMES:%=$(B)/test/fuzz_%)
define replay_rule
$(B)/test/fuzz_$(1): $(B)/obj/tests/fuzz/fuzz_$(1).o $(B)/obj/tests/fuzz/replay.o $(FUZZ_LIB_$(1):%=$(B)/obj/lib%.a) $(UNDER_$(FUZZ_LIB_$(1)):%=$(B)/obj/lib%.a) $(LIBVISION) $(LIBCOMMON) $(LIBILF) $(B)/flags/ld
	@mkdir -p $$(@D)
	@echo "  LD  $$(@F)"
	$$(Q)$$(CC) $$(LDFLAGS) -o $$@ $$(PARTS) $$(foreach t,$(FUZZ_LIB_$(1)),$$(LIBS_$$(t))) $$(LIBS_IMAGE)
endef
$(foreach f,$(FUZZ_NAMES),$(eval $(call replay_rule,$(f))))
test: $(REPLAYS)

# ---- libFuzzer --------------------------------------------------------------------------------------------
FUZZ_FLAGS  := -fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer
FUZZ_CFLAGS := -std=c11 -O1 -g $(WARN) -Wno-unknown-pragmas -MMD -MP
FUZZ_CXXFLAGS := -std=c++17 -O1 -g -Wall -Wextra -Wshadow -MMD -MP
FUZZ_ARCHIVE = $(patsubst %.c,$(FUZZ_DIR)/obj/%.o,$(1))
FUZZ_OWN     := $(ILFLIB_SRC) $(COMMON_SRC)
fuzz_sources  = $(filter-out $(PROGRAMS_$(1):%=tools/$(1)/%.c),$(wildcard tools/$(1)/*.c))

.PHONY: clang-there
clang-there:
	@command -v $(CLANG) >/dev/null || { echo "fuzz: $(CLANG) is not installed (package clang), or set CLANG=..." >&2; exit 1; }
$(FUZZ_DIR)/obj/%.o: %.c | $(B0)/.debs-tools clang-there
	@mkdir -p $(@D)
	$(Q)$(CLANG) $(FUZZ_CPP) $(FUZZ_CFLAGS) $(FUZZ_FLAGS) -fsanitize=fuzzer-no-link -c -o $@ $<
$(FUZZ_DIR)/obj/%.o: %.cpp | $(B0)/.debs-tools clang-there
	@mkdir -p $(@D)
	$(Q)$(CLANG) $(FUZZ_CPP) $(FUZZ_CXXFLAGS) $(FUZZ_FLAGS) -fsanitize=fuzzer-no-link -c -o $@ $<
$(FUZZ_DIR)/libown.a: $(patsubst %,$(FUZZ_DIR)/obj/%.o,$(basename $(FUZZ_OWN)))
	@rm -f $@; ar rcs $@ $^
$(foreach t,$(TOOLS),$(eval $(FUZZ_DIR)/lib$(t).a: $(patsubst %.c,$(FUZZ_DIR)/obj/%.o,$(call fuzz_sources,$(t))) ; @rm -f $$@; ar rcs $$@ $$^))

define fuzz_rule
$(FUZZ_DIR)/fuzz_$(1): $(FUZZ_DIR)/obj/tests/fuzz/fuzz_$(1).o $(FUZZ_LIB_$(1):%=$(FUZZ_DIR)/lib%.a) $(UNDER_$(FUZZ_LIB_$(1)):%=$(FUZZ_DIR)/lib%.a) $(LIBVISION) $(FUZZ_DIR)/libown.a
	@echo "  LD  fuzz_$(1) (clang)"
	$$(Q)$(CLANG) $(FUZZ_FLAGS) -fsanitize=fuzzer -o $$@ $$^ $$(foreach t,$(FUZZ_LIB_$(1)),$$(LIBS_$$(t))) $$(LIBS_IMAGE)
endef
$(foreach f,$(FUZZ_NAMES),$(eval $(call fuzz_rule,$(f))))

.PHONY: fuzz fuzz-build
fuzz-build: $(FUZZ_NAMES:%=$(FUZZ_DIR)/fuzz_%)
fuzz: $(FUZZ:%=$(FUZZ_DIR)/fuzz_%)
	sh tests/fuzz/run.sh $(FUZZ_DIR) $(FUZZ_SECONDS) $(FUZZ)

-include $(shell find $(FUZZ_DIR)/obj -name '*.d' 2>/dev/null)
#?measures: fuzz            every parser under libFuzzer (clang), FUZZ_SECONDS=60 each; FUZZ="ilf hdr ..." some of them
