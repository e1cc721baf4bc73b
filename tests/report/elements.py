"""The elements of a page as a browser finds them."""

from html.parser import HTMLParser

Attributes = dict[str, str | None]


class Elements(HTMLParser):
    """The elements of a page, its text, and the texts of its scripts and titles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, Attributes]] = []
        self.scripts: list[tuple[Attributes, str]] = []
        self.titles: list[str] = []
        self.text = self.inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        self.inside = tag

    def handle_endtag(self, tag: str) -> None:
        self.inside = ""

    def handle_data(self, data: str) -> None:
        if self.inside == "script":
            self.scripts.append((self.found[-1][1], data))
        elif self.inside == "title":
            self.titles.append(data)
        self.text += data

    def values(self, *names: str) -> list[str]:
        """Of the attributes of these names that have one."""
        return [str(given[name]) for _, given in self.found for name in names if given.get(name)]

    @property
    def policy(self) -> str:
        """The content security policy."""
        return next(str(given["content"]) for _, given in self.found if "http-equiv" in given)

    def opens_nothing(self) -> bool:
        """Whether no element runs anything or has a style of its own, which the policy would not take."""
        return not any(name.startswith("on") or name == "style" for _, given in self.found for name in given)
