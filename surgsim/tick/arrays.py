"""The records of a tick, and the signature of each kind of kernel that works on them.

A part's law is a function: its gains, what it may see, its memory, and where its answer goes. It returns a
status of `surgsim.tick.status`, allocates nothing that shows and raises nothing. What it sees and answers
are records: plain C structs, one piece of memory each, read by name as `seen.q` or `seen.Jv_WT[i, j]` in
Python and in compiled code. A record's layout follows from its class here and the number of joints n;
compiled code gets a pointer to it. The same function runs as Python and compiled, with the same result bit
for bit.

Notation of the names: docs/notation.md. Frames W world, T tip, C trocar.
"""

from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar, cast, get_type_hints

import numpy as np
from numba import from_dtype, types
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.errors import SurgsimError

Ids = NDArray[np.int64]

A1 = types.float64[::1]
A2 = types.float64[:, ::1]
I1 = types.int64[::1]
MOST_JOINTS = 8
"""Most joints of an arm; kernels set room aside for them."""
MOST_VALUES = 72
"""Most columns that a task or a resolver can add to the trace."""


FINISHED, OUT_OF_TIME = 1, 2
"""What a task says when it is over: nothing is left to do, or its time limit has passed before that."""


class Record:
    """Base of the records: fields in order, numbers as they are, arrays with their shape in `SHAPES`.

    A shape is a text of whole numbers and `n`, the number of joints, e.g. `3 n`. `ADDRESSES` names the fields
    that hold one: they mean something in their own simulation alone, and no snapshot has them.
    """

    SHAPES: ClassVar[dict[str, str]] = {}
    ADDRESSES: ClassVar[frozenset[str]] = frozenset()

    if TYPE_CHECKING:  # `new` makes records of NumPy, which have these

        @property
        def dtype(self) -> np.dtype[Any]:
            """Its layout."""

        @property
        def base(self) -> NDArray[Any]:
            """The memory that it views."""

        def copy(self) -> Self:
            """Another one with the same content."""

        def __getitem__(self, name: str) -> Any: ...

        def __setitem__(self, name: str, value: object) -> None: ...


R = TypeVar("R", bound=Record)


@cache
def layout(kind: Any, n: int) -> np.dtype[Any]:
    """Memory layout of a record for `n` joints: C's, with its alignment.

    Raises:
        SurgsimError: If there are more joints than kernels have room for.
    """
    if n > MOST_JOINTS:
        raise SurgsimError(f"the arm has {n} joints; at most {MOST_JOINTS} are supported")
    fields: list[tuple[Any, ...]] = []
    for name, hint in get_type_hints(kind).items():
        assert not hasattr(np.void, name), f"{kind.__name__}.{name} hides what NumPy calls so"
        if name in kind.SHAPES:
            shape = tuple(n if size == "n" else int(size) for size in kind.SHAPES[name].split())
            fields.append((name, np.float64, shape))
        elif isinstance(hint, type) and issubclass(hint, Record):
            inner: Any = hint
            fields.append((name, layout(inner, n)))
        elif hint in (float, int):
            fields.append((name, np.float64 if hint is float else np.int64))
    return np.dtype(fields, align=True)


def new(kind: type[R], n: int) -> R:
    """A record of zeros: a record of NumPy, with the fields of `kind`."""
    of: Any = kind
    return cast(R, np.zeros(1, layout(of, n)).view(np.recarray)[0])


@cache
def type_of(kind: Any, n: int) -> Any:
    """Numba's type of a record."""
    return from_dtype(layout(kind, n))


class Numbers(Record):
    """Where an array of doubles is; whoever fills it in keeps the array alive, `views.numbers` reads it.

    Numba counts the references of every array that it is handed, at every call: a few words that say where
    an array is cost nothing.

    Attributes:
        address: Of its first entry.
        length: How many entries.
    """

    ADDRESSES: ClassVar[frozenset[str]] = frozenset(("address",))
    address: int
    length: int


