$banner
 */

#include "${prefix}.h"

#define COLUMNS (${upper}_STATES + ${upper}_INPUTS)

/* Nonzero entries of [A B] and [C D]; those of row r stand at start[r] ... start[r + 1] - 1. */
$arrays

/* States, then inputs. */
static void join(const ${prefix}_state *state, const $real u[], $real all[])
{
    int i;

    for (i = 0; i < ${upper}_STATES; i++) {
        all[i] = state->x[i];
    }
    for (i = 0; i < ${upper}_INPUTS; i++) {
        all[${upper}_STATES + i] = u[i];
    }
}

static void multiply(int rows, const int start[], const int column[], const $real value[], const $real all[],
                     $real result[])
{
    $real sum;
    int r, k;

    for (r = 0; r < rows; r++) {
        sum = $zero;
        for (k = start[r]; k < start[r + 1]; k++) {
            sum += value[k] * all[column[k]];
        }
        result[r] = sum;
    }
}

void ${prefix}_reset(${prefix}_state *state)
{
    int i;

    for (i = 0; i < ${upper}_STATES; i++) {
        state->x[i] = $zero;
    }
}

void ${prefix}_outputs(const ${prefix}_state *state, const $real u[], $real y[])
{
    $real all[COLUMNS];

    join(state, u, all);
    multiply(${upper}_OUTPUTS, output_start, output_column, output_value, all, y);
}

void ${prefix}_update(${prefix}_state *state, const $real u[])
{
    $real all[COLUMNS];

    join(state, u, all);
    multiply(${upper}_STATES, next_start, next_column, next_value, all, state->x);
}

void ${prefix}_step(${prefix}_state *state, const $real u[], $real y[])
{
    $real all[COLUMNS];

    join(state, u, all);
    multiply(${upper}_OUTPUTS, output_start, output_column, output_value, all, y);
    multiply(${upper}_STATES, next_start, next_column, next_value, all, state->x);
}
