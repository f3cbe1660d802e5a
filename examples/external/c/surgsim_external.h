/* What surgsim and an external controller exchange. Made by `surgsim external header`.
 *
 * A process reads a surgsim_hello and text_bytes of JSON from its standard input and writes a
 * surgsim_declaration to its standard output; then it reads requests and writes one reply to each, until its
 * input ends. A function of a shared library, named f here, is
 *
 *     int64_t f_declare(const surgsim_hello *hello, const char *text, surgsim_declaration *declaration);
 *     int64_t f(const surgsim_request *request, double *memory, double *answer);
 *
 * The first fills the declaration and returns 0. The second fills answer[0..n-1] and returns 0, or 1 where there
 * is no command. `memory` holds as many doubles as it declared, all 0 where request->first is 1; it keeps
 * nothing elsewhere. Arrays over joints have room for SURGSIM_MOST_JOINTS: the arm's n come first.
 * SI units; frames W world, T tip, C trocar; matrices row by row. Numbers are little-endian, without gaps.
 */
#ifndef SURGSIM_EXTERNAL_H
#define SURGSIM_EXTERNAL_H

#include <stdint.h>
#include <string.h>
#include <unistd.h>

#define SURGSIM_VERSION 1
#define SURGSIM_MOST_JOINTS 8
#define SURGSIM_JOINT_VELOCITY 1
#define SURGSIM_JOINT_TORQUE 2
#define SURGSIM_HASH INT64_C(-1908477213626824159)
#define SURGSIM_HELLO INT64_C(8028911418491753043)
#define SURGSIM_DECLARATION INT64_C(30508584609993299)
#define SURGSIM_REQUEST INT64_C(118143297475155)
#define SURGSIM_REPLY INT64_C(8749491757085315667)

/* Once, at the beginning; a JSON text follows. */
typedef struct {
    int64_t magic; /* SURGSIM_HELLO */
    int64_t version; /* SURGSIM_VERSION */
    int64_t hash; /* SURGSIM_HASH, of the layout of request and reply */
    int64_t request_bytes; /* size of a request */
    int64_t reply_bytes; /* size of a reply */
    int64_t n; /* joints of the arm */
    int64_t gives; /* SURGSIM_JOINT_VELOCITY or SURGSIM_JOINT_TORQUE: what is to be answered */
    int64_t text_bytes; /* length of the JSON text that follows: the arm */
} surgsim_hello;

/* The answer to the hello. */
typedef struct {
    int64_t magic; /* SURGSIM_DECLARATION */
    int64_t version; /* SURGSIM_VERSION as it was compiled with */
    int64_t hash; /* SURGSIM_HASH as it was compiled with */
    int64_t memory; /* doubles that a function wants to keep from tick to tick; 0 for a process */
    char name[64]; /* what the controller is called */
    char release[64]; /* its version; both go into the results of a run */
} surgsim_declaration;

/* What a controller sees at a tick, and asks for; the fields are those of surgsim's own parts. */
typedef struct {
    int64_t magic; /* SURGSIM_REQUEST */
    int64_t tick; /* number of the request since `first` was 1, from 1 on; the reply repeats it */
    int64_t n; /* joints of the arm; of arrays over joints, the entries from n on are 0 */
    double t_s; /* Time since the start [s] */
    double dt_s; /* Control period [s] */
    int64_t first; /* 1 at the first tick after a reset, else 0: the memory is all zeros then */
    int64_t has_trocar; /* 1 with a trocar, else 0 and nothing is said of it */
    int64_t rows; /* RCM rows: 2, or 0 without a trocar */
    double depth; /* Insertion depth of the shaft [m] */
    double roll_rate; /* Commanded turn about the shaft [rad/s] */
    double jaw; /* How far the jaws close, from 0 to 1 */
    double budget_j; /* Energy that may be given to the surroundings in this period; infinite: no limit [J] */
    double omega_gain; /* alpha of Omega [1/s] */
    /* How near the end of a joint's range the null space leads away from it; 0: never [rad] */
    double limit_zone;
    /* Poses of the instrument that a tracker has measured so far; 0: there is none */
    int64_t tracked_samples;
    double tracked_age_s; /* How much older than q the last of them is [s] */
    int64_t has_wrench; /* 1 with a force-torque sensor at the flange, else 0 */
    double f_S[3]; /* Force of the surroundings on the instrument that it measures (3) [N] */
    double m_S[3]; /* Their moment about the tip (3) [N m] */
    double p_WT_m[3]; /* Tip position in it (3) [m] */
    double R_WT_m[3][3]; /* Tip orientation in it (3, 3) */
    double q[8]; /* Joint positions at which the kinematics were evaluated (n) [rad] */
    double v[8]; /* Joint velocities there (n) [rad/s] */
    double tau[8]; /* Joint torques that were measured over the last period (n) [N m] */
    double f_T[3]; /* Measured force of the surroundings on the tip (3) [N] */
    double p_WT[3]; /* Tip position (3) [m] */
    double R_WT[3][3]; /* Tip orientation; its third column is the shaft axis (3, 3) */
    double Jv_WT[3][8]; /* Translational tip Jacobian (3, n) [m/rad] */
    double Jw_WT[3][8]; /* Rotational tip Jacobian (3, n) */
    double p_WS[3]; /* Place of the shaft's end: the tip of a straight instrument (3) [m] */
    double Jv_WS[3][8]; /* Its translational Jacobian (3, n) [m/rad] */
    double z_W[8][3]; /* Joint axes as rows, unit (n, 3) */
    double anchors_W[8][3]; /* Points on the joint axes as rows (n, 3) [m] */
    double M[8][8]; /* Inertia with armature; not filled on the kinematic plant (n, n) [kg m^2] */
    /* Coriolis, centrifugal and gravity torque; not filled on the kinematic plant (n) [N m] */
    double bias[8];
    double damping[8]; /* Viscous joint damping of the nominal model (n) [N m s/rad] */
    /* Trocar position; NaN without one. A port estimator sees the measured one, the other parts the
     * estimate, shifted if the command says so (3) [m] */
    double p_WC[3];
    double v_WC[3]; /* Trocar velocity (3) [m/s] */
    double a_WC[3]; /* Trocar acceleration (3) [m/s^2] */
    double rcm_error[2]; /* e_N (2) [m] */
    double J_rcm[2][8]; /* RCM Jacobian (2, n) [m/rad] */
    double rcm_velocity[2]; /* N C' (2) [m/s] */
    double normals[2][3]; /* N, unit rows normal to the shaft (2, 3) */
    /* Commanded tip position; a torque law sees the motion that the resolver follows (3) [m] */
    double p_WTd[3];
    double v_WTd[3]; /* Commanded tip velocity (3) [m/s] */
    double a_WTd[3]; /* Commanded tip acceleration (3) [m/s^2] */
    double budget_f_T[3]; /* Force on the tip that the budget is reckoned with (3) [N] */
    double lower[8]; /* Lower velocity bounds Omega (n) [rad/s] */
    double upper[8]; /* Upper velocity bounds Omega (n) [rad/s] */
    double q_min[8]; /* Joint range (n) [rad] */
    double q_max[8]; /* Joint range (n) [rad] */
    double v_max[8]; /* Joint velocity limits (n) [rad/s] */
    double a_max[8]; /* Joint acceleration limits (n) [rad/s^2] */
    double tau_max[8]; /* Joint torque limits (n) [N m] */
    double qdot_ref[8]; /* The resolver's answer; of the last tick, for the resolver itself (n) [rad/s] */
    double q_ref[8]; /* Joint reference, integrated from them (n) [rad] */
} surgsim_request;