def point(where: Numbers, array: Array) -> None:
    """Fill in where `array` is.

    Raises:
        SurgsimError: If the array is not of doubles that lie side by side.
    """
    if array.dtype != np.float64 or not array.flags.c_contiguous:
        raise SurgsimError(f"a kernel's numbers are a contiguous array of float64, not of {array.dtype}")
    where.address, where.length = array.ctypes.data, array.size


class Model(Record):
    """The controller's own model of the arm, evaluated at one state (`surgsim.tick.nominal`).

    Attributes:
        mj_model: Address of MuJoCo's model.
        mj_data: Address of MuJoCo's data, of this record alone.
        qpos: Address of the joint positions in it; as the next five, of what it says by that name.
        qvel: Of the joint velocities.
        site_xpos: Of the tip's place.
        site_xmat: Of the tip's orientation.
        xaxis: Of the joint axes.
        xanchor: Of the points on them.
        xpos: Of the places of the bodies.
        xmat: Of their orientations.
        site: The tip's site.
        nbody: Bodies.
        corrected: 1 where `p_NT` and `R_NT` count, else 0.
        angled: 1 where the tip is not the shaft's end, else 0.
        p_TS: The shaft's end in the tip's frame (3,) [m].
        p_NT: Corrected tip in the nominal tip's frame (3,) [m].
        R_NT: Its orientation there (3, 3).
        q: Joint positions of the evaluation (n,) [rad].
        v: Joint velocities of the evaluation (n,) [rad/s].
        p_WT: Tip position (3,) [m].
        R_WT: Tip orientation (3, 3); its third column is the shaft axis.
        Jv_WT: Translational tip Jacobian (3, n) [m/rad].
        Jw_WT: Rotational tip Jacobian (3, n).
        p_WS: Place of the shaft's end (3,) [m]: the tip of a straight instrument.
        Jv_WS: Its translational Jacobian (3, n) [m/rad].
        z_W: Joint axes as rows (n, 3), unit.
        anchors_W: Points on the joint axes as rows (n, 3) [m].
        M: Joint-space inertia with armature (n, n) [kg m^2].
        bias: Coriolis, centrifugal and gravity torque (n,) [N m].
        damping: Viscous joint damping (n,) [N m s/rad].
    """

    SHAPES: ClassVar[dict[str, str]] = {
        "p_TS": "3",
        "p_NT": "3",
        "R_NT": "3 3",
        "q": "n",
        "v": "n",
        "p_WT": "3",
        "R_WT": "3 3",
        "Jv_WT": "3 n",
        "Jw_WT": "3 n",
        "p_WS": "3",
        "Jv_WS": "3 n",
        "z_W": "n 3",
        "anchors_W": "n 3",
        "M": "n n",
        "bias": "n",
        "damping": "n",
    }
    ADDRESSES: ClassVar[frozenset[str]] = frozenset(
        ("mj_model", "mj_data", "qpos", "qvel", "site_xpos", "site_xmat", "xaxis", "xanchor", "xpos", "xmat")
    )
    mj_model: int
    mj_data: int
    qpos: int
    qvel: int
    site_xpos: int
    site_xmat: int
    xaxis: int
    xanchor: int
    xpos: int
    xmat: int
    site: int
    nbody: int
    corrected: int
    angled: int
    p_TS: Array
    p_NT: Array
    R_NT: Array
    q: Array
    v: Array
    p_WT: Array
    R_WT: Array
    Jv_WT: Array
    Jw_WT: Array
    p_WS: Array
    Jv_WS: Array
    z_W: Array
    anchors_W: Array
    M: Array
    bias: Array
    damping: Array


