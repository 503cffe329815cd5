/* Saved states of an instance as bytes: a head that names the model, then time, mode, states, inputs, parameters. */
#include "lti.h"
#include <math.h>
#include <string.h>

#define MAGIC "MBSNAP02"
#define HEAD 88                        /* magic 8, checksum of the rest 8, token 64, mode 4, slope_set 4 */

static size_t numbers(const Instance *s)
{
    return (size_t)(1 + s->model.n + 2 * s->model.m + s->model.np);
}

size_t snapshot_size(const Instance *s) { return HEAD + numbers(s) * sizeof(double); }

void snapshot_write(const Instance *s, unsigned char *bytes)
{
    int32_t state[] = {s->mode, s->slope_set};
    uint64_t sum;
    memcpy(bytes, MAGIC, 8);
    memcpy(bytes + 16, s->model.token, 64);
    memcpy(bytes + 80, state, 8);
    memcpy(bytes + HEAD, &s->t, sizeof(double));
    memcpy(bytes + HEAD + sizeof(double), s->x, (numbers(s) - 1) * sizeof(double));   /* x, u, slope, par */
    sum = checksum(bytes + 16, snapshot_size(s) - 16);
    memcpy(bytes + 8, &sum, 8);
}

/* 0 or what is wrong with bytes from outside */
const char *snapshot_check(const Instance *s, const unsigned char *bytes, size_t length)
{
    uint64_t sum;
    int32_t state[2];
    double value;
    if (!bytes || length != snapshot_size(s)) return "the state is of another size";
    memcpy(&sum, bytes + 8, 8);
    if (memcmp(bytes, MAGIC, 8) || sum != checksum(bytes + 16, length - 16)) return "the state is damaged";
    if (memcmp(bytes + 16, s->model.token, 64)) return "the state is that of another model";
    memcpy(state, bytes + 80, 8);
    int modes = INSTANTIATED | INITIALIZATION | TERMINATED | EVENT | (s->cosimulation ? STEP : CONTINUOUS);
    if (state[0] <= 0 || (state[0] & (state[0] - 1)) || !(state[0] & modes)) return "the state is of no mode";
    if (state[1] != 0 && state[1] != 1) return "the state is damaged";
    for (size_t i = 0; i < numbers(s); i++) {
        memcpy(&value, bytes + HEAD + i * sizeof(double), sizeof value);
        if (!isfinite(value)) return "a number of the state is not finite";
    }
    return NULL;
}

void snapshot_read(Instance *s, const unsigned char *bytes)
{
    int32_t state[2];
    memcpy(state, bytes + 80, 8);
    s->mode = state[0];
    s->slope_set = state[1];
    memcpy(&s->t, bytes + HEAD, sizeof(double));
    memcpy(s->x, bytes + HEAD + sizeof(double), (numbers(s) - 1) * sizeof(double));
    s->dirty = 1;
}
