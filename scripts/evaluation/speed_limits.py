# SPDX-License-Identifier: BSD-3-Clause
"""What a scan costs at least (docs/benchmarks/speed.md): the operations and bytes that the equations ask for, at the
rates of machine_benchmark. Part of speed.py."""

import dataclasses
import json
import statistics
import subprocess

STATES, MEASURED = 8, 5  # of an element of the map of objects; of a detection
ELEMENT_BYTES = 8 * (STATES + STATES * STATES)
NETWORKS_PARAMETERS = 214_550 + 215_578  # of the ellipse and the shape network: each is used once for each segment
BEAM_BYTES, POINT_BYTES = 12, 48
SURFEL_BYTES = 136
CELL_BYTES = 12  # of which no image showed anything of the class: height, weight, images


@dataclasses.dataclass(frozen=True)
class Work:
    """Of one scan: operations are single multiplications, additions or comparisons of double precision."""
    operations: float
    bytes: float

    def __add__(self, other):
        return Work(self.operations + other.operations, self.bytes + other.bytes)

    def __rmul__(self, times):
        return Work(times * self.operations, times * self.bytes)

    def limit_us(self, machine):
        """Arithmetic and memory run beside each other, so the longer of both."""
        return max(self.operations / machine["operations_per_us"], self.bytes / machine["bytes_per_us"])


# --- of one beam, one hit, one segment, one element, one cell

LIMITED_BEAM = Work(2, 2 * BEAM_BYTES)  # two comparisons
# Direction times range 2, turn and shift into the level frame 12, and in 2D 6, the pose at the time of the beam 6.
PROJECTED_BEAM = Work(26, BEAM_BYTES + 16 + POINT_BYTES)
SEGMENTED_BEAM = Work(8, POINT_BYTES)  # difference, square of its length, bounds on both gaps
LINE_HIT = Work(12, 16)  # sums of x, y, xx, xy and yy
EXPECTED_ELEMENT = Work(40, ELEMENT_BYTES + 40)  # state at the stamp, ellipse in the level frame
DIVIDED_HIT = Work(10, 16)  # distance from one outline
FITTED_HIT = Work(30 + 40, 16)  # residual, its 5 derivatives and their 15 products, one iteration
ARRIVED_HIT = Work(8 * 8, 8 * 16)  # turned into each of eight scans of the past, and compared with the beam there
DETECTED_SEGMENT = Work(NETWORKS_PARAMETERS, 0)  # a product and a sum in single precision are one operation in double
# Prediction of the covariance with velocities and turn rate; S = H P H' + R and its Cholesky factor, the gain by
# substitution, P - K S K' of which one half is needed.
UPDATED_ELEMENT = Work(2 * (3 * STATES * 2 + MEASURED ** 3 // 3 + STATES * MEASURED ** 2 + STATES ** 2 * MEASURED // 2),
                       2 * ELEMENT_BYTES)
MISSED_ELEMENT = Work(20, 80)  # predicted position, the beam there, existence
COMPARED_PAIR = Work(2 * (MEASURED ** 3 // 3 + MEASURED ** 2), ELEMENT_BYTES // 2)  # Mahalanobis distance
PUBLISHED_ELEMENT = Work(2 * 3 * STATES * 2, ELEMENT_BYTES + 300)
FUSED_HIT = Work(30, 16 + 2 * SURFEL_BYTES)  # distance along the normal, weights, position and normal
PASSED_BEAM = Work(20, 32)  # with one line of a chain
# The column above a cell for nine elevations at foot and top: projected 15, and labels between four pixels 10.
CELL = Work(9 * 2 * 25, 2 * CELL_BYTES)
# A residual by four vertices of the spline, and its products with their twelve parameters.
SPLINEGON_ELEMENT = Work(40 + 2 * 78, SURFEL_BYTES)
REFLECTOR = Work(4, 16)

SCAN_TO_POLYLINES = LIMITED_BEAM + PROJECTED_BEAM + SEGMENTED_BEAM + LINE_HIT
POLYLINES_TO_MAP = FUSED_HIT + PASSED_BEAM
CORRIDOR_BEAMS, STREET_BEAMS, HALL_BEAMS, FLIGHT_BEAMS = 541, 541, 720, 541
SPLINEGON_ELEMENTS = 500  # of a boundary with twenty vertices


def of_stages(line):
    """{stage: Work} of a line of pipeline_speed."""
    beams, segments, elements = line["beams"], line["segments"], line["elements"]
    hits = line["hits"]
    return {"limit": beams * LIMITED_BEAM, "project": beams * PROJECTED_BEAM, "expect": elements * EXPECTED_ELEMENT,
            "segment": beams * SEGMENTED_BEAM, "divide": hits * DIVIDED_HIT, "lines": beams * LINE_HIT,
            "detect": segments * DETECTED_SEGMENT + hits * FITTED_HIT, "arrivals": hits * ARRIVED_HIT,
            "update": line["detections"] * UPDATED_ELEMENT, "publish": elements * PUBLISHED_ELEMENT}


# --- the machine


def rates(program, core):
    """{"operations_per_us", "bytes_per_us"} of a core."""
    command = ["taskset", "-c", str(core), program, "--benchmark_format=json", "--benchmark_repetitions=3"]
    lines = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)["benchmarks"]
    return {name: statistics.median(line[name] for line in lines if name in line)
            for name in ("operations_per_us", "bytes_per_us")}
