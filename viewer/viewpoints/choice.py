"""Choosing among candidates by what they show: each next one adds most."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ntc.grouping.seen_blocks import seen_blocks
from ntc.metrics.divergence import BLOCK
from viewer.scene.model import Camera, Scene
from viewer.state.camera import clip_distances
from viewer.viewpoints.candidates import Candidate

Array = NDArray[np.float64]
See = Callable[[Camera, tuple[int, int]], NDArray[np.int32]]
"""Draws the texture ids [H, W] int32 (-1 for none, row 0 on top) that a camera sees at a size (width, height)."""

TOO_NEAR = 0.35
"""Nothing that fills the picture may be nearer to the eye than this many eye heights."""
TOO_NEAR_SHARE = 0.1
"""Share of the picture that may be."""
TEXTURE_WEIGHT = 8.0
"""What it counts to see a texture, against seeing a pair of textures in one block."""


@dataclass(frozen=True)
class Rules:
    """What a candidate must fulfil."""

    least_covered: float
    """Share of the picture that shows textures."""
    most_of_one: float
    """Share of the picture that one texture may fill."""
    least_textures: int = 2


RULES = (
    Rules(0.4, 0.7),
    Rules(0.25, 0.8),
    Rules(0.1, 0.85),
    Rules(0.15, 0.8, 1),
    Rules(0.02, 1.0, least_textures=1),
)
"""Relaxed in this order; views of one texture serve only where nothing fulfils the rules before."""


@dataclass(frozen=True, eq=False)
class CandidateView:
    """A candidate and what it shows."""

    candidate: Candidate
    ids: NDArray[np.int32]
    """[H, W] texture ids."""
    covered: float
    """Share of the picture that shows textures."""
    dominant: float
    """Share that shows the texture which is seen most."""
    textures: int
    features: NDArray[np.int64]
    """Numbers of the textures and of the pairs of textures that are seen, and..."""
    amounts: Array
    """... the blocks in which each is."""

    @staticmethod
    def of(candidate: Candidate, ids: NDArray[np.int32], textures: int) -> "CandidateView":
        """`candidate` in a scene of `textures` textures, of which it sees `ids`."""
        pixels = np.bincount(ids[ids >= 0], minlength=textures)
        seen = np.nonzero(pixels)[0]
        together = seen_blocks([ids], textures)
        members = together.members
        pairs = sparse.coo_array(sparse.triu(members.T @ members.multiply(together.weights[:, None]), 1))
        features = np.concatenate([seen, textures + pairs.row.astype(np.int64) * textures + pairs.col])
        amounts = np.concatenate([pixels[seen] / (BLOCK[0] * BLOCK[1]), pairs.data])
        covered, dominant = float(pixels.sum()) / ids.size, float(pixels.max(initial=0)) / ids.size
        return CandidateView(candidate, ids, covered, dominant, len(seen), features, amounts)

    def fulfils(self, rules: Rules) -> bool:
        """Whether it is good enough."""
        return (
            self.covered >= rules.least_covered
            and self.dominant <= rules.most_of_one
            and self.textures >= rules.least_textures
        )


class Pictures:
    """Draws what candidates see."""

    def __init__(self, see: See, size: tuple[int, int], scene: Scene) -> None:
        self._see, self._size, self._bounds, self._textures = see, size, scene.bounds, len(scene.textures)

    def views(self, candidates: Sequence[Candidate]) -> list[CandidateView]:
        """Those of `candidates` that see a texture."""
        seen = [CandidateView.of(one, self._see(one.camera, self._size), self._textures) for one in candidates]
        return [view for view in seen if view.textures]

    def stands_free(self, view: CandidateView) -> bool:
        """Whether nothing right before the eye hides what is behind it: without what is near it sees much the same."""
        camera = view.candidate.camera
        near, far = clip_distances(camera, self._bounds)
        clear = TOO_NEAR * view.candidate.scale
        if near >= clear:
            return True
        cut = self._see(replace(camera, near=clear, far=max(far, 2.0 * clear)), self._size)
        return float((cut != view.ids).mean()) <= TOO_NEAR_SHARE


class _Shown:
    """How much of each texture and pair of textures the views chosen so far show, and what others would add."""

    def __init__(self, views: Sequence[CandidateView], textures: int) -> None:
        used, columns = np.unique(np.concatenate([view.features for view in views]), return_inverse=True)
        starts = np.cumsum([0, *(len(view.features) for view in views)])
        amounts = np.concatenate([view.amounts for view in views])
        self._amounts = sparse.csr_array((amounts, columns, starts), shape=(len(views), len(used)))
        self._weights = np.where(used < textures, TEXTURE_WEIGHT, 1.0)
        self._shown = np.zeros(len(used))

    def gains(self) -> Array:
        """[views] what each would add; of what is shown already, ever less. Every view shows something."""
        rows = self._amounts
        before = self._shown[rows.indices]
        each = (np.log1p(before + rows.data) - np.log1p(before)) * self._weights[rows.indices]
        return np.asarray(np.add.reduceat(each, rows.indptr[:-1]))

    def add(self, index: int) -> None:
        """View `index` is chosen."""
        row = slice(*self._amounts.indptr[index : index + 2])
        self._shown[self._amounts.indices[row]] += self._amounts.data[row]


def choose(views: Sequence[CandidateView], pictures: Pictures, count: int, textures: int) -> list[Candidate]:
    """At most `count` candidates, one after the other each that adds most; those that fulfil the strictest rules first."""
    shown = _Shown(views, textures)
    chosen: list[Candidate] = []
    refused: set[int] = set()
    for rules in RULES:
        if rules.least_textures < 2 and chosen:
            break
        while len(chosen) < count:
            waiting = [i for i, view in enumerate(views) if i not in refused and view.fulfils(rules)]
            if not waiting:
                break
            best = waiting[int(np.argmax(shown.gains()[waiting]))]
            refused.add(best)
            candidate = views[best].candidate
            if not any(candidate.alike(other) for other in chosen) and pictures.stands_free(views[best]):
                shown.add(best)
                chosen.append(candidate)
    return chosen
