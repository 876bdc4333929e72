"""A vehicle of the user's own: a model declared by names and units, and everything that is asked about it."""
