"""Puts several sentences, or several words, into one."""

from collections.abc import Sequence

from rig.phrase import NOTHING, Phrase, phrase


def in_turn(said: Sequence[Phrase]) -> Phrase:
    """Sentences one after the other, as "one; another"; nothing if there is none."""
    if len(said) < 2:
        return said[0] if said else NOTHING
    return phrase("sentences", "{first}; {rest}", first=said[0], rest=in_turn(said[1:]))


def enumerated(said: Sequence[Phrase]) -> Phrase:
    """What belongs to one sentence, as "one, another"; nothing if there is none."""
    if len(said) < 2:
        return said[0] if said else NOTHING
    return phrase("enumeration", "{first}, {rest}", first=said[0], rest=enumerated(said[1:]))
