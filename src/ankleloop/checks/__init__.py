"""Whether data can show what an identification asks of them."""
