"""A laboratory's desk: files, recordings, design of experiments, live estimates, pages and the command line."""
