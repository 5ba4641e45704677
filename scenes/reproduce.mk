# Stages that light as captured fields would (ilfstage): wanted beside reproduced, and errors against lights and bits.  Included by the top Makefile.
#
#?pictures: reproduce       virtual stages lit by the light fields of figures 11, 12 and the demo, with their errors (build/reproduce/)
#?pictures: reproduce-clean forget them
#
# Stages: 156 lights on a sphere, 29, a wall of 64 x 32 patches with a ceiling (scenes/stages/generate.py).  Each run of ilfstage leaves a report, a picture and frames; reproduce.py draws
# the curves and the table, reproduce.csv.

REPRODUCE        := $(B0)/reproduce
REPRODUCE_STAGES := sphere156 sphere29 wall
REPRODUCE_FIELDS := figure11 figure12 demo
reproduce_figure11 := $(B0)/figures/figure11/room.ilf.exr
reproduce_figure12 := $(B0)/figures/figure12/room.ilf.exr
reproduce_demo     := $(B0)/demo/room.ilf.exr
# through the pools of light and the shadows of figures 11 and 12, and from one pool to the other
REPRODUCE_PATH   := 0 -.30 -.20 0|2 0 0 0|4 .30 .20 0
REPRODUCE_FPS    ?= 2
REPRODUCE_SETS   := $(foreach s,$(REPRODUCE_STAGES),$(foreach f,$(REPRODUCE_FIELDS),$(s)-$(f)))
REPRODUCE_RUN     = $(ILF_ENV) ilfstage --quiet --path $(REPRODUCE)/path.txt --fps $(REPRODUCE_FPS) --exposure auto
STAGE_PARTS      := $(wildcard tools/ilfstage/*.py) $(B0)/bin/ilfstage

.PHONY: reproduce reproduce-clean
reproduce: $(REPRODUCE)/reproduce.png $(REPRODUCE_SETS:%=$(REPRODUCE)/%.json) $(REPRODUCE)/statue-figure11.json
	@echo "Pictures:     $(TOP)/$(REPRODUCE)/*.png"; echo "Errors:       $(TOP)/$(REPRODUCE)/reproduce.csv"
reproduce-clean:
	rm -rf $(REPRODUCE)

$(REPRODUCE)/path.txt: scenes/reproduce.mk
	@mkdir -p $(@D)
	@echo "$(REPRODUCE_PATH)" | tr '|' '\n' >$@
$(REPRODUCE)/%.toml: scenes/stages/generate.py | $(VENV)/.packages
	@mkdir -p $(@D)
	@$(PY) $< $* -o $@
define reproduced
$(REPRODUCE)/$(1)-$(2).json: $(REPRODUCE)/$(1).toml $(reproduce_$(2)) $(REPRODUCE)/path.txt $(STAGE_PARTS) $(MODELS)/statue.obj $(call made_by,rcontrib rtrace rpict oconv obj2mesh) | $(VENV)/.ilf
	@echo "  reproduce: $(2) by $(1)"
	@$$(REPRODUCE_RUN) --matrix $(REPRODUCE)/$(1).npz $(if $(filter sphere156-% sphere29-figure11,$(1)-$(2)),--picture $$(@:json=png) --show $(MODELS)/statue.obj) \
	    -o $$(@:json=csv) --dmx $$(@:json=artnet) --report $$@ $(REPRODUCE)/$(1).toml $(reproduce_$(2)) >$$(@:json=txt)
endef
$(foreach s,$(REPRODUCE_STAGES),$(foreach f,$(REPRODUCE_FIELDS),$(eval $(call reproduced,$(s),$(f)))))

# the statue itself is matched, not a ball
$(REPRODUCE)/statue-figure11.json: $(REPRODUCE)/sphere156.toml $(reproduce_figure11) $(REPRODUCE)/path.txt $(STAGE_PARTS) $(MODELS)/statue.obj $(call made_by,rcontrib rtrace rpict oconv obj2mesh) | $(VENV)/.ilf
	@echo "  reproduce: figure11 on the statue by sphere156"
	@$(REPRODUCE_RUN) --matrix $(REPRODUCE)/statue.npz --mesh $(MODELS)/statue.obj --picture $(@:json=png) --report $@ $(REPRODUCE)/sphere156.toml $(reproduce_figure11) >$(@:json=txt)

$(REPRODUCE)/reproduce.png: scenes/reproduce.py $(REPRODUCE_SETS:%=$(REPRODUCE)/%.json) $(REPRODUCE)/statue-figure11.json | $(VENV)/.ilf
	@echo "  reproduce: errors against lights and bits"
	@$(ILF_ENV) $(PY) $< --folder $(REPRODUCE) --field figure11=$(reproduce_figure11) --field figure12=$(reproduce_figure12) --field demo=$(reproduce_demo) -o $@
