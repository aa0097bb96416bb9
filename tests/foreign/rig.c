/* A linear oscillator on a moving base as an FMU, strict: only inputs can be set. It creates the file in the environment variable ZEROED when its
   drive becomes zero. -DHANG=n: it hangs in step n, and creates the file in HANGS. */
#define _GNU_SOURCE
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>
enum { OMEGA, E, V, BASE, Q1, VARIABLES };
typedef struct { double x[VARIABLES], q, dq, phase; long count; } Rig;
typedef int Status;
typedef const unsigned *References;
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *n, int t, const char *g, const char *f, const void *c, int v, int l) { return calloc(1, sizeof(Rig)); }
void fmi2FreeInstance(void *s) { free(s); }
Status fmi2SetupExperiment(void *s, int a, double b, double c, int d, double e) { return 0; }
Status fmi2EnterInitializationMode(void *s) { return 0; }
Status fmi2ExitInitializationMode(void *s) { return 0; }
Status fmi2Terminate(void *s) { return 0; }
static void create(const char *variable) {
    const char *path = getenv(variable);
    if (path) fclose(fopen(path, "w"));
}
Status fmi2SetReal(void *instance, References r, size_t n, const double *v) {
    Rig *s = instance;
    while (n--) {
        if (r[n] > E) return 3;
        if (r[n] == E && v[n] == 0 && s->x[E] != 0) create("ZEROED");
        s->x[r[n]] = v[n];
    }
    return 0;
}
Status fmi2GetReal(void *s, References r, size_t n, double *v) { while (n--) v[n] = ((Rig *)s)->x[r[n]]; return 0; }
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
    Rig *s = instance;
#ifdef HANG
    if (s->count == HANG) {
        wait_for_handlers();
        create("HANGS");
        for (;;) pause();
    }
#endif
    s->count++;
    const int steps = 20;
    const double d = step / steps, mass = 3.807, stiffness = 11680, damping = 2.53;
    for (int i = 0; i < steps; i++) {
        double e = s->x[E] * sin(s->phase), de = s->x[E] * s->x[OMEGA] * cos(s->phase);
        s->dq += d * (stiffness * (e - s->q) + damping * (de - s->dq)) / mass;
        s->q += d * s->dq;
        s->phase += d * s->x[OMEGA];
    }
    s->x[V] = s->x[Q1] = s->q;
    s->x[BASE] = s->x[E] * sin(s->phase);
    return 0;
}
