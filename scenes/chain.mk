# From a room to its light field: file rules that any scene can use.
#
#   octree of the room ──virtualcamera──► exposures ──hdrgen──► fisheye.exr ──fishremap──► probe.exr ──ilfpack──► room.ilf.exr
#
# $(eval $(call light_field,NAME)) makes them for the scene NAME, which says before
#
#   NAME_OUT      folder of everything that is made
#   NAME_STAGE    octree that the camera sees (the room without the objects)
#   NAME_NU _NV   grid nodes along u and v           NAME_PLANE   "Ox Oy Oz Ux Uy Uz Vx Vy Vz"
#   NAME_TIMES    exposure times, seconds            NAME_CAMERA  options of virtualcamera
#   NAME_LENS     --lens ... --fov ... (camera and remap alike)
#   NAME_FALLOFF  falloff file of the lens           NAME_RESPONSE  camera's response (camera and merge alike)
#   NAME_CORRECT  falloff as measured, for the remap (default: NAME_FALLOFF)
#   NAME_DISCARD  not empty: exposures and merged picture of a node are removed once its probe is there
#   NAME_LIGHT    ambient options of the renderer for what the camera sees
#   NAME_PROBE    size of a probe, n_theta x n_phi   NAME_SINGLE  I_J, the node of the single-probe light field
#
# Each node has a folder of its own and each step its file: a run that was stopped goes on where it was, and -j works.
# Programs are order-only: a rebuilt program alone does not throw a capture away (`make demo-clean` does).

# The environment of every step: our programs first, function files, then what the scenes bring.
ILF_ENV = PATH="$(TOP)/$(B)/bin:$$PATH" RAYPATH=.:$(TOP)/$(B0)/lib

upto = $(shell seq 0 $$(($(1) - 1)))
# our programs, and the function files that Radiance's read at their start
bins = $(1:%=$(B)/bin/%) $(if $(filter rpict rtrace oconv xform obj2mesh virtualcamera,$(1)),$(B0)/lib/.radiance)

# A file that says how things are made, and is written again only when that has changed: what depends on it
# is made anew after a change of settings, and only then.   $(eval $(call settings,FILE,TEXT))
.PHONY: FORCE
define settings
$(1): FORCE
	@mkdir -p $$(@D)
	@printf '%s\n' '$(2)' > $$@.$$$$$$$$; if cmp -s $$@.$$$$$$$$ $$@; then rm $$@.$$$$$$$$; else mv $$@.$$$$$$$$ $$@; fi
endef

# One probe for the whole scene.  Its node is the middle of a rectangle as large as the plane, so
# that the depth correction knows where it stood.   $(eval $(call single_probe,NAME,PROBE))
define single_probe
$($(1)_OUT)/single.ilf.exr: $(2) | $(call bins,ilfpack)
	@plane=$$$$(echo "$($(1)_PLANE)" | awk -v ij=$($(1)_SINGLE) -v n=$($(1)_NU) -v m=$($(1)_NV) \
	    '{split(ij, k, "_"); a = k[1] / (n - 1) - .5; b = k[2] / (m - 1) - .5; \
	      for (c = 1; c <= 3; c++) printf "%.9g ", $$$$c + a * $$$$(c + 3) + b * $$$$(c + 6); print $$$$4, $$$$5, $$$$6, $$$$7, $$$$8, $$$$9}'); \
	$$(ILF_ENV) ilfpack --quiet --grid 1x1 --plane "$$$$plane" --type half -o $$@ $$<
endef

define light_field
$(1)_NODES := $$(foreach j,$$(call upto,$($(1)_NV)),$$(foreach i,$$(call upto,$($(1)_NU)),$$(i)_$$(j)))
$$(eval $$(call settings,$($(1)_OUT)/capture.settings,$($(1)_NU)x$($(1)_NV) on $($(1)_PLANE); $($(1)_TIMES) s; \
    $($(1)_LENS) $($(1)_CAMERA) --response $($(1)_RESPONSE) --falloff $($(1)_FALLOFF); $($(1)_LIGHT)))
$$(eval $$(call settings,$($(1)_OUT)/probe.settings,$($(1)_PROBE)))

