"""The parts of a record: which calls of the program each consists of."""

import itertools
import re
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

from lab.benchmarks.behaviour.program import Run
from lab.benchmarks.behaviour.scripts import PICTURE, played, scripts, training

GROUPINGS = ("baseline", "single", "random", "category", "clustered", "covisible")
PATHS = ("deferred", "forward", "binned", "cached")
PRECISIONS = ("fp32", "fp16")
HALVES = ("fp16-arithmetic", "fp16-accumulate")
"""Refused by drivers without half arithmetic in shaders: then that is what is recorded."""
CAMERAS = ("entrance", "market", "grazing")
STEPS = "30"


def pictures() -> Iterable[Run]:
    """Single pictures by `render`, and the whole grid by scripts, which load the scene once for a pack."""

    def render(name: str, *arguments: str) -> Run:
        return Run(name, ("render", *arguments, "--out", "OUT", *PICTURE))

    overlays = itertools.cycle(("none", "divergence", "error"))
    cameras = itertools.cycle(CAMERAS[:2])
    for grouping, path in itertools.product(GROUPINGS, PATHS):
        precisions = PRECISIONS if grouping in ("single", "clustered") else PRECISIONS[:1]
        for precision in precisions:
            choice = ("--grouping", grouping, "--path", path, "--precision", precision)
            view = ("--camera", next(cameras), "--overlay", next(overlays))
            yield render(f"render {grouping} {path} {precision}", *choice, *view)
        # One after another, so that cameras and overlays do not keep step with paths.
        next(overlays)
    yield render("render reference", "--grouping", "reference", "--anisotropy", "8", "--camera", "grazing")
    yield render("render auto-precision", "--precision", "auto", "--overlay", "divergence", "--block", "16x4")
    eye = ("--eye", "3", "2", "5", "--target", "0", "1", "0", "--fov", "75")
    yield render(
        "render eye", *eye, "--overlay", "divergence", "--palette", "viridis", "--opacity", "0.9", "--block", "4x4"
    )
    yield render("render cameras", "WORK/scene/small.gltf", "--cameras", "WORK/path.json", "--camera", "p1")
    for grouping, path in itertools.product(("reference", "single", "category"), PATHS):
        small = ("--grouping", grouping, "--path", path, "--camera", "front", "--overlay", "error")
        yield render(f"render small {grouping} {path}", "WORK/scene/small.gltf", *small)
    yield Run(
        "render deep folder",
        ("render", "--out", "OUT/a/b", "--size", "64x64", "--overlay", "divergence", "--block", "8x4"),
    )
    for grouping, precisions in itertools.product(GROUPINGS, (PRECISIONS, HALVES)):
        lines = ["window.panels", f"slot.source a {grouping}"]
        keep = []
        for camera, path, precision in itertools.product(CAMERAS, PATHS, precisions):
            keep.append(f"{camera}_{path}_{precision}.png")
            lines += [f"camera.go {camera}", f"slot.path a {path}", f"slot.precision a {precision}"]
            lines += ["wait settled", f"file.screenshot-picture a {keep[-1]}"]
        run = played(f"grid {grouping} {precisions[0]}", "; ".join(lines), PICTURE, tuple(keep))
        yield replace(run, fails=False if precisions is PRECISIONS else None)


def encodings() -> Iterable[Run]:
    """Every grouping of the scene by one recipe, and of the folder by the other; both recipes of both once."""

    def encode(source: str, grouping: str, recipe: str, *more: str) -> Run:
        file = {"scene": "WORK/scene/small.gltf", "textures": "WORK/textures"}[source]
        clusters = () if grouping in ("baseline", "single", "category") else ("--clusters", "3")
        how = (
            "--grouping",
            grouping,
            *clusters,
            "--recipe",
            recipe,
            "--steps",
            STEPS,
            "--seed",
            "7",
            "--device",
            "cpu",
        )
        extra = "".join(f" {word.lstrip('-')}" for word in more)
        return Run(f"{source} {grouping} {recipe}{extra}", ("encode", file, "--out", "OUT/pack.ntc", *how, *more))

    yield from (encode("scene", grouping, "best") for grouping in GROUPINGS)
    yield from (encode("textures", grouping, "paper") for grouping in GROUPINGS if grouping != "covisible")
    yield encode("scene", "clustered", "paper")
    yield encode("textures", "baseline", "best")
    yield encode("textures", "clustered", "best", "--features", "spectral", "--texture-size", "32")
    yield encode("textures", "single", "paper", "--levels", "1")
    yield encode("scene", "covisible", "best", "--sampled-views", "4", "--spread-weight", "0.6")


