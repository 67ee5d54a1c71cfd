"""The variant in which a pack is decoded: named, the default of the device's class, or the fastest one."""

import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from ntc.codec.gpu import DecoderVariant
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from viewer.gl.context import GraphicsContext
from viewer.locations import variants_cache
from viewer.render.resources.precision import fastest_first
from viewer.render.resources.variant import default_variant, parsed_variant
from viewer.render.variants.kept_times import keep_times, read_times
from viewer.render.variants.measurement import VariantMeasurement, VariantTimes
from viewer.state.view_state import Precision

VARIANT_VARIABLE: Final = "NTC_VIEWER_DECODER_VARIANT"
"""Environment variable: `default`, `measured`, or settings such as `pixels=2,weights=shared`. Else GPUs measure, software does not."""


@dataclass
class VariantChoice:
    """Gives each pack its variant; where nothing else is asked for, that of the device's class."""

    wanted: str = "default"
    """`default`; `measured`; settings of a variant; or empty: `measured` on a GPU, else `default`."""
    folder: Path | None = None
    """Where times are kept; None: `variants_cache()`."""
    tell: Callable[[str], None] = lambda _: None
    """Called once where something has been measured, with a line about it."""
    _times: dict[str, VariantTimes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._named = None if self.wanted in ("", "default", "measured") else parsed_variant(self.wanted)

    @classmethod
    def of_environment(cls, wanted: str, tell: Callable[[str], None]) -> "VariantChoice":
        """What an option asks for, else VARIANT_VARIABLE. Raises InputError for settings that there are not."""
        return cls(wanted or os.environ.get(VARIANT_VARIABLE, ""), tell=tell)

    def variant(self, context: GraphicsContext, pack: Pack, precision: Precision) -> DecoderVariant:
        """The variant in which `pack` is decoded. May measure, which takes a second or two, once for each shape and driver."""
        if self._named is not None:
            return self._named if context.features.compute else replace(self._named, weights="image")
        times = self._measured(context, pack)
        own = times.fastest(precision) if times is not None else None
        return own or default_variant(context, pack.config)

    def precisions(self, context: GraphicsContext, pack: Pack) -> tuple[Precision, ...]:
        """The precisions of this driver, the fastest first: as measured, else as is known of most GPUs."""
        times = self._measured(context, pack) if self._named is None else None
        return times.precisions if times is not None else fastest_first(context)

    def _measured(self, context: GraphicsContext, pack: Pack) -> VariantTimes | None:
        tables = codec_of(pack.config).gpu_tables(pack.config)
        measures = self.wanted == "measured" or (not self.wanted and not context.info.is_software)
        if not measures or not context.features.compute or not tables.shares_decoders or not pack.textures:
            return None
        shape, folder = tables.shape_text(), self.folder or variants_cache()
        if shape not in self._times:
            times = read_times(folder, context.info, shape)
            if times is None:
                times = VariantMeasurement(context, pack).times()
                keep_times(folder, context.info, shape, times)
                self.tell(
                    f"decoder {shape}: measured on {context.info.renderer}, {times.fastest('fp32')} is the fastest"
                )
            self._times[shape] = times
        return self._times[shape]
