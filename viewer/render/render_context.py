"""Context that the parts of one renderer share: the GPU, the scene on it, programs, the scheduler, and settings of packs."""

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
    """Programs of all shaders that need no codec; those of codecs are made from it (`codec_programs`)."""
    scene: Scene
    scene_buffers: SceneBuffers
    scheduler: PassScheduler
    tile_budget: TileBudget = field(default_factory=TileBudget)
    """Decoding time of path `cached`, with the settings of its tile caches."""
    latents: LatentBudget | None = None
    """Limit of GPU memory for the latents of a pack. None: all of them are uploaded at once."""
    emulate_half: bool = False
    """Round in single precision what the driver cannot compute in halves: for tests and studies."""
    variant: VariantName | None = None
    """Variant of the decoding shaders. None: that of the renderer (`decoder_variant`)."""
