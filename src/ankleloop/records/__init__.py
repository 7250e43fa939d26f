"""The trial and its files: contract, readers of a laboratory's containers, trial files, atomic writing, drift."""
