"""Files that are damaged at random, and the readers that must refuse or read them."""
