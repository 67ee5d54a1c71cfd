"""Commands: the animations of the scene."""

from dataclasses import replace
from typing import Annotated

from viewer.commands.command import Arg, Context, command, switch
from viewer.scene.model import Pose
from viewer.state.motion import chosen_animation
from viewer.state.session import Session

LONGEST_SECONDS = 1e6
SLOWEST, FASTEST = 0.05, 20.0


def _no_animations(context: Context) -> str:
    return "" if context.session.scene.animations else "the scene has no animations"


def _stand(session: Session, pose: Pose | None) -> None:
    session.view = replace(session.view, pose=pose)


Seconds = Annotated[float, Arg("seconds from the animation's beginning", None, 0.0, LONGEST_SECONDS)]
AnimationName = Annotated[
    str,
    Arg(
        "an animation of the scene; the one that is shown unless given",
        lambda s: tuple(a.name for a in s.scene.animations),
    ),
]


@command(
    "animation.play",
    "Play the animation",
    "play the scene's animation until pressed again",
    "View",
    "K",
    unavailable=_no_animations,
    current=switch(lambda session: session.playback.is_playing),
)
def play(session: Session) -> None:
    session.playback = replace(session.playback, is_playing=not session.playback.is_playing)
    if session.playback.is_playing and not session.playback.repeats:
        shown, pose = chosen_animation(session.scene.animations, session.view.pose), session.view.pose
        if pose is not None and pose.seconds >= shown.seconds:
            _stand(session, Pose(shown.name, 0.0))


@command(
    "animation.time",
    "Moment of an animation",
    "let the scene stand at a time of one of its animations",
    "View",
    unavailable=_no_animations,
)
def set_time(session: Session, seconds: Seconds, animation: AnimationName = "") -> None:
    name = animation or chosen_animation(session.scene.animations, session.view.pose).name
    _stand(session, Pose(name, seconds))


@command("animation.rest", "Without animation", "show the scene as its nodes stand", "View", unavailable=_no_animations)
def rest(session: Session) -> None:
    session.playback = replace(session.playback, is_playing=False)
    _stand(session, None)


Speed = Annotated[float, Arg("seconds of the animation in a second", None, SLOWEST, FASTEST, clamp=True)]


@command(
    "animation.speed",
    "Speed of the animation",
    "play the animation at another speed",
    "View",
    unavailable=_no_animations,
)
def set_speed(session: Session, speed: Speed) -> None:
    session.playback = replace(session.playback, speed=speed)


@command(
    "animation.repeat",
    "Repeat the animation",
    "begin the animation again at its end",
    "View",
    unavailable=_no_animations,
    current=switch(lambda session: session.playback.repeats),
)
def toggle_repeat(session: Session) -> None:
    session.playback = replace(session.playback, repeats=not session.playback.repeats)
