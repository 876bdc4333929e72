"""Names and prose use the field's terms (tests/data/language.toml); exceptions by file may only shrink."""

from tests.support.language import count_tree, exceptions, excess, rejected_in_code, rejected_in_prose


def test_no_file_holds_a_rejected_term_more_often_than_it_is_excepted():
    assert excess(count_tree(), exceptions()) == []


def test_the_exceptions_shrink_with_the_code():
    """An exception that nothing needs any more is taken out: `python -m tests.support.language`."""
    counts = count_tree()
    stale = [
        f"{path}: {word}"
        for path, words in exceptions().items()
        for word, most in words.items()
        if counts.get(path, {}).get(word, 0) < most
    ]
    assert stale == []


def test_the_lint_reads_names_strings_and_comments():
    source = 'def heat_of(HEAT, aHeat):  # the heat of a run\n    """Return what it promises."""\n    return "mended"\n'
    assert rejected_in_code(source) == {"heat (name)": 3, "heat": 1, "promises": 1}
    assert rejected_in_code("wheat = reheating_s\n") == {}
    assert rejected_in_prose("`inflation` is a name; heat is not") == {"heat": 1}
