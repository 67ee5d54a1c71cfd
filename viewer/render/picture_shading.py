"""Makes the picture of a slot from the planes of its maps: lit, or one of the maps as it is stored."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ntc.codec.maps import MapName, Plane
from ntc.errors import InputError
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.light_drawer import LightDrawer
from viewer.render.pass_scheduler import Output, PassScheduler
from viewer.render.passes.shade import PlaneTargets, ShadeInputs, ShadePass
from viewer.render.picture_targets import ShownMaterials
from viewer.render.resources.color_target import ColorTarget
from viewer.render.resources.light.scene_light import SceneLight
from viewer.render.resources.visibility_buffer import VisibilityInputs
from viewer.state.view_state import SKY, Lighting


@dataclass(frozen=True, eq=False)
class Mixture:
    """One map of another source, in place of that of the planes that all others are taken from."""

    map_name: MapName
    planes: Mapping[Plane, ColorTarget]
    """Those of the other source."""


def _targets(planes: Mapping[Plane, ColorTarget]) -> PlaneTargets:
    return PlaneTargets(planes.get("base"), planes.get("surface"), planes.get("emission"))


class PictureShading:
    """Views other than `base`, whose picture is its plane. What they need is made when the first of them is drawn."""

    def __init__(
        self, context: GraphicsContext, programs: ProgramFactory, light: LightDrawer, scheduler: PassScheduler
    ) -> None:
        self._light, self._scheduler = light, scheduler
        self._pass = ShadePass(context, programs)
        self.problem: str | None = None
        """Why the environment of the last lit picture is not the one that was asked for; None where it is."""

    def draw(
        self,
        view: VisibilityInputs,
        planes: Mapping[Plane, ColorTarget],
        materials: ShownMaterials,
        output: ColorTarget,
        mixture: Mixture | None,
        reads: Sequence[Output],
    ) -> Output:
        """Draw the picture; `reads` are the outputs of the planes. Raises GpuMemoryError, ShaderError."""
        light = None
        if materials.view == "lit":
            light = self._lit_by(materials.lighting)
            reads = (*reads, *light.outputs)
        other = None if mixture is None else _targets(mixture.planes)
        taken = frozenset[MapName](() if mixture is None else (mixture.map_name,))
        inputs = ShadeInputs(view, _targets(planes), materials.view, light, other, taken)
        return self._scheduler.run(self._pass, inputs, output, reads)

    def _lit_by(self, lighting: Lighting) -> SceneLight:
        """What lights a view. The sky stands in for an environment that cannot be read any more."""
        try:
            light = self._light.prepare(lighting)
        except InputError as error:
            self.problem = f"{error}; the sky is shown instead of {Path(lighting.environment).name}"
            return self._light.prepare(replace(lighting, environment=SKY))
        self.problem = None
        return light

    def release(self) -> None:
        """Free everything."""
        self._light.release()
        self._pass.release()
