"""Figures of the docs, each by `python -m tools.figures.NAME`: measured again whenever the code has changed."""
