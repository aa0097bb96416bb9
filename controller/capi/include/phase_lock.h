/* A phase-locked loop that drives a shaker to phase resonance and holds it there.
   Made by cbindgen from controller/capi/src; a test compares the two. Units: m, s, rad, rad/s.
   Every function returns 0 where it succeeds, 1 for a value that is refused, -1 for a NULL pointer. */

#ifndef PHASE_LOCK_H
#define PHASE_LOCK_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// State of the sequence.
typedef enum PhaseLockStage {
  // Not armed.
  PHASE_LOCK_STAGE_IDLE = 0,
  // The drive rises, the loop is open.
  PHASE_LOCK_STAGE_RAMPING = 1,
  // The loop is closed, and not yet locked.
  PHASE_LOCK_STAGE_ACQUIRING = 2,
  // Phase resonance is held.
  PHASE_LOCK_STAGE_LOCKED = 3,
  // The phase escaped; latched, the drive ramps down.
  PHASE_LOCK_STAGE_LOCK_LOST = 4,
  // Another fault; latched, the drive ramps down.
  PHASE_LOCK_STAGE_TRIPPED = 5,
  // Taken out of service: the drive is released.
  PHASE_LOCK_STAGE_SHUT_DOWN = 6,
} PhaseLockStage;

// Why the drive was taken away.
typedef enum PhaseLockFault {
  // It was not.
  PHASE_LOCK_FAULT_NONE = 0,
  // A sensor read no number, or one beyond all reason.
  PHASE_LOCK_FAULT_SENSOR = 1,
  // The response exceeded response_max.
  PHASE_LOCK_FAULT_RESPONSE_TOO_LARGE = 2,
  // No lock within acquire_timeout.
  PHASE_LOCK_FAULT_TIMED_OUT = 3,
  // The phase escaped, or the response was lost in noise.
  PHASE_LOCK_FAULT_LOCK_LOST = 4,
} PhaseLockFault;

// Everything that can be chosen; begin with phase_lock_config_for_resonance.
typedef struct PhaseLockConfig {
  // Time from sample to sample, s.
  double sample_time;
  // Frequency before the loop closes, rad/s.
  double omega_start;
  // Lowest frequency allowed, rad/s.
  double omega_min;
  // Highest frequency allowed, rad/s.
  double omega_max;
  // Largest rate of change of the frequency, rad/s^2; 0 for none.
  double omega_rate;
  // Drive amplitude wanted, m.
  double amplitude;
  // Largest drive amplitude allowed, m; 0 for none.
  double amplitude_max;
  // Time of a ramp of the drive from 0 to amplitude, s, also down after a fault; 0 to jump.
  double ramp_time;
  // Time of a ramp of the drive to 0 where active is taken away, s; 0 to switch off at once.
  double release_time;
  // Bandwidth of the control of the measured base amplitude, rad/s; 0 for none.
  double base_bandwidth;
  // Phase of the response relative to the reference that is sought, rad.
  double phase_target;
  // Bandwidth of the detector, rad/s: the tuning knob.
  double bandwidth;
  // Damping rate of the structure, rad/s; 0 where unknown.
  double damping_rate;
  // Delay from the drive to the sample of the sensor, s; used where no reference is connected.
  double delay;
  // By how much a drive of 1 m makes the response grow in 1 s at phase resonance, 1/s.
  double response_gain;
  // Largest phase error that counts as locked, mean over a period, rad.
  double phase_tolerance;
  // Phase error at which a lock is lost, mean over a period, rad.
  double unlock_tolerance;
  // Largest relative drift of the frequency per period in a lock.
  double frequency_drift;
  // Largest relative drift of the response amplitude per period in a lock.
  double amplitude_drift;
  // Smallest share of the fundamental in the power of a signal that is believed, 0 to 1.
  double coherence_min;
  // Smallest response amplitude that is believed, as a multiple of amplitude.
  double response_min;
  // Reading of the response sensor above which the drive is taken away, m; 0 for none.
  double response_max;
  // Time allowed from the end of the ramp to the lock, s; 0 for ever.
  double acquire_timeout;
  // How long a lock must hold before it counts, periods.
  uint32_t dwell;
  // Harmonics of the adaptive filter, 1 to 8; 0 for a synchronous demodulator instead.
  uint8_t harmonics;
  // Harmonics 1, 3, 5, ... instead of 1, 2, 3, ...
  bool odd_only;
} PhaseLockConfig;

