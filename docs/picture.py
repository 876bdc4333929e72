"""Draw README's picture from a diagnosis: `python docs/picture.py ANSWER docs/pictures/diagnosis.png`.

Left, prediction errors of depth and pitch in a held-out flight, by the nominal and by the corrected model. Right, the
causes with their probabilities. The picture holds what it shows as text, so that a test compares it with the demo.
"""

import json
import sys
from pathlib import Path

import numpy as np

COLOURS = {"nominal": "tab:red", "corrected": "tab:blue"}
MOST_CAUSES = 4


def described(answer: Path) -> str:
    """What a diagnosis says, as far as the picture shows it: verdict, causes with probability, gaps."""
    found = json.loads((answer / "diagnosis.json").read_text())
    causes = [f"{one['label']} {one['probability']:.2f}" for one in found["causes"][:2]]
    gaps = [f"{name} {found['gap'][name]['total']:.2f}" for name in ("before", "after", "floor")]
    return "; ".join([found["verdict"], *causes, *gaps])


def written(picture: Path) -> str:
    """The text in a picture."""
    from PIL import Image

    with Image.open(picture) as image:
        return str(image.info.get("Description", ""))


def draw(answer: Path, picture: Path) -> None:
    """Draw the picture of a diagnosis."""
    from matplotlib.figure import Figure

    from glider.tools.inference.channels import ROUGHIE_MEASURES

    found = json.loads((answer / "diagnosis.json").read_text())
    curves = np.load(answer / "report.npz")
    figure = Figure(figsize=(9.6, 4.2), layout="constrained")
    axes = figure.subplot_mosaic([["depth", "causes"], ["pitch", "causes"]])
    for channel in (one for one in ROUGHIE_MEASURES.channels if one.name in axes):
        shown, column, band = axes[channel.name], channel.columns[0], channel.scale * channel.tolerance
        shown.axhspan(-band, band, color="0.9", label="tolerance")
        for table, colour in COLOURS.items():
            error = channel.scale * (curves[f"{table}_0"][:, column] - curves["measured_0"][:, column])
            shown.plot(curves["t_0"], error, color=colour, lw=1.2, label=table)
        shown.set(ylabel=f"{channel.name} error, {channel.unit}")
    axes["depth"].legend(frameon=False, fontsize=8, ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    axes["pitch"].set(xlabel="time in a held-out flight, s")
    causes = found["causes"][:MOST_CAUSES][::-1]
    axes["causes"].barh([one["label"] for one in causes], [one["probability"] for one in causes], color="tab:blue")
    axes["causes"].set(xlim=(0, 1), xlabel="probability of being the main cause")
    axes["causes"].set_title(
        "error on held-out flights, in tolerances: "
        f"{found['gap']['before']['total']:.2f} before, {found['gap']['after']['total']:.2f} after", fontsize=9,
    )  # fmt: skip
    picture.parent.mkdir(exist_ok=True)
    figure.savefig(picture, dpi=110, metadata={"Description": described(answer)})


if __name__ == "__main__":
    draw(Path(sys.argv[1]), Path(sys.argv[2]))
