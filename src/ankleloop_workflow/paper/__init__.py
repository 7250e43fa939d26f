"""The claims of the paper, how each is checked, the ledger, tables and captions."""
