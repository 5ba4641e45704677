# The demo: the main job on real photographs and on a virtual capture.  Included by the top Makefile.
#
#?pictures: demo-clean      forget the demo's results
#
# OFFICE=DIR names a folder with an exposure series of one fisheye view (*.jpg with EXIF exposure times); scenes/README.md
# says what it has to be and which variables describe the lens.

include scenes/chain.mk scenes/render.mk

DEMO     := $(B0)/demo
OFFICE   ?= ../shared/data/fisheye_bracket_office_canon5d2_8mm
OFFICE_IMAGES := $(sort $(wildcard $(OFFICE)/*.jpg $(OFFICE)/*.JPG $(OFFICE)/*.jpeg))
SCENES   := scenes/demo
DEMO_AD  ?= $(if $(filter 0,$(DI)),512,256)
DEMO_JOBS ?= $(shell nproc 2>/dev/null || echo 2)
# a picture is rendered at twice its size and halved
DEMO_RES := -x 640 -y 480
OFFICE_AD ?= $(if $(filter 0,$(DI)),256,1024)

.PHONY: demo demo-run demo-clean
demo:
	+@$(MAKE) --no-print-directory $(if $(findstring jobserver,$(MAKEFLAGS)),,-j$(DEMO_JOBS)) demo-run
	@echo "The pictures:"; ls -1 $(DEMO)/demo.png $(DEMO)/office.png 2>/dev/null | sed 's,^,  $(TOP)/,'
	@echo "The errors:   $(TOP)/$(DEMO)/errors.csv"
	@echo "To look at:   $(TOP)/$(DEMO)/view.html   (the light field, in a browser)"

# the photographs first: their picture is drawn while the virtual camera works
demo-run: $(if $(OFFICE_IMAGES),$(DEMO)/office.png,no-office) $(DEMO)/demo.png $(DEMO)/view.html
demo-clean:
	rm -rf $(DEMO)

# ---- (b) the virtual capture -------------------------------------------------------------------------
# Two spotlights in a studio, 6 x 6 positions on a plane of 30 x 30 inches at the table's height.
# How they are captured stands in the session; DEMO_SESSION names another, whose [output] folder is $(DEMO).
DEMO_SESSION  ?= $(SCENES)/session.conf
demo_OUT      := $(DEMO)
demo_PATH     := $(TOP)/$(SCENES):$(TOP)/$(DEMO):$(TOP)/$(MODELS)
demo_SESSION  := $(DEMO_SESSION)
demo_STAGE    := $(DEMO)/stage.oct
demo_NAMES    := $(SCENES)/lens_falloff.txt
demo_NODES    := $(subst x, ,$(call in_session,$(DEMO_SESSION),nodes))
demo_NU       := $(firstword $(demo_NODES))
demo_NV       := $(lastword $(demo_NODES))
demo_PLANE    := $(call in_session,$(DEMO_SESSION),plane)
demo_SINGLE   := 2_2
# with lamps taken out, too, as long as the session asks for it ([chain] ilflamps)
demo_LIT      := $(if $(call in_session,$(DEMO_SESSION),ilflamps),$(DEMO)/with_room.lamps.hdr)
$(eval $(call light_field,demo))

# The pictures: the table and what stands on it, in the same studio.
demo_PAINT    := $(SCENES)/room_materials.rad
demo_ROOM     := $(SCENES)/room.rad $(SCENES)/lamps.rad
demo_TABLE    := $(SCENES)/table.rad
demo_OBJECTS  := $(SCENES)/objects.rad
demo_READS    := $(SCENES)/lamp_yellow.rad $(SCENES)/lamp_blue.rad $(SCENES)/spot.cal $(MODELS)/statue.rtm
demo_VIEW     := $(SCENES)/view.vf
demo_RES      := $(DEMO_RES)
demo_LIGHT_photo := -ab 2 -aa .15 -ad 512 -as 128 -ar 64 -ds .05 -dj .8 -dt 0 -dc 1
demo_LIGHT_with  := $(PICT_ILF) -ad $(DEMO_AD)
$(eval $(call light_field_pictures,demo))

# ---- the same without a stage: a 360-degree camera, put down at places that a list of them tells ------------------------
# What such a camera stores is drawn, and goes the way that a user's panoramas go (panoramas.mk).  Who captures so has measured the
# walls and no lamps: neither ilfpack nor the picture knows where those hang.
FREE        := $(DEMO)/free
free_NAMES  := $(shell sed -n 's/^\([^ \#]*\) .*/\1/p' $(SCENES)/positions.txt)
free_LENS   := 384
free_LIGHT  := -pj 0 -ab 2 -aa .2 -ad 512 -as 256 -ar 32 -ds .1 -dj .6 -dt 0 -dc 1 -w
$(eval $(call settings,$(FREE)/camera.settings,$(free_LENS) $(free_LIGHT)))
# (the capture has left the room's indirect light there)
$(free_NAMES:%=$(FREE)/%): $(FREE)/%: $(DEMO)/stage.oct $(SCENES)/positions.txt scenes/dual.sh $(FREE)/camera.settings $(demo_READS) $(call made_by,rpict pcompos) | $(DEMO)/.taken $(FUNCTIONS)
	@echo "  360-degree camera: $*"
	@$(demo_RUN) sh scenes/dual.sh $< $(SCENES)/positions.txt $* $(DEMO)/views/room.amb $(free_LENS) $(free_LIGHT) -o $@
$(FREE)/walls.oct: $(demo_PAINT) $(SCENES)/room.rad $(call made_by,oconv) | $(FUNCTIONS)
	@mkdir -p $(@D)
	@$(demo_RUN) oconv -f $(demo_PAINT) $(SCENES)/room.rad > $@.part
	@mv $@.part $@
$(FREE)/positions.txt: $(SCENES)/positions.txt
	@mkdir -p $(@D)
	@cp $< $@
$(FREE)/.taken: $(free_NAMES:%=$(FREE)/%) $(FREE)/positions.txt $(FREE)/walls.oct $(call made_by,fishremap ilfpack)
	+@$(a_make) --no-print-directory -C scenes PANORAMAS=$(TOP)/$(FREE)/positions.txt BUILD=$(TOP)/$(B) QUIET=--quiet
	@touch $@
$(FREE)/field/room.ilf.exr: $(FREE)/.taken ;
demo_RENDER_with_free := $(demo_LIGHT_with)
$(DEMO)/with_free.oct: $(FREE)/field/room.ilf.exr $(demo_PAINT) $(SCENES)/room.rad $(demo_TABLE) $(demo_OBJECTS) $(demo_READS) $(call made_by,oconv xform) | $(FUNCTIONS)
	@{ printf 'void ilf room_light\n1 free/field/room.ilf.exr\n0\n0\n'; \
	   $(demo_RUN) xform -m room_light $(SCENES)/room.rad; cat $(demo_TABLE) $(demo_OBJECTS); } > $(DEMO)/with_free.rad
	@$(demo_RUN) oconv -f $(demo_PAINT) $(DEMO)/with_free.rad > $@.part
	@mv $@.part $@

$(DEMO)/demo.png: $(DEMO)/room.mosaic.png $(DEMO)/photo.hdr $(DEMO)/with_room.hdr $(demo_LIT) $(DEMO)/with_free.hdr $(DEMO)/with_single.hdr $(DEMO)/mask.hdr scenes/compare.py scenes/pictures.py scenes/rgbe.py | $(VENV)/.packages
	@$(PY) scenes/compare.py --reference "Photograph: the room itself=$(DEMO)/photo.hdr" \
	    --picture "Incident light field, $(demo_NU) × $(demo_NV) probes=$(DEMO)/with_room.hdr" \
	    $(if $(demo_LIT),--picture "With $(call lamps_in,$(DEMO)/room.lamps.ilf.exr)=$(demo_LIT)") \
	    --picture "360° camera, $(words $(free_NAMES)) free places, $(subst ilflamps,ilfpack,$(call lamps_in,$(FREE)/field/room.ilf.exr))=$(DEMO)/with_free.hdr" \
	    --picture "Single probe=$(DEMO)/with_single.hdr" --mask $(DEMO)/mask.hdr \
	    --title "Two spotlights, captured by a virtual fisheye at $(demo_NU) × $(demo_NV) positions" \
	    --extra "the light field: $(demo_NU) × $(demo_NV) probes, each the hemisphere as a map=$(DEMO)/room.mosaic.png" \
	    --csv $(DEMO)/errors.csv -o $@

# the light field as a page, and beside it the one with lamps taken out
demo_FIELDS   := $(DEMO)/room.ilf.exr $(if $(demo_LIT),$(DEMO)/room.lamps.ilf.exr)
$(DEMO)/view.html: $(demo_FIELDS) $(call made_by,ilfview)
	@$(ILF_ENV) ilfview --quiet -o $@ $(demo_FIELDS)

# ---- (a) real photographs ------------------------------------------------------------------------------
OFFICE_LENS    ?= --lens equisolid --fov 186
OFFICE_CIRCLE  ?= --centre 706,466 --radius 451.5
OFFICE_FALLOFF ?= $(if $(wildcard $(OFFICE)/vignetting.json),--falloff $(OFFICE)/vignetting.json --falloff-set f5.6)
OFFICE_RESPONSE ?= debevec
OUT_OFFICE     := $(DEMO)/office
OFFICE_RUN      = $(ILF_ENV):$(TOP)/$(SCENES):$(TOP)/$(OUT_OFFICE):$(TOP)/$(MODELS)

.PHONY: no-office
no-office:
	@echo "demo: real photographs left out: no *.jpg in $(OFFICE) (OFFICE=DIR names a series of your own; see scenes/README.md)"
$(OUT_OFFICE)/fisheye.exr: $(OFFICE_IMAGES) $(call made_by,hdrgen)
	@mkdir -p $(@D)
	@echo "  office: merging $(words $(OFFICE_IMAGES)) photographs"
	@$(ILF_ENV) $(call on,merge,$@) hdrgen --quiet --response $(OFFICE_RESPONSE) -o $@ $(OFFICE_IMAGES)
$(OUT_OFFICE)/probe.exr: $(OUT_OFFICE)/fisheye.exr $(call made_by,fishremap)
	@$(ILF_ENV) $(call on,remap,$@) fishremap --quiet $(OFFICE_LENS) $(OFFICE_CIRCLE) --size 720x180 --polar-max 90 \
	    $(OFFICE_FALLOFF) -o $@ $<
$(OUT_OFFICE)/office.ilf.exr: $(OUT_OFFICE)/probe.exr $(call made_by,ilfpack)
	@$(ILF_ENV) ilfpack --quiet --grid 1x1 --plane "-.5 0 -.5  1 0 0  0 0 1" --type float -o $@ $<
$(OUT_OFFICE)/office.oct: $(OUT_OFFICE)/office.ilf.exr $(SCENES)/office.rad $(MODELS)/statue.rtm $(call made_by,oconv xform) | $(FUNCTIONS)
	@$(OFFICE_RUN) oconv -f $(SCENES)/office.rad > $@.part
	@mv $@.part $@
office_RUN     = $(OFFICE_RUN)
office_OPTIONS = -vf $(SCENES)/office.vf $(DEMO_RES) $(PICT_RAYS) $(PICT_ILF) -ad $(OFFICE_AD)
office_SAYS    = echo "  render: office $(PICT_ILF) -ad $(OFFICE_AD)"
$(eval $(call settings,$(OUT_OFFICE)/render.settings,$(DEMO_RES) $(PICT_ILF) -ad $(OFFICE_AD); $(ROWS) parts))
$(call in_rows,office,$(OUT_OFFICE)/office.big.hdr,$(OUT_OFFICE)/office.rows,$(OUT_OFFICE)/office.oct,$(SCENES)/office.vf $(OUT_OFFICE)/render.settings $(TIMED) $(call made_by,rpict) | $(VENV)/.packages $(FUNCTIONS))
$(OUT_OFFICE)/office.hdr: $(OUT_OFFICE)/office.big.hdr $(call made_by,pfilt)
	@$(ILF_ENV) $(HALVE) $< > $@.part
	@mv $@.part $@
$(DEMO)/office.png: $(OUT_OFFICE)/office.hdr scenes/compare.py scenes/pictures.py scenes/rgbe.py | $(VENV)/.packages
	@$(PY) scenes/compare.py --title "Real photographs to a rendered picture" \
	    --show "One of $(words $(OFFICE_IMAGES)) photographs|fisheye, looking into the room=$(word $(shell echo $$((($(words $(OFFICE_IMAGES)) + 1) / 2))),$(OFFICE_IMAGES))" \
	    --show "The probe|latitude/longitude, pole in the top row=$(OUT_OFFICE)/probe.exr@6" \
	    --show "Rendered in that light|a still life before the wall where the camera stood=$(OUT_OFFICE)/office.hdr" -o $@
