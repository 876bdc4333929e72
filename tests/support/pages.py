"""What holds for every page that is written: it opens offline."""

from html.parser import HTMLParser


class Tags(HTMLParser):
    """The tags of a page with their attributes."""

    def __init__(self):
        super().__init__()
        self.tags: list[tuple[str, dict]] = []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))


def assert_offline(page: str) -> None:
    """Nothing is fetched and no script runs."""
    parser = Tags()
    parser.feed(page)
    assert parser.tags
    for tag, attributes in parser.tags:
        assert tag not in ("script", "link", "img", "iframe", "object")
        assert not {"src", "href", "srcset"} & set(attributes)
    assert "url(" not in page
    assert "@import" not in page
    assert "://" not in page
