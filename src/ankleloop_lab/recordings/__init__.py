"""One recording of a laboratory: loop test, checks, analysis by every valid method, export."""
