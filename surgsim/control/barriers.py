"""Vector-field inequalities at acceleration level: the port's sphere and walls as rows of q''.

A bound h(q, t) >= 0 of relative degree two is kept by the row

    h'' + (p1 + p2) h' + p1 p2 h >= 0

where h' + p1 h >= 0 and h >= 0 held before: h' + p1 h decays no faster than exp(-p2 t), and h no faster than
exp(-p1 t). With real p1, p2 > 0 neither changes its sign.

    sphere   h = R^2 - D,  D = e . e,  D' = 2 e_N . e_N',  D'' = 2 (|e_N'|^2 + (d' . e)^2) + 2 e_N . e_N''
    wall     h = offset - n . p

with the RCM error e and its components e_N of `surgsim.control.rcm`; e' has the component -(d' . e) along the
shaft. D, not its root: the distance has no gradient where the shaft passes through the port.

Source: the first-order form is that of Marinho et al., IEEE T-RO 35:1166 (2019) and ICRA 2019; the
second-order form that of exponential control barrier functions, Nguyen and Sreenath, ACC 2016, with real
poles, and of the inequalities for torque-actuated robots of Quiroz-Omana and Adorno, IEEE RA-L 4:4048 (2019).
"""

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.control.manipulability import fill_velocity_products
from surgsim.control.rcm import fill_rcm, fill_rcm_bias
from surgsim.tick.algebra import cross, dot, times
from surgsim.tick.arrays import Model, Seen
from surgsim.tick.scratch import scratch, scratch_matrix

Sphere = tuple[float, float, float]


@compiled
def entry_curvature(
    model: Model | Seen, v: Array, p_WC: Array, v_WC: Array, a_WC: Array, row: Array
) -> Sphere:
    """Fill `row` (n,) with J_D; D, D' and D'' of the shaft at the joint velocities v, with q'' = 0.

    Args:
        model: The arm, placed.
        v: Joint velocities (n,) [rad/s].
        p_WC: Port (3,) [m].
        v_WC: Its velocity (3,) [m/s].
        a_WC: Its acceleration (3,) [m/s^2].
        row: Filled.

    Returns:
        D [m^2], D' [m^2/s], D'' at q'' = 0 [m^2/s^2].
    """
    linear, angular, axis, rate = scratch(3), scratch(3), scratch(3), scratch(2)
    error, moving, bias, omega = scratch(2), scratch(2), scratch(2), scratch(3)
    J, normals = scratch_matrix(2, v.size), scratch_matrix(2, 3)
    fill_velocity_products(model.Jv_WS, model.z_W, v, linear, angular)
    fill_rcm(model.p_WS, model.R_WT, model.Jv_WS, model.Jw_WT, p_WC, v_WC, error, J, moving, normals)
    fill_rcm_bias(model.p_WS, model.R_WT, model.Jv_WS, model.Jw_WT, v, p_WC, v_WC, linear, angular, bias)
    times(model.Jw_WT, v, omega)
    axis[:] = model.R_WT[:, 2]
    cross(omega, axis, axis)
    along = square = slope = bend = 0.0
    for k in range(2):
        rate[k] = dot(J[k], v) - moving[k]
        along += error[k] * dot(normals[k], axis)
        square += error[k] * error[k]
        slope += 2.0 * error[k] * rate[k]
        bend += 2.0 * (rate[k] * rate[k] + error[k] * (bias[k] - dot(normals[k], a_WC)))
    for j in range(v.size):
        row[j] = 2.0 * (error[0] * J[0, j] + error[1] * J[1, j])
    return square, slope, bend + 2.0 * along * along


@compiled
def fill_entry_barrier(
    seen: Seen, model: Model, late: float, radius: float, poles: Array, row: Array
) -> float:
    """Fill the row (n,) that keeps the shaft inside the sphere about the port; its upper bound [m^2/s^2].

    Args:
        seen: The port of now.
        model: The arm `late` [s] from now.
        late: How much later that is.
        radius: R [m].
        poles: p1, p2 (2,) [1/s].
        row: Filled with J_D.
    """
    p_WC, v_WC = scratch(3), scratch(3)
    for i in range(3):
        p_WC[i] = seen.p_WC[i] + late * (seen.v_WC[i] + 0.5 * late * seen.a_WC[i])
        v_WC[i] = seen.v_WC[i] + late * seen.a_WC[i]
    square, slope, bend = entry_curvature(model, model.v, p_WC, v_WC, seen.a_WC, row)
    most: float = poles[0] * poles[1] * (radius * radius - square) - (poles[0] + poles[1]) * slope - bend
    return most


@compiled
def fill_plane_barriers(planes: Array, model: Model, poles: Array, rows: Array, most: Array) -> None:
    """Fill rows (k, n) and upper bounds (k,) [m/s^2] that keep the tip on the allowed side of k walls.

    Args:
        planes: The walls, from `surgsim.control.planes.plane_numbers` (4 k,).
        model: The arm.
        poles: p1, p2 (2,) [1/s].
        rows: Filled with n . J_T.
        most: Filled.
    """
    linear, angular, rate = scratch(3), scratch(3), scratch(3)
    fill_velocity_products(model.Jv_WT, model.z_W, model.v, linear, angular)
    times(model.Jv_WT, model.v, rate)
    for k in range(most.size):
        normal = planes[4 * k : 4 * k + 3]
        room = planes[4 * k + 3] - dot(normal, model.p_WT)
        most[k] = poles[0] * poles[1] * room - (poles[0] + poles[1]) * dot(normal, rate) - dot(normal, linear)
        for j in range(rows.shape[1]):
            s = 0.0
            for i in range(3):
                s += normal[i] * model.Jv_WT[i, j]
            rows[k, j] = s
