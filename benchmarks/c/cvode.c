/*
 * CVODE (SUNDIALS 6 or newer) with right-hand side and root functions in C: Adams formulas with fixed-point iteration, because
 * the problem is not stiff. An impact is a root of the gap to a wall; the solver restarts after it. While the drive stays, the
 * solver steps past the communication points and interpolates there.
 *
 * Reads requests from standard input, numbers in text; benchmarks/python/cvode_c.py writes them:
 *   M k c m b r  q1 q1' q2 q2'  tolerance limit budget
 *   number of runs of equal steps, each: amplitude omega duration count
 *   number of checks, each: step after which the state is wanted, counted from 1
 * Answers a line each: `ok IMPACTS RUNS ns ... STATES q1 q1' q2 q2' ...` or `failed REASON`.
 */
#include <cvode/cvode.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <sundials/sundials_version.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <time.h>

#define MOST_IMPACTS_PER_STEP 5000
#define MOST_RUNS 1000
#define MOST_SOLVER_STEPS 100000
#define TAU 6.283185307179586476925

_Static_assert(sizeof(sunrealtype) == sizeof(double), "SUNDIALS must be built for double precision");

typedef struct {
    double M, k, c, m, b, r;
    double amplitude, omega;
    double phase; /* of the drive where the solver's time is 0, rad */
} Rig;

typedef struct {
    double amplitude, omega, duration;
    long count;
} Steps;

typedef struct {
    Rig rig;
    double start[4], tolerance, limit, budget;
    Steps *steps;
    long *checks;
    double *states;
    int parts, checked;
} Scene;

static char failure[200];

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int right_hand_side(sunrealtype t, N_Vector state, N_Vector rate, void *data) {
    const Rig *rig = data;
    const double *y = N_VGetArrayPointer(state);
    double *dy = N_VGetArrayPointer(rate);
    const double angle = rig->phase + rig->omega * t;
    const double e = rig->amplitude * sin(angle), de = rig->amplitude * rig->omega * cos(angle);
    dy[0] = y[1];
    dy[1] = (rig->k * (e - y[0]) + rig->c * (de - y[1])) / rig->M;
    dy[2] = y[3];
    dy[3] = 0.0;
    return 0;
}

static int gaps(sunrealtype t, N_Vector state, sunrealtype *gap, void *data) {
    const Rig *rig = data;
    const double *y = N_VGetArrayPointer(state);
    (void)t;
    gap[0] = rig->b - (y[0] - y[2]);
    gap[1] = rig->b + (y[0] - y[2]);
    return 0;
}

static void impact(const Rig *rig, double *y) {
    const double momentum = rig->M * y[1] + rig->m * y[3], separation = rig->r * (y[1] - y[3]);
    y[1] = (momentum - rig->m * separation) / (rig->M + rig->m);
    y[3] = y[1] + separation;
}

/* The solver at its own time `t`; its time 0 is the last restart. */
typedef struct {
    void *memory;
    N_Vector y;
    double t;
    long impacts;
} Solver;

static int restart(Solver *s, Rig *rig) {
    rig->phase = fmod(rig->phase + rig->omega * s->t, TAU);
    s->t = 0.0;
    return CVodeReInit(s->memory, 0.0, s->y);
}

/* One step that ends at the solver's time `end`; 0, or -1 with `failure` set. The drive may change there. */
static int step(Solver *s, Rig *rig, double end, int stop, double deadline) {
    int impacts = 0;
    for (;;) {
        if (stop) CVodeSetStopTime(s->memory, end);
        sunrealtype reached = s->t;
        const int flag = CVode(s->memory, end, s->y, &reached, CV_NORMAL);
        if (flag == CV_TOO_CLOSE) { /* An impact within rounding of the end. */
            double *y = N_VGetArrayPointer(s->y);
            y[0] += y[1] * (end - s->t);
            y[2] += y[3] * (end - s->t);
            s->t = end;
            return restart(s, rig);
        }
        if (flag < 0) {
            snprintf(failure, sizeof failure, "%s after %ld impacts", CVodeGetReturnFlagName(flag), s->impacts);
            return -1;
        }
        s->t = reached;
        if (flag != CV_ROOT_RETURN) return 0;
        impact(rig, N_VGetArrayPointer(s->y));
        s->impacts += 1;
        end -= s->t;
        if (restart(s, rig) < 0) {
            snprintf(failure, sizeof failure, "no restart after %ld impacts", s->impacts);
            return -1;
        }
        if (++impacts > MOST_IMPACTS_PER_STEP) {
            snprintf(failure, sizeof failure, "stalled after %ld impacts", s->impacts);
            return -1;
        }
        if (now() > deadline) {
            snprintf(failure, sizeof failure, "time limit");
            return -1;
        }
        if (end <= 0.0) return 0;
    }
}

