"""Files of laboratories: one reader for each format, and how their variables become a trial."""
