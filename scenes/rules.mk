# What all rules of the scenes share: which build of a program a thing was made with, and with which settings.
#
SCENE_RULES := $(patsubst %/,%,$(dir $(lastword $(MAKEFILE_LIST))))
# BIN is the folder of the programs, DIGEST that of their digests, DIGESTED the programs that rules may name.

# ---- programs ------------------------------------------------------------------------------------------
# DIGEST/NAME holds the SHA-256 of BIN/NAME.  It is touched only when the program's bytes change, so what depends on it is
# made anew by another program, and not because the same one was linked again.   target: files $(call made_by,NAME...)
made_by = $(1:%=$(DIGEST)/%)

# .NAME says when the program was last looked at; the empty recipe lets make look at NAME again (with its +, make -n does, too)
$(DIGESTED:%=$(DIGEST)/.%): $(DIGEST)/.%: $(BIN)/%
	@sh $(SCENE_RULES)/digest.sh $< $(@D)/$* $@
$(DIGESTED:%=$(DIGEST)/%): $(DIGEST)/%: $(DIGEST)/.% ;+

# those of a thing's programs in a file beside it, for who reports its numbers   $(call builds,FILE,NAME...)
builds = for p in $(2); do echo "$$p $$(cut -c 1-12 $(DIGEST)/$$p)"; done > $(1)

# ---- settings ------------------------------------------------------------------------------------------
# A file that says how things are made, and is written again only when that has changed: what depends on it
# is made anew after a change of settings, and only then.   $(eval $(call settings,FILE,TEXT))
.PHONY: FORCE
same = $(and $(findstring $(1),$(2)),$(findstring $(2),$(1)))
define settings
$(1): $(if $(call same,$(file <$(1)),$(2)),,FORCE)
	@mkdir -p $$(@D)
	@printf '%s\n' '$(subst ','\'',$(2))' > $$@.$$$$$$$$; mv $$@.$$$$$$$$ $$@
endef
# the same for a text of several lines that stands in an exported variable   $(eval $(call settings_of,FILE,VARIABLE))
define settings_of
$(1): $(if $(call same,$(file <$(1)),$($(2))),,FORCE)
	@mkdir -p $$(@D)
	@printf '%s\n' "$$$$$(2)" > $$@.$$$$$$$$; mv $$@.$$$$$$$$ $$@
endef
