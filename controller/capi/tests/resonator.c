/* Locks a small resonator and prints what the controller puts out, bit by bit; the argument is the number of samples. */
#include "phase_lock.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static uint64_t bits(double x) {
    uint64_t word;
    memcpy(&word, &x, sizeof word);
    return word;
}

int main(int argc, char **argv) {
    const int samples = argc > 1 ? atoi(argv[1]) : 60000;
    const double omega_0 = 55.39, zeta = 0.005, amplitude = 1e-4;
    PhaseLockConfig config;
    phase_lock_config_for_resonance(&config, omega_0, amplitude);
    config.amplitude_max = (PhaseLockOptional){true, 4.0 * amplitude};
    config.response_max = (PhaseLockOptional){true, 0.1};
    config.omega_start = 0.98 * omega_0;

    char message[200];
    PhaseLockController controller;
    if (phase_lock_init(&controller, &config, message, sizeof message)) {
        fprintf(stderr, "%s\n", message);
        return 1;
    }

    PhaseLockOutput output = {0};
    double q = 0.0, v = 0.0;
    for (int n = 0; n < samples; n++) {
        PhaseLockInput input = {q, {true, output.drive}, true};
        if (n == 50000) {
            PhaseLockMove to = {0.5 * output.response_amplitude, 1.0, -0.5 * amplitude, 0.0, 0.0};
            if (phase_lock_hold_response(&controller, &to, message, sizeof message)) {
                fprintf(stderr, "%s\n", message);
                return 1;
            }
        }
        phase_lock_sample(&controller, &input, &output);
        const double h = config.sample_time;
        v += h * (omega_0 * omega_0 * (output.drive - q) - 2.0 * zeta * omega_0 * v);
        q += h * v;
        if (n % 500 == 499)
            printf("%d %016" PRIx64 " %016" PRIx64 " %016" PRIx64 " %d\n", n, bits(output.omega),
                   bits(output.amplitude), bits(output.phase_error.value), (int)output.state);
    }

    /* A copy is a controller of its own. */
    PhaseLockController copy = controller;
    PhaseLockInput lost = {NAN, {false, 0.0}, true};
    phase_lock_sample(&copy, &lost, &output);
    printf("%d %d\n", (int)output.state, (int)output.fault);

    config.omega_min = 2.0 * omega_0;
    printf("%d %s\n", phase_lock_init(&copy, &config, message, sizeof message), message);
    printf("%d\n", phase_lock_sample(NULL, &lost, &output));
    return 0;
}
