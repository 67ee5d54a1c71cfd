"""Entry point of `ntc-viewer`: parse, dispatch, and turn bad input into one line and exit status 2."""

import sys
from collections.abc import Sequence

from lab.commands.bench_options import BenchOptions
from lab.commands.study_options import (
    ClusterStudyOptions,
    FilteringStudyOptions,
    PaperScenesOptions,
    PaperStudyOptions,
    StabilityStudyOptions,
    TrainingStudyOptions,
)
from ntc.errors import InputError
from viewer.cli.arguments import Options, parse_arguments
from viewer.cli.options import (
    DecodeOptions,
    DoctorOptions,
    EncodeOptions,
    InfoOptions,
    RenderOptions,
    ViewOptions,
)
from viewer.gl.context_loss import ContextLostError

BAD_INPUT = 2
INTERRUPTED = 130


def run(options: Options) -> int:
    """Run the subcommand that `options` belongs to. Imports only what it needs: viewing a pack needs no torch."""
    match options:
        case ViewOptions():
            from viewer.cli.view import view

            return view(options)
        case RenderOptions():
            from viewer.cli.render import render

            return render(options)
        case EncodeOptions():
            from viewer.cli.encode import encode

            return encode(options)
        case DecodeOptions():
            from viewer.cli.decode import decode

            return decode(options)
        case InfoOptions():
            from viewer.cli.info import info

            return info(options)
        case BenchOptions():
            from lab.commands.bench import bench

            return bench(options)
        case ClusterStudyOptions():
            from lab.commands.study_clusters import study_clusters

            return study_clusters(options)
        case FilteringStudyOptions():
            from lab.commands.study_filtering import study_filtering

            return study_filtering(options)
        case StabilityStudyOptions():
            from lab.commands.study_stability import study_stability

            return study_stability(options)
        case PaperScenesOptions():
            from lab.commands.study_paper import study_paper_scenes

            return study_paper_scenes(options)
        case PaperStudyOptions():
            from lab.commands.study_paper import study_paper_textures

            return study_paper_textures(options)
        case TrainingStudyOptions():
            from lab.commands.study_recipe import study_recipe

            return study_recipe(options)
        case DoctorOptions():
            from viewer.cli.doctor import doctor

            return doctor(options)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `ntc-viewer` with `arguments` (None: those of the process) and return its exit status."""
    try:
        return run(parse_arguments(sys.argv[1:] if arguments is None else arguments))
    except InputError as error:
        sys.stderr.write(f"error: {error}\n")
        return BAD_INPUT
    except ContextLostError as lost:
        sys.stderr.write(
            f"error: {lost}; what was not finished has not been written; run it again, "
            "or without the GPU: LIBGL_ALWAYS_SOFTWARE=1\n"
        )
        return BAD_INPUT
    except BrokenPipeError:
        # The reader of a pipe (`| head`) has gone: nothing is left to say to it.
        sys.stderr.close()
        return 0
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
