"""Animations go on by themselves, begin again or end, at any speed."""

import pytest

from viewer.scene.model import AnimationFacts, Pose
from viewer.state.motion import AnimationPlayback, chosen_animation

ANIMATIONS = (AnimationFacts("walk", 2.0), AnimationFacts("wave", 0.5))


def test_time_goes_on_at_a_speed_and_begins_again() -> None:
    playing = AnimationPlayback(is_playing=True, speed=0.5)
    assert playing.advance(ANIMATIONS, None, 1.0) == (Pose("walk", 0.5), playing)
    pose, after = playing.advance(ANIMATIONS, Pose("walk", 1.9), 1.0)
    assert (pose.animation, after) == ("walk", playing)
    assert pose.seconds == pytest.approx(0.4)
    assert playing.advance(ANIMATIONS, Pose("wave", 0.1), 0.2)[0].seconds == pytest.approx(0.2 / 2 + 0.1)


def test_without_repeating_it_stops_at_the_end() -> None:
    playing = AnimationPlayback(is_playing=True, repeats=False)
    pose, after = playing.advance(ANIMATIONS, Pose("walk", 1.9), 1.0)
    assert pose == Pose("walk", 2.0)
    assert not after.is_playing


def test_an_animation_of_one_moment_has_nothing_to_play() -> None:
    still = (AnimationFacts("still", 0.0),)
    pose, after = AnimationPlayback(is_playing=True).advance(still, None, 1.0)
    assert (pose, after.is_playing) == (Pose("still", 0.0), False)


def test_an_unknown_name_is_the_first_animation() -> None:
    assert chosen_animation(ANIMATIONS, Pose("run", 1.0)).name == "walk"
    assert chosen_animation(ANIMATIONS, Pose("wave", 1.0)).name == "wave"
