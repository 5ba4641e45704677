# Pictures in parts of their rows, each a file of its own: -j draws them side by side, ON=slurm on as many nodes.
#
#   octree ──rpict, 1/256 of the rays──► NAME.rows/room.amb ──a copy each──► rpict -yr K N ──► NAME.rows/K.hdr ──rows.py──► NAME.hdr
#
# The indirect light of a first look is found once (the overture) and given to each part as a copy: a cache is written to by one process alone,
# and no part depends on when the others ran.  So pictures depend on ROWS, but neither on -j nor on where they are drawn.  Without a cache (-aa 0, -ab 0)
# they don't depend on ROWS either, unless importance samples of a light field (-di) learn on their way.
#
# $(call in_rows,NAME,TARGET,FOLDER,OCTREE,FILES): TARGET (X.hdr) from its parts in FOLDER (X.rows), of OCTREE and of further FILES that it
# depends on; these three may have a %.  NAME_RUN is the environment of rpict, NAME_OPTIONS its options ($* is the stem), -ps 1 and a size among
# them, NAME_SAYS a line to be said.  X.json is what all parts cost together.
ROWS     ?= 16
ROW_PARTS    := $(shell seq 0 $$(($(ROWS) - 1)))
TIMED    := $(ON_RULES)/timed.py $(ON_RULES)/builds.py
timed     = $(ROWS_PY) $(firstword $(TIMED)) --log $(basename $@).json
ROWS_PY  ?= python3

# the value of rpict's option, by its last mention   $(call option,-x,OPTIONS)
option    = $(shell printf '%s\n' '$(subst ','\'',$(2))' | awk '{for (i = 1; i < NF; i++) if ($$i == "$(1)") v = $$(i + 1)} END {print v}')
sixteenth = $(1) $(shell n=$(call option,$(1),$(2)); echo $$((($${n:-512} + 15) / 16)))
small     = $(call sixteenth,-x,$(1)) $(call sixteenth,-y,$(1))
# is there indirect light to be kept?
zero     := 0 0. .0 0.0 00
cached    = $(and $(filter-out $(zero),$(call option,-ab,$(1))),$(if $(filter $(zero),$(call option,-aa,$(1))),,yes))

# NAME_CACHE: one that is there already
define overture
$(2)/room.amb: $(if $($(1)_CACHE),$($(1)_CACHE),$(3) $(4))
	@mkdir -p $$(@D); rm -f $$@.part $$(basename $$@).json; $$($(1)_SAYS)
	@$$(if $$($(1)_CACHE),cp $$< $$@,$$(if $$(and $$(filter-out 1,$(ROWS)),$$(call cached,$$($(1)_OPTIONS))),$$($(1)_RUN) $$(call on,render,$$@.part) $$(timed) -o $$(basename $$@).hdr -- \
	    rpict $$($(1)_OPTIONS) $$(call small,$$($(1)_OPTIONS)) -af $$@.part $$<; mv $$@.part $$@,: > $$@))
endef
define part_of_rows
$(2)/$(5).hdr: $(3) $(2)/room.amb $(4)
	@[ ! -s $$(word 2,$$^) ] || cp $$(word 2,$$^) $$(basename $$@).amb
	@$$($(1)_RUN) $$(call on,render,$$@) $$(timed) -o $$@ -- \
	    rpict $$($(1)_OPTIONS) $$$$([ ! -s $$(word 2,$$^) ] || echo -af $$(basename $$@).amb) -yr $(5) $(ROWS) $$<
	@rm -f $$(basename $$@).amb
endef
define joined_rows
$(2): $(foreach k,$(ROW_PARTS),$(3)/$(k).hdr) $(ON_RULES)/rows.py
	@$$(ROWS_PY) $(ON_RULES)/rows.py --log $$(<D:.rows=.json) $$$$([ ! -e $$(<D)/room.json ] || echo --before $$(<D)/room.json) -o $$@ $$(filter %.hdr,$$^)
endef
in_rows   = $(eval $(call overture,$(1),$(3),$(4),$(5)))$(foreach k,$(ROW_PARTS),$(eval $(call part_of_rows,$(1),$(3),$(4),$(5),$(k))))$(eval $(call joined_rows,$(1),$(2),$(3)))
