"""Figures of the docs, each by `python -m glider.tools.verify.figures.NAME`: measured again when the code changes."""
