"""A Mermaid state diagram as a picture for the site: the states on a circle. A forge draws the text itself."""

import re
from pathlib import Path

import numpy as np

BLOCK = re.compile(r"```mermaid\nstateDiagram-v2\n(.*?)```", re.DOTALL)
EDGE = re.compile(r"^\s*(\w+) --> (\w+)$", re.MULTILINE)


def draw(block: str, path: Path) -> None:
    """Draw the states of a diagram and its transitions."""
    from matplotlib.figure import Figure

    edges = EDGE.findall(block)
    states = list(dict.fromkeys(state for edge in edges for state in edge))
    angles = np.pi / 2 - 2.0 * np.pi * np.arange(len(states)) / len(states)
    at = dict(zip(states, zip(1.5 * np.cos(angles), np.sin(angles), strict=True), strict=True))
    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    axis = figure.subplots()
    box = {"boxstyle": "round,pad=0.4", "facecolor": "#dde8f5", "edgecolor": "0.35"}
    boxes = {
        state: axis.text(*place, state, ha="center", va="center", fontsize=9, bbox=box).get_bbox_patch()
        for state, place in at.items()
    }
    for first, last in edges:
        ends = {"patchA": boxes[first], "patchB": boxes[last], "shrinkA": 2, "shrinkB": 2}
        arrow = {"arrowstyle": "-|>", "connectionstyle": "arc3,rad=0.12", "color": "0.35", **ends}
        axis.annotate("", at[last], at[first], arrowprops=arrow)
    axis.set(xlim=(-1.9, 1.9), ylim=(-1.2, 1.2))
    axis.axis("off")
    figure.savefig(path, metadata={"Date": None})


def drawn(text: str, picture: Path, link: str) -> str:
    """A page's text with its diagram as a picture, which is written to `picture`."""
    block = BLOCK.search(text)
    if block is None:
        return text
    draw(block[1], picture)
    return text.replace(block[0], f"![States and transitions, as in the table below]({link})")
