# Rendered objects in a photograph of the place (composite.py: differential rendering, Debevec 1998).  Included by the top Makefile.
#
#?pictures: composite       objects in a photograph of the demo's room, with the errors; PLATE=... for a photograph of your own (docs/TUTORIAL.md)
#
# $(eval $(call composites,NAME)) adds to a scene of render.mk's, in NAME_OUT,
#
#   without_room.oct         the local scene alone (NAME_TABLE, without NAME_OBJECTS) in room.ilf.exr
#   composite.KIND.exr       the objects in NAME_PLATE: KIND difference, ratio, replace or none (composite.py)
#
# which says before   NAME_PLATE  the photograph, linear radiance, of the view NAME_VIEW    NAME_FIELD  room, or room.lamps   NAME_GAIN  1 or auto

define composites
$(1)_RENDER_without_room       := $($(1)_LIGHT_with)
$(1)_RENDER_without_room.lamps := $($(1)_LIGHT_with)
$($(1)_OUT)/without_%.oct: $($(1)_OUT)/%.ilf.exr $($(1)_PAINT) $($(1)_ROOM) $($(1)_TABLE) $($(1)_READS) $(call made_by,oconv xform) | $(FUNCTIONS)
	@{ printf 'void ilf room_light\n1 %s\n0\n0\n' $$(<F); \
	   $$($(1)_RUN) xform -m room_light $($(1)_ROOM); cat $($(1)_TABLE); } > $($(1)_OUT)/without_$$*.rad
	@$$($(1)_RUN) oconv -f $($(1)_PAINT) $($(1)_OUT)/without_$$*.rad > $$@.part
	@mv $$@.part $$@
$$(eval $$(call settings,$($(1)_OUT)/composite.settings,$($(1)_GAIN) $($(1)_PLATE)))
$(COMPOSITE_KINDS:%=$($(1)_OUT)/composite.%.exr): $($(1)_OUT)/composite.%.exr: $($(1)_PLATE) $($(1)_OUT)/composite.settings $(foreach k,with_$($(1)_FIELD) without_$($(1)_FIELD) mask,$($(1)_OUT)/$(k).big.hdr) scenes/composite.py scenes/compare.py scenes/pictures.py scenes/rgbe.py | $(VENV)/.packages
	@$(PY) scenes/composite.py $$(if $$(filter $$(or $$(KIND),difference),$$*),,--quiet) --shadow $$* --gain $($(1)_GAIN) --with $($(1)_OUT)/with_$($(1)_FIELD).big.hdr \
	    --without $($(1)_OUT)/without_$($(1)_FIELD).big.hdr --mask $($(1)_OUT)/mask.big.hdr -o $$@ $($(1)_PLATE)
endef
COMPOSITE_KINDS := difference ratio replace none

.PHONY: composite
ifeq ($(PLATE),)
# ---- the demo's: a photograph of the studio, and the studio itself with the objects as the truth -------------------------------
demo_PLATE := $(DEMO)/plate.exr
demo_FIELD := $(if $(demo_LIT),room.lamps,room)
demo_GAIN  := 1
$(eval $(call composites,demo))

# the view's own camera: the room without objects, rendered as the reference is, in three exposures that hdrgen merges
demo_RENDER_stage := $(demo_LIGHT_photo)
$(DEMO)/plate/times.txt: $(DEMO)/stage.hdr scenes/camera.py | $(VENV)/.packages
	@$(PY) scenes/camera.py --seconds 1/16 --seconds 1/2 --seconds 4 --seconds 16 -o $(@D) $<
$(demo_PLATE): $(DEMO)/plate/times.txt $(call made_by,hdrgen)
	@cd $(<D) && $(ILF_ENV) hdrgen --quiet --response srgb --times times.txt -o ../$(@F) e*.png

