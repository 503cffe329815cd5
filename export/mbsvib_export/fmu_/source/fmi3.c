/* FMI 3.0, model exchange and co-simulation; what is the same as in 2.0 is called from there. */
#include "fmi.h"
#include "lti.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ANY (INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS | STEP | TERMINATED)
#define READ (INITIALIZATION | EVENT | CONTINUOUS | STEP | UPDATE | TERMINATED)
#define WRITE (INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS | STEP | UPDATE)
#define ENTER(modes) Instance *s = c; if (!allowed(s, modes, __func__)) return FAULT
#define RETURN(wrong) do { const char *w = (wrong); return w ? (fail(s, __func__, w), FAULT) : OK; } while (0)
#define COUNTS "the number of values is another than that of the variables"

typedef union { void *object; LogMessage log; IntermediateUpdate update; } Pointer;

static void log_3(Instance *s, const char *text)
{
    Pointer pointer = {.object = s->log};
    if (pointer.log) pointer.log(s->environment, FAULT, "logStatusError", text);
}

static Instance *make(const char *name, const char *token, const char *folder, void *environment, LogMessage log)
{
    const char *wrong;
    Instance *s = instance_new(folder, token, name, &wrong);
    Pointer pointer = {.log = log};
    if (s) { s->environment = environment; s->log = pointer.object; s->logger = log_3; }
    else if (log) log(environment, FAULT, "logStatusError", wrong);
    return s;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT Status fmi3SetDebugLogging(void *c, bool on, size_t count, const char *const categories[])
{
    (void)on; (void)count; (void)categories;
    return c ? OK : FAULT;
}

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *folder, bool visible, bool logging,
                                          void *environment, LogMessage log)
{
    (void)visible; (void)logging;
    return make(name, token, folder, environment, log);
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *folder, bool visible, bool logging,
                                         bool event_mode, bool early_return, const uint32_t intermediate[], size_t count,
                                         void *environment, LogMessage log, IntermediateUpdate update)
{
    Instance *s = make(name, token, folder, environment, log);
    Pointer pointer = {.update = update};
    (void)visible; (void)logging; (void)intermediate; (void)count;
    if (s) { s->cosimulation = 1; s->event_mode = event_mode; s->early_return = early_return; s->update = pointer.object; }
    return s;
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *folder, bool visible,
    bool logging, void *environment, LogMessage log, void (*clock)(void *), void (*lock)(void), void (*unlock)(void))
{
    (void)name; (void)token; (void)folder; (void)visible; (void)logging; (void)clock; (void)lock; (void)unlock;
    if (log) log(environment, FAULT, "logStatusError", "fmi3InstantiateScheduledExecution: not supported");
    return NULL;
}

EXPORT void fmi3FreeInstance(void *c) { instance_free(c); }

EXPORT Status fmi3EnterInitializationMode(void *c, bool tolerant, double tolerance, double start, bool stops, double stop)
{
    ENTER(INSTANTIATED);
    (void)tolerant; (void)tolerance; (void)stops; (void)stop;
    if (!isfinite(start)) RETURN("the start time is not finite");
    s->t = start;
    s->mode = INITIALIZATION;
    return OK;
}

EXPORT Status fmi3ExitInitializationMode(void *c)
{
    ENTER(INITIALIZATION);
    const char *wrong = refresh(s);
    if (!wrong) s->mode = s->cosimulation && !s->event_mode ? STEP : EVENT;
    RETURN(wrong);
}

EXPORT Status fmi3EnterEventMode(void *c)
{
    ENTER(CONTINUOUS | EVENT | STEP);
    if (s->cosimulation && !s->event_mode) RETURN("the instance was made without event mode");
    s->mode = EVENT;
    return OK;
}

EXPORT Status fmi3Terminate(void *c) { ENTER(EVENT | CONTINUOUS | STEP); s->mode = TERMINATED; return OK; }
EXPORT Status fmi3Reset(void *c) { ENTER(ANY); instance_reset(s); return OK; }
EXPORT Status fmi3EnterConfigurationMode(void *c) { ENTER(0); return OK; }      /* no structural parameters */
EXPORT Status fmi3ExitConfigurationMode(void *c) { ENTER(0); return OK; }

EXPORT Status fmi3GetFloat64(void *c, const uint32_t vr[], size_t count, double v[], size_t values)
{
    ENTER(READ);
    RETURN(values == count ? get_values(s, vr, count, v) : COUNTS);
}

EXPORT Status fmi3SetFloat64(void *c, const uint32_t vr[], size_t count, const double v[], size_t values)
{
    ENTER(WRITE);
    RETURN(values == count ? set_values(s, vr, count, v) : COUNTS);
}

/* there are no variables of the other types */
#define NONE "all variables are of type Float64"
#define NONE_OF(NAME, TYPE) \
    EXPORT Status fmi3Get##NAME(void *c, const uint32_t vr[], size_t count, TYPE v[], size_t values) \
    { ENTER(READ); (void)vr; (void)v; (void)values; RETURN(count ? NONE : NULL); } \
    EXPORT Status fmi3Set##NAME(void *c, const uint32_t vr[], size_t count, const TYPE v[], size_t values) \
    { ENTER(WRITE); (void)vr; (void)v; (void)values; RETURN(count ? NONE : NULL); }
