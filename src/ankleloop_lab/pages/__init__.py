"""HTML pages that need no other files: rendered notebooks, and one page for each recording."""
