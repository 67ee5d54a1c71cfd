"""Greedy choice among candidate views: each next one adds most to the textures and pairs that are visible."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ntc.grouping.covisible import seen_blocks
from ntc.metrics.divergence import BLOCK
from viewer.scene.model import Camera, Scene
from viewer.state.camera import clip_distances
from viewer.viewpoints.candidates import Candidate

Array = NDArray[np.float64]
DrawTextureIds = Callable[[Camera, tuple[int, int]], NDArray[np.int32]]
"""Function: (camera, (width, height)) -> texture ids [H, W] int32, -1 for none, row 0 on top."""

CLEARANCE = 0.35
"""Distance in eye heights below which surfaces obstruct the view."""
MOST_OBSTRUCTED = 0.1
"""Largest share of the picture that obstructing surfaces may hide."""
TEXTURE_WEIGHT = 8.0
"""Weight of a visible texture, relative to a pair of textures that is visible in one block."""


@dataclass(frozen=True)
class ViewCriteria:
    """Criteria that a candidate view must meet."""

    least_covered: float
    """Share of the picture that shows textures."""
    most_of_one: float
    """Share of the picture that one texture may fill."""
    least_textures: int = 2


CRITERIA = (
    ViewCriteria(0.4, 0.7),
    ViewCriteria(0.25, 0.8),
    ViewCriteria(0.1, 0.85),
    ViewCriteria(0.15, 0.8, 1),
    ViewCriteria(0.02, 1.0, least_textures=1),
)
"""Criteria from strict to loose; views of a single texture are taken only where nothing meets the criteria before."""


@dataclass(frozen=True, eq=False)
class CandidateView:
    """Candidate and the textures that are visible from it."""

    candidate: Candidate
    ids: NDArray[np.int32]
    """[H, W] texture ids."""
    covered: float
    """Share of the picture that shows textures."""
    dominant: float
    """Share of the most visible texture."""
    textures: int
    features: NDArray[np.int64]
    """[F] numbers of the visible textures and of the pairs of textures that share a block."""
    amounts: Array
    """[F] number of blocks that show each."""

    @staticmethod
    def of(candidate: Candidate, ids: NDArray[np.int32], textures: int) -> "CandidateView":
        """Make the view with the texture ids `ids` [H, W] in a scene of `textures` textures."""
        pixels = np.bincount(ids[ids >= 0], minlength=textures)
        seen = np.nonzero(pixels)[0]
        together = seen_blocks([ids], textures)
        members = together.members
        pairs = sparse.coo_array(sparse.triu(members.T @ members.multiply(together.weights[:, None]), 1))
        features = np.concatenate([seen, textures + pairs.row.astype(np.int64) * textures + pairs.col])
        amounts = np.concatenate([pixels[seen] / (BLOCK[0] * BLOCK[1]), pairs.data])
        covered, dominant = float(pixels.sum()) / ids.size, float(pixels.max(initial=0)) / ids.size
        return CandidateView(candidate, ids, covered, dominant, len(seen), features, amounts)

    def meets(self, criteria: ViewCriteria) -> bool:
        """Return whether the view shows enough textures, and none too large."""
        return (
            self.covered >= criteria.least_covered
            and self.dominant <= criteria.most_of_one
            and self.textures >= criteria.least_textures
        )


class CandidateRenderer:
    """Renderer of the texture ids of candidates."""

    def __init__(self, draw_ids: DrawTextureIds, size: tuple[int, int], scene: Scene) -> None:
        self._draw_ids, self._size, self._bounds, self._textures = draw_ids, size, scene.bounds, len(scene.textures)

    def views(self, candidates: Sequence[Candidate]) -> list[CandidateView]:
        """Return the views of `candidates` that show a texture."""
        seen = [CandidateView.of(one, self._draw_ids(one.camera, self._size), self._textures) for one in candidates]
        return [view for view in seen if view.textures]

    def is_unobstructed(self, view: CandidateView) -> bool:
        """Return whether the picture stays much the same without the surfaces closest to the eye."""
        camera = view.candidate.camera
        near, far = clip_distances(camera, self._bounds)
        clear = CLEARANCE * view.candidate.scale
        if near >= clear:
            return True
        cut = self._draw_ids(replace(camera, near=clear, far=max(far, 2.0 * clear)), self._size)
        return float((cut != view.ids).mean()) <= MOST_OBSTRUCTED


class _Coverage:
    """Coverage: blocks in which the chosen views show each texture and pair, and what the other views would add."""

    def __init__(self, views: Sequence[CandidateView], textures: int) -> None:
        used, columns = np.unique(np.concatenate([view.features for view in views]), return_inverse=True)
        starts = np.cumsum([0, *(len(view.features) for view in views)])
        amounts = np.concatenate([view.amounts for view in views])
        self._amounts = sparse.csr_array((amounts, columns, starts), shape=(len(views), len(used)))
        self._weights = np.where(used < textures, TEXTURE_WEIGHT, 1.0)
        self._blocks = np.zeros(len(used))

    def gains(self) -> Array:
        """Return [views] what each would add: logarithmic in the blocks, so that repeated content counts less."""
        rows = self._amounts
        before = self._blocks[rows.indices]
        each = (np.log1p(before + rows.data) - np.log1p(before)) * self._weights[rows.indices]
        return np.asarray(np.add.reduceat(each, rows.indptr[:-1]))

    def add(self, index: int) -> None:
        """Count view `index` as chosen."""
        row = slice(*self._amounts.indptr[index : index + 2])
        self._blocks[self._amounts.indices[row]] += self._amounts.data[row]


def choose(views: Sequence[CandidateView], renderer: CandidateRenderer, count: int, textures: int) -> list[Candidate]:
    """Choose at most `count` candidates, greedily by what each adds; those that meet the strictest criteria come first."""
    coverage = _Coverage(views, textures)
    chosen: list[Candidate] = []
    refused: set[int] = set()
    for criteria in CRITERIA:
        if criteria.least_textures < 2 and chosen:
            break
        while len(chosen) < count:
            waiting = [i for i, view in enumerate(views) if i not in refused and view.meets(criteria)]
            if not waiting:
                break
            best = waiting[int(np.argmax(coverage.gains()[waiting]))]
            refused.add(best)
            candidate = views[best].candidate
            if not any(candidate.duplicates(other) for other in chosen) and renderer.is_unobstructed(views[best]):
                coverage.add(best)
                chosen.append(candidate)
    return chosen
