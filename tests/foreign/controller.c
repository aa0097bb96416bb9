/* A controller as an FMU, strict: only inputs can be set. Options of the compiler make it misbehave:
   -DSAY         prints to stdout at the start and while it steps
   -DFOLDER      changes the working folder, at the start and in a step
   -DHANG=n      hangs in step n, and creates the file in the environment variable HANGS
   -DDEAF        ignores signals from the first step on
   -DSTEPS       refuses steps and times that are not those that it has added up, has multiplied or expects, within DBL_EPSILON
   -DOWN_STEPS   makes steps of its own while they end within DBL_EPSILON of the end of a step; refuses to make another number than one */
#define _GNU_SOURCE
#include <complex.h>
#include <float.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>
enum { RESPONSE, REFERENCE, ACTIVE, OMEGA, E, PHASE_ERROR, EXTRA, VARIABLES };
typedef struct { double x[VARIABLES], theta, integral, first, sum; double complex response, base; long count, own; } Loop;
static void sample(Loop *s, double step) {
    const double start = 55.39, bandwidth = 5.539, kp = 1.742, ki = 1.353, amplitude = 92.46e-6;
    double complex turn = cexp(I * s->theta);
    s->response += 2 * bandwidth * step * (s->x[RESPONSE] - creal(s->response * turn)) / turn;
    s->base += 2 * bandwidth * step * (s->x[REFERENCE] - creal(s->base * turn)) / turn;
    double error = 0;
    if (cabs(s->base) > 0.5 * amplitude && cabs(s->response) > 1e-5) error = carg(s->response / s->base * I);
    s->integral += ki * error * step;
    s->x[OMEGA] = fmin(fmax(start + kp * error + s->integral, 0.9 * start), 1.1 * start);
    s->x[E] = s->x[ACTIVE] ? amplitude : 0;
    s->x[PHASE_ERROR] = error;
    s->theta = fmod(s->theta + s->x[OMEGA] * step, 2 * M_PI);
}
typedef int Status;
typedef const unsigned *References;
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *n, int t, const char *g, const char *f, const void *c, int v, int l) {
#ifdef SAY
    printf("Controller of lab 3: licence found, 12 days left\n");
    fflush(stdout);
#endif
#ifdef FOLDER
    if (chdir("/")) return NULL;
#endif
    return calloc(1, sizeof(Loop));
}
void fmi2FreeInstance(void *s) { free(s); }
Status fmi2SetupExperiment(void *s, int a, double b, double c, int d, double e) { return 0; }
Status fmi2EnterInitializationMode(void *s) { return 0; }
Status fmi2ExitInitializationMode(void *s) { return 0; }
Status fmi2Terminate(void *s) { return 0; }
static Status set(Loop *s, unsigned r, double v) { if (r > ACTIVE) return 3; s->x[r] = v; return 0; }
Status fmi2SetReal(void *s, References r, size_t n, const double *v) { while (n--) if (set(s, r[n], v[n])) return 3; return 0; }
Status fmi2SetBoolean(void *s, References r, size_t n, const int *v) { while (n--) if (set(s, r[n], v[n])) return 3; return 0; }
Status fmi2GetReal(void *s, References r, size_t n, double *v) { while (n--) v[n] = ((Loop *)s)->x[r[n]]; return 0; }
Status fmi2GetBoolean(void *s, References r, size_t n, int *v) { while (n--) v[n] = ((Loop *)s)->x[r[n]] != 0; return 0; }
#ifdef HANG
/* Waits until the program catches the signals again that an FMU has ignored. */
static void wait_for_handlers(void) {
    struct sigaction interrupt, terminate;
    do {
        usleep(1000);
        sigaction(SIGINT, NULL, &interrupt);
        sigaction(SIGTERM, NULL, &terminate);
    } while (interrupt.sa_handler == SIG_IGN || terminate.sa_handler == SIG_IGN);
}
#endif
Status fmi2DoStep(void *instance, double time, double step, int no) {
    Loop *s = instance;
#ifdef DEAF
    signal(SIGINT, SIG_IGN);
    signal(SIGTERM, SIG_IGN);
#endif
#ifdef SAY
    if (s->count % 10000 == 0) { printf("t = %g\n", time); fflush(stdout); }
#endif
#ifdef FOLDER
    if (s->count == 100 && chdir("/")) return 3;
#endif
#ifdef HANG
    if (s->count == HANG) {
        wait_for_handlers();
        fclose(fopen(getenv("HANGS"), "w"));
        for (;;) pause();
    }
#endif
    if (s->count == 0) s->first = step;
#ifdef STEPS
    if (fabs(step - s->first) > 0 || fabs(time - s->sum) > DBL_EPSILON || fabs(time - s->count * step) > DBL_EPSILON) return 3;
#endif
#ifdef OWN_STEPS
    long made = 0;
    while ((s->own + 1) * s->first <= time + step + DBL_EPSILON) { s->own++; made++; }
    if (made != 1) return 3;
#endif
    s->sum += step;
    s->count++;
    sample(s, step);
    return 0;
}
