"""The report: figures with their errors, error against run time, what each stage of the chain costs in accuracy.

    run        commands run once, with what they cost            measures   how far a picture is from another
    scene      the small scene that all sweeps share             probes     light probes without a camera
    fields     light fields made coarser                         plots, page  what a reader sees
    sweep_*    what is run, one file per question                __main__   the command line

Every number comes with the command that makes it again: a line for a shell at the project's top, after
`eval "$(make -s env)"`.
"""
