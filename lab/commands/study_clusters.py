"""`ntc-viewer study clusters`: groupings over the number of groups, measured on the views of a scene."""

import sys
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress

from lab.commands.options import ClusterStudyOptions
from lab.runner import StudyOutput
from lab.studies.cluster_plot import cluster_figure
from lab.studies.clusters import ClusterStudyConfig, EncodedGrouping, Fold, cluster_study, cluster_table
from ntc.errors import InputError
from ntc.features import FeatureOptions, feature_matrix
from ntc.grouping.covisible import seen_blocks
from ntc.metrics.metrics import psnr_table
from viewer.cli.sources import open_scene, packs_for
from viewer.locations import features_cache
from viewer.scene.model import Scene
from viewer.scene.source_textures import source_textures
from viewer.state.pack_files import match_scene
from viewer.viewpoints.scene_views import SceneViews, ViewSource, scene_views


def _folds(views: SceneViews, textures: int) -> tuple[Fold, ...]:
    """Two: every other view is held out, then the others are. Views near a held-out camera are held out, too."""
    cameras = views.cameras
    sampled = views.from_sampled()
    exact = views.exactly(cameras)
    nearby = [views.near([camera]) for camera in cameras]
    folds = []
    for first in (0, 1):
        seen: list[NDArray[np.int32]] = [*exact[first::2], *sampled[first::2]]
        seen += [view for group in nearby[first::2] for view in group]
        held_out = [*exact[1 - first :: 2], *sampled[1 - first :: 2]]
        folds.append(Fold(seen_blocks(seen, textures), seen_blocks(held_out, textures)))
    return tuple(folds)


def _encoded(scene: Scene, options: ClusterStudyOptions) -> tuple[EncodedGrouping, ...]:
    found = []
    for name, pack in packs_for(scene, options.pack).items():
        match = match_scene(pack, scene)
        if match.absent:
            sys.stderr.write(f"note: {pack.path}: left out, it lacks textures of the scene\n")
            continue
        summary = psnr_table(pack).summary
        found.append(EncodedGrouping(name, match.decoders(pack), summary.mean_db if summary else None))
    return tuple(found)


def _describe(scene: Scene, views: SceneViews) -> str:
    parts = [f"{len(views.cameras)} cameras"] if views.cameras else []
    parts += [f"{len(views.sampled)} sampled places"] if views.sampled else []
    return f"{scene.name}: {len(scene.textures)} textures, {' and '.join(parts)}, every other view held out"


def study_clusters(options: ClusterStudyOptions) -> int:
    """Run `ntc-viewer study clusters`. Raises InputError for bad input."""
    config = ClusterStudyConfig(options.clusters, options.spread_weight, options.largest_share, options.seed)
    output = StudyOutput(options.out)
    if not options.features:
        raise InputError("--features: name at least one")
    console = Console(stderr=True, soft_wrap=True)
    scene = open_scene(options.scene)
    textures = source_textures(scene, options.texture_size)
    if len(textures) < 2:
        raise InputError(f"{scene.name}: has {len(textures)} textures; a study of groups needs at least two")
    views = scene_views(scene, ViewSource(options.views, options.sampled_views, options.seed))
    if views.note:
        sys.stderr.write(f"note: {views.note}\n")
    if len(views.cameras) + len(views.sampled) < 2:
        raise InputError("--views: one view cannot be split; name at least two cameras, or give --sampled-views")
    folds = _folds(views, len(textures))
    renderer = views.renderer.name
    views.renderer.release()
    feature_options = FeatureOptions(cache=features_cache(), clip_weights=options.clip_weights)
    features = {name: feature_matrix(name, textures, feature_options) for name in options.features}
    with Progress(console=console, transient=True) as bar:
        task = bar.add_task("groupings", total=None)
        rows = cluster_study(
            textures,
            features,
            folds,
            config,
            _encoded(scene, options),
            lambda done, whole: bar.update(task, completed=done, total=whole),
        )
    title, table = _describe(scene, views), cluster_table(rows)
    facts = {
        "scene": scene.name,
        "settings": asdict(config),
        "features": list(options.features),
        "texture_size": options.texture_size,
        "renderer": renderer,
    }
    output.write("clusters", title, table, cluster_figure(rows, title), facts, [asdict(row) for row in rows])
    output.end()
    return 0
