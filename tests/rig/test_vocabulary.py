"""Topics and errors: the tables that every room reads."""

import rig.errors
import rig.topics
from rig.errors import SvevError
from rig.topics import Topic


def _topics() -> list[Topic]:
    return [value for value in vars(rig.topics).values() if isinstance(value, Topic)]


def _errors() -> list[type[Exception]]:
    return [value for value in vars(rig.errors).values() if isinstance(value, type) and issubclass(value, Exception)]


def test_the_channels_of_the_contract_are_there() -> None:
    channels = {(topic.name, topic.schema, topic.encoding) for topic in _topics()}
    assert channels >= {
        ("/triplet", "foxglove.RawImage", "protobuf"),
        ("/triplet/tag", "svev.TripletTag", "json"),
        ("/events", "foxglove.Log", "protobuf"),
        ("/health", "svev.Health", "json"),
    }


def test_no_topic_is_named_twice() -> None:
    names = [topic.name for topic in _topics()]
    live = [topic.live for topic in _topics() if topic.live]
    assert len(names) == len(set(names))
    assert len(live) == len(set(live))


def test_no_live_topic_begins_like_another() -> None:
    # ZeroMQ subscribes by prefix: whoever asks for "event" would also get "events".
    live = [topic.live for topic in _topics() if topic.live]
    assert not [(a, b) for a in live for b in live if a != b and b.startswith(a)]


def test_every_error_ends_the_command_with_a_failure() -> None:
    for error in _errors():
        assert issubclass(error, SvevError)
        assert 1 <= error.exit_code < 128


def test_bad_input_ends_with_2() -> None:
    assert rig.errors.BadInputError.exit_code == 2
    assert rig.errors.CameraNotFoundError.exit_code == 2
