# The paper's figures, measured: three rooms, each captured as the paper did and drawn as itself, in its light field, in one probe.
#
#?pictures: figures         the paper's figures with their errors (SIZE=paper: its 30 x 30 probes of 400 x 400, hours)
#?pictures: figures-clean   forget them
#
# scenes/README.md says what each figure shows.  All is made under build/figures/ (SIZE=paper: build/figures-paper/), each step a
# file of its own: what was stopped goes on where it was.  figures.txt there holds time and size in the end.

SIZE     ?= small
ifeq ($(filter $(SIZE),small paper),)
$(error SIZE=$(SIZE): expected small or paper)
endif
BIG      := $(filter paper,$(SIZE))
FIG      := $(B0)/figures$(BIG:%=-%)
FIG_JOBS ?= $(shell nproc 2>/dev/null || echo 2)
sized     = $(if $(BIG),$(2),$(1))

.PHONY: figures figures-run figures-clean
# what a run took is written down even if it is stopped; one that finds everything made is not worth a line
figures:
	@mkdir -p $(FIG)
	+@trap 'times > $(FIG)/.times; awk -v wall=$$SECONDS -v size=$(SIZE) -v mb=$$(du -sm $(FIG) | cut -f1) -v day="$$(date "+%F %H:%M")" \
	    "NR == 2 {split(\$$1, u, /[ms]/); split(\$$2, k, /[ms]/); cpu = 60 * (u[1] + k[1]) + u[2] + k[2]} \
	     END {if (wall >= 5) printf \"%s  SIZE=%s  %d s, %.0f s of the CPU; %d MB on disk\\n\", day, size, wall, cpu, mb}" \
	    $(FIG)/.times >> $(FIG)/figures.txt; rm -f $(FIG)/.times' EXIT; \
	$(MAKE) --no-print-directory $(if $(findstring jobserver,$(MAKEFLAGS)),,-j$(FIG_JOBS)) figures-run
	@echo "The figures:"; ls -1 $(FIG)/*.png $(FIG)/*/figure.png | sed 's,^,  $(TOP)/,'; cat $(FIG)/figures.txt 2>/dev/null
figures-run: $(foreach n,04 05 06 07,$(FIG)/figure$(n).png) $(foreach n,10 11 12,$(FIG)/figure$(n)/figure.png $(FIG)/figure$(n)/shift.csv)
figures-clean:
	rm -rf $(FIG)

# 16 exposures from 1/16384 s to 2 s; at the small size every third of them, the same range
TIMES_16   := 1/16384 1/8192 1/4096 1/2048 1/1024 1/512 1/256 1/128 1/64 1/32 1/16 1/8 1/4 1/2 1 2
TIMES_6    := 1/16384 1/2048 1/256 1/32 1/4 2
LIGHT_ROOM := -ab 2 -aa .2 -ad 512 -as 128 -ar 48 -ds .1 -dj .6 -dt 0 -dc 1 -w
STUDIO     := scenes/demo/room.rad
FIG_PATH    = $(TOP)/scenes/$(1):$(TOP)/scenes/studio:$(TOP)/$(FIG)/$(1):$(TOP)/$(MODELS)

