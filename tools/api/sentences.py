"""What the commands and `.summary()` print of a result, a line each."""

from typing import TYPE_CHECKING, Any

from glider.tools.data.runs.origin import flights_of, with_flight

if TYPE_CHECKING:  # a base install lists effects without the packages of an analysis
    from glider.sim_backend.core.effects.base import Effect
    from glider.tools.gap.assess import CaseGap
    from glider.tools.identify.ocean.identify import OceanIdentification
    from glider.tools.identify.pipeline import Identified
    from glider.tools.readings.findings import Finding
    from glider.tools.watch.answer import Sized, WatchAnswer

MOST_CAUSES, LEAST_PROBABILITY = 4, 0.01  # of a diagnosis: causes shown at most; the smallest probability shown


def gap_lines(found: "CaseGap") -> list[str]:
    """The gap, runs by channels, then the parts of the model."""
    channels, flights = list(found.channels), flights_of(found.case.runs)
    width = max(8, *(len(name) + 2 for name in channels))
    runs = {run.name: with_flight(run.name, flights) for run in found.runs}
    first = max(8, *(len(shown) + 2 for shown in runs.values()))

    def line(head: str, cells: list[str]) -> str:
        return head.ljust(first) + "".join(cell.rjust(width) for cell in cells)

    lines = [line("", [*channels, "total"])]
    for run in found.runs:
        cells = [f"{run.channels[name]:.2f}" if name in run.channels else "-" for name in channels]
        lines.append(line(runs[run.name], [*cells, f"{run.total:.2f}"]))
    lines.append(line("all", [*(f"{found.channels[name]:.2f}" for name in channels), f"{found.total:.2f}"]))
    lines += ["", "share of the squared gap"]
    for share in found.where:
        name = share.subsystem if share.subsystem == share.element else f"{share.subsystem} {share.element}"
        lines.append(f"  {100.0 * share.share:5.1f} %  {name}")
    return lines


def reading_lines(findings: "list[Finding]") -> list[str]:
    """The findings of a check of the readings."""
    if not findings:
        return ["nothing found: the readings agree with each other as far as these flights can show"]
    return [
        f"{one.finding:11}{one.text}{f'  [{one.label}]' if one.label else ''}{'  (corrected)' if one.mended else ''}"
        for one in findings
    ]


def verdict_lines(answer: Any) -> list[str]:
    """The verdict of a diagnosis (diagnosis.json), causes with their probabilities and groups, and the gap."""
    lines = [f"verdict: {answer['verdict']}{''.join(f', {label}' for label in answer['selected'])}"]
    for n, cause in enumerate(answer["causes"][:MOST_CAUSES]):
        if n == 0 or cause["probability"] >= LEAST_PROBABILITY:
            others = [label for label in cause["group"] if label != cause["label"]]
            confounded = f"  or {', '.join(others)}, which these data cannot distinguish" if others else ""
            lines.append(f"  {cause['probability']:.2f}  {cause['label']}{confounded}")
    totals = {name: answer["gap"][name]["total"] for name in ("before", "recalibrated", "after", "floor")}
    gaps = ", ".join(f"{name} {value:.2f}" for name, value in totals.items() if value is not None)
    return [*lines, f"gap in tolerances: {gaps}"]


def watch_lines(found: "WatchAnswer") -> list[str]:
    """The answer of a watch: runs, then events."""
    lines = []
    names = {run.run: with_flight(run.run, found.flights) for run in found.runs}
    width = max(map(len, names.values()), default=0)
    for run in found.runs:
        name = names[run.run].ljust(max(width, 12))
        if run.skipped is not None:
            lines.append(f"{name} skipped  {run.skipped}")
            continue
        causes = ", ".join(f"{cause.label} {size_text(cause.sized)}" for cause in run.causes[:2])
        gap = "-" if run.gap is None else f"{run.gap:.2f}"
        lines.append(f"{name} {run.verdict:8} gap {gap:>6}  {causes}".rstrip())
    lines.append("")
    if not found.events:
        lines.append("nothing changed, as far as these runs can show")
    for event in found.events:
        until = "and is still there" if event.to_run is None else f"to {names.get(event.to_run, event.to_run)}"
        place = f"{event.where[0]['subsystem']} {event.where[0]['element']}" if event.where else ""
        name = event.label or f"unknown ({place})"
        others = [label for label in event.group if label != event.label]
        confounded = f"; may as well be {', '.join(others)}" if others else ""
        size = size_text(event.sized)
        since = names.get(event.from_run, event.from_run)
        lines.append(f"{name} {size} from {since} {until}, {event.course}, {event.probability:.2f}{confounded}")
    return lines


def size_text(sized: "Sized") -> str:
    """A size with its 90 % interval and unit; empty where it has none."""
    if sized.size is None or sized.ci90 is None:
        return ""
    low, high = sized.ci90
    unit = "" if sized.unit in ("1", None) else f" {sized.unit}"
    return f"{sized.size:.3g}{unit} ({low:.3g} to {high:.3g})"


def identified_lines(found: "Identified") -> list[str]:
    """The coefficients of an identification, and what the runs cannot identify."""
    from glider.tools.identify.identifiability import sentences, unidentifiable_directions

    lines = []
    if found.held is not None:
        before, after = found.held.candidates[0].total, found.held.chosen.total
        lines.append(
            f"runs left out: {before:.2f} -> {after:.2f} tolerances, worst in {found.held.worst}; handed out: "
            f"{found.held.chosen.name} ({found.held.why})"
        )
    lines.append(f"{'':<6} {'mean':>10} {'sd':>9}   {'90 % interval':<22} {'R-hat':>6} {'ESS':>7}  unit")
    for one in found.coefficients:
        low, high = one.ci90
        interval = f"{low:.4g} to {high:.4g}"
        figures = f"{one.name:<6} {one.mean:>10.4g} {one.sd:>9.2g}   {interval:<22}"
        lines.append(f"{figures} {one.rhat:>6.3f} {one.ess:>7.0f}  {one.unit}")
    weak = unidentifiable_directions(found.free, found.chains.flat)
    return [*lines, *sentences(found.free, found.chains.flat), *(f"  {one.sentence()}" for one in weak)]


def ocean_lines(found: "OceanIdentification") -> list[str]:
    """The numbers of an ocean glider's identification."""
    lines = [f"{'':<18} {'mean':>11} {'sd':>9}   {'90 % interval':<24} unit"]
    for number in [*found.parameters, found.net_mass]:
        low, high = number.ci90
        interval = f"{low:.5g} to {high:.5g}"
        lines.append(f"{number.name:<18} {number.mean:>11.5g} {number.sd:>9.2g}   {interval:<24} {number.unit}")
    lines += [finding.sentence for finding in found.findings]
    lines += [weak_direction.sentence() for weak_direction in found.ridges]
    if found.next_run is not None:
        lines.append(f"to part them: {found.next_run['text']}")
    return [*lines, f"vertical water {100.0 * found.water_rms:.2f} cm/s rms over {len(found.water)} runs"]


def effect_lines(effects: "list[Effect]") -> list[str]:
    """Effects of the catalogue with their parameters: range, 1 sigma of the prior, unit."""
    lines = []
    for one in effects:
        lines.append(f"{one.label}  {one.summary} ({one.subsystem}: {one.element})")
        for p in one.parameters:
            unit = "" if p.unit in ("", "1") else f" {p.unit}"
            lines.append(f"    {p.name:<12} {p.low:g} to {p.high:g}{unit}, 1 sigma {p.spread:g}")
    return lines