class Seen(Record):
    """All that a controller's part may use at a tick: what is measured, the nominal model there, the command.

    Attributes:
        t_s: Time since the start [s].
        dt_s: Control period [s].
        first: 1 at the first tick after a reset, else 0: the memory is all zeros then.
        has_trocar: 1 with a trocar, else 0 and nothing is said of it.
        rows: RCM rows: 2, or 0 without a trocar.
        depth: Insertion depth of the shaft [m].
        roll_rate: Commanded turn about the shaft [rad/s].
        jaw: How far the jaws close, from 0 to 1.
        budget_j: Energy that may be given to the surroundings in this period [J]; infinite: no limit.
        omega_gain: alpha of Omega [1/s].
        limit_zone: How near the end of a joint's range the null space leads away from it [rad]; 0: never.
        tracked_samples: Poses of the instrument that a tracker has measured so far; 0: there is none.
        tracked_age_s: How much older than q the last of them is [s].
        has_wrench: 1 with a force-torque sensor at the flange, else 0.
        f_S: Force of the surroundings on the instrument that it measures (3,) [N].
        m_S: Their moment about the tip (3,) [N m].
        p_WT_m: Tip position in it (3,) [m].
        R_WT_m: Tip orientation in it (3, 3).
        q: Joint positions at which the kinematics were evaluated (n,) [rad].
        v: Joint velocities there (n,) [rad/s].
        tau: Joint torques that were measured over the last period (n,) [N m].
        f_T: Measured force of the surroundings on the tip (3,) [N].
        p_WT: Tip position (3,) [m].
        R_WT: Tip orientation (3, 3); its third column is the shaft axis.
        Jv_WT: Translational tip Jacobian (3, n) [m/rad].
        Jw_WT: Rotational tip Jacobian (3, n).
        p_WS: Place of the shaft's end (3,) [m]: the tip of a straight instrument.
        Jv_WS: Its translational Jacobian (3, n) [m/rad].
        z_W: Joint axes as rows (n, 3), unit.
        anchors_W: Points on the joint axes as rows (n, 3) [m].
        M: Inertia with armature (n, n) [kg m^2]; not filled on the kinematic plant.
        bias: Coriolis, centrifugal and gravity torque (n,) [N m]; not filled on the kinematic plant.
        damping: Viscous joint damping of the nominal model (n,) [N m s/rad].
        p_WC: Trocar position (3,) [m]; NaN without one. A port estimator sees the measured one, the other
            parts the estimate, shifted if the command says so.
        v_WC: Trocar velocity (3,) [m/s].
        a_WC: Trocar acceleration (3,) [m/s^2].
        rcm_error: e_N (2,) [m].
        J_rcm: RCM Jacobian (2, n) [m/rad].
        rcm_velocity: N C' (2,) [m/s].
        normals: N (2, 3), unit rows normal to the shaft.
        p_WTd: Commanded tip position (3,) [m]; a torque law sees the motion that the resolver follows.
        v_WTd: Commanded tip velocity (3,) [m/s].
        a_WTd: Commanded tip acceleration (3,) [m/s^2].
        budget_f_T: Force on the tip that the budget is reckoned with (3,) [N].
        lower: Lower velocity bounds Omega (n,) [rad/s].
        upper: Upper velocity bounds Omega (n,) [rad/s].
        q_min: Joint range (n,) [rad].
        q_max: Joint range (n,) [rad].
        v_max: Joint velocity limits (n,) [rad/s].
        a_max: Joint acceleration limits (n,) [rad/s^2].
        tau_max: Joint torque limits (n,) [N m].
        qdot_ref: The resolver's answer (n,) [rad/s]; of the last tick, for the resolver itself.
        q_ref: Joint reference, integrated from them (n,) [rad].
        elsewhere: The nominal model to be evaluated at other states.
    """

    SHAPES: ClassVar[dict[str, str]] = {
        **{name: shape for name, shape in Model.SHAPES.items()},
        "p_WT_m": "3",
        "R_WT_m": "3 3",
        "f_S": "3",
        "m_S": "3",
        "tau": "n",
        "f_T": "3",
        "p_WC": "3",
        "v_WC": "3",
        "a_WC": "3",
        "rcm_error": "2",
        "J_rcm": "2 n",
        "rcm_velocity": "2",
        "normals": "2 3",
        "p_WTd": "3",
        "v_WTd": "3",
        "a_WTd": "3",
        "budget_f_T": "3",
        "lower": "n",
        "upper": "n",
        "q_min": "n",
        "q_max": "n",
        "v_max": "n",
        "a_max": "n",
        "tau_max": "n",
        "qdot_ref": "n",
        "q_ref": "n",
    }
    t_s: float
    dt_s: float
    first: int
    has_trocar: int
    rows: int
    depth: float
    roll_rate: float
    jaw: float
    budget_j: float
    omega_gain: float
    limit_zone: float
    tracked_samples: int
    tracked_age_s: float
    has_wrench: int
    f_S: Array
    m_S: Array
    p_WT_m: Array
    R_WT_m: Array
    q: Array
    v: Array
    tau: Array
    f_T: Array
    p_WT: Array
    R_WT: Array
    Jv_WT: Array
    Jw_WT: Array
    p_WS: Array
    Jv_WS: Array
    z_W: Array
    anchors_W: Array
    M: Array
    bias: Array
    damping: Array
    p_WC: Array
    v_WC: Array
    a_WC: Array
    rcm_error: Array
    J_rcm: Array
    rcm_velocity: Array
    normals: Array
    p_WTd: Array
    v_WTd: Array
    a_WTd: Array
    budget_f_T: Array
    lower: Array
    upper: Array
    q_min: Array
    q_max: Array
    v_max: Array
    a_max: Array
    tau_max: Array
    qdot_ref: Array
    q_ref: Array
    elsewhere: Model