/* What a process answers to a request. */
typedef struct {
    int64_t magic; /* SURGSIM_REPLY */
    int64_t tick; /* of the request */
    int64_t status; /* 0; or 1 where there is no command that meets the constraints */
    double answer[8]; /* joint velocities or joint torques, as the hello asked for (n) [rad/s or N m] */
} surgsim_reply;

#ifndef __cplusplus
_Static_assert(sizeof(surgsim_hello) == 64, "no gaps");
_Static_assert(sizeof(surgsim_declaration) == 160, "no gaps");
_Static_assert(sizeof(surgsim_request) == 3168, "no gaps");
_Static_assert(sizeof(surgsim_reply) == 88, "no gaps");
#endif

/* Read or write all of `bytes`; 0, or -1 where the other end is closed. */
static inline int surgsim_read(int file, void *to, size_t bytes) {
    for (char *at = (char *)to; bytes > 0;) {
        ssize_t got = read(file, at, bytes);
        if (got <= 0) return -1;
        at += got, bytes -= (size_t)got;
    }
    return 0;
}

static inline int surgsim_write(int file, const void *from, size_t bytes) {
    for (const char *at = (const char *)from; bytes > 0;) {
        ssize_t put = write(file, at, bytes);
        if (put <= 0) return -1;
        at += put, bytes -= (size_t)put;
    }
    return 0;
}

/* The declaration of a controller of that name and version, which wants so many doubles of memory. */
static inline void surgsim_declare(surgsim_declaration *d, const char *name, const char *release,
                                   int64_t memory) {
    memset(d, 0, sizeof *d);
    d->magic = SURGSIM_DECLARATION, d->version = SURGSIM_VERSION, d->hash = SURGSIM_HASH, d->memory = memory;
    strncpy(d->name, name, sizeof d->name - 1);
    strncpy(d->release, release, sizeof d->release - 1);
}

typedef int64_t (*surgsim_function)(const surgsim_request *, double *memory, double *answer);

/* A process that answers with a function as above; `memory` is its own. Returns its exit status.
 * What the program prints goes to standard error: standard output belongs to the replies. */
static inline int surgsim_serve(const char *name, const char *release, surgsim_function f, double *memory,
                                size_t doubles) {
    int out = dup(1);
    surgsim_hello hello;
    surgsim_declaration declaration;
    dup2(2, 1);
    if (surgsim_read(0, &hello, sizeof hello) || hello.magic != SURGSIM_HELLO) return 1;
    for (int64_t left = hello.text_bytes; left > 0;) {
        char text[4096];
        size_t count = left < (int64_t)sizeof text ? (size_t)left : sizeof text;
        if (surgsim_read(0, text, count)) return 1;
        left -= (int64_t)count;
    }
    surgsim_declare(&declaration, name, release, 0);
    if (surgsim_write(out, &declaration, sizeof declaration)) return 1;
    for (;;) {
        surgsim_request request;
        surgsim_reply reply = {SURGSIM_REPLY, 0, 0, {0}};
        if (surgsim_read(0, &request, sizeof request)) return 0; /* the run is over */
        if (request.first) memset(memory, 0, doubles * sizeof *memory);
        reply.tick = request.tick;
        reply.status = f(&request, memory, reply.answer);
        if (surgsim_write(out, &reply, sizeof reply)) return 0;
    }
}

#endif
