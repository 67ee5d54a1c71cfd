"""Objects and settings that the parts of one renderer share: GPU, scene, programs, scheduler, settings of packs."""

from dataclasses import dataclass, field

from ntc.codec.gpu import VariantName
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.pass_scheduler import PassScheduler
from viewer.render.resources.latent_store import LatentBudget
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.render.resources.tile_cache.budget import TileBudget
from viewer.scene.model import Scene


@dataclass(frozen=True, eq=False)
class RenderContext:
    """Objects and settings that the parts of one renderer share."""

    graphics: GraphicsContext
    programs: ProgramFactory
    """Factory of the shaders that need no codec; `codec_programs` derives the factory of a codec."""
    scene: Scene
    scene_buffers: SceneBuffers
    scheduler: PassScheduler
    tile_budget: TileBudget = field(default_factory=TileBudget)
    """Decoding time of a frame, and the settings of tile caches."""
    latents: LatentBudget | None = None
    """Limit of GPU memory for the latents of a pack. None: all are uploaded at once."""
    emulate_half: bool = False
    """True: emulate half precision by rounding in single precision, for tests and studies on drivers without it."""
    variant: VariantName | None = None
    """Variant of the decoding shaders. None: the one that suits the driver (`decoder_variant`)."""
