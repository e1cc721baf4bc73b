"""The page on what does not work quotes what the package prints."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
QUOTED = re.findall(r"^### `(.+)`$", (ROOT / "docs" / "start" / "faq.md").read_text(encoding="utf-8"), re.MULTILINE)


@pytest.fixture(scope="module")
def code() -> str:
    """All of the package, with literals that follow each other as one."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "holobench_eval").rglob("*.py")))
    constants = dict(re.findall(r'^([A-Z]+) = "(.*)"$', text, re.MULTILINE))
    joined = re.sub(r'"\s*\n\s*f?"', "", text)
    return re.sub(r"\{([A-Z]+)\}", lambda match: constants.get(match[1], match[0]), joined)


def test_ten_messages_are_quoted() -> None:
    assert len(QUOTED) >= 10


@pytest.mark.parametrize("message", QUOTED)
def test_a_quoted_message_is_one_of_the_package(code: str, message: str) -> None:
    assert all(part.strip() in code for part in message.split("..."))
