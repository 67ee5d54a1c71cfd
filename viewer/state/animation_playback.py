"""Animations of the scene that play: from a pose and a time to the next pose."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from viewer.scene.model import AnimationFacts, Pose


@dataclass(frozen=True)
class AnimationPlayback:
    """Whether the scene's animation plays, and how."""

    is_playing: bool = False
    speed: float = 1.0
    """Seconds of the animation in a second."""
    repeats: bool = True
    """Whether it begins again at its end."""

    def advance(
        self, animations: Sequence[AnimationFacts], pose: Pose | None, seconds: float
    ) -> "tuple[Pose, AnimationPlayback]":
        """The pose `seconds` after `pose`, and what goes on playing: nothing after the end of what does not repeat."""
        shown = chosen_animation(animations, pose)
        at = (pose.seconds if pose is not None else 0.0) + seconds * self.speed
        if at < shown.seconds:
            return Pose(shown.name, at), self
        if self.repeats and shown.seconds > 0.0:
            return Pose(shown.name, at % shown.seconds), self
        return Pose(shown.name, shown.seconds), replace(self, is_playing=False)


def chosen_animation(animations: Sequence[AnimationFacts], pose: Pose | None) -> AnimationFacts:
    """The animation of a pose; the first one for None, and where none has the name."""
    named = (animation for animation in animations if pose is not None and animation.name == pose.animation)
    return next(named, animations[0])
