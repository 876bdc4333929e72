"""Figures of the docs, each by `python -m glider.tools.measure.figures.NAME`: measured again whenever the code has changed."""
