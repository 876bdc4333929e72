"""Results of sealed sets, as pages show them: generated from docs/results/*.json, which `challenge score --out` writes.

A set is added by committing its file and `python -m docs.generate`. The newest answered set of each kind stands in
docs/reference/figures.md and README.md, all of them in docs/archive/blind-sets.md.
"""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

from glider.tools.data.intervals import wilson
from glider.tools.verify.challenge.result import ResultFigure, SetResult, StatedProbability, read_results

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "docs" / "results"
PICTURE = ROOT / "docs" / "pictures" / "calibration.png"
NO_BREAK = "\N{NO-BREAK SPACE}"  # within a number of a narrow table
BINS = (0.0, 0.5, 0.8, 0.9, 0.95, 1.0)  # of stated probability
WORDS = {
    "no_gap_called_gap": "unchanged cases called a gap",
    "unchanged_called_cause": "unchanged cases called a cause",
    "unchanged_called_unknown": "unchanged cases called unknown",
    "right_cause_first": "right cause most probable",
    "in_first_three": "right cause among the first three",
    "right_subsystem": "right subsystem",
    "two_both_named": "both of two effects",
    "unknown_called_unknown": "unmodelled effects reported as unknown",
    "known_called_unknown": "catalogue effects reported as unknown",
    "small_sure": "no large effect, but sure (> 0.8) of one",
    "sure_and_wrong": "sure (> 0.8) and wrong",
    "log_loss": "log loss, nat",
    "unchanged_called": "unchanged runs called changed",
    "changed_found": "changed runs detected",
    "bounds": "first and last changed run right to one run",
    "label": "right cause",
    "label_or_twin": "right cause, or one that is indistinguishable from it",
    "size": "size within its 90 % interval",
    "outside_unknown": "unmodelled changes reported as unknown",
    "velocity": "mean speed of a dive within its 90 % interval",
}
COUNTED = {
    "single": "with one effect", "pairs": "with two", "none": "without an effect",
    "unknown": "with an effect outside the catalogue",
    "changed": "changed by an effect of the catalogue", "outside": "changed outside the catalogue",
    "vehicles": "vehicles", "unchanged": "unchanged", "runs": "runs each", "reference": "reference runs each",
}  # fmt: skip
CELLS = {  # columns of the archive
    "single": ("right_cause_first", "in_first_three", "no_gap_called_gap", "unknown_called_unknown",
               "known_called_unknown", "two_both_named", "sure_and_wrong", "log_loss"),
    "messy": ("right_cause_first", "in_first_three", "small_sure", "unknown_called_unknown", "known_called_unknown",
              "sure_and_wrong", "log_loss"),
    "watch": ("unchanged_called", "changed_found", "bounds", "label", "size", "outside_unknown"),
    "ocean": ("unchanged_called", "changed_found", "bounds", "label_or_twin", "size", "outside_unknown", "velocity"),
    "form": ("unchanged_called_cause", "unchanged_called_unknown", "right_cause_first", "in_first_three",
             "unknown_called_unknown", "known_called_unknown", "sure_and_wrong"),
}  # fmt: skip
HEADS = {
    "no_gap_called_gap": "none", "unchanged_called_cause": "unchanged: cause", "unchanged_called_unknown": "unknown",
    "right_cause_first": "first", "in_first_three": "top 3", "two_both_named": "pairs, both",
    "unknown_called_unknown": "unknown", "known_called_unknown": "false unknown", "small_sure": "none",
    "sure_and_wrong": "sure and wrong", "log_loss": "log loss", "unchanged_called": "false alarms",
    "changed_found": "detected", "bounds": "interval", "label": "cause", "label_or_twin": "cause", "size": "size",
    "outside_unknown": "unknown", "velocity": "speed",
}  # fmt: skip
SUMMARY = (  # rows of README: words, kind, figures
    ("right cause, one effect", "single", ("right_cause_first",)),
    ("right cause, one large and four small effects", "messy", ("right_cause_first",)),
    ("unmodelled effect reported as unknown, the same flights", "messy", ("unknown_called_unknown",)),
    ("unchanged flights called changed; changed ones detected", "watch", ("unchanged_called", "changed_found")),
    ("vehicles of another form: right cause; unmodelled called unknown", "form",
     ("right_cause_first", "unknown_called_unknown")),
)  # fmt: skip


def all_results() -> list[SetResult]:
    """Every committed result."""
    return read_results(RESULTS)


def newest(results: Iterable[SetResult], kind: str) -> SetResult:
    """The set of a kind that was scored last; of those of one minute the one with the largest seed."""
    answered = [one for one in results if one.kind == kind and one.figures and one.standing]
    return max(answered, key=lambda one: (one.date or "", one.seed))


def share(figure: ResultFigure) -> str:
    """The figure as pages show it: count/of, or the value."""
    return f"{figure.value:.2f}" if figure.count is None else f"{figure.count}/{figure.of}"


def interval(figure: ResultFigure) -> str:
    """Wilson's 90 % interval in per cent; empty for a value."""
    if figure.ci90 is None:
        return ""
    low, high = (100.0 * end for end in figure.ci90)
    digits = 1 if high < 2.0 else 0
    return f"{low:.{digits}f} to {high:.{digits}f} %".replace(" ", NO_BREAK)


