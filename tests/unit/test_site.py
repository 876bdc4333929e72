"""What makes the site beside Sphinx: links within it are checked, state diagrams are drawn."""

from docs.links import broken
from docs.states import drawn

DIAGRAM = "before\n```mermaid\nstateDiagram-v2\n    [*] --> A\n    A --> B\n    B --> A\n```\nafter\n"


def test_a_link_to_no_page_and_to_no_anchor_is_named(tmp_path):
    (tmp_path / "a.html").write_text('<a href="b.html#x">x</a><a href="b.html#y">y</a><a href="https://e.org/z">z</a>')
    (tmp_path / "b.html").write_text('<p id="x"></p><img src="c.png"><a href="#x"></a><a href="a.html"></a>')
    assert broken(tmp_path) == ["a.html: b.html#y", "b.html: c.png"]
    (tmp_path / "c.png").write_bytes(b"")
    assert broken(tmp_path) == ["a.html: b.html#y"]


def test_a_state_diagram_becomes_a_picture(tmp_path):
    text = drawn(DIAGRAM, tmp_path / "states.svg", "../states.svg")
    assert text.splitlines()[0] == "before"
    assert "(../states.svg)" in text
    assert "mermaid" not in text
    assert (tmp_path / "states.svg").read_text().count("<!-- A -->") == 1
    assert drawn("plain", tmp_path / "none.svg", "") == "plain"
