# What a virtual camera sees, rendered place by place and side by side before the capture develops it.  Included by capture.mk.
#
#   room.oct ──five views──► views/room.amb ──a copy each──► views/I_J/*.pfm ──stagectl capture──► exposures
#
# For sessions whose camera's command has a cache for each place (--cache FOLDER/{i}_{j}); all others render a place at its first
# exposure.  Where its rendering options name an ambient file in there (-af FOLDER/{i}_{j}/NAME) the room's indirect light is found
# once, from the plane's middle and corners, and each place starts from a copy: so no place depends on the order of the others.
# Views that were thrown away are rendered again only for a capture that wants them.

word_after  = $(shell printf '%s\n' '$(subst ','\'',$(COMMAND))' | sed -n 's,.*$(1) "*\([^ "]*\){i}_{j}\([^ "]*\).*,\$(2),p')
VIEWS_NAMED := $(if $(CAMERA_PROGRAMS),$(patsubst %/,%,$(call word_after,--cache,1)))
VIEWS       := $(if $(VIEWS_NAMED),$(abspath $(if $(filter /%,$(VIEWS_NAMED)),,$(HERE))$(VIEWS_NAMED)))
VIEWS_DONE  :=
ifneq ($(VIEWS),)
AMBIENT     := $(patsubst /%,%,$(call word_after,-af,2))
upto         = $(shell seq 0 $$(($(1) - 1)))
VIEWS_DONE  := $(foreach j,$(call upto,$(lastword $(subst x, ,$(NODES)))),$(foreach i,$(call upto,$(firstword $(subst x, ,$(NODES)))),$(VIEWS)/$(i)_$(j)/done))
see          = @$(call on,view,$(1)) sh $(CHAIN)/view.sh $(SESSION)

$(eval $(call settings,$(FOLDER)/.views,$(COMMAND); $(PLANE) $(call get,camera.lens) $(call get,camera.fov)))
VIEWS_FROM  := $(FOLDER)/.seen $(FOLDER)/.views $(CHAIN)/view.sh

ifneq ($(AMBIENT),)
$(VIEWS)/$(AMBIENT): $(VIEWS_FROM)
	@echo "  capture: indirect light of the room"
	@rm -rf $(VIEWS)/overture; mkdir -p $(VIEWS)/overture
	$(call see,$(VIEWS)/overture/$(AMBIENT)) 3x3 1_1 overture --size 160 --supersample 1 --refine 16
	$(call see,$(VIEWS)/overture/$(AMBIENT)) 3x3 0_0 overture --size 160 --supersample 1 --refine 16
	$(call see,$(VIEWS)/overture/$(AMBIENT)) 3x3 2_2 overture --size 160 --supersample 1 --refine 16
	$(call see,$(VIEWS)/overture/$(AMBIENT)) 3x3 0_2 overture --size 160 --supersample 1 --refine 16
	$(call see,$(VIEWS)/overture/$(AMBIENT)) 3x3 2_0 overture --size 160 --supersample 1 --refine 16
	@mv $(VIEWS)/overture/$(AMBIENT) $@; rm -rf $(VIEWS)/overture
endif

.SECONDARY: $(VIEWS_DONE) $(if $(AMBIENT),$(VIEWS)/$(AMBIENT))
# the pattern's stem is the node, i_j
$(VIEWS_DONE): $(VIEWS)/%/done: $(VIEWS_FROM) $(if $(AMBIENT),$(VIEWS)/$(AMBIENT))
	@echo "  capture: view from node $*"
	@rm -rf $(@D); mkdir -p $(@D); $(if $(AMBIENT),cp $(VIEWS)/$(AMBIENT) $(@D)/$(AMBIENT))
	$(call see,$(@D)) $(NODES) $* $*
	@$(if $(AMBIENT),rm -f $(@D)/$(AMBIENT) $(@D)/$(AMBIENT).scene;) touch $@
endif
