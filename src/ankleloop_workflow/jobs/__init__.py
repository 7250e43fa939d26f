"""What the jobs of the workflow do, the fingerprint of their code, and the record of a run."""
