# Entry of the workflow, so that plain `snakemake` runs it in the root of the repository.
include: "workflow/Snakefile"


# Rules that a root Snakefile only includes are no targets of it.
rule everything:
    default_target: True
    input:
        rules.all.input,
