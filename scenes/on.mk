# Where expensive steps run: here, or with ON=slurm as jobs of Slurm's (slurm.sh, docs/CLUSTER.md).
#
#   make ... ON=slurm [SLURM="-p short --time=20"] [SLURM_render="--mem=4G"] -jN
#
# A recipe says which of its commands is an expensive step of which name, and what it writes; without ON that says nothing.
#   $(call on,NAME,OUT) COMMAND ARG...
ON_RULES := $(patsubst %/,%,$(dir $(lastword $(MAKEFILE_LIST))))
# (a shell's own variable of this name is not meant)
ON := $(if $(filter environment,$(origin ON)),,$(ON))
$(if $(filter-out slurm,$(ON)),$(error ON=$(ON): expected slurm, or nothing))
ifneq ($(ON),)
$(if $(shell command -v srun),,$(error ON=slurm: expected Slurm's srun on the path (package slurm-client), found none))
on = SLURM='$(SLURM) $(SLURM_$(1))' bash $(ON_RULES)/slurm.sh $(1) $(2)
endif
