"""Commands for the animations of the scene."""

from dataclasses import replace
from typing import Annotated

from viewer.commands.command import Arg, command, field_command, unless
from viewer.scene.model import Pose
from viewer.state.motion import chosen_animation
from viewer.state.session import Session

LONGEST_SECONDS = 1e6


_animated = unless(lambda context: context.session.scene.animations, "the scene has no animations")


def _set_pose(session: Session, pose: Pose | None) -> None:
    session.view = replace(session.view, pose=pose)


Seconds = Annotated[float, Arg("time in seconds from the beginning", None, 0.0, LONGEST_SECONDS)]
AnimationName = Annotated[
    str, Arg("animation of the scene; default: the shown one", lambda s: tuple(a.name for a in s.scene.animations))
]


@command(
    "animation.play",
    "Play animation",
    "play or pause the scene's animation",
    "K",
    unavailable=_animated,
    current=lambda session: session.playback.is_playing,
    icon="play",
)
def play(session: Session) -> None:
    session.playback = replace(session.playback, is_playing=not session.playback.is_playing)
    if session.playback.is_playing and not session.playback.repeats:
        shown, pose = chosen_animation(session.scene.animations, session.view.pose), session.view.pose
        if pose is not None and pose.seconds >= shown.seconds:
            _set_pose(session, Pose(shown.name, 0.0))


@command(
    "animation.time",
    "Animation time",
    "show the scene at a time of an animation",
    unavailable=_animated,
    current=lambda session, _time: chosen_animation(session.scene.animations, session.view.pose).name,
)
def set_time(session: Session, seconds: Seconds, animation: AnimationName = "") -> None:
    name = animation or chosen_animation(session.scene.animations, session.view.pose).name
    _set_pose(session, Pose(name, seconds))


@command("animation.rest", "Rest pose", "show the scene without animation", unavailable=_animated, icon="stop")
def rest(session: Session) -> None:
    session.playback = replace(session.playback, is_playing=False)
    _set_pose(session, None)


speed = field_command("playback.speed", unavailable=_animated)
repeat = field_command("playback.repeats", unavailable=_animated)
