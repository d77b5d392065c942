"""HTML pages as tests read them."""

import json
import re
from base64 import b64encode
from hashlib import sha256
from html.parser import HTMLParser

VOID = {"meta", "img", "br", "link", "input"}


class Page(HTMLParser):
    """Checks nesting; collects tags with their attributes, all text, and what scripts hold."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict]] = []
        self.open: list[str] = []
        self.text = ""
        self.scripts: list[tuple[dict, str]] = []
        self.feed(source)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] == ["script"]:
            self.scripts.append((self.tags[-1][1], data))
        elif self.open[-1:] != ["style"]:
            self.text += data

    @property
    def charts(self) -> list[dict]:
        """What the page draws itself."""
        return [json.loads(text) for attrs, text in self.scripts if "type" in attrs]

    @property
    def programs(self) -> list[str]:
        return [text for attrs, text in self.scripts if "type" not in attrs]


def assert_self_contained(source: str) -> Page:
    """Nothing is loaded from elsewhere, and no script runs but the page's own."""
    page = Page(source)
    assert not {"link", "iframe", "object", "base", "form"} & {tag for tag, _ in page.tags}
    for tag, attributes in page.tags:
        for name in ("src", "href", "srcset", "data", "action"):
            assert (attributes.get(name) or "data:").startswith("data:")
        assert not any(name.startswith("on") for name in attributes), tag
    assert "://" not in source
    assert not re.search(r"url\(|@import", source)
    (policy,) = [a["content"] for _, a in page.tags if "http-equiv" in a]
    assert policy.startswith("default-src 'none'; ")
    (program,) = page.programs
    digest = b64encode(sha256(program.encode()).digest()).decode()
    assert policy.endswith(f"script-src 'sha256-{digest}'")
    return page
