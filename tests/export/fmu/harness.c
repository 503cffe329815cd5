/* Hostile files and hostile calls, for sanitizers: harness FOLDER ROUNDS SEED, with a good model.lti in the folder.
 *
 * Every round changes the file a little or a lot (its checksum is put right most times, so that the reader goes on),
 * makes an instance of it if that is still possible, and calls functions of FMI in any order with any arguments that C
 * allows. Nothing is expected but that no memory is touched that is not ours. */
#include "fmi.h"
#include "lti.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SOME 6

void *fmi2Instantiate(const char *, Kind, const char *, const char *, const Callbacks *, int, int);
void *fmi3InstantiateCoSimulation(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *,
                                  size_t, void *, LogMessage, IntermediateUpdate);
void fmi2FreeInstance(void *), fmi3FreeInstance(void *);
Status fmi2SetupExperiment(void *, int, double, double, int, double), fmi2EnterInitializationMode(void *);
Status fmi2ExitInitializationMode(void *), fmi2Terminate(void *), fmi2Reset(void *), fmi2EnterEventMode(void *);
Status fmi2EnterContinuousTimeMode(void *), fmi2NewDiscreteStates(void *, EventInfo *), fmi2SetTime(void *, double);
Status fmi2GetReal(void *, const unsigned *, size_t, double *), fmi2SetReal(void *, const unsigned *, size_t, const double *);
Status fmi2DoStep(void *, double, double, int), fmi2GetFMUstate(void *, void **), fmi2SetFMUstate(void *, void *);
Status fmi2FreeFMUstate(void *, void **), fmi2SerializedFMUstateSize(void *, void *, size_t *);
Status fmi2SerializeFMUstate(void *, void *, char *, size_t), fmi2DeSerializeFMUstate(void *, const char *, size_t, void **);
Status fmi2GetDirectionalDerivative(void *, const unsigned *, size_t, const unsigned *, size_t, const double *, double *);
Status fmi2SetRealInputDerivatives(void *, const unsigned *, size_t, const int *, const double *);
Status fmi2GetRealOutputDerivatives(void *, const unsigned *, size_t, const int *, double *);
Status fmi2GetDerivatives(void *, double *, size_t), fmi2SetContinuousStates(void *, const double *, size_t);
Status fmi2GetNominalsOfContinuousStates(void *, double *, size_t), fmi2GetContinuousStates(void *, double *, size_t);
Status fmi3EnterInitializationMode(void *, bool, double, double, bool, double), fmi3ExitInitializationMode(void *);
Status fmi3GetAdjointDerivative(void *, const uint32_t *, size_t, const uint32_t *, size_t, const double *, size_t, double *, size_t);
Status fmi3DoStep(void *, double, double, bool, bool *, bool *, bool *, double *), fmi3EnterStepMode(void *);
Status fmi3SetFloat64(void *, const uint32_t *, size_t, const double *, size_t);

static uint64_t state;

static uint64_t any(uint64_t below)
{
    state ^= state << 13; state ^= state >> 7; state ^= state << 17;
    return state % below;
}

static double number(void)
{
    static const double odd[] = {0, -0.0, 1, -1, 1e-300, 1e300, -1e308, INFINITY, NAN, 1e-9};
    return any(3) ? odd[any(10)] : (double)any(2000) / 1000 - 1;
}

static void spoil(unsigned char *bytes, size_t length)
{
    static const int64_t sizes[] = {0, 1, -1, 2, 3, 7, 1000000, 1000001, INT64_MAX, INT64_MIN, INT64_MAX / 8, 1LL << 32};
    for (uint64_t left = 1 + any(4); left--;) {
        size_t place = any(3) ? any(length) : any(length < 400 ? length : 400);
        switch (any(4)) {
        case 0: bytes[place] ^= (unsigned char)(1 << any(8)); break;
        case 1: if (length >= 64) { int64_t v = sizes[any(12)]; memcpy(bytes + 16 + 8 * any(6), &v, 8); } break;
        case 2: if (length >= 144) { int64_t v = sizes[any(12)]; memcpy(bytes + 128 + any((length - 136) / 8) * 8, &v, 8); } break;
        default: if (length >= 144) { double v = number(); memcpy(bytes + 128 + any((length - 136) / 8) * 8, &v, 8); }
        }
    }
}

static void quiet(void *environment, const char *name, Status status, const char *category, const char *message, ...)
{
    (void)environment; (void)name; (void)status; (void)category; (void)message;
}

static void quiet_3(void *environment, Status status, const char *category, const char *message)
{
    (void)environment; (void)status; (void)category; (void)message;
}

static void *now;                      /* the instance that asks for inputs */

static void update(void *environment, double time, bool set, bool get, bool finished, bool can, bool *early, double *when)
{
    uint32_t vr[SOME]; double v[SOME];
    (void)environment; (void)get; (void)finished;
    for (int i = 0; i < SOME; i++) { vr[i] = (uint32_t)any(40); v[i] = number(); }
    if (set) fmi3SetFloat64(now, vr, 1 + any(SOME), v, 1 + any(SOME));
    if (can && any(2)) { *early = true; *when = any(2) ? time - 1e-4 : number(); }
}

