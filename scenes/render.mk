# From a light field to pictures: file rules that any scene can use.
#
# $(eval $(call light_field_pictures,NAME)) makes in NAME_OUT, for the scene NAME,
#
#   stage.oct                the room without the objects: what a camera on the plane sees
#   walls.oct                the surfaces that the light field lies on: how far ilflamps is to take them for
#   photo.oct                the room itself with the objects: the reference
#   with_room.oct _single    the objects in room.ilf.exr, single.ilf.exr (room.lamps.ilf.exr, too): on the same surfaces, each of them a window on the light field
#   mask.oct                 table red, objects green (compare.py)
#   X.hdr                    pictures of those, X.json beside it what one cost (timed.py), X.mosaic.png the probes of X.ilf.exr
#
# which says before (NAME_OUT, NAME_PATH as in chain.mk)
#
#   NAME_PAINT     the room's materials                 NAME_ROOM      its surfaces and lamps
#   NAME_HIDDEN    further surfaces of the room, of which the rendering knows nothing
#   NAME_TABLE     the table   NAME_OBJECTS  what is set on it   NAME_CAPTURE_ONLY  what stood on it for the capture
#   NAME_READS     files that all these read: lamps, function files, meshes
#   NAME_VIEW      view file   NAME_RES      -x -y: twice the picture's size
#   NAME_LIGHT_photo, NAME_LIGHT_with   sampling options of the reference and of pictures in a light field

# importance samples of the light field per point; 0 = the paper's literal method, blind rays
DI       ?= 32
# The literal method sees the lamps with its ambient rays, so no cache and no supersampling: both would be biased.
# -st 0: highlights are a scattered ray's, below the threshold a surface has none in a light field
PICT_ILF := -ab 2 -st 0 -di $(DI) $(if $(filter 0,$(DI)),-aa 0 -as 0 -lw 1e-7,-aa .12 -as 64 -ar 64)
# one ray in the middle of each pixel, so that all pictures see the same edges; a picture is rendered at twice its size and halved
PICT_RAYS := -ps 1 -pj 0 -w
HALVE     = pfilt -1 -x /2 -y /2

MODELS   := $(B0)/models
$(MODELS)/statue.obj: scenes/models/statue.py | $(VENV)/.packages
	@mkdir -p $(@D)
	@$(PY) $< --height .30 --cells 110 -o $@
$(MODELS)/%.rtm: $(MODELS)/%.obj $(call made_by,obj2mesh) | $(FUNCTIONS)
	@$(ILF_ENV) obj2mesh $< $@

# "2 lamps taken out", as the picture's caption has it, in a recipe   $(call lamps_in,LIGHT FIELD OF VERSION 2)
lamps_in = $$($(ILF_ENV) ilfinfo --header $(1) | awk '$$1 == "lamps" {n = $$2 + 0} END {print n ? n : "no", n == 1 ? "lamp" : "lamps"}') taken out (ilflamps)

define light_field_pictures
$(1)_RUN  = $$(ILF_ENV):$$($(1)_PATH)
$(1)_PICT := -vf $($(1)_VIEW) $($(1)_RES) $(PICT_RAYS)
$$(eval $$(call settings,$($(1)_OUT)/render.settings,$$($(1)_PICT) $($(1)_LIGHT_photo); $($(1)_LIGHT_with); $(ROWS) parts))
$(1)_RENDER_photo       := $($(1)_LIGHT_photo)
$(1)_RENDER_mask        := -ab 0
$(1)_RENDER_with_room   := $($(1)_LIGHT_with)
$(1)_RENDER_with_single := $($(1)_LIGHT_with)
$(1)_RENDER_with_room.lamps := $($(1)_LIGHT_with)

$($(1)_OUT)/stage.oct: $($(1)_PAINT) $($(1)_ROOM) $($(1)_HIDDEN) $($(1)_TABLE) $($(1)_CAPTURE_ONLY) $($(1)_READS) $(call made_by,oconv xform) | $(FUNCTIONS)
	@mkdir -p $$(@D)
	@$$($(1)_RUN) oconv -f $($(1)_PAINT) $($(1)_ROOM) $($(1)_HIDDEN) $($(1)_TABLE) $($(1)_CAPTURE_ONLY) > $$@.part
	@mv $$@.part $$@
$($(1)_OUT)/walls.oct: $($(1)_PAINT) $($(1)_ROOM) $($(1)_READS) $(call made_by,oconv xform) | $(FUNCTIONS)
	@mkdir -p $$(@D)
	@$$($(1)_RUN) oconv -f $($(1)_PAINT) $($(1)_ROOM) > $$@.part
	@mv $$@.part $$@
$($(1)_OUT)/photo.oct: $($(1)_PAINT) $($(1)_ROOM) $($(1)_HIDDEN) $($(1)_TABLE) $($(1)_OBJECTS) $($(1)_READS) $(call made_by,oconv xform) | $(FUNCTIONS)
	@mkdir -p $$(@D)
	@$$($(1)_RUN) oconv -f $($(1)_PAINT) $($(1)_ROOM) $($(1)_HIDDEN) $($(1)_TABLE) $($(1)_OBJECTS) > $$@.part
	@mv $$@.part $$@
$($(1)_OUT)/with_%.oct: $($(1)_OUT)/%.ilf.exr $($(1)_PAINT) $($(1)_ROOM) $($(1)_TABLE) $($(1)_OBJECTS) $($(1)_READS) $(call made_by,oconv xform) | $(FUNCTIONS)
	@{ printf 'void ilf room_light\n1 %s\n0\n0\n' $$(<F); \
	   $$($(1)_RUN) xform -m room_light $($(1)_ROOM); cat $($(1)_TABLE) $($(1)_OBJECTS); } > $($(1)_OUT)/with_$$*.rad
	@$$($(1)_RUN) oconv -f $($(1)_PAINT) $($(1)_OUT)/with_$$*.rad > $$@.part
	@mv $$@.part $$@
# the longer of the two renderings starts first
$($(1)_OUT)/with_single.oct: | $($(1)_OUT)/room.ilf.exr
$($(1)_OUT)/mask.oct: scenes/demo/mask_materials.rad $($(1)_TABLE) $($(1)_OBJECTS) $($(1)_READS) $(call made_by,oconv xform) | $(FUNCTIONS)
	@mkdir -p $$(@D)
	@{ cat $$<; $$($(1)_RUN) xform -m mask_table $($(1)_TABLE); \
	   $$($(1)_RUN) xform -m mask_objects $($(1)_OBJECTS); } | $$($(1)_RUN) oconv -f - > $$@.part
	@mv $$@.part $$@

$(1)_OPTIONS = $$($(1)_PICT) $$($(1)_RENDER_$$*)
$(1)_SAYS    = echo "  render: $(1) $$* $$($(1)_RENDER_$$*)"
$$(call in_rows,$(1),$($(1)_OUT)/%.big.hdr,$($(1)_OUT)/%.rows,$($(1)_OUT)/%.oct,$($(1)_VIEW) $($(1)_OUT)/render.settings $(TIMED) $(call made_by,rpict) | $(VENV)/.packages $(FUNCTIONS))
$($(1)_OUT)/%.hdr: $($(1)_OUT)/%.big.hdr $(call made_by,pfilt)
	@$$(ILF_ENV) $(HALVE) $$< > $$@.part
	@mv $$@.part $$@

$($(1)_OUT)/%.mosaic.png: $($(1)_OUT)/%.ilf.exr $(call made_by,ilfinfo)
	@$$(ILF_ENV) ilfinfo --quiet --montage $$@ $$< > $($(1)_OUT)/$$*.ilf.txt
endef
