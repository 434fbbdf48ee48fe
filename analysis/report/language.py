"""The coach's page in English and Norwegian: both stand in it, and `html[lang]` says which is shown."""

import re
from datetime import datetime
from html import escape
from typing import Final, Literal, NamedTuple

from analysis.report.norwegian import SENTENCES
from analysis.result.model import Verdict
from rig.phrase import Phrase, Value

Language = Literal["en", "nb"]
LANGUAGES: Final[tuple[Language, ...]] = ("en", "nb")


_MONTHS: Final = (
    "januar", "februar", "mars", "april", "mai", "juni", "juli", "august", "september", "oktober", "november",
    "desember",
)  # fmt: skip


class Said(NamedTuple):
    """The same in both languages."""

    english: str
    norwegian: str

    def of(self, language: Language) -> str:
        """In one of them."""
        return self.english if language == "en" else self.norwegian


def same(text: str) -> Said:
    """What is the same in both languages, e.g. a name."""
    return Said(text, text)


def day_of(then: datetime) -> Said:
    """A date."""
    return Said(f"{then:%-d %B %Y}", f"{then.day}. {_MONTHS[then.month - 1]} {then.year}")


def shown(words: Said, tag: str = "span") -> str:
    """An element for each language, of which the page shows one; one without a language where they are the same."""
    if words.english == words.norwegian:
        return f"<{tag}>{escape(words.english)}</{tag}>"
    return "".join(f'<{tag} lang="{language}">{escape(words.of(language))}</{tag}>' for language in LANGUAGES)


def attribute(name: str, words: Said) -> str:
    """An attribute such as `aria-label` in English, with the Norwegian one beside it for the page's script."""
    return f'{name}="{escape(words.english)}" data-en="{escape(words.english)}" data-nb="{escape(words.norwegian)}"'


def said(sentence: Phrase) -> Said:
    """A sentence of the analysis; in English in both where there is no Norwegian one."""
    return Said(sentence.text, _norwegian(sentence))


def sentences(all_of_them: tuple[Phrase, ...]) -> Said:
    """Sentences one after the other."""
    words = [said(each) for each in all_of_them]
    return Said("; ".join(each.english for each in words), "; ".join(each.norwegian for each in words))


def reasons(verdict: Verdict) -> Said:
    """What a verdict rests on."""
    return sentences(verdict.said) if verdict.said else same(verdict.message.removeprefix("measured well: "))


def with_comma(svg: str) -> str:
    """A drawing with decimal commas in its texts."""
    return re.sub(r"(?<=>)[^<>]+(?=</text>)", lambda text: re.sub(r"(?<=\d)\.(?=\d)", ",", text[0]), svg)


def _norwegian(sentence: Phrase) -> str:
    template = SENTENCES.get(sentence.code)
    if template is None:
        return sentence.text
    return re.sub(r"\{(\w+)\}", lambda name: _filled(sentence.values[name[1]]), template)


def _filled(value: Value) -> str:
    """As the panel's page does: one digit after the point, two digits of what is less than one."""
    if isinstance(value, Phrase):
        return _norwegian(value)
    if not isinstance(value, float):
        return str(value)
    text = f"{value:.2g}" if abs(value) < 1 else f"{value:.1f}".removesuffix(".0")
    return text.replace(".", ",")
