# The scenes' rules on a cluster of two nodes that is brought up on this machine, and what its steps cost (needs slurmctld slurmd slurm-client munge).
.PHONY: test-slurm bench-scale
test-slurm: all $(VENV)/.ilf
	ILF_SLURM=1 ILF_BUILD=$(B) $(PY) -m pytest -q -rs -p no:cacheprovider tests/slurm $(TEST_ARGS)
bench-scale: all $(VENV)/.ilf
	ILF_BUILD=$(B) $(PY) bench/scale/scale.py
#?measures: test-slurm      the scenes' rules on a cluster of two nodes brought up on this machine
#?measures: bench-scale     work done against nodes and parts, the overhead of a step (docs/CLUSTER.md)
