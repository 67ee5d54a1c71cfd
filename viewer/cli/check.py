"""`ntc-viewer check`: measures an encoded scene, and compares it with a budget and with an accepted report."""

import datetime
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

import viewer
from ntc.codec.model import Pack
from ntc.content_cache import ContentCache
from ntc.errors import InputError
from ntc.io import atomic_folder, write_bytes, write_text
from ntc.library.index import is_library, library_packs
from ntc.metrics.metrics import psnr_table
from ntc.pack.file import read_pack
from ntc.pack.match import PackMatch
from viewer.checking.budget import Budget, read_budget, suggested_budget
from viewer.checking.ci_files import junit_xml, sarif_json
from viewer.checking.findings import Finding, failures, find
from viewer.checking.page import PageContent, page, past_of
from viewer.checking.record import FORMAT, PackRecord, Record, read_record
from viewer.checking.remedies import MOST_CURVES, rate_curve
from viewer.checking.textures import MeasuredTextures, measured_textures, original_of, recorded_textures
from viewer.checking.views import MeasuredViews, ViewsToMeasure, cached_views, measured_views, scene_content
from viewer.cli.options import CheckOptions
from viewer.cli.progress import TerminalProgress
from viewer.cli.sources import choose_source, open_scene, packs_for
from viewer.gl.context import create_headless_context
from viewer.locations import cache_folder
from viewer.scene.cameras_file import read_cameras, with_cameras_beside
from viewer.scene.json_text import counted
from viewer.scene.model import Camera, Scene
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.state.framing import frame_all
from viewer.state.pack_files import match_scene
from viewer.state.view_state import is_image_source
from viewer.training.rates import RateCurve
from viewer.viewpoints.sampling import CandidateSampler, ViewpointConfig

HAS_FINDINGS = 1
"""Exit status where a limit is exceeded, or a value got worse."""
REPORT, JUNIT, SARIF, PAGE = "report.json", "junit.xml", "check.sarif", "index.html"
LINES_SHOWN = 40
MOST_PAST = 200
"""Most past checks in a report."""


@dataclass(frozen=True, eq=False)
class _Checked:
    """Measured values, with the scene and pack that they belong to."""

    record: Record
    textures: MeasuredTextures
    views: MeasuredViews
    scene: Scene | None = None
    pack: Pack | None = None
    match: PackMatch | None = None


def check(options: CheckOptions) -> int:
    """Run `ntc-viewer check`. Raises InputError for bad input."""
    budget = read_budget(options.budget) if options.budget is not None else Budget()
    accepted = read_record(options.against) if options.against is not None else None
    cache = ContentCache(cache_folder("checks"))
    checked = _measured(options, cache)
    if accepted is not None:
        past = (*accepted.past, past_of(accepted))[-MOST_PAST:]
        checked = replace(checked, record=msgspec.structs.replace(checked.record, past=past))
    if options.suggest is not None:
        write_text(options.suggest, suggested_budget(checked.record))
        sys.stdout.write(f"wrote {options.suggest}\n")
    findings = find(checked.record, budget, accepted, datetime.datetime.now(datetime.UTC).date())
    if options.out is not None:
        _write(options.out, checked, findings, _curves(checked, findings, cache))
    sys.stdout.write("\n".join(_lines(checked, findings)) + "\n")
    return HAS_FINDINGS if failures(findings) else 0


def _measured(options: CheckOptions, cache: ContentCache) -> _Checked:
    if options.views < 0 or options.close < 0:
        raise InputError("--views and --close: must be 0 or more")
    path = options.source
    if path is not None and (path.suffix.lower() == PACK_SUFFIX or is_library(path)):
        if options.pack:
            raise InputError(f"{path}: is a pack itself; name the scene, or leave out --pack")
        return _of_packs(path)
    scene = with_cameras_beside(open_scene(path))
    packs = packs_for(scene, options.pack)
    source = choose_source(packs, options.grouping, options.pack)
    if is_image_source(source):
        raise InputError(f"{scene.name}: has no pack to check; encode it first: ntc-viewer encode SCENE --out F.ntc")
    pack = packs[source]
    match = match_scene(pack, scene)
    with TerminalProgress("measuring textures") as report:
        textures = measured_textures(scene, pack, match, cache, report)
    views = _views(
        options, ViewsToMeasure(scene, source, pack, _cameras(options, scene), options.size, ""), textures, cache
    )
    record = _record(str(path or scene.name), [pack], textures, views)
    return _Checked(record, textures, views, scene, pack, match)


def _of_packs(path: Path) -> _Checked:
    """Return the values of a pack or library that its encoder recorded."""
    packs = library_packs(path) if is_library(path) else [read_pack(path)]
    recorded = [recorded_textures(pack) for pack in packs]
    textures = MeasuredTextures(tuple(record for each in recorded for record in each.records), {}, 0)
    views = MeasuredViews((), None, 0)
    return _Checked(_record(str(path), packs, textures, views), textures, views)


