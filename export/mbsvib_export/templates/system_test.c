$banner
 * Compile: cc -std=c99 ${prefix}.c ${prefix}_test.c -o ${prefix}_test
 */

#include <stdio.h>

#include "${prefix}.h"

#define SAMPLES $samples

$test_inputs

$expected

/* Bound of the rounding of each output. */
$tolerance

int main(void)
{
    ${prefix}_state state;
    $real y[${upper}_OUTPUTS], error;
    int wrong = 0, k, i;

    ${prefix}_reset(&state);
    for (k = 0; k < SAMPLES; k++) {
        ${prefix}_step(&state, inputs[k], y);
        for (i = 0; i < ${upper}_OUTPUTS; i++) {
            error = y[i] - expected[k][i];
            if (!(error <= tolerance[i] && -error <= tolerance[i])) {
                printf("sample %d, output %d: %.17g, expected %.17g\n", k, i, (double)y[i], (double)expected[k][i]);
                wrong++;
            }
        }
    }
    printf("%s: %d of %d values differ\n", wrong ? "FAILED" : "passed", wrong, SAMPLES * ${upper}_OUTPUTS);
    return wrong != 0;
}
