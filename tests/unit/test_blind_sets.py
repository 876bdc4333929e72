"""Results of sealed sets: pages, picture and README show what the files of docs/results hold."""

import pytest

from docs import blind_sets
from docs.picture import written
from glider.tools.data.errors import InputError
from glider.tools.data.intervals import wilson
from glider.tools.verify.challenge.diagnosis import AnsweredCause, AnswerFile
from glider.tools.verify.challenge.result import SetResult, StatedProbability, answered_by, as_file, result_of
from glider.tools.verify.challenge.score import ScoredCase, score
from glider.tools.verify.challenge.seal import seal

RESULTS = blind_sets.all_results()


@pytest.mark.parametrize(("page", "texts"), blind_sets.blocks().items(), ids=lambda one: getattr(one, "name", ""))
def test_a_page_shows_the_committed_results(page, texts):
    text = page.read_text(encoding="utf-8")
    assert blind_sets.with_blocks(text, texts) == text, "python -m docs.generate"


def test_the_picture_is_of_the_committed_results():
    assert written(blind_sets.PICTURE) == blind_sets.calibration_table(RESULTS), "python -m docs.generate"


@pytest.mark.parametrize("result", RESULTS, ids=lambda one: f"{one.kind}-{one.seed}")
def test_the_figures_of_a_set_agree_with_each_other(result):
    assert result.commit or not result.figures
    for figure in result.figures.values():
        if figure.count is not None:
            assert figure.value == pytest.approx(figure.count / figure.of)
            assert figure.ci90 == pytest.approx(wilson(figure.count, figure.of))
        if figure.target is not None:
            reached = figure.value <= figure.target if figure.bound == "at most" else figure.value >= figure.target
            assert figure.met == reached


def test_the_newest_set_is_an_answered_one_of_a_version_that_stands():
    def made(seed, date, **more):
        figures = {"right_cause_first": RESULTS[0].figures["right_cause_first"]} if date else {}
        return SetResult("form", seed, None, "c0ffee0", date, figures=figures, **more)

    sets = [made("1", "2026-01-02"), made("2", "2026-01-01"), made("3", "2026-01-03", standing=False), made("4", None)]
    assert blind_sets.newest(sets, "form").seed == "1"


def test_stated_probabilities_are_counted_by_bin():
    stated = [StatedProbability(0.85, True), StatedProbability(0.9, False), StatedProbability(0.91, True)]
    bins = blind_sets.calibration([SetResult("form", "1", None, stated=stated)])
    assert [(low, high, sum(one.right for one in found), len(found)) for low, high, found in bins] == [
        (0.8, 0.9, 1, 2), (0.9, 0.95, 1, 1),
    ]  # fmt: skip


def said(label, probability):
    return AnswerFile(1, "cause", [], [AnsweredCause(label, probability), AnsweredCause("other", 1 - probability)], [])


def test_a_score_becomes_a_result_with_seed_hash_and_the_version_that_answered(tmp_path):
    truth = {"labels": ["drag"], "places": [[["hydrodynamics", "surge"]]], "secret": []}
    sha = seal(tmp_path / "answers.zip", {"seed": 7, "counts": {"single": 2}}, {"a": truth, "b": truth})
    scored = score([ScoredCase("a", truth, said("drag", 0.9)), ScoredCase("b", truth, said("lift", 0.7))])
    for name, commit in (("a", "1234567"), ("b", "89abcde")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "timing.json").write_text(f'{{"seconds": 1.0, "commit": "{commit}"}}')
    found = result_of(scored, "single", tmp_path / "answers.zip", tmp_path, None)
    assert (found.kind, found.seed, found.answers_sha256, found.counts) == ("single", "7", sha, {"single": 2})
    assert found.commit == "1234567, 89abcde"
    assert found.figures["right_cause_first"].ci90 == pytest.approx(wilson(1, 2))
    assert found.stated == [StatedProbability(0.9, True), StatedProbability(0.7, False)]
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "single-7.json").write_bytes(as_file(found))
    assert blind_sets.read_results(tmp_path / "results") == [found]
    assert result_of(scored, "single", tmp_path / "answers.zip", tmp_path, "fedcba9").commit == "fedcba9"


def test_answers_that_name_no_version_ask_for_it(tmp_path):
    with pytest.raises(InputError, match="--commit"):
        answered_by(tmp_path, ["a"])


def test_a_file_that_is_no_result_is_named(tmp_path):
    (tmp_path / "x.json").write_text('{"kind": "single"}')
    with pytest.raises(InputError, match="seed"):
        blind_sets.read_results(tmp_path)
