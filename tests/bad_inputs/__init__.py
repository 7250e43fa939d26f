"""The table of bad inputs, by subject: what the library must do with each of them.

There is a row for each class of fault, and each container or call where a laboratory or the author of a configuration
meets it. A module holds the rows of one subject in `ROWS`; tests/unit/test_bad_inputs.py runs them.
"""
