"""KHR_draco_mesh_compression through DracoPy, an optional dependency."""

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf_buffers import Buffers
from viewer.scene.gltf_container import GltfFile, describe, printable

EXTENSION = "KHR_draco_mesh_compression"


@dataclass(frozen=True, eq=False)
class DracoMesh:
    """A decoded primitive."""

    attributes: dict[str, NDArray[Any]]
    """[V, components] by glTF name, in the type stored."""
    indices: NDArray[np.uint32]
    """[3 T] triangles."""


def draco_available() -> bool:
    """Whether DracoPy is installed."""
    return find_spec("DracoPy") is not None


def decode_draco(file: GltfFile, buffers: Buffers, extension: dict[str, Any], where: str) -> DracoMesh:
    """Decode the primitive at `where`. Raises InputError where DracoPy is absent or the data is broken."""
    where = f"{where}.{EXTENSION}"
    try:
        import DracoPy
    except ImportError as error:
        raise file.fail(where, "needs DracoPy; install it with: pip install 'ntc-viewer[draco]'") from error
    data, _ = buffers.view(extension.get("bufferView"), f"{where}.bufferView")
    try:
        mesh = DracoPy.decode(data.tobytes())
        faces = np.asarray(mesh.faces)
        stored = {entry["unique_id"]: np.asarray(entry["data"]) for entry in mesh.attributes}
    except Exception as error:  # DracoPy documents no exceptions of its own, and the data is untrusted.
        raise file.fail(where, f"the Draco data does not decode ({error})") from error
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise file.fail(where, "the Draco data holds no triangles")
    attributes: dict[str, NDArray[Any]] = {}
    for name, number in file.object(extension, "attributes", where).items():
        if not isinstance(number, int) or number not in stored:
            raise file.fail(f"{where}.attributes.{printable(name)}", f"{describe(number)} is not in the Draco data")
        values = stored[number]
        attributes[name] = values.reshape(len(values), -1)
    if len({len(values) for values in attributes.values()}) > 1:
        raise file.fail(where, "the Draco attributes differ in count")
    return DracoMesh(attributes, faces.astype(np.uint32).reshape(-1))
