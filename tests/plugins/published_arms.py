"""Arms as their sources print them: chains of turning links, with kinematics and dynamics written here."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

GRAVITY_M_PER_S2 = 9.81


def pose(turn: np.ndarray, shift: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Homogeneous matrix (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, shift
    return matrix


def about(axis: int, angle: float) -> np.ndarray:
    """Rotation (3, 3) about x, y or z, for axis 0, 1 or 2."""
    c, s, matrix = np.cos(angle), np.sin(angle), np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def craig(alpha: float, a: float, d: float) -> np.ndarray:
    """A row of modified (Craig) DH without its joint angle: Rx(alpha) Tx(a) Tz(d)."""
    return pose(about(0, alpha)) @ pose(np.eye(3), (a, 0.0, d))


def urdf(xyz: Sequence[float], roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Origin of a URDF joint."""
    return pose(about(2, yaw) @ about(1, pitch) @ about(0, roll), xyz)


def slope(function: Callable[[np.ndarray], np.ndarray | float], q: Sequence[float]) -> np.ndarray:
    """Central differences of `function` along the joints, in the last axis."""
    steps = 1e-6 * np.eye(len(q))
    return np.stack([(function(q + h) - function(q - h)) / 2e-6 for h in steps], axis=-1)


def tensor(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> np.ndarray:
    """Symmetric matrix (3, 3)."""
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def steiner(mass: float, com: Sequence[float]) -> np.ndarray:
    """What a point mass at `com` [m] adds to the tensor about the origin (3, 3) [kg m2]."""
    c = np.array(com)
    return mass * (c @ c * np.eye(3) - np.outer(c, c))


@dataclass(frozen=True, kw_only=True)
class PublishedArm:
    """A chain of links, each of which turns about the z of its frame.

    Attributes:
        placements: Pose (4, 4) of each joint in the frame of the link before it.
        flange_m: Distance of the flange from the last frame along its z [m].
        masses: [kg].
        coms: Centres of mass in the links' frames [m].
        tensors: Inertias about the centres of mass in the links' axes (3, 3) [kg m2].
    """

    placements: tuple[np.ndarray, ...]
    flange_m: float
    masses: tuple[float, ...]
    coms: tuple[Sequence[float], ...]
    tensors: tuple[np.ndarray, ...]

    def frames(self, q: Sequence[float]) -> list[np.ndarray]:
        """Poses (4, 4) of the links."""
        frames, here = [], np.eye(4)
        for placement, angle in zip(self.placements, q, strict=True):
            here = here @ placement @ pose(about(2, angle))
            frames.append(here)
        return frames

    def flange(self, q: Sequence[float]) -> np.ndarray:
        """Position (3,) [m]."""
        return (self.frames(q)[-1] @ [0, 0, self.flange_m, 1])[:3]

    def centres(self, q: Sequence[float]) -> np.ndarray:
        """Centres of mass (n, 3) [m]."""
        return np.array([(T @ [*c, 1])[:3] for T, c in zip(self.frames(q), self.coms, strict=True)])

    def potential_energy(self, q: Sequence[float]) -> float:
        """[J]."""
        return float(np.dot(self.masses, self.centres(q)[:, 2]) * GRAVITY_M_PER_S2)

    def mass_matrix(self, q: Sequence[float]) -> np.ndarray:
        """Sum over the links of Jv' m Jv + Jw' R I R' Jw (n, n), without rotors [kg m2]."""
        frames, Jv, n = self.frames(q), slope(self.centres, np.array(q)), len(self.masses)
        M = np.zeros((n, n))
        for i, (T, m, inertia) in enumerate(zip(frames, self.masses, self.tensors, strict=True)):
            R, Jw = T[:3, :3], np.zeros((3, n))
            Jw[:, : i + 1] = np.stack([frame[:3, 2] for frame in frames[: i + 1]], axis=1)
            M += m * Jv[i].T @ Jv[i] + Jw.T @ R @ inertia @ R.T @ Jw
        return M


H = np.pi / 2
# Franka Control Interface documentation: modified (Craig) DH of joints 1 to 7 and the flange, Panda and FR3.
FRANKA_DH = tuple(
    craig(alpha, a, d)
    for alpha, a, d in zip(
        (0, -H, H, H, -H, H, H),
        (0, 0, 0, 0.0825, -0.0825, 0, 0.088),
        (0.333, 0, 0.316, 0, 0.384, 0, 0),
        strict=True,
    )
)
PANDA = PublishedArm(
    placements=FRANKA_DH,
    flange_m=0.107,
    # Gaz et al. 2019 as in MuJoCo Menagerie, in the DH frame.
    masses=(4.970684, 0.646926, 3.228604, 3.587895, 1.225946, 1.666555, 0.735522),
    coms=(
        (0.003875, 0.002081, -0.04762),
        (-0.003141, -0.02872, 0.003495),
        (0.027518, 0.039252, -0.066502),
        (-0.05317, 0.104419, 0.027454),
        (-0.011953, 0.041065, -0.038437),
        (0.060149, -0.014117, -0.010517),
        (0.010517, -0.004252, 0.061597),
    ),
    tensors=(
        tensor(0.70337, 0.70661, 0.009117, -0.000139, 0.006772, 0.019169),
        tensor(0.007962, 0.02811, 0.025995, -0.003925, 0.010254, 0.000704),
        tensor(0.037242, 0.036155, 0.01083, -0.004761, -0.011396, -0.012805),
        tensor(0.025853, 0.019552, 0.028323, 0.007796, -0.001332, 0.008641),
        tensor(0.035549, 0.029474, 0.008627, -0.002117, -0.004037, 0.000229),
        tensor(0.001964, 0.004354, 0.005433, 0.000109, -0.001158, 0.000341),
        tensor(0.012516, 0.010027, 0.004815, -0.000428, -0.001196, -0.000741),
    ),
)

# frankaemika/franka_description, robots/fr3/inertials.yaml: its tensors are about the links' origins.
FR3_MASSES = (
    2.9274653454,
    2.9355370338,
    2.2449013699,
    2.6155955791,
    2.3271207594,
    1.8170376524,
    0.6271432862,
)
FR3_COMS = (
    (0.0000004128, -0.0181251324, -0.0386035970),
    (0.0031828864, -0.0743221644, 0.0088146084),
    (0.0407015686, -0.0048200565, -0.0289730823),
    (-0.0459100965, 0.0630492960, -0.0085187868),
    (-0.0016039605, 0.0292536262, -0.0972965990),
    (0.0597131221, -0.0410294666, -0.0101692726),
    (0.0045225817, 0.0086261921, -0.0161633251),
)
FR3_TENSORS_ABOUT_ORIGINS = (
    tensor(
        0.023927316485107913,
        0.0224821613275756,
        0.006350098258530016,
        1.3317903455714081e-05,
        -0.00011404774918616684,
        -0.0019950320628240115,
    ),
    tensor(
        0.041938946257609425,
        0.02514514885014724,
        0.06170214472888839,
        0.00020257331521090626,
        0.004077784227179924,
        -0.0042252158006570156,
    ),
    tensor(
        0.02410142547240885,
        0.01974053266708178,
        0.019044494482244823,
        0.002404694559042109,
        -0.002856269270114313,
        -0.002104212683891874,
    ),
    tensor(
        0.03452998321913202,
        0.028881621933049058,
        0.04125471171146641,
        0.01322552265982813,
        0.01015142998484113,
        -0.0009762833870704552,
    ),
    tensor(
        0.051610278463662895,
        0.04787729713371481,
        0.016423625579357254,
        -0.005715173387783472,
        -0.0035673167625872135,
        0.010673985108535986,
    ),
    tensor(
        0.005412333594383447,
        0.014058329545509979,
        0.016080817924212554,
        0.006193456360285834,
        0.0014219289306117652,
        -0.0013140753741120031,
    ),
    tensor(
        0.00021092389150104718,
        0.00017718568002411474,
        5.993190599659971e-05,
        -2.433299114461931e-05,
        4.564480393778983e-05,
        8.744070223226438e-05,
    ),
)
FR3 = PublishedArm(
    placements=FRANKA_DH,
    flange_m=0.107,
    masses=FR3_MASSES,
    coms=FR3_COMS,
    tensors=tuple(
        about_origin - steiner(mass, com)
        for about_origin, mass, com in zip(FR3_TENSORS_ABOUT_ORIGINS, FR3_MASSES, FR3_COMS, strict=True)
    ),
)

# RobotLocomotion/drake, manipulation/models/iiwa_description, iiwa14_primitive_collision.urdf of 2024.
IIWA14 = PublishedArm(
    placements=(
        urdf((0, 0, 0.1575), 0, 0, 0),
        urdf((0, 0, 0.2025), H, 0, np.pi),
        urdf((0, 0.2045, 0), H, 0, np.pi),
        urdf((0, 0, 0.2155), H, 0, 0),
        urdf((0, 0.1845, 0), -H, np.pi, 0),
        urdf((0, 0, 0.2155), H, 0, 0),
        urdf((0, 0.081, 0), -H, np.pi, 0),
    ),
    flange_m=0.045,
    masses=(5.76, 6.35, 3.5, 3.5, 3.5, 1.8, 1.2),
    coms=(
        (0, -0.03, 0.12),
        (0.0003, 0.059, 0.042),
        (0, 0.03, 0.13),
        (0, 0.067, 0.034),
        (0.0001, 0.021, 0.076),
        (0, 0.0006, 0.0004),
        (0, 0, 0.02),
    ),
    tensors=tuple(
        np.diag(moments)
        for moments in (
            (0.033, 0.0333, 0.0123),
            (0.0305, 0.011, 0.0304),
            (0.025, 0.0238, 0.0076),
            (0.017, 0.006, 0.0164),
            (0.01, 0.0087, 0.00449),
            (0.0049, 0.0047, 0.0036),
            (0.001, 0.001, 0.001),
        )
    ),
)
PUBLISHED = {"fr3": FR3, "iiwa14": IIWA14, "panda": PANDA}