def target(figure: ResultFigure) -> tuple[str, str]:
    """The target with its bound, and whether it is met."""
    if figure.target is None:
        return "", ""
    bound = "<=" if figure.bound == "at most" else ">="
    wanted = f"{figure.target:g}" if figure.count is None else f"{100.0 * figure.target:.0f} %"
    return f"{bound} {wanted}".replace(" ", NO_BREAK), "met" if figure.met else "missed"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Render a Markdown table."""
    return "".join("| " + " | ".join(row) + " |\n" for row in (head, ["---"] * len(head), *rows))


def block(result: SetResult) -> str:
    """A set of docs/reference/figures.md: what it is, its figures, its note."""
    counts = ", ".join(f"{result.counts[key]} {words}" for key, words in COUNTED.items() if result.counts.get(key))
    day = (result.date or "")[:10]
    text = f"Version {result.commit}, {day}, set {result.seed}" + (f": {counts}.\n\n" if counts else ".\n\n")
    rows = [
        (words, share(figure), interval(figure), *target(figure))
        for key, words in WORDS.items()
        if (figure := result.figures.get(key))
    ]
    text += table(("measure", "result", "90 %", "target", ""), rows)
    return text + (f"\n{result.note}\n" if result.note else "")


def archive(results: Iterable[SetResult], kind: str) -> str:
    """The sets of one kind, a row each, as docs/archive/blind-sets.md has them."""
    keys = CELLS[kind]
    rows = []
    for one in (one for one in results if one.kind == kind):
        commit = one.commit or "not answered"
        cells = [share(figure) if (figure := one.figures.get(key)) else "-" for key in keys]
        seed = ", ".join(filter(None, (one.seed, one.answered)))
        commit += "" if one.standing else ", whose change was removed again"
        rows.append((seed, commit, *cells, f"`{one.answers_sha256}`" if one.answers_sha256 else "-"))
    return table(("seed", "commit", *(HEADS[key] for key in keys), "SHA-256 of the answers"), rows)


def summary(results: Sequence[SetResult]) -> str:
    """The table of README."""
    rows = []
    for words, kind, keys in SUMMARY:
        found = newest(results, kind)
        figures = [found.figures[key] for key in keys]
        cells = ["; ".join(map(share, figures)), "; ".join(map(interval, figures))]
        rows.append((f"{words} ({found.commit})", *cells))
    return table(("", "result", "90 %"), rows)


def calibration(results: Iterable[SetResult]) -> list[tuple[float, float, list[StatedProbability]]]:
    """Stated probabilities of all sets by bin: its ends and those in it."""
    stated = [one for result in results for one in result.stated]
    return [
        (low, high, found)
        for low, high in pairwise(BINS)
        if (found := [one for one in stated if low < one.probability <= high])
    ]


def mean_stated(found: Sequence[StatedProbability]) -> float:
    """Mean of the probabilities stated."""
    return sum(one.probability for one in found) / len(found)


def calibration_table(results: Sequence[SetResult]) -> str:
    """Stated probability against frequency, a row a bin."""
    sets = ", ".join(f"{one.kind} {one.seed} ({one.commit})" for one in results if one.stated)
    rows = []
    for low, high, found in calibration(results):
        right = sum(one.right for one in found)
        ends = wilson(right, len(found))
        rows.append(
            (f"{low:g}-{high:g}", f"{mean_stated(found):.3f}", f"{right}/{len(found)}", f"{right / len(found):.3f}",
             f"{ends[0]:.2f}-{ends[1]:.2f}")
        )  # fmt: skip
    head = ("stated", "mean stated", "right", "frequency", "90 %")
    return f"Sets: {sets}.\n\n" + table(head, rows)


def draw_calibration(results: Sequence[SetResult]) -> None:
    """Draw the calibration; the picture holds its table as text, by which a test compares it with the results."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6, 4.2), layout="constrained")
    axis = figure.subplots()
    axis.plot((0, 1), (0, 1), color="0.6", lw=1, label="calibrated")
    for _, _, found in calibration(results):
        right = sum(one.right for one in found)
        low, high = wilson(right, len(found))
        x, y = mean_stated(found), right / len(found)
        axis.errorbar(x, y, yerr=[[y - low], [high - y]], fmt="o", color="tab:blue", capsize=3)
        axis.annotate(str(len(found)), (x, y), textcoords="offset points", xytext=(-7, -3), ha="right", fontsize=8)
    axis.set(xlim=(0, 1.02), ylim=(0, 1.02), xlabel="stated probability of the main cause", ylabel="frequency right")
    axis.legend(frameon=False, loc="upper left")
    figure.savefig(PICTURE, dpi=110, metadata={"Description": calibration_table(results)})


def blocks() -> dict[Path, dict[str, str]]:
    """The generated blocks of each page, by name."""
    results = all_results()
    return {
        ROOT / "docs" / "reference" / "figures.md": {
            **{kind: block(newest(results, kind)) for kind in CELLS}, "calibration": calibration_table(results),
        },
        ROOT / "docs" / "archive" / "blind-sets.md": {kind: archive(results, kind) for kind in CELLS},
        ROOT / "README.md": {"results": summary(results)},
    }  # fmt: skip


def with_blocks(page: str, texts: dict[str, str]) -> str:
    """The page with its generated blocks as they should be; KeyError where the page has not got one of them."""
    for name, text in texts.items():
        begin = f"<!-- generated by docs/generate.py: {name} -->\n"
        if begin not in page:
            raise KeyError(name)
        head, _, rest = page.partition(begin)
        page = head + begin + text + "<!-- end -->" + rest.partition("<!-- end -->")[2]
    return page


def write_pages() -> None:
    """Write the generated blocks into their pages, and the picture."""
    for page, texts in blocks().items():
        page.write_text(with_blocks(page.read_text(encoding="utf-8"), texts), encoding="utf-8")
    draw_calibration(all_results())