class Resolved(Record):
    """Where a resolver's answer goes.

    Attributes:
        residual: Norm of the task and RCM rows that it leaves unmet [m/s].
        qdot: Joint velocities inside the bounds (n,) [rad/s].
        p_WTd: Tip motion that they follow, for the torque law (3,) [m]; the command's unless written.
        v_WTd: (3,) [m/s].
        a_WTd: (3,) [m/s^2].
        values: Values of the resolver's own columns, as many as it has.
    """

    SHAPES: ClassVar[dict[str, str]] = {
        "qdot": "n",
        "p_WTd": "3",
        "v_WTd": "3",
        "a_WTd": "3",
        "values": str(MOST_VALUES),
    }
    residual: float
    qdot: Array
    p_WTd: Array
    v_WTd: Array
    a_WTd: Array
    values: Array


class Feedback(Record):
    """What a task is told at a tick: the time, and for one that reacts the instrument as measured.

    Attributes:
        t_s: Time [s].
        p_WT: Tip position (3,) [m].
        v_WT: Tip velocity (3,) [m/s].
        R_WT: Tip orientation (3, 3).
        w_WT: Angular velocity of the instrument (3,) [rad/s].
        f_T: Measured force of the surroundings on the tip (3,) [N].
        plant: The plant's columns now, for a task that looks at things in the patient; none without a plant.
    """

    SHAPES: ClassVar[dict[str, str]] = {"p_WT": "3", "v_WT": "3", "R_WT": "3 3", "w_WT": "3", "f_T": "3"}
    t_s: float
    p_WT: Array
    v_WT: Array
    R_WT: Array
    w_WT: Array
    f_T: Array
    plant: Numbers