/* All steps of the scene; 0, or -1 with `failure` set. */
static int follow(Scene *scene, Solver *s, double deadline) {
    Rig *rig = &scene->rig; /* The solver's functions read it. */
    long n = 0, total = 0;
    int next = 0;
    for (int part = 0; part < scene->parts; part++) total += scene->steps[part].count;
    for (int part = 0; part < scene->parts; part++) {
        const Steps *steps = &scene->steps[part];
        if (restart(s, rig) < 0) {
            snprintf(failure, sizeof failure, "no restart at a new drive");
            return -1;
        }
        rig->amplitude = steps->amplitude;
        rig->omega = steps->omega;
        for (long k = 1; k <= steps->count; k++) {
            if (step(s, rig, s->t + steps->duration, k == steps->count, deadline) < 0 || now() > deadline) {
                if (now() > deadline)
                    snprintf(failure, sizeof failure, "time limit: %.2f %% done after %g s", 100.0 * n / total, scene->limit);
                return -1;
            }
            n += 1;
            if (next < scene->checked && scene->checks[next] == n) {
                const double *y = N_VGetArrayPointer(s->y);
                for (int i = 0; i < 4; i++) scene->states[4 * next + i] = y[i];
                next += 1;
            }
        }
    }
    return 0;
}

/* Sets the solver up and times one run, ns; negative with `failure` set. */
static double run(Scene *scene, SUNContext context, long *impacts) {
    Solver s = {CVodeCreate(CV_ADAMS, context), N_VNew_Serial(4, context), 0.0, 0};
    double *y = N_VGetArrayPointer(s.y);
    for (int i = 0; i < 4; i++) y[i] = scene->start[i];
    SUNNonlinearSolver iteration = SUNNonlinSol_FixedPoint(s.y, 0, context);
    int directions[2] = {-1, -1};
    int failed = CVodeInit(s.memory, right_hand_side, 0.0, s.y) || CVodeSetUserData(s.memory, &scene->rig) ||
                 CVodeSStolerances(s.memory, scene->tolerance, scene->tolerance) ||
                 CVodeSetNonlinearSolver(s.memory, iteration) || CVodeRootInit(s.memory, 2, gaps) ||
                 CVodeSetRootDirection(s.memory, directions) || CVodeSetMaxNumSteps(s.memory, MOST_SOLVER_STEPS) ||
                 CVodeSetNoInactiveRootWarn(s.memory);
    if (failed) snprintf(failure, sizeof failure, "CVODE could not be set up");
    const double began = now();
    failed = failed || follow(scene, &s, began + scene->limit) < 0;
    const double ns = 1e9 * (now() - began);
    *impacts = s.impacts;
    CVodeFree(&s.memory);
    SUNNonlinSolFree(iteration);
    N_VDestroy(s.y);
    return failed ? -1.0 : ns;
}

static int number(double *x) { return scanf("%lf", x) == 1; }

static int read_scene(Scene *scene) {
    Rig *rig = &scene->rig;
    double *first[] = {&rig->M, &rig->k, &rig->c, &rig->m, &rig->b, &rig->r, scene->start, scene->start + 1,
                       scene->start + 2, scene->start + 3, &scene->tolerance, &scene->limit, &scene->budget};
    for (size_t n = 0; n < sizeof first / sizeof *first; n++)
        if (!number(first[n])) return 0;
    if (scanf("%d", &scene->parts) != 1) return 0;
    scene->steps = calloc((size_t)scene->parts, sizeof *scene->steps);
    for (int n = 0; n < scene->parts; n++) {
        Steps *s = &scene->steps[n];
        if (!number(&s->amplitude) || !number(&s->omega) || !number(&s->duration) || scanf("%ld", &s->count) != 1) return 0;
    }
    if (scanf("%d", &scene->checked) != 1) return 0;
    scene->checks = calloc((size_t)scene->checked, sizeof *scene->checks);
    scene->states = calloc(4 * (size_t)scene->checked, sizeof *scene->states);
    for (int n = 0; n < scene->checked; n++)
        if (scanf("%ld", &scene->checks[n]) != 1) return 0;
    return 1;
}

static void answer(Scene *scene, SUNContext context) {
    static double ns[MOST_RUNS];
    int runs = 0;
    long impacts = 0;
    const double began = now();
    while (runs == 0 || (runs < MOST_RUNS && now() - began < scene->budget)) {
        /* The rig that the solver's callbacks see is the scene's; each run begins with phase 0 and no drive. */
        scene->rig.phase = scene->rig.amplitude = scene->rig.omega = 0.0;
        ns[runs] = run(scene, context, &impacts);
        if (ns[runs] < 0.0) {
            printf("failed %s\n", failure);
            return;
        }
        runs += 1;
    }
    printf("ok %ld %d", impacts, runs);
    for (int n = 0; n < runs; n++) printf(" %.0f", ns[n]);
    printf(" %d", scene->checked);
    for (int n = 0; n < 4 * scene->checked; n++) printf(" %.17g", scene->states[n]);
    printf("\n");
}

int main(void) {
    SUNContext context;
#if SUNDIALS_VERSION_MAJOR >= 7
    if (SUNContext_Create(SUN_COMM_NULL, &context)) return 1;
#else
    if (SUNContext_Create(NULL, &context)) return 1;
#endif
    char version[40] = "";
    SUNDIALSGetVersion(version, sizeof version);
    printf("%s\n", version);
    fflush(stdout);
    Scene scene = {0};
    while (read_scene(&scene)) {
        answer(&scene, context);
        fflush(stdout);
        free(scene.steps);
        free(scene.checks);
        free(scene.states);
    }
    SUNContext_Free(&context);
    return 0;
}
