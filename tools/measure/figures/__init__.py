"""Figures of the docs, each by `python -m glider.tools.measure.figures.NAME`: measured again when the code changes."""