# Indirect light of the room, once, from the plane's middle and corners; each node starts from a copy.
$($(1)_OUT)/room.amb: $($(1)_STAGE) $($(1)_OUT)/capture.settings | $(call bins,virtualcamera rtrace)
	@echo "  capture: indirect light of the room"
	@rm -f $$@ $$@.part $$@.part.scene
	@for at in 1$(,)1 0$(,)0 2$(,)2 0$(,)2 2$(,)0; do \
	    $$(ILF_ENV):$$($(1)_PATH) virtualcamera --quiet --octree $($(1)_STAGE) --plane "$($(1)_PLANE)" --grid 3x3 --node $$$$at \
	        $($(1)_LENS) --size 160 --supersample 1 --render-options "$($(1)_LIGHT) -af $$@.part" -o $($(1)_OUT)/overture.exr; \
	done
	@rm -f $($(1)_OUT)/overture.exr $$@.part.scene
	@mv $$@.part $$@

$($(1)_OUT)/nodes/%/times.txt: $($(1)_OUT)/room.amb $($(1)_FALLOFF) | $(call bins,virtualcamera rtrace)
	@echo "  capture: node $$*, $(words $($(1)_TIMES)) exposures"
	@rm -rf $$(@D) && mkdir -p $$(@D) && cp $$< $$(@D)/room.amb
	@k=0; for t in $($(1)_TIMES); do \
	    $$(ILF_ENV):$$($(1)_PATH) virtualcamera --quiet --octree $($(1)_STAGE) --plane "$($(1)_PLANE)" \
	        --grid $($(1)_NU)x$($(1)_NV) --node $$(subst _,$$(,),$$*) --seconds $$$$t $($(1)_LENS) $($(1)_CAMERA) \
	        --falloff $($(1)_FALLOFF) --response $($(1)_RESPONSE) --cache $$(@D) \
	        --render-options "$($(1)_LIGHT) -af $$(@D)/room.amb" -o $$(@D)/e$$$$k.png; \
	    echo "e$$$$k.png $$$$t"; k=$$$$((k + 1)); \
	done > $$@.part
	@rm -f $$(@D)/*.pfm $$(@D)/room.amb $$(@D)/room.amb.scene
	@mv $$@.part $$@

$($(1)_OUT)/nodes/%/fisheye.exr: $($(1)_OUT)/nodes/%/times.txt | $(call bins,hdrgen)
	@$$(ILF_ENV) hdrgen --quiet --response $($(1)_RESPONSE) --times $$< -o $$@ $$(@D)/e*.png

# With NAME_DISCARD a probe depends on the room, not on the merged picture, which a make of its own makes and which goes again.
$($(1)_OUT)/nodes/%/probe.exr: $($(1)_OUT)/$(if $($(1)_DISCARD),room.amb,nodes/%/fisheye.exr) $(or $($(1)_CORRECT),$($(1)_FALLOFF)) $($(1)_OUT)/probe.settings | $(call bins,fishremap)
	$(if $($(1)_DISCARD),+@$$(MAKE) --no-print-directory $($(1)_OUT)/nodes/$$*/fisheye.exr)
	@$$(ILF_ENV) fishremap --quiet $($(1)_LENS) --size $($(1)_PROBE) --falloff $(or $($(1)_CORRECT),$($(1)_FALLOFF)) --polar-max 90 -o $$@ $$(@D)/fisheye.exr
	$(if $($(1)_DISCARD),@rm -f $$(@D)/e*.png $$(@D)/fisheye.exr $$(@D)/times.txt)

$($(1)_OUT)/room.ilf.exr: $$($(1)_NODES:%=$($(1)_OUT)/nodes/%/probe.exr) | $(call bins,ilfpack)
	@echo "  light field: $($(1)_NU) x $($(1)_NV) probes"
	@$$(ILF_ENV) ilfpack --quiet --grid $($(1)_NU)x$($(1)_NV) --plane "$($(1)_PLANE)" --type half -o $$@ $$^

$$(eval $$(call single_probe,$(1),$($(1)_OUT)/nodes/$($(1)_SINGLE)/probe.exr))
endef