composite: $(DEMO)/composite.png
	@$(PY) -c 'import csv; [print("%s: RMSE %.1f %%, %s CPU s" % (r[0], 100 * float(r[3]), r[4])) for r in csv.reader(open("$(DEMO)/composite.csv")) if r[2] == "rmse (all)"]'
	@echo "The picture: $(TOP)/$<"; echo "The errors:  $(TOP)/$(DEMO)/composite.csv"
$(DEMO)/composite.png: $(DEMO)/photo.hdr $(DEMO)/mask.hdr $(COMPOSITE_KINDS:%=$(DEMO)/composite.%.exr) scenes/compare.py | $(VENV)/.packages
	@$(PY) scenes/compare.py --reference "The room with the objects=$(DEMO)/photo.hdr" \
	    --picture "Put into its photograph, differential=$(DEMO)/composite.difference.exr" \
	    --picture "The same by ratios=$(DEMO)/composite.ratio.exr" \
	    --picture "The table rendered, not differential=$(DEMO)/composite.replace.exr" \
	    --picture "Objects pasted, no shadows=$(DEMO)/composite.none.exr" --mask $(DEMO)/mask.hdr \
	    --extra "the photograph: the room without the objects=$(demo_PLATE)" \
	    --quiet --title "Objects in a photograph of the room, lit by its light field" --csv $(DEMO)/composite.csv -o $@
else
# ---- your own ------------------------------------------------------------------------------------------------------------
# PLATE=photo.exr FIELD=room.ilf.exr VIEW=camera.vf LOCAL=table.rad OBJECTS=things.rad AROUND=walls.rad [PAINT=materials.rad] [OUT=FOLDER]
# [KIND=difference|ratio|replace|none] [GAIN=auto|1|G: of the photograph] [AD=256: rays of the renderings]
needed_here := $(strip $(foreach v,FIELD VIEW LOCAL OBJECTS AROUND,$(if $($(v)),,$(v)=FILE)))
$(if $(needed_here),$(error composite: PLATE=$(PLATE): expected $(needed_here), too))
missing_here := $(strip $(foreach f,$(PLATE) $(FIELD) $(VIEW) $(LOCAL) $(OBJECTS) $(AROUND) $(PAINT),$(if $(wildcard $(f)),,$(f))))
$(if $(missing_here),$(error composite: expected a file, found none: $(missing_here)))
OUT        ?= $(B0)/composite
AD         ?= 256
own_OUT    := $(OUT)
# what the scene's files name is looked for beside them, then where RAYPATH says
blank      := $() $()
own_PATH   := $(subst $(blank),:,$(sort $(abspath $(dir $(LOCAL) $(OBJECTS) $(AROUND) $(PAINT) $(OUT)/x)))):$(RAYPATH)
own_PLATE  := $(PLATE)
own_FIELD  := room
own_GAIN   := $(or $(GAIN),auto)
own_PAINT  := $(PAINT)
own_ROOM   := $(AROUND)
own_TABLE  := $(LOCAL)
own_OBJECTS := $(OBJECTS)
own_VIEW   := $(VIEW)
# twice the photograph's size, whatever the view's angles say of a pixel's shape
own_RES    := $(shell PYTHONPATH=scenes $(PY) -c 'import pictures, sys; h, w = pictures.read(sys.argv[1]).shape[:2]; print("-pa 0 -x", 2 * w, "-y", 2 * h)' $(PLATE) 2>&1 | tail -n 1)
$(if $(filter -pa,$(own_RES)),,$(error composite: $(own_RES)))
own_LIGHT_photo := -ab 0
own_LIGHT_with  := $(PICT_ILF) -ad $(AD)
$(OUT)/room.ilf.exr: $(FIELD)
	@mkdir -p $(@D) && ln -sf $(abspath $<) $@
$(eval $(call light_field_pictures,own))
$(eval $(call composites,own))
composite: $(OUT)/composite.$(or $(KIND),difference).exr
	@echo "The picture: $(abspath $<)"
endif
