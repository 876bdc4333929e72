"""What holds for every page that is written: it opens offline."""

from html.parser import HTMLParser


class Tags(HTMLParser):
    """The tags of a page with their attributes."""

    def __init__(self):
        super().__init__()
        self.tags: list[tuple[str, dict]] = []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))


def assert_offline(page: str, scripts: int = 0) -> None:
    """Nothing is fetched: scripts stand in the page itself, links lead into it or hold their file."""
    parser = Tags()
    parser.feed(page)
    assert parser.tags
    assert sum(tag == "script" for tag, _ in parser.tags) == scripts
    for tag, attributes in parser.tags:
        assert tag not in ("link", "img", "iframe", "object")
        assert not {"src", "srcset"} & set(attributes)
        assert attributes.get("href", "#").startswith(("#", "data:application/toml"))
    assert "url(" not in page
    assert "@import" not in page
    assert "://" not in page
