"""What the rules, scripts and notebooks of the workflow call: configuration, jobs, tables, claims, pages."""
