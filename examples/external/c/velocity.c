/* A velocity controller: the least joint velocity that moves the tip and holds the shaft in the trocar,
 *
 *     q' = J^T (J J^T)^-1 v,   J = [J_T; J_rcm],   v = [v_d - k (p - p_d); N C' - k e]
 *
 * as a process (main) and as functions of a shared library (velocity, velocity_declare). */
#include <math.h>
#include "surgsim_external.h"

#define ROWS 5
static const double K_PER_S = 5.0;

static int factor(int m, double A[ROWS][ROWS]) { /* A becomes its lower Cholesky factor; 0 where it has none */
    for (int j = 0; j < m; j++) {
        double s = A[j][j];
        for (int k = 0; k < j; k++) s -= A[j][k] * A[j][k];
        if (!(s > 1e-14 * A[j][j])) return 0;
        A[j][j] = sqrt(s);
        for (int i = j + 1; i < m; i++) {
            s = A[i][j];
            for (int k = 0; k < j; k++) s -= A[i][k] * A[j][k];
            A[i][j] = s / A[j][j];
        }
    }
    return 1;
}

static void solve(int m, double L[ROWS][ROWS], double x[ROWS]) { /* x becomes (L L^T)^-1 x */
    for (int i = 0; i < m; i++) {
        for (int k = 0; k < i; k++) x[i] -= L[i][k] * x[k];
        x[i] /= L[i][i];
    }
    for (int i = m - 1; i >= 0; i--) {
        for (int k = i + 1; k < m; k++) x[i] -= L[k][i] * x[k];
        x[i] /= L[i][i];
    }
}

int64_t velocity(const surgsim_request *in, double *memory, double *answer) {
    const int n = (int)in->n, m = 3 + (int)in->rows;
    double J[ROWS][SURGSIM_MOST_JOINTS], A[ROWS][ROWS], v[ROWS];
    (void)memory;
    for (int i = 0; i < m; i++) {
        const double *row = i < 3 ? in->Jv_WT[i] : in->J_rcm[i - 3];
        for (int j = 0; j < n; j++) J[i][j] = row[j];
        v[i] = i < 3 ? in->v_WTd[i] - K_PER_S * (in->p_WT[i] - in->p_WTd[i])
                     : in->rcm_velocity[i - 3] - K_PER_S * in->rcm_error[i - 3];
    }
    for (int i = 0; i < m; i++)
        for (int k = 0; k < m; k++) {
            A[i][k] = 0.0;
            for (int j = 0; j < n; j++) A[i][k] += J[i][j] * J[k][j];
        }
    if (!factor(m, A)) return 1;
    solve(m, A, v);
    for (int j = 0; j < n; j++) {
        answer[j] = 0.0;
        for (int i = 0; i < m; i++) answer[j] += J[i][j] * v[i];
    }
    return 0;
}

int64_t velocity_declare(const surgsim_hello *hello, const char *text, surgsim_declaration *declaration) {
    (void)text; /* the arm as JSON, not needed here */
    surgsim_declare(declaration, "example velocity in C", "1.0", 0);
    return hello->gives == SURGSIM_JOINT_VELOCITY ? 0 : 1;
}

int main(void) { return surgsim_serve("example velocity in C", "1.0", velocity, 0, 0); }