static void calls(void *c, size_t n, int new)
{
    unsigned vr[SOME], other[SOME]; double v[SOME], w[SOME], *x = calloc(n + 2, sizeof *x); int order[SOME];
    void *saved = NULL; size_t size = 0; bool flag[3]; double last; EventInfo info;
    for (int round = 0; round < 60; round++) {
        size_t count = any(SOME + 1), more = any(SOME + 1);
        for (int i = 0; i < SOME; i++) {
            vr[i] = (unsigned)(any(8) ? any(60) : any(UINT32_MAX)); other[i] = (unsigned)any(60);
            v[i] = number(); w[i] = number(); order[i] = (int)any(3);
        }
        switch (any(24)) {
        case 0: new ? fmi3EnterInitializationMode(c, 0, 0, number(), 0, 0) : fmi2SetupExperiment(c, 0, 0, number(), 0, 0); break;
        case 1: case 2: fmi2EnterInitializationMode(c); break;
        case 3: case 4: new ? fmi3ExitInitializationMode(c) : fmi2ExitInitializationMode(c); break;
        case 5: if (!any(6)) fmi2Terminate(c); break;
        case 6: if (!any(6)) fmi2Reset(c); break;
        case 7: fmi2EnterEventMode(c); break;
        case 8: new ? fmi3EnterStepMode(c) : fmi2EnterContinuousTimeMode(c); break;
        case 9: fmi2NewDiscreteStates(c, any(4) ? &info : NULL); break;
        case 10: fmi2SetTime(c, number()); break;
        case 11: fmi2GetReal(c, vr, count, v); break;
        case 12: fmi2SetReal(c, vr, count, v); break;
        case 13: case 14: case 15:
            if (new) fmi3DoStep(c, any(2) ? 0.1 : number(), any(2) ? 1e-3 : number(), 0, flag, flag + 1, flag + 2, any(4) ? &last : NULL);
            else fmi2DoStep(c, any(2) ? 0.1 : number(), any(2) ? 1e-3 : number(), 0);
            break;
        case 16: fmi2GetFMUstate(c, &saved); break;
        case 17: if (any(2)) fmi2SetFMUstate(c, saved); else fmi2FreeFMUstate(c, &saved); break;
        case 18:
            if (saved && fmi2SerializedFMUstateSize(c, saved, &size) == OK) {
                unsigned char *bytes = malloc(size + 1); void *again = NULL;
                fmi2SerializeFMUstate(c, saved, (char *)bytes, any(2) ? size : any(size));
                if (any(2)) fmi2SerializeFMUstate(c, saved, (char *)bytes, size);
                if (size > 120 && any(2)) {
                    uint64_t sum; double bad = number();
                    memcpy(bytes + 80 + 8 * any((size - 88) / 8), &bad, 8);
                    sum = checksum(bytes + 16, size - 16);
                    memcpy(bytes + 8, &sum, 8);
                }
                if (fmi2DeSerializeFMUstate(c, (char *)bytes, any(3) ? size : any(size), &again) == OK) fmi2SetFMUstate(c, again);
                fmi2FreeFMUstate(c, &again);
                free(bytes);
            }
            break;
        case 19: fmi2GetDirectionalDerivative(c, vr, count, other, more, w, v); break;
        case 20: fmi3GetAdjointDerivative(c, vr, count, other, more, w, count, v, more); break;
        case 21: any(2) ? fmi2SetRealInputDerivatives(c, vr, count, order, v) : fmi2GetRealOutputDerivatives(c, vr, count, order, v); break;
        case 22: any(2) ? fmi2GetDerivatives(c, x, any(4) ? n : n + 1) : fmi2GetContinuousStates(c, x, any(4) ? n : n + 1); break;
        default: any(2) ? fmi2SetContinuousStates(c, x, any(4) ? n : n + 1) : fmi2GetNominalsOfContinuousStates(c, x, n);
        }
    }
    fmi2FreeFMUstate(c, &saved);
    free(saved);
    free(x);
}

int main(int argc, char **argv)
{
    char good[4400], folder[4200], bad[4400], token[65] = {0};
    if (argc != 4) return 2;
    snprintf(good, sizeof good, "%s/model.lti", argv[1]);
    snprintf(folder, sizeof folder, "%s/spoilt", argv[1]);
    snprintf(bad, sizeof bad, "%s/model.lti", folder);
    state = strtoull(argv[3], NULL, 10) * 2654435761u + 88172645463325252ull;
    FILE *file = fopen(good, "rb");
    if (!file) return 2;
    static unsigned char bytes[1 << 20], copy[1 << 20];
    size_t length = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    Callbacks callbacks = {.logger = quiet};
    long lived = 0, rounds = strtol(argv[2], NULL, 10);
    for (long round = 0; round < rounds; round++) {
        size_t kept = any(6) ? length : any(length + 1);
        memcpy(copy, bytes, length);
        if (any(8)) spoil(copy, kept ? kept : 1);
        if (kept > 16 && any(16)) { uint64_t sum = checksum(copy + 16, kept - 16); memcpy(copy + 8, &sum, 8); }
        if (kept >= 128) memcpy(token, copy + 64, 64);
        file = fopen(bad, "wb");
        if (!file || fwrite(copy, 1, kept, file) != kept) return 2;
        fclose(file);
        if (any(2)) {
            void *c = fmi2Instantiate("unit", (Kind)any(2), any(50) ? token : "", folder, any(9) ? &callbacks : NULL, 0, 0);
            if (c) { lived++; calls(c, (size_t)((Instance *)c)->model.n, 0); fmi2FreeInstance(c); }
        } else {
            void *c = fmi3InstantiateCoSimulation("unit", token, any(50) ? folder : "file:///%zz%4", 0, 0, any(2), any(2), NULL, 0, NULL,
                                                  any(2) ? quiet_3 : NULL, any(2) ? update : NULL);
            now = c;
            if (c) { lived++; calls(c, (size_t)((Instance *)c)->model.n, 1); fmi3FreeInstance(c); }
        }
    }
    printf("%ld of %ld files were taken\n", lived, rounds);
    return 0;
}
