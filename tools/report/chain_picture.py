"""The chain command -> actuator -> force and moment -> motion -> sensor as a picture: five boxes, the likely lit."""

from html import escape

from glider.tools.diagnose.record import Place
from glider.tools.diagnose.stages import STAGES, stage_of

WIDTH = 360
BOX, GAP, TOP, TALL, LINE = 62.0, 12.5, 8, 48, 27
WRITTEN = {"force and moment": ("force,", "moment")}
MOST_PLACES, LEAST_PROBABILITY = 2, 0.05  # named under a box: how many, and how probable


def chain_svg(places: list[Place], certain: list[tuple[str, str]], doubt: bool) -> str:
    """The picture as an <svg> element.

    places: the likely ones; certain: places of further effects that are there beside the main one;
    doubt: the boxes are dashed, for a gap whose cause is not known.
    """
    tint = dict.fromkeys(STAGES, 0.0)
    named: dict[str, list[tuple[str, str]]] = {stage: [] for stage in STAGES}
    for place in places:
        stage, p = stage_of(place.subsystem, place.element), place.probability
        tint[stage] += p
        own = (place.subsystem, place.element)
        if p >= LEAST_PROBABILITY and own not in certain:
            named[stage].append((place.element, f"{100.0 * p:.0f} %"))
    for subsystem, element in certain:
        stage = stage_of(subsystem, element)
        tint[stage] = 1.0
        named[stage].append((element, "too"))
    said = (
        "; ".join(f"{stage}: {element} {share}" for stage in STAGES for element, share in named[stage])
        or "nothing stands out"
    )
    lines = min(max(len(found) for found in named.values()), MOST_PLACES)
    height = TOP + TALL + 8 + LINE * lines
    out = [
        f'<svg class="chain" viewBox="-1 0 {WIDTH + 2} {height}" role="img" aria-label="{escape(f"chain: {said}")}">'
    ]
    for n, stage in enumerate(STAGES):
        x = n * (BOX + GAP)
        out.append(_box(x, stage, min(tint[stage], 1.0), doubt))
        if n + 1 < len(STAGES):
            out.append(f'<path class="arrow" d="M{x + BOX + 1.5:.1f} {TOP + TALL / 2}h{GAP - 4:.1f}m-4 -4l4 4l-4 4"/>')
        out += _names(x + BOX / 2, named[stage][:MOST_PLACES])
    return "".join([*out, "</svg>"])


def _box(x: float, stage: str, tint: float, doubt: bool) -> str:
    """A stage: its frame, filled as strongly as it is probable, and its name."""
    style = "stage doubt" if doubt and tint >= LEAST_PROBABILITY else "stage"
    frame = f'x="{x:.1f}" y="{TOP}" width="{BOX}" height="{TALL}" rx="7"'
    parts = [f'<rect class="{style}" {frame}/>', f'<rect class="tint" fill-opacity="{tint:.2f}" {frame}/>']
    lines = WRITTEN.get(stage, (stage,))
    ink = "on" if tint > 0.5 else "off"
    for k, text in enumerate(lines):
        y = TOP + TALL / 2 + 4 + 13 * (k - (len(lines) - 1) / 2)
        parts.append(f'<text class="{ink}" x="{x + BOX / 2:.1f}" y="{y:.1f}" text-anchor="middle">{text}</text>')
    return "".join(parts)


def _names(x: float, named: list[tuple[str, str]]) -> list[str]:
    """Elements under a box, each with its probability."""
    out = []
    for k, (element, share) in enumerate(named):
        y = TOP + TALL + 14 + LINE * k
        x = min(max(x, 32.0), WIDTH - 32.0)
        out.append(f'<text class="element" x="{x:.1f}" y="{y}" text-anchor="middle">{escape(element)}</text>')
        out.append(f'<text class="chance" x="{x:.1f}" y="{y + 12}" text-anchor="middle">{share}</text>')
    return out