def _cameras(options: CheckOptions, scene: Scene) -> Sequence[Camera]:
    cameras = read_cameras(options.cameras) if options.cameras is not None else scene.cameras
    chosen = (cameras or (frame_all(scene, aspect=options.size[0] / options.size[1]),))[: options.views]
    return (*chosen, *_close_cameras(scene, options.close)) if chosen else ()


def _close_cameras(scene: Scene, count: int) -> list[Camera]:
    """Return at most `count` cameras close to surfaces, the same for the same scene."""
    sampler = CandidateSampler.of(scene, ViewpointConfig()) if count > 0 else None
    candidates = sampler.close(count) if sampler is not None else []
    return [replace(each.camera, name=f"close {number}") for number, each in enumerate(candidates, 1)]


def _views(
    options: CheckOptions, views: ViewsToMeasure, textures: MeasuredTextures, cache: ContentCache
) -> MeasuredViews:
    if not views.cameras:
        return MeasuredViews((), None, 0)
    views = replace(views, content=scene_content(views.scene, textures.records))
    known = cached_views(views, cache)
    if known is not None:
        return known
    context = create_headless_context(options.device)
    with context.reset.watched(), TerminalProgress("measuring lit views") as report:
        return measured_views(context, views, cache, report)


def _record(source: str, packs: Sequence[Pack], textures: MeasuredTextures, views: MeasuredViews) -> Record:
    tables = [psnr_table(pack) for pack in packs]
    stored = sum(table.latent_bytes + table.decoder_bytes + table.adapter_bytes for table in tables)
    texels = sum(texture.width * texture.height for pack in packs for texture in pack.textures)
    pack = PackRecord(
        disk_bytes=sum(_disk_bytes(pack, table.latent_bytes) for pack, table in zip(packs, tables, strict=True)),
        bits_per_texel=8.0 * stored / max(1, texels),
        multiply_adds=max((pack.config.multiply_adds for pack in packs), default=0),
        gpu_bytes=views.gpu_bytes,
    )
    date = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return Record(FORMAT, date, source, pack, textures.records, views.records)


def _disk_bytes(pack: Pack, latents: int) -> int:
    """Return the bytes of the pack's file; for a pack of a library, those of its latents."""
    return pack.path.stat().st_size if pack.path is not None and pack.path.is_file() else latents


def _curves(checked: _Checked, findings: Sequence[Finding], cache: ContentCache) -> dict[str, RateCurve]:
    """Return the rate curves of the textures that miss a limit of PSNR by most, by content."""
    if checked.scene is None or checked.pack is None or checked.match is None:
        return {}
    places = {index: texture_id for texture_id, index in enumerate(checked.match.texture_index) if index >= 0}
    by_name = {texture.name: (index, texture) for index, texture in enumerate(checked.pack.textures) if index in places}
    contents = {record.name: record.content for record in checked.record.textures}
    names = dict.fromkeys(f.subject.name for f in failures(tuple(findings)) if f.measure == "psnr_db" and f.subject.map)
    curves: dict[str, RateCurve] = {}
    for name in [name for name in names if name in by_name][:MOST_CURVES]:
        index, texture = by_name[name]
        curve = rate_curve(original_of(checked.scene, places[index], texture), checked.pack, cache)
        if curve is not None:
            curves[contents[name]] = curve
    return curves


def _write(out: Path, checked: _Checked, findings: tuple[Finding, ...], curves: dict[str, RateCurve]) -> None:
    content = PageContent(checked.record, findings, checked.textures.strips, curves)
    with atomic_folder(out, REPORT) as made:
        write_bytes(made / REPORT, msgspec.json.format(msgspec.json.encode(checked.record), indent=1) + b"\n")
        write_bytes(made / JUNIT, junit_xml(checked.record, findings))
        write_bytes(made / SARIF, sarif_json(checked.record, findings, viewer.__version__))
        write_text(made / PAGE, page(content))


def _lines(checked: _Checked, findings: tuple[Finding, ...]) -> list[str]:
    record, failing = checked.record, failures(findings)
    lines = [each.text for each in failing[:LINES_SHOWN]]
    if len(failing) > LINES_SHOWN:
        lines.append(f"{len(failing) - LINES_SHOWN} more; --out DIR writes all of them")
    lines += [f"excepted: {each.text}" for each in findings if each.is_waived][:LINES_SHOWN]
    now = f"{checked.textures.measured} measured now" if checked.scene is not None else "as their encoder measured them"
    views = (
        f", {counted(len(record.views), 'lit view')} ({checked.views.measured} measured now)" if record.views else ""
    )
    verdict = f"{counted(len(failing), 'finding')}" if failing else "all within the budget"
    lines.append(f"{record.source}: {counted(len(record.textures), 'texture')} ({now}){views}: {verdict}")
    return lines