class Command(Record):
    """Where a task's command goes.

    Attributes:
        roll_rate: Turn about the shaft [rad/s].
        jaw: How far the jaws close, from 0 to 1.
        budget_j: Energy that the controller may spend [J]; infinite: no limit.
        finished: 0 while there is something left to do, `FINISHED`, or `OUT_OF_TIME`.
        p_WTd: Tip position (3,) [m].
        v_WTd: Tip velocity (3,) [m/s].
        a_WTd: Tip acceleration (3,) [m/s^2].
        budget_f_T: Force on the tip that the budget is reckoned with (3,) [N].
        rcm_shift: From the trocar to the point that the shaft is held through in its place (3,) [m].
        rcm_shift_rate: Its rate of change (3,) [m/s].
        values: Values of the task's own columns, as many as it has.
    """

    SHAPES: ClassVar[dict[str, str]] = {
        "p_WTd": "3",
        "v_WTd": "3",
        "a_WTd": "3",
        "budget_f_T": "3",
        "rcm_shift": "3",
        "rcm_shift_rate": "3",
        "values": str(MOST_VALUES),
    }
    roll_rate: float
    jaw: float
    budget_j: float
    finished: int
    p_WTd: Array
    v_WTd: Array
    a_WTd: Array
    budget_f_T: Array
    rcm_shift: Array
    rcm_shift_rate: Array
    values: Array


class Minds(Record):
    """Kernels, numbers and memories of a controller's parts, and the terms of its torque.

    Attributes:
        instrument: Address of the instrument estimator's kernel.
        port: Of the port estimator's.
        resolver: Of the resolver's.
        law: Of the torque law's.
        instrument_gains: Of the instrument estimator.
        instrument_memory: Of the instrument estimator.
        port_gains: Of the port estimator.
        port_memory: Of the port estimator.
        resolver_gains: Of the resolver.
        resolver_memory: Of the resolver.
        law_gains: Of the torque law.
        law_memory: Of the torque law.
        terms: Terms of the torque (k, n) [N m], row by row.
    """

    ADDRESSES: ClassVar[frozenset[str]] = frozenset(("instrument", "port", "resolver", "law"))
    instrument: int
    port: int
    resolver: int
    law: int
    instrument_gains: Numbers
    instrument_memory: Numbers
    port_gains: Numbers
    port_memory: Numbers
    resolver_gains: Numbers
    resolver_memory: Numbers
    law_gains: Numbers
    law_memory: Numbers
    terms: Numbers


class Control(Record):
    """A controller at a tick.

    Attributes:
        has_law: Whether there is a torque law, else 0.
        at_reference: Whether the resolver's kinematics are those of the joint reference.
        commands_reference: Whether the arm's own impedance loop is given the joint reference, and the law's
            torque beside it.
        corrects: Whether the instrument estimator may correct the nominal model.
        who: Written: the part that a status other than GOES_ON came from.
        adds_avoidance: Whether null-space motion away from joint limits is added to the resolver's answer.
        q_ref: Joint reference at this tick (n,) [rad].
        torque: Sum of the law's terms (n,) [N m].
        correction: Twist of the corrected tip in the nominal tip's frame, rows linear [m] and angular [rad]
            (2, 3).
        port: Rows position, velocity and acceleration of the estimated port (3, 3).
        minds: Where the parts' kernels, numbers and memories are.
        command: The task's command.
        seen: What the parts see, one after the other: instrument and port estimator, resolver, torque law.
        referred: What the resolver sees where it is evaluated at the joint reference.
        measured: The nominal model at the measured state.
        reference: The nominal model at the joint reference.
        resolved: The resolver's answer.
    """

    SHAPES: ClassVar[dict[str, str]] = {
        "q_ref": "n",
        "torque": "n",
        "correction": "2 3",
        "port": "3 3",
    }
    has_law: int
    at_reference: int
    commands_reference: int
    corrects: int
    who: int
    adds_avoidance: int
    q_ref: Array
    torque: Array
    correction: Array
    port: Array
    minds: Minds
    command: Command
    seen: Seen
    referred: Seen
    measured: Model
    reference: Model
    resolved: Resolved


