"""Tables over the trials of a study: all trials, means with intervals and faults, sweeps, captions."""