typedef const char *Text;
typedef const uint8_t *Bytes;
NONE_OF(Float32, float)
NONE_OF(Int8, int8_t)
NONE_OF(UInt8, uint8_t)
NONE_OF(Int16, int16_t)
NONE_OF(UInt16, uint16_t)
NONE_OF(Int32, int32_t)
NONE_OF(UInt32, uint32_t)
NONE_OF(Int64, int64_t)
NONE_OF(UInt64, uint64_t)
NONE_OF(Boolean, bool)
NONE_OF(String, Text)
#define REFUSED(NAME, ...) EXPORT Status fmi3##NAME(void *c, const uint32_t vr[], size_t count, __VA_ARGS__)
#define REFUSE { ENTER(WRITE | READ); (void)vr; RETURN(count ? NONE : NULL); }
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
REFUSED(GetBinary, size_t sizes[], Bytes v[], size_t values) REFUSE
REFUSED(SetBinary, const size_t sizes[], const Bytes v[], size_t values) REFUSE
REFUSED(GetClock, bool v[]) REFUSE
REFUSED(SetClock, const bool v[]) REFUSE
REFUSED(GetIntervalDecimal, double v[], IntervalQualifier q[]) REFUSE
REFUSED(GetIntervalFraction, uint64_t counters[], uint64_t resolutions[], IntervalQualifier q[]) REFUSE
REFUSED(GetShiftDecimal, double v[]) REFUSE
REFUSED(GetShiftFraction, uint64_t counters[], uint64_t resolutions[]) REFUSE
REFUSED(SetIntervalDecimal, const double v[]) REFUSE
REFUSED(SetIntervalFraction, const uint64_t counters[], const uint64_t resolutions[]) REFUSE
REFUSED(SetShiftDecimal, const double v[]) REFUSE
REFUSED(SetShiftFraction, const uint64_t counters[], const uint64_t resolutions[]) REFUSE
EXPORT Status fmi3ActivateModelPartition(void *c, uint32_t clock, double time) { ENTER(0); return OK; }
#pragma GCC diagnostic pop

/* dependencies never change: they are those of modelDescription.xml */
EXPORT Status fmi3GetNumberOfVariableDependencies(void *c, uint32_t reference, size_t *count)
{
    ENTER(ANY);
    (void)reference; (void)count;
    RETURN("dependencies are those of modelDescription.xml");
}

EXPORT Status fmi3GetVariableDependencies(void *c, uint32_t dependent, size_t rows[], uint32_t independents[], size_t columns[],
                                          DependencyKind kinds[], size_t count)
{
    ENTER(ANY);
    (void)dependent; (void)rows; (void)independents; (void)columns; (void)kinds; (void)count;
    RETURN("dependencies are those of modelDescription.xml");
}

Status fmi2GetFMUstate(void *, void **), fmi2SetFMUstate(void *, void *), fmi2FreeFMUstate(void *, void **);
Status fmi2SerializedFMUstateSize(void *, void *, size_t *), fmi2SerializeFMUstate(void *, void *, char[], size_t);
Status fmi2DeSerializeFMUstate(void *, const char[], size_t, void **), fmi2SetTime(void *, double);
Status fmi2SetContinuousStates(void *, const double[], size_t), fmi2GetDerivatives(void *, double[], size_t);
Status fmi2GetContinuousStates(void *, double[], size_t), fmi2GetNominalsOfContinuousStates(void *, double[], size_t);
Status fmi2GetEventIndicators(void *, double[], size_t);
EXPORT Status fmi3GetFMUState(void *c, void **state) { return fmi2GetFMUstate(c, state); }
EXPORT Status fmi3SetFMUState(void *c, void *state) { return fmi2SetFMUstate(c, state); }
EXPORT Status fmi3FreeFMUState(void *c, void **state) { return fmi2FreeFMUstate(c, state); }
EXPORT Status fmi3SerializedFMUStateSize(void *c, void *state, size_t *size) { return fmi2SerializedFMUstateSize(c, state, size); }
EXPORT Status fmi3SerializeFMUState(void *c, void *state, uint8_t v[], size_t size) { return fmi2SerializeFMUstate(c, state, (char *)v, size); }
EXPORT Status fmi3DeserializeFMUState(void *c, const uint8_t v[], size_t size, void **state) { return fmi2DeSerializeFMUstate(c, (const char *)v, size, state); }

EXPORT Status fmi3GetDirectionalDerivative(void *c, const uint32_t unknowns[], size_t nu, const uint32_t knowns[], size_t nk,
                                           const double seed[], size_t seeds, double result[], size_t results)
{
    ENTER(READ);
    RETURN(seeds == nk && results == nu ? directional(s, unknowns, nu, knowns, nk, seed, result) : COUNTS);
}

