"""What Python and GLSL share of culling by clusters. GLSL gets it as the include `generated/clusters.glsl`."""

from enum import IntEnum

import numpy as np

from ntc.codec.gpu import glsl_struct
from viewer.gl.indirect import COMMAND_BYTES
from viewer.render.resources.layout import SCAN_GROUP

CLUSTER_TRIANGLES = 128
"""Of scenes that are culled on the GPU."""
ITEM_CLUSTERS = 64
"""Clusters of one instance that a work group tests."""
COMMAND_WORDS = COMMAND_BYTES // 4
"""Of a DrawElementsIndirectCommand."""
ROUNDING = 4e-6
"""What is lost to rounding in float32, here and in the vertex shader, in units of the largest number that is added: 32 times the unit
roundoff of 2^-23."""
CONE_MARGIN = 1.0 / 64.0
"""Sine of the angle (about 1 degree) by which a cluster must be turned away: rasterisers move corners to a grid, which may turn
a small triangle that is seen almost from its edge."""
PIXEL_MARGIN = 1.0 / 8.0
"""Pixels that a cluster's outline is taken to be wider: the coarsest grid that OpenGL allows has steps of 1/16."""


class ClusterBinding(IntEnum):
    """Storage buffers, in place of others that these programs do not read."""

    CLUSTERS = 3
    PLACEMENTS = 4
    ITEMS = 5
    COMMANDS = 6
    BUCKETS = 7


class ClusterTest(IntEnum):
    """What clusters are tested for: bits."""

    FRUSTUM = 1
    CONE = 2
    SIZE = 4


CLUSTER_RECORD = np.dtype(
    [
        ("centre", "<f4", (4,)),
        ("extent", "<f4", (4,)),
        ("axis", "<f4", (4,)),
        ("first_index", "<u4"),
        ("index_count", "<u4"),
        ("padding_0", "<u4"),
        ("padding_1", "<u4"),
    ]
)
"""A cluster: std430, 64 bytes. Box (centre and half size, local space) and normal cone (axis, and in w the sine of its half angle)."""

PLACEMENT_RECORD = np.dtype(
    [
        ("row_x", "<f4", (4,)),
        ("row_y", "<f4", (4,)),
        ("row_z", "<f4", (4,)),
        ("base_vertex", "<u4"),
        ("may_face_away", "<u4"),
        ("padding_0", "<u4"),
        ("padding_1", "<u4"),
    ]
)
"""An instance: std430, 64 bytes. Rows of its local-to-world matrix, and whether its clusters can be turned away as a whole."""

ITEM_RECORD = np.dtype(
    [
        ("eye", "<f4", (4,)),
        ("first_cluster", "<u4"),
        ("clusters", "<u4"),
        ("instance", "<u4"),
        ("seen_low", "<u4"),
        ("seen_high", "<u4"),
        ("runs", "<u4"),
        ("first_command", "<u4"),
        ("triangles", "<u4"),
    ]
)
"""Up to ITEM_CLUSTERS clusters of one instance: std430, 48 bytes. The eye in the instance's local space; then a bit for each seen
cluster, how many runs of neighbours those are, the place of the first one's command, and the triangles: the GPU writes these."""

BUCKET_RECORD = np.dtype(
    [
        ("first_item", "<u4"),
        ("items", "<u4"),
        ("first_command", "<u4"),
        ("capacity", "<u4"),
        ("commands", "<u4"),
        ("clusters", "<u4"),
        ("triangles", "<u4"),
        ("padding_0", "<u4"),
    ]
)
"""Items that are drawn with the same OpenGL state: std430, 32 bytes. The GPU writes how
many commands, clusters and triangles there are."""


def cluster_layout_glsl() -> str:
    """The include `generated/clusters.glsl`."""
    lines = ["// Generated from viewer/render/resources/clusters/records.py."]
    lines += [f"#define BINDING_{member.name} {member.value}" for member in ClusterBinding]
    lines += [f"#define TEST_{member.name} {member.value}u" for member in ClusterTest]
    lines += [
        f"#define ITEM_CLUSTERS {ITEM_CLUSTERS}",
        f"#define COMMAND_WORDS {COMMAND_WORDS}u",
        f"#define SCAN_GROUP {SCAN_GROUP}",
        f"#define ROUNDING {ROUNDING}",
        f"#define CONE_MARGIN {CONE_MARGIN}",
        f"#define PIXEL_MARGIN {PIXEL_MARGIN}",
        glsl_struct("ClusterRecord", CLUSTER_RECORD),
        glsl_struct("PlacementRecord", PLACEMENT_RECORD),
        glsl_struct("ItemRecord", ITEM_RECORD),
        glsl_struct("BucketRecord", BUCKET_RECORD),
    ]
    return "\n".join(lines) + "\n"