# ---- what the three have in common ---------------------------------------------------------------------
define figure_scene
$(1)_OUT      := $(FIG)/$(1)
$(1)_PATH     := $(call FIG_PATH,$(1))
$(1)_STAGE    := $(FIG)/$(1)/stage.oct
$(1)_TIMES    := $(call sized,$(TIMES_6),$(TIMES_16))
$(1)_LIGHT    := $(LIGHT_ROOM)
$(1)_PAINT    := scenes/demo/room_materials.rad
$(1)_OBJECTS  := scenes/$(1)/objects.rad
$(1)_VIEW     := scenes/$(1)/view.vf
$(1)_RES      := $(call sized,-x 640 -y 480,-x 1280 -y 960)
$(1)_LIGHT_photo := -ab 3 -aa .15 -ad 512 -as 128 -ar 64 -ds $(2) -dj .8 -dt 0 -dc 1
$(1)_LIGHT_with  := $(PICT_ILF) -ad 256
endef
# the fisheye on its stage: 30 x 30 inches at the table's height
define fisheye_scene
$(1)_NU       := $(call sized,$(2),30)
$(1)_NV       := $(call sized,$(2),30)
$(1)_PLANE    := -.381 -.381 0  .762 0 0  0 .762 0
$(1)_CAMERA   := --size $(call sized,256,1024) --supersample 2 --refine 8 --bits 8 --full-scale 1 --electrons 20000 --read-noise 8
$(1)_LENS     := equidistant 185
$(1)_FALLOFF  := scenes/demo/lens_falloff.txt
$(1)_CORRECT  := $(FIG)/falloff/measured.txt
$(1)_PROBE    := $(call sized,192x96,400x400)
$(1)_DISCARD  := $(BIG)
$(1)_TABLE    := scenes/demo/table.rad
endef
# its session, written where its results go: its values stand here, because there are two sizes of it
define fisheye_session
$(1)_SESSION  := $$($(1)_OUT)/session.conf
$(1)_NAMES    := $$($(1)_FALLOFF) $$($(1)_CORRECT)
$(1)_CONF      = $$(call session_text,$(1))
export $(1)_CONF
$$(eval $$(call settings_of,$$($(1)_SESSION),$(1)_CONF))
endef

# ---- figure 6: the lens's falloff, measured ----------------------------------------------------------------
# A small disc of constant radiance, 1 m away, at twenty-one angles from the axis to the horizon.
FALLOFF        := $(FIG)/falloff
FALLOFF_ANGLES := $(shell seq 0 4.5 90)
LENS_185       := --lens equidistant --fov 185
FALLOFF_CAMERA := $(LENS_185) --size 512 --bits 8 --full-scale 1 --electrons 20000 --read-noise 8 --response srgb
FALLOFF_SOURCE := ring disc 0 0 8  0 0 1  0 0 -1  0 .035
$(eval $(call settings,$(FALLOFF)/capture.settings,$(FALLOFF_CAMERA); $(FALLOFF_SOURCE)))
$(FALLOFF)/%.png: $(FALLOFF)/capture.settings scenes/demo/lens_falloff.txt $(call made_by,virtualcamera rtrace oconv xform) | $(FUNCTIONS)
	@mkdir -p $(@D)
	@{ printf 'void glow lamp 0 0 4 .8 .8 .8 0\n'; echo 'lamp $(FALLOFF_SOURCE)' | $(ILF_ENV) xform -ry $*; } \
	    | $(ILF_ENV) oconv -f - > $(FALLOFF)/$*.oct
	@$(ILF_ENV) $(call on,view,$@) virtualcamera --quiet --octree $(FALLOFF)/$*.oct --plane "-.5 -.5 0  1 0 0  0 1 0" --grid 1x1 --node 0,0 --seconds 1 \
	    $(FALLOFF_CAMERA) --falloff scenes/demo/lens_falloff.txt --render-options "-ab 0" -o $@
$(FALLOFF)/measured.txt: $(FALLOFF_ANGLES:%=$(FALLOFF)/%.png) $(call made_by,falloffcal)
	@$(ILF_ENV) falloffcal --quiet $(LENS_185) -o $@ $(foreach a,$(FALLOFF_ANGLES),$(FALLOFF)/$(a).png@$(a))