# ---- an array of mirror spheres ---------------------------------------------------------------------------
#   octree with the spheres ──rpict──► spheres.hdr ──camera.py──► exposures ──hdrgen──► spheres.exr ──fishremap --array──► room.ilf.exr
#
# $(eval $(call array_light_field,NAME)): NAME_OUT _PATH _STAGE _NU _NV _PLANE _TIMES _LIGHT _PROBE _SINGLE as above, and
#
#   NAME_CAMERA_VIEW  view options of the array's photograph     NAME_PIXELS  its size (square)
#   NAME_RAYS         n: n x n rays a pixel                      NAME_CORNERS the corner spheres, as fishremap has them
#   NAME_ARRAY        further options of fishremap
define array_light_field
$$(eval $$(call settings,$($(1)_OUT)/capture.settings,$($(1)_CAMERA_VIEW) -x $($(1)_PIXELS) $($(1)_RAYS) rays $($(1)_LIGHT)))
$$(eval $$(call settings,$($(1)_OUT)/exposure.settings,$($(1)_TIMES) s))
$$(eval $$(call settings,$($(1)_OUT)/probe.settings,$($(1)_PROBE) $($(1)_PLANE) $$($(1)_CORNERS) $$($(1)_ARRAY)))
$(1)_BIG := $$(shell echo $$$$(($($(1)_PIXELS) * $($(1)_RAYS))))

$($(1)_OUT)/spheres.big.hdr: $($(1)_STAGE) $($(1)_OUT)/capture.settings scenes/timed.py | $(VENV)/.packages $(call bins,rpict)
	@echo "  capture: $($(1)_NU) x $($(1)_NV) mirror spheres"
	@$$(ILF_ENV):$$($(1)_PATH) $(PY) scenes/timed.py --log $($(1)_OUT)/spheres.json -o $$@ -- \
	    rpict $($(1)_CAMERA_VIEW) -x $$($(1)_BIG) -y $$($(1)_BIG) -ps 1 -pj 0 $($(1)_LIGHT) $$<
$($(1)_OUT)/spheres.hdr: $($(1)_OUT)/spheres.big.hdr | $(call bins,pfilt)
	@$$(ILF_ENV) pfilt -1 -x /$($(1)_RAYS) -y /$($(1)_RAYS) $$< > $$@.part
	@mv $$@.part $$@
$($(1)_OUT)/spheres/times.txt: $($(1)_OUT)/spheres.hdr $($(1)_OUT)/exposure.settings scenes/camera.py | $(VENV)/.packages
	@rm -rf $$(@D)
	@$(PY) scenes/camera.py $($(1)_TIMES:%=--seconds %) -o $$(@D) $$<
$($(1)_OUT)/spheres.exr: $($(1)_OUT)/spheres/times.txt | $(call bins,hdrgen)
	@$$(ILF_ENV) hdrgen --quiet --response srgb --times $$< -o $$@ $$(<D)/e*.png
$($(1)_OUT)/room.ilf.exr: $($(1)_OUT)/spheres.exr $($(1)_OUT)/probe.settings | $(call bins,fishremap)
	@echo "  light field: $($(1)_NU) x $($(1)_NV) spheres"
	@$$(ILF_ENV) fishremap --quiet --array $($(1)_NU)x$($(1)_NV) --corners $($(1)_CORNERS) $($(1)_ARRAY) --size $($(1)_PROBE) --plane "$($(1)_PLANE)" --type half \
	    --compression none --overlay $($(1)_OUT)/overlay.png --report $($(1)_OUT)/spheres.found.json -o $$@ $$<
$($(1)_OUT)/overlay.png: $($(1)_OUT)/room.ilf.exr ;
$($(1)_OUT)/single.probe.exr: $($(1)_OUT)/room.ilf.exr scenes/oneprobe.py | $(VENV)/.packages
	@$(PY) scenes/oneprobe.py --node $($(1)_SINGLE) -o $$@ $$<
$$(eval $$(call single_probe,$(1),$($(1)_OUT)/single.probe.exr))
endef