def decodes() -> Iterable[Run]:
    """Small packs by every backend, and one of the built-in scene at a small level."""
    backends = [(backend, "fp32") for backend in ("numpy", "torch", "gl")] + [
        ("gl", name) for name in ("fp16", *HALVES)
    ]
    for backend, precision in backends:
        how = ("--backend", backend, "--precision", precision, "--out", "OUT")
        fails = None if precision in HALVES else False
        for grouping, level in (("single", "0"), ("category", "0"), ("baseline", "2")):
            pack = f"WORK/scene/small.{grouping}.ntc"
            yield Run(f"small {grouping} {backend} {precision}", ("decode", pack, "--level", level, *how), fails=fails)
        pack = "BUILTIN/courtyard.clustered.ntc"
        yield Run(f"courtyard {backend} {precision}", ("decode", pack, "--level", "3", *how), fails=fails)


def info() -> Iterable[Run]:
    """Scenes, packs and folders; and what --help says."""
    small = [f"WORK/scene/small.{grouping}.ntc" for grouping in ("baseline", "covisible", "category")]
    packs = [f"BUILTIN/courtyard.{grouping}.ntc" for grouping in ("baseline", "clustered")]
    for file in ("BUILTIN/courtyard.glb", "WORK/scene/small.gltf", *small, *packs):
        name = Path(file).name
        yield Run(f"{name} text", ("info", file))
        yield Run(f"{name} json", ("info", file, "--json"))
    for form in ((), ("--json",)):
        yield Run(f"all {'json' if form else 'text'}", ("info", "--all", "WORK/scene", *form))
        yield Run(f"all bad {'json' if form else 'text'}", ("info", "--all", "WORK/bad", *form))
    for command in ("", "view", "render", "encode", "decode", "info", "bench", "doctor", "study"):
        yield Run(f"help {command}".strip(), (*command.split(), "--help"))


def refused() -> Iterable[Run]:
    """Bad input of every command."""
    calls = """
        render BAD/missing.glb --out OUT
        render BAD/empty.glb --out OUT
        render BAD/torn.gltf --out OUT
        render BAD/needs.gltf --out OUT
        render BAD/counts.gltf --out OUT
        render --camera nowhere --out OUT
        render --grouping nothing --out OUT
        render --eye 0 0 1 --out OUT
        render --size 0x10 --out OUT
        render --eye 0 0 1 --target 0 0 0 --fov 400 --out OUT
        render --cameras BAD/cameras.json --out OUT
        render --pack BAD/words.ntc --out OUT
        render --pack WORK/scene/small.single.ntc --out OUT
        render --path sideways --out OUT
        render --out BAD/words.ntc
        render
        encode BAD/missing --out OUT/p.ntc
        encode WORK/textures --out OUT/p.ntc --grouping covisible
        encode WORK/textures --out OUT/p.ntc --steps 5 --epochs 1
        encode WORK/textures --out OUT/p.ntc --grouping clustered --clusters 99 --steps 5 --device cpu
        encode BAD/empty.glb --out OUT/p.ntc
        decode BAD/words.ntc --out OUT
        decode WORK/scene/small.single.ntc --level -1 --out OUT
        decode WORK/scene/small.single.ntc --backend wrong --out OUT
        info
        info BAD/words.ntc
        info --all BAD/missing
        view --headless --script BAD/missing.script --out OUT
        view --headless --size 10x10 --out OUT
        view --headless --grouping nothing --out OUT
        study nothing
        nothing
    """
    lines = """
        wait frames 1; compare.mod a | expect source nothing | click 'A sourc' | slot.source a missing | wait long
        file.open missing.glb | view.load WORK/bad/wrong.json | camera.turntable 0 | camera.play | camera.bookmark '' | key Q+Q
        file.screenshot-picture shown a.jpg | pixel.keep 4000 4000 | overlay.opacity 3 | compare.divider nan | view.magnify 0.2
        training.retrain 0,99 | training.encode clustered 0 | texture.flat nowhere | errors.highlight texture 999 | size 10x10
        window.panel Nowhere | view.paste | KEEP | training.show 3 a | camera.go nowhere | compare.flicker -1
    """
    for call in calls.replace("BAD", "WORK/bad").split("\n"):
        if call.strip():
            yield Run(re.sub(r"[^\w.-]+", " ", call).strip(), tuple(call.split()), fails=True)
    for line in lines.replace("\n", "|").split("|"):
        if line.strip():
            script = (
                "view",
                "WORK/scene/small.gltf",
                "--headless",
                "--size",
                "320x240",
                "--out",
                "OUT",
                "--exec",
                line.strip(),
            )
            yield Run(f"script {re.sub(r'[^a-zA-Z0-9.-]+', ' ', line).strip()}", script, fails=True)


PARTS: dict[str, Callable[[], Iterable[Run]]] = {
    **{"packs": encodings, "pictures": pictures, "decodes": decodes},
    **{"info": info, "refused": refused, "scripts": scripts, "training": training},
}