# ---- figure 10: mirror spheres -------------------------------------------------------------------------
$(eval $(call figure_scene,figure10,.05))
figure10_NU       := 12
figure10_NV       := 12
figure10_PLANE    := -.1397 -.1397 0  .2794 0 0  0 .2794 0
figure10_CAMERA_VIEW := -vtv -vp 0 0 3.5 -vd 0 0 -1 -vu 0 1 0 -vh 5.2 -vv 5.2 
# as a person outlines the four corner spheres, to the pixel
figure10_CORNERS  := "$(subst _,$(,),$(call sized,63_961_41 961_961_41 961_63_41 63_63_41,88_1352_57 1352_1352_57 1352_88_57 88_88_57))"
figure10_PIXELS   := $(call sized,1024,1440)
figure10_RAYS     := $(call sized,2,3)
figure10_LIGHT    := -ab 2 -aa .2 -ad 256 -as 64 -ar 128 -ds .1 -dj .5 -dt .05 -dc 1 -w -st 0 -lr 10 -lw 1e-3
figure10_ARRAY    := --camera-distance 3.50635 --diameter .0254 --reflectance .95,.95,.95
figure10_PROBE    := $(call sized,128x64,192x96)
figure10_LIT      := $(FIG)/figure10/with_room.lamps.hdr
figure10_SINGLE   := 6_6
figure10_ROOM     := scenes/figure10/room.rad scenes/figure10/lamps.rad
figure10_TABLE    := scenes/figure10/table.rad
figure10_CAPTURE_ONLY := scenes/figure10/spheres.rad
figure10_READS    := scenes/figure10/lamp_warm.rad scenes/figure10/lamp_cool.rad scenes/figure10/bead.rad scenes/studio/profile.cal
$(eval $(call array_light_field,figure10))
$(eval $(call light_field_pictures,figure10))

# ---- figure 11: two lamps and a card -------------------------------------------------------------------
$(eval $(call figure_scene,figure11,.02))
$(eval $(call fisheye_scene,figure11,8))
figure11_LIT      := $(FIG)/figure11/with_room.lamps.hdr
figure11_SINGLE   := $(call sized,1_4,4_16)
figure11_ROOM     := $(STUDIO) scenes/figure11/lamps.rad
figure11_READS    := scenes/figure11/lamp_yellow.rad scenes/figure11/lamp_blue.rad scenes/studio/profile.cal $(MODELS)/statue.rtm
$(eval $(call fisheye_session,figure11))
$(eval $(call light_field,figure11))
$(eval $(call light_field_pictures,figure11))

# ---- figure 12: dappled light --------------------------------------------------------------------------
$(eval $(call figure_scene,figure12,.01))
$(eval $(call fisheye_scene,figure12,12))
figure12_LIT      := $(FIG)/figure12/with_room.lamps.hdr
figure12_SINGLE   := $(call sized,6_6,15_15)
figure12_ROOM     := $(STUDIO) scenes/figure12/lamps.rad
figure12_HIDDEN   := scenes/figure12/branch.rad
figure12_READS    := scenes/figure12/lamp.rad scenes/figure12/branch_up.rad $(MODELS)/statue.rtm $(MODELS)/branch.rtm
$(eval $(call fisheye_session,figure12))
$(eval $(call light_field,figure12))
$(eval $(call light_field_pictures,figure12))

$(MODELS)/branch.obj: scenes/models/branch.py | $(VENV)/.packages
	@mkdir -p $(@D)
	@$(PY) $< --length .6 --leaf .10 --seed 2 -o $@

# ---- the figures ---------------------------------------------------------------------------------------
# $(call compared,NAME,TITLE,WHAT THE LIGHT FIELD IS,WHAT THE SINGLE PROBE IS)
define compared
$(FIG)/$(1)/figure.png: $(FIG)/$(1)/photo.hdr $(FIG)/$(1)/with_room.hdr $($(1)_LIT) $(FIG)/$(1)/with_single.hdr $(FIG)/$(1)/mask.hdr \
        $(FIG)/$(1)/room.mosaic.png scenes/compare.py scenes/pictures.py scenes/rgbe.py | $(VENV)/.packages
	@$(PY) scenes/compare.py --reference "(a) Photograph: the room itself=$(FIG)/$(1)/photo.hdr" \
	    --picture "(b) Incident light field$(,) $(3)=$(FIG)/$(1)/with_room.hdr" \
	    --picture "With $$(call lamps_in,$(FIG)/$(1)/room.lamps.ilf.exr)=$($(1)_LIT)" \
	    --picture "(c) Single probe$(,) $(4)=$(FIG)/$(1)/with_single.hdr" --mask $(FIG)/$(1)/mask.hdr --title "$(2)" \
	    --extra "the light field: each rectangle a probe=$(FIG)/$(1)/room.mosaic.png" --csv $(FIG)/$(1)/errors.csv -o $$@
