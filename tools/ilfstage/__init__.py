"""ilfstage: from a captured light field to the drive values of a stage's lights (man/ilfstage.1, docs/THEORY.md)."""
PROGRAM = "ilfstage"
