"""The trial: its contract, file formats that are read into trials, trial files, atomic writing, drift."""