class World(Record):
    """The plant: where MuJoCo's arrays are, and what the plant's parts act on.

    MuJoCo's own arrays are read through the functions of `surgsim.tick.views`.

    Attributes:
        mj_model: Address of MuJoCo's model.
        mj_data: Address of MuJoCo's data.
        xaxis: Address of the joints' axes; as the following, of the array of MuJoCo's data by that name.
        xanchor: Points on them.
        qpos: All positions.
        qvel: All velocities.
        ctrl: All controls.
        qfrc_bias: Bias torques.
        qfrc_applied: Applied generalized forces, zeroed before every step.
        xfrc_applied: Applied forces and torques on bodies, zeroed before every step.
        xpos: Body places.
        xquat: Body orientations, wxyz.
        xmat: Body orientations.
        xipos: Centres of mass.
        site_xpos: Site places.
        site_xmat: Site orientations.
        cfrc_ext: External forces on bodies.
        cfrc_int: Forces between bodies and their parents.
        subtree_com: Centres of mass of the bodies with all that hangs on them.
        mocap_pos: Places of the mocap bodies.
        sensordata: Sensors.
        nq: Positions.
        nv: Velocities.
        nbody: Bodies.
        nsite: Sites.
        njnt: Joints.
        first_qpos: Where the arm's positions begin.
        first_dof: Where its velocities begin.
        first_ctrl: Where its motors begin.
        first_joint: Where its joints begin.
        tip: Site of the tip.
        entry: Site of the shaft's entry.
        shaft_end: Site of the shaft's end: the tip's of a straight instrument.
        trocar: Site of the trocar, or -1.
        jaws: Body of the jaws, or -1.
        hinged: Bodies after it that are jaws on hinges.
        mocap: The port's mocap row, or -1.
        substeps: Physics steps in a control period.
        disturbed: Whether there are parts or a wall.
        touched: Whether the tip can be touched.
        walled: Whether there is a physical wall.
        tick: Control ticks since the reset.
        t_s: Time of the state [s].
        step_s: Time of the physics step [s].
        dt_s: Control period [s].
        timestep_s: Physics step [s].
        jaw: How far the jaws are told to close.
        tracked_samples: Poses of the instrument that a tracker has measured so far.
        tracked_age_s: How much older than the measured joint positions the last of them is [s].
        has_wrench: 1 with a force-torque sensor at the flange, else 0.
        tau_max: Torque limits (n,) [N m].
        torque: Torque on its way to the joints (n,) [N m].
        qdot: The resolver's velocities (n,) [rad/s].
        q_cmd: Joint positions at the end of the period on their way to the arm's own impedance loop (n,)
            [rad]; NaN: there are none, the torque is the command; infinite: no command arrived.
        q: True joint positions (n,) [rad].
        v: True joint velocities (n,) [rad/s].
        tau: Torque that the actuators gave over the last period (n,) [N m].
        p_WT: Tip (3,) [m].
        p_WS: End of the shaft: the tip of a straight instrument (3,) [m].
        p_WR: A second point of the shaft axis (3,) [m].
        p_WC: Trocar, or NaN (3,) [m].
        f_C: Force of the shaft on the wall, or NaN (3,) [N].
        f_T: Force of the surroundings on the tip (3,) [N].
        port_home: Configured place of the port (3,) [m].
        port_offset: How far the port's place of rest has moved (3,) [m].
        port_velocity: Its velocity (3,) [m/s].
        q_m: Measured joint positions (n,) [rad].
        v_m: Measured joint velocities (n,) [rad/s].
        tau_m: Measured joint torques (n,) [N m].
        p_WC_m: Trocar as the controller is told (3,) [m].
        v_WC_m: Trocar's velocity as announced (3,) [m/s].
        f_T_m: Measured force on the tip (3,) [N].
        f_S_m: Force on the instrument that a sensor at the flange measures (3,) [N].
        m_S_m: Its moment about the tip (3,) [N m].
        p_WT_m: Tip in the tracker's last sample; NaN without one (3,) [m].
        R_WT_m: Tip orientation in it (3, 3).
    """

    SHAPES: ClassVar[dict[str, str]] = {
        **{
            name: "n"
            for name in ("tau_max", "torque", "qdot", "q_cmd", "q", "v", "tau", "q_m", "v_m", "tau_m")
        },
        **{name: "3" for name in ("p_WT", "p_WS", "p_WR", "p_WC", "f_C", "f_T", "p_WC_m", "v_WC_m", "f_T_m")},
        **{name: "3" for name in ("port_home", "port_offset", "port_velocity")},
        **{name: "3" for name in ("f_S_m", "m_S_m", "p_WT_m")},
        "R_WT_m": "3 3",
    }
    ADDRESSES: ClassVar[frozenset[str]] = frozenset(
        (
            "mj_model",
            "mj_data",
            "xaxis",
            "xanchor",
            "qpos",
            "qvel",
            "ctrl",
            "qfrc_bias",
            "qfrc_applied",
            "xfrc_applied",
            "xpos",
            "xquat",
            "xmat",
            "xipos",
            "site_xpos",
            "site_xmat",
            "cfrc_ext",
            "cfrc_int",
            "subtree_com",
            "mocap_pos",
            "sensordata",
        )
    )
    mj_model: int
    mj_data: int
    xaxis: int
    xanchor: int
    qpos: int
    qvel: int
    ctrl: int
    qfrc_bias: int
    qfrc_applied: int
    xfrc_applied: int
    xpos: int
    xquat: int
    xmat: int
    xipos: int
    site_xpos: int
    site_xmat: int
    cfrc_ext: int
    cfrc_int: int
    subtree_com: int
    mocap_pos: int
    sensordata: int
    nq: int
    nv: int
    nbody: int
    nsite: int
    njnt: int
    first_qpos: int
    first_dof: int
    first_ctrl: int
    first_joint: int
    tip: int
    entry: int
    shaft_end: int
    trocar: int
    jaws: int
    hinged: int
    mocap: int
    substeps: int
    disturbed: int
    touched: int
    walled: int
    tick: int
    t_s: float
    step_s: float
    dt_s: float
    timestep_s: float
    jaw: float
    tracked_samples: int
    tracked_age_s: float
    has_wrench: int
    tau_max: Array
    torque: Array
    qdot: Array
    q_cmd: Array
    q: Array
    v: Array
    tau: Array
    p_WT: Array
    p_WS: Array
    p_WR: Array
    p_WC: Array
    f_C: Array
    f_T: Array
    port_home: Array
    port_offset: Array
    port_velocity: Array
    q_m: Array
    v_m: Array
    tau_m: Array
    p_WC_m: Array
    v_WC_m: Array
    f_T_m: Array
    f_S_m: Array
    m_S_m: Array
    p_WT_m: Array
    R_WT_m: Array


@cache
def resolver_signature(n: int) -> Any:
    """Status = step(gains, seen, memory, out: Resolved)."""
    return types.int64(A1, type_of(Seen, n), A1, type_of(Resolved, n))


@cache
def law_signature(n: int) -> Any:
    """Status = torque(gains, seen, memory, out: terms of the torque as rows (k, n)).

    Of a port estimator too: out has the rows position, velocity and acceleration (3, 3). And of an instrument
    estimator: the rows linear and angular (2, 3) of the correction's twist.
    """
    return types.int64(A1, type_of(Seen, n), A1, A2)


@cache
def task_signature() -> Any:
    """Status = command(gains, feedback, memory, out: Command)."""
    return types.int64(A1, type_of(Feedback, 0), A1, type_of(Command, 0))


@cache
def hook_signature(n: int) -> Any:
    """Status = hook(gains, world, memory, out: the part's columns (k,)), of a disturbance or prop."""
    return types.int64(A1, type_of(World, n), A1, A1)