$(FIG)/$(1)/shift.csv: $(FIG)/$(1)/photo.hdr $(FIG)/$(1)/with_room.hdr $(FIG)/$(1)/mask.hdr scenes/shift.py scenes/compare.py scenes/pictures.py scenes/rgbe.py | $(VENV)/.packages
	@$(PY) scenes/shift.py --reference $(FIG)/$(1)/photo.hdr --mask $(FIG)/$(1)/mask.hdr \
	    --picture "Incident light field=$(FIG)/$(1)/with_room.hdr" -o $$@
endef
$(eval $(call compared,figure10,Figure 10: two spotlights$(,) captured with 12 × 12 mirror spheres,12 × 12 mirror spheres,the middle sphere))
$(eval $(call compared,figure11,Figure 11: a yellow spotlight and a blue light behind a card,$(figure11_NU) × $(figure11_NV) probes,from the blue light))
$(eval $(call compared,figure12,Figure 12: dappled light under a branch,$(figure12_NU) × $(figure12_NV) probes,the middle one))

# ---- figures 4 to 7 --------------------------------------------------------------------------------------
$(FIG)/figure04.png: $(FIG)/figure10/room.mosaic.png $(FIG)/figure10/spheres.exr scenes/compare.py scenes/pictures.py scenes/rgbe.py | $(VENV)/.packages
	@$(PY) scenes/compare.py --pane 520 --title "Figure 4: an array of 12 × 12 mirror spheres$(,) and the light field from it" \
	    --show "Photograph|$(words $(figure10_TIMES)) exposures merged$(,) 1/16384 s to 2 s=$(FIG)/figure10/spheres.exr@3" \
	    --show "The spheres found|circles drawn by fishremap --overlay=$(FIG)/figure10/overlay.png" \
	    --show "The light field|each rectangle is one sphere's hemisphere as a map$(,) pole in its top row=$(FIG)/figure10/room.mosaic.png" -o $@

# all sixteen exposures of one place, the middle of figure 11's table
$(eval $(call figure_scene,exposures,.02))
$(eval $(call fisheye_scene,exposures,1))
exposures_NU    := 1
exposures_NV    := 1
exposures_TIMES := $(TIMES_16)
exposures_STAGE := $(figure11_STAGE)
$(eval $(call fisheye_session,exposures))
$(eval $(call capture,exposures,capture))
SERIES := $(FIG)/exposures/nodes/0_0/times.txt
$(SERIES): $(FIG)/exposures/.taken ;+
$(FIG)/figure05.png: $(SERIES) scenes/plots.py scenes/compare.py scenes/pictures.py scenes/rgbe.py | $(VENV)/.packages
	@$(PY) scenes/plots.py strip --times $< --title "Figure 5: sixteen exposures of one place$(,) by the virtual fisheye" -o $@
$(FIG)/figure06.png: $(FALLOFF)/measured.txt scenes/plots.py scenes/compare.py scenes/pictures.py scenes/rgbe.py | $(VENV)/.packages
	@$(PY) scenes/plots.py falloff --measured $< --true scenes/demo/lens_falloff.txt \
	    --title "Figure 6: the lens's falloff$(,) measured with one source at $(words $(FALLOFF_ANGLES)) angles" -o $@
$(FIG)/figure07.png: $(FIG)/figure12/room.mosaic.png scenes/compare.py scenes/pictures.py scenes/rgbe.py | $(VENV)/.packages
	@$(PY) scenes/compare.py --pane 1200 --title "Figure 7: high-fidelity light field" \
	    --show "$(figure12_NU) × $(figure12_NV) probes of $(figure12_PROBE)|the dappled light of figure 12=$<" -o $@
