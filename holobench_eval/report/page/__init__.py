"""report.html: the numbers and pictures of a study in one file, to sort, to filter and to look at; no network."""

from .html import write_page

__all__ = ["write_page"]
