/* A torque controller: the joints follow the joint reference, with inertia in front of the gains, and a slow
 * integral of what is left,
 *
 *     tau = M(q) (w^2 (q_ref - q) + 2 w (q_ref' - q') + w^3/10 integral (q_ref - q) dt) + D q_ref'
 *
 * as a process (main) and as functions of a shared library (torque, torque_declare). surgsim adds gravity. */
#include "surgsim_external.h"

static const double W_PER_S = 60.0;

int64_t torque(const surgsim_request *in, double *integral, double *answer) {
    const int n = (int)in->n;
    double a[SURGSIM_MOST_JOINTS];
    for (int j = 0; j < n; j++) {
        const double error = in->q_ref[j] - in->q[j];
        integral[j] += in->dt_s * error;
        a[j] = W_PER_S * W_PER_S * error + 2.0 * W_PER_S * (in->qdot_ref[j] - in->v[j]);
        a[j] += 0.1 * W_PER_S * W_PER_S * W_PER_S * integral[j];
    }
    for (int i = 0; i < n; i++) {
        answer[i] = in->damping[i] * in->qdot_ref[i];
        for (int j = 0; j < n; j++) answer[i] += in->M[i][j] * a[j];
    }
    return 0;
}

int64_t torque_declare(const surgsim_hello *hello, const char *text, surgsim_declaration *declaration) {
    (void)text; /* the arm as JSON, not needed here */
    surgsim_declare(declaration, "example torque in C", "1.0", SURGSIM_MOST_JOINTS);
    return hello->gives == SURGSIM_JOINT_TORQUE ? 0 : 1;
}

int main(void) {
    static double integral[SURGSIM_MOST_JOINTS];
    return surgsim_serve("example torque in C", "1.0", torque, integral, SURGSIM_MOST_JOINTS);
}
