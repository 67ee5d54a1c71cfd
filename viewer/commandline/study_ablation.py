"""`ntc-viewer study ablation`: what each part of the recipe is worth."""

import platform
import sys
from dataclasses import asdict

import torch
from rich.console import Console
from rich.progress import Progress, TimeRemainingColumn

from ntc.config import GroupingConfig
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from ntc.studies.ablation import ablation_figure, ablation_runs, ablation_table
from ntc.studies.ablation_config import AblationConfig
from ntc.studies.runs import finished_run
from viewer.commandline.encode import read_source
from viewer.commandline.study_files import check_output, write_study
from viewer.commandline.study_options import AblationStudyOptions
from viewer.folders import features_cache


def study_ablation(options: AblationStudyOptions) -> int:
    """Run `ntc-viewer study ablation`. Raises InputError for bad input."""
    config = AblationConfig(options.steps, options.texels_per_texture, options.levels, options.seeds, options.device)
    check_output(options.out)
    textures = read_source(options.source, options.texture_size).textures
    inputs = GroupingInputs(features=FeatureOptions(cache=features_cache()))
    grouping = make_grouping(GroupingConfig("clustered", options.clusters), textures, inputs)
    runs = ablation_runs(grouping, max(texture.pixels.shape[2] for texture in textures), config)
    results = []
    console = Console(stderr=True, soft_wrap=True)
    with Progress(*Progress.get_default_columns()[:-1], TimeRemainingColumn(), console=console, transient=True) as bar:
        whole = bar.add_task("", total=len(runs))
        for number, run in enumerate(runs):
            bar.update(whole, description=f"{run.name}, seed {run.training.seed}")
            folder = options.out / "runs"

            def report(step: int, steps: int, before: int = number) -> None:
                bar.update(whole, completed=before + step / steps)

            done = finished_run(run, textures, folder, report)
            results.append(done)
            console.print(f"{number + 1}/{len(runs)} {run.name}, seed {run.training.seed}: {done.seconds:.0f} s")
    table = ablation_table(results)
    title = (
        f"{options.source.stem}: {len(textures)} textures of at most {options.texture_size} texels, "
        f"{grouping.group_count} decoders, {options.steps} steps of {options.texels_per_texture} texels a texture"
    )
    record = {
        "study": "ablation",
        "what": title,
        "settings": asdict(config),
        "machine": {
            "python": platform.python_version(),
            "torch": torch.__version__,
            "threads": torch.get_num_threads(),
            "processor": platform.machine(),
        },
        "runs": [asdict(result) for result in results],
        "rows": [dict(row) for row in table.rows],
    }
    write_study(options.out, "ablation", title, table, ablation_figure(table, title), record)
    sys.stdout.write(f"{title}\n{table.text()}wrote {options.out}\n")
    return 0