// Storage of a controller and its state, set up by phase_lock_init. To be copied, not looked into.
typedef struct PhaseLockController {
  // Opaque.
  uint64_t words[256];
} PhaseLockController;

// What the sensors read at a sample, and what the operator wants.
typedef struct PhaseLockInput {
  // Response of the structure, m.
  double response;
  // Displacement of the base, m.
  double reference;
  // Whether a sensor reads the base at all.
  bool has_reference;
  // Whether the drive is wanted. Going from false to true arms the controller, also after a fault.
  bool active;
} PhaseLockInput;

// What the controller wants until the next sample, and what it knows.
typedef struct PhaseLockOutput {
  // Drive frequency, rad/s.
  double omega;
  // Drive amplitude, m.
  double amplitude;
  // Base displacement wanted at this sample, m.
  double drive;
  // Phase of the response relative to the reference less the target, rad.
  double phase_error;
  // Amplitude of the response's fundamental, m.
  double response_amplitude;
  // Response amplitude that is held, m; 0 where the drive is.
  double response_target;
  // Amplitude of the reference's fundamental, m.
  double reference_amplitude;
  // Share of the fundamental in the power of the response, 0 to 1.
  double coherence;
  // Mean frequency over the running dwell, rad/s.
  double frequency;
  // Mean response amplitude over the running dwell, m.
  double response_mean;
  // State of the sequence.
  enum PhaseLockStage stage;
  // Why the drive was taken away.
  enum PhaseLockFault fault;
  // Phase resonance is held.
  bool locked;
  // Phase, frequency and amplitude have been stationary for the whole dwell.
  bool settled;
} PhaseLockOutput;

// A change of the amplitude at which the response is held.
typedef struct PhaseLockMove {
  // Response amplitude to go to, m.
  double response;
  // How long the way there takes, s.
  double duration;
  // Change of the drive amplitude that is expected, m; 0 where unknown.
  double amplitude;
  // Change of the frequency that is expected, rad/s; 0 where unknown.
  double omega;
} PhaseLockMove;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Fills in a sensible start for a structure that resonates near omega (rad/s) and a base of the given amplitude (m).
//
// # Safety
// config is NULL or may be written.
int phase_lock_config_for_resonance(struct PhaseLockConfig *config,
                                    double omega,
                                    double amplitude);

// Checks a configuration and sets up a controller before its first sample. Where a value is refused the reason is
// written to message (of that length in bytes, NULL for none), and the controller is left as it was.
//
// # Safety
// controller and message may be written, config may be read; each of them may be NULL.
int phase_lock_init(struct PhaseLockController *controller,
                    const struct PhaseLockConfig *config,
                    char *message,
                    size_t length);

// Takes what the sensors read now, puts out what the drive shall be until the next sample. To be called every sample_time.
//
// # Safety
// controller is NULL or was set up, input is NULL or may be read, output is NULL or may be written.
int phase_lock_sample(struct PhaseLockController *controller,
                      const struct PhaseLockInput *input,
                      struct PhaseLockOutput *output);

// Changes drive amplitude (m) and phase target (rad) between samples; the state goes on.
//
// # Safety
// As for phase_lock_init.
int phase_lock_retune(struct PhaseLockController *controller,
                      double amplitude,
                      double phase_target,
                      char *message,
                      size_t length);

// Holds the amplitude of the response from now on and moves it as stated; the drive does what it must, within its limits.
//
// # Safety
// As for phase_lock_init; to is NULL or may be read.
int phase_lock_hold_response(struct PhaseLockController *controller,
                             const struct PhaseLockMove *to,
                             char *message,
                             size_t length);

// Back to before the first sample, with the configuration as it is.
//
// # Safety
// controller is NULL or was set up.
int phase_lock_reset(struct PhaseLockController *controller);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PHASE_LOCK_H */