EXPORT Status fmi3GetAdjointDerivative(void *c, const uint32_t unknowns[], size_t nu, const uint32_t knowns[], size_t nk,
                                       const double seed[], size_t seeds, double result[], size_t results)
{
    ENTER(READ);
    RETURN(seeds == nu && results == nk ? adjoint(s, unknowns, nu, knowns, nk, seed, result) : COUNTS);
}

EXPORT Status fmi3EvaluateDiscreteStates(void *c) { ENTER(INITIALIZATION | EVENT); return OK; }

EXPORT Status fmi3UpdateDiscreteStates(void *c, bool *again, bool *stop, bool *nominals, bool *states, bool *next, double *time)
{
    ENTER(EVENT);
    ANSWER(again, false); ANSWER(stop, false); ANSWER(nominals, false); ANSWER(states, false); ANSWER(next, false); ANSWER(time, 0);
    return OK;
}

/* Model exchange */
EXPORT Status fmi3EnterContinuousTimeMode(void *c)
{
    ENTER(EVENT);
    if (s->cosimulation) RETURN("the instance is one of co-simulation");
    s->mode = CONTINUOUS;
    return OK;
}

EXPORT Status fmi3CompletedIntegratorStep(void *c, bool final, bool *event, bool *stop)
{
    ENTER(CONTINUOUS);
    (void)final;
    ANSWER(event, false); ANSWER(stop, false);
    return OK;
}

EXPORT Status fmi3SetTime(void *c, double time) { return fmi2SetTime(c, time); }
EXPORT Status fmi3SetContinuousStates(void *c, const double x[], size_t count) { return fmi2SetContinuousStates(c, x, count); }
EXPORT Status fmi3GetContinuousStateDerivatives(void *c, double dx[], size_t count) { return fmi2GetDerivatives(c, dx, count); }
EXPORT Status fmi3GetEventIndicators(void *c, double v[], size_t count) { return fmi2GetEventIndicators(c, v, count); }
EXPORT Status fmi3GetContinuousStates(void *c, double x[], size_t count) { return fmi2GetContinuousStates(c, x, count); }
EXPORT Status fmi3GetNominalsOfContinuousStates(void *c, double x[], size_t count) { return fmi2GetNominalsOfContinuousStates(c, x, count); }
EXPORT Status fmi3GetNumberOfEventIndicators(void *c, size_t *count) { ENTER(ANY); ANSWER(count, 0); return OK; }
EXPORT Status fmi3GetNumberOfContinuousStates(void *c, size_t *count) { ENTER(ANY); ANSWER(count, (size_t)s->model.n); return OK; }

/* Co-simulation */
EXPORT Status fmi3EnterStepMode(void *c)
{
    ENTER(EVENT);
    if (!s->cosimulation) RETURN("the instance is one of model exchange");
    s->mode = STEP;
    return OK;
}

EXPORT Status fmi3GetOutputDerivatives(void *c, const uint32_t vr[], size_t count, const int32_t order[], double v[], size_t values)
{
    ENTER(STEP | UPDATE | TERMINATED);
    RETURN(values == count ? output_slopes(s, vr, order, count, v) : COUNTS);
}

/* The importer is asked for the inputs at the end of the step, so that the step is exact for inputs that are linear in
 * time; it may shorten the step then. */
static double ask_for_slopes(Instance *s, IntermediateUpdate update, double t, double h, bool *early)
{
    int64_t m = s->model.m;
    bool requested = false;
    double end = t + h;
    memcpy(s->wu, s->u, (size_t)m * sizeof(double));
    s->t = t + h;
    s->mode = UPDATE;
    update(s->environment, t + h, true, false, false, s->early_return, &requested, &end);
    s->mode = STEP;
    s->t = t;
    for (int64_t j = 0; j < m; j++) s->slope[j] = (s->u[j] - s->wu[j]) / h;
    memcpy(s->u, s->wu, (size_t)m * sizeof(double));
    *early = requested && s->early_return && end > t && end < t + h;
    return *early ? end - t : h;
}

EXPORT Status fmi3DoStep(void *c, double t, double h, bool final, bool *event, bool *stop, bool *early, double *last)
{
    ENTER(STEP);
    bool shortened = false;
    Pointer pointer = {.object = s->update};
    (void)final;
    ANSWER(event, false); ANSWER(stop, false); ANSWER(early, false); ANSWER(last, s->t);
    if (!isfinite(t) || !(h > 0) || !isfinite(h)) RETURN("the step is not positive, or not finite");
    s->t = t;
    memset(s->slope, 0, (size_t)s->model.m * sizeof(double));
    if (pointer.update) h = ask_for_slopes(s, pointer.update, t, h, &shortened);
    const char *wrong = advance(s, h, pointer.update != NULL);
    if (wrong) RETURN(wrong);
    s->t = t + h;
    ANSWER(early, shortened); ANSWER(last, s->t);
    if (pointer.update) {
        bool ignored = false;
        double time = s->t;
        s->mode = UPDATE;
        pointer.update(s->environment, s->t, false, true, true, false, &ignored, &time);
        s->mode = STEP;
    }
    return OK;
}
