$banner
 */

#ifndef ${upper}_H
#define ${upper}_H

#ifdef __cplusplus
extern "C" {
#endif

#define ${upper}_STATES $states
#define ${upper}_INPUTS $inputs
#define ${upper}_OUTPUTS $outputs
#define ${upper}_STEP $step /* [s] */

/* Indices of inputs and outputs. */
$indices

typedef struct {
    $real x[${upper}_STATES ? ${upper}_STATES : 1];
} ${prefix}_state;

/* Set all states to zero. */
void ${prefix}_reset(${prefix}_state *state);

/* Outputs of this sample. */
void ${prefix}_outputs(const ${prefix}_state *state, const $real u[], $real y[]);

/* Go on to the next sample. */
void ${prefix}_update(${prefix}_state *state, const $real u[]);

/* Both: the outputs of this sample, then on to the next; u and y do not overlap. */
void ${prefix}_step(${prefix}_state *state, const $real u[], $real y[]);

#ifdef __cplusplus
}
#endif

#endif /* ${upper}_H */
